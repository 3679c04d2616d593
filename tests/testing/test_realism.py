"""The function by which the pedestrians are compared with recorded ones."""

from __future__ import annotations

import importlib.util
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from sonata2d.core.geometry import Point
from sonata2d.core.portable_math import Array, IntArray
from sonata2d.core.vectors import X, Y
from sonata2d.testing.realism import simulate

SHARED = Path(__file__).parents[3] / "shared"
CHECK = SHARED / "realism.py"
NO_WALLS = np.zeros((0, 4))


def walk(positions: list[Point], goals: list[Point], steps: int = 30, groups: IntArray | None = None) -> Array:
    """Simulate pedestrians that start at rest, without walls; (steps, N, 2)."""
    starts, count = np.array(positions), len(positions)
    return simulate(starts, np.zeros((count, 2)), np.array(goals), np.full(count, 1.2), NO_WALLS, 0.1, steps, groups)


@pytest.mark.usefixtures("motionless")
def test_pedestrians_walk_to_their_goals_and_stop_there() -> None:
    path = walk([(0.0, 0.0), (0.0, 3.0)], [(2.0, 0.0), (0.0, 3.0)], 60)
    assert path.shape == (60, 2, 2)
    assert path[0, 0] == pytest.approx((0.0, 0.0), abs=0.05)  # one tick after the start
    assert path[-1] == pytest.approx(np.array([(2.0, 0.0), (0.0, 3.0)]), abs=0.3)
    assert np.abs(path[-5:] - path[-1]).max() < 0.01
    assert np.abs(path[:, 1] - (0.0, 3.0)).max() < 0.01  # started at its goal


@pytest.mark.usefixtures("no_deviations")
def test_a_run_continues_from_the_state_of_another_one() -> None:
    """Without deviations, which are no part of the state."""
    whole = walk([(0.0, 0.0)], [(9.0, 1.0)], 40)
    state = whole[19]
    velocity = (whole[19] - whole[18]) / 0.1
    rest = simulate(state, velocity, np.array([[9.0, 1.0]]), np.array([1.2]), NO_WALLS, 0.1, 20)
    assert rest[-1] == pytest.approx(whole[-1], abs=0.03)


def test_pedestrians_walk_round_walls() -> None:
    wall = np.array([[1.0, -1.0, 1.0, 1.0]])
    start, goal = np.zeros((1, 2)), np.array([[3.0, 0.0]])
    path = simulate(start, start, goal, np.array([1.2]), wall, 0.1, 80)
    assert path[-1, 0] == pytest.approx((3.0, 0.0), abs=0.3)
    assert np.abs(path[:, 0, Y]).max() > 1.0


def test_members_of_a_group_stay_closer_than_strangers() -> None:
    positions, goals = [(0.0, 0.0), (-1.6, 0.2)], [(8.0, 0.0), (8.0, 0.2)]
    alone, together = walk(positions, goals), walk(positions, goals, groups=np.array([1, 1]))
    alone_gap, together_gap = (path[-1, 0, X] - path[-1, 1, X] for path in (alone, together))
    assert together_gap < alone_gap - 0.02
    assert np.array_equal(walk(positions, goals, groups=np.array([0, 0])), alone)


@pytest.fixture(scope="module")
def check() -> ModuleType:
    """The module that compares simulated with recorded pedestrians."""
    if not CHECK.exists():
        pytest.skip("needs ../shared/realism.py and recorded pedestrians, which are not part of the repository")
    spec = importlib.util.spec_from_file_location("realism_check", CHECK)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("name", ["eth", "zara01"])
def test_the_best_of_eight_runs_is_as_near_as_a_straight_line_and_nobody_touches(
    check: ModuleType, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    """On every sixth window only; docs/realism.md has the results of all.

    For each person the best run counts. The ADE is not below that of straight lines: many goals lie behind walls, which
    straight lines ignore.
    """
    scene, all_windows, now = check.Scene(SHARED / "data" / "real" / f"{name}.csv"), check.windows, list[Any]()

    def windows(scene: Any, oracle: Any) -> Iterator[Any]:
        for window in list(all_windows(scene, oracle))[::6]:
            now[:] = [window]
            yield window

    def best(*given: Any) -> Array:
        runs = np.array([simulate(*given, seed=seed) for seed in range(8)])
        error = np.linalg.norm(runs[:, check.SUB - 1 :: check.SUB] - now[0].real[1:], axis=3)
        chosen = np.nan_to_num(error, nan=9.0).mean(axis=1).argmin(axis=0)
        return np.stack([runs[run, :, person] for person, run in enumerate(chosen)], axis=1)

    monkeypatch.setattr(check, "windows", windows)
    ours, straight = (check.replay(check.load(model), scene) for model in ("sonata2d.testing.realism", "straight"))
    assert ours["contacts"] == 0.0
    assert ours["wall_hits"] == 0.0
    assert check.replay(best, scene)["ADE"] < 1.2 * straight["ADE"]


@pytest.mark.usefixtures("no_deviations")
@pytest.mark.parametrize("name", ["eth", "zara01"])
def test_encounters_are_as_urgent_as_recorded_ones(
    check: ModuleType, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    scene, all_windows = check.Scene(SHARED / "data" / "real" / f"{name}.csv"), check.windows
    monkeypatch.setattr(check, "windows", lambda scene, oracle: list(all_windows(scene, oracle))[::3])
    ours, straight = (check.replay(check.load(model), scene) for model in ("sonata2d.testing.realism", "straight"))
    assert ours["W_urgency"] < straight["W_urgency"]
