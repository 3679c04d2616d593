"""The server of a study: pages, and a web socket for each participant."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from functools import cache
from importlib.resources import files
from typing import Any, Literal
from urllib.parse import urlsplit

import orjson
from jinja2 import Environment, PackageLoader
from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.requests import HTTPConnection, Request
from starlette.responses import HTMLResponse, RedirectResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.types import ASGIApp, Message as AsgiMessage, Receive, Scope, Send
from starlette.websockets import WebSocket, WebSocketDisconnect, WebSocketState

from ..agents.controllers.teleoperation import DEFAULT_MAPPINGS, DeviceMapping
from ..core.wording import described
from ..errors import Sonata2dError
from ..study.folder import StudyFolder
from ..study.participant import Participant
from .content import words_of
from .links import Links
from .messages import parse_message
from .seat import Seat

logger = logging.getLogger(__name__)

Takeover = Literal["newest", "first"]

# The stick on a touch screen works like a dragged mouse.
MAPPINGS = dict(DEFAULT_MAPPINGS) | {
    "touch": DeviceMapping(DEFAULT_MAPPINGS["mouse"].controls, DEFAULT_MAPPINGS["mouse"].dead_zone)
}
TAKEN_OVER, REFUSED, UNKNOWN, TOO_MANY_MISTAKES, FULL = 4001, 4002, 4003, 4004, 4005  # codes of closed web sockets
MAX_MISTAKES = 20  # messages of one connection that cannot be read
_IDLE = 900.0  # s without a message, after which a connection is closed
_STATIC = {"css": "text/css", "js": "text/javascript", "svg": "image/svg+xml"}
_HEADERS = {
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; connect-src 'self'; "
        "form-action 'self'; base-uri 'none'; frame-ancestors 'none'"
    ),
    "Referrer-Policy": "same-origin",
    "X-Content-Type-Options": "nosniff",
    "X-Robots-Tag": "noindex",
    "Permissions-Policy": "camera=(), microphone=(), geolocation=()",
}


class StudyServer:
    """Serves one study.

    Args:
        folder: of the study.
        links: its links.
        suffix: of episode files.
        takeover: which of two tabs with the same link may drive: the `newest`, or the `first` as long as it is open.
        max_connections: largest number of open web sockets.

    Attributes:
        app: the ASGI application.
        is_held: whether the researcher has stopped all runs for a while.
        seats: state of each participant who has connected since the start of the server, by id.
    """

    def __init__(
        self,
        folder: StudyFolder,
        links: Links,
        *,
        suffix: str = ".json",
        takeover: Takeover = "newest",
        max_connections: int = 200,
    ) -> None:
        self.folder, self.links = folder, links
        self._suffix, self._takeover, self._max_connections = suffix, takeover, max_connections
        self.is_held = False
        self.seats: dict[str, Seat] = {}
        self._sockets: dict[str, WebSocket] = {}
        self._locks: dict[str, asyncio.Lock] = {}
        self._open = 0
        self._words = words_of(folder.study)
        routes = [
            Route("/", self._front),
            Route("/static/{name}", self._static),
            Route("/s/{token}", self._study_page),
            Route("/j/{token}", self._join, methods=["GET", "POST"]),
            WebSocketRoute("/s/{token}/socket", self._socket),
        ]
        app = Starlette(routes=routes, lifespan=self._lifespan)
        app.state.server = self
        self.app: ASGIApp = _Guarded(app)

    @property
    def connected(self) -> list[str]:
        """Ids of the participants who have the page open."""
        return list(self._sockets)

    # Pages

    async def _front(self, request: Request) -> Response:
        return _page("front.html")

    async def _static(self, request: Request) -> Response:
        content = _static_file(str(request.path_params["name"]))
        if content is None:
            return _not_found()
        data, kind = content
        return Response(data, media_type=kind, headers={"Cache-Control": "no-cache"})

    async def _study_page(self, request: Request) -> Response:
        if self.links.participant_of(str(request.path_params["token"])) is None:
            return _not_found()
        study = self.folder.study
        data = {"words": self._words, "languages": study.config.languages, "title": study.config.title}
        return _page("study.html", language=study.config.languages[0], data=data)

    async def _join(self, request: Request) -> Response:
        """The open link: a page with a button first, because programs that preview links would become participants."""
        if not self.links.is_open(str(request.path_params["token"])):
            return _not_found()
        language = self.folder.study.config.languages[0]
        words = self._words[language]
        if request.method == "GET":
            return _page("join.html", language=language, words=words, title=self.folder.study.config.title)
        if not _is_same_origin(request):
            return Response("Forbidden", 403)
        if len(self.folder.participants) >= self.folder.study.config.participants:
            return _page("join.html", 403, language=language, words=words, title="", is_full=True)
        token = await run_in_threadpool(self.new_participant)
        return RedirectResponse(f"../s/{token}", 303, headers={"Cache-Control": "no-store"})

    def new_participant(self) -> str:
        """Add a participant with the next free id, such as `p001`; returns the token.

        Raises:
            RecordError: the folder cannot be written.
        """
        number = len(self.folder.participants) + 1
        while f"p{number:03d}" in self.folder.participants:
            number += 1
        id = f"p{number:03d}"
        self.folder.add(id)
        return self.links.add(id)

    # Participants

    async def _socket(self, socket: WebSocket) -> None:
        """A page of a participant: its messages are answered until it leaves."""
        id = self.links.participant_of(str(socket.path_params["token"]))
        if not _is_same_origin(socket):
            await socket.close(UNKNOWN)
            return
        await socket.accept()
        if id is None:
            await socket.close(UNKNOWN)
            return
        if self._open >= self._max_connections:
            await socket.close(FULL)
            return
        self._open += 1
        try:
            if not await self._take_place(id, socket):
                return
            async with self._locks.setdefault(id, asyncio.Lock()):  # the former page is answered to the end
                if self._sockets.get(id) is socket:
                    await self._serve(id, socket)
        finally:
            self._open -= 1
            if self._sockets.get(id) is socket:
                del self._sockets[id]

    async def _take_place(self, id: str, socket: WebSocket) -> bool:
        """Make a page the one of its participant; False if another one keeps the place."""
        former = self._sockets.get(id)
        if former is not None:
            if self._takeover == "first" and former.client_state is WebSocketState.CONNECTED:
                await socket.close(REFUSED)
                return False
            self._sockets[id] = socket
            with suppress(RuntimeError, WebSocketDisconnect):
                await former.close(TAKEN_OVER)
        self._sockets[id] = socket
        return True

    async def _serve(self, id: str, socket: WebSocket) -> None:
        """Answer the messages of a page until it leaves or another one takes its place."""
        try:
            seat = await self._seat_of(id)
        except Sonata2dError as error:
            logger.error("%s: %s", id, error)
            await _send(socket, {"type": "error", "problem": str(error)})
            await socket.close(1011)
            return
        mistakes = 0
        try:
            while self._sockets.get(id) is socket:
                data = await asyncio.wait_for(_received(socket), _IDLE)
                try:
                    message = parse_message(data)
                except ValueError as error:
                    mistakes += 1
                    await _send(socket, {"type": "error", "problem": str(error)})
                    if mistakes >= MAX_MISTAKES:
                        await socket.close(TOO_MANY_MISTAKES)
                        return
                    continue
                answer = await seat.answer(message)
                if answer is not None:
                    await _send(socket, answer)
        except (WebSocketDisconnect, TimeoutError, RuntimeError):
            pass  # the page was closed, or its connection is lost
        finally:
            with suppress(Sonata2dError):
                await seat.leave()

    async def _seat_of(self, id: str) -> Seat:
        """The state of a participant; it is created when the participant connects for the first time.

        Raises:
            Sonata2dError: a file of the participant is damaged, or in use by another program.
        """
        if id not in self.seats:
            participant = await run_in_threadpool(self._open_participant, id)
            self.seats[id] = Seat(participant, is_held=lambda: self.is_held)
        return self.seats[id]

    def _open_participant(self, id: str) -> Participant:
        return Participant(self.folder, id, mappings=MAPPINGS, suffix=self._suffix)

    @asynccontextmanager
    async def _lifespan(self, app: Starlette) -> AsyncIterator[None]:
        yield
        for seat in self.seats.values():
            try:
                await run_in_threadpool(seat.participant.close)
            except (Sonata2dError, OSError) as error:
                logger.error("%s: %s", seat.participant.id, error)


class _Guarded:
    """Adds headers to all answers, refuses bodies and long addresses, and turns unexpected errors into one line."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
            return
        has_begun = False

        async def send_with_headers(message: AsgiMessage) -> None:
            nonlocal has_begun
            if message["type"] == "http.response.start":
                has_begun = True
                names = {name.lower() for name, _ in message["headers"]}
                for name, value in _HEADERS.items():
                    if name.lower().encode() not in names:
                        message["headers"].append((name.lower().encode(), value.encode()))
            await send(message)

        try:
            await self._app(scope, receive, send_with_headers)
        except Exception as error:  # one participant's error must not show up in the pages of others, or in a traceback
            logger.error("%s %s: %s", scope.get("method", "socket"), _shown_path(scope), described(error))
            if scope["type"] == "http" and not has_begun:
                await Response("Internal error", 500)(scope, receive, send_with_headers)


def _shown_path(scope: Scope) -> str:
    """The path of a request without tokens, which must not be in a log."""
    return "/".join(part if k != 2 else "…" for k, part in enumerate(str(scope.get("path", "")).split("/")))[:80]


async def _received(socket: WebSocket) -> str | bytes:
    message = await socket.receive()
    if message["type"] == "websocket.disconnect":
        raise WebSocketDisconnect(message.get("code", 1000))
    text = message.get("text")
    return text if text is not None else message.get("bytes") or b""


async def _send(socket: WebSocket, answer: dict[str, Any]) -> None:
    await socket.send_text(orjson.dumps(answer, option=orjson.OPT_SERIALIZE_NUMPY).decode())


def _is_same_origin(connection: HTTPConnection) -> bool:
    """Whether a request comes from a page of this server; programs that are no browsers send no origin."""
    origin = connection.headers.get("origin")
    return origin is None or urlsplit(origin).netloc == connection.headers.get("host")


def _not_found() -> Response:
    return _page("unknown.html", 404)


def _page(name: str, status: int = 200, **values: Any) -> Response:
    return HTMLResponse(_templates().get_template(name).render(**values), status, headers={"Cache-Control": "no-store"})


@cache
def _templates() -> Environment:
    environment = Environment(loader=PackageLoader(__package__, "pages"), autoescape=True)
    environment.policies["json.dumps_kwargs"] = {"separators": (",", ":"), "allow_nan": False}
    return environment


@cache
def _static_file(name: str) -> tuple[bytes, str] | None:
    """A file of the page, and its type; None if there is none. Only names in the list are looked up."""
    known = {path.name: path for path in files(__package__).joinpath("static").iterdir() if path.is_file()}
    known["drawing.js"] = files("sonata2d.view").joinpath("drawing.js")
    kind = _STATIC.get(name.rpartition(".")[2])
    if name not in known or kind is None:
        return None
    return known[name].read_bytes(), kind
