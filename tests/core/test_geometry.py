"""Poses, shapes and distances in the plane."""

import math

import numpy as np
import pytest
from hypothesis import given, strategies as st

from sonata2d.core.geometry import (
    Barriers,
    Disc,
    Pose,
    Rectangle,
    canonical_angle,
    inside_polygon,
    quantised,
    segment_distances,
    shape_gap,
)
from sonata2d.core.vectors import wrap_angle

metres = st.floats(-20.0, 20.0)
angles = st.floats(-50.0, 50.0)
poses = st.builds(Pose, metres, metres, angles)


@given(angles)
def test_wrapped_angle_has_the_same_direction_and_is_in_range(angle: float) -> None:
    wrapped = wrap_angle(angle)
    assert -math.pi < wrapped <= math.pi
    assert math.cos(wrapped - angle) == pytest.approx(1.0, abs=1e-9)


@given(angles)
def test_canonical_angle_is_in_range_and_idempotent(angle: float) -> None:
    canonical = canonical_angle(angle)
    assert -3.1416 < canonical <= 3.1416
    assert canonical_angle(canonical) == canonical


@given(st.floats(-1e4, 1e4))
def test_quantised_is_near_idempotent_and_never_minus_zero(value: float) -> None:
    rounded = quantised(value)
    assert rounded == pytest.approx(value, abs=5.1e-5)
    assert quantised(rounded) == rounded
    assert math.copysign(1.0, rounded) == 1.0 or rounded != 0.0
    assert len(repr(rounded).rpartition(".")[2]) <= 4 or "e" in repr(rounded)


@given(poses, metres, metres)
def test_to_world_is_the_inverse_of_to_local(pose: Pose, x: float, y: float) -> None:
    assert pose.to_world(pose.to_local((x, y))) == pytest.approx((x, y), abs=1e-9)


def test_to_local_gives_ahead_and_left() -> None:
    assert Pose(0.0, 0.0, math.pi / 2).to_local((-1.0, 2.0)) == pytest.approx((2.0, 1.0))


def test_shape_gap_equals_values_worked_out_by_hand() -> None:
    table, plant = Rectangle(2.0, 1.0), Disc(0.5)
    assert shape_gap(table, Pose(0, 0), plant, Pose(2.0, 0)) == pytest.approx(0.5)
    assert shape_gap(table, Pose(0, 0, math.pi / 2), plant, Pose(2.0, 0)) == pytest.approx(1.0)
    assert shape_gap(table, Pose(0, 0), plant, Pose(4.0, 4.5)) == pytest.approx(4.5)
    assert shape_gap(table, Pose(0, 0), table, Pose(0.1, 0, 1.0)) == 0.0
    assert shape_gap(Rectangle(4.0, 4.0), Pose(0, 0), plant, Pose(0.2, 0)) == 0.0
    assert shape_gap(table, Pose(0, 0), table, Pose(0, 3.0, math.pi / 4)) == pytest.approx(2.5 - 1.5 / math.sqrt(2))


@given(poses, poses)
def test_shape_gap_is_symmetric(pose: Pose, other_pose: Pose) -> None:
    rectangle, disc = Rectangle(1.2, 0.6), Disc(0.3)
    gap = shape_gap(rectangle, pose, disc, other_pose)
    assert gap == pytest.approx(shape_gap(disc, other_pose, rectangle, pose), abs=1e-9)


def test_a_line_that_crosses_a_wall_has_no_gap() -> None:
    barriers = Barriers.of([((0.0, -1.0), (0.0, 1.0), 0.0), ((3.0, 3.0), (3.0, 3.0), 0.5)])
    start, end = np.array([[-1.0, 0.0], [1.0, -1.0]]), np.array([[1.0, 0.0], [1.0, 3.0]])
    gaps = segment_distances(start, end, barriers)
    assert gaps[0, 0] <= 0.0
    assert gaps[0, 1] == pytest.approx(1.0)
    assert gaps[1, 1] == pytest.approx(1.5)


def test_the_notch_of_an_l_is_outside_the_polygon() -> None:
    polygon = np.array([[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2]], dtype=float)
    points = np.array([[0.5, 0.5], [1.5, 0.5], [0.5, 1.5], [1.5, 1.5], [-0.1, 0.5]])
    assert inside_polygon(points, polygon).tolist() == [True, True, True, False, False]
