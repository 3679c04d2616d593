"""Recorded runs in the window, by keys and mouse."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pygame
import pytest

from sonata2d.errors import RecordError
from sonata2d.record.recorder import JsonRecorder
from sonata2d.window import facts as words
from sonata2d.window.stage import Stage
from sonata2d.window.view_screen import ViewScreen

from ..record.samples import run

TICKS = 30


class Watching:
    """A person in front of the window."""

    def __init__(self, paths: list[Path], *, size: tuple[int, int] = (1280, 800)) -> None:
        self.stage = Stage(size=size)
        self.screen = ViewScreen(paths)
        self.screen.enter(self.stage)
        self.is_open = True
        self.turn()

    def turn(self, pictures: int = 1) -> None:
        for _ in range(pictures):
            self.is_open = self.is_open and self.stage.turn(self.screen) is not None

    def press(self, *keys: int, mod: int = 0) -> None:
        for key in keys:
            pygame.event.post(pygame.Event(pygame.KEYDOWN, key=key, mod=mod, unicode="", scancode=0))
            self.turn()

    def mouse(self, kind: int, place: tuple[int, int]) -> None:
        pygame.event.post(pygame.Event(kind, pos=place, button=1, rel=(0, 0), buttons=(1, 0, 0)))
        self.turn()

    @property
    def index(self) -> int:
        return self.screen.player.index

    @property
    def file(self) -> str:
        return self.screen.files.record.path.name


@pytest.fixture
def paths(tmp_path: Path) -> list[Path]:
    found = [tmp_path / f"run-{k}.json" for k in range(3)]
    for path in found:
        with JsonRecorder(path, contributor="Zoë", context="It is in a hurry.") as recorder:
            run(recorder, ticks=TICKS, labels=lambda tick: {"near": tick < 5})
    return found


@pytest.fixture(autouse=True)
def closed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.chdir(tmp_path)
    yield
    pygame.quit()


def test_space_pauses_and_arrows_step_by_frames_and_by_seconds(paths: list[Path]) -> None:
    watching = Watching(paths)
    watching.press(pygame.K_SPACE, pygame.K_HOME, pygame.K_SPACE)
    assert not watching.screen.player.playing
    at = watching.index
    watching.press(pygame.K_RIGHT, pygame.K_RIGHT)
    assert watching.index == at + 2
    watching.press(pygame.K_RIGHT, mod=pygame.KMOD_SHIFT)
    assert watching.index == at + 12
    watching.press(pygame.K_LEFT)
    assert watching.index == at + 11
    watching.turn(5)
    assert watching.index == at + 11


def test_the_time_line_is_dragged(paths: list[Path]) -> None:
    watching = Watching(paths)
    watching.press(pygame.K_SPACE)
    box = watching.screen._line.box
    watching.mouse(pygame.MOUSEBUTTONDOWN, box.center)
    assert watching.index == TICKS // 2
    watching.mouse(pygame.MOUSEMOTION, (box.right + 50, 0))
    assert watching.index == TICKS
    watching.mouse(pygame.MOUSEBUTTONUP, (box.right + 50, 0))
    watching.mouse(pygame.MOUSEMOTION, box.center)
    assert watching.index == TICKS


def test_buttons_do_what_keys_do(paths: list[Path]) -> None:
    watching = Watching(paths)
    button = watching.screen._play_button
    for kind in (pygame.MOUSEBUTTONDOWN, pygame.MOUSEBUTTONUP):
        pygame.mouse.set_pos(button.rect.center)
        watching.mouse(kind, button.rect.center)
    watching.turn(2)
    assert not watching.screen.player.playing
    assert button.text == "Play"


def test_files_follow_one_another_and_end_with_the_last(paths: list[Path]) -> None:
    watching = Watching(paths)
    seen = []
    for _ in range(4):
        seen.append(watching.file)
        watching.screen.advance(10.0)  # to the end
        watching.screen.advance(1.0)
        assert watching.file == seen[-1]  # a moment to look
        watching.screen.advance(1.0)
    assert seen == ["run-0.json", "run-1.json", "run-2.json", "run-2.json"]
    watching.press(pygame.K_n)
    assert watching.screen.notice == "this is the last file"
    watching.press(pygame.K_PAGEUP, pygame.K_b)
    assert watching.file == "run-0.json"


def test_speed_camera_and_layers_stay_from_file_to_file(paths: list[Path]) -> None:
    watching = Watching(paths)
    watching.press(pygame.K_PLUS, pygame.K_v, pygame.K_z, pygame.K_t, pygame.K_n)
    screen = watching.screen
    assert watching.file == "run-1.json"
    assert (screen.player.speed, screen.projector.view) == (2.0, "follow")
    assert (screen.projector.zones, screen.projector.trails) == (True, True)
    watching.turn(3)


def test_damaged_files_are_passed_over_with_a_notice(paths: list[Path]) -> None:
    paths[0].write_text("{")
    paths[1].write_text("[]")
    watching = Watching(paths)
    assert watching.file == "run-2.json"
    assert "passed over" in watching.screen.notice
    assert "run-1.json" in watching.screen.notice
    watching.press(pygame.K_b)
    assert watching.file == "run-2.json"
    assert "this is the first file; passed over" in watching.screen.notice
    assert watching.is_open


def test_without_any_good_file_there_is_one_clear_error(paths: list[Path]) -> None:
    for path in paths:
        path.write_text("{")
    with pytest.raises(RecordError, match=r"run-2\.json is not whole JSON"):
        ViewScreen(paths)


def test_a_moment_is_saved_as_picture_and_as_drawing(paths: list[Path], tmp_path: Path) -> None:
    watching = Watching(paths)
    watching.press(pygame.K_SPACE, pygame.K_HOME, pygame.K_SPACE)
    while watching.index < 7:
        watching.press(pygame.K_RIGHT)
    watching.press(pygame.K_p)
    assert watching.screen.notice == f"saved: {tmp_path / 'run-0_t0007.png'}"
    watching.press(pygame.K_s)
    assert pygame.image.load(tmp_path / "run-0_t0007.png").get_width() > 300
    assert "<svg" in (tmp_path / "run-0_t0007.svg").read_text(encoding="utf-8")


def test_a_moment_that_cannot_be_saved_is_told(paths: list[Path], tmp_path: Path) -> None:
    watching = Watching(paths)
    watching.press(pygame.K_SPACE)
    (tmp_path / f"run-0_t{watching.index:04d}.png").mkdir()
    watching.press(pygame.K_p)
    assert "run-0_t" in watching.screen.notice
    assert "saved" not in watching.screen.notice


def test_escape_puts_a_page_away_first_and_closes_then(paths: list[Path]) -> None:
    watching = Watching(paths)
    for page in (pygame.K_F1, pygame.K_i):
        watching.press(page, pygame.K_ESCAPE)
        assert watching.is_open
    watching.press(pygame.K_F1, pygame.K_F1, pygame.K_h, pygame.K_h, pygame.K_ESCAPE)
    assert not watching.is_open


def test_a_change_of_size_leaves_the_moment(paths: list[Path]) -> None:
    watching = Watching(paths)
    watching.press(pygame.K_SPACE, pygame.K_RIGHT)
    at = watching.index
    pygame.display.set_mode((700, 500), pygame.RESIZABLE)
    pygame.event.post(pygame.Event(pygame.VIDEORESIZE, size=(700, 500), w=700, h=500))
    watching.turn(2)
    assert (watching.index, watching.screen._bar.bottom) == (at, 500)


def test_what_the_file_tells_is_told_in_words(paths: list[Path]) -> None:
    """The run made by hand touches a person and has a key pressed at tick 2."""
    record = Watching(paths).screen.files.record
    told = words.frame_facts(record, record.snapshot(2), 2)
    assert told == ["command +0.50 m/s ahead, +0.00 rad/s", "touches human 1, robot at fault", "keyboard w 1"]
    assert (words.frame_label(record, 2), words.frame_label(record, 9)) == ("near: yes", "near: no")
    assert words.frame_label(record, TICKS) == ""
    facts = dict(words.run_facts(record))
    assert (facts["contributor"], facts["context"]) == ("Zoë", "It is in a hurry.")
    assert facts["outcome"].startswith("stopped: by hand")
    assert "label" not in facts
