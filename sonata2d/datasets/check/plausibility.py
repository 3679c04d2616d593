"""Plausibility of a recorded episode: its numbers must be consistent with one another and physically possible.

Ids, references and the lengths of rows are checked when a file is read, see `record.validate`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import chain

import numpy as np

from ...core.portable_math import Array, BoolArray
from ...core.scene import Scene
from ...core.tasks import is_done
from ...core.turning import BODY_TURN
from ...core.vectors import wrap_angle
from ...record.layout import HUMAN_ANGLES, ROBOT_ANGLES
from ...record.motion import THETA, VX, VY, X, Y
from ...record.record import EpisodeRecord
from ...sim.kernel.rules import maximum_speeds, walking_speeds
from .overlaps import overlaps, overlaps_of_robots, overlaps_with_doors
from .rows import first_not_canonical, inside_room

MAXIMUM_OVERLAP = 0.06  # m, of outlines: the physics detects a contact only after the bodies have moved
ROUNDING = 2e-4  # m, m/s, rad/s: tolerance for numbers rounded to 1e-4
_ROBOT_SPEED_TOLERANCE = 0.05  # m/s above the robot's limits
# m/s, on top of half the top speed: tolerance between the displacement of a tick over dt and the mean velocity
_MOTION_TOLERANCE = 0.5
_MOVED_APART = 0.05  # m, by which bodies that overlap are moved apart in a tick, whatever their velocities
_PUSH_RANGE = 0.1  # m, clearance to a recorded pedestrian within which a push in the last tick is possible
_ROBOT_OVERLAP = 1e-3  # m, of the outlines of two robots: poses are rounded
_TURN_TOLERANCE = 0.05  # rad, between the rotation in a tick and the executed turn rate times dt
_SUDDEN_SPEED, _SUDDEN_TURN = 1.0, 1.0  # m/s and rad, changes in a tick beyond which two velocities say little of it

Finding = tuple[str, str]  # place, message


def implausible_values(record: EpisodeRecord) -> Iterator[Finding]:
    """Everything implausible in an episode, as place and message."""
    pushed = _may_be_pushed(record)
    yield from _check_rounding(record, "humans", record.states.humans, HUMAN_ANGLES)
    yield from _check_groups(record.scene())
    yield from _check_time(record)
    yield from _check_people(record, pushed)
    yield from _check_room_of_people(record)
    yield from _check_overlaps(record, pushed)
    yield from _check_presence(record)
    yield from _check_outcome(record)
    yield from _robot_values(record, pushed)
    for robot_id in record.robot_ids[1:]:
        view = record.seen_by(robot_id)
        pushed = _may_be_pushed(view)
        of_robot = (each for each in _check_overlaps(view, pushed) if "the robot" in each[1])
        for place, message in chain(_robot_values(view, pushed), of_robot):
            yield place, message.replace("the robot", f"robot {robot_id}")
    yield from _check_overlaps_of_robots(record)


def _robot_values(record: EpisodeRecord, pushed: BoolArray) -> Iterator[Finding]:
    """Everything implausible of the robot alone."""
    yield from _check_rounding(record, "robot", record.states.robot, ROBOT_ANGLES)
    yield from _check_rounding(record, "command", record.command, [])
    yield from _check_rounding(record, "executed", record.executed, [])
    yield from _check_speed(record)
    yield from _check_motion(record, pushed)
    yield from _check_robot(record)
    yield from _check_room(record)
    yield from _check_arrival(record)


def _check_rounding(record: EpisodeRecord, key: str, rows: Array, angles: list[int]) -> Iterator[Finding]:
    """Numbers must be in the canonical form of files, to the bit."""
    is_angle = np.zeros(rows.shape[-1], dtype=bool)
    is_angle[angles] = True
    number = first_not_canonical(rows.reshape(-1, rows.shape[-1]).copy(), is_angle)
    if number >= 0:
        t = number * len(rows) // (rows.size // rows.shape[-1])
        yield f"frames.{t}.{key}", "a number is not rounded to 0.0001 or is -0.0, or an angle is out of range"


def _check_groups(scene: Scene) -> Iterator[Finding]:
    """Pedestrians must be members of the groups that they name."""
    members = {group.id: group.members for group in scene.groups}
    for human in scene.humans:
        if human.group is not None and human.id not in members.get(human.group, ()):
            yield "humans", f"human {human.id} names group {human.group} but is not a member of it"


def _check_time(record: EpisodeRecord) -> Iterator[Finding]:
    """Time must be tick * dt; in imported episodes, whose steps may be uneven, it must rise."""
    ticks, time, dt = record.states.tick, record.states.time, record.scene().rules.dt
    if record.document["physics"] == 0:
        for t in np.flatnonzero(np.diff(time) <= 0)[:1]:
            yield f"frames.{t + 1}", f"time must rise, is {time[t + 1]} s after {time[t]} s"
        return
    for t in np.flatnonzero(np.abs(time - ticks * dt) > ROUNDING)[:1]:
        yield f"frames.{t}", f"time should be {ticks[t] * dt:.4f} s, is {time[t]} s"


def _check_speed(record: EpisodeRecord) -> Iterator[Finding]:
    """Speed and turn rate must stay within the limits of the robot."""
    scene = record.scene()
    limits, maximum_speed = scene.robot.limits, scene.robot.top_speed + _ROBOT_SPEED_TOLERANCE
    executed = np.hypot(record.executed[:, 0], record.executed[:, 1])
    yield from _worst_tick(executed - maximum_speed, "executed", "the robot's drive", "m/s faster than its limits")
    turning = np.abs(record.executed[:, 2]) - limits.turn - ROUNDING
    yield from _worst_tick(turning, "executed", "the robot's drive", "rad/s of turning beyond its limits")


def _maximum_overlap(scene: Scene) -> float:
    """Depth to which outlines may overlap, m.

    The physics stops pedestrians up to one substep too late: two may approach each other, and turn, so far. Without the
    guard, the robot pushes pedestrians into others and into walls, up to two substeps too late: in the first one they
    still give way. Whoever turns notices at the end of the tick that there is no room.
    """
    rules, shoulder = scene.rules, float(np.abs(scene.human_table.shoulder).max(initial=0.0))
    speed, substep = float(walking_speeds(scene).max(initial=0.0)), rules.dt / rules.substeps
    overlap = max(MAXIMUM_OVERLAP, 2.0 * (speed + BODY_TURN * shoulder) * substep)
    if rules.guard:
        return overlap
    fastest = max(robot.top_speed for robot, _ in scene.tasks)
    return overlap + 2.0 * fastest * substep + min(BODY_TURN * rules.dt, 1.0) * shoulder


def _motion_tolerance(scene: Scene) -> float:
    """Tolerance of `_unexplained_speed`, m/s."""
    dt, overlap = scene.rules.dt, _maximum_overlap(scene)
    tolerance = max(_MOTION_TOLERANCE, _MOVED_APART / dt)
    if overlap > MAXIMUM_OVERLAP:
        tolerance += 2.0 * overlap / dt  # bodies that overlap are also moved apart
    return tolerance


def _check_people(record: EpisodeRecord, pushed: BoolArray) -> Iterator[Finding]:
    """Speeds of pedestrians must be possible, and match the changes of their poses."""
    scene, humans = record.scene(), record.states.humans
    speed = np.hypot(humans[..., VX], humans[..., VY])
    speed[pushed[:, :-1]] = 0.0
    yield from _worst_tick_of_humans(speed - maximum_speeds(scene) - ROUNDING, scene, "m/s faster than possible")
    unexplained = _unexplained_speed(humans, scene.rules.dt)
    unexplained[(pushed[1:] | pushed[:-1])[:, :-1]] = 0.0
    excess = unexplained - maximum_speeds(scene) / 2 - _motion_tolerance(scene)
    yield from _worst_tick_of_humans(excess, scene, "m/s of motion beyond what the velocities explain")


def _check_motion(record: EpisodeRecord, pushed: BoolArray) -> Iterator[Finding]:
    """Velocities of the robot must match the changes of its pose."""
    scene, states = record.scene(), record.states
    dt, limits, tolerance = scene.rules.dt, scene.robot.limits, _motion_tolerance(scene)
    robot = _unexplained_speed(states.robot, dt)
    robot[(pushed[1:] | pushed[:-1])[:, -1]] = 0.0
    limit = math.hypot(max(limits.ahead, limits.back), limits.sideways) / 2 + tolerance
    robot = robot - np.where(_is_sudden(record), max(limit, 2.0 * scene.robot.top_speed), limit)
    yield from _worst_tick(robot, "robot", "the robot", "m/s of motion beyond what the velocities explain")
    turned = (np.diff(states.robot[:, THETA]) - record.executed[:, 2] * dt + np.pi) % (2 * np.pi) - np.pi
    turned = np.abs(turned) - _TURN_TOLERANCE
    yield from _worst_tick(turned, "robot", "the robot", "rad turned beyond what its turn rate explains")


def _is_sudden(record: EpisodeRecord) -> BoolArray:
    """Ticks whose displacement does not follow from the robot's velocities before and after them; (T,).

    The recorded velocities are those of the last substeps. A robot that guard, walls or people stop in one substep, and
    that a strong drive brings to full speed or turns round within a tick, may have moved at any speed of its drive in
    the others. `_check_robot` compares the displacements of all ticks with the executed twists.
    """
    rules, limits = record.scene().rules, record.scene().robot.limits
    if record.document["physics"] == 0:  # imported: no drive
        return np.zeros(len(record), dtype=bool)
    if not rules.guard or limits.acceleration * rules.dt > _SUDDEN_SPEED:
        return np.ones(len(record), dtype=bool)
    sudden = record.guarded | (np.abs(record.executed[:, 2]) * rules.dt > _SUDDEN_TURN)
    sudden[1:] |= record.guarded[:-1]
    return sudden


def _check_robot(record: EpisodeRecord) -> Iterator[Finding]:
    """The robot must move as its drive does, and a unicycle or a differential drive along its heading.

    The drive keeps its twist during a tick, so that a body which turns covers an arc: its displacement has the
    direction of its mean heading, and is the arc times a factor between cos(half the angle) and 1. Where the guard or a
    wall slows it during the tick, the displacement is up to half the angle off the mean heading.
    """
    if record.document["physics"] == 0:  # imported: no simulator moved the robot
        return
    scene, states, executed = record.scene(), record.states, record.executed
    dt, theta = scene.rules.dt, states.robot[:, THETA]
    half = np.minimum(np.abs(executed[:, 2]) * dt / 2, np.pi)
    ahead, left = _along(np.diff(states.robot[:, X : Y + 1], axis=0), theta[:-1] + executed[:, 2] * dt / 2)
    speed = np.hypot(states.robot[:, VX], states.robot[:, VY])
    yield from _worst_tick(speed - scene.robot.top_speed - _ROBOT_SPEED_TOLERANCE, "robot", "the robot", "m/s too fast")
    name, is_steady = f"the robot, a {scene.robot.kinematics},", ~record.guarded & scene.rules.guard
    keeps_heading = scene.robot.kinematics in ("unicycle", "differential")
    # m; while a holonomic robot is slowed down, its path can be longer than its mean velocity says
    arc = np.hypot(executed[:, 0], executed[:, 1]) * dt
    if not keeps_heading:
        arc = np.where(is_steady, arc, scene.robot.top_speed * dt)
    rounding = ROUNDING * (1.0 + arc)  # the second part is for the angle
    difference = np.hypot(ahead - executed[:, 0] * dt, left - executed[:, 1] * dt)
    difference -= arc * np.where(is_steady, 1.0 - np.cos(half), 2.0 * np.sin(half / 2))
    yield from _worst_tick(difference - rounding, "robot", "the robot", "m from where its drive led")
    if keeps_heading:
        sideways = np.abs(left) - np.where(is_steady, 0.0, arc * np.sin(np.minimum(half, np.pi / 2))) - rounding
        yield from _worst_tick(sideways, "robot", name, "m off its heading")
        yield from _worst_tick(np.abs(executed[:, 1]), "executed", name, "m/s fast sideways")
        _, slip = _along(states.robot[:, VX : VY + 1], theta)
        slip = np.abs(slip) - ROUNDING * (1.0 + speed)
        yield from _worst_tick(slip, "robot", name, "m/s fast sideways")


def _along(vectors: Array, theta: Array) -> tuple[Array, Array]:
    """Components of (T, 2) vectors along and to the left of headings; (T,) each."""
    c, s = np.cos(theta), np.sin(theta)
    return vectors[:, 0] * c + vectors[:, 1] * s, vectors[:, 1] * c - vectors[:, 0] * s


def _unexplained_speed(rows: Array, dt: float) -> Array:
    """|displacement / dt - mean velocity| of each tick, m/s; rows (T + 1, ..., columns) to (T, ...)."""
    position, velocity = rows[..., X : Y + 1], rows[..., VX : VY + 1]
    difference = np.diff(position, axis=0) / dt - (velocity[1:] + velocity[:-1]) / 2
    return np.hypot(difference[..., 0], difference[..., 1])


def _check_room_of_people(record: EpisodeRecord) -> Iterator[Finding]:
    """All pedestrians must be inside the room."""
    scene, humans = record.scene(), record.states.humans
    inside = inside_room(humans.reshape(-1, humans.shape[-1]).copy(), scene.outline_edges.copy()).reshape(
        humans.shape[:2]
    )
    outside = np.argwhere(~inside & record.states.present)
    if len(outside):
        t, k = outside[0]
        yield f"frames.{t}", f"human {scene.humans[k].id} is outside the room ({len(outside)} cases in total)"


def _check_room(record: EpisodeRecord) -> Iterator[Finding]:
    """The robot must be inside the room."""
    inside = inside_room(record.states.robot.copy(), record.scene().outline_edges.copy())
    if not inside.all():
        yield f"frames.{int(np.argmin(inside))}", "the robot is outside the room"


def _check_overlaps(record: EpisodeRecord, pushed: BoolArray) -> Iterator[Finding]:
    """Outlines must not overlap by more than `_maximum_overlap`."""
    for tick, section, name, depth in overlaps(record, pushed, _maximum_overlap(record.scene())):
        yield f"frames.{tick}.{section}", f"{name} is {depth}"
    for tick, message in overlaps_with_doors(record, pushed, _maximum_overlap(record.scene())):
        yield f"frames.{tick}.doors", message


def _check_overlaps_of_robots(record: EpisodeRecord) -> Iterator[Finding]:
    """Outlines of robots must not overlap but by rounding."""
    for tick, message in overlaps_of_robots(record, _ROBOT_OVERLAP):
        yield f"frames.{tick}.robots", message


def _check_presence(record: EpisodeRecord) -> Iterator[Finding]:
    """Pedestrians must be absent before they enter and after they leave, and recorded ones must be on their track."""
    states, ticks, noted = record.states, np.arange(len(record) + 1), record.document.get("never_entered")
    if noted is not None and noted != record.never_entered:  # files of earlier versions have no such key
        yield "never_entered", f"is {noted}, but the people who never entered are {record.never_entered}"
    for k, human in enumerate(record.scene().humans):
        absent = (ticks < human.enters) | (ticks >= (np.inf if human.leaves is None else human.leaves))
        for t in np.flatnonzero(states.present[:, k] & absent)[:1]:
            yield f"frames.{t}.humans", f"human {human.id} is present before entering or after leaving"
        if human.track:
            track = np.array([human.track_position(t) for t in ticks.tolist()])
            distance = np.hypot(*(states.humans[:, k, X : Y + 1] - track).T)
            yield from _worst_tick(distance - ROUNDING, "humans", f"human {human.id}", "m off the recorded track")


def _may_be_pushed(record: EpisodeRecord) -> BoolArray:
    """Whether each pedestrian, and the robot last, is recorded or touches a recorded one; (T + 1, N + 1).

    Recorded pedestrians react to nothing and may push others, so limits on motion do not hold there.
    """
    scene, positions = record.scene(), _positions(record)
    radii = np.array([*scene.human_table.circumradius, scene.robot.radius])
    pushed = np.zeros(positions.shape[:2], dtype=bool)
    for k, human in enumerate(scene.humans):
        if human.behaviour == "recorded":
            offset = positions - positions[:, k, None]
            pushed |= np.hypot(offset[..., 0], offset[..., 1]) < radii + human.shape.circumradius + _PUSH_RANGE
            pushed[:, k] = True
    return pushed


def _positions(record: EpisodeRecord) -> Array:
    """(T + 1, N + 1, 2), m, of the pedestrians and the robot, which is last; NaN where absent."""
    states = record.states
    return np.concatenate((states.humans[..., X : Y + 1], states.robot[:, None, X : Y + 1]), axis=1)


def _check_outcome(record: EpisodeRecord) -> Iterator[Finding]:
    """The outcome must match the final state, and no earlier state may have ended the episode."""
    scene, states, outcome = record.scene(), record.states, record.outcome
    final = record.document["final"]
    if outcome.tick != len(record) or abs(outcome.time - states.time[-1]) > ROUNDING:
        yield "outcome", f"is of tick {outcome.tick} at {outcome.time} s, but there are {len(record)} frames"
    if outcome.status == "timeout" and outcome.tick < scene.rules.last_tick:
        yield "outcome", f"says the time limit was reached at {outcome.time} s; the limit is {scene.rules.time_limit} s"
    contacts = [final["contacts"], *(other["contacts"] for other in final.get("robots") or ())]
    if outcome.status == "contact" and not any(contacts):
        yield "outcome", "says a contact ended the episode, but the final state has none"
    has_all = None not in outcome.arrivals
    if scene.robots and (outcome.status == "goal") != has_all and "goal" in scene.rules.ends_on:
        yield "outcome", f"is {outcome.status}, but the robots arrived at ticks {list(outcome.arrivals)}"


def _check_task(record: EpisodeRecord) -> Iterator[Finding]:
    """The task must be done when the file says so, and not before."""
    done = [is_done(snapshot) for snapshot in record.snapshots()]
    if record.outcome.status == "goal" and not done[-1]:
        yield "outcome", f"says the task was done: {record.scene().goal.task}, but it was not"
    if "goal" in record.scene().rules.ends_on and any(done[:-1]) and not record.scene().robots:
        yield "outcome", f"the task was done at tick {done.index(True)}, but the episode went on"


def _check_arrival(record: EpisodeRecord) -> Iterator[Finding]:
    """The robot must be at its goal when the file says so, and not before; of several, it stands from then on."""
    scene, outcome = record.scene(), record.outcome
    goal, robot = scene.goal, record.states.robot
    if not goal.is_plain:
        yield from _check_task(record)
        return
    missing = np.hypot(robot[:, X] - goal.x, robot[:, Y] - goal.y) - goal.distance  # m, and rad: 0 or less at the goal
    if goal.angle < 3.14:
        turned = np.array([abs(wrap_angle(theta - goal.theta)) for theta in robot[:, THETA].tolist()])
        missing = np.maximum(missing, turned - goal.angle)
    if scene.robots:
        arrival = outcome.arrivals[0]
        if arrival is not None and missing[arrival] > ROUNDING:
            yield "outcome", f"says the robot arrived at tick {arrival}; {missing[arrival]:.3f} m or rad were missing"
        if (missing[:arrival] < -ROUNDING).any():
            yield "outcome", f"the robot arrived at tick {int(np.argmax(missing < -ROUNDING))}, not at {arrival}"
        if arrival is not None and record.command[arrival:].any():
            yield "outcome", f"the robot arrived at tick {arrival}, but has other commands than 0 after it"
        return
    if outcome.status == "goal" and missing[-1] > ROUNDING:
        yield "outcome", f"says the goal was reached, but {missing[-1]:.3f} m or rad were missing"
    if "goal" in scene.rules.ends_on and (missing[:-1] < -ROUNDING).any():
        yield "outcome", f"the goal was reached at tick {int(np.argmax(missing < -ROUNDING))}, but the episode went on"


def _worst_tick(excess: Array, place: str, subject: str, description: str) -> Iterator[Finding]:
    """The tick with the largest excess over a limit; (T,), positive values exceed it, NaN is ignored."""
    if (excess > 0.0).any():
        excess = np.nan_to_num(excess, nan=-1.0)
        t, count = int(np.argmax(excess)), int(np.count_nonzero(excess > 0.0))
        ticks = f" (the worst of {count} ticks)" if count > 1 else ""
        yield f"frames.{t}.{place}", f"{subject} is {excess[t]:.3f} {description}{ticks}"


def _worst_tick_of_humans(excess: Array, scene: Scene, description: str) -> Iterator[Finding]:
    for k, human in enumerate(scene.humans):
        yield from _worst_tick(excess[:, k], "humans", f"human {human.id}", description)
