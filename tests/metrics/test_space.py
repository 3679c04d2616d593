"""Metrics of distance, by hand: the robot's radius is 0.3 m, that of people 0.2 m."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sonata2d.core.entities import Furniture, Human
from sonata2d.core.geometry import Disc, Pose
from sonata2d.metrics.space import THRESHOLDS

from ..conftest import room
from .samples import stay, value

# Centres 0.4, 0.8, 1.0, 1.5, 4.0, 4.2 m apart: d = 0 (overlap), 0.3, 0.5, 1.0, 3.5, 3.7 m.
ONE_PERSON = room([Human(1, Pose(0.0, 0.0), 0.2)])
PERSON = [[[x, 0.0, 0.0] for x in (0.4, 0.8, 1.0, 1.5, 4.0, 4.2)]]
ROBOT = stay(0.0, 0.0, 6)


def test_clearance_to_people() -> None:
    assert value("human_clearance_min", ONE_PERSON, ROBOT, PERSON) == 0.0
    assert value("human_clearance_mean", ONE_PERSON, ROBOT, PERSON) == pytest.approx(9.0 / 6.0)


@pytest.mark.parametrize(("threshold", "compliant"), [(0.3, 5), (0.45, 4), (0.5, 4), (0.8, 3), (1.2, 2)])
def test_compliance_at_each_threshold(threshold: float, compliant: int) -> None:
    assert threshold in THRESHOLDS
    fraction = value(f"personal_space_compliance_{threshold:.2f}", ONE_PERSON, ROBOT, PERSON)
    assert fraction == pytest.approx(compliant / 6.0, abs=1e-6)


def test_zones_cover_all_states() -> None:
    fractions = [
        value(f"zone_{name}", ONE_PERSON, ROBOT, PERSON) for name in ("intimate", "personal", "social", "public")
    ]
    assert fractions == pytest.approx([2 / 6, 2 / 6, 1 / 6, 1 / 6], abs=1e-6)


def test_clearance_is_to_the_nearest_outline() -> None:
    """d = 1.5 - 0.3 - 0.2 = 1.0 and 1.6 - 0.3 - 0.4 = 0.9."""
    scene = room([Human(1, Pose(0.0, 0.0), 0.2), Human(2, Pose(0.0, 0.0), radius=0.4)])
    clearance = value("human_clearance_min", scene, stay(0, 0, 2), [stay(1.5, 0, 2), stay(0, 1.6, 2)])
    assert clearance == pytest.approx(0.9)


def test_absent_people_are_far_away() -> None:
    """d = 0.1 in the first of two states; in the second the person is absent."""
    person = [[[0.6, 0.0, 0.0], [np.nan] * 3]]
    assert value("human_clearance_mean", ONE_PERSON, stay(0, 0, 2), person) == pytest.approx(0.1)
    assert value("personal_space_compliance_0.45", ONE_PERSON, stay(0, 0, 2), person) == 0.5
    assert value("zone_public", ONE_PERSON, stay(0, 0, 2), person) == 0.5
    assert value("time_to_collision_min", ONE_PERSON, stay(0, 0, 2), person) is None


@pytest.mark.parametrize(
    "name", ["human_clearance_min", "human_clearance_mean", "personal_space_compliance_0.45", "zone_public"]
)
def test_distances_to_people_are_undefined_without_people(name: str) -> None:
    assert value(name, room(), stay(0, 0, 3)) is None


def test_clearance_to_walls_and_objects() -> None:
    """At (0, 0) the walls are 3.7 m away and the plant's edge 0.5 m; at (0, -1) 2.7 m and √2 - 0.5 m."""
    plant = Furniture(9, "plant", Pose(1.0, 0.0), Disc(0.2))
    robot = [[0.0, 0.0, 0.0], [0.0, -1.0, 0.0]]
    assert value("obstacle_clearance_min", room([], [plant]), robot) == pytest.approx(0.5)
    mean = (0.5 + math.sqrt(2.0) - 0.5) / 2.0
    assert value("obstacle_clearance_mean", room([], [plant]), robot) == pytest.approx(mean, abs=1e-6)
    assert value("obstacle_clearance_min", room(), robot) == pytest.approx(2.7)
