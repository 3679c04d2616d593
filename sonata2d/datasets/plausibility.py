"""Does a recorded episode make sense? Its numbers must agree with one another and with what bodies can do."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from typing import Any

import numpy as np

from ..core.entities import RELATIONS, ROBOT_ID, Furniture
from ..core.geometry import Barriers, Disc, inside_polygon
from ..core.humans import ACTIVITIES
from ..core.portable_math import Array
from ..core.scene import Scene
from ..core.vectors import wrap_angle
from ..record.canonical import rounded_rows
from ..record.layout import HUMAN_ANGLES, ROBOT_ANGLES
from ..record.record import EpisodeRecord

DEEPEST = 0.06  # m, that outlines may overlap: a step of the physics finds a contact after the bodies moved
ROUNDING = 2e-4  # m, m/s, rad/s: of numbers rounded to 1e-4
HURRY, PUSH = 1.3, 1.0  # a person walks up to HURRY times their desired speed; shoved aside, by PUSH m/s more
ROBOT_SLACK = 0.05  # m/s, of the robot's speed over its limits
JERK = 0.5  # m/s and half of the top speed, between a tick's displacement over dt and the mean velocity at its ends
REACHED = 0.1  # m, gap to one who is recorded within which they may have shoved somebody in the last tick
TURN_SLACK = 0.05  # rad, between a turn in a tick and the mean turn rate at its ends

Doubt = tuple[str, str]  # place, message


def doubts(record: EpisodeRecord) -> Iterator[Doubt]:
    """All that does not make sense, as place and message."""
    shoved = shoved_in(record)
    yield from _about_numbers(record)
    yield from _about_ids(record.scene())
    yield from _about_time(record)
    yield from _about_activities(record)
    yield from _about_speeds(record, shoved)
    yield from _about_motion(record, shoved)
    yield from _about_room(record)
    yield from _about_overlaps(record, shoved)
    yield from _about_presence(record)
    yield from _about_outcome(record)


def _about_numbers(record: EpisodeRecord) -> Iterator[Doubt]:
    """Numbers are written the one way there is, to the bit."""
    looks = record.looks
    kinds = (("robot", looks.robot, ROBOT_ANGLES), ("humans", looks.humans, HUMAN_ANGLES))
    for key, rows, angles in (*kinds, ("command", record.command, []), ("executed", record.executed, [])):
        values = np.nan_to_num(rows)
        strange = (rounded_rows(values, angles).view(np.int64) != values.view(np.int64)).any(axis=-1)
        strange |= (values[..., angles] > 3.1416).any(axis=-1)
        for t in np.flatnonzero(strange.reshape(len(values), -1).any(axis=1))[:1]:
            yield f"frames.{t}.{key}", "a number is not rounded to 0.0001, is -0.0, or an angle out of range"


def _about_ids(scene: Scene) -> Iterator[Doubt]:
    """Ids are unique, and whoever is spoken of exists."""
    people, things = [human.id for human in scene.humans], [thing.id for thing in scene.furniture]
    for kind, ids in (("ids", [ROBOT_ID, *people, *things]), ("groups", [group.id for group in scene.groups])):
        for id, count in Counter(ids).items():
            if count > 1:
                yield kind, f"id {id} is given {count} times"
    groups = {group.id: group.members for group in scene.groups}
    for group, members in groups.items():
        for id in set(members) - set(people):
            yield "groups", f"member {id} of group {group} is no human"
    for human in scene.humans:
        if human.group is not None and human.id not in groups.get(human.group, ()):
            yield "humans", f"human {human.id} is no member of the group {human.group} it names"
    for thing in scene.furniture:
        if thing.on is not None and thing.on not in things:
            yield "objects", f"object {thing.id} lies on {thing.on}, which is no object"


def _about_time(record: EpisodeRecord) -> Iterator[Doubt]:
    """Ticks count from 0 and time is tick * dt."""
    ticks, dt = record.looks.tick, record.scene().rules.dt
    for t in np.flatnonzero(ticks != np.arange(len(ticks)))[:1]:
        yield f"frames.{t}", f"tick should be {t}, is {ticks[t]}"
        return
    for t in np.flatnonzero(np.abs(record.looks.time - ticks * dt) > ROUNDING)[:1]:
        yield f"frames.{t}", f"time should be {ticks[t] * dt:.4f} s, is {record.looks.time[t]} s"


def _about_activities(record: EpisodeRecord) -> Iterator[Doubt]:
    """Activities are in the list, and interactions are between those who exist."""
    names, scene = record.document["activities"], record.scene()
    if not set(names) <= set(ACTIVITIES):
        yield "activities", f"unknown {sorted(set(names) - set(ACTIVITIES))}"
    for t, k in np.argwhere(record.looks.activity >= len(names))[:1]:
        yield f"frames.{t}.activity.{k}", f"{record.looks.activity[t, k]} is not in the list of activities"
    people = {human.id for human in scene.humans}
    known = people | {thing.id for thing in scene.furniture} | {ROBOT_ID}
    for tie in scene.interactions:
        if tie.src not in people or tie.dst not in known or tie.relation not in RELATIONS:
            yield "interactions", f"{tie.relation} of {tie.src} and {tie.dst}: unknown, or not in the room"
    for t, frame in enumerate([*record.document["frames"], record.document["final"]]):
        for src, relation, dst in frame["interactions"]:
            if src not in people or dst not in known:
                yield f"frames.{t}.interactions", f"{relation} of {src} and {dst}, who are not in the room"
                return


def _about_speeds(record: EpisodeRecord, shoved: Any) -> Iterator[Doubt]:
    """Nobody is faster than they can be."""
    scene = record.scene()
    robot, limits = scene.robot, scene.robot.limits
    sideways = limits.sideways if robot.kinematics == "holonomic" else 0.0
    most = math.hypot(max(limits.ahead, limits.back), sideways) + ROBOT_SLACK
    done = np.hypot(record.executed[:, 0], record.executed[:, 1])
    yield from _worst(done - most, "executed", "the robot's drive", "m/s faster than its limits")
    turning = np.abs(record.executed[:, 2]) - limits.turn - ROUNDING
    yield from _worst(turning, "executed", "the robot's drive", "rad/s of turning beyond its limits")
    fastest = np.array([HURRY * human.desired_speed + PUSH for human in scene.humans])
    speed = np.hypot(record.looks.humans[..., 3], record.looks.humans[..., 4])
    speed[shoved[:, :-1]] = 0.0
    yield from _worst_person(speed - fastest, scene, "m/s faster than they can be")


def _about_motion(record: EpisodeRecord, shoved: Any) -> Iterator[Doubt]:
    """Velocities are what poses change by."""
    looks, dt = record.looks, record.scene().rules.dt
    people, robot = _unexplained(looks.humans, dt), _unexplained(looks.robot, dt)
    either = shoved[1:] | shoved[:-1]
    people[either[:, :-1]] = robot[either[:, -1]] = 0.0
    scene = record.scene()
    limits = scene.robot.limits
    fastest = np.array([HURRY * human.desired_speed + PUSH for human in scene.humans])
    yield from _worst_person(people - fastest / 2 - JERK, scene, "m/s of motion beyond what the velocities explain")
    robot = robot - math.hypot(max(limits.ahead, limits.back), limits.sideways) / 2 - JERK
    yield from _worst(robot, "robot", "the robot", "m/s of motion beyond what the velocities explain")
    turned = (np.diff(looks.robot[:, 2]) - record.executed[:, 2] * dt + np.pi) % (2 * np.pi) - np.pi
    yield from _worst(
        np.abs(turned) - TURN_SLACK, "robot", "the robot", "rad turned beyond what its turn rate explains"
    )


def _unexplained(rows: Array, dt: float) -> Array:
    """|displacement / dt - mean velocity| of each tick, m/s; rows (T + 1, …, columns) to (T, …)."""
    place, velocity = rows[..., 0:2], rows[..., 3:5]
    off = np.diff(place, axis=0) / dt - (velocity[1:] + velocity[:-1]) / 2
    return np.hypot(off[..., 0], off[..., 1])


def _about_room(record: EpisodeRecord) -> Iterator[Doubt]:
    """Nobody is outside."""
    scene, there = record.scene(), record.looks.present
    everybody = np.concatenate((record.looks.humans[..., :2], record.looks.robot[:, None, :2]), axis=1)
    inside = inside_polygon(np.nan_to_num(everybody).reshape(-1, 2), scene.outline).reshape(everybody.shape[:2])
    out = np.argwhere(~inside[:, :-1] & there)
    if len(out):
        yield f"frames.{out[0, 0]}", f"human {scene.humans[out[0, 1]].id} is outside the room ({len(out)} cases in all)"
    if not inside[:, -1].all():
        yield f"frames.{int(np.argmin(inside[:, -1]))}", "the robot is outside the room"


def _about_overlaps(record: EpisodeRecord, shoved: Any) -> Iterator[Doubt]:
    """Outlines do not overlap by more than `DEEPEST`."""
    scene = record.scene()
    places = np.where(shoved[..., None], np.nan, _places(record))
    radii = np.array([*(human.radius for human in scene.humans), scene.robot.radius])
    names = [*(f"human {human.id}" for human in scene.humans), "the robot"]
    for k, name in enumerate(names):
        mine, nearest = places[:, k], radii[k] - DEEPEST
        walls = Barriers.of([(wall.start, wall.end, 0.0) for wall in scene.walls])
        if len(walls):
            yield from _worst(nearest - walls.gaps(mine).min(axis=0), "walls", name, "m too deep in a wall")
        for thing in scene.furniture:
            if thing.on is None:
                place = f"m too deep in {thing.type} {thing.id}"
                yield from _worst(nearest - _distance(mine, thing), "objects", name, place)
        apart = places[:, k + 1 :] - mine[:, None]
        deep = nearest + radii[k + 1 :] - np.hypot(apart[..., 0], apart[..., 1])
        for other in range(deep.shape[1]):
            yield from _worst(deep[:, other], "humans", name, f"m too deep in {names[k + 1 + other]}")


def _about_presence(record: EpisodeRecord) -> Iterator[Doubt]:
    """Nobody is there before they enter or after they leave, and who is recorded is on their track."""
    looks, ticks = record.looks, np.arange(len(record) + 1)
    for k, human in enumerate(record.scene().humans):
        outside = (ticks < human.enters) | (ticks >= (np.inf if human.leaves is None else human.leaves))
        for t in np.flatnonzero(looks.present[:, k] & outside)[:1]:
            yield f"frames.{t}.humans", f"human {human.id} is there before they enter or after they leave"
        if human.track:
            track = np.array([human.place_at(t) for t in ticks.tolist()])
            off = np.hypot(*(looks.humans[:, k, :2] - track).T)
            yield from _worst(off - ROUNDING, "humans", f"human {human.id}", "m off their track")


def shoved_in(record: EpisodeRecord) -> Any:
    """Who is recorded or touches one who is, who heeds nobody and may shove them anywhere; (T + 1, N + 1) of bool.

    The robot comes last.
    """
    scene, places = record.scene(), _places(record)
    radii = np.array([*(human.radius for human in scene.humans), scene.robot.radius])
    shoved = np.zeros(places.shape[:2], dtype=bool)
    for k, human in enumerate(scene.humans):
        if human.behaviour == "recorded":
            apart = places - places[:, k, None]
            shoved |= np.hypot(apart[..., 0], apart[..., 1]) < radii + human.radius + REACHED
            shoved[:, k] = True
    return shoved


def _places(record: EpisodeRecord) -> Array:
    """(T + 1, N + 1, 2), m, of all, the robot last; NaN where absent."""
    return np.concatenate((record.looks.humans[..., :2], record.looks.robot[:, None, :2]), axis=1)


def _distance(points: Array, thing: Furniture) -> Array:
    """Signed distance of points to the outline of a thing, m, negative inside; (T, 2) to (T,)."""
    offset = points - np.array(thing.pose.position)
    if isinstance(thing.shape, Disc):
        return np.asarray(np.hypot(offset[:, 0], offset[:, 1]) - thing.shape.radius)
    c, s = thing.pose.direction
    local = np.stack((offset[:, 0] * c + offset[:, 1] * s, offset[:, 1] * c - offset[:, 0] * s), axis=1)
    beyond = np.abs(local) - np.array([thing.shape.length, thing.shape.width]) / 2
    outside = np.maximum(beyond, 0.0)
    return np.asarray(np.hypot(outside[:, 0], outside[:, 1]) + np.minimum(beyond.max(axis=1), 0.0))


def _about_outcome(record: EpisodeRecord) -> Iterator[Doubt]:
    """The outcome is what the last look shows, and no look before it showed it."""
    scene, looks, outcome = record.scene(), record.looks, record.outcome
    if outcome.tick != len(record) or abs(outcome.time - looks.time[-1]) > ROUNDING:
        yield "outcome", f"is of tick {outcome.tick} at {outcome.time} s, but there are {len(record)} frames"
    goal, robot = scene.goal, looks.robot
    reached = np.hypot(robot[:, 0] - goal.x, robot[:, 1] - goal.y) - goal.distance
    if goal.angle < 3.14:
        turned = np.array([abs(wrap_angle(theta - goal.theta)) for theta in robot[:, 2].tolist()])
        reached = np.maximum(reached, turned - goal.angle)
    if outcome.status == "goal" and reached[-1] > ROUNDING:
        yield "outcome", f"says the goal was reached, but {reached[-1]:.3f} m or rad were missing"
    if "goal" in scene.rules.ends_on and (reached[:-1] < -ROUNDING).any():
        yield "outcome", f"the goal was reached at tick {int(np.argmax(reached < -ROUNDING))}, but the episode went on"
    if outcome.status == "timeout" and outcome.tick < scene.rules.last_tick:
        yield "outcome", f"says time was up at {outcome.time} s, the limit is {scene.rules.time_limit} s"
    if outcome.status == "contact" and not record.document["final"]["contacts"]:
        yield "outcome", "says a contact ended the episode, but the final look has none"


def _worst(excess: Array, place: str, who: str, what: str) -> Iterator[Doubt]:
    """The tick at which somebody is most beyond what is allowed; (T,), positive: too much, NaN: not present."""
    excess = np.nan_to_num(excess, nan=-1.0)
    if len(excess) and excess.max() > 0.0:
        t, count = int(np.argmax(excess)), int(np.count_nonzero(excess > 0.0))
        often = f" (the worst of {count} ticks)" if count > 1 else ""
        yield f"frames.{t}.{place}", f"{who} is {excess[t]:.3f} {what}{often}"


def _worst_person(excess: Array, scene: Scene, what: str) -> Iterator[Doubt]:
    for k, human in enumerate(scene.humans):
        yield from _worst(excess[:, k], "humans", f"human {human.id}", what)
