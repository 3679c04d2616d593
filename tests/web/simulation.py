"""A study under a simulated clock, network and disk: `python -m tests.web.simulation [--seeds 10000] [--first 0]`.

From one seed follow all delays, lost connections, double clicks, failures of the disk, kills of the server and power
cuts, as in the simulation of FoundationDB. Pages behave as the participant's page does: they repeat nothing on a
connection, and connect again with `hello`. Each page keeps a history of what it showed, by which the seed is judged, as
Jepsen judges data bases: no step that was shown is taken back, every answer and every run is stored exactly once, and
every participant reaches the end. Linux.
"""

from __future__ import annotations

import argparse
import heapq
import itertools
import json
import random
import sys
import tempfile
import traceback
from collections.abc import Callable, Coroutine, Generator
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any
from unittest import mock

import sonata2d as s2
from sonata2d.collect.rating import ratings_of
from sonata2d.datasets import verify
from sonata2d.errors import Sonata2dError
from sonata2d.study.folder import StudyFolder
from sonata2d.study.load import Study, load_study
from sonata2d.study.participant import Participant
from sonata2d.web.messages import PROTOCOL, parse_message
from sonata2d.web.participant_session import ParticipantSession
from tests.faults.disk import Disk

STUDY = """\
title: Simulated
pages: [{title: Welcome, text: Hello.}]
consent: {title: Consent, text: Yes., statements: [I take part.]}
demographics:
  - {name: age, kind: number, question: Age, minimum: 18, maximum: 120}
  - {name: name, kind: text, question: Name, personal: true}
practice: {scenario: room.yaml, runs: 1, text: Try it first.}
runs: [{scenario: room.yaml, runs: 2}]
after_run: [{name: effort, kind: classes, classes: 5, question: Effort}]
ratings: [{name: polite, folder: recorded, count: 2, question: {name: polite, kind: yes_no, question: Polite}}]
end: [{name: pleasant, kind: yes_no, question: Pleasant}]
seed: 3
"""
ROOM = "extends: empty\nrules: {time_limit: 0.4, ends_on: [time]}\n"
_IDS = ("p1", "p2")
_RETRY = (0.3, 0.6, 1.2, 2.5, 5.0)  # s, of connection.js
_LIMIT = 4000  # events of a simulation: beyond it somebody is stuck


class Violation(AssertionError):
    """The history of a page contradicts what the page shows, or what is stored."""


class _Sleep:
    """Awaitable: the simulation resumes the coroutine after a number of s."""

    def __init__(self, seconds: float) -> None:
        self.seconds = seconds

    def __await__(self) -> Generator[_Sleep, None, None]:
        yield self


class _Connection:
    """A connection of a page; messages arrive in their order, or not at all after it is cut."""

    def __init__(self) -> None:
        self.is_open = True
        self.arrivals = {"up": 0.0, "down": 0.0}


class Simulation:
    """One study with two participants.

    Args:
        seed: of all chances.
        study: of `create_study`.
        folder: for the files; empty.
    """

    def __init__(self, seed: int, study: Study, folder: Path) -> None:
        self.random, self.study, self.folder = random.Random(seed), study, folder
        self.time, self._order, self._events = 0.0, itertools.count(), list[tuple[float, int, Callable[[], None]]]()
        chance = self.random.random
        # What happens in this seed, per s of simulated time or per action; a third of the seeds lack each kind.
        self.kills, self.cuts, self.failures, self.lost, self.clicks = (
            0.0 if chance() < 0.33 else chance() * most for most in (0.15, 0.15, 0.3, 0.3, 0.3)
        )
        self.may_undo = chance() < 0.3
        self.power_was_cut = self.disk_failed = False
        self.disk = Disk(folder)
        self.generation, self.server_folder = 0, None
        self.sessions: dict[str, ParticipantSession] = {}
        self.queues: dict[str, list[tuple[_Connection, str]]] = {}
        self.running: dict[str, Coroutine[Any, Any, Any]] = {}
        self.pages = {id: Page(self, id) for id in _IDS}

    def at(self, delay: float, action: Callable[[], None]) -> None:
        """Schedule an action after a delay, s."""
        heapq.heappush(self._events, (self.time + delay, next(self._order), action))

    def run(self) -> None:
        """Run the study to its end, and judge it.

        Raises:
            Violation: it is wrong.
        """

        async def at_once(function: Callable[..., Any], *arguments: Any, **options: Any) -> Any:
            return function(*arguments, **options)

        with mock.patch("sonata2d.web.participant_session.asyncio.to_thread", at_once):
            self.disk.__enter__()
            try:
                self._guarded(self._start_server)
                for page in self.pages.values():
                    self.at(self.random.random(), page.connect)
                self._schedule_faults()
                for _ in range(_LIMIT):
                    if all(page.is_finished for page in self.pages.values()):
                        break
                    self.time, _, action = heapq.heappop(self._events)
                    self._guarded(action)
                else:
                    places = {id: (page.step, page.doing) for id, page in self.pages.items()}
                    raise Violation(f"stuck after {self.time:.1f} s: {places}")
            finally:
                self.disk.__exit__()
                self._stop_server()
        self._judge()

    # Faults

    def _schedule_faults(self) -> None:
        for rate, fault in ((self.kills, self._kill), (self.cuts, self._cut_power), (self.failures, self._fail_disk)):
            if rate:
                self.at(self.random.expovariate(rate), lambda rate=rate, fault=fault: self._repeat(rate, fault))  # type: ignore[misc]

    def _repeat(self, rate: float, fault: Callable[[], None]) -> None:
        if self.time < 60.0:  # afterwards all can end
            self.at(self.random.expovariate(rate), lambda: self._repeat(rate, fault))
            fault()

    def _kill(self) -> None:
        self._stop_server()
        self.at(self.random.uniform(0.1, 3.0), self._start_server)

    def _cut_power(self) -> None:
        """Cut the power at one of the next calls of the disk."""
        self.disk.fails_at, self.disk.is_cut = len(self.disk.calls) + self.random.randint(1, 12), True

    def _fail_disk(self) -> None:
        """Let one of the next calls of the disk fail."""
        if not self.disk.is_cut:
            self.disk.fails_at = len(self.disk.calls) + self.random.randint(1, 12)
            self.disk_failed = True

    def _guarded(self, action: Callable[[], None]) -> None:
        """Carry out an action during which the power may be cut."""
        try:
            action()
        except BaseException:
            if not self.disk.is_off:
                raise
        if self.disk.is_off:
            self.power_was_cut = True
            self.disk.__exit__()
            self._stop_server()
            self.disk.lose(keeps_names=self.random.random() < 0.5)
            self.disk = Disk(self.folder)
            self.disk.__enter__()
            self.at(self.random.uniform(0.5, 3.0), self._start_server)

    # The server

    def _start_server(self) -> None:
        if self.server_folder is not None:
            return
        try:
            self.server_folder = StudyFolder(self.folder / "out", self.study)
        except (Sonata2dError, OSError):  # the disk failed: the researcher starts it again
            self.at(1.0, self._start_server)

    def _stop_server(self) -> None:
        """End the process: no code runs, and its locks are free."""
        self.generation += 1
        for coroutine in self.running.values():
            coroutine.close()
        for session in self.sessions.values():
            driven = session.participant.session
            if driven is not None:
                driven._collection._lock.release(force=True)
                file = driven._journal._file
                if file is not None:
                    file.close()
        self.server_folder, self.sessions, self.queues, self.running = None, {}, {}, {}
        for page in self.pages.values():
            page.lose()

    def receive(self, id: str, connection: _Connection, data: str) -> None:
        """A message arrives at the server; it is answered after those before it."""
        if self.server_folder is None or not connection.is_open:
            return
        self.queues.setdefault(id, []).append((connection, data))
        self._serve(id)

    def _serve(self, id: str) -> None:
        while self.queues.get(id) and id not in self.running:
            connection, data = self.queues[id].pop(0)
            self.running[id] = self._answer(id, connection, data)
            self._go_on(id, self.generation)

    def _go_on(self, id: str, generation: int) -> None:
        """Run the answer to a message until it sleeps or ends."""
        if generation != self.generation:
            return
        try:
            sleeping: _Sleep = self.running[id].send(None)
        except StopIteration:
            del self.running[id]
            return

        def wake() -> None:
            self._go_on(id, generation)
            self._serve(id)

        self.at(sleeping.seconds, wake)

    async def _answer(self, id: str, connection: _Connection, data: str) -> None:
        if id not in self.sessions:
            folder = self.server_folder
            assert folder is not None
            start = datetime(2026, 1, 1, tzinfo=UTC)
            try:
                participant = Participant(folder, id, now=lambda: start + timedelta(seconds=int(self.time)))
            except Sonata2dError:  # as the server: the page is told, and connects again
                self.pages[id].lose()
                return
            self.sessions[id] = ParticipantSession(participant, clock=lambda: self.time, sleep=_Sleep)  # type: ignore[arg-type]
        answer = await self.sessions[id].answer(parse_message(data))
        if answer is not None:
            text = json.dumps(answer)
            self.send("down", connection, lambda: self.pages[id].receive(connection, json.loads(text)))

    def send(self, way: str, connection: _Connection, arrive: Callable[[], None]) -> None:
        """Let a message arrive after a delay, after those before it."""
        slow = self.random.random() < 0.1
        arrival = max(connection.arrivals[way], self.time + self.random.uniform(0.005, 1.0 if slow else 0.05))
        connection.arrivals[way] = arrival
        self.at(arrival - self.time, arrive)

    # The end

    def _judge(self) -> None:
        out = self.folder / "out"
        wrong = [str(problem) for problem in verify(out) if not problem.is_warning]
        if wrong and not (self.disk_failed or self.power_was_cut):
            raise Violation(f"check: {wrong[0]}")
        for page in self.pages.values():
            page.judge(out)


class Page:
    """The page of a participant, and its history.

    Attributes:
        step: id of the step on show.
        doing: what it does, for messages.
    """

    def __init__(self, world: Simulation, id: str) -> None:
        self.world, self.id = world, id
        self.step, self.doing, self.is_finished = "", "", False
        self.connection: _Connection | None = None
        self._attempt = 0
        self._view: Any = None
        self._order: list[str] = []  # of the steps
        self._farthest = 0  # index of the farthest step that was shown
        self._ticks = ("", 0)  # step of the run on show, and its ticks
        # What was asked for may be shown once, after views that were on their way before.
        self._takes_back = self._replaces_run = False
        self._sent: dict[str, list[Any]] = {}  # answers by step
        self._turn = 0  # counts what the page has begun, so that a click that was planned before is void

    # The connection

    def connect(self) -> None:
        if self.connection is not None or self.is_finished:
            return
        if self.world.server_folder is None:
            self._connect_later()
            return
        self.connection = _Connection()
        self._send({"type": "hello", "protocol": PROTOCOL, "languages": ["en"]})

    def _connect_later(self) -> None:
        self.world.at(_RETRY[min(self._attempt, len(_RETRY) - 1)], self.connect)
        self._attempt += 1

    def lose(self) -> None:
        """The connection is cut."""
        if self.connection is not None:
            self.connection.is_open, self.connection = False, None
            self._turn += 1
            self._connect_later()

    def _send(self, message: dict[str, Any]) -> None:
        connection = self.connection
        if connection is None:
            return
        self.doing, data = message["type"], json.dumps(message)
        chance = self.world.random.random
        for _ in range(2 if chance() < self.world.clicks and message["type"] != "tick" else 1):  # a double click
            self.world.send("up", connection, lambda: self.world.receive(self.id, connection, data))
        if chance() < self.world.lost * 0.2:
            self.world.at(chance() * 0.2, lambda: self.lose() if self.connection is connection else None)

    def receive(self, connection: _Connection, answer: Any) -> None:
        if connection is not self.connection or self.is_finished:
            return
        self._attempt = 0
        if answer["type"] == "view":
            self._show(answer)
        elif self._view is not None and "drive" in self._view and answer["run"] == self._view["drive"]["run"]:
            self._view["drive"].update({key: value for key, value in answer.items() if key not in ("type", "asked")})
            self._check_ticks()
            self._plan(0.05)

    # What is shown

    def _show(self, view: Any) -> None:
        self._view, self.step = view, view["step"]["id"]
        session = self.world.sessions.get(self.id)
        if session is not None and not self._order:
            self._order = [step.id for step in session.participant.steps]
        place = self._order.index(self.step)
        if place < self._farthest and self._takes_back and self.step.startswith("run"):
            self._takes_back = False
        elif place < self._farthest:
            raise Violation(f"{self.id}: {self._order[self._farthest]} was shown, then {self.step} again")
        self._farthest = place
        if "drive" in view:
            self._check_ticks()
        self.is_finished = view["step"]["kind"] == "thanks"
        film = (len(view["rating"]["states"]) - 1) * view["rating"]["scene"]["dt"] if "rating" in view else 0.0
        self._plan(film + self.world.random.uniform(0.05, 0.5))

    def _check_ticks(self) -> None:
        """Compare a run with its former state; the journal has each tick, but is synced at the end of the run only."""
        step, ticks = self._ticks
        self._ticks = (self.step, self._view["drive"]["ticks"])
        is_safe = not (self.world.disk_failed or self.world.power_was_cut)
        if self.step == step and self._ticks[1] < ticks and self._replaces_run:
            self._replaces_run = False
        elif is_safe and self.step == step and self._ticks[1] < ticks:
            raise Violation(f"{self.id}: {step} had {ticks} ticks, then {self._ticks[1]}")

    def _plan(self, delay: float) -> None:
        self._turn += 1
        turn = self._turn
        self.world.at(delay, lambda: self._act() if turn == self._turn else None)

    # What the participant does

    def _act(self) -> None:
        view, step, chance = self._view, self._view["step"], self.world.random.random
        kind = step["kind"]
        if kind == "declined":
            self._send({"type": "reconsider"})
        elif kind == "page":
            self._send({"type": "read", "step": step["id"]})
        elif kind == "consent":
            if chance() < 0.05:
                self._send({"type": "decline", "step": step["id"]})
            else:
                self._send({"type": "consent", "step": step["id"], "ticked": [True] * len(step["statements"])})
        elif kind == "questions":
            self._answer(step)
        elif "drive" in view:
            self._drive(view)
        elif "rating" in view:
            rating = view["rating"]
            if rating["breakDue"]:
                self._send({"type": "rest"})
            label, shown = chance() < 0.5, rating["shown"]
            self._send({"type": "rate", "shown": shown, "label": label, "seconds": 1.5, "whole": True})
        else:
            self._send({"type": "hello", "protocol": PROTOCOL, "languages": []})  # as after a reload

    def _answer(self, step: Any) -> None:
        if self.world.may_undo and self._view["canUndo"] and self.world.random.random() < 0.2:
            self._takes_back = True
            self._send({"type": "undo"})
            return
        chosen = {
            "age": self.world.random.randint(18, 90),
            "name": f"n{self.world.random.randint(0, 99)}",
            "effort": self.world.random.randint(1, 5),
            "pleasant": self.world.random.random() < 0.5,
        }
        values = {question["name"]: chosen[question["name"]] for question in step["questions"]}
        self._sent.setdefault(step["id"], []).append(values)
        self._send({"type": "answer", "step": step["id"], "values": values})

    def _drive(self, view: Any) -> None:
        drive, chance = view["drive"], self.world.random.random
        run = drive["run"]
        if drive["status"] == "ended":
            if drive["isPractice"]:
                self._send({"type": "finish_practice", "run": run})
            elif chance() < 0.1 and drive["allowed"]["discard"]:
                self._replaces_run = True
                self._send({"type": "discard", "run": run})
            else:
                self._send({"type": "keep", "run": run})
        elif chance() < 0.03:
            self._send({"type": "pause", "run": run})
        else:
            event = {"device": "keyboard", "control": "w", "value": 1.0}
            events = [event] if drive["ticks"] == 0 else []
            self._send({"type": "tick", "run": run, "number": drive["ticks"], "events": events})

    # The end

    def judge(self, out: Path) -> None:
        """Compare the stored study with the history.

        Raises:
            Violation: something is missing, or there twice.
        """
        runs = [id for id in self._order if id.startswith("run")]
        files = sorted(out.glob(f"{self.id}__*.json"))
        if len(files) != len(runs):
            raise Violation(f"{self.id}: {len(files)} kept runs instead of {len(runs)}")
        answers, personal = (
            [json.loads(line) for line in (out / "study" / name / f"{self.id}.jsonl").read_text().splitlines()]
            for name in ("answers", "personal")
        )
        for step, sent in self._sent.items():
            stored = [line["values"] for line in answers if line["event"] == "answers" and line["step"] == step]
            if len(stored) != 1 and not self.world.may_undo:
                raise Violation(f"{self.id}: {step} is answered {len(stored)} times")
            secret = [line["values"] for line in personal if line["step"] == step]  # the last one counts
            found = stored[-1] | (secret[-1] if secret else {})
            if found not in sent:
                raise Violation(f"{self.id}: {step} has the answer {found}, never given: {sent}")
        ratings = [rating for rating in ratings_of(out / "rated" / "polite") if rating.rater == self.id]
        # a recorded run is skipped if its file cannot be read
        is_complete = len(ratings) >= 2 or self.world.disk_failed
        if len(ratings) != len({(rating.file, rating.showing) for rating in ratings}) or not is_complete:
            raise Violation(f"{self.id}: the ratings are {ratings}")


def create_study(folder: Path) -> Study:
    """A study with two recorded runs to rate."""
    s2.generate_dataset(folder / "recorded", "empty", "straight-to-goal", episodes=2)
    (folder / "room.yaml").write_text(ROOM)
    (folder / "study.yaml").write_text(STUDY)
    return load_study(folder / "study.yaml")


def simulate(seed: int, study: Study) -> str:
    """Simulate a seed; returns the violation or the traceback, or an empty text."""
    memory = Path("/dev/shm")
    with tempfile.TemporaryDirectory(dir=memory if memory.is_dir() else None) as folder:
        try:
            Simulation(seed, study, Path(folder)).run()
        except Violation as violation:
            return f"seed {seed}: {violation}"
        except Exception:
            return f"seed {seed}: {traceback.format_exc()}"
    return ""


def main() -> int:
    """Simulate many seeds, and print what is wrong."""
    parser = argparse.ArgumentParser(prog="python -m tests.web.simulation", description=__doc__)
    parser.add_argument("--seeds", type=int, default=10_000, help="number of seeds")
    parser.add_argument("--first", type=int, default=0, help="first seed")
    options = parser.parse_args()
    wrong = 0
    with tempfile.TemporaryDirectory() as folder:
        study = create_study(Path(folder))
        for seed in range(options.first, options.first + options.seeds):
            if problem := simulate(seed, study):
                wrong += 1
                sys.stdout.write(f"{problem}\n")
    sys.stdout.write(f"{options.seeds} seeds, {wrong or 'none'} wrong\n")
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
