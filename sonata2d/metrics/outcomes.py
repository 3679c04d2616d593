"""Metrics of the outcome: goal reached or not, collisions, time."""

from __future__ import annotations

import numpy as np

from ..core.vectors import lengths, wrap_angles
from .definition import BODIES, GOAL, OBSTACLES, metric
from .trajectory import Kind, Trajectory

_STILL_SPEED, _STILL_TURN = 0.01, 0.02  # m/s, rad/s: the robot stands still below both (HuNavSim's thresholds)

_ALL_OUTLINES = (*BODIES, *OBSTACLES)


@metric("0/1", "more", needs=GOAL, headline=True)
def success(trajectory: Trajectory) -> float:
    """1 if |p − g| ≤ goal.distance and |wrap(θ − θ_g)| ≤ goal.angle in a state until the time limit, else 0.

    Source: Francis et al., arXiv 2306.16740, table of metrics (S).
    """
    return float(trajectory.goal_index is not None)


@metric("0/1", "more", needs={*GOAL, *_ALL_OUTLINES}, headline=True)
def success_strict(trajectory: Trajectory) -> float:
    """1 if success is 1 and there is no collision before the goal, else 0.

    Source: Francis et al., arXiv 2306.16740, table of metrics (S), with collisions as failures.
    """
    return float(trajectory.goal_index is not None and not trajectory.collisions)


@metric("0/1", "less", needs={*GOAL, "outcome"})
def timeout(trajectory: Trajectory) -> float:
    """1 if the time limit ends the run, or passes, before the goal is reached, else 0.

    Source: Francis et al., arXiv 2306.16740, table of metrics (TO).
    """
    is_over = trajectory.record.outcome.status in ("timeout", "goal")  # "goal" of an older file: after the time limit
    return float(trajectory.goal_index is None and is_over)


@metric("count", "less", needs=_ALL_OUTLINES)
def collisions(trajectory: Trajectory) -> float:
    """Number of collisions.

    One collision is a series of consecutive states in which the clearance to one outline is below contact_distance
    (0.01 m).

    Source: Francis et al., arXiv 2306.16740, table of metrics (C).
    """
    return float(len(trajectory.collisions))


@metric("count", "less", needs=BODIES, headline=True)
def human_collisions(trajectory: Trajectory) -> float:
    """Number of collisions with people.

    Source: Francis et al., arXiv 2306.16740, table of metrics (HC).
    """
    return _collisions_with(trajectory, "human")


@metric("count", "less", needs={"robot", "robot.radius", "objects"}, headline=True)
def object_collisions(trajectory: Trajectory) -> float:
    """Number of collisions with furniture.

    Source: SocNavGym, COLLISION_OBJECT.
    """
    return _collisions_with(trajectory, "object")


@metric("count", "less", needs={"robot", "robot.radius", "walls"}, headline=True)
def wall_collisions(trajectory: Trajectory) -> float:
    """Number of collisions with walls and doors.

    They are counted for each straight wall separately, in however many pieces it is drawn.

    Source: Francis et al., arXiv 2306.16740, table of metrics (WC).
    """
    return _collisions_with(trajectory, "wall", "door")


@metric("count", "less", needs=BODIES, headline=True)
def robot_on_person(trajectory: Trajectory) -> float:
    """Number of collisions with people in which the robot's own velocity, as commanded, closed the gap (> 0.01 m/s).

    Includes collisions in which both velocities did.

    Source: the question is SEAN 2.0's (Tsoi et al., IEEE RA-L 7 (2022) 11047), the velocity test is sonata2d's.
    """
    return float(sum(c.kind == "human" and c.robot_at_fault for c in trajectory.collisions))


@metric("count", "neither", needs=BODIES)
def person_on_robot(trajectory: Trajectory) -> float:
    """Number of collisions with people in which the person's velocity closed the gap.

    Includes collisions in which both velocities did.

    Source: as robot_on_person.
    """
    return float(sum(c.kind == "human" and c.other_at_fault for c in trajectory.collisions))


@metric("count", "less", needs=BODIES)
def both_on_each_other(trajectory: Trajectory) -> float:
    """Number of collisions counted in both robot_on_person and person_on_robot.

    Source: as robot_on_person.
    """
    return float(sum(c.kind == "human" and c.robot_at_fault and c.other_at_fault for c in trajectory.collisions))


@metric("s", "more", needs=_ALL_OUTLINES)
def time_to_first_collision(trajectory: Trajectory) -> float | None:
    """Time of the first state of the first collision; not defined without collisions."""
    collisions = trajectory.collisions
    return float(trajectory.time[collisions[0].first] - trajectory.time[0]) if collisions else None


@metric("s", "less", needs=GOAL, headline=True)
def time_to_goal(trajectory: Trajectory) -> float | None:
    """T = time at which the goal is reached; not defined if it is not reached.

    Source: Francis et al., arXiv 2306.16740, table of metrics (T).
    """
    return None if trajectory.goal_index is None else trajectory.total_time


@metric("share", "more", needs={"robot", "goal"})
def company(trajectory: Trajectory) -> float | None:
    """Share of the states in which the robot is near the person of its task, `Goal.near`; 0 while it is absent.

    Not defined for a task without a person.
    """
    goal = trajectory.scene.goal
    if goal.person is None:
        return None
    k = trajectory.scene.human_table.row[goal.person]
    person = trajectory.record.states.humans[: len(trajectory), k, :2]
    return float((lengths(person - trajectory.position) <= goal.near).mean())


@metric("s", "less", needs={"robot"}, headline=True)
def stalled_time(trajectory: Trajectory) -> float:
    """Σ Δt over ticks with |Δp| < 0.01 m/s · Δt and |wrap(Δθ)| < 0.02 rad/s · Δt.

    Source: Francis et al., arXiv 2306.16740, table of metrics (ST); thresholds of HuNavSim.
    """
    steps, durations = lengths(trajectory.position[1:] - trajectory.position[:-1]), trajectory.durations
    turns = np.abs(wrap_angles(np.diff(trajectory.heading)))
    return float(durations[(steps < _STILL_SPEED * durations) & (turns < _STILL_TURN * durations)].sum())


def _collisions_with(trajectory: Trajectory, *kinds: Kind) -> float:
    """Number of collisions with outlines of some kinds."""
    return float(sum(collision.kind in kinds for collision in trajectory.collisions))


METRICS = (
    success, success_strict, timeout, collisions, human_collisions, object_collisions, wall_collisions,
    robot_on_person, person_on_robot, both_on_each_other, time_to_first_collision, time_to_goal, company,
    stalled_time,
)  # fmt: skip
