"""Sizes and languages: texts fit and stay readable in every window."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pygame
import pytest

from sonata2d.collect.texts import choose_language, languages
from sonata2d.view.fonts import EM
from sonata2d.window.cards import Card
from sonata2d.window.hud import legend_box
from sonata2d.window.stage import fitting_size
from sonata2d.window.view_screen import ViewScreen

from .conftest import Line
from .driver import Driver
from .volunteer import Person


@pytest.fixture(autouse=True)
def _english() -> Iterator[None]:
    yield
    choose_language("en")


def test_every_size_and_state_is_drawn(driver: Callable[..., Driver]) -> None:
    person = driver(label={"kind": "yes_no", "question": "Was it polite?"})
    for size in ((640, 480), (1600, 900)):
        person.resize(size)
        for key in (pygame.K_F1, pygame.K_F1, pygame.K_ESCAPE, pygame.K_ESCAPE, pygame.K_g, pygame.K_ESCAPE):
            person.press(key)
            assert person.stage.size == size
        person.drive(person.session, seconds=0.5)
        person.press(pygame.K_p, pygame.K_RETURN, pygame.K_RETURN, pygame.K_y)
        person.press(pygame.K_BACKSPACE)


@pytest.mark.parametrize("size", [(1024, 640), (1280, 800), (1920, 1200), (2560, 1600)])
def test_texts_and_widgets_have_the_scale_of_the_window(size: tuple[int, int], driver: Callable[..., Driver]) -> None:
    person = driver(size=size)
    person.press(pygame.K_ESCAPE)
    card, button = person.collect.overlay.card, person.buttons["Continue"]
    assert card is not None
    scale = size[0] / 1280
    assert person.stage.ui.get_theme().get_font(["button"]).get_point_size() == pytest.approx(20 * scale, abs=1.1)
    assert button.height == pytest.approx(42 * scale, abs=1.1)
    assert card.box.width == pytest.approx(640 * scale, abs=1.1)


def test_the_window_leaves_room_on_every_desktop() -> None:
    for desktop in ((1024, 700), (1280, 800), (1366, 768), (1920, 1080), (3840, 2160)):
        width, height = fitting_size(desktop)
        assert width <= 0.97 * desktop[0]
        assert height <= 0.97 * desktop[1]
        assert width >= min(1024, 0.95 * desktop[0])
        assert height >= min(640, 0.95 * desktop[1])


@pytest.mark.parametrize("language", languages())
@pytest.mark.parametrize("size", [(1024, 640), (1280, 800)])
def test_the_help_does_not_cover_the_legend_in_any_language(
    size: tuple[int, int], language: str, driver: Callable[..., Driver], tmp_path: Path
) -> None:
    choose_language(language)
    person = driver(size=size, humans=[6, 6], room={"kinds": "square", "side": 9}, relations=[2, 2])
    person.press(pygame.K_F1, pygame.K_z)
    card, session = person.collect.overlay.card, person.session
    assert card is not None
    assert not card.box.colliderect(legend_box(size, session.after, zones=True, scale=person.stage.scale))
    person.press(pygame.K_F1)
    person.drive(session, seconds=0.2)
    person.press(pygame.K_RETURN, pygame.K_RETURN)
    viewer = Person(lambda: ViewScreen([person.kept_file()]), size)
    viewer.press(pygame.K_F1, pygame.K_z, pygame.K_t)
    view = viewer.screen
    assert isinstance(view, ViewScreen)
    assert view.card is not None
    picture = size[0], view.picture.height
    legend = legend_box(picture, view.player.moment, zones=True, paths=True, scale=viewer.stage.scale)
    assert not view.card.box.colliderect(legend)


@pytest.mark.parametrize("language", languages())
@pytest.mark.parametrize("size", [(640, 480), (1024, 640)])
def test_the_help_shows_keys_and_meanings_in_full(
    size: tuple[int, int], language: str, driver: Callable[..., Driver], drawn: list[Line]
) -> None:
    choose_language(language)
    person = driver(size=size)
    person.press(pygame.K_F1, pygame.K_h)
    drawn.clear()
    person.wait()
    assert [words for words, _ in drawn if words.endswith("…")] == []
    card = person.collect.overlay.card
    assert card is not None
    assert person.stage.surface.get_rect().contains(card.box)
    person.press(pygame.K_F1)
    person.drive(person.session, seconds=1.0)
    person.press(pygame.K_RETURN, pygame.K_RETURN)
    viewer = Person(lambda: ViewScreen([person.kept_file()]), size)
    viewer.press(pygame.K_i, pygame.K_F1, pygame.K_h)
    drawn.clear()
    viewer.wait()
    cut = {words for words, _ in drawn if words.endswith("…")}
    assert {words for words in cut if "zoe" not in words} == set(), "only the line about the run may be too long"


def test_keys_are_readable_in_small_windows(driver: Callable[..., Driver], drawn: list[Line]) -> None:
    person = driver(size=(1024, 640))
    person.wait()
    (size,) = {size for words, size in drawn if words == "F1"}
    assert size * EM >= 13, "px of the em square"


def test_long_keys_and_meanings_are_wrapped(driver: Callable[..., Driver], drawn: list[Line]) -> None:
    person = driver(size=(640, 480))
    pairs = [("wheel " * 8, "turn"), ("W", "drive " * 20), ("A", "brake")]
    card = Card(person.stage.ui, person.stage.scale, "Keys", pairs)
    drawn.clear()
    card.draw(person.stage.surface)
    words = " ".join(line.words for line in drawn)
    assert [words.count(word) for word in ("wheel", "drive", "brake", "…")] == [8, 20, 1, 0]
    assert person.stage.surface.get_rect().contains(card.box)


@pytest.mark.parametrize("size", [(120, 90), (300, 60), (1, 1)])
def test_a_window_that_is_dragged_to_a_tiny_size_stays_open(
    driver: Callable[..., Driver], size: tuple[int, int]
) -> None:
    person = driver(size=size)
    person.drive(person.session, seconds=1.0)
    person.press(pygame.K_RETURN, pygame.K_RETURN)
    viewer = Person(lambda: ViewScreen([person.kept_file()]), size)
    viewer.press(pygame.K_v, pygame.K_F1)
    viewer.wait()
