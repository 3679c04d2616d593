"""Velocities, headings, rooms and radii that are estimated for foreign recordings."""

from __future__ import annotations

import random

import numpy as np
import pytest
from hypothesis import given, strategies as st

from sonata2d.core.entities import PERSON_RADIUS
from sonata2d.core.vectors import wrap_angles
from sonata2d.formats.estimates import fitting_radii, headings_along, polygon_of, velocities
from sonata2d.record.record import EpisodeRecord

ABSENT = (np.nan, np.nan, np.nan)


def test_room_is_found_from_walls_in_any_order_and_direction(records: list[EpisodeRecord]) -> None:
    for number, record in enumerate(records):
        scene, rng = record.scene(), random.Random(number)
        walls = [(*wall.start, *wall.end) for wall in scene.walls[: len(scene.polygon)]]
        rng.shuffle(walls)
        walls = [wall if rng.random() < 0.5 else (*wall[2:], *wall[:2]) for wall in walls]
        polygon = polygon_of(np.array(walls))
        assert polygon is not None
        assert {tuple(corner) for corner in polygon.tolist()} == set(scene.polygon)
        x, y = polygon.T
        assert (x * np.roll(y, -1) - np.roll(x, -1) * y).sum() > 0.0, "counter-clockwise"


def test_walls_that_do_not_close_make_no_room() -> None:
    assert polygon_of(np.array([(0.0, 0.0, 1.0, 0.0), (1.0, 0.0, 1.0, 1.0), (1.0, 1.0, 0.0, 1.0)])) is None
    assert polygon_of(np.zeros((0, 4))) is None


def test_repeated_walls_are_one_wall_of_the_room() -> None:
    corners = [(0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (0.0, 1.0)]
    walls = [(*start, *end) for start, end in zip(corners, corners[1:] + corners[:1], strict=True)]
    polygon = polygon_of(np.array(walls[:2] * 3 + walls * 2))
    assert polygon is not None
    assert {tuple(corner) for corner in polygon.tolist()} == set(corners)


@given(st.lists(st.floats(-50, 50), min_size=1, max_size=8))
def test_wrapped_angles_are_equivalent_and_within_half_a_turn(angles: list[float]) -> None:
    wrapped = wrap_angles(np.array(angles))
    assert ((wrapped > -np.pi) & (wrapped <= np.pi + 1e-9)).all()
    assert np.exp(1j * wrapped) == pytest.approx(np.exp(1j * np.array(angles)), abs=1e-9)


def test_velocities_do_not_cross_gaps_in_a_track() -> None:
    """The pedestrian moves at 2 m/s while observed; the velocity across a gap is unknown."""
    track = [(0.0, 0.0, 3.1), (1.0, 0.0, -3.1), ABSENT, (9.0, 0.0, 0.0), (10.0, 0.0, 0.0), ABSENT, (5.0, 5.0, 0.0)]
    rates = velocities(np.arange(7) * 0.5, np.array(track)[:, None])[:, 0]
    assert rates[:, 0] == pytest.approx([2.0, 2.0, np.nan, 2.0, 2.0, np.nan, 0.0], nan_ok=True)
    assert rates[:2, 2] == pytest.approx([2 * (2 * np.pi - 6.2)] * 2)


def test_headings_follow_the_velocity_and_are_kept_while_standing() -> None:
    velocity = np.array([(0.0, 0.0), (0.0, 1.0), (0.0, 0.05), (-1.0, 0.0), (np.nan, np.nan)])[:, None]
    headings = headings_along(velocity)[:, 0]
    assert headings == pytest.approx([np.pi / 2, np.pi / 2, np.pi / 2, np.pi, np.nan], nan_ok=True)


def test_estimated_radii_never_overlap() -> None:
    positions = np.array([[(0.0, 0.0), (5.0, 0.0), (9.0, 3.0)], [(0.0, 0.0), (0.22, 0.0), (9.0, 3.0)]])
    first, second, near_wall = fitting_radii(positions, np.array([(8.9, 0.0, 8.9, 9.0)]))
    assert first == second == pytest.approx(0.13)
    assert near_wall == pytest.approx(0.12)
    assert fitting_radii(positions[:1], np.zeros((0, 4))) == [PERSON_RADIUS] * 3
