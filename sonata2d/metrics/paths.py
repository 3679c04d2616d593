"""How far did the robot go, compared with how far it had to; how did it turn, and how smoothly did it move?"""

from __future__ import annotations

import numpy as np

from ..core.portable_math import Array
from ..core.vectors import lengths, wrap_angles
from .definition import Metric
from .outcomes import success
from .trajectory import Trajectory, distances

_FRANCIS = "Francis et al., arXiv 2306.16740, table of metrics"


def path_length(run: Trajectory) -> float:
    """m, gone by the robot's centre."""
    return float(distances(run.position[1:], run.position[:-1]).sum())


def shortest_length(run: Trajectory) -> float | None:
    """m, of the shortest way to the rim of the goal; None where the robot does not fit through."""
    return run.shortest


def spl(run: Trajectory) -> float | None:
    """Success weighted by the share that the shortest way has in the way gone; None where there is no way at all."""
    return _weighted(run, run.shortest, path_length(run))


def stl(run: Trajectory) -> float | None:
    """Success weighted by the share that the shortest time has in the time taken; None where there is no way at all."""
    shortest = None if run.shortest is None else run.shortest / run.scene.robot.limits.ahead
    return _weighted(run, shortest, float(run.time[-1] - run.time[0]))


def cumulative_heading_change(run: Trajectory) -> float:
    """rad, turned in all, either way."""
    return float(np.abs(wrap_angles(np.diff(run.heading))).sum())


def speed_mean(run: Trajectory) -> float | None:
    """m/s, way gone over time taken; None for a run without a tick."""
    took = float(run.time[-1] - run.time[0])
    return path_length(run) / took if took > 0.0 else None


def speed_max(run: Trajectory) -> float:
    """m/s, of the recorded velocities."""
    return float(lengths(run.velocity).max())


def acceleration_mean(run: Trajectory) -> float | None:
    """m/s², mean of the size of the first difference of velocity."""
    return _mean(lengths(_acceleration(run)))


def acceleration_max(run: Trajectory) -> float | None:
    """m/s², the largest."""
    return _max(lengths(_acceleration(run)))


def jerk_mean(run: Trajectory) -> float | None:
    """m/s³, mean of the size of the second difference of velocity."""
    return _mean(lengths(_jerk(run)))


def jerk_max(run: Trajectory) -> float | None:
    """m/s³, the largest."""
    return _max(lengths(_jerk(run)))


def _acceleration(run: Trajectory) -> Array:
    """(L - 1, 2), m/s², between looks."""
    return np.diff(run.velocity, axis=0) / run.lasted[:, None]


def _jerk(run: Trajectory) -> Array:
    """(L - 2, 2), m/s³, at the looks that have one before and one after."""
    between = (run.lasted[1:] + run.lasted[:-1]) / 2.0
    return np.diff(_acceleration(run), axis=0) / between[:, None]


def _weighted(run: Trajectory, shortest: float | None, taken: float) -> float | None:
    if shortest is None:
        return None
    return success(run) * (shortest / max(taken, shortest) if shortest > 0.0 else 1.0)


def _mean(values: Array) -> float | None:
    return float(values.mean()) if len(values) else None


def _max(values: Array) -> float | None:
    return float(values.max()) if len(values) else None


METRICS = (
    Metric(
        "path_length", "m", "less", "PL = Σ |p(t+1) − p(t)|", f"{_FRANCIS} (PL)", path_length, headline=True
    ),
    Metric(
        "shortest_length", "m", "neither",
        "L = length of the shortest way of the robot's outline round walls and furniture, less goal.distance, not below"
        " 0; not defined where there is no way",
        "Anderson et al., arXiv 1807.06757", shortest_length,
    ),
    Metric(
        "spl", "share", "more", "S · L / max(PL, L), with S = success; 1 if the robot starts within the goal",
        "Anderson et al., arXiv 1807.06757", spl, headline=True,
    ),
    Metric(
        "stl", "share", "more", "S · T₀ / max(T, T₀), with T₀ = L / limits.ahead",
        "SocNavGym, STL, with a T₀ that needs no second robot", stl,
    ),
    Metric(
        "cumulative_heading_change", "rad", "less", "Σ |wrap(θ(t+1) − θ(t))|", "HuNavSim, cumulative_heading_changes",
        cumulative_heading_change, headline=True,
    ),
    Metric("speed_mean", "m/s", "neither", "PL / T", f"{_FRANCIS} (V)", speed_mean),
    Metric("speed_max", "m/s", "neither", "max |v|", f"{_FRANCIS} (V)", speed_max),
    Metric("acceleration_mean", "m/s²", "less", "mean |Δv / Δt|, as vectors, world frame", f"{_FRANCIS} (A)",
           acceleration_mean),
    Metric("acceleration_max", "m/s²", "less", "max |Δv / Δt|", f"{_FRANCIS} (A)", acceleration_max),
    Metric("jerk_mean", "m/s³", "less", "mean |Δ(Δv / Δt) / Δt|, as vectors, world frame", f"{_FRANCIS} (J)",
           jerk_mean, headline=True),
    Metric("jerk_max", "m/s³", "less", "max |Δ(Δv / Δt) / Δt|", f"{_FRANCIS} (J)", jerk_max),
)  # fmt: skip
