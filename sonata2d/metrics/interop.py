"""The same names as other programs mean them, for comparison with numbers that were made there.

Facts about SocNavGym (`socnavenv_v1.py`), HuNavSim (`hunav_metrics.py`) and SocNav3 (its baseline's `metrics.py`) were
read in their sources; where their code differs from their documentation, the code counts.
"""

from __future__ import annotations

from functools import partial
from typing import Literal

import numpy as np

from ..core.portable_math import Array
from ..core.vectors import wrap_angles
from .definition import Better, Function, Metric
from .interactions import times_to_collision
from .paths import path_length
from .space import ZONES
from .trajectory import Trajectory, distances

SOCNAV3_PERSON = 0.3  # m, everybody's radius there
HUNAV_TOUCH = 0.02  # m
HUNAV_STILL_SPEED, HUNAV_STILL_TURN = 0.01, 0.02  # m/s, rad/s
HUNAV_GOAL_SLACK = 0.05  # m beyond the goal's radius
HUNAV_GROUP_AHEAD = 1.5  # m ahead of each member, where the middle of the group is taken to be
SOCNAV3_SOON = 0.01  # s, below which fear is 10


def socnavgym_compliance(run: Trajectory) -> float | None:
    """Share of looks with the robot's outline 0.45 m or more from every person's centre."""
    if not run.has_people:
        return None
    return float((run.distance.min(axis=1, initial=np.inf) - run.radius >= 0.45).mean())


def socnavgym_distance(run: Trajectory) -> float | None:
    """m, least distance between centres."""
    return float(run.distance.min()) if run.has_people else None


def socnavgym_no_progress(run: Trajectory) -> float:
    """Looks at which the goal is further, as the crow flies, than at the look before."""
    return float((np.diff(distances(run.position, run.scene.goal.position)) > 0.0).sum())


def socnavgym_stalled(run: Trajectory) -> float:
    """s, of the ticks with a command of exactly no advance and no lateral speed; turning counts as stalled."""
    return float(run.lasted[(_executed(run)[:, :2] == 0.0).all(axis=1)].sum())


def socnavgym_jerk(run: Trajectory) -> float | None:
    """m/s³, mean size of the second difference of the commanded (vx, vy), body frame, which was zero before."""
    if not len(run.lasted):
        return None
    step = run.lasted[:, None]
    acceleration = np.diff(_executed(run)[:, :2], axis=0, prepend=np.zeros((1, 2))) / step
    jerk = np.diff(acceleration, axis=0, prepend=np.zeros((1, 2))) / step
    return float(distances(jerk, (0.0, 0.0)).mean())


def socnavgym_obstacle(run: Trajectory) -> float | None:
    """m, from the robot's centre to the nearest outline of a wall or thing."""
    return float(run.barrier_gaps.min()) + run.radius if len(run.barrier_gaps) else None


def hunav_goal(run: Trajectory) -> float:
    """1 if the last look is less than 5 cm beyond the goal's radius, whatever the heading."""
    away = float(distances(run.position[-1], run.scene.goal.position))
    return float(away - run.scene.goal.distance < HUNAV_GOAL_SLACK)


def hunav_stalled(run: Trajectory) -> float:
    """s, looks with |v| < 0.01 and ω < 0.02 (a turn to the right counts as standing) times T / L."""
    omega = run.record.looks.robot[: len(run), 5]
    still = (distances(run.velocity, (0.0, 0.0)) < HUNAV_STILL_SPEED) & (omega < HUNAV_STILL_TURN)
    return float(still.sum()) * float(run.time[-1] - run.time[0]) / len(run)


def hunav_hits(run: Trajectory, by: Literal["robot", "person"]) -> float:
    """Looks times people nearer than 0.02 m, given to whoever has the other more straight ahead.

    α is the robot's bearing from the person; of the person's bearing from the robot the two arguments of atan2 are
    exchanged, so that α' is π/2 less it. Equal angles count for both where speeds are equal too.
    """
    look, k = np.nonzero(run.gaps < HUNAV_TOUCH)
    person, offset = run.people[look, k], run.offset[look, k]
    alpha = np.abs(_bearing(-offset, person[:, 2]))
    other = np.abs(wrap_angles(np.pi / 2.0 - _bearing(offset, run.heading[look])))
    own_speed, speed = distances(run.velocity[look], (0.0, 0.0)), distances(person[:, 3:5], (0.0, 0.0))
    first = alpha < other if by == "robot" else alpha > other
    return float(((first & (own_speed != speed)) | ((alpha == other) & (own_speed == speed))).sum())


def hunav_group_zone(run: Trajectory, low: float, high: float) -> float | None:
    """% of looks at which the nearest group's middle, 1.5 m ahead of its members, is in a zone from the robot's rim."""
    column = {human.id: k for k, human in enumerate(run.scene.humans)}
    groups = [[column[m] for m in group.members] for group in run.scene.groups]
    if not groups:
        return None
    theta = run.people[:, :, 2]
    ahead = run.people[:, :, :2] + HUNAV_GROUP_AHEAD * np.stack((np.cos(theta), np.sin(theta)), axis=-1)
    away = np.stack([distances(ahead[:, members].mean(axis=1), run.position) for members in groups]).min(axis=0)
    inside = (away - run.radius >= low) & (away - run.radius < high)
    return 100.0 * float(inside.mean())


def hunav_zone(run: Trajectory, low: float, high: float) -> float | None:
    """% of looks with the nearest person in a zone."""
    if not run.has_people:
        return None
    return 100.0 * float(((run.nearest >= low) & (run.nearest < high)).mean())


def hunav_overacceleration(run: Trajectory) -> float | None:
    """m/s³ by its name: sum of Δ|v| / Δt², signed, over the number of looks."""
    if not len(run.lasted):
        return None
    change = np.diff(distances(run.velocity, (0.0, 0.0)))
    return float((change / run.lasted / run.lasted).sum()) / len(run)


def socnav3_intrusion(run: Trajectory, threshold: float) -> float | None:
    """Share of looks with somebody, of radius 0.3 m, nearer than the threshold."""
    return float((_socnav3_gaps(run).min(axis=1) < threshold).mean()) if run.has_people else None


def socnav3_contact(run: Trajectory) -> float | None:
    """Share of looks with somebody, of radius 0.3 m, touched."""
    return float((_socnav3_gaps(run).min(axis=1) <= 0.0).mean()) if run.has_people else None


def socnav3_time_to_collision(run: Trajectory) -> float | None:
    """s, the least; robot's radius √2 too large, person's 0.3 m, velocities from differences of places."""
    least = _socnav3_times(run).min(initial=np.inf)
    return float(least) if np.isfinite(least) else None


def socnav3_fear(run: Trajectory) -> float | None:
    """1/s, largest of 1 / time to collision, 10 from 0.01 s down, 0 where there is none."""
    if not run.has_people:
        return None
    least = float(_socnav3_times(run).min(initial=np.inf))
    return 1.0 / least if least > SOCNAV3_SOON else 10.0


def socnav3_path_efficiency(run: Trajectory) -> float:
    """Distance to the goal's centre at the start, as the crow flies, over the way gone, at most 1."""
    straight, gone = float(distances(run.position[0], run.scene.goal.position)), path_length(run)
    return min(1.0, straight / gone) if gone > 0.0 else 1.0


def _executed(run: Trajectory) -> Array:
    """(L - 1, 3), what the drive carried out in each tick."""
    return run.record.executed[: len(run) - 1]


def _bearing(offset: Array, heading: Array) -> Array:
    """Angle at which something lies, left of ahead, rad."""
    return wrap_angles(np.arctan2(offset[:, 1], offset[:, 0]) - heading)


def _socnav3_gaps(run: Trajectory) -> Array:
    """(L, N), m."""
    gaps: Array = np.maximum(run.distance - run.radius - SOCNAV3_PERSON, 0.0)
    return gaps


def _socnav3_times(run: Trajectory) -> Array:
    """(L, N), s; at the first look nobody moves."""
    own, others = np.zeros_like(run.position), np.zeros_like(run.people[:, :, :2])
    own[1:] = np.diff(run.position, axis=0) / run.lasted[:, None]
    others[1:] = np.diff(run.people[:, :, :2], axis=0) / run.lasted[:, None, None]
    return times_to_collision(run.offset, own[:, None, :] - others, np.sqrt(2.0) * run.radius + SOCNAV3_PERSON)


def _variant(
    name: str, of: str, unit: str, better: Better, formula: str, function: Function, source: str | None = None
) -> Metric:
    where = {"socnavgym": "SocNavGym, info", "hunavsim": "HuNavSim, hunav_metrics.py", "socnav3": "SocNav3, metrics.py"}
    return Metric(name, unit, better, formula, source or where[name.split(".")[0]], function, variant_of=of)


VARIANTS = (
    _variant("socnavgym.personal_space_compliance", "personal_space_compliance_0.45", "share", "more",
             "share of looks with min |p − q| − r_robot ≥ 0.45 m: the person's radius is not taken off",
             socnavgym_compliance),
    _variant("socnavgym.minimum_distance_to_human", "human_clearance_min", "m", "more", "min |p − q|, between centres",
             socnavgym_distance),
    _variant("socnavgym.minimum_obstacle_distance", "obstacle_clearance_min", "m", "more",
             "least distance from the robot's centre to the outline of a wall or thing", socnavgym_obstacle),
    _variant("socnavgym.stalled_time", "stalled_time", "s", "less",
             "Σ Δt over ticks with executed vx = vy = 0 exactly, turning or not", socnavgym_stalled),
    _variant("socnavgym.failure_to_progress", "stalled_time", "count", "less",
             "looks with |p − g| greater than at the look before", socnavgym_no_progress),
    _variant("socnavgym.jerk_avg", "jerk_mean", "m/s³", "less",
             "mean |Δ²u| / Δt² of the executed u = (vx, vy) in the body frame, so that turning at constant speed has"
             " none; u and Δu are zero before the start", socnavgym_jerk),
    _variant("hunavsim.goal_reached", "success", "0/1", "more",
             "1 if |p − g| − goal.distance < 0.05 m at the last look, whatever the heading", hunav_goal),
    _variant("hunavsim.robot_on_person_collision", "robot_on_person", "count", "less",
             "looks × people with d < 0.02 m and |α| < |α'|, where α = bearing of the robot from the person, α' = π/2 −"
             " bearing of the person from the robot (their atan2 takes x first), speeds unequal; or both equal: one"
             " long contact counts many times", partial(hunav_hits, by="robot")),
    _variant("hunavsim.person_on_robot_collision", "person_on_robot", "count", "neither",
             "the same with |α| > |α'|", partial(hunav_hits, by="person")),
    _variant("hunavsim.time_not_moving", "stalled_time", "s", "less",
             "T / L · looks with |v| < 0.01 m/s and ω < 0.02 rad/s (ω has its sign: a bracket is misplaced there)",
             hunav_stalled),
    *(_variant(f"hunavsim.{name}_space_intrusions", f"zone_{name}", "%", "less",
               f"% of looks with {low:g} m ≤ min d < {high:g} m", partial(hunav_zone, low=low, high=high))
      for name, (low, high) in ZONES.items() if name != "public"),
    *(_variant(f"hunavsim.group_{name}_space_intrusions", "group_intrusion", "%", "less",
               f"% of looks with {'' if name == 'intimate' else f'{low:g} m ≤ '}|p − c| − r_robot < {high:g} m for the"
               " nearest group, c = mean of members' places 1.5 m ahead of each",
               partial(hunav_group_zone, low=-np.inf if name == "intimate" else low, high=high))
      for name, (low, high) in ZONES.items() if name != "public"),
    _variant("hunavsim.avg_overacceleration", "jerk_mean", "m/s³", "less",
             "Σ Δ|v| / Δt² / L, with its sign: a change of speed over Δt², not a change of acceleration",
             hunav_overacceleration),
    *(_variant(f"socnav3.social_space_intrusion{letter}", f"personal_space_compliance_{ours:.2f}", "share", "less",
               f"share of looks with min max(0, |p − q| − r_robot − 0.3 m) < {threshold:g} m",
               partial(socnav3_intrusion, threshold=threshold))
      for letter, threshold, ours in (("A", 0.4, 0.45), ("B", 0.6, 0.5), ("C", 0.8, 0.8))),
    _variant("socnav3.hum_collision_flag", "human_collisions", "share", "less",
             "share of looks with |p − q| ≤ r_robot + 0.3 m for somebody", socnav3_contact),
    _variant("socnav3.min_time_to_collision", "time_to_collision_min", "s", "more",
             "as time_to_collision_min with R = √2 r_robot + 0.3 m and velocities from differences of places",
             socnav3_time_to_collision),
    _variant("socnav3.max_fear", "time_to_collision_min", "1/s", "less",
             "max of 1 / time to collision as socnav3 has it, 10 where that is ≤ 0.01 s, 0 where there is none",
             socnav3_fear),
    _variant("socnav3.path_efficiency_ratio", "spl", "share", "more",
             "min(1, |p(0) − g| / PL), as the crow flies, reached or not", socnav3_path_efficiency),
)  # fmt: skip
