"""The server of a study: pages, and a web socket for each participant."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager, suppress
from functools import cache, partial
from importlib.resources import files
from typing import Any, Literal, TypeVar
from urllib.parse import urlsplit

import orjson
from jinja2 import Environment, PackageLoader
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
from ..study.export import temporary_export, write_archive
from ..study.folder import StudyFolder
from ..study.links import Links
from ..study.participant import Participant
from ..study.texts import Json, in_language
from .messages import FAILED, REFUSED, Message, parse_message
from .participant_session import ParticipantSession, preferred
from .researcher import Researcher

logger = logging.getLogger(__name__)

T = TypeVar("T")
Takeover = Literal["newest", "first"]

# The stick on a touch screen works like a dragged mouse.
MAPPINGS = dict(DEFAULT_MAPPINGS) | {
    "touch": DeviceMapping(DEFAULT_MAPPINGS["mouse"].controls, DEFAULT_MAPPINGS["mouse"].dead_zone)
}
TAKEN_OVER, OCCUPIED, UNKNOWN, TOO_MANY_MISTAKES, FULL = 4001, 4002, 4003, 4004, 4005  # codes of closed web sockets
MAX_MISTAKES = 20  # messages of one connection that cannot be read
_AWAY_S, _SWEEP_S = 600.0, 60.0  # time without a page, after which a session is closed; time between two checks of it
_IDLE_S = 900.0  # time without a message, after which a connection is closed
_SEND_TIMEOUT_S = 30.0  # in which a page has to receive an answer
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
        url: address of the server for participants; None: the one at which the researcher's page is opened.
        is_preview: whether participants can skip steps.

    Attributes:
        app: the ASGI application.
        sessions: session of each participant who was connected lately, by id.
    """

    def __init__(
        self,
        folder: StudyFolder,
        links: Links,
        *,
        suffix: str = ".json",
        takeover: Takeover = "newest",
        max_connections: int = 200,
        url: str | None = None,
        is_preview: bool = False,
    ) -> None:
        self.folder, self.links = folder, links
        self._suffix, self._takeover, self._max_connections = suffix, takeover, max_connections
        self.sessions: dict[str, ParticipantSession] = {}
        self._pages: dict[str, _Connection] = {}  # open pages by id of the participant
        self._locks: dict[str, asyncio.Lock] = {}
        self._open = 0
        self._words, self._url, self._is_preview = folder.study.tables, url, is_preview
        self._public_host = urlsplit(url).netloc.lower() if url else None
        connected = self._pages.keys()
        self._researcher = Researcher(folder, links, self.sessions, connected, self.new_participant)
        self._has_warned = False
        routes = [
            Route("/", self._front),
            Route("/static/{name}", self._static),
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
        language, words = self._words_for(request)
        title = in_language(self.folder.study.config.title, language)
        return _page("front.html", language=language, title=title, text=words["web.front"])

    async def _static(self, request: Request) -> Response:
        content = _static_file(str(request.path_params["name"]))
        if content is None:
            return self._not_found(request)
        data, kind = content
        return Response(data, media_type=kind, headers={"Cache-Control": "no-cache"})

    async def _study_page(self, request: Request) -> Response:
        if self.links.participant_of(str(request.path_params["token"])) is None:
            return self._not_found(request)
        study = self.folder.study
        data = {"words": self._words, "languages": study.config.languages, "title": study.config.title}
        return _page("study.html", language=study.config.languages[0], data=data)

    async def _join(self, request: Request) -> Response:
        """The open link: a page with a button first, because programs that preview links would become participants."""
        if not self.links.is_open(str(request.path_params["token"])):
            return self._not_found(request)
        config = self.folder.study.config
        language, words = self._words_for(request)
        title = in_language(config.title, language)
        if request.method == "GET":
            return _page("join.html", language=language, words=words, title=title)
        if not self._is_same_origin(request):
            return Response("Forbidden", 403)
        token = await run_in_threadpool(self.new_participant, config.participants)
        if token is None:
            return _page("join.html", 403, language=language, words=words, title=title, is_full=True)
        return RedirectResponse(f"../s/{token}", 303, headers={"Cache-Control": "no-store"})

    async def _unknown_address(self, request: Request, error: Exception) -> Response:
        return self._not_found(request)

    def _not_found(self, request: Request) -> Response:
        language, words = self._words_for(request)
        title, text = words["web.unknown_title"], words["web.unknown"]
        return _page("front.html", 404, language=language, title=title, text=text)

    def _is_same_origin(self, connection: HTTPConnection) -> bool:
        """Whether a request comes from a page of this server; programs other than browsers send no origin."""
        origin, host = connection.headers.get("origin"), connection.headers.get("host")
        if origin is None:
            return True
        site = urlsplit(origin).netloc
        if site and site in (host, self._public_host):
            return True
        if not self._has_warned:
            self._has_warned = True
            hint = "a proxy in front of the server has to pass the Host header on; or start the server with --url"
            names = (one_line(name, 100) for name in (origin, host))
            logger.warning("a page of %s asked %s, and was refused: %s", *names, hint)
        return False

    def _words_for(self, request: Request) -> tuple[str, dict[str, str]]:
        """The language of the study that the browser prefers, and the page's words in it."""
        wanted = (part.partition(";")[0] for part in request.headers.get("accept-language", "").split(","))
        language = preferred(self.folder.study.config.languages, wanted)
        return language, self._words[language]

    def new_participant(self, limit: int | None = None) -> str | None:
        """Add a participant with the next free id, such as `p001`; returns the token.

        Args:
            limit: largest number of participants; None is returned if there are as many.

        Raises:
            RecordError: the folder cannot be written.
        """
        id = self.folder.add_next(self.links.tokens(), limit)
        return None if id is None else self.links.add(id)

    # Participants

    async def _socket(self, socket: WebSocket) -> None:
        """A page of a participant: its messages are answered until it leaves."""
        id = self.links.participant_of(str(socket.path_params["token"]))
        if not self._is_same_origin(socket):
            await socket.close(UNKNOWN)
            return
        await socket.accept()
        # a page that reconnects may replace its own lost connection
        page = _Connection(socket, socket.query_params.get("page", "")[:40])
        if id is None:
            await page.close(UNKNOWN)
            return
        if self._open >= self._max_connections:
            await page.close(FULL)
            return
        self._open += 1
        try:
            if not await self._take_place(id, page):
                return
            async with self._locks.setdefault(id, asyncio.Lock()):  # the former page is answered to the end
                if not page.is_replaced:
                    await self._serve(id, page)
        finally:
            self._open -= 1
            if self._pages.get(id) is page:
                del self._pages[id]

    async def _take_place(self, id: str, page: _Connection) -> bool:
        """Make a page the one of its participant; False if another one keeps the place."""
        former = self._pages.get(id)
        if former is None:
            self._pages[id] = page
            return True
        is_other = not page.name or page.name != former.name
        if self._takeover == "first" and is_other and former.socket.client_state is WebSocketState.CONNECTED:
            await page.close(OCCUPIED)
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
            open_participant = partial(Participant, self.folder, id, mappings=MAPPINGS, suffix=self._suffix)
            self.sessions[id] = ParticipantSession(
                await run_in_threadpool(open_participant),
                is_paused=lambda: self._researcher.is_paused,
                is_preview=self._is_preview,
            )
        return self.sessions[id]

    # The researcher

    async def _researcher_page(self, request: Request) -> Response:
        if not self.links.is_researcher(str(request.path_params["token"])):
            return self._not_found(request)
        config = self.folder.study.config
        language = config.languages[0]
        data = {"words": self._words[language], "title": in_language(config.title, language), "url": self._url}
        return _page("researcher.html", language=language, data=data)

    async def _researcher_socket(self, socket: WebSocket) -> None:
        if not self._is_same_origin(socket) or not self.links.is_researcher(str(socket.path_params["token"])):
            await socket.close(UNKNOWN)
            return
        await socket.accept()
        await _Connection(socket).converse(partial(parse_message, of_researcher=True), self._researcher.answer)

    async def _export(self, request: Request) -> Response:
        """All that was collected, as a ZIP file."""
        if not self.links.is_researcher(str(request.path_params["token"])):
            return self._not_found(request)
        file = temporary_export(self.folder.out)
        personal = request.query_params.get("personal") == "1"
        try:
            await run_in_threadpool(write_archive, self.folder.out, file, personal=personal)
        except Sonata2dError as error:
            return Response(str(error), 500, media_type="text/plain")
        name = f"{self.folder.out.resolve().name}{'-personal' if personal else ''}.zip"
        return FileResponse(
            file,
            filename=name,
            headers={"Cache-Control": "no-store"},
            background=BackgroundTask(file.unlink, missing_ok=True),
        )

    @asynccontextmanager
    async def _lifespan(self, app: Starlette) -> AsyncIterator[None]:
        sweeping = asyncio.create_task(self._close_idle_sessions())
        try:
            yield
        except asyncio.CancelledError:  # a second Ctrl+C; the journals keep the runs that are being driven
            return
        sweeping.cancel()
        for session in self.sessions.values():
            await run_in_threadpool(self._close, session)


class _Guarded:
    """Adds headers to all answers, and turns unexpected errors into one line."""

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
        """Answer messages until the page leaves, reads nothing for a while, or is replaced."""
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
            if mistakes >= MAX_MISTAKES:
                await self.close(TOO_MANY_MISTAKES)
                return

    async def send(self, answer: Json) -> bool:
        """Send an answer; False if the page does not read it."""
        text = orjson.dumps(answer, option=orjson.OPT_SERIALIZE_NUMPY).decode()
        return await self._within(_SEND_TIMEOUT_S, _sent(self.socket.send_text(text))) is True

    async def close(self, code: int) -> None:
        """Close the web socket with a code, of which a page that reads nothing does not learn."""
        with suppress(TimeoutError, WebSocketDisconnect, RuntimeError):
            await asyncio.wait_for(self.socket.close(code), 1.0)

    async def replace(self) -> None:
        """End the page, because another one takes its place."""
        self.is_replaced = True
        await self.close(TAKEN_OVER)
        if self._waiting is not None:  # for a page that is gone
            with suppress(RuntimeError):  # the time is over at this moment
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
    return HTMLResponse(_templates().get_template(name).render(**values), status, headers={"Cache-Control": "no-store"})


@cache
def _templates() -> Environment:
    environment = Environment(loader=PackageLoader(__package__, "pages"), autoescape=True)
    environment.policies["json.dumps_kwargs"] = {"separators": (",", ":"), "allow_nan": False}
    return environment


def _static_file(name: str) -> tuple[bytes, str] | None:
    """A file of the page, and its media type; None for an unknown name."""
    kind = _STATIC.get(name.rpartition(".")[2])
    data = _static_files().get(name)
    return None if data is None or kind is None else (data, kind)


@cache
def _static_files() -> dict[str, bytes]:
    """The files of the page by name; no other one is looked up."""
    known = {path.name: path for path in files(__package__).joinpath("static").iterdir() if path.is_file()}
    known["drawing.js"] = files("sonata2d.view").joinpath("drawing.js")
    return {name: path.read_bytes() for name, path in known.items()}
