"""A slow and unreliable connection: forwards bytes late, with jitter and stalls, and can be cut."""

from __future__ import annotations

import asyncio
import random
import threading
from contextlib import suppress
from typing import Self


class Proxy:
    """Listens at a free port of this machine and forwards to another one.

    TCP repeats lost packets, so that a loss is a stall to the two ends: everything behind it waits.

    Args:
        target: port of the server.
        delay: of each direction, s.
        jitter: largest further delay, s.
        loss: probability that a packet stalls its direction.
        stall: duration of a stall, s.
    """

    def __init__(
        self, target: int, *, delay: float = 0.0, jitter: float = 0.0, loss: float = 0.0, stall: float = 0.4
    ) -> None:
        self.target, self._delay, self._jitter, self._loss, self._stall = target, delay, jitter, loss, stall
        self._rng = random.Random(1)
        self._writers: set[asyncio.StreamWriter] = set()
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        start = asyncio.start_server(self._connected, "127.0.0.1", 0)
        self._server = asyncio.run_coroutine_threadsafe(start, self._loop).result()
        self.port = self._server.sockets[0].getsockname()[1]
        return self

    def __exit__(self, *_: object) -> None:
        async def close() -> None:
            self._server.close()
            tasks = asyncio.all_tasks() - {asyncio.current_task()}
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)

        asyncio.run_coroutine_threadsafe(close(), self._loop).result()
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()
        self._loop.close()

    def cut(self) -> None:
        """Cut all connections."""

        async def cut() -> None:
            for writer in self._writers:
                writer.transport.abort()

        asyncio.run_coroutine_threadsafe(cut(), self._loop).result()

    async def _connected(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with suppress(OSError, asyncio.CancelledError):
            to_server, from_server = None, None
            try:
                from_server, to_server = await asyncio.open_connection("127.0.0.1", self.target)
                self._writers |= {writer, to_server}
                await asyncio.gather(self._forward(reader, to_server), self._forward(from_server, writer))
            finally:
                for end in (writer, to_server):
                    if end is not None:
                        end.close()
                        self._writers.discard(end)

    async def _forward(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        queue: asyncio.Queue[tuple[float, bytes]] = asyncio.Queue()

        async def deliver() -> None:
            while True:
                when, data = await queue.get()
                await asyncio.sleep(when - self._loop.time())
                writer.write(data)
                await writer.drain()
                if not data:
                    writer.close()
                    return

        delivering = asyncio.create_task(deliver())
        last = 0.0
        try:
            while True:
                data = await reader.read(65_536)
                late = self._delay + self._rng.uniform(0.0, self._jitter)
                late += self._stall if self._rng.random() < self._loss else 0.0
                last = max(last, self._loop.time() + late)  # bytes do not overtake each other
                queue.put_nowait((last, data))
                if not data:
                    await delivering
                    return
        finally:
            delivering.cancel()
