"""A metric: the mean speed of the robot."""

from __future__ import annotations

from sonata2d.metrics import Trajectory, metric


@metric("m/s", "neither", needs={"robot"})
def mean_speed(trajectory: Trajectory) -> float | None:
    """Σ |p(k+1) − p(k)| / (t_end − t_0); not defined for an episode of a single state.

    Source: this package.
    """
    steps = trajectory.position[1:] - trajectory.position[:-1]
    duration = float(trajectory.time[-1] - trajectory.time[0])
    return float(((steps**2).sum(axis=1) ** 0.5).sum()) / duration if duration > 0.0 else None
