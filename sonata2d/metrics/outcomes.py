"""Did the robot get there, whom did it touch on the way, and how long did it take?"""

from __future__ import annotations

from functools import partial

import numpy as np

from ..core.vectors import wrap_angles
from .definition import OURS, Metric
from .trajectory import Kind, Trajectory, distances

STILL_SPEED, STILL_TURN = 0.01, 0.02  # m/s, rad/s, below which the robot stands (HuNavSim's thresholds)

_FRANCIS = "Francis et al., arXiv 2306.16740, table of metrics"


def success(run: Trajectory) -> float:
    """1 if the goal was reached in time, whatever happened on the way."""
    return float(run.reached is not None)


def success_strict(run: Trajectory) -> float:
    """1 if the goal was reached in time and nothing was touched before."""
    return float(run.reached is not None and not run.touches)


def timeout(run: Trajectory) -> float:
    """1 if time ran out before the goal was reached."""
    return float(run.reached is None and run.record.outcome.status == "timeout")


def collisions(run: Trajectory, kind: Kind | None = None) -> float:
    """Touches with outlines of a kind, or with any."""
    return float(sum(kind in (None, touch.kind) for touch in run.touches))


def robot_on_person(run: Trajectory) -> float:
    """Touches with people in which the robot closed the gap."""
    return float(sum(t.kind == "human" and t.robot_at_fault for t in run.touches))


def person_on_robot(run: Trajectory) -> float:
    """Touches with people in which the person closed the gap."""
    return float(sum(t.kind == "human" and t.other_at_fault for t in run.touches))


def both_on_each_other(run: Trajectory) -> float:
    """Touches with people in which both closed the gap."""
    return float(sum(t.kind == "human" and t.robot_at_fault and t.other_at_fault for t in run.touches))


def time_to_first_collision(run: Trajectory) -> float | None:
    """s, to the first touch; None if there was none."""
    found = run.touches
    return float(run.time[found[0].first] - run.time[0]) if found else None


def time_to_goal(run: Trajectory) -> float | None:
    """s, None where the goal was not reached."""
    return None if run.reached is None else float(run.time[-1] - run.time[0])


def stalled_time(run: Trajectory) -> float:
    """s, of the ticks in which the robot neither went nor turned."""
    went = distances(run.position[1:], run.position[:-1]) < STILL_SPEED * run.lasted
    turned = np.abs(wrap_angles(np.diff(run.heading))) < STILL_TURN * run.lasted
    return float(run.lasted[went & turned].sum())


_TOUCH = "touches, each a run of consecutive looks at which the gap between outlines is below contact_distance (0.01 m)"

METRICS = (
    Metric(
        "success", "0/1", "more",
        "1 if at some look |p − g| ≤ goal.distance and |wrap(θ − θ_g)| ≤ goal.angle, before time is up",
        f"{_FRANCIS} (S)", success, headline=True,
    ),
    Metric(
        "success_strict", "0/1", "more", "success, and nothing was touched until then",
        f"{_FRANCIS} (S), with collisions as failures", success_strict, headline=True,
    ),
    Metric("timeout", "0/1", "less", "1 if time ran out before the goal was reached", f"{_FRANCIS} (TO)", timeout),
    Metric("collisions", "count", "less", f"{_TOUCH}", f"{_FRANCIS} (C)", collisions),
    Metric(
        "human_collisions", "count", "less", "touches with people", f"{_FRANCIS} (HC)",
        partial(collisions, kind="human"), headline=True,
    ),
    Metric(
        "object_collisions", "count", "less", "touches with furniture", "SocNavGym, COLLISION_OBJECT",
        partial(collisions, kind="object"),
    ),
    Metric(
        "wall_collisions", "count", "less", "touches with walls, each wall for itself", f"{_FRANCIS} (WC)",
        partial(collisions, kind="wall"),
    ),
    Metric(
        "robot_on_person", "count", "less",
        "touches with people during which the robot's own velocity, as it was wanted, closed the gap (> 0.01 m/s);"
        " those of both count too",
        "the question is SEAN 2.0's (Tsoi et al., IEEE RA-L 7 (2022) 11047), the test by velocity ours",
        robot_on_person, headline=True,
    ),
    Metric(
        "person_on_robot", "count", "neither",
        "touches with people during which the person's velocity closed the gap; those of both count too",
        "as robot_on_person", person_on_robot,
    ),
    Metric(
        "both_on_each_other", "count", "less", "touches that count as robot_on_person and as person_on_robot",
        "as robot_on_person", both_on_each_other,
    ),
    Metric(
        "time_to_first_collision", "s", "more", "time of the first look of the first touch; not defined without one",
        OURS, time_to_first_collision,
    ),
    Metric(
        "time_to_goal", "s", "less", "T = time of the look at which the goal is reached; not defined on failure",
        f"{_FRANCIS} (T)", time_to_goal, headline=True,
    ),
    Metric(
        "stalled_time", "s", "less",
        "Σ Δt over ticks with |Δp| < 0.01 m/s · Δt and |wrap(Δθ)| < 0.02 rad/s · Δt",
        f"{_FRANCIS} (ST); thresholds of HuNavSim", stalled_time, headline=True,
    ),
)  # fmt: skip
