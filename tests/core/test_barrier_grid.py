"""Barriers near a point or a line, found with a grid, against searches through all barriers."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sonata2d.core.barrier_grid import (
    Solids,
    find_within,
    is_blocked,
    is_crossed,
    is_near_line,
    is_within,
    nearest_within,
    outline_gap,
    packed_solids,
    rows_within,
    solids_of,
)
from sonata2d.core.geometry import Barriers, segment_distances, segments_cross
from sonata2d.core.portable_math import Array

SEEDS = range(30)


def scattered(seed: int) -> tuple[Solids, Barriers, np.random.Generator, float]:
    """Lines and discs of all sizes in areas of all sizes, some of them on the edges of cells."""
    rng = np.random.default_rng(seed)
    count, size = int(rng.integers(0, 90)), float(10.0 ** rng.uniform(-0.5, 2.0))
    start = rng.uniform(-size, size, (count, 2))
    end = start + rng.uniform(-size, size, (count, 2)) * rng.choice([0.0, 0.1, 1.0], (count, 1))
    if rng.random() < 0.3:
        start, end = np.round(start), np.round(end)
    radius = rng.choice([0.0, 0.2], count).tolist()
    barriers = Barriers.of([((a, b), (c, d), r) for (a, b), (c, d), r in zip(start, end, radius, strict=True)])
    return solids_of(barriers), barriers, rng, size


def points(rng: np.random.Generator, size: float, count: int = 40) -> Array:
    """Points in and around the area."""
    found: Array = rng.uniform(-1.5 * size, 1.5 * size, (count, 2))
    return np.round(found) if rng.random() < 0.3 else found


@pytest.mark.parametrize("seed", SEEDS)
def test_barriers_within_a_distance_are_those_of_a_search_through_all(seed: int) -> None:
    solids, barriers, rng, size = scattered(seed)
    distance = float(rng.uniform(0.1, 0.5) * size)
    for point in points(rng, size):
        x, y, gaps = float(point[0]), float(point[1]), barriers.gaps(point[None])[:, 0]
        expected = np.flatnonzero(gaps < distance)
        found = np.empty(len(barriers), dtype=np.int64)
        assert found[: find_within(solids, x, y, distance, found)].tolist() == expected.tolist()
        assert rows_within(packed_solids(barriers), (x, y), distance).tolist() == expected.tolist()
        assert is_within(solids, x, y, distance) == (len(expected) > 0)
        k, gap = nearest_within(solids, x, y, distance)
        assert gap == (gaps.min() if len(expected) else distance)
        assert k == (int(gaps.argmin()) if len(expected) else -1)


@pytest.mark.parametrize("seed", SEEDS)
def test_lines_are_blocked_and_crossed_as_in_a_search_through_all(seed: int) -> None:
    solids, barriers, rng, size = scattered(seed)
    start, end = points(rng, size), points(rng, size)
    gaps, crossed = segment_distances(start, end, barriers), segments_cross(start, end, barriers)
    clearance, tolerance = float(rng.uniform(0.05, 0.3) * size), 1e-6
    ends = np.minimum(barriers.gaps(start), barriers.gaps(end))
    for k, line in enumerate(np.hstack((start, end)).tolist()):
        nearest = gaps[:, k].min(initial=math.inf)
        if abs(nearest - clearance) > 2 * tolerance:
            assert is_blocked(solids, clearance, tolerance, *line) == (nearest < clearance)
            if ends[:, k].min(initial=math.inf) >= clearance:
                assert is_near_line(solids, clearance, *line) == (nearest < clearance)
        assert is_crossed(solids, *line) == crossed[:, k].any()


@pytest.mark.parametrize("seed", SEEDS)
def test_the_gap_of_a_body_is_that_of_its_shoulder_line(seed: int) -> None:
    solids, barriers, rng, size = scattered(seed)
    for point in points(rng, size):
        angle, radius, shoulder, limit = rng.uniform(-3.0, 3.0), 0.15, 0.1 * size, float(rng.uniform(0.0, 0.5) * size)
        bx, by = math.cos(angle), math.sin(angle)
        half = shoulder * np.array([-by, bx])
        gaps = segment_distances((point + half)[None], (point - half)[None], barriers)
        expected = min(gaps.min(initial=math.inf) - radius, limit)
        found = outline_gap(solids, float(point[0]), float(point[1]), bx, by, radius, shoulder, limit)
        assert found == pytest.approx(expected, abs=1e-9)
