"""Shoulders turn in gaps that are narrow for a body, as far as the gap requires."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sonata2d.agents.pedestrians.models.base import Walkers
from sonata2d.agents.pedestrians.shoulders import APERTURE_RATIO, MAXIMUM_TWIST, MAXIMUM_TWIST_IN_GAP, wanted_twist
from sonata2d.core.entities import PERSON_BREADTH, PERSON_RADIUS
from sonata2d.core.geometry import Barriers

from ..conftest import beside_walls, neighbour_lists

NO_WALLS = np.zeros((0, 8))
DEPTH, SHOULDER = 2 * PERSON_RADIUS, PERSON_BREADTH / 2 - PERSON_RADIUS


def walkers(*others: tuple[float, float], shoulder: float = SHOULDER) -> Walkers:
    """A person that walks east from the origin, and other people, who face east."""
    count = 1 + len(others)
    east, ones = np.tile((1.0, 0.0), (count, 1)), np.ones(count)
    return Walkers(
        np.array([(0.0, 0.0), *others]), np.zeros((count, 2)), east, east, ones, PERSON_RADIUS * ones, ones > 0.0,
        **neighbour_lists(1.0 - np.eye(count)), group=np.full(count, -1), is_abreast=ones > 0.0,
        shoulder=shoulder * ones, headway=ones, politeness=ones, heed=0.0 * ones, steering=np.zeros((count, 2)),
    )  # fmt: skip


def twist(left: float, right: float, side: float = 1.0, present: float = 0.0, shoulder: float = SHOULDER) -> float:
    """The twist between two walls along the way, at distances from the centre of the body, m."""
    walls = Barriers.of([((-2.0, left), (2.0, left), 0.0), ((-2.0, -right), (2.0, -right), 0.0)])
    return wanted_twist(beside_walls(walkers(shoulder=shoulder), walls), 0, walls.table, present, side)


def projected_breadth(angle: float) -> float:
    return DEPTH + (PERSON_BREADTH - DEPTH) * math.cos(angle)


@pytest.mark.parametrize("gap", [0.48, 0.5, 0.57])
def test_shoulders_turn_until_the_gap_is_wide_enough_for_them(gap: float) -> None:
    found = twist(gap / 2, gap / 2)
    assert APERTURE_RATIO * projected_breadth(found) == pytest.approx(gap, abs=1e-6)


def test_shoulders_do_not_turn_where_there_is_room() -> None:
    wide = APERTURE_RATIO * PERSON_BREADTH + 0.01
    assert twist(wide / 2, wide / 2) == 0.0
    assert wanted_twist(walkers(), 0, NO_WALLS, 0.0, 1.0) == 0.0
    assert twist(0.25, 0.25, shoulder=0.0) == 0.0  # a disc


def test_shoulders_turn_by_80_degrees_at_most_between_walls_and_by_60_among_people() -> None:
    assert twist(0.16, 0.16) == pytest.approx(math.radians(80.0)) == pytest.approx(MAXIMUM_TWIST_IN_GAP)
    beside = walkers((0.0, 0.4), (0.0, -0.4))
    assert abs(wanted_twist(beside, 0, NO_WALLS, 0.0, 1.0)) == pytest.approx(math.radians(60.0))
    assert pytest.approx(math.radians(60.0)) == MAXIMUM_TWIST


def test_the_shoulder_with_less_room_goes_back() -> None:
    left, right = twist(0.18, 0.32), twist(0.32, 0.18)
    assert left > 0.1  # the heading turns to the left, so that the left shoulder goes back
    assert right == pytest.approx(-left)


def test_where_both_sides_are_alike_a_twist_keeps_its_side_or_takes_that_of_the_rules() -> None:
    assert twist(0.25, 0.25, side=-1.0) == -twist(0.25, 0.25, side=1.0)
    for present in (0.3, -0.3):
        assert twist(0.24, 0.26, present=present) == pytest.approx(math.copysign(twist(0.25, 0.25), present))


def test_shoulders_turn_between_people() -> None:
    between = walkers((0.2, 0.48), (0.2, -0.48))
    found = wanted_twist(between, 0, NO_WALLS, 0.0, 1.0)
    assert APERTURE_RATIO * projected_breadth(found) == pytest.approx(2 * 0.48 - PERSON_BREADTH, abs=1e-6)
    assert wanted_twist(walkers((-0.5, 0.4), (-0.5, -0.4)), 0, NO_WALLS, 0.0, 1.0) == 0.0  # already passed
    between.attention[:] = 0.0
    assert wanted_twist(between, 0, NO_WALLS, 0.0, 1.0) == 0.0
