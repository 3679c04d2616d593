"""Runs the server of a study until it is interrupted."""

from __future__ import annotations

import logging
import socket
from collections.abc import Callable
from contextlib import suppress
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

from ..errors import ConfigError, StudyError
from ..study.export import unfinished_exports
from ..study.folder import STUDY, StudyFolder
from ..study.links import Links
from .messages import MAX_MESSAGE
from .settings import MAX_IDLE_CONNECTIONS, ServerSettings

# Addresses at which a server listens in all networks, and an address in another network, reserved for documentation.
_ALL_NETWORKS = {"0.0.0.0": (socket.AF_INET, "192.0.2.1"), "::": (socket.AF_INET6, "2001:db8::1")}
_PING_S = 20.0  # between two pings of an idle connection

if TYPE_CHECKING:
    import uvicorn
    from starlette.types import ASGIApp


def serve(folder: StudyFolder, settings: ServerSettings, announce: Callable[[dict[str, str]], None]) -> None:
    """Serve a study until the program is interrupted.

    Args:
        folder: of the study; see `opened_folder`.
        settings: address, limits and participants.
        announce: called with the links by name as soon as connections are accepted.

    Raises:
        ConfigError: the address, or the id of a participant, cannot be used.
        RecordError: the folder cannot be written.
        SceneError: too many scenes in a row cannot be generated.
        KeyboardInterrupt: the program was interrupted before the links were announced.
        StudyError: the packages of the extra `serve` are not installed.
    """
    try:
        import uvicorn
        import websockets  # noqa: F401  uvicorn loads it only with the first web socket

        from .server import StudyServer
    except ImportError as error:
        raise StudyError(f"{error.name} is not installed: pip install 'sonata2d[serve]'") from error
    _check_url(settings.url)
    links = Links(folder.out / STUDY)
    server = StudyServer(folder, links, settings)
    for path in unfinished_exports(folder.out):
        path.unlink(missing_ok=True)
    for id in folder.present:
        links.add(id)  # a program may have ended after it added the participant, and before it added the link
    with _listener(settings.host, settings.port) as listener:
        folder.study.warm_up()  # may take half a minute, so after everything that can be refused
        for id in settings.ids:
            folder.add(id)
            links.add(id)
        while len(folder.present) < settings.participants:
            server.new_participant()
        host, port = listener.getsockname()[:2]
        host = _reachable(host)
        base = (settings.url or f"http://{f'[{host}]' if ':' in host else host}:{port}").rstrip("/")
        announce(
            {"researcher": f"{base}/r/{links.researcher}", "open link": f"{base}/j/{links.open}"}
            | {id: f"{base}/s/{token}" for id, token in links.tokens().items()}
        )
        with suppress(KeyboardInterrupt):  # uvicorn raises the signal that stopped it a second time
            uvicorn.Server(server_config(server.app, settings.connections)).run(sockets=[listener])


def server_config(app: ASGIApp, connections: int, **options: Any) -> uvicorn.Config:
    """The configuration of uvicorn for a study: limits of connections, messages and times.

    Args:
        app: of the study.
        connections: largest number of open pages.
        options: further ones of `uvicorn.Config`.
    """
    import uvicorn

    from .protocol import TimeoutProtocol, TimeoutSocket, without_traceback

    logging.getLogger("uvicorn.error").addFilter(without_traceback)
    settings: dict[str, Any] = {
        "log_config": None,
        "access_log": False,  # addresses hold tokens
        "server_header": False,
        "http": TimeoutProtocol,
        "ws": TimeoutSocket,
        "ws_max_size": MAX_MESSAGE,
        "ws_ping_interval": _PING_S,
        "ws_ping_timeout": _PING_S,
        "backlog": MAX_IDLE_CONNECTIONS,  # all waiting ones are accepted at once, and must not reach the limit
        "limit_concurrency": connections + 2 * MAX_IDLE_CONNECTIONS,  # open pages, idle connections, and requests
        "timeout_graceful_shutdown": 5,
    }
    return uvicorn.Config(app, **(settings | options))


def _check_url(url: str | None) -> None:
    """Require a complete address without a folder.

    Raises:
        ConfigError: it is not a complete address, or has a folder.
    """
    try:
        parts = urlsplit(url or "http://localhost")
    except ValueError as error:
        raise ConfigError(f"--url {url} is not an address: {error}") from None
    if parts.scheme not in ("http", "https") or not parts.netloc:
        raise ConfigError(f"--url {url} is not a complete address; write https://study.example.org")
    if parts.path.strip("/") or parts.query or parts.fragment:
        raise ConfigError(
            f"--url {url} leads into a folder; links are at the top of a host name: https://{parts.netloc}"
        )


def _reachable(host: str) -> str:
    """An address by which other machines reach this one, if the server listens at all of them."""
    if host not in _ALL_NETWORKS:
        return host
    family, elsewhere = _ALL_NETWORKS[host]
    with socket.socket(family, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect((elsewhere, 9))  # chooses a network, and sends nothing
        except OSError:
            return socket.gethostname()
        return str(probe.getsockname()[0])


def _listener(host: str, port: int) -> socket.socket:
    """A socket that listens at an address.

    Raises:
        ConfigError: the address cannot be used.
    """
    try:
        family, *_, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        is_dual = family == socket.AF_INET6 and socket.has_dualstack_ipv6()
        # From now on, connections wait until the server answers.
        return socket.create_server(address, family=family, dualstack_ipv6=is_dual)
    except OSError as error:
        raise ConfigError(
            f"{host}, port {port}, cannot be used: {error.strerror or error}; choose another --host or --port"
        ) from None
