"""The door behind which the people of sonata2d are compared with recorded ones."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from sonata2d.testing.realism import simulate

SHARED = Path(__file__).parents[3] / "shared"
CHECK = SHARED / "realism.py"


def walk(
    places: list[tuple[float, float]], goals: list[tuple[float, float]], steps: int = 30, **more: object
) -> np.ndarray:
    x, g = np.array(places), np.array(goals)
    return simulate(x, np.zeros_like(x), g, np.full(len(x), 1.2), np.zeros((0, 4)), 0.1, steps, **more)  # type: ignore[arg-type]


def test_people_walk_to_their_goals_and_stop_there() -> None:
    path = walk([(0.0, 0.0), (0.0, 3.0)], [(2.0, 0.0), (0.0, 3.0)], 60)
    assert path.shape == (60, 2, 2)
    assert path[0, 0] == pytest.approx((0.0, 0.0), abs=0.05)  # the first one is dt after the start
    assert path[-1] == pytest.approx(np.array([(2.0, 0.0), (0.0, 3.0)]), abs=0.05)
    assert np.abs(path[:, 1] - (0.0, 3.0)).max() < 0.01  # who was told to stand stood


def test_a_call_goes_on_from_where_the_last_one_ended() -> None:
    whole = walk([(0.0, 0.0)], [(9.0, 1.0)], 40)
    state = whole[19]
    velocity = (whole[19] - whole[18]) / 0.1
    rest = simulate(state, velocity, np.array([[9.0, 1.0]]), np.array([1.2]), np.zeros((0, 4)), 0.1, 20)
    assert rest[-1] == pytest.approx(whole[-1], abs=0.03)


def test_walls_are_gone_round() -> None:
    wall = np.array([[1.0, -1.0, 1.0, 1.0]])
    start, goal = np.zeros((1, 2)), np.array([[3.0, 0.0]])
    path = simulate(start, start, goal, np.array([1.2]), wall, 0.1, 80)
    assert path[-1, 0] == pytest.approx((3.0, 0.0), abs=0.1)
    assert np.abs(path[:, 0, 1]).max() > 1.0


def test_groups_are_told_apart_from_strangers() -> None:
    places, goals = [(0.0, 0.0), (-1.6, 0.2)], [(8.0, 0.0), (8.0, 0.2)]
    alone, together = walk(places, goals), walk(places, goals, groups=np.array([1, 1]))
    gap = [path[-1, 0, 0] - path[-1, 1, 0] for path in (alone, together)]
    assert gap[1] < gap[0] - 0.02  # who walks together closes up
    assert np.array_equal(walk(places, goals, groups=np.array([0, 0])), alone)


@pytest.fixture(scope="module")
def check() -> ModuleType:
    if not CHECK.exists():
        pytest.skip("needs recorded pedestrians and their check, which are not part of the repository")
    spec = importlib.util.spec_from_file_location("realism_check", CHECK)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("name", ["eth", "zara01"])
def test_people_come_nearer_to_recorded_ones_than_a_straight_line_and_touch_nobody(
    check: ModuleType, name: str
) -> None:
    """A few windows only; the whole table is in docs/realism.md."""
    scene, every = check.Scene(SHARED / "data" / "real" / f"{name}.csv"), check.windows
    check.windows = lambda scene, oracle: list(every(scene, oracle))[::12]
    try:
        ours, straight = (check.replay(check.load(model), scene) for model in ("sonata2d.testing.realism", "straight"))
    finally:
        check.windows = every
    assert ours["contacts"] == 0.0
    assert ours["wall_hits"] == 0.0
    assert ours["ADE"] < 1.05 * straight["ADE"]
    assert ours["W_urgency"] < straight["W_urgency"]
