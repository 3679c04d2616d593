"""`sonata2d view` plays episodes in a window; `sonata2d describe` shows the agreement of raters."""

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
    """The screens shown by the window, picture by picture; after three, Escape is pressed."""
    screens: list[Any] = []
    show_frame = Stage.show_frame

    def show_frame_and_count(stage: Stage, screen: Any) -> Any:
        screens.append(screen)
        if len(screens) == 3:
            pygame.event.post(pygame.Event(pygame.KEYDOWN, key=pygame.K_ESCAPE, mod=0, unicode=""))
        return show_frame(stage, screen)

    monkeypatch.setattr(Stage, "show_frame", show_frame_and_count)
    return screens


@pytest.fixture
def out(sonata2d: Run) -> str:
    sonata2d("generate out --scenario quick.yaml --episodes 3 --workers 1 --no-picture")
    return "out"


def test_view_plays_all_episodes_of_a_data_set(sonata2d: Run, out: str, shown: list[Any]) -> None:
    sonata2d(f"view {out}")
    assert len(shown[0].files) == 3
    assert (shown[0].files.record.path.name, shown[0].camera.view) == ("000000.json", "top")
    assert not pygame.display.get_init()


def test_view_plays_one_file_with_options(sonata2d: Run, out: str, shown: list[Any]) -> None:
    sonata2d(f"view {out}/000002.json --follow --speed 2 --fps 30")
    assert len(shown[0].files) == 1
    assert (shown[0].player.speed, shown[0].camera.view) == (2.0, "follow")


def test_view_live_runs_a_controller(sonata2d: Run, here: Path, shown: list[Any]) -> None:
    sonata2d("view --live --controller social-planner --scenario quick.yaml --seed 3 --follow --speed 2")
    assert type(shown[0]).__name__ == "LiveScreen"
    assert len(shown) >= 3


def test_view_refuses_invalid_arguments(sonata2d: Run, here: Path, shown: list[Any]) -> None:
    (here / "bad.json").write_text("{")
    assert "bad.json is not valid JSON" in sonata2d("view bad.json", code=1).output
    assert "nowhere does not exist" in sonata2d("view nowhere", code=1).output
    assert "give a DIR|FILE to play, or --live" in sonata2d("view", code=2).output
    assert "--live needs --controller" in sonata2d("view --live", code=2).output
    assert (
        "--live needs --controller and takes no DIR" in sonata2d("view bad.json --live --controller x", code=2).output
    )
    assert "with --controller" in sonata2d("view bad.json --seed 3", code=2).output
    assert shown == []


def test_describe_shows_the_agreement_of_raters(sonata2d: Run, out: str, here: Path) -> None:
    """Two raters whose ratings of three runs differ by 0.1: by hand, alpha = 1 - 5/6 * 2 * 3 * 0.005 / 0.175 = 6/7."""
    assert "raters" not in sonata2d(f"describe {out}").output
    for rater, extra in (("ann", 0.0), ("ben", 0.1)):
        session = RatingSession(here / out, rater, SPEC, repeats=0)
        while (record := session.load()) is not None:
            session.rate(record, 0.2 + 0.2 * record.episode + extra, seconds=1.0, whole=True)
    output = sonata2d(f"describe {out}").output
    assert "asked            How well did it go? (slider)" in output
    assert "raters           ann, ben" in output
    assert "6, of 3 runs; 3 of them rated by two or more" in output
    assert "Krippendorff's alpha, interval: 0.857" in output
    assert "within ann       no run rated twice" in output
    tree = json.loads(sonata2d(f"describe {out} --json").output)
    assert tree["episodes"] == "3 of 3"
    (question,) = tree["ratings"]
    assert (question["raters"], question["ratings"], question["shared"]) == (["ann", "ben"], 6, 3)
    assert question["alpha"] == pytest.approx(6 / 7)
    assert "no problems" in sonata2d(f"check {out} --workers 1").output


def test_describe_accepts_rated_files_without_a_manifest(sonata2d: Run, out: str, here: Path) -> None:
    (here / "loose").mkdir()
    (here / "loose/one.json").write_bytes((here / out / "000000.json").read_bytes())
    session = RatingSession(here / "loose", "ann", SPEC)
    record = session.load()
    assert record is not None
    session.rate(record, 1.0, seconds=1.0, whole=True)
    assert "not defined" in sonata2d("describe loose").output
