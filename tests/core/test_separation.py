"""Separations of convex polygons and lines, against code that samples points and directions."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from sonata2d.core.geometry import Disc, Polygon, Pose, Rectangle, Shape
from sonata2d.core.portable_math import Array
from sonata2d.core.separation import covering_discs, outline_gaps

HEXAGON = Polygon(tuple((0.5 * math.cos(k * math.pi / 3), 0.4 * math.sin(k * math.pi / 3)) for k in range(6)))
WEDGE = Polygon(((0.7, 0.0), (-0.3, 0.3), (-0.2, -0.35)))
SHAPES: list[Shape] = [Rectangle(0.9, 0.6), Rectangle(0.3, 1.1), HEXAGON, WEDGE, Disc(0.3)]

places = st.floats(-1.5, 1.5)
angles = st.floats(-math.pi, math.pi)


def points_of(corners: Array, count: int = 150) -> Array:
    """Points on the sides of a closed line, (n, 2)."""
    t = np.linspace(0.0, 1.0, count)[:, None]
    pairs = zip(corners, np.roll(corners, -1, axis=0), strict=True)
    return np.concatenate([a + t * (b - a) for a, b in pairs])


def sampled_gap(corners: Array, start: Array, end: Array) -> float:
    """Distance of a polygon and a line; where they overlap, minus the least translation that parts them."""
    line = start + np.linspace(0.0, 1.0, 201)[:, None] * (end - start)
    angle = np.linspace(0.0, 2.0 * math.pi, 6_001)
    directions = np.stack((np.cos(angle), np.sin(angle)))
    depth = np.min((corners @ directions).max(axis=0) - (np.stack((start, end)) @ directions).min(axis=0))
    if depth > 0.0 and len(corners) > 2:
        return -float(depth)
    return float(np.min(np.linalg.norm(points_of(corners)[:, None] - line[None], axis=2)))


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: type(shape).__name__)
@settings(max_examples=40)
@given(x=places, y=places, theta=angles, ax=places, ay=places, bx=places, by=places)
def test_gaps_equal_those_of_sampled_points(
    shape: Shape, x: float, y: float, theta: float, ax: float, ay: float, bx: float, by: float
) -> None:
    pose, line = Pose(x, y, theta), np.array([[[ax, ay, bx, by, 0.05]]])
    gap = outline_gaps(shape, np.array([pose.position]), np.array([pose.direction]), line)[0, 0]
    expected = sampled_gap(np.array(shape.corners(pose)), np.array([ax, ay]), np.array([bx, by]))
    assert gap == pytest.approx(expected - shape.rounding - 0.05, abs=6e-3)


def test_gaps_turn_and_move_with_the_scene() -> None:
    """Turning and moving everything keeps the gaps, at many poses at once."""
    draw = np.random.default_rng(3)
    position, lines = draw.uniform(-1.0, 1.0, (50, 2)), draw.uniform(-1.0, 1.0, (50, 7, 5))
    angle = draw.uniform(-3.0, 3.0, 50)
    direction = np.stack((np.cos(angle), np.sin(angle)), axis=1)
    gaps = outline_gaps(WEDGE, position, direction, lines)
    c, s = math.cos(1.1), math.sin(1.1)
    turn = np.array([[c, s], [-s, c]])
    moved = lines.copy()
    for ends in (slice(0, 2), slice(2, 4)):
        moved[..., ends] = lines[..., ends] @ turn + (3.0, -2.0)
    again = outline_gaps(WEDGE, position @ turn + (3.0, -2.0), direction @ turn, moved)
    np.testing.assert_allclose(again, gaps, atol=1e-12)


def test_gaps_of_absent_lines_are_nan() -> None:
    lines = np.array([[[np.nan] * 5, [1.0, 0.0, 2.0, 0.0, 0.1]]])
    gaps = outline_gaps(Rectangle(1.0, 1.0), np.zeros((1, 2)), np.array([[1.0, 0.0]]), lines)[0]
    assert math.isnan(gaps[0])
    assert gaps[1] == pytest.approx(0.4)


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: type(shape).__name__)
def test_covering_discs_contain_the_outline_and_keep_close_to_it(shape: Shape) -> None:
    discs, radius = covering_discs(shape)
    if isinstance(shape, Disc):
        assert discs.tolist() == [[0.0, 0.0]]
        assert radius == shape.radius
        return
    corners = np.array(shape.core)
    draw = np.random.default_rng(0)
    weights = draw.dirichlet(np.full(len(corners), 0.4), 5000)
    inside = np.concatenate((points_of(corners), weights @ corners))
    distance = np.linalg.norm(inside[:, None] - discs[None], axis=2).min(axis=1)
    assert distance.max() <= radius + 1e-9
    angle = np.linspace(0.0, 2.0 * math.pi, 100)
    rims = (discs[:, None] + radius * np.stack((np.cos(angle), np.sin(angle)), axis=1)).reshape(-1, 2)
    lines = np.concatenate((rims, rims, np.zeros((len(rims), 1))), axis=1)[None]
    beyond = outline_gaps(shape, np.zeros((1, 2)), np.array([[1.0, 0.0]]), lines)
    assert beyond.max() < (0.071 if isinstance(shape, Rectangle) else 0.25)
