"""Episodes of other programs: pictures show nothing that the recording lacks."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pygame
import pytest

from sonata2d.core.entities import Human
from sonata2d.core.geometry import Pose
from sonata2d.core.humans import BODY_X, GAZE_X, GAZE_Y
from sonata2d.core.scene import Scene, Unmeasured
from sonata2d.core.snapshot import Snapshot
from sonata2d.formats.api import import_from
from sonata2d.formats.format import Options
from sonata2d.record.reader import read_episode
from sonata2d.view.figures import human_parts
from sonata2d.view.layers import Layers
from sonata2d.view.painter import Painter
from sonata2d.view.palette import GOAL, ROBOT
from sonata2d.view.stills import picture, save_moment
from sonata2d.view.trails import Trails

from .conftest import BARE, pixels, snapshot_at

TRACKS = "frame,ped,x,y\n" + "\n".join(
    f"{frame},{ped},{0.1 * frame + ped},{ped}" for frame in range(20) for ped in (1, 2)
)
LAYERS = Layers(zones=True, velocities=True, ids=True, legend=True)


def without(scene: Scene, *unmeasured: Unmeasured, tick: int = 0) -> Snapshot:
    return snapshot_at(replace(scene, unmeasured=frozenset(unmeasured)), tick)


def groups_of(path: Path) -> list[str]:
    return [group.get("class", "") for group in ElementTree.parse(path).getroot().iter("{http://www.w3.org/2000/svg}g")]


def count(surface: pygame.Surface, colour: tuple[int, int, int]) -> int:
    return int((np.abs(pixels(surface) - colour).max(axis=2) <= 2).sum())


def test_an_imported_csv_lacks_robot_goal_headings_seed_and_outcome(tmp_path: Path) -> None:
    (tmp_path / "walk.csv").write_text(TRACKS)
    import_from(tmp_path / "walk.csv", "csv", tmp_path / "walk.json", Options(frame_time=0.1))
    record = read_episode(tmp_path / "walk.json")
    assert record.scene().unmeasured == {"robot", "goal", "headings", "heads", "seed", "outcome"}
    save_moment(tmp_path / "a.svg", record.snapshot(-1), trails=Trails.of(record.snapshots()), outcome="stopped")
    assert sorted({*groups_of(tmp_path / "a.svg")}) == ["person"]
    text = (tmp_path / "a.svg").read_text(encoding="utf-8")
    assert not [word for word in ("seed", "episode", "stopped") if word in text]


def test_neither_robot_nor_goal_is_drawn_without_a_record_of_them(scene: Scene, episode: list[Snapshot]) -> None:
    trails, unknown = Trails.of(episode), without(scene, "robot", "goal", tick=11)
    for snapshot, is_drawn in ((episode[-1], True), (unknown, False)):
        drawn = picture(snapshot, layers=LAYERS, trails=trails)
        assert (count(drawn, ROBOT) > 100) == (count(drawn, GOAL) > 20) == is_drawn
        surface = pygame.Surface((640, 480), 0, 32)
        Painter(snapshot.scene).draw(surface, snapshot, trails=trails)
        assert (count(surface, ROBOT) > 100) == is_drawn


def test_without_a_robot_the_window_shows_the_whole_room(scene: Scene) -> None:
    surfaces = [pygame.Surface((400, 300), 0, 32) for _ in range(2)]
    for surface, view in zip(surfaces, ("follow", "top"), strict=True):
        Painter(scene).draw(surface, without(scene, "robot"), view=view)  # type: ignore[arg-type]
    assert (pixels(surfaces[0]) != pixels(surfaces[1])).any()  # the painter's scene has a robot
    unknown = without(scene, "robot")
    for surface, view in zip(surfaces, ("follow", "top"), strict=True):
        Painter(unknown.scene).draw(surface, unknown, view=view)  # type: ignore[arg-type]
    assert (pixels(surfaces[0]) == pixels(surfaces[1])).all()


@pytest.mark.parametrize("unmeasured", [("headings", "heads"), ("heads",)])
def test_a_picture_does_not_depend_on_directions_that_were_not_measured(
    scene: Scene, unmeasured: tuple[Unmeasured, ...]
) -> None:
    snapshot = without(scene, *unmeasured)
    turned = replace(snapshot, humans=replace(snapshot.humans, state=snapshot.humans.state.copy()))
    columns = slice(BODY_X if "headings" in unmeasured else GAZE_X, GAZE_Y + 1)
    turned.humans.state[:, columns] = np.roll(turned.humans.state[:, columns], 1, axis=0)
    known = replace(turned, scene=scene), replace(snapshot, scene=scene)
    a, b, c, d = (pixels(picture(s, layers=LAYERS)) for s in (snapshot, turned, *known))
    assert (a == b).all()
    assert (c != d).any()


def test_a_pedestrian_without_heading_is_one_disc(scene: Scene) -> None:
    human = next(iter(snapshot_at(scene).humans))
    assert [len(parts) for _, parts in human_parts(human, 0.0)] == [2]
    assert [len(parts) for _, parts in human_parts(human, 0.0, unmeasured={"headings", "heads"})] == [1]


def test_a_body_is_drawn_as_broad_as_its_shoulders_and_as_deep_as_its_chest(scene: Scene) -> None:
    extents = []
    for theta in (0.0, math.pi / 2):
        human = Human(1, Pose(1.5, 1.5, theta), 0.15, breadth=0.5)
        snapshot = snapshot_at(replace(scene, humans=(human,), interactions=()))
        nobody = replace(snapshot, humans=snapshot.humans.select(np.arange(0)))
        shown, empty = (pixels(picture(s, layers=BARE, size=(640, 640))) for s in (snapshot, nobody))
        changed = np.argwhere((shown != empty).any(axis=2))
        extents.append((np.ptp(changed, axis=0) + 1) * 0.5 / (np.ptp(changed, axis=0).max() + 1))
    assert extents[0] == pytest.approx([0.3, 0.5], abs=0.02)
    assert extents[1] == pytest.approx([0.5, 0.3], abs=0.02)
