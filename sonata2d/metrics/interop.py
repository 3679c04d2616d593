"""Metrics of the same names as other projects define them, to compare with numbers that these projects publish.

The definitions were read in the sources of SocNavGym (`socnavenv_v1.py`), HuNavSim (`hunav_metrics.py`) and SocNav3
(`metrics.py` of its baseline). Where code and documentation of a project differ, the variant follows the code.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from functools import partial

import numpy as np

from ..core.geometry import disc_contact_times
from ..core.portable_math import Array
from ..core.vectors import lengths, wrap_angles
from .definition import BODIES, GOAL, Better, Function, Metric, Need, metric
from .paths import path_length_of
from .space import ZONES, zone_fraction
from .trajectory import Trajectory

_SOCNAV3_HUMAN_RADIUS = 0.3  # m, the same for every human
_SOCNAV3_IMMINENT = 0.01  # s, time to collision up to which fear is 10
_HUNAV_CONTACT_DISTANCE = 0.02  # m
_HUNAV_STILL_SPEED, _HUNAV_STILL_TURN = 0.01, 0.02  # m/s, rad/s
_HUNAV_GOAL_TOLERANCE = 0.05  # m, added to the goal's radius
_HUNAV_GROUP_AHEAD = 1.5  # m, ahead of each member, where the centre of the group is assumed

_MOTION: tuple[Need, ...] = ("robot",)
_ROBOT: tuple[Need, ...] = (*_MOTION, "robot.radius")
_HUNAV, _SOCNAV3 = "HuNavSim, hunav_metrics.py", "SocNav3, metrics.py"


def _variant(
    name: str, of: str, unit: str, better: Better, needs: Collection[Need] = _MOTION
) -> Callable[[Function], Metric]:
    """The decorator `metric` for the variant of a metric."""
    return metric(unit, better, needs=needs, name=name, variant_of=of)


@_variant("socnavgym.personal_space_compliance", "personal_space_compliance_0.45", "share", "more", _ROBOT)
def socnavgym_compliance(trajectory: Trajectory) -> float | None:
    """Fraction of states with min |p − q| − r_robot ≥ 0.45 m; the person's radius is not subtracted.

    Source: SocNavGym, info.
    """
    if not trajectory.has_humans:
        return None
    return float((trajectory.distance.min(axis=1, initial=np.inf) - trajectory.radius >= 0.45).mean())


@_variant("socnavgym.minimum_distance_to_human", "human_clearance_min", "m", "more")
def socnavgym_distance(trajectory: Trajectory) -> float | None:
    """Min |p − q|, between centres.

    Source: SocNavGym, info.
    """
    return float(trajectory.distance.min()) if trajectory.has_humans else None


@_variant("socnavgym.minimum_obstacle_distance", "obstacle_clearance_min", "m", "more", ("robot", "walls", "objects"))
def socnavgym_obstacle(trajectory: Trajectory) -> float | None:
    """Smallest distance from the robot's centre to the outline of a wall or object.

    Source: SocNavGym, info.
    """
    clearance = trajectory.barrier_clearance
    return float(clearance.min()) + trajectory.radius if len(clearance) else None


@_variant("socnavgym.stalled_time", "stalled_time", "s", "less")
def socnavgym_stalled(trajectory: Trajectory) -> float:
    """Σ Δt over ticks with executed vx = vy = 0 exactly; the robot may turn.

    Source: SocNavGym, info.
    """
    return float(trajectory.durations[(_executed_velocity(trajectory) == 0.0).all(axis=1)].sum())


@_variant("socnavgym.failure_to_progress", "stalled_time", "count", "less", ("robot", "goal"))
def socnavgym_no_progress(trajectory: Trajectory) -> float | None:
    """Number of states with |p − g| greater than in the state before. Not defined for a goal that moves.

    Source: SocNavGym, info.
    """
    if trajectory.scene.goal.moves:
        return None
    return float((np.diff(lengths(trajectory.position - trajectory.scene.goal.position)) > 0.0).sum())


@_variant("socnavgym.jerk_avg", "jerk_mean", "m/s³", "less")
def socnavgym_jerk(trajectory: Trajectory) -> float | None:
    """Mean |Δ²u| / Δt² of the executed u = (vx, vy) in the body frame, so that turning at constant speed adds none.

    u and Δu are zero before the start.

    Source: SocNavGym, info.
    """
    if not len(trajectory.durations):
        return None
    durations, before = trajectory.durations[:, None], np.zeros((1, 2))
    acceleration = np.diff(_executed_velocity(trajectory), axis=0, prepend=before) / durations
    jerk = np.diff(acceleration, axis=0, prepend=before) / durations
    return float(lengths(jerk).mean())


@_variant("hunavsim.goal_reached", "success", "0/1", "more", GOAL)
def hunav_goal(trajectory: Trajectory) -> float | None:
    """1 if |p − g| − goal.distance < 0.05 m in the last state, with any heading. Not defined for a goal that moves.

    Source: HuNavSim, hunav_metrics.py.
    """
    if trajectory.scene.goal.moves:
        return None
    distance = float(lengths(trajectory.position[-1] - trajectory.scene.goal.position))
    return float(distance - trajectory.scene.goal.distance < _HUNAV_GOAL_TOLERANCE)


@_variant("hunavsim.robot_on_person_collision", "robot_on_person", "count", "less", (*BODIES, "headings"))
def hunav_robot_on_person(trajectory: Trajectory) -> float:
    """Number of (state, person) pairs with d < 0.02 m and |α| < |α'|, and unequal speeds.

    α = bearing of the robot from the person, α' = π/2 − bearing of the person from the robot (atan2 is called with x
    first). Pairs of equal angles and equal speeds count too. One long contact counts many times.

    Source: HuNavSim, hunav_metrics.py.
    """
    return _hunav_collisions(trajectory, sign=1)


@_variant("hunavsim.person_on_robot_collision", "person_on_robot", "count", "neither", (*BODIES, "headings"))
def hunav_person_on_robot(trajectory: Trajectory) -> float:
    """As robot_on_person_collision, with |α| > |α'|.

    Source: HuNavSim, hunav_metrics.py.
    """
    return _hunav_collisions(trajectory, sign=-1)


@_variant("hunavsim.time_not_moving", "stalled_time", "s", "less")
def hunav_stalled(trajectory: Trajectory) -> float:
    """T / L · number of states with |v| < 0.01 m/s and ω < 0.02 rad/s.

    ω keeps its sign, so that every right turn counts: a bracket is misplaced in the source.

    Source: HuNavSim, hunav_metrics.py.
    """
    still = (lengths(trajectory.velocity) < _HUNAV_STILL_SPEED) & (trajectory.omega < _HUNAV_STILL_TURN)
    return float(still.sum()) * trajectory.total_time / len(trajectory)


@_variant("hunavsim.avg_overacceleration", "jerk_mean", "m/s³", "less")
def hunav_overacceleration(trajectory: Trajectory) -> float | None:
    """Σ Δ|v| / Δt² / L, signed: a change of speed over Δt², not a change of acceleration.

    Source: HuNavSim, hunav_metrics.py.
    """
    durations = trajectory.durations
    if not len(durations):
        return None
    return float((np.diff(lengths(trajectory.velocity)) / durations / durations).sum()) / len(trajectory)


@_variant("socnav3.hum_collision_flag", "human_collisions", "share", "less", _ROBOT)
def socnav3_contact(trajectory: Trajectory) -> float | None:
    """Fraction of states with |p − q| ≤ r_robot + 0.3 m for any person.

    Source: SocNav3, metrics.py.
    """
    return float((_socnav3_clearance(trajectory) <= 0.0).mean()) if trajectory.has_humans else None


@_variant("socnav3.min_time_to_collision", "time_to_collision_min", "s", "more", _ROBOT)
def socnav3_time_to_collision(trajectory: Trajectory) -> float | None:
    """As time_to_collision_min with R = √2 r_robot + 0.3 m and velocities from differences of positions.

    Source: SocNav3, metrics.py.
    """
    smallest = _socnav3_min_time(trajectory)
    return smallest if np.isfinite(smallest) else None


@_variant("socnav3.max_fear", "time_to_collision_min", "1/s", "less", _ROBOT)
def socnav3_fear(trajectory: Trajectory) -> float | None:
    """Max of 1 / (time to collision as in socnav3.min_time_to_collision).

    10 where it is ≤ 0.01 s, 0 where it is not defined.

    Source: SocNav3, metrics.py.
    """
    if not trajectory.has_humans:
        return None
    smallest = _socnav3_min_time(trajectory)
    return 1.0 / smallest if smallest > _SOCNAV3_IMMINENT else 10.0


@_variant("socnav3.path_efficiency_ratio", "spl", "share", "more", ("robot", "goal"))
def socnav3_path_efficiency(trajectory: Trajectory) -> float | None:
    """min(1, |p(0) − g| / PL), with the straight-line distance, whether or not the goal is reached.

    Not defined for a goal that moves.

    Source: SocNav3, metrics.py.
    """
    if trajectory.scene.goal.moves:
        return None
    straight = float(lengths(trajectory.position[0] - trajectory.scene.goal.position))
    actual = path_length_of(trajectory)
    return min(1.0, straight / actual) if actual > 0.0 else 1.0


def _hunav_zone(trajectory: Trajectory, low: float, high: float) -> float | None:
    """Percentage of the states with the nearest human's clearance in [low, high) m."""
    fraction = zone_fraction(trajectory, low, high)
    return None if fraction is None else 100.0 * fraction


def _hunav_group_zone(trajectory: Trajectory, low: float, high: float) -> float | None:
    """Percentage of the states with the nearest group's centre in [low, high) m from the robot's outline.

    The centre is the mean of the points 1.5 m ahead of each member.
    """
    column = trajectory.human_column
    groups = [[column[m] for m in group.members] for group in trajectory.scene.groups]
    if not groups:
        return None
    ahead = trajectory.human_position + _HUNAV_GROUP_AHEAD * trajectory.human_direction
    centres = [ahead[:, members].mean(axis=1) for members in groups]
    distance = np.stack([lengths(centre - trajectory.position) for centre in centres]).min(axis=0)
    inside = (distance - trajectory.radius >= low) & (distance - trajectory.radius < high)
    return 100.0 * float(inside.mean())


def _socnav3_intrusion(trajectory: Trajectory, threshold: float) -> float | None:
    """Fraction of the states with a human of radius 0.3 m nearer than the threshold, m."""
    return float((_socnav3_clearance(trajectory) < threshold).mean()) if trajectory.has_humans else None


def _hunav_collisions(trajectory: Trajectory, sign: int) -> float:
    """Number of pairs with |α| below |α'|, as `hunav_robot_on_person` defines them; with sign -1, above it."""
    index, k = np.nonzero(trajectory.human_clearance < _HUNAV_CONTACT_DISTANCE)
    offset = trajectory.offset[index, k]
    alpha = np.abs(_bearing(-offset, trajectory.human_heading[index, k]))
    alpha_prime = np.abs(wrap_angles(np.pi / 2.0 - _bearing(offset, trajectory.heading[index])))
    robot_speed, speed = lengths(trajectory.velocity[index]), lengths(trajectory.human_velocity[index, k])
    attributed = sign * alpha < sign * alpha_prime
    both = (alpha == alpha_prime) & (robot_speed == speed)
    return float(((attributed & (robot_speed != speed)) | both).sum())


def _bearing(offset: Array, heading: Array) -> Array:
    """(K,), rad, counter-clockwise angle from headings (K,) to the directions of offsets (K, 2)."""
    return wrap_angles(np.arctan2(offset[:, 1], offset[:, 0]) - heading)


def _executed_velocity(trajectory: Trajectory) -> Array:
    """(L - 1, 2), m/s, body frame: vx and vy executed in each tick."""
    return trajectory.record.executed[: len(trajectory) - 1, :2]


def _socnav3_clearance(trajectory: Trajectory) -> Array:
    """(L,), m, to the nearest human of radius 0.3 m; 0 where they overlap."""
    clearance: Array = np.maximum(trajectory.distance - trajectory.radius - _SOCNAV3_HUMAN_RADIUS, 0.0).min(axis=1)
    return clearance


def _socnav3_min_time(trajectory: Trajectory) -> float:
    """Smallest time to collision, s, with velocities from differences of positions, zero in the first state."""
    velocity, human_velocity = np.zeros_like(trajectory.position), np.zeros_like(trajectory.human_position)
    velocity[1:] = np.diff(trajectory.position, axis=0) / trajectory.durations[:, None]
    human_velocity[1:] = np.diff(trajectory.human_position, axis=0) / trajectory.durations[:, None, None]
    radii = np.sqrt(2.0) * trajectory.radius + _SOCNAV3_HUMAN_RADIUS
    times = disc_contact_times(trajectory.offset, velocity[:, None, :] - human_velocity, radii)
    return float(times.min(initial=np.inf))


_HUNAV_ZONES = tuple(
    Metric(
        f"hunavsim.{name}_space_intrusions", "%", "less",
        f"Percentage of states with {low:g} m ≤ min d < {high:g} m",
        _HUNAV, partial(_hunav_zone, low=low, high=high), variant_of=f"zone_{name}", needs=BODIES,
    )
    for name, (low, high) in ZONES.items() if name != "public"
)  # fmt: skip
_HUNAV_GROUP_ZONES = tuple(
    Metric(
        f"hunavsim.group_{name}_space_intrusions", "%", "less",
        f"Percentage of states with {'' if name == 'intimate' else f'{low:g} m ≤ '}|p − c| − r_robot < {high:g} m for"
        " the nearest group, c = mean of the points 1.5 m ahead of each member",
        _HUNAV, partial(_hunav_group_zone, low=-np.inf if name == "intimate" else low, high=high),
        variant_of="group_intrusion", needs={*_ROBOT, "headings", "humans.group"},
    )
    for name, (low, high) in ZONES.items() if name != "public"
)  # fmt: skip
_SOCNAV3_INTRUSIONS = tuple(
    Metric(
        f"socnav3.social_space_intrusion{letter}", "share", "less",
        f"Fraction of states with min max(0, |p − q| − r_robot − 0.3 m) < {threshold:g} m",
        _SOCNAV3, partial(_socnav3_intrusion, threshold=threshold),
        variant_of=f"personal_space_compliance_{ours:.2f}", needs=_ROBOT,
    )
    for letter, threshold, ours in (("A", 0.4, 0.45), ("B", 0.6, 0.5), ("C", 0.8, 0.8))
)  # fmt: skip
VARIANTS = (
    socnavgym_compliance, socnavgym_distance, socnavgym_obstacle, socnavgym_stalled, socnavgym_no_progress,
    socnavgym_jerk, hunav_goal, hunav_robot_on_person, hunav_person_on_robot, hunav_stalled, *_HUNAV_ZONES,
    *_HUNAV_GROUP_ZONES, hunav_overacceleration, *_SOCNAV3_INTRUSIONS, socnav3_contact, socnav3_time_to_collision,
    socnav3_fear, socnav3_path_efficiency,
)  # fmt: skip
