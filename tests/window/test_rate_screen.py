"""Rating by keys and mouse, as a person does it, on a window that nobody sees."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pygame
import pytest

from sonata2d.collect.rating import Rating, RatingSession, ratings_of
from sonata2d.core.labels import LabelSpec
from sonata2d.errors import RecordError
from sonata2d.record.recorder import JsonRecorder
from sonata2d.window.rate_cards import end_card, start_card
from sonata2d.window.rate_screen import RateScreen
from sonata2d.window.stage import Stage

from ..record.samples import run

CLASSES = LabelSpec("classes", question="How polite?", classes=("poor", "fair", "good"))
LONG = "The robot brings medicine to a patient next door; the people here know it. " * 12
TICKS = 4


class Sitting:
    """A person in front of the window."""

    def __init__(self, folder: Path, spec: LabelSpec, *, size: tuple[int, int] = (1280, 800), **how: Any) -> None:
        self.folder = folder
        self.session = RatingSession(folder, "ann", spec, repeats=0, **how)
        self.stage = Stage(size=size)
        self.screen = RateScreen(self.session)
        self.screen.enter(self.stage)
        self.is_open = True
        self.turn(2)

    def turn(self, pictures: int = 1) -> None:
        for _ in range(pictures):
            self.is_open = self.is_open and self.stage.turn(self.screen) is not None

    def press(self, *keys: int, mod: int = 0) -> None:
        for key in keys:
            for kind in (pygame.KEYDOWN, pygame.KEYUP):
                pygame.event.post(pygame.Event(kind, key=key, mod=mod, unicode="", scancode=0))
            self.turn()

    def type(self, text: str) -> None:
        for letter in text:
            for kind in (pygame.KEYDOWN, pygame.KEYUP):
                pygame.event.post(pygame.Event(kind, key=pygame.key.key_code(letter), mod=0, unicode=letter))
            pygame.event.post(pygame.Event(pygame.TEXTINPUT, text=letter))
        self.turn(2)

    def click(self, place: tuple[int, int]) -> None:
        pygame.mouse.set_pos(place)
        for kind in (pygame.MOUSEBUTTONDOWN, pygame.MOUSEBUTTONUP):
            self.turn()
            pygame.event.post(pygame.Event(kind, pos=place, button=1))
        self.turn(2)

    def watch(self) -> None:
        """To the end of the run; time is made to pass."""
        for _ in range(200):
            if self.screen.answer is not None:
                return
            self.screen.advance(0.05)
        raise AssertionError("the answer never opened")

    @property
    def ratings(self) -> list[Rating]:
        return ratings_of(self.folder)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for k in range(3):
        with JsonRecorder(tmp_path / f"run-{k}.json", context=LONG, contributor="Zoë") as recorder:
            run(recorder, ticks=TICKS)
    return tmp_path


@pytest.fixture(autouse=True)
def closed() -> Iterator[None]:
    yield
    pygame.quit()


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
    sitting = Sitting(folder, spec)
    sitting.press(pygame.K_SPACE)
    sitting.watch()
    sitting.press(*keys, pygame.K_RETURN)
    (rating,) = sitting.ratings
    assert (rating.label, rating.rater, rating.showing, rating.whole) == (label, "ann", 1, True)
    assert sitting.screen.answer is None


def test_a_text_is_typed_and_its_letters_are_no_commands(folder: Path) -> None:
    sitting = Sitting(folder, LabelSpec("text"))
    sitting.press(pygame.K_SPACE)
    sitting.watch()
    sitting.turn(2)
    sitting.type("r v")
    assert sitting.screen.player is not None
    assert sitting.screen.player.at_end  # R would have begun it again
    sitting.press(pygame.K_RETURN)
    sitting.turn(2)
    assert [rating.label for rating in sitting.ratings] == ["r v"]


def test_the_answer_is_closed_until_the_run_was_watched_to_its_end(folder: Path) -> None:
    sitting = Sitting(folder, CLASSES)
    sitting.press(pygame.K_SPACE)
    sitting.press(pygame.K_3, pygame.K_RETURN)
    assert sitting.screen.answer is None
    line = sitting.screen._line.box
    sitting.click((line.right - 2, line.centery))  # the time line cannot be dragged ahead either
    assert sitting.ratings == []
    assert sitting.screen.player is not None
    assert sitting.screen.player.share < 0.9
    sitting.watch()
    sitting.press(pygame.K_RETURN)
    assert sitting.ratings == []
    assert "answer first" in sitting.screen._notice


def test_nothing_is_chosen_before_the_person_chooses(folder: Path) -> None:
    for spec in (CLASSES, LabelSpec("slider"), LabelSpec("yes_no"), LabelSpec("text")):
        sitting = Sitting(folder, spec)
        sitting.press(pygame.K_SPACE)
        sitting.watch()
        assert sitting.screen.answer is not None
        assert sitting.screen.answer.label is None
        pygame.quit()


def test_the_mouse_answers_and_saves(folder: Path) -> None:
    sitting = Sitting(folder, CLASSES)
    sitting.press(pygame.K_SPACE)
    sitting.watch()
    assert sitting.screen.answer is not None
    sitting.click(sitting.screen.answer._buttons[1].rect.center)
    assert sitting.screen.answer.label == 2
    sitting.click(sitting.screen._save_button.rect.center)
    assert [rating.label for rating in sitting.ratings] == [2]


def test_the_slider_is_dragged_from_end_to_end(folder: Path) -> None:
    sitting = Sitting(folder, LabelSpec("slider"))
    sitting.press(pygame.K_SPACE)
    sitting.watch()
    answer = sitting.screen.answer
    assert answer is not None
    assert answer._scale is not None
    track = answer._scale.track
    pygame.event.post(
        pygame.Event(pygame.MOUSEBUTTONDOWN, pos=(track.left + track.width // 4, track.centery), button=1)
    )
    sitting.turn()
    assert answer.label == pytest.approx(0.25, abs=0.002)
    pygame.event.post(pygame.Event(pygame.MOUSEMOTION, pos=(5000, 0), rel=(1, 1), buttons=(1, 0, 0)))
    pygame.event.post(pygame.Event(pygame.MOUSEBUTTONUP, pos=(5000, 0), button=1))
    pygame.event.post(pygame.Event(pygame.MOUSEMOTION, pos=(0, 0), rel=(1, 1), buttons=(0, 0, 0)))
    sitting.turn()
    assert answer.label == 1.0


def test_seen_again_the_answer_stays_open_and_the_seconds_add_up(folder: Path) -> None:
    sitting = Sitting(folder, CLASSES)
    sitting.press(pygame.K_SPACE)
    sitting.watch()
    sitting.press(pygame.K_3, pygame.K_r)
    for _ in range(20):
        sitting.screen.advance(0.05)
    sitting.press(pygame.K_RETURN)
    (rating,) = sitting.ratings
    assert rating.label == 3
    assert 2 * TICKS * 0.1 <= rating.seconds < 3 * TICKS * 0.1


def test_an_answer_outlives_a_change_of_the_windows_size(folder: Path) -> None:
    for spec, key, label in ((CLASSES, pygame.K_3, 3), (LabelSpec("slider"), pygame.K_RIGHT, 0.5)):
        sitting = Sitting(folder, spec)
        sitting.press(pygame.K_SPACE)
        sitting.watch()
        sitting.press(key)
        pygame.display.set_mode((800, 600), pygame.RESIZABLE)
        pygame.event.post(pygame.Event(pygame.VIDEORESIZE, size=(800, 600), w=800, h=600))
        sitting.turn(2)
        assert sitting.screen.answer is not None
        assert sitting.screen.answer.label == label
        pygame.quit()


def test_escape_closes_at_any_time_and_the_next_sitting_goes_on(folder: Path) -> None:
    sitting = Sitting(folder, CLASSES)
    sitting.press(pygame.K_SPACE)
    sitting.watch()
    sitting.press(pygame.K_1, pygame.K_RETURN)
    sitting.press(pygame.K_ESCAPE)
    assert not sitting.is_open
    pygame.quit()
    again = Sitting(folder, CLASSES)
    assert start_card(again.session)[1][2] == "2 of 3 runs are left for ann."


def test_a_rest_comes_between_and_thanks_come_last(folder: Path) -> None:
    sitting = Sitting(folder, CLASSES, break_after=2)
    sitting.press(pygame.K_SPACE)
    phases = []
    for _ in range(3):
        sitting.watch()
        sitting.press(pygame.K_2, pygame.K_RETURN)
        phases.append(sitting.screen.phase)
        if sitting.screen.phase == "break":
            sitting.press(pygame.K_SPACE)
    assert phases == ["watch", "break", "end"]
    assert len(sitting.ratings) == 3
    title, lines = end_card(sitting.session)
    assert title == "Thank you!"
    assert f"The ratings are in {sitting.session.path}" in lines
    sitting.press(pygame.K_RETURN)
    assert not sitting.is_open


def test_a_disk_that_takes_no_more_is_told_and_the_answer_stays(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    sitting = Sitting(folder, CLASSES)
    sitting.press(pygame.K_SPACE)
    sitting.watch()
    sitting.press(pygame.K_2)

    def full(*_: Any, **__: Any) -> None:
        raise RecordError("ann.jsonl cannot be written: No space left on device")

    monkeypatch.setattr(sitting.session, "rate", full)
    sitting.press(pygame.K_RETURN)
    assert "No space left" in sitting.screen._notice
    monkeypatch.undo()
    sitting.press(pygame.K_RETURN)
    assert [rating.label for rating in sitting.ratings] == [2]


def test_neither_file_nor_driver_is_shown(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from sonata2d.window import rate_screen

    written: list[str] = []
    write = rate_screen.write
    monkeypatch.setattr(
        rate_screen, "write", lambda surface, text, *a, **k: (written.append(text), write(surface, text, *a, **k))[1]
    )
    sitting = Sitting(folder, CLASSES)
    sitting.press(pygame.K_SPACE)
    sitting.watch()
    sitting.turn(2)
    told = " ".join(written)
    assert "How polite?" in told
    assert "1 of 3" in told
    assert "run-" not in told
    assert "Zoë" not in told


@pytest.mark.parametrize("size", [(1280, 800), (800, 600), (640, 480)])
@pytest.mark.parametrize("kind", ["yes_no", "classes", "slider", "text"])
def test_it_draws_in_every_size_with_long_texts(kind: Any, size: tuple[int, int], folder: Path) -> None:
    names = tuple(f"a class with a long name, number {k}" for k in range(1, 10)) if kind == "classes" else ()
    sitting = Sitting(folder, LabelSpec(kind, question=LONG[:200], classes=names, ends=("x" * 90, "y" * 90)), size=size)
    sitting.press(pygame.K_SPACE)
    sitting.watch()
    sitting.turn(2)
    screen = sitting.screen
    assert screen._picture.height > size[1] / 4
    assert screen._head.bottom == screen._picture.top
    assert screen._picture.bottom == screen._bar.top
