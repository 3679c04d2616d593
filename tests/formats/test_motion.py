"""What follows from tracks and walls."""

from __future__ import annotations

import random

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sonata2d.core.entities import PERSON_RADIUS
from sonata2d.core.vectors import wrap_angles
from sonata2d.formats.imported import headings_along, polygon_of, radii_that_fit, velocities
from sonata2d.record.record import EpisodeRecord

GONE = (np.nan, np.nan, np.nan)


def test_a_room_is_found_from_its_walls_in_any_order_and_direction(records: list[EpisodeRecord]) -> None:
    for number, record in enumerate(records):
        scene, chance = record.scene(), random.Random(number)
        walls = [(*wall.start, *wall.end) for wall in scene.walls[: len(scene.polygon)]]
        chance.shuffle(walls)
        walls = [wall if chance.random() < 0.5 else (*wall[2:], *wall[:2]) for wall in walls]
        found = polygon_of(np.array(walls))
        assert found is not None
        assert {tuple(corner) for corner in found.tolist()} == set(scene.polygon)
        x, y = found.T
        assert (x * np.roll(y, -1) - np.roll(x, -1) * y).sum() > 0.0, "counter-clockwise"


def test_walls_that_close_nothing_are_no_room() -> None:
    assert polygon_of(np.array([(0.0, 0.0, 1.0, 0.0), (1.0, 0.0, 1.0, 1.0), (1.0, 1.0, 0.0, 1.0)])) is None
    assert polygon_of(np.zeros((0, 4))) is None


@given(st.lists(st.floats(-50, 50), min_size=1, max_size=8))
def test_turns_are_the_same_direction_and_less_than_half_a_round(angles: list[float]) -> None:
    turns = wrap_angles(np.array(angles))
    assert ((turns > -np.pi) & (turns <= np.pi + 1e-9)).all()
    assert np.exp(1j * turns) == pytest.approx(np.exp(1j * np.array(angles)), abs=1e-9)


def test_velocities_of_somebody_who_comes_goes_and_comes_again() -> None:
    """At 2 m/s while seen; across a gap nothing is known."""
    track = [(0.0, 0.0, 3.1), (1.0, 0.0, -3.1), GONE, (9.0, 0.0, 0.0), (10.0, 0.0, 0.0), GONE, (5.0, 5.0, 0.0)]
    rates = velocities(np.arange(7) * 0.5, np.array(track)[:, None])[:, 0]
    assert rates[:, 0] == pytest.approx([2.0, 2.0, np.nan, 2.0, 2.0, np.nan, 0.0], nan_ok=True)
    assert rates[:2, 2] == pytest.approx([2 * (2 * np.pi - 6.2)] * 2)


def test_people_face_where_they_go_and_keep_it_when_they_stand() -> None:
    velocity = np.array([(0.0, 0.0), (0.0, 1.0), (0.0, 0.05), (-1.0, 0.0), (np.nan, np.nan)])[:, None]
    faced = headings_along(velocity)[:, 0]
    assert faced == pytest.approx([np.pi / 2, np.pi / 2, np.pi / 2, np.pi, np.nan], nan_ok=True)


def test_radii_that_nobody_told_never_overlap() -> None:
    places = np.array([[(0.0, 0.0), (5.0, 0.0), (9.0, 3.0)], [(0.0, 0.0), (0.26, 0.0), (9.0, 3.0)]])
    one, two, far = radii_that_fit(places, np.array([(8.9, 0.0, 8.9, 9.0)]))
    assert one == two == pytest.approx(0.15)
    assert far == pytest.approx(0.12)
    assert radii_that_fit(places[:1], np.zeros((0, 4))) == [PERSON_RADIUS] * 3
