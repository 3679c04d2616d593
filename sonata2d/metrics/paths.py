"""Metrics of path and motion: length compared with the shortest path, turning, smoothness."""

from __future__ import annotations

import numpy as np

from ..core.portable_math import Array
from ..core.vectors import lengths, wrap_angles
from .definition import GOAL, OBSTACLES, metric
from .trajectory import Trajectory

_SHORTEST_PATH = (*GOAL, *OBSTACLES)


def path_length_of(trajectory: Trajectory) -> float:
    """Length of the path of the robot's centre, m."""
    return float(lengths(trajectory.position[1:] - trajectory.position[:-1]).sum())


@metric("m", "less", needs={"robot"}, headline=True)
def path_length(trajectory: Trajectory) -> float:
    """PL = Σ |p(k+1) − p(k)|.

    Source: Francis et al., arXiv 2306.16740, table of metrics (PL).
    """
    return path_length_of(trajectory)


@metric("m", "neither", needs=_SHORTEST_PATH)
def shortest_length(trajectory: Trajectory) -> float | None:
    """L₀ = length of the robot's shortest path to a position with |p − g| ≤ goal.distance; 0 if it starts there.

    The path keeps p at r_robot from each wall and object or farther, at its distance at the start if that is less, by
    straight lines and arcs around corners, and ignores people. Not defined where no path exists.

    Source: Anderson et al., arXiv 1807.06757.
    """
    return trajectory.shortest_path


@metric("share", "more", needs=_SHORTEST_PATH, headline=True)
def spl(trajectory: Trajectory) -> float | None:
    """S · L₀ / max(PL, L₀), where S is success; S if L₀ is 0.

    Not defined where no path exists.

    Source: Anderson et al., arXiv 1807.06757.
    """
    return _weighted_success(trajectory, trajectory.shortest_path, path_length_of(trajectory))


@metric("share", "more", needs={*_SHORTEST_PATH, "robot.limits"})
def stl(trajectory: Trajectory) -> float | None:
    """S · T₀ / max(T, T₀), where T₀ = L₀ / limits.ahead.

    Not defined where no path exists.

    Source: SocNavGym, STL, with a T₀ that needs no second robot.
    """
    path = trajectory.shortest_path
    shortest = None if path is None else path / trajectory.scene.robot.limits.ahead
    return _weighted_success(trajectory, shortest, trajectory.total_time)


@metric("rad", "less", needs={"robot"}, headline=True)
def cumulative_heading_change(trajectory: Trajectory) -> float:
    """Σ |wrap(θ(k+1) − θ(k))|.

    Source: HuNavSim, cumulative_heading_changes.
    """
    return float(np.abs(wrap_angles(np.diff(trajectory.heading))).sum())


@metric("m/s", "neither", needs={"robot"})
def speed_mean(trajectory: Trajectory) -> float | None:
    """PL / T; not defined for a single state.

    Source: Francis et al., arXiv 2306.16740, table of metrics (V).
    """
    time = trajectory.total_time
    return path_length_of(trajectory) / time if time > 0.0 else None


@metric("m/s", "neither", needs={"robot"})
def speed_max(trajectory: Trajectory) -> float:
    """Max |v|.

    Source: Francis et al., arXiv 2306.16740, table of metrics (V).
    """
    return float(lengths(trajectory.velocity).max())


@metric("m/s²", "less", needs={"robot"})
def acceleration_mean(trajectory: Trajectory) -> float | None:
    """Mean |Δv / Δt|, of vectors in the world frame; not defined for a single state.

    Source: Francis et al., arXiv 2306.16740, table of metrics (A).
    """
    return _mean(_acceleration(trajectory))


@metric("m/s²", "less", needs={"robot"})
def acceleration_max(trajectory: Trajectory) -> float | None:
    """Max |Δv / Δt|; not defined for a single state.

    Source: Francis et al., arXiv 2306.16740, table of metrics (A).
    """
    return _max(_acceleration(trajectory))


@metric("m/s³", "less", needs={"robot"}, headline=True)
def jerk_mean(trajectory: Trajectory) -> float | None:
    """Mean |Δ(Δv / Δt) / Δt|, of vectors in the world frame; not defined for fewer than three states.

    Source: Francis et al., arXiv 2306.16740, table of metrics (J).
    """
    return _mean(_jerk(trajectory))


@metric("m/s³", "less", needs={"robot"})
def jerk_max(trajectory: Trajectory) -> float | None:
    """Max |Δ(Δv / Δt) / Δt|; not defined for fewer than three states.

    Source: Francis et al., arXiv 2306.16740, table of metrics (J).
    """
    return _max(_jerk(trajectory))


def _acceleration(trajectory: Trajectory) -> Array:
    """(L - 1, 2), m/s², between consecutive states."""
    return np.diff(trajectory.velocity, axis=0) / trajectory.durations[:, None]


def _jerk(trajectory: Trajectory) -> Array:
    """(L - 2, 2), m/s³, at all states but the first and the last."""
    durations = (trajectory.durations[1:] + trajectory.durations[:-1]) / 2.0
    return np.diff(_acceleration(trajectory), axis=0) / durations[:, None]


def _weighted_success(trajectory: Trajectory, shortest: float | None, actual: float) -> float | None:
    """Success times shortest / actual, where lengths or times are compared."""
    if shortest is None:
        return None
    success = float(trajectory.goal_index is not None)
    # a robot that starts within the goal needs no path, and gets the full weight
    return success * (shortest / max(actual, shortest) if shortest > 0.0 else 1.0)


def _mean(vectors: Array) -> float | None:
    """Mean length of (n, 2) vectors; None without any."""
    return float(lengths(vectors).mean()) if len(vectors) else None


def _max(vectors: Array) -> float | None:
    """Largest length of (n, 2) vectors; None without any."""
    return float(lengths(vectors).max()) if len(vectors) else None


METRICS = (
    path_length, shortest_length, spl, stl, cumulative_heading_change, speed_mean, speed_max, acceleration_mean,
    acceleration_max, jerk_mean, jerk_max,
)  # fmt: skip
