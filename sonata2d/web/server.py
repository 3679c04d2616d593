"""The web server of a study: pages, and a web socket for each participant."""

from __future__ import annotations

import asyncio
import gzip
import logging
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping
from contextlib import asynccontextmanager, suppress
from functools import cache, partial
from hashlib import sha256
from types import MappingProxyType
from typing import Any, TypeVar
from urllib.parse import urlsplit

import orjson
from starlette.applications import Starlette
from starlette.background import BackgroundTask
from starlette.concurrency import run_in_threadpool
from starlette.requests import HTTPConnection, Request
from starlette.responses import FileResponse, HTMLResponse, RedirectResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.types import ASGIApp, Message as AsgiMessage, Receive, Scope, Send
from starlette.websockets import WebSocket, WebSocketDisconnect, WebSocketState

from ..agents.controllers.teleoperation import DEFAULT_MAPPINGS, DeviceMapping
from ..core.wording import described, one_line
from ..errors import Sonata2dError
from ..study.content import way_back
from ..study.export import temporary_export, write_archive
from ..study.folder import StudyFolder
from ..study.links import Links
from ..study.participant import Participant
from ..study.texts import Json, in_language
from .messages import FAILED, REFUSED, Message, parse_message
from .page_folder import read_page, static_files, templates
from .participant_session import ParticipantSession, preferred
from .researcher import Researcher
from .settings import ServerSettings

logger = logging.getLogger(__name__)

T = TypeVar("T")

# The stick on a touch screen works like a dragged mouse.
MAPPINGS = dict(DEFAULT_MAPPINGS) | {
    "touch": DeviceMapping(DEFAULT_MAPPINGS["mouse"].controls, DEFAULT_MAPPINGS["mouse"].dead_zone)
}
# Codes of closed web sockets; `connection.js` knows them.
_TAKEN_OVER, _OCCUPIED, _UNKNOWN, _TOO_MANY_MISTAKES, _FULL = range(4001, 4006)
_MAX_ID = 200  # characters of an id of a panel
_MAX_MISTAKES = 20  # messages of one connection that cannot be read
_AWAY_S, _SWEEP_S = 600.0, 60.0  # time without a page, after which a session is closed; time between two checks of it
_IDLE_S = 900.0  # time without a message, after which a connection is closed
_SEND_TIMEOUT_S = 30.0  # in which a page has to receive an answer
_NO_STORE = {"Cache-Control": "no-store"}
_STATIC = {"css": "text/css", "js": "text/javascript", "svg": "image/svg+xml"}
_PICTURES = {
    ".png": "image/png", ".jpg": "image/jpeg", ".jpeg": "image/jpeg", ".gif": "image/gif", ".webp": "image/webp",
    ".svg": "image/svg+xml",
}  # fmt: skip
_SIMULATOR = {"js": "text/javascript", "mjs": "text/javascript", "wasm": "application/wasm", "json": "application/json"}
# Python in the browser compiles WebAssembly and JavaScript; it gets nothing but files of this server.
_SIMULATOR_POLICY = "default-src 'none'; script-src 'self' 'unsafe-eval'; connect-src 'self'"
_PICTURE_POLICY = "default-src 'none'; style-src 'unsafe-inline'; sandbox"  # an SVG can have scripts
_HEADERS = {
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; connect-src 'self'; "
        "worker-src 'self'; "
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
        settings: limits and address.

    Attributes:
        app: the ASGI application.
        sessions: session of each participant who was connected lately, by id.
    """

    def __init__(self, folder: StudyFolder, links: Links, settings: ServerSettings) -> None:
        self.folder, self.links, self._settings = folder, links, settings
        self.sessions: dict[str, ParticipantSession] = {}
        self._pages: dict[str, _Connection] = {}  # open pages by id of the participant
        self._locks: dict[str, asyncio.Lock] = {}
        self._open = 0
        self._words, self._url = folder.study.tables, settings.url and settings.url.rstrip("/")
        self._requires = folder.study.config.requires.model_dump(exclude_defaults=True)
        self._public_host = urlsplit(self._url).netloc.lower() if self._url else None
        connected = self._pages.keys()
        self._researcher = Researcher(folder, links, self.sessions, connected, self.new_participant)
        self._has_warned = False
        self._simulator = read_page(settings.page) if settings.page else {}
        # A page keeps these files for a year: the address changes with them.
        self._simulator_place = f"/simulator/{_digest(self._simulator)}/" if self._simulator else None
        routes = [
            Route("/", self._front),
            Route("/static/{name}", self._static),
            Route("/pictures/{name}", self._picture),
            Route("/simulator/{digest}/{name:path}", self._simulator_file),
            Route("/s/{token}", self._study_page),
            Route("/j/{token}", self._join, methods=["GET", "POST"]),
            WebSocketRoute("/s/{token}/socket", self._socket),
            Route("/r/{token}", self._researcher_page),
            Route("/r/{token}/export.zip", self._export),
            WebSocketRoute("/r/{token}/socket", self._researcher_socket),
        ]
        app = Starlette(routes=routes, lifespan=self._lifespan, exception_handlers={404: self._unknown_address})
        self.app: ASGIApp = _Guarded(app)

    # Pages

    async def _front(self, request: Request) -> Response:
        return self._message(request, text="web.front")

    async def _unknown_address(self, request: Request, error: Exception) -> Response:
        return self._not_found(request)

    def _not_found(self, request: Request) -> Response:
        return self._message(request, 404, title="web.unknown_title", text="web.unknown")

    async def _static(self, request: Request) -> Response:
        name = str(request.path_params["name"])
        if name not in static_files():
            return self._not_found(request)
        media_type = _STATIC[name.rpartition(".")[2]]
        return Response(static_files()[name], media_type=media_type, headers={"Cache-Control": "no-cache"})

    async def _picture(self, request: Request) -> Response:
        """A picture in the texts of the study."""
        name = str(request.path_params["name"])
        path = self.folder.picture(name)
        if name not in {picture.name for picture in self.folder.study.pictures.values()} or not path.is_file():
            return self._not_found(request)
        headers = {"Cache-Control": "max-age=86400", "Content-Security-Policy": _PICTURE_POLICY}
        return FileResponse(path, media_type=_PICTURES[path.suffix], headers=headers)

    async def _simulator_file(self, request: Request) -> Response:
        """A file of the simulator that runs in the page."""
        name = str(request.path_params["name"])
        if request.url.path != f"{self._simulator_place}{name}" or name not in self._simulator:
            return self._not_found(request)
        media_type = _SIMULATOR.get(name.rpartition(".")[2], "application/octet-stream")
        headers = {"Cache-Control": "public, max-age=31536000, immutable", "Content-Security-Policy": _SIMULATOR_POLICY}
        headers["Vary"] = "Accept-Encoding"
        content = self._simulator[name]
        if "gzip" in request.headers.get("accept-encoding", "") and not name.endswith((".whl", ".zip")):
            content = await run_in_threadpool(_compressed, content)
            headers["Content-Encoding"] = "gzip"
        return Response(content, media_type=media_type, headers=headers)

    async def _study_page(self, request: Request) -> Response:
        if self.links.participant_of(str(request.path_params["token"])) is None:
            return self._not_found(request)
        config = self.folder.study.config
        data: Json = {"words": self._words, "languages": config.languages, "title": config.title}
        data["requires"] = self._requires
        data["simulator"] = self._simulator_place
        return _page("study.html", language=config.languages[0], title="sonata2d", script="page.js", data=data)

    async def _join(self, request: Request) -> Response:
        """The open link: first a page with a button, because programs that preview links must not add participants."""
        if not self.links.is_open(str(request.path_params["token"])):
            return self._not_found(request)
        if request.method == "GET":
            return self._message(request, button="web.begin")
        if not self._is_same_origin(request):
            return Response("Forbidden", 403)
        config, recruitment = self.folder.study.config, self.folder.study.config.recruitment
        names = () if recruitment is None else recruitment.ids
        ids = {name: request.query_params.get(name, "")[:_MAX_ID] for name in names}
        token = await run_in_threadpool(self.new_participant, config.participants, ids)
        if token is None:
            full = None if recruitment is None or recruitment.full is None else way_back(recruitment.full, ids)
            return self._message(request, 403, title="web.full_title", text="web.full_study", leave=full)
        return RedirectResponse(f"../s/{token}", 303, headers=_NO_STORE)

    def _message(
        self,
        request: Request,
        status: int = 200,
        *,
        title: str = "",
        text: str = "",
        button: str = "",
        leave: Json | None = None,
    ) -> Response:
        """A page with a title, a text and a button, named by their keys; by default with the title of the study."""
        config = self.folder.study.config
        wanted = (part.partition(";")[0] for part in request.headers.get("accept-language", "").split(","))
        language = preferred(config.languages, wanted)
        words = self._words[language]
        heading = words[title] if title else in_language(config.title, language)
        texts: Json = {"text": words.get(text), "button": words.get(button)}
        if button:
            texts |= {"script": "join.js", "data": {"requires": self._requires, "words": words}}
        if leave is not None:
            texts |= leave | {"back": words["web.leave"], "your_code": words["web.code"]}
        return _page("message.html", status, language=language, title=heading, **texts)

    def _is_same_origin(self, connection: HTTPConnection) -> bool:
        """Whether a request comes from a page of this server; programs other than browsers send no origin."""
        origin, host = connection.headers.get("origin"), connection.headers.get("host")
        if origin is None:
            return True
        try:
            site = urlsplit(origin).netloc
        except ValueError:  # such as of http://[
            site = ""
        if site and site in (host, self._public_host):
            return True
        if not self._has_warned:
            self._has_warned = True
            hint = "let the proxy in front of the server pass the Host header on, or start the server with --url"
            names = (one_line(name, 100) for name in (origin, host))
            logger.warning("a request of a page of %s to %s was refused: %s", *names, hint)
        return False

    def new_participant(self, limit: int | None = None, ids: Mapping[str, str] = MappingProxyType({})) -> str | None:
        """Add a participant with the next free id, such as `p001`; returns the token.

        Args:
            limit: largest number of participants; None is returned if there are as many.
            ids: that a panel gave; whoever comes again with the same first id gets the token of the first time.

        Raises:
            RecordError: the folder cannot be written.
        """
        id = self.folder.recruit(ids, self.links.tokens(), limit)
        return None if id is None else self.links.add(id)

    # Participants

    async def _socket(self, socket: WebSocket) -> None:
        """The web socket of a participant's page; its messages are answered until it leaves."""
        id = self.links.participant_of(str(socket.path_params["token"]))
        if not self._is_same_origin(socket):
            await socket.close(_UNKNOWN)
            return
        await socket.accept()
        # a page that reconnects may replace its own lost connection
        page = _Connection(socket, socket.query_params.get("page", "")[:40])
        if id is None:
            await page.close(_UNKNOWN)
            return
        if self._open >= self._settings.connections:
            await page.close(_FULL)
            return
        self._open += 1
        try:
            if not await self._take_place(id, page):
                return
            async with self._locks.setdefault(id, asyncio.Lock()):  # the former page is answered to the end
                if not page.is_replaced:
                    await self._serve(id, page)
            if page.is_replaced:  # its place was taken while it was not waiting for messages
                await page.close(_TAKEN_OVER)
        finally:
            self._open -= 1
            if self._pages.get(id) is page:
                del self._pages[id]

    async def _take_place(self, id: str, page: _Connection) -> bool:
        """Make a page the open page of its participant; False if another page remains it."""
        former = self._pages.get(id)
        if former is None:
            self._pages[id] = page
            return True
        is_other = not page.name or page.name != former.name
        if self._settings.takeover == "first" and is_other and former.socket.client_state is WebSocketState.CONNECTED:
            await page.close(_OCCUPIED)
            return False
        self._pages[id] = page
        await former.replace()
        return True

    async def _serve(self, id: str, page: _Connection) -> None:
        """Answer the messages of a page until it leaves or another one takes its place."""
        try:
            session = await self._session_of(id)
        except Sonata2dError as error:
            logger.error("%s: %s", id, error)
            await page.send({"type": "error", "problem": "the server cannot read its files", "problemKind": FAILED})
            await page.close(1011)
            return
        try:
            await page.converse(parse_message, session.answer)
        finally:
            with suppress(Sonata2dError):
                await session.leave()

    async def _close_idle_sessions(self) -> None:
        """Free the memory of participants who are away; their journals hold all that is needed to go on."""
        while True:
            await asyncio.sleep(_SWEEP_S)
            await self.close_sessions(_AWAY_S)

    async def close_sessions(self, seconds: float) -> None:
        """Close the sessions of participants whose page has been closed for a time, s."""
        for id, session in list(self.sessions.items()):
            lock = self._locks.setdefault(id, asyncio.Lock())
            if lock.locked() or session.idle < seconds:  # a page holds the lock as long as it is open
                continue
            async with lock:
                del self.sessions[id]
                await run_in_threadpool(self._close, session)
                self._researcher.forget()

    def _close(self, session: ParticipantSession) -> None:
        try:
            session.participant.close()
        except (Sonata2dError, OSError) as error:
            logger.error("%s: %s", session.participant.id, error)

    async def _session_of(self, id: str) -> ParticipantSession:
        """The session of a participant; it is created when the participant connects for the first time.

        Raises:
            Sonata2dError: a file of the participant is damaged, or in use by another program.
        """
        if id not in self.sessions:
            open_participant = partial(Participant, self.folder, id, mappings=MAPPINGS, suffix=self._settings.suffix)
            self.sessions[id] = ParticipantSession(
                await run_in_threadpool(open_participant),
                is_paused=lambda: self._researcher.is_paused,
                is_preview=self._settings.is_preview,
                predicts=bool(self._simulator),
            )
        return self.sessions[id]

    # The researcher

    async def _researcher_page(self, request: Request) -> Response:
        if not self.links.is_researcher(str(request.path_params["token"])):
            return self._not_found(request)
        config = self.folder.study.config
        language = config.languages[0]
        title, data = in_language(config.title, language), {"words": self._words[language], "url": self._url}
        return _page(
            "researcher.html", language=language, title=title, script="researcher.js", page="researcher", data=data
        )

    async def _researcher_socket(self, socket: WebSocket) -> None:
        if not self._is_same_origin(socket) or not self.links.is_researcher(str(socket.path_params["token"])):
            await socket.close(_UNKNOWN)
            return
        await socket.accept()
        await _Connection(socket).converse(partial(parse_message, of_researcher=True), self._researcher.answer)

    async def _export(self, request: Request) -> Response:
        """The export of the study as a ZIP file."""
        if not self.links.is_researcher(str(request.path_params["token"])):
            return self._not_found(request)
        file = temporary_export(self.folder.out)
        personal = request.query_params.get("personal") == "1"
        try:
            await run_in_threadpool(write_archive, self.folder.out, file, personal=personal)
        except Sonata2dError as error:
            return Response(str(error), 500, media_type="text/plain")
        name = f"{self.folder.out.resolve().name}{'-personal' if personal else ''}.zip"
        deletion = BackgroundTask(file.unlink, missing_ok=True)
        return FileResponse(file, filename=name, headers=_NO_STORE, background=deletion)

    @asynccontextmanager
    async def _lifespan(self, app: Starlette) -> AsyncIterator[None]:
        sweeping = asyncio.create_task(self._close_idle_sessions())
        try:
            yield
        except asyncio.CancelledError:  # a second Ctrl+C; open runs are in the journals
            return
        sweeping.cancel()
        for session in self.sessions.values():
            await run_in_threadpool(self._close, session)


class _Guarded:
    """Middleware that adds headers to all answers, and logs unexpected errors in one line."""

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
        except Exception as error:  # an error of one participant must not stop the server for others
            logger.error("%s %s: %s", scope.get("method", "socket"), _shown_path(scope), described(error))
            if scope["type"] == "http" and not has_begun:
                await Response("Internal error", 500)(scope, receive, send_with_headers)


def _shown_path(scope: Scope) -> str:
    """The path of a request without its token, which must not be logged."""
    return "/".join(part if k != 2 else "…" for k, part in enumerate(str(scope.get("path", "")).split("/")))[:80]


class _Connection:
    """The connection to an open page. Its messages are answered in order, one at a time.

    Args:
        socket: accepted.
        name: random name that the page chose.

    Attributes:
        is_replaced: whether another page has the place of this one.
    """

    def __init__(self, socket: WebSocket, name: str = "") -> None:
        self.socket, self.name, self.is_replaced = socket, name, False
        self._waiting: asyncio.Timeout | None = None

    async def converse(
        self, parse: Callable[[str | bytes], Message], answer: Callable[[Message], Awaitable[Json | None]]
    ) -> None:
        """Answer messages until the page leaves, does not read for a while, or is replaced."""
        mistakes = 0
        while not self.is_replaced:
            data = await self._within(_IDLE_S, _received(self.socket))
            if data is None:
                return
            try:
                message = parse(data)
            except ValueError as error:
                mistakes += 1
                reply: Json | None = {"type": "error", "problem": str(error), "problemKind": REFUSED}
            else:
                reply = await answer(message)
            if reply is not None and not await self.send(reply):
                return
            if mistakes >= _MAX_MISTAKES:
                await self.close(_TOO_MANY_MISTAKES)
                return

    async def send(self, answer: Json) -> bool:
        """Send an answer; False if the page does not read it."""
        text = orjson.dumps(answer, option=orjson.OPT_SERIALIZE_NUMPY).decode()
        return await self._within(_SEND_TIMEOUT_S, _sent(self.socket.send_text(text))) is True

    async def close(self, code: int) -> None:
        """Close the web socket with a code; a page that does not read never gets the code."""
        with suppress(TimeoutError, WebSocketDisconnect, RuntimeError):
            await asyncio.wait_for(self.socket.close(code), 1.0)

    async def replace(self) -> None:
        """Close the page, because another page takes its place."""
        self.is_replaced = True
        await self.close(_TAKEN_OVER)
        if self._waiting is not None:  # the page may be gone
            with suppress(RuntimeError):  # the timeout may have expired
                self._waiting.reschedule(asyncio.get_running_loop().time())

    async def _within(self, seconds: float, transfer: Awaitable[T]) -> T | None:
        """Await with a timeout; None on timeout, disconnect, or when another page takes the place of this one."""
        try:
            async with asyncio.timeout(seconds) as self._waiting:
                return await transfer
        except (TimeoutError, WebSocketDisconnect, RuntimeError):
            return None
        finally:
            self._waiting = None


async def _sent(sending: Awaitable[None]) -> bool:
    await sending
    return True


async def _received(socket: WebSocket) -> str | bytes:
    message = await socket.receive()
    if message["type"] == "websocket.disconnect":
        raise WebSocketDisconnect(message.get("code", 1000))
    text = message.get("text")
    return text if text is not None else message.get("bytes") or b""


def _page(name: str, status: int = 200, **values: Any) -> Response:
    return HTMLResponse(templates().get_template(name).render(**values), status, headers=_NO_STORE)


def _digest(content: Mapping[str, bytes]) -> str:
    digest = sha256()
    for name in sorted(content):
        digest.update(name.encode() + b"\0" + sha256(content[name]).digest())
    return digest.hexdigest()[:16]


@cache
def _compressed(content: bytes) -> bytes:
    return gzip.compress(content, 6, mtime=0)
