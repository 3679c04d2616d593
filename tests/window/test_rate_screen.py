"""The rating screen, operated by keys and mouse."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pygame
import pytest

from sonata2d.collect.rating import Rating, RatingSession, ratings_of
from sonata2d.collect.texts import text
from sonata2d.core.labels import LabelSpec
from sonata2d.errors import RecordError
from sonata2d.record.recorder import JsonRecorder
from sonata2d.window.rate_screen import RateScreen, rating_end, rating_start

from ..record.samples import run
from .conftest import Line
from .volunteer import Person

CLASSES = LabelSpec("classes", question="How polite?", classes=("poor", "fair", "good"))
LONG = "The robot brings medicine to a patient next door; the people here know it. " * 12
TICKS = 4


class Rater(Person):
    """A person at the rating screen."""

    def __init__(self, folder: Path, spec: LabelSpec, *, size: tuple[int, int] = (1280, 800), **options: Any) -> None:
        self.folder = folder
        self.session = RatingSession(folder, "ann", spec, repeats=0, **options)
        self.rating = RateScreen(self.session)
        super().__init__(lambda: self.rating, size)
        self.wait()

    def watch(self, *, begin: bool = True) -> None:
        """Begin if needed, and watch the run to its end."""
        if begin:
            self.press(pygame.K_SPACE)
        for _ in range(200):
            if self.rating.answer is not None:
                self.wait()
                return
            self.rating.advance(0.05)
        raise AssertionError("the answer was never shown")

    @property
    def ratings(self) -> list[Rating]:
        return ratings_of(self.folder)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for k in range(3):
        with JsonRecorder(tmp_path / f"run-{k}.json", context=LONG, contributor="Zoë") as recorder:
            run(recorder, ticks=TICKS)
    return tmp_path


KEYS: list[tuple[LabelSpec, tuple[int, ...], Any]] = [
    (LabelSpec("yes_no"), (pygame.K_y,), True),
    (LabelSpec("yes_no"), (pygame.K_y, pygame.K_n), False),
    (LabelSpec("yes_no"), (pygame.K_LEFT,), False),
    (CLASSES, (pygame.K_3,), 3),
    (CLASSES, (pygame.K_KP1, pygame.K_RIGHT), 2),
    (CLASSES, (pygame.K_2, pygame.K_9), 2),
    (LabelSpec("slider"), (pygame.K_RIGHT,), 0.5),
    (LabelSpec("slider"), (pygame.K_LEFT, pygame.K_LEFT, pygame.K_LEFT), 0.4),
]


@pytest.mark.parametrize(("spec", "keys", "label"), KEYS)
def test_every_kind_is_answered_by_keys(spec: LabelSpec, keys: tuple[int, ...], label: Any, folder: Path) -> None:
    rater = Rater(folder, spec)
    rater.watch()
    rater.press(*keys, pygame.K_RETURN)
    (rating,) = rater.ratings
    assert (rating.label, rating.rater, rating.showing, rating.whole) == (label, "ann", 1, True)
    assert rater.rating.answer is None


def test_letters_of_a_text_answer_are_not_commands(folder: Path) -> None:
    rater = Rater(folder, LabelSpec("text"))
    rater.watch()
    rater.frames(2)
    rater.type("r v")
    assert rater.rating.player.at_end  # the key R restarts the run
    rater.press(pygame.K_RETURN)
    rater.frames(2)
    assert [rating.label for rating in rater.ratings] == ["r v"]


def test_there_is_no_answer_before_the_run_was_watched_to_its_end(folder: Path) -> None:
    rater = Rater(folder, CLASSES)
    rater.press(pygame.K_SPACE)
    rater.press(pygame.K_3, pygame.K_RETURN)
    assert rater.rating.answer is None
    line = rater.rating.timeline.box
    rater.click(line.right - 2, line.centery)  # the timeline cannot be dragged yet
    assert rater.ratings == []
    assert rater.rating.player.fraction < 0.9
    rater.watch(begin=False)
    rater.press(pygame.K_RETURN)
    assert rater.ratings == []
    assert rater.rating.notice == text("rating.answer_first")


def test_there_is_no_default_answer(folder: Path) -> None:
    for spec in (CLASSES, LabelSpec("slider"), LabelSpec("yes_no"), LabelSpec("text")):
        rater = Rater(folder, spec)
        rater.watch()
        assert rater.rating.answer is not None
        assert rater.rating.answer.label is None
        pygame.quit()


def test_the_mouse_answers_and_saves(folder: Path) -> None:
    rater = Rater(folder, CLASSES)
    rater.watch()
    assert rater.rating.answer is not None
    assert rater.rating.answer.choices is not None
    rater.click(*rater.rating.answer.choices.places[1].center)
    assert rater.rating.answer.label == 2
    rater.push("Save & next")
    assert [rating.label for rating in rater.ratings] == [2]


def test_the_slider_is_dragged(folder: Path) -> None:
    rater = Rater(folder, LabelSpec("slider"))
    rater.watch()
    answer = rater.rating.answer
    assert answer is not None
    assert answer.scale is not None
    track = answer.scale.track
    rater.mouse(pygame.MOUSEBUTTONDOWN, (track.left + track.width // 4, track.centery))
    assert answer.label == pytest.approx(0.25, abs=0.002)
    rater.mouse(pygame.MOUSEMOTION, (5000, 0))
    rater.mouse(pygame.MOUSEBUTTONUP, (5000, 0))
    rater.mouse(pygame.MOUSEMOTION, (0, 0), held=False)
    assert answer.label == 1.0


def test_watching_again_keeps_the_answer_and_adds_the_seconds(folder: Path) -> None:
    rater = Rater(folder, CLASSES)
    rater.watch()
    rater.press(pygame.K_3, pygame.K_r)
    for _ in range(20):
        rater.rating.advance(0.05)
    rater.press(pygame.K_RETURN)
    (rating,) = rater.ratings
    assert rating.label == 3
    assert 2 * TICKS * 0.1 <= rating.seconds < 3 * TICKS * 0.1


def test_an_answer_outlives_resizing(folder: Path) -> None:
    for spec, key, label in ((CLASSES, pygame.K_3, 3), (LabelSpec("slider"), pygame.K_RIGHT, 0.5)):
        rater = Rater(folder, spec)
        rater.watch()
        rater.press(key)
        rater.resize((800, 600))
        assert rater.rating.answer is not None
        assert rater.rating.answer.label == label
        pygame.quit()


def test_escape_closes_and_the_next_session_continues(folder: Path) -> None:
    rater = Rater(folder, CLASSES)
    rater.watch()
    rater.press(pygame.K_1, pygame.K_RETURN)
    rater.press(pygame.K_ESCAPE)
    assert rater.is_open, "the first press only asks"
    rater.press(pygame.K_ESCAPE)
    assert not rater.is_open
    pygame.quit()
    again = Rater(folder, CLASSES)
    assert "33 % of the runs are rated." in rating_start(again.session)[1]


def test_a_break_comes_between_runs_and_thanks_come_last(folder: Path) -> None:
    rater = Rater(folder, CLASSES, break_after=2)
    rater.press(pygame.K_SPACE)
    phases = []
    for _ in range(3):
        rater.watch(begin=False)
        rater.press(pygame.K_2, pygame.K_RETURN)
        phases.append(rater.rating.phase)
        if rater.rating.phase == "break":
            rater.press(pygame.K_SPACE)
    assert phases == ["watch", "break", "end"]
    assert len(rater.ratings) == 3
    assert rating_end(rater.session) == ("Thank you!", ["All runs are rated."])
    rater.press(pygame.K_RETURN)
    assert not rater.is_open


def test_a_full_disk_is_reported_and_the_answer_stays(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    rater = Rater(folder, CLASSES)
    rater.watch()
    rater.press(pygame.K_2)

    def full(*_: Any, **__: Any) -> None:
        raise RecordError("ann.jsonl cannot be written: No space left on device")

    monkeypatch.setattr(rater.session, "rate", full)
    rater.press(pygame.K_RETURN)
    assert "No space left" in rater.rating.notice
    monkeypatch.undo()
    rater.press(pygame.K_RETURN)
    assert [rating.label for rating in rater.ratings] == [2]


def test_neither_file_nor_driver_is_shown(folder: Path, drawn: list[Line]) -> None:
    rater = Rater(folder, CLASSES)
    rater.watch()
    rater.frames(2)
    words = " ".join(line.words for line in drawn)
    assert "How polite?" in words
    assert "0 %" in words
    assert not re.search(r"\d of \d", words), "the number of showings reveals that some are repeats"
    assert "run-" not in words
    assert "Zoë" not in words


@pytest.mark.parametrize("size", [(1280, 800), (800, 600), (640, 480)])
@pytest.mark.parametrize("kind", ["yes_no", "classes", "slider", "text"])
def test_it_draws_in_every_size_with_long_texts(kind: Any, size: tuple[int, int], folder: Path) -> None:
    names = tuple(f"a class with a long name, number {k}" for k in range(1, 10)) if kind == "classes" else ()
    rater = Rater(folder, LabelSpec(kind, question=LONG[:200], classes=names, ends=("x" * 90, "y" * 90)), size=size)
    rater.watch()
    rater.frames(2)
    picture = rater.rating.picture
    assert picture.height > size[1] / 5
    assert pygame.Rect((0, 0), size).contains(picture)
    assert all(not rect.colliderect(picture) for rect in rater.buttons.values())
