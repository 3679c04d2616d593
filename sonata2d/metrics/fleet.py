"""Metrics of scenes with several robots; not defined for one."""

from __future__ import annotations

from .definition import metric
from .trajectory import Trajectory


@metric("count", "less", needs={"robot", "robot.radius"})
def robot_collisions(trajectory: Trajectory) -> float | None:
    """Number of collisions with other robots; one between two robots counts for each of them."""
    if not trajectory.scene.robots:
        return None
    return float(sum(collision.kind == "robot" for collision in trajectory.collisions))


@metric("m", "more", needs={"robot", "robot.radius"})
def robot_clearance_min(trajectory: Trajectory) -> float | None:
    """Smallest distance between the outlines of the robot and another robot."""
    if not trajectory.scene.robots:
        return None
    return float(max(trajectory.robot_clearance.min(), 0.0))


@metric("s", "less", needs={"robot"})
def makespan(trajectory: Trajectory) -> float | None:
    """Time at which the last of all robots reaches its goal; not defined unless all do."""
    arrivals = [tick for tick in trajectory.record.outcome.arrivals if tick is not None]
    if not arrivals or len(arrivals) < len(trajectory.scene.robot_ids):
        return None
    return max(arrivals) * trajectory.scene.rules.dt


METRICS = (robot_collisions, robot_clearance_min, makespan)
