"""The window among people who come and go: it drives, replays and drives live."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pygame
import pytest

import sonata2d as s2
from sonata2d.datasets.verification import verify
from sonata2d.record.recorder import JsonRecorder
from sonata2d.window.view_screen import ViewScreen

from .test_collect_screen import Desk
from .volunteer import Person

PASSERS = [
    {"x": -2.0, "y": 1.5, "goals": [[2.0, 1.5]], "exits": True},
    {"x": -2.0, "y": 2.0, "goals": [[2.0, 2.0]], "exits": True, "enters": 0.5},
    {"track": [[0.8, 2.2, -1.0], [1.2, 0.5, -1.5], [2.0, -2.0, -1.5]]},
]


@pytest.fixture(autouse=True)
def closed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setenv("SONATA2D_CONFIG", str(tmp_path / "config"))
    yield
    pygame.quit()


def test_a_person_drives_among_them_and_the_run_is_proven(tmp_path: Path) -> None:
    journey = {"robot": {"pose": (-1.5, 0.0, 0.0)}, "goal": {"position": (0.0, 0.0)}}
    desk = Desk(tmp_path / "runs", size=(500, 400), people=PASSERS, humans=0, **journey)
    desk.person.drive(desk.session)
    assert desk.session.outcome is not None
    desk.person.press(pygame.K_RETURN)
    desk.session._journal.shut()
    desk.session._folder._lock.release()
    assert desk.session.kept == 1
    assert verify(tmp_path / "runs", replay=True) == []


def test_they_are_seen_at_every_moment_of_a_replay(tmp_path: Path) -> None:
    settings = {"room": {"kinds": "square", "side": 6}, "humans": 0, "relations": 0, "tables": 0, "people": PASSERS}
    config = s2.ScenarioConfig(**settings, rules={"time_limit": 1.5, "ends_on": ["time"]})  # type: ignore[arg-type]
    with JsonRecorder(tmp_path / "one.json") as recorder:
        s2.Episode(s2.generate(config, 1), s2.SocialPlanner(), observers=[recorder]).run()
    screen = ViewScreen([tmp_path / "one.json"])
    person = Person(lambda: screen, (500, 400))
    seen = set()
    for _ in range(120):
        person.wait()
        seen.add(len(screen.files.record.snapshot(screen.player.index).humans))
    assert seen >= {1, 2, 3}
    assert screen.player.index == 15
