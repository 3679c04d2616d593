"""Protocols of uvicorn that close idle connections: after a time, and the oldest ones where there are many."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Iterable
from typing import Any

from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol
from websockets.exceptions import InvalidState

from .settings import MAX_IDLE_CONNECTIONS

_TIMEOUT_S = 10.0


def _cut_oldest_idle(connections: Iterable[Any]) -> None:
    """Cut the oldest idle connection off if there are more than `MAX_IDLE_CONNECTIONS`."""
    idle = [each for each in connections if each.idle_since is not None and not each.transport.is_closing()]
    if len(idle) > MAX_IDLE_CONNECTIONS:
        min(idle, key=lambda each: each.idle_since).transport.abort()


class TimeoutProtocol(H11Protocol):
    """HTTP that closes connections without a complete request: uvicorn counts them towards its limit of connections."""

    _limit: asyncio.TimerHandle | None = None
    _waits_since = 0.0

    @property
    def idle_since(self) -> float | None:
        """Time of the event loop since which no request is complete; None while one is answered."""
        request: Any = self.cycle  # None before the first one
        return self._waits_since if request is None or request.response_complete else None

    def connection_made(self, transport: Any) -> None:
        super().connection_made(transport)
        self._wait_for_request()
        _cut_oldest_idle(self.connections)

    def connection_lost(self, exc: Exception | None) -> None:
        self._stop()
        super().connection_lost(exc)

    def handle_websocket_upgrade(self, event: Any) -> None:
        self._stop()
        super().handle_websocket_upgrade(event)

    def on_response_complete(self) -> None:
        self._wait_for_request()  # before the next request, which may have arrived
        super().on_response_complete()

    def _wait_for_request(self) -> None:
        self._stop()
        self._waits_since = self.loop.time()
        self._limit = self.loop.call_later(_TIMEOUT_S, self._close_if_silent)

    def _close_if_silent(self) -> None:
        if self.idle_since is not None and not self.transport.is_closing():
            self.transport.close()

    def _stop(self) -> None:
        if self._limit is not None:
            self._limit.cancel()


class TimeoutSocket(WebSocketsSansIOProtocol):
    """Web sockets that are cut off if the other side does not read what was sent last, or continues after an error."""

    idle_since: float | None = None  # time at which the server closed it

    def data_received(self, data: bytes) -> None:
        try:
            super().data_received(data)
        except InvalidState:  # uvicorn closes after a frame that is not text, and does not expect a second one
            self.transport.abort()

    async def run_asgi(self) -> None:
        await super().run_asgi()
        self.idle_since = self.loop.time()
        self.loop.call_later(_TIMEOUT_S, self.transport.abort)
        _cut_oldest_idle(self.connections)


def without_traceback(record: logging.LogRecord) -> bool:
    """A log filter that removes uvicorn's tracebacks about frames that are not text, and about cancelled requests."""
    error = record.exc_info[1] if record.exc_info else None
    if isinstance(error, UnicodeDecodeError):
        record.exc_info = None
    if isinstance(error, asyncio.CancelledError):
        record.msg, record.args, record.exc_info = "a request was not answered, because the server stops", (), None
    return True
