"""Load of a study's server: ticks that pages drop, round trips, processor time and memory with many participants.

python benchmarks/serve.py [--participants 20] [--minutes 10] [--delays 0 100 300]

One process serves the study. Another one simulates the participants: each drives run after run in the default scenes
like the page in a browser, which asks for a tick every 0.1 s, and drops ticks when it is more than three behind in a
picture. Messages are delayed by half of the delay in each direction. Both processes share the machine.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import os
import random
import re
import sys
import tempfile
import time
from collections import deque
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import websockets
from study_server import served_study

from sonata2d.datasets import verify

STUDY = "title: Load\nruns: [{scenario: sonata-2020, runs: 400}]\n"
FRAME = 1 / 60  # s, between two pictures of a page
MAX_TICKS, MAX_UNANSWERED = 3, 15  # of a page: see drive.js
RUN_SECONDS = 20.0  # after which a participant ends a run
KEYS = ("w", "a", "d")


@dataclass
class Page:
    """A page that a simulated person drives with; counts what happens."""

    delay: float
    rng: random.Random
    sent: int = 0
    ticks: int = 0
    dropped: int = 0
    pauses: int = 0
    runs: int = 0
    bytes: int = 0
    problems: list[str] = field(default_factory=list)
    round_trips: list[float] = field(default_factory=list)

    async def drive(self, link: str, seconds: float) -> None:
        """Drive run after run for a time."""
        end = time.monotonic() + seconds
        async with websockets.connect(link.replace("http", "ws", 1) + "/socket", max_size=None) as socket:
            self.socket = socket
            self.inbox: deque[tuple[float, dict[str, Any]]] = deque()  # answers, and when they arrive
            receiving = asyncio.create_task(self._receive())
            view = await self._ask(type="hello", protocol=2)
            while time.monotonic() < end:
                view = await self._drive_run(view["drive"], end)
            receiving.cancel()

    async def _receive(self) -> None:
        async for text in self.socket:
            self.bytes += len(text)
            self.inbox.append((time.monotonic() + self.delay / 2, json.loads(text)))

    def _send(self, **message: Any) -> None:
        data = json.dumps(message)
        self.bytes += len(data)
        asyncio.get_running_loop().call_later(self.delay / 2, lambda: asyncio.ensure_future(self.socket.send(data)))

    def _arrived(self) -> list[tuple[float, dict[str, Any]]]:
        """The answers that have arrived by now, each with its time."""
        answers = []
        while self.inbox and self.inbox[0][0] <= time.monotonic():
            answers.append(self.inbox.popleft())
        return answers

    async def _ask(self, **message: Any) -> dict[str, Any]:
        """Send a message that is not a tick; returns the next view."""
        self._send(**message)
        while True:
            await asyncio.sleep(FRAME)
            for _, answer in self._arrived():
                if answer["type"] == "view":
                    if answer["problem"]:
                        self.problems.append(answer["problem"])
                    return answer

    async def _drive_run(self, drive: dict[str, Any], end: float) -> dict[str, Any]:
        run, dt = drive["run"], drive["scene"]["dt"]
        number = latest = drive["ticks"]
        sent_at: dict[int, float] = {}
        lag, round_trip, dropped, pressed = dt, None, 0, dict.fromkeys(KEYS, 0.0)
        began = last = time.monotonic()
        status = "driving"
        while status == "driving" and time.monotonic() < min(began + RUN_SECONDS, end):
            await asyncio.sleep(FRAME)
            now = time.monotonic()
            for arrival, answer in self._arrived():
                if answer["type"] == "tick" and answer["run"] == run:
                    latest, status = max(latest, answer["ticks"]), answer["status"]
                    round_trip = arrival - sent_at.pop(answer["asked"])
                    self.round_trips.append(round_trip)
            lag, last = lag + now - last, now
            for _ in range(MAX_TICKS):
                if lag < dt:
                    break
                if number - latest >= MAX_UNANSWERED:  # the page pauses; the driver drives on at once
                    self.pauses += 1
                    view = await self._ask(type="pause", run=run)
                    number = latest = view["drive"]["ticks"]
                    sent_at, lag, last = {}, 0.0, time.monotonic()
                    break
                lag -= dt
                events = []
                for key in KEYS if self.rng.random() < 0.3 else ():
                    value = float(self.rng.random() < 0.6)
                    if value != pressed[key]:
                        pressed[key] = value
                        events.append({"device": "keyboard", "control": key, "value": value})
                self._send(type="tick", run=run, number=number, events=events, round_trip=round_trip, dropped=dropped)
                sent_at[number] = now
                number, round_trip, dropped = number + 1, None, 0
                self.ticks += 1
            behind = int(lag / dt)
            lag, dropped = lag - behind * dt, dropped + behind
            self.dropped += behind
        await self._ask(type="stop", run=run)
        self.runs += 1
        return await self._ask(type="keep", run=run)


def usage(pid: int) -> tuple[float, float]:
    """Processor time of a process so far, s, and its largest memory, MB."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    seconds = (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
    peak = re.search(r"VmHWM:\s+(\d+)", Path(f"/proc/{pid}/status").read_text())
    assert peak
    return seconds, int(peak[1]) / 1024


async def drive_all(links: list[str], delay: float, seconds: float) -> list[Page]:
    pages = [Page(delay, random.Random(k)) for k in range(len(links))]
    await asyncio.gather(*(page.drive(link, seconds) for page, link in zip(pages, links, strict=True)))
    return pages


def measure(folder: Path, participants: int, delay: float, minutes: float) -> dict[str, Any]:
    """Serve a study for a time; returns the figures."""
    (folder / "study.yaml").write_text(STUDY)
    out = folder / f"out-{delay:g}"
    with served_study(folder, participants, out=out.name) as (server, by_name):
        links = [link for name, link in by_name.items() if name.startswith("p")]
        before, memory_before = usage(server.pid)
        pages = asyncio.run(drive_all(links, delay / 1000, 60 * minutes))
        after, memory = usage(server.pid)
    ticks, dropped = sum(page.ticks for page in pages), sum(page.dropped for page in pages)
    trips = np.array([trip for page in pages for trip in page.round_trips])
    problems = verify(out, replay=True, rerun=True)
    for problem in problems:
        print(problem, file=sys.stderr)
    return {
        "delay_ms": delay,
        "participants": participants,
        "ticks": ticks,
        "dropped_percent": round(100 * dropped / (ticks + dropped), 4),
        "pauses": sum(page.pauses for page in pages),
        "round_trip_ms": [round(1000 * float(np.percentile(trips, share)), 1) for share in (50, 95, 99.9)],
        "processor_percent_per_participant": round(100 * (after - before) / (60 * minutes * participants), 2),
        "kilobytes_per_second_per_participant": round(
            sum(page.bytes for page in pages) / (60e3 * minutes * participants), 1
        ),
        "memory_mb": [round(memory_before), round(memory)],
        "runs": sum(page.runs for page in pages),
        "refused": sum(len(page.problems) for page in pages),
        "check_problems": len(problems),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--participants", type=int, default=20)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--delays", type=float, nargs="+", default=[0.0, 100.0, 300.0], help="ms")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        for delay in options.delays:
            print(json.dumps(measure(Path(folder), options.participants, delay, options.minutes)), flush=True)


if __name__ == "__main__":
    main()
