"""`sonata2d view` opens, plays, and closes; `sonata2d describe` tells how well raters agree."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pygame
import pytest

from sonata2d.collect.rating import RatingSession
from sonata2d.core.labels import LabelSpec
from sonata2d.window.stage import Stage

from .conftest import Run

SPEC = LabelSpec("slider", question="How well did it go?")


@pytest.fixture
def shown(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """What the window shows, picture by picture; after three, a person presses Escape."""
    screens: list[Any] = []
    turn = Stage.turn

    def watched(stage: Stage, screen: Any) -> Any:
        screens.append(screen)
        if len(screens) == 3:
            pygame.event.post(pygame.Event(pygame.KEYDOWN, key=pygame.K_ESCAPE, mod=0, unicode=""))
        return turn(stage, screen)

    monkeypatch.setattr(Stage, "turn", watched)
    return screens


@pytest.fixture
def out(sonata2d: Run) -> str:
    sonata2d("generate out --scenario quick.yaml --episodes 3 --workers 1 --no-picture")
    return "out"


def test_view_plays_a_data_set_file_after_file(sonata2d: Run, out: str, shown: list[Any]) -> None:
    sonata2d(f"view {out}")
    assert len(shown[0].files) == 3
    assert (shown[0].files.record.path.name, shown[0].projector.view) == ("000000.json", "top")
    assert not pygame.display.get_init()


def test_view_plays_one_file_as_asked(sonata2d: Run, out: str, shown: list[Any]) -> None:
    sonata2d(f"view {out}/000002.json --follow --speed 2 --fps 30")
    assert len(shown[0].files) == 1
    assert (shown[0].player.speed, shown[0].projector.view) == (2.0, "follow")


def test_view_shows_a_controller_at_work(sonata2d: Run, here: Path, shown: list[Any]) -> None:
    sonata2d("view --live --controller social-planner --scenario quick.yaml --seed 3 --follow --speed 2")
    assert type(shown[0]).__name__ == "LiveScreen"
    assert len(shown) >= 3


def test_view_says_in_one_line_what_is_wrong(sonata2d: Run, here: Path, shown: list[Any]) -> None:
    (here / "bad.json").write_text("{")
    assert "bad.json is not whole JSON" in sonata2d("view bad.json", code=1).output
    assert "nowhere does not exist" in sonata2d("view nowhere", code=1).output
    assert "give a DIR|FILE to play, or --live" in sonata2d("view", code=2).output
    assert "--live takes a --controller" in sonata2d("view --live", code=2).output
    assert "--live takes a --controller and no DIR" in sonata2d("view bad.json --live --controller x", code=2).output
    assert "with --controller" in sonata2d("view bad.json --seed 3", code=2).output
    assert shown == []


def test_describe_tells_how_well_raters_agree(sonata2d: Run, out: str, here: Path) -> None:
    """Two raters, three runs, 0.1 apart each: by hand, alpha = 1 - 5/6 * 2 * 3 * 0.005 / 0.175 = 6/7."""
    assert "raters" not in sonata2d(f"describe {out}").output
    for rater, extra in (("ann", 0.0), ("ben", 0.1)):
        session = RatingSession(here / out, rater, SPEC, repeats=0)
        while (record := session.load()) is not None:
            session.rate(record, 0.2 + 0.2 * record.episode + extra, seconds=1.0, whole=True)
    told = sonata2d(f"describe {out}").output
    assert "asked            How well did it go? (slider)" in told
    assert "raters           ann, ben" in told
    assert "6, of 3 runs; 3 of them rated by two or more" in told
    assert "Krippendorff's alpha, interval: 0.857" in told
    assert "within ann       nothing rated twice" in told
    tree = json.loads(sonata2d(f"describe {out} --json").output)
    assert tree["episodes"] == "3 of 3"
    (asked,) = tree["ratings"]
    assert (asked["raters"], asked["ratings"], asked["runs_rated_by_two_or_more"]) == (["ann", "ben"], 6, 3)
    assert asked["between_raters"]["value"] == pytest.approx(6 / 7)
    assert "no problems" in sonata2d(f"check {out} --workers 1").output


def test_describe_takes_rated_files_without_a_manifest(sonata2d: Run, out: str, here: Path) -> None:
    (here / "loose").mkdir()
    (here / "loose/one.json").write_bytes((here / out / "000000.json").read_bytes())
    session = RatingSession(here / "loose", "ann", SPEC)
    record = session.load()
    assert record is not None
    session.rate(record, 1.0, seconds=1.0, whole=True)
    assert "not defined" in sonata2d("describe loose").output
