"""The small linear program against a search of every velocity on a grid."""

from __future__ import annotations

import numpy as np
import pytest

from sonata2d.agents.pedestrians.models.orca2011 import HalfPlane, chosen_velocity, nearest_velocity
from sonata2d.core.portable_math import Array

STEP = 0.01
AXIS = np.arange(-1.5, 1.5 + STEP / 2, STEP)
GRID = np.stack(np.meshgrid(AXIS, AXIS), axis=-1).reshape(-1, 2)


def drawn(rng: np.random.Generator, count: int, low: float, high: float) -> list[HalfPlane]:
    """Half-planes whose edges are `low` to `high` m/s from standing still, negative where that is allowed."""
    angle, least = rng.uniform(0.0, 2 * np.pi, count), rng.uniform(low, high, count)
    return [(float(np.cos(a)), float(np.sin(a)), float(c)) for a, c in zip(angle, least, strict=True)]


def breaches(planes: list[HalfPlane], velocity: Array) -> Array:
    """By how much each velocity, (K, 2), breaks each half-plane, (P, K), m/s."""
    rows = np.array(planes).reshape(-1, 3)
    return rows[:, 2:] - rows[:, :2] @ velocity.T


@pytest.mark.parametrize("seed", range(40))
def test_the_nearest_velocity_is_the_nearest_on_a_grid(seed: int) -> None:
    rng = np.random.default_rng(seed)
    planes = drawn(rng, int(rng.integers(1, 9)), -1.0, 0.3)
    wish = (float(rng.uniform(-1.5, 1.5)), float(rng.uniform(-1.5, 1.5)))
    found, kept = nearest_velocity(planes, wish, 1.3)
    allowed = GRID[(breaches(planes, GRID).max(axis=0) <= 0.0) & (np.linalg.norm(GRID, axis=1) <= 1.3)]
    if kept < len(planes):
        assert len(allowed) < 20  # nothing, or a sliver between grid points
        return
    assert breaches(planes, np.array([found])).max() < 1e-9
    assert np.linalg.norm(found) < 1.3 + 1e-9
    if len(allowed):
        best = np.linalg.norm(allowed - wish, axis=1).min()
        assert np.linalg.norm(np.subtract(found, wish)) < best + 1e-9


@pytest.mark.parametrize("seed", range(40))
def test_where_none_is_safe_the_worst_breach_is_the_least_on_a_grid(seed: int) -> None:
    rng = np.random.default_rng(seed)
    hard, soft = drawn(rng, 2, -0.5, 0.0), drawn(rng, int(rng.integers(3, 12)), 0.2, 1.0)
    found = np.array([chosen_velocity(hard, soft, (1.0, 0.2), 1.3)])
    assert breaches(hard, found).max() < 1e-9
    assert np.linalg.norm(found) < 1.3 + 1e-9
    allowed = GRID[(breaches(hard, GRID).max(axis=0) <= 0.0) & (np.linalg.norm(GRID, axis=1) <= 1.3)]
    best = max(breaches(soft, allowed).max(axis=0).min(), 0.0)
    assert best - 1.5 * STEP < max(breaches(soft, found).max(), 0.0) < best + 1e-6


def test_a_safe_wish_is_granted_and_haste_is_cut() -> None:
    assert chosen_velocity([], [(0.0, 1.0, -1.0)], (0.5, 0.25), 1.3) == (0.5, 0.25)
    assert chosen_velocity([], [], (3.0, 4.0), 1.0) == pytest.approx((0.6, 0.8))


def test_the_order_of_half_planes_does_not_change_the_choice() -> None:
    rng = np.random.default_rng(3)
    planes = drawn(rng, 8, -0.8, 0.1)
    there, back = (chosen_velocity([], order, (1.2, 0.3), 1.3) for order in (planes, planes[::-1]))
    assert there == pytest.approx(back, abs=1e-9)
