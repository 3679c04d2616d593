"""Poses, shapes and distances in the plane."""

import math

import numpy as np
import pytest
from hypothesis import given, strategies as st

from sonata2d.core.compiled import scalar
from sonata2d.core.compiled.scalar import crosses, gap, is_inside, line_gap, towards
from sonata2d.core.geometry import (
    Barriers,
    Pose,
    canonical_angle,
    contact_times,
    inside_polygon,
    quantised,
    segment_distances,
    segments_cross,
    shoulder_line_distances,
    shoulder_lines,
    to_shoulder_line,
)
from sonata2d.core.portable_math import Array, unit_vector, unit_vectors
from sonata2d.core.vectors import lengths, wrap_angle

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


def random_barriers(seed: int) -> Barriers:
    """Barriers with a corner, a disc and thick segments, on and off a coarse grid."""
    rng = np.random.default_rng(seed)
    ends = rng.uniform(-3.0, 3.0, (12, 4))
    ends[::2] = np.round(ends[::2])
    ends[1, :2], ends[2, 2:] = ends[0, 2:], ends[2, :2]
    return Barriers.of(((a, b), (c, d), r) for (a, b, c, d), r in zip(ends, [0.0, 0.0, 0.3, 0.1] * 3, strict=True))


@pytest.mark.parametrize("seed", range(5))
def test_scalar_functions_have_the_bits_of_their_array_versions(seed: int) -> None:
    barriers = random_barriers(seed)
    start, end = np.random.default_rng(seed + 100).uniform(-3.0, 3.0, (2, 40, 2))
    start[::3], end[::3] = np.round(start[::3]), np.round(end[::3])
    start[1] = end[1]
    x, y = barriers.towards(start)
    gaps, line_gaps = barriers.gaps(start), segment_distances(start, end, barriers)
    is_crossed = segments_cross(start, end, barriers)
    for n, ((a, b), (c, d)) in enumerate(zip(start.tolist(), end.tolist(), strict=True)):
        for m in range(len(barriers)):
            assert towards(barriers.table, m, a, b) == (x[m, n], y[m, n])
            assert gap(barriers.table, m, a, b) == gaps[m, n]
            assert line_gap(barriers.table, m, a, b, c, d) == line_gaps[m, n]
            assert crosses(barriers.table, m, a, b, c, d) == is_crossed[m, n]


@given(st.floats(-1e9, 1e9))
def test_kernels_round_to_the_precision_of_files_as_poses_do(value: float) -> None:
    pose = Pose(value, round(value, 4) + 0.00005, value).rounded()  # the second one lies near a tie
    rounded = scalar.quantised(value), scalar.quantised(round(value, 4) + 0.00005), scalar.canonical_angle(value)
    assert [number.hex() for number in rounded] == [number.hex() for number in (pose.x, pose.y, pose.theta)]


def test_a_scalar_point_is_inside_where_its_array_version_is() -> None:
    polygon = np.array([[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2]], dtype=float)
    edges = np.concatenate((polygon, np.roll(polygon, -1, axis=0)), axis=1)
    points = np.random.default_rng(0).uniform(-0.5, 2.5, (300, 2))
    points[::2] = np.round(points[::2] * 2) / 2
    assert [is_inside(edges, x, y) for x, y in points.tolist()] == inside_polygon(points, polygon).tolist()


def test_joined_barriers_equal_barriers_of_all_edges() -> None:
    first, second = random_barriers(1), random_barriers(2)
    rows = np.concatenate([np.column_stack((each.start, each.end, each.radius)) for each in (first, second)])
    joined, expected = first.joined(second), Barriers.of(((a, b), (c, d), r) for a, b, c, d, r in rows.tolist())
    for name in ("start", "end", "radius", "table"):
        assert np.array_equal(getattr(joined, name), getattr(expected, name))
        with pytest.raises(ValueError, match="read-only"):
            getattr(joined, name)[0] = 0.0
    assert first.joined(Barriers.of([])) is first
    assert np.array_equal(Barriers.of([]).joined(first).table, first.table)


bodies = st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), st.floats(-4.0, 4.0), st.floats(0.0, 0.3))


def line_points(body: tuple[float, float, float, float]) -> Array:
    """1001 points on a shoulder line; body is x, y, theta and half the length of the line."""
    x, y, theta, shoulder = body
    start, end = shoulder_lines(np.array([x, y]), np.array(unit_vector(theta)), shoulder)
    return start + np.linspace(0.0, 1.0, 1001)[:, None] * (end - start)


@given(bodies, st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0)))
def test_nearest_point_of_a_shoulder_line_is_the_nearest_of_many(
    body: tuple[float, float, float, float], point: tuple[float, float]
) -> None:
    x, y, theta, shoulder = body
    offset, direction = np.array([x, y]) - np.array(point), np.array(unit_vector(theta))
    found = to_shoulder_line(offset, direction, shoulder)
    assert float(lengths(found)) == pytest.approx(float(lengths(line_points(body) - np.array(point)).min()), abs=1e-3)
    assert scalar.to_shoulder_line(*offset, *direction, shoulder) == tuple(found.tolist())
    assert to_shoulder_line(offset, direction, 0.0).tolist() == offset.tolist()  # a disc, to the last bit


@given(bodies, bodies)
def test_distance_of_shoulder_lines_is_that_of_their_nearest_points(
    body: tuple[float, float, float, float], other: tuple[float, float, float, float]
) -> None:
    offset = np.array(other[:2]) - np.array(body[:2])
    turned = [np.array(unit_vector(theta)) for theta in (body[2], other[2])]
    found = float(shoulder_line_distances(offset, turned[0], body[3], turned[1], other[3]))
    sampled = lengths(line_points(body)[:, None] - line_points(other)[None]).min()
    assert found == pytest.approx(float(sampled), abs=1e-3)
    assert scalar.shoulder_line_distance(*offset, *turned[0], body[3], *turned[1], other[3]) == pytest.approx(found)


@given(bodies, st.floats(-2.0, 2.0), st.floats(-2.0, 2.0))
def test_time_to_contact_is_the_first_time_at_which_the_outlines_touch(
    body: tuple[float, float, float, float], vx: float, vy: float
) -> None:
    x, y, theta, shoulder = body
    offset, direction, velocity, radii = np.array([x, y]), np.array(unit_vector(theta)), np.array([vx, vy]), 0.4
    found = float(contact_times(offset, velocity, radii, direction, shoulder))
    times = np.linspace(0.0, min(found, 10.0), 200)
    gaps = lengths(to_shoulder_line(offset - times[:, None] * velocity, direction, shoulder)) - radii
    assert gaps[:-1].min() > -1e-6 or found == 0.0
    if found < 10.0:
        assert gaps[-1] < 1e-6


@given(st.lists(angles, min_size=1, max_size=5))
def test_many_unit_vectors_have_the_bits_of_one(theta: list[float]) -> None:
    assert unit_vectors(np.array(theta)).tolist() == [list(unit_vector(angle)) for angle in theta]
