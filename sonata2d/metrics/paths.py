"""Metrics of path and motion: length compared with the shortest path, turning, smoothness."""

from __future__ import annotations

import numpy as np

from ..core.portable_math import Array
from ..core.vectors import lengths, wrap_angles
from .definition import Metric
from .outcomes import success
from .trajectory import Trajectory

_FRANCIS = "Francis et al., arXiv 2306.16740, table of metrics"
_ANDERSON = "Anderson et al., arXiv 1807.06757"


def path_length(trajectory: Trajectory) -> float:
    """Length of the path of the robot's centre, m."""
    return float(lengths(trajectory.position[1:] - trajectory.position[:-1]).sum())


def spl(trajectory: Trajectory) -> float | None:
    """Success weighted by shortest over actual path length; None where no path exists."""
    return _weighted_success(trajectory, trajectory.shortest_path, path_length(trajectory))


def stl(trajectory: Trajectory) -> float | None:
    """Success weighted by shortest over actual time; None where no path exists."""
    path = trajectory.shortest_path
    shortest = None if path is None else path / trajectory.scene.robot.limits.ahead
    return _weighted_success(trajectory, shortest, trajectory.total_time)


def cumulative_heading_change(trajectory: Trajectory) -> float:
    """Sum of the absolute heading changes, rad."""
    return float(np.abs(wrap_angles(np.diff(trajectory.heading))).sum())


def speed_mean(trajectory: Trajectory) -> float | None:
    """Path length over time, m/s; None for an episode of a single state."""
    time = trajectory.total_time
    return path_length(trajectory) / time if time > 0.0 else None


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
    # a robot that starts within the goal needs no path, and gets the full weight
    return success(trajectory) * (shortest / max(actual, shortest) if shortest > 0.0 else 1.0)


def _mean(vectors: Array) -> float | None:
    """Mean length of (n, 2) vectors; None without any."""
    return float(lengths(vectors).mean()) if len(vectors) else None


def _max(vectors: Array) -> float | None:
    """Largest length of (n, 2) vectors; None without any."""
    return float(lengths(vectors).max()) if len(vectors) else None


METRICS = (
    Metric(
        "path_length", "m", "less", "PL = Σ |p(k+1) − p(k)|", f"{_FRANCIS} (PL)", path_length, headline=True
    ),
    Metric(
        "shortest_length", "m", "neither",
        "L₀ = length of the robot's shortest path around walls and furniture, minus goal.distance, at least 0; not"
        " defined where no path exists",
        _ANDERSON, lambda trajectory: trajectory.shortest_path,
    ),
    Metric(
        "spl", "share", "more", "S · L₀ / max(PL, L₀), where S is success; S if the robot starts within the goal",
        _ANDERSON, spl, headline=True,
    ),
    Metric(
        "stl", "share", "more", "S · T₀ / max(T, T₀), where T₀ = L₀ / limits.ahead",
        "SocNavGym, STL, with a T₀ that needs no second robot", stl,
    ),
    Metric(
        "cumulative_heading_change", "rad", "less", "Σ |wrap(θ(k+1) − θ(k))|", "HuNavSim, cumulative_heading_changes",
        cumulative_heading_change, headline=True,
    ),
    Metric("speed_mean", "m/s", "neither", "PL / T", f"{_FRANCIS} (V)", speed_mean),
    Metric("speed_max", "m/s", "neither", "max |v|", f"{_FRANCIS} (V)",
           lambda trajectory: float(lengths(trajectory.velocity).max())),
    Metric("acceleration_mean", "m/s²", "less", "mean |Δv / Δt|, of vectors in the world frame", f"{_FRANCIS} (A)",
           lambda trajectory: _mean(_acceleration(trajectory))),
    Metric("acceleration_max", "m/s²", "less", "max |Δv / Δt|", f"{_FRANCIS} (A)",
           lambda trajectory: _max(_acceleration(trajectory))),
    Metric("jerk_mean", "m/s³", "less", "mean |Δ(Δv / Δt) / Δt|, of vectors in the world frame", f"{_FRANCIS} (J)",
           lambda trajectory: _mean(_jerk(trajectory)), headline=True),
    Metric("jerk_max", "m/s³", "less", "max |Δ(Δv / Δt) / Δt|", f"{_FRANCIS} (J)",
           lambda trajectory: _max(_jerk(trajectory))),
)  # fmt: skip
