"""An episode in an L-shaped room with furniture, pedestrians of every activity and a robot, and helpers for pixels."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pygame
import pytest

from sonata2d.core.entities import Furniture, Goal, Human, Interaction, Robot, Wall
from sonata2d.core.geometry import Disc, Point, Pose, Rectangle, Twist
from sonata2d.core.humans import BODY_X, BODY_Y, GAZE_X, GAZE_Y, X, Y
from sonata2d.core.portable_math import unit_vector, unit_vectors
from sonata2d.core.relations import ACTIVITIES, AT_LAPTOP, TALKING
from sonata2d.core.scene import Scene
from sonata2d.core.snapshot import RobotState, Snapshot
from sonata2d.view.layers import Layers
from sonata2d.view.projection import Camera

CORNERS = ((0.0, 0.0), (6.0, 0.0), (6.0, 2.5), (3.0, 2.5), (3.0, 5.0), (0.0, 5.0))
BARE = Layers(gaze=False, links=False, grid=False, caption=False)


def _scene() -> Scene:
    walls = tuple(Wall(a, b) for a, b in zip(CORNERS, (*CORNERS[1:], CORNERS[0]), strict=True))
    kinds = ("plant", "chair", "shelf", "tv", "crate")
    furniture = (
        Furniture(1, "table", Pose(1.5, 4.2), Rectangle(1.2, 0.7)),
        Furniture(2, "laptop", Pose(1.5, 4.2, -math.pi / 2), Rectangle(0.3, 0.35), on=1),
        *(Furniture(3 + k, kind, Pose(0.4, 0.5 + 0.6 * k, 0.3), Rectangle(0.3, 0.4)) for k, kind in enumerate(kinds)),
        Furniture(9, "table", Pose(5.5, 2.0), Disc(0.3)),
    )
    humans = tuple(
        Human(20 + k, Pose(1.2 + 0.7 * k, 1.6, 0.4 * k), 0.2, behaviour="standing" if k % 2 else "wandering",
              reacts_to_robot=0.0 if k == 1 else 1.0)
        for k in range(6)
    )  # fmt: skip
    links = (Interaction(20, TALKING, 21), Interaction(24, AT_LAPTOP, 2))
    return Scene("by-hand", "L", CORNERS, walls, furniture, humans, Robot(Pose(1.0, 0.5)), Goal(5.0, 0.6),
                 interactions=links, seed=7, episode=3)  # fmt: skip


def snapshot_at(scene: Scene, tick: int = 0, robot: Pose | None = None) -> Snapshot:
    """The scene at a tick: pedestrians at their initial poses, the robot on its way to the goal or at a given pose."""
    pose = robot or Pose(1.0 + 0.1 * tick, 0.5, 0.0)
    state = np.zeros((len(scene.humans), 9))
    state[:, X : Y + 1] = [human.pose.position for human in scene.humans]
    angles = np.array([human.pose.theta for human in scene.humans])
    state[:, BODY_X : BODY_Y + 1], state[:, GAZE_X : GAZE_Y + 1] = unit_vectors(angles), unit_vectors(angles + 0.3)
    humans = scene.human_table.with_state(state, np.arange(len(state)) % len(ACTIVITIES))
    body = RobotState(pose.position, unit_vector(pose.theta), (1.0, 0.0), 0.0, Twist(1.0), False, scene.robot)
    return Snapshot(tick, tick * scene.rules.dt, scene, body, humans, scene.interactions)


def pixels(surface: pygame.Surface) -> Any:
    """(width, height, 3) of int."""
    return pygame.surfarray.array3d(surface).astype(int)


def colour_at(surface: pygame.Surface, camera: Camera, point: Point) -> tuple[int, ...]:
    """Colour of the pixel at a world point."""
    x, y = camera.to_pixels(point)
    return tuple(surface.get_at((int(x), int(y))))[:3]


@pytest.fixture(scope="session")
def scene() -> Scene:
    return _scene()


@pytest.fixture(scope="session")
def episode(scene: Scene) -> list[Snapshot]:
    return [snapshot_at(scene, tick) for tick in range(12)]
