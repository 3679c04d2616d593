"""Gaps between outlines, and whether outlines have space in a room."""

import math

import numpy as np
import pytest
from hypothesis import given, strategies as st

from sonata2d.core.geometry import Barriers, Disc, Pose, Rectangle, Shape
from sonata2d.core.outlines import COLUMNS, has_space, has_space_at, outline_row, shape_gap
from sonata2d.core.portable_math import Array

metres = st.floats(-20.0, 20.0)
poses = st.builds(Pose, metres, metres, st.floats(-50.0, 50.0))

SQUARE = np.array([[-4.0, -4.0], [4.0, -4.0], [4.0, 4.0], [-4.0, 4.0]])
BORDERS = np.concatenate((SQUARE, np.roll(SQUARE, -1, axis=0)), axis=1)
WALLS = Barriers.of([*(((a, b), (c, d), 0.0) for a, b, c, d in BORDERS.tolist()), ((0.0, 0.0), (4.0, 0.0), 0.0)])
NOTHING, NO_LINES = np.empty((0, COLUMNS)), np.empty((0, 4))


def fits(
    *outlines: tuple[Shape, Pose], wall_gap: float = 0.1, others: Array = NOTHING, sight_lines: Array = NO_LINES
) -> bool:
    """Whether outlines have space, with a clearance of 0.1 m, in a square room with a wall from (0, 0) to (4, 0)."""
    rows = np.array([outline_row(shape, pose, wall_gap) for shape, pose in outlines])
    return bool(has_space(WALLS.table, BORDERS, rows, others, 0.1, sight_lines))


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


def boundary(shape: Shape, pose: Pose) -> Array:
    """Many points on an outline, (N, 2), m."""
    if isinstance(shape, Disc):
        angles = np.linspace(0.0, 2 * math.pi, 400)
        return np.array(pose.position) + shape.radius * np.stack((np.cos(angles), np.sin(angles)), axis=1)
    return np.concatenate([np.linspace(a, b, 100) for a, b, _ in shape.edges(pose)])


@pytest.mark.parametrize("seed", range(4))
def test_shape_gap_is_the_distance_of_the_nearest_points(seed: int) -> None:
    rng = np.random.default_rng(seed)
    for _ in range(20):
        shapes = [Rectangle(*rng.uniform(0.2, 2.0, 2).tolist()), Disc(float(rng.uniform(0.1, 1.0)))]
        first, second = (shapes[k] for k in rng.integers(2, size=2))
        pose, other_pose = (Pose(*rng.uniform(-2.0, 2.0, 3).tolist()) for _ in range(2))
        a, b = boundary(first, pose), boundary(second, other_pose)
        between = np.sqrt(((a[:, None, :] - b[None, :, :]) ** 2).sum(axis=2)).min()
        gap = shape_gap(first, pose, second, other_pose)
        assert gap == 0.0 or gap == pytest.approx(between, abs=0.02)
        assert between >= gap - 1e-9


def test_outlines_must_lie_in_the_room_and_keep_their_gap_to_walls() -> None:
    disc, table = Disc(0.3), Rectangle(2.0, 1.0)
    assert fits((disc, Pose(-2.0, 0.0)), (table, Pose(2.0, 2.0, 0.5)))
    assert fits((disc, Pose(-3.59, 0.0)))
    assert not fits((disc, Pose(-3.61, 0.0)))
    assert not fits((disc, Pose(-6.0, 0.0)))
    assert fits((table, Pose(2.0, 0.61)))
    assert not fits((table, Pose(2.0, 0.59)))
    assert not fits((table, Pose(-0.61, 0.0)))  # the inscribed circle keeps the gap, but a side does not
    assert fits((table, Pose(-0.61, 0.0, math.pi / 2)))


def test_without_a_wall_gap_only_the_centre_must_lie_in_the_room() -> None:
    assert fits((Disc(0.3), Pose(2.0, 0.1)), wall_gap=-math.inf)
    assert not fits((Disc(0.3), Pose(5.0, 0.1)), wall_gap=-math.inf)


def test_outlines_keep_the_clearance_to_others_and_to_each_other() -> None:
    disc, table = Disc(0.3), Rectangle(2.0, 1.0)
    others = np.array([outline_row(disc, Pose(-2.0, 0.0)), outline_row(table, Pose(-2.0, 2.0))])
    assert fits((disc, Pose(-2.0, -0.71)), others=others)
    assert not fits((disc, Pose(-2.0, -0.69)), others=others)
    assert not fits((disc, Pose(-2.0, 2.0)), others=others)  # inside the table
    assert not fits((disc, Pose(-2.0, 2.89)), others=others)
    assert fits((disc, Pose(-2.0, 2.91)), others=others)
    assert fits((disc, Pose(-2.0, -2.0)), (table, Pose(-0.59, -2.0)))
    assert not fits((disc, Pose(-2.0, -2.0)), (table, Pose(-0.61, -2.0)))
    assert fits((disc, Pose(-2.0, -2.0)), (disc, Pose(-1.4, -2.0)))  # people who start together may touch
    assert not fits((disc, Pose(-2.0, -2.0)), (disc, Pose(-1.41, -2.0)))


def test_sight_lines_do_not_cross_walls() -> None:
    place = Disc(0.3), Pose(-2.0, 0.0)
    assert fits(place, sight_lines=np.array([[-2.0, 1.0, -2.0, -1.0]]))
    assert not fits(place, sight_lines=np.array([[-2.0, 1.0, -2.0, -1.0], [2.0, 1.0, 2.0, -1.0]]))


@given(st.builds(Pose, st.floats(-4.5, 4.5), st.floats(-4.5, 4.5), st.floats(-50.0, 50.0)), st.booleans())
def test_relative_outlines_have_space_where_they_have_it_after_being_moved(origin: Pose, is_near: bool) -> None:
    shapes = Disc(0.3), Rectangle(0.9, 0.4)
    relative = Pose(0.0, 0.0), Pose(1.0 if is_near else 3.0, -0.5, 1.2)
    moved = [Pose(*origin.to_world(pose.position), origin.theta + pose.theta).rounded() for pose in relative]
    rows = np.array([outline_row(shape, pose, 0.1) for shape, pose in zip(shapes, relative, strict=True)])
    before = rows.copy()
    others = np.array([outline_row(Disc(0.5), Pose(-2.0, 2.0))])
    found = has_space_at(origin.x, origin.y, origin.theta, rows, WALLS.table, BORDERS, others, 0.1)
    assert found == fits(*zip(shapes, moved, strict=True), others=others)
    assert np.array_equal(rows, before)


def test_relative_outlines_beyond_the_numbers_of_files_have_no_space() -> None:
    rows = np.array([outline_row(Disc(0.3), Pose(1e300, 0.0))])
    assert not has_space_at(0.0, 0.0, 0.0, rows, WALLS.table, BORDERS, NOTHING, 0.1)
