"""The screen that plays recorded runs, operated by keys and mouse."""

from __future__ import annotations

from pathlib import Path

import pygame
import pytest

import sonata2d as s2
from sonata2d.errors import RecordError
from sonata2d.record.recorder import JsonRecorder
from sonata2d.window.run_texts import frame_label, frame_summary, run_summary
from sonata2d.window.view_screen import ViewScreen

from ..record.samples import run
from .driver import PASSERS, SCENE
from .volunteer import Person

TICKS = 30


class Viewer(Person):
    """A person at the viewing screen."""

    def __init__(self, paths: list[Path], size: tuple[int, int] = (1280, 800)) -> None:
        self.view = ViewScreen(paths)
        super().__init__(lambda: self.view, size)
        self.wait()

    @property
    def index(self) -> int:
        return self.view.player.index

    @property
    def file(self) -> str:
        return self.view.files.record.path.name


@pytest.fixture
def paths(tmp_path: Path) -> list[Path]:
    found = [tmp_path / f"run-{k}.json" for k in range(3)]
    for path in found:
        with JsonRecorder(path, contributor="Zoë", context="It is in a hurry.") as recorder:
            run(recorder, ticks=TICKS, labels=lambda tick: {"near": tick < 5})
    return found


@pytest.fixture(autouse=True)
def _working_directory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def test_space_pauses_and_arrows_step_by_frames_and_by_seconds(paths: list[Path]) -> None:
    viewer = Viewer(paths)
    viewer.press(pygame.K_SPACE, pygame.K_HOME, pygame.K_SPACE)
    assert not viewer.view.player.playing
    at = viewer.index
    viewer.press(pygame.K_RIGHT, pygame.K_RIGHT)
    assert viewer.index == at + 2
    viewer.press(pygame.K_RIGHT, mod=pygame.KMOD_SHIFT)
    assert viewer.index == at + 12
    viewer.press(pygame.K_LEFT)
    assert viewer.index == at + 11
    viewer.frames(5)
    assert viewer.index == at + 11


def test_the_timeline_is_dragged(paths: list[Path]) -> None:
    viewer = Viewer(paths)
    viewer.press(pygame.K_SPACE)
    box = viewer.view.timeline.box
    viewer.mouse(pygame.MOUSEBUTTONDOWN, box.center)
    assert viewer.index == TICKS // 2
    viewer.mouse(pygame.MOUSEMOTION, (box.right + 50, 0))
    assert viewer.index == TICKS
    viewer.mouse(pygame.MOUSEBUTTONUP, (box.right + 50, 0))
    viewer.mouse(pygame.MOUSEMOTION, box.center)
    assert viewer.index == TICKS


def test_buttons_do_what_keys_do(paths: list[Path]) -> None:
    viewer = Viewer(paths)
    viewer.push("Pause")
    viewer.frames(2)
    assert not viewer.view.player.playing
    assert "Play" in viewer.buttons


def test_files_are_played_in_order_up_to_the_last(paths: list[Path]) -> None:
    viewer = Viewer(paths)
    seen = []
    for _ in range(4):
        seen.append(viewer.file)
        viewer.view.advance(10.0)  # to the end
        viewer.view.advance(1.0)
        assert viewer.file == seen[-1]  # the end stays on screen for a moment
        viewer.view.advance(1.0)
    assert seen == ["run-0.json", "run-1.json", "run-2.json", "run-2.json"]
    viewer.press(pygame.K_n)
    assert viewer.view.notice == "this is the last file"
    viewer.press(pygame.K_PAGEUP, pygame.K_b)
    assert viewer.file == "run-0.json"


def test_speed_camera_and_layers_are_kept_for_the_next_file(paths: list[Path]) -> None:
    viewer = Viewer(paths)
    viewer.press(pygame.K_PLUS, pygame.K_v, pygame.K_z, pygame.K_t, pygame.K_n)
    view = viewer.view
    assert viewer.file == "run-1.json"
    assert (view.player.speed, view.camera.view) == (2.0, "follow")
    assert (view.camera.zones, view.shows_trails) == (True, True)
    viewer.frames(3)


def test_damaged_files_are_skipped_with_a_notice(paths: list[Path]) -> None:
    paths[0].write_text("{")
    paths[1].write_text("[]")
    viewer = Viewer(paths)
    assert viewer.file == "run-2.json"
    assert "skipped" in viewer.view.notice
    assert "run-1.json" in viewer.view.notice
    viewer.press(pygame.K_b)
    assert viewer.file == "run-2.json"
    assert "this is the first file; skipped" in viewer.view.notice
    assert viewer.is_open


def test_only_damaged_files_give_one_clear_error(paths: list[Path]) -> None:
    for path in paths:
        path.write_text("{")
    with pytest.raises(RecordError, match=r"run-2\.json is not valid JSON"):
        ViewScreen(paths)


def test_a_moment_is_saved_as_png_and_as_svg(paths: list[Path], tmp_path: Path) -> None:
    viewer = Viewer(paths)
    viewer.press(pygame.K_SPACE, pygame.K_HOME, pygame.K_SPACE)
    while viewer.index < 7:
        viewer.press(pygame.K_RIGHT)
    viewer.press(pygame.K_p)
    assert viewer.view.notice == f"saved: {tmp_path / 'run-0_t0007.png'}"
    viewer.press(pygame.K_s)
    assert pygame.image.load(tmp_path / "run-0_t0007.png").get_width() > 300
    assert "<svg" in (tmp_path / "run-0_t0007.svg").read_text(encoding="utf-8")


def test_an_error_of_saving_is_shown(paths: list[Path], tmp_path: Path) -> None:
    viewer = Viewer(paths)
    viewer.press(pygame.K_SPACE)
    (tmp_path / f"run-0_t{viewer.index:04d}.png").mkdir()
    viewer.press(pygame.K_p)
    assert "run-0_t" in viewer.view.notice
    assert "saved" not in viewer.view.notice


def test_escape_closes_a_page_first_and_then_the_window(paths: list[Path]) -> None:
    viewer = Viewer(paths)
    for page in (pygame.K_F1, pygame.K_i):
        viewer.press(page, pygame.K_ESCAPE)
        assert viewer.is_open
    viewer.press(pygame.K_F1, pygame.K_F1, pygame.K_h, pygame.K_h, pygame.K_ESCAPE)
    assert not viewer.is_open


def test_resizing_keeps_the_moment(paths: list[Path]) -> None:
    viewer = Viewer(paths)
    viewer.press(pygame.K_SPACE, pygame.K_RIGHT)
    at = viewer.index
    viewer.resize((700, 500))
    assert viewer.index == at
    assert viewer.view.picture.width == 700
    assert 250 < viewer.view.picture.height < 500


def test_ticks_and_runs_are_summarised_in_text(paths: list[Path]) -> None:
    """The sample has a contact and a key press at tick 2."""
    record = Viewer(paths).view.files.record
    texts = frame_summary(record, record.snapshot(2), 2)
    assert texts == ["command +0.50 m/s ahead, +0.00 rad/s", "touches human 1, robot at fault", "keyboard w 1"]
    assert (frame_label(record, 2), frame_label(record, 9)) == ("near: yes", "near: no")
    assert frame_label(record, TICKS) == ""
    run_texts = dict(run_summary(record))
    assert (run_texts["contributor"], run_texts["context"]) == ("Zoë", "It is in a hurry.")
    assert run_texts["outcome"].startswith("stopped: by hand")
    assert "label" not in run_texts


def test_people_who_enter_and_leave_are_shown_at_their_times(tmp_path: Path) -> None:
    rules = {"time_limit": 1.5, "ends_on": ["time"]}
    config = s2.ScenarioConfig(**SCENE | {"humans": 0, "people": PASSERS, "rules": rules})
    with JsonRecorder(tmp_path / "one.json") as recorder:
        s2.Episode(s2.generate(config, 1), s2.SocialPlanner(), observers=[recorder]).run()
    viewer = Viewer([tmp_path / "one.json"], (500, 400))
    seen = set()
    for _ in range(120):
        viewer.wait()
        seen.add(len(viewer.view.files.record.snapshot(viewer.index).humans))
    assert seen >= {1, 2, 3}
    assert viewer.index == 15
