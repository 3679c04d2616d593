"""Gaps and times to collision equal values worked out by hand."""

from __future__ import annotations

import math

import pytest

import sonata2d as s2
from sonata2d.core.entities import Furniture, Human
from sonata2d.core.geometry import Disc, Pose, Twist
from sonata2d.core.proxemics import clearances, obstacle_clearance
from sonata2d.sim.world import World

from ..conftest import room, times_to_collision
from ..sim.test_world import drive


def test_clearance_is_the_gap_between_outlines() -> None:
    scene = room([Human(1, Pose(-1.0, 0.0), 0.2), Human(2, Pose(-3.0, 3.0), radius=0.25)])
    snapshot = World(scene).snapshot()
    assert clearances(snapshot) == pytest.approx([2.0 - 0.5, 3.0 - 0.55])
    assert s2.clearance(snapshot) == pytest.approx(1.5)
    assert s2.clearance(World(room()).snapshot()) == math.inf


def test_clearance_is_smaller_beside_a_shoulder_than_before_the_chest() -> None:
    facing, turned = Human(1, Pose(-1.0, 0.0)), Human(1, Pose(-1.0, 0.0, math.pi / 2))
    assert clearances(World(room([facing])).snapshot()) == pytest.approx([2.0 - 0.3 - 0.14])
    assert clearances(World(room([turned])).snapshot()) == pytest.approx([2.0 - 0.3 - 0.225])
    assert clearances(World(room([Human(1, Pose(-1.0, 0.0), breadth=0.28)])).snapshot()) == pytest.approx([1.56])


def test_obstacle_clearance_considers_walls_and_furniture() -> None:
    assert obstacle_clearance(World(room(robot=Pose(-3.0, 0.0))).snapshot()) == pytest.approx(0.7)
    plant = Furniture(9, "plant", Pose(-2.2, 0.0), Disc(0.2))
    assert obstacle_clearance(World(room([], [plant])).snapshot()) == pytest.approx(0.3)


def test_time_to_collision_at_constant_velocity() -> None:
    humans = [Human(1, Pose(0.0, 0.0), 0.2), Human(2, Pose(0.0, 2.0), 0.2), Human(3, Pose(-3.9, 0.0), 0.2)]
    snapshot = drive(World(room(humans)), Twist(vx=1.0), 5)
    ahead, beside, behind = times_to_collision(snapshot)
    assert ahead == pytest.approx((0.0 - snapshot.robot.position[0] - 0.5) / 1.0, abs=1e-3)
    assert beside == behind == math.inf
