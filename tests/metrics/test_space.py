"""Clearances, compliance and zones, worked out by hand: the robot's radius is 0.3 m, a person's 0.2 m."""

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
ONE = room([Human(1, Pose(0.0, 0.0), 0.2)])
AWAY = [[[x, 0.0, 0.0] for x in (0.4, 0.8, 1.0, 1.5, 4.0, 4.2)]]
STILL = stay(0.0, 0.0, 6)


def test_clearance_to_people() -> None:
    assert value("human_clearance_min", ONE, STILL, AWAY) == 0.0
    assert value("human_clearance_mean", ONE, STILL, AWAY) == pytest.approx(9.0 / 6.0)


@pytest.mark.parametrize(("threshold", "compliant"), [(0.3, 5), (0.45, 4), (0.5, 4), (0.8, 3), (1.2, 2)])
def test_compliance_is_a_sweep_of_thresholds(threshold: float, compliant: int) -> None:
    assert threshold in THRESHOLDS
    told = value(f"personal_space_compliance_{threshold:.2f}", ONE, STILL, AWAY)
    assert told == pytest.approx(compliant / 6.0, abs=1e-6)


def test_zones_share_out_all_looks() -> None:
    shares = [value(f"zone_{name}", ONE, STILL, AWAY) for name in ("intimate", "personal", "social", "public")]
    assert shares == pytest.approx([2 / 6, 2 / 6, 1 / 6, 1 / 6], abs=1e-6)


def test_the_nearest_person_counts_and_each_with_their_own_radius() -> None:
    """d = 1.5 - 0.3 - 0.2 = 1.0 and 1.6 - 0.3 - 0.4 = 0.9."""
    two = room([Human(1, Pose(0.0, 0.0), 0.2), Human(2, Pose(0.0, 0.0), radius=0.4)])
    told = value("human_clearance_min", two, stay(0, 0, 2), [stay(1.5, 0, 2), stay(0, 1.6, 2)])
    assert told == pytest.approx(0.9)


def test_who_is_not_there_leaves_room() -> None:
    """d = 0.1 at one look of two; at the other nobody is there."""
    gone = [[[0.6, 0.0, 0.0], [np.nan] * 3]]
    assert value("human_clearance_mean", ONE, stay(0, 0, 2), gone) == pytest.approx(0.1)
    assert value("personal_space_compliance_0.45", ONE, stay(0, 0, 2), gone) == 0.5
    assert value("zone_public", ONE, stay(0, 0, 2), gone) == 0.5
    assert value("time_to_collision_min", ONE, stay(0, 0, 2), gone) is None


def test_without_people_social_metrics_are_not_defined() -> None:
    for name in ("human_clearance_min", "human_clearance_mean", "personal_space_compliance_0.45", "zone_public"):
        assert value(name, room(), stay(0, 0, 3)) is None


def test_clearance_to_walls_and_things() -> None:
    """At (0, 0) the walls are 3.7 m away, the plant's rim 0.5 m; at (0, -1), 2.7 m and √2 - 0.5."""
    plant = Furniture(9, "plant", Pose(1.0, 0.0), Disc(0.2))
    robot = [[0.0, 0.0, 0.0], [0.0, -1.0, 0.0]]
    assert value("obstacle_clearance_min", room([], [plant]), robot) == pytest.approx(0.5)
    mean = (0.5 + math.sqrt(2.0) - 0.5) / 2.0
    assert value("obstacle_clearance_mean", room([], [plant]), robot) == pytest.approx(mean, abs=1e-6)
    assert value("obstacle_clearance_min", room(), robot) == pytest.approx(2.7)
