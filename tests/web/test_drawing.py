"""The page draws what the window draws."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
import pygame
import pytest

import sonata2d as s2
from sonata2d.record.reader import read_episode
from sonata2d.view.layers import Layers
from sonata2d.view.painter import Painter

from .conftest import Served
from .test_browser import opened

STUDY = """\
title: Drawing
ratings:
  - {{name: one, folder: one.json, view: {view}, question: {{name: polite, kind: yes_no, question: Polite}}}}
"""


@pytest.mark.parametrize("view", ["top", "follow"])
def test_the_page_draws_as_the_window(browser: Any, tmp_path: Path, view: Any) -> None:
    """Pictures of a lively room differ only along edges, which the two smooth differently."""
    scene = s2.generate(s2.load_scenario("sonata-2020-crowded").changed(rules={"time_limit": 2.0}), seed=4)
    with s2.JsonRecorder(tmp_path / "one.json") as recorder:
        s2.Episode(scene, s2.SocialPlanner(), observers=[recorder]).run()
    (tmp_path / "study.yaml").write_text(STUDY.format(view=view))
    served = Served(tmp_path)
    try:
        page = opened(browser, served.link())
        page.wait_for_selector("#rating input:enabled")  # the run has been watched to its end
        page.wait_for_timeout(200)
        shot = page.locator("#film").screenshot()
        assert page.problems == []
        page.context.close()
    finally:
        served.stop()
    drawn = pygame.surfarray.array3d(pygame.image.load(io.BytesIO(shot))).astype(int)
    surface = pygame.Surface(drawn.shape[:2])
    snapshot = read_episode(tmp_path / "one.json").snapshot(-1)
    Painter(snapshot.scene).draw(surface, snapshot, view=view, layers=Layers(caption=False))
    painted = pygame.surfarray.array3d(surface).astype(int)
    difference = np.abs(drawn - painted).max(axis=2)[12:-12, 12:-12]  # the corners of the page's picture are round
    assert np.ptp(painted, axis=(0, 1)).min() > 150  # it is not an empty picture
    assert difference.mean() < 2.5
    assert (difference > 60).mean() < 0.015


RUNS = """\
title: Driving
runs: [{scenario: corridor.yaml}]
changes: [view, zoom, zones]
"""
# A corridor, with four people, of whom two are near the robot.
CORRIDOR = """\
extends: empty
room: {kinds: corridor, corridor_length: 14, corridor_width: 2.4, turns: 0}
robot: {pose: [-6, 0, 0]}
goal: {position: [6, 0]}
people:
  - {x: -4.5, y: 0.8}
  - {x: -3.5, y: -0.8}
  - {x: 3, y: 0.8}
  - {x: 4, y: -0.8}
"""


@pytest.fixture
def corridor(tmp_path: Path) -> Any:
    (tmp_path / "study.yaml").write_text(RUNS)
    (tmp_path / "corridor.yaml").write_text(CORRIDOR)
    served = Served(tmp_path)
    yield served
    served.stop()


def orange(shot: bytes) -> tuple[float, float]:
    """Place of the robot's colour in a picture, as fractions of its width and height."""
    picture = pygame.surfarray.array3d(pygame.image.load(io.BytesIO(shot))).astype(int)
    is_robot = (np.abs(picture - (213, 94, 0)).max(axis=2) < 60) & (picture[:, :, 2] < 60)
    columns, rows = np.nonzero(is_robot)
    return float(columns.mean() / picture.shape[0]), float(rows.mean() / picture.shape[1])


def test_a_run_begins_with_the_whole_room_which_is_turned_on_a_phone(browser: Any, corridor: Served) -> None:
    page = opened(browser, corridor.link())
    page.set_viewport_size({"width": 360, "height": 740})
    page.reload()
    page.wait_for_selector("#status.waiting")
    page.wait_for_timeout(500)
    x, y = orange(page.locator("#canvas").screenshot())
    assert abs(x - 0.5) < 0.15
    assert y > 0.85  # at the lower end of the corridor, which is upright
    page.wait_for_timeout(2000)
    x, y = orange(page.locator("#canvas").screenshot())
    assert abs(x - 0.5) < 0.05
    assert abs(y - 0.72) < 0.05  # the picture has moved to the robot
    assert page.problems == []
    page.context.close()


def test_who_drives_at_once_sees_the_robot_at_once(browser: Any, corridor: Served) -> None:
    page = opened(browser, corridor.link())
    page.wait_for_selector("#status.waiting")
    page.locator("#canvas").focus()
    page.keyboard.down("w")
    page.wait_for_selector("#status.driving")
    page.wait_for_timeout(100)
    _, y = orange(page.locator("#canvas").screenshot())
    assert abs(y - 0.72) < 0.05
    page.keyboard.up("w")
    page.context.close()


def test_zones_are_those_of_the_nearest_two_people(browser: Any, corridor: Served) -> None:
    page = opened(browser, corridor.link(), reduced_motion="reduce")
    page.wait_for_selector("#status.waiting")
    page.get_by_role("button", name="Camera").click()  # the whole room
    page.wait_for_timeout(300)

    def picture() -> Any:
        shot = page.locator("#canvas").screenshot()
        return pygame.surfarray.array3d(pygame.image.load(io.BytesIO(shot))).astype(int)

    before = picture()
    page.get_by_role("button", name="Zones").click()
    page.wait_for_timeout(300)
    columns = np.nonzero(np.abs(picture() - before).max(axis=2) > 3)[0] / before.shape[0]
    assert columns.min() > 0.05
    assert columns.max() < 0.5  # the two at the other end have none
    page.context.close()


def test_a_phone_has_the_buttons_of_the_picture_behind_one(browser: Any, corridor: Served) -> None:
    page = opened(browser, corridor.link())
    page.set_viewport_size({"width": 360, "height": 740})
    page.wait_for_selector("#status.waiting")
    names = page.locator("#actions").get_by_role("button")
    assert names.all_inner_texts() == ["View", "Help"]
    names.first.click()
    assert names.all_inner_texts() == ["View", "Camera", "Zones", "Zoom in", "Zoom out", "Help"]
    page.set_viewport_size({"width": 1000, "height": 760})
    page.wait_for_timeout(200)
    assert names.all_inner_texts() == ["Camera", "Zones", "Zoom in", "Zoom out", "Help"]
    page.context.close()
