"""Programs that finish a study without taking part: each is refused, or its rows say what to doubt."""

from __future__ import annotations

import json
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest

from sonata2d.study.folder import StudyFolder
from sonata2d.study.load import load_study
from sonata2d.study.participant import Participant
from sonata2d.study.report import results_of
from sonata2d.web.participant_session import ParticipantSession

from .conftest import answered

STUDY = """\
title: Paid
pages: [{title: Welcome, text: Drive to the target.}]
consent: {title: Consent, text: Runs are stored., statements: [I take part.]}
practice:
  scenario: empty
  text: Reach the target.
  check: [{name: task, kind: classes, classes: [nothing, the target, a person], question: Where to,
           right: 2, until_right: true}]
runs: [{scenario: empty, runs: 4}]
ratings:
  - {name: polite, folder: recorded, count: 5, repeats: 0,
     question: {name: polite, kind: classes, classes: 5, question: Polite}}
end:
  - {name: attention, kind: classes, classes: 5, question: Choose 4, right: 4}
  - {scale: rosas, subscales: [warmth]}
"""
FULL = {"minimum_length": 2.0, "minimum_distance": 1.0, "must_reach_goal": True}


class Cheat:
    """A program that talks to a server by messages, with a clock that goes on only when it waits.

    Args:
        folder: for the study.
        rules: of the study, for runs.
        patience: s that it waits before each message that is no tick.
    """

    def __init__(self, folder: Path, rules: dict[str, Any], patience: float = 0.0) -> None:
        (folder / "study.yaml").write_text(STUDY + json.dumps(rules)[1:-1].replace('"', "").replace(", ", "\n").lower())
        self.out, self.clock, self.patience, self.slept = folder / "out", 1000.0, patience, 0.0
        study = StudyFolder(self.out, load_study(folder / "study.yaml"))
        participant = Participant(study, "p1", now=self._now)
        self.session = ParticipantSession(participant, clock=lambda: self.clock, sleep=self._sleep)
        self.view = self.ask(type="hello", protocol=2)

    def _now(self) -> datetime:
        return datetime(2026, 1, 1, tzinfo=UTC) + timedelta(seconds=self.clock)

    async def _sleep(self, seconds: float) -> None:
        self.clock += seconds
        self.slept += seconds

    def ask(self, **message: Any) -> Any:
        self.clock += self.patience if message["type"] != "tick" else 0.0
        answer = answered(self.session, message)
        if answer is not None and answer["type"] == "view":
            self.view = answer
        return answer

    def begin(self, answer: int = 2) -> None:
        """Go on to the practice."""
        self.ask(type="read", step="page-1")
        self.ask(type="consent", step="consent", ticked=[True])
        self.ask(type="answer", step="practice-check", values={"task": answer})

    def run(self, ticks: int, *events: tuple[str, float], round_trip: float = 0.01) -> Any:
        """Drive a run, and end it unless it has ended; returns why it cannot be kept."""
        run = self.view["drive"]["run"]
        for number in range(ticks):
            sent = [{"device": "keyboard", "control": key, "value": value} for key, value in events if number == 0]
            if self.ask(type="tick", run=run, number=number, events=sent, round_trip=round_trip)["status"] == "ended":
                break
        return self.ask(type="stop", run=run)["drive"]["broken"]

    def keep(self) -> str:
        """Keep the run; returns the problem."""
        problem: str = self.ask(type="keep", run=self.view["drive"]["run"])["problemKind"]
        return problem

    def flags(self) -> str:
        """The flags of the participant, as the table has them."""
        self.session.participant.close()
        (row,) = results_of(self.out)["participants"]
        return str(row["flags"])


@pytest.fixture
def study(tmp_path: Path, short_runs: Path) -> Path:
    (tmp_path / "recorded").symlink_to(short_runs)
    return tmp_path


def practised(cheat: Cheat) -> None:
    cheat.run(5)
    cheat.ask(type="finish_practice", run=cheat.view["drive"]["run"])


def rate_all(cheat: Cheat, label: int, wait: float) -> int:
    """Rate until it is refused; returns the number of ratings that were taken."""
    count = 0
    while cheat.view["step"]["kind"] == "ratings":
        cheat.clock += wait
        message = {"type": "rate", "shown": cheat.view["rating"]["shown"], "label": label, "seconds": 999.0}
        if cheat.ask(**message, whole=True)["problemKind"]:
            break
        count += 1
    return count


def test_1_the_script_that_presses_no_key(study: Path) -> None:
    """Once, it finished in nine seconds: runs of 21 ticks without a key, ratings at once, "999 s, seen whole"."""
    cheat = Cheat(study, {})
    cheat.begin()
    practised(cheat)
    for _ in range(4):
        cheat.run(21)
        assert cheat.keep() == ""
    assert rate_all(cheat, 3, wait=0.0) == 0  # refused: the first run cannot have been seen
    assert cheat.view["step"]["kind"] == "ratings"
    assert "3 pages under 1 s" in cheat.flags()
    assert "4 runs without driving" in cheat.flags()


def test_2_the_script_that_meets_a_study_with_rules(study: Path) -> None:
    cheat = Cheat(study, FULL)
    cheat.begin()
    practised(cheat)
    for ticks, rule in ((15, "minimum_length"), (25, "minimum_distance")):
        assert cheat.run(ticks) == rule
        assert cheat.keep() == "refused"
        cheat.ask(type="redo", run=cheat.view["drive"]["run"])
    assert cheat.view["runs"] == (0, 4)
    cheat.session.participant.close()


def test_3_the_script_that_turns_on_the_spot_or_drives_in_circles(study: Path) -> None:
    cheat = Cheat(study, {"minimum_distance": 1.0})
    cheat.begin()
    practised(cheat)
    assert cheat.run(40, ("left", 1.0)) == "minimum_distance"  # turning is no way
    cheat.ask(type="redo", run=cheat.view["drive"]["run"])
    assert cheat.run(60, ("left", 1.0), ("up", 1.0)) is None  # circles are
    strict = Cheat(_other(study), FULL)
    strict.begin()
    practised(strict)
    assert strict.run(60, ("left", 1.0), ("up", 1.0)) == "must_reach_goal"
    strict.session.participant.close()
    cheat.session.participant.close()


def _other(folder: Path) -> Path:
    other = folder / "other"
    other.mkdir()
    (other / "recorded").symlink_to(folder / "recorded")
    return other


def test_4_the_script_that_waits_before_each_message_and_clicks_the_same(study: Path) -> None:
    """Its pages take long enough; equal ratings and a wrong check remain."""
    cheat = Cheat(study, {}, patience=5.0)
    cheat.begin()
    practised(cheat)
    for _ in range(4):
        cheat.run(60, ("up", 1.0))
        assert cheat.keep() == ""
    assert rate_all(cheat, 1, wait=20.0) == 5
    rosas = {item["name"]: 5 for item in cheat.view["step"]["questions"][1]["items"]}
    cheat.ask(type="answer", step="end", values={"attention": 1, "rosas": rosas})
    assert cheat.view["step"]["kind"] == "thanks"
    flags = cheat.flags()
    assert "1 wrong check" in flags
    assert "all ratings are equal" in flags
    assert "pages under" not in flags


def test_5_the_script_that_guesses_the_comprehension_check(study: Path) -> None:
    cheat = Cheat(study, {}, patience=5.0)
    cheat.begin(answer=1)
    assert (cheat.view["problemKind"], cheat.view["step"]["id"]) == ("wrong", "practice-check")
    assert "right" not in json.dumps(cheat.view["step"])  # the page is not told
    cheat.ask(type="answer", step="practice-check", values={"task": 3})
    cheat.ask(type="answer", step="practice-check", values={"task": 2})
    assert cheat.view["step"]["kind"] == "practice"
    assert "2 wrong checks" in cheat.flags()


def test_6_the_script_that_drives_faster_than_time_passes(study: Path) -> None:
    """All ticks at once, and round trips that it makes up: a run takes as long as a person needs."""
    cheat = Cheat(study, {})
    cheat.begin()
    practised(cheat)
    cheat.slept, begun = 0.0, cheat.clock
    cheat.run(200, ("up", 1.0), round_trip=0.0)
    ticks = cheat.view["drive"]["ticks"]
    assert cheat.clock - begun > 0.1 * (ticks - 21) / 1.15
    cheat.session.participant.close()


def test_7_the_script_that_leaves_steps_out(study: Path) -> None:
    cheat = Cheat(study, {})
    for message in (
        {"type": "skip", "step": "page-1"},
        {"type": "answer", "step": "end", "values": {"attention": 4}},
        {"type": "consent", "step": "consent", "ticked": [True]},
        {"type": "read", "step": "thanks"},
    ):
        assert cheat.ask(**message)["problemKind"] == "refused"
    assert cheat.view["step"]["id"] == "page-1"
    cheat.ask(type="read", step="page-1")
    assert cheat.ask(type="consent", step="consent", ticked=[False])["problemKind"] == "refused"
    cheat.session.participant.close()
