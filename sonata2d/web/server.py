"""The server of a study: pages, and a web socket for each participant."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import AsyncIterator, Awaitable, Callable, Collection
from contextlib import asynccontextmanager, suppress
from functools import cache, partial
from importlib.resources import files
from typing import Any, Literal
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
from ..core.wording import described
from ..errors import Sonata2dError
from ..study.config import in_language
from ..study.content import Json
from ..study.export import export_study, temporary_export
from ..study.folder import StudyFolder
from ..study.links import Links
from ..study.participant import Participant
from .messages import Message, parse_message
from .researcher import Researcher
from .seat import Seat, preferred

logger = logging.getLogger(__name__)

Takeover = Literal["newest", "first"]

# The stick on a touch screen works like a dragged mouse.
MAPPINGS = dict(DEFAULT_MAPPINGS) | {
    "touch": DeviceMapping(DEFAULT_MAPPINGS["mouse"].controls, DEFAULT_MAPPINGS["mouse"].dead_zone)
}
TAKEN_OVER, REFUSED, UNKNOWN, TOO_MANY_MISTAKES, FULL = 4001, 4002, 4003, 4004, 4005  # codes of closed web sockets
MAX_MISTAKES = 20  # messages of one connection that cannot be read
_AWAY, _SWEEP = 600.0, 60.0  # s: without a page, after which a participant's memory is freed; between two looks
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
        url: address of the server for participants; None: the one at which the researcher's page is opened.
        is_preview: whether participants can skip steps.

    Attributes:
        app: the ASGI application.
        is_held: whether the researcher has stopped all runs for a while.
        seats: state of each participant who has connected lately, by id.
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
        self.is_held = False
        self.seats: dict[str, Seat] = {}
        self._sockets: dict[str, WebSocket] = {}
        self._pages: dict[str, str] = {}  # random names of the pages that have the sockets
        self._locks: dict[str, asyncio.Lock] = {}
        self._open = 0
        self._words, self._url, self._is_preview = folder.study.tables, url, is_preview
        self._researcher = Researcher(self)
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
        app = Starlette(routes=routes, lifespan=self._lifespan)
        self.app: ASGIApp = _Guarded(app)

    @property
    def connected(self) -> Collection[str]:
        """Ids of the participants who have the page open."""
        return self._sockets.keys()

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
        config = self.folder.study.config
        wanted = (part.partition(";")[0] for part in request.headers.get("accept-language", "").split(","))
        language = preferred(config.languages, wanted)
        words, title = self._words[language], in_language(config.title, language)
        if request.method == "GET":
            return _page("join.html", language=language, words=words, title=title)
        if not _is_same_origin(request):
            return Response("Forbidden", 403)
        token = await run_in_threadpool(self.new_participant, config.participants)
        if token is None:
            return _page("join.html", 403, language=language, words=words, title=title, is_full=True)
        return RedirectResponse(f"../s/{token}", 303, headers={"Cache-Control": "no-store"})

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
        page = socket.query_params.get("page", "")[:40]  # a page that reconnects may replace its own lost connection
        if former is not None:
            is_other = not page or page != self._pages.get(id)
            if self._takeover == "first" and is_other and former.client_state is WebSocketState.CONNECTED:
                await socket.close(REFUSED)
                return False
            self._sockets[id] = socket
            with suppress(RuntimeError, WebSocketDisconnect):
                await former.close(TAKEN_OVER)
        self._sockets[id], self._pages[id] = socket, page
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
        try:
            await _converse(socket, parse_message, seat.answer, until=lambda: self._sockets.get(id) is not socket)
        finally:
            with suppress(Sonata2dError):
                await seat.leave()

    async def _free_idle_seats(self) -> None:
        """Free the memory of participants who are away; their journals hold all that is needed to go on."""
        while True:
            await asyncio.sleep(_SWEEP)
            await self.free_seats(_AWAY)

    async def free_seats(self, seconds: float) -> None:
        """Close the parts of participants whose page has been closed for a time."""
        for id, seat in list(self.seats.items()):
            lock = self._locks.setdefault(id, asyncio.Lock())
            if lock.locked() or seat.idle < seconds:  # a page holds the lock as long as it is open
                continue
            async with lock:
                del self.seats[id]
                await run_in_threadpool(self._close, seat)
                self._researcher.forget()

    def _close(self, seat: Seat) -> None:
        try:
            seat.participant.close()
        except (Sonata2dError, OSError) as error:
            logger.error("%s: %s", seat.participant.id, error)

    async def _seat_of(self, id: str) -> Seat:
        """The state of a participant; it is created when the participant connects for the first time.

        Raises:
            Sonata2dError: a file of the participant is damaged, or in use by another program.
        """
        if id not in self.seats:
            participant = await run_in_threadpool(self._open_participant, id)
            self.seats[id] = Seat(participant, is_held=lambda: self.is_held, is_preview=self._is_preview)
        return self.seats[id]

    def _open_participant(self, id: str) -> Participant:
        return Participant(self.folder, id, mappings=MAPPINGS, suffix=self._suffix)

    # The researcher

    async def _researcher_page(self, request: Request) -> Response:
        if not self.links.is_researcher(str(request.path_params["token"])):
            return _not_found()
        config = self.folder.study.config
        language = config.languages[0]
        data = {"words": self._words[language], "title": in_language(config.title, language), "url": self._url}
        return _page("researcher.html", language=language, data=data)

    async def _researcher_socket(self, socket: WebSocket) -> None:
        if not _is_same_origin(socket) or not self.links.is_researcher(str(socket.path_params["token"])):
            await socket.close(UNKNOWN)
            return
        await socket.accept()
        await _converse(socket, partial(parse_message, of_researcher=True), self._researcher.answer)

    async def _export(self, request: Request) -> Response:
        """All that was collected, as a ZIP file."""
        if not self.links.is_researcher(str(request.path_params["token"])):
            return _not_found()
        file = temporary_export(self.folder.out)
        personal = request.query_params.get("personal") == "1"
        try:
            await run_in_threadpool(export_study, self.folder.out, file, personal=personal)
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
        sweeping = asyncio.create_task(self._free_idle_seats())
        yield
        sweeping.cancel()
        for seat in self.seats.values():
            await run_in_threadpool(self._close, seat)


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


async def _received(socket: WebSocket) -> str | bytes:
    message = await socket.receive()
    if message["type"] == "websocket.disconnect":
        raise WebSocketDisconnect(message.get("code", 1000))
    text = message.get("text")
    return text if text is not None else message.get("bytes") or b""


async def _converse(
    socket: WebSocket,
    parse: Callable[[str | bytes], Message],
    answer: Callable[[Message], Awaitable[Json | None]],
    until: Callable[[], bool] = lambda: False,
) -> None:
    """Answer the messages of a page, one after the other, until it leaves or `until` is true."""
    mistakes = 0
    while not until():
        try:
            data = await asyncio.wait_for(_received(socket), _IDLE)
        except (WebSocketDisconnect, TimeoutError, RuntimeError):
            return  # the page was closed, or its connection is lost
        try:
            message = parse(data)
        except ValueError as error:
            mistakes += 1
            reply: Json | None = {"type": "error", "problem": str(error)}
        else:
            reply = await answer(message)
        try:
            if reply is not None:
                await _send(socket, reply)
            if mistakes >= MAX_MISTAKES:
                await socket.close(TOO_MANY_MISTAKES)
                return
        except (WebSocketDisconnect, RuntimeError):
            return


async def _send(socket: WebSocket, answer: Json) -> None:
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


def _static_file(name: str) -> tuple[bytes, str] | None:
    """A file of the page, and its type; None if there is none."""
    kind = _STATIC.get(name.rpartition(".")[2])
    data = _static_files().get(name)
    return None if data is None or kind is None else (data, kind)


@cache
def _static_files() -> dict[str, bytes]:
    """The files of the page by name; no other one is looked up."""
    known = {path.name: path for path in files(__package__).joinpath("static").iterdir() if path.is_file()}
    known["drawing.js"] = files("sonata2d.view").joinpath("drawing.js")
    return {name: path.read_bytes() for name, path in known.items()}
