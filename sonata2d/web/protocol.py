"""HTTP connections that do not wait for ever for a request."""

from __future__ import annotations

import asyncio
from typing import Any

from uvicorn.protocols.http.h11_impl import H11Protocol

_PATIENCE = 10.0  # s, until a connection without a complete request is closed


class ImpatientProtocol(H11Protocol):
    """Closes connections that send no complete request: uvicorn counts them, and refuses others when they are many."""

    _limit: asyncio.TimerHandle | None = None

    def connection_made(self, transport: Any) -> None:
        super().connection_made(transport)
        self._limit = self.loop.call_later(_PATIENCE, self._close_if_silent)

    def connection_lost(self, exc: Exception | None) -> None:
        self._stop()
        super().connection_lost(exc)

    def handle_websocket_upgrade(self, event: Any) -> None:
        self._stop()
        super().handle_websocket_upgrade(event)

    def _close_if_silent(self) -> None:
        request: Any = self.cycle  # None before the first one
        if request is None and not self.transport.is_closing():
            self.transport.close()

    def _stop(self) -> None:
        if self._limit is not None:
            self._limit.cancel()
