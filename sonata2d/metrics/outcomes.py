"""Metrics of the outcome: goal reached or not, collisions, time."""

from __future__ import annotations

from functools import partial

import numpy as np

from ..core.vectors import lengths, wrap_angles
from .definition import OURS, Metric
from .trajectory import Kind, Trajectory

STILL_SPEED, STILL_TURN = 0.01, 0.02  # m/s, rad/s: the robot stands still below both (HuNavSim's thresholds)

_FRANCIS = "Francis et al., arXiv 2306.16740, table of metrics"


def success(trajectory: Trajectory) -> float:
    """1 if the goal was reached in time, with or without collisions."""
    return float(trajectory.goal_index is not None)


def collisions(trajectory: Trajectory, kind: Kind | None = None) -> float:
    """Number of collisions with outlines of a kind, or with all."""
    return float(sum(kind in (None, collision.kind) for collision in trajectory.collisions))


def faulty_collisions(trajectory: Trajectory, *, robot: bool, other: bool) -> float:
    """Number of collisions with humans in which the given parties closed the gap (a party not given may have, too)."""
    return float(
        sum(
            c.kind == "human" and c.robot_at_fault >= robot and c.other_at_fault >= other for c in trajectory.collisions
        )
    )


def time_to_first_collision(trajectory: Trajectory) -> float | None:
    """Time from the start to the first collision, s; None without collisions."""
    found = trajectory.collisions
    return float(trajectory.time[found[0].first] - trajectory.time[0]) if found else None


def stalled_time(trajectory: Trajectory) -> float:
    """Total duration of the ticks in which the robot neither moved nor turned, s."""
    steps, durations = lengths(trajectory.position[1:] - trajectory.position[:-1]), trajectory.durations
    turns = np.abs(wrap_angles(np.diff(trajectory.heading)))
    return float(durations[(steps < STILL_SPEED * durations) & (turns < STILL_TURN * durations)].sum())


METRICS = (
    Metric(
        "success", "0/1", "more",
        "1 if |p − g| ≤ goal.distance and |wrap(θ − θ_g)| ≤ goal.angle in a state before the time limit, else 0",
        f"{_FRANCIS} (S)", success, headline=True,
    ),
    Metric(
        "success_strict", "0/1", "more", "1 if success is 1 and there is no collision before the goal, else 0",
        f"{_FRANCIS} (S), with collisions as failures",
        lambda trajectory: success(trajectory) if not trajectory.collisions else 0.0, headline=True,
    ),
    Metric(
        "timeout", "0/1", "less", "1 if the time limit is reached before the goal, else 0", f"{_FRANCIS} (TO)",
        lambda trajectory: float(trajectory.goal_index is None and trajectory.record.outcome.status == "timeout"),
    ),
    Metric(
        "collisions", "count", "less",
        "number of collisions; one collision is a series of consecutive states in which the clearance to one outline is"
        " below contact_distance (0.01 m)",
        f"{_FRANCIS} (C)", collisions,
    ),
    Metric(
        "human_collisions", "count", "less", "number of collisions with people", f"{_FRANCIS} (HC)",
        partial(collisions, kind="human"), headline=True,
    ),
    Metric(
        "object_collisions", "count", "less", "number of collisions with furniture", "SocNavGym, COLLISION_OBJECT",
        partial(collisions, kind="object"), headline=True,
    ),
    Metric(
        "wall_collisions", "count", "less", "number of collisions with walls, counted for each wall separately",
        f"{_FRANCIS} (WC)", partial(collisions, kind="wall"), headline=True,
    ),
    Metric(
        "robot_on_person", "count", "less",
        "number of collisions with people in which the robot's own velocity, as commanded, closed the gap"
        " (> 0.01 m/s); includes those in which both velocities did",
        "the question is SEAN 2.0's (Tsoi et al., IEEE RA-L 7 (2022) 11047), the velocity test is sonata2d's",
        partial(faulty_collisions, robot=True, other=False), headline=True,
    ),
    Metric(
        "person_on_robot", "count", "neither",
        "number of collisions with people in which the person's velocity closed the gap; includes those in which both"
        " velocities did",
        "as robot_on_person", partial(faulty_collisions, robot=False, other=True),
    ),
    Metric(
        "both_on_each_other", "count", "less",
        "number of collisions counted in both robot_on_person and person_on_robot", "as robot_on_person",
        partial(faulty_collisions, robot=True, other=True),
    ),
    Metric(
        "time_to_first_collision", "s", "more",
        "time of the first state of the first collision; not defined without collisions", OURS, time_to_first_collision,
    ),
    Metric(
        "time_to_goal", "s", "less", "T = time at which the goal is reached; not defined if it is not reached",
        f"{_FRANCIS} (T)",
        lambda trajectory: None if trajectory.goal_index is None else trajectory.total_time, headline=True,
    ),
    Metric(
        "stalled_time", "s", "less",
        "Σ Δt over ticks with |Δp| < 0.01 m/s · Δt and |wrap(Δθ)| < 0.02 rad/s · Δt",
        f"{_FRANCIS} (ST); thresholds of HuNavSim", stalled_time, headline=True,
    ),
)  # fmt: skip
