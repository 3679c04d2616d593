"""A metric: the mean speed of the robot."""

from __future__ import annotations

from sonata2d.metrics import Metric, Trajectory


def mean_speed(trajectory: Trajectory) -> float | None:
    """Path length over duration, m/s; None for an episode of a single state."""
    steps = trajectory.position[1:] - trajectory.position[:-1]
    duration = float(trajectory.time[-1] - trajectory.time[0])
    return float(((steps**2).sum(axis=1) ** 0.5).sum()) / duration if duration > 0.0 else None


MEAN_SPEED = Metric("mean_speed", "m/s", "neither", "Σ |p(k+1) − p(k)| / (t_end − t_0)", "this package", mean_speed)
