"""Layers on top of the room: fields of view, Hall's zones, interactions and velocities."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from functools import partial
from itertools import pairwise

import numpy as np

from ..core.entities import Interaction
from ..core.geometry import Barriers, Point
from ..core.humans import HumanState
from ..core.portable_math import Array
from ..core.proxemics import INTIMATE_DISTANCE, PERSONAL_DISTANCE
from ..core.relations import ACTIVITY
from ..core.snapshot import Snapshot
from .annotations import STRIP
from .brush import Brush, body_arc
from .furniture import half_size
from .palette import BLUE, FAINT, FLOOR, INK, PURPLE, REGARD, ROBOT, Colour, mixed, shaded

_RAYS = tuple((math.cos(0.38 * k / 3), math.sin(0.38 * k / 3)) for k in range(-3, 4))  # unit vectors around the gaze
_FAN_RANGE = 0.75  # m beyond the pedestrian's outline
_CIRCLE = tuple(body_arc(1.0, 0.0, 0.0, 1.0, 65))  # closed
_DASHES = 48  # of the line around a personal zone
_INTIMATE_LINE, _PERSONAL_LINE = mixed(FLOOR, INK, 0.3), mixed(FLOOR, INK, 0.22)
_MARGIN = 0.05  # m, between the end of a link and the outline of its entity

_Ends = dict[int, tuple[Point, float]]  # by id: position and radius of the entities that a link can join, m


@dataclass(frozen=True, slots=True)
class Layers:
    """The parts of a picture besides the room, the pedestrians and the robot.

    Attributes:
        gaze: fields of view.
        links: dotted lines between interacting entities.
        goal: the robot's goal.
        grid: faint lines, 1 m apart.
        zones: intimate and personal zones, and the space shared by interacting pedestrians.
        velocities: arrows.
        ids: of pedestrians and objects.
        attributes: of pedestrians, objects and areas, as words.
        caption: the strip below, with the scale bar.
        legend: rows below the picture that explain its symbols; camera images have none.
    """

    gaze: bool = True
    links: bool = True
    goal: bool = True
    grid: bool = True
    zones: bool = False
    velocities: bool = False
    ids: bool = False
    attributes: bool = True
    caption: bool = True
    legend: bool = False

    @property
    def strip(self) -> int:
        """Height of the strip of the caption, px; 0 without one."""
        return STRIP if self.caption else 0


# Fields of view


def _blocked_rays(humans: Sequence[HumanState], walls: Barriers) -> dict[int, list[float]]:
    """Distances to the next wall along the rays of each field of view that a wall may cut off.

    Returns:
        By id of the pedestrian: one distance per ray, m; infinite without a wall. Pedestrians far from walls are left
        out.
    """
    if not humans or not len(walls):
        return {}
    places = np.array([human.pose.position for human in humans], dtype=float)
    ranges = np.array([human.radius + _FAN_RANGE for human in humans])
    near = np.flatnonzero(walls.gaps(places).min(axis=0) < ranges)
    return {humans[int(k)].id: _ray_lengths(places[k], humans[int(k)].head, walls).tolist() for k in near}


def _ray_lengths(place: Array, head: float, walls: Barriers) -> Array:
    """Distance to the next wall along each ray, (rays,), m; infinite without a wall."""
    c, s = np.cos(head), np.sin(head)
    rays = np.array([(x * c - y * s, x * s + y * c) for x, y in _RAYS])[:, None, :]
    along, offset = walls.end - walls.start, walls.start - place
    cross = rays[..., 0] * along[:, 1] - rays[..., 1] * along[:, 0]
    cross = np.where(cross == 0.0, 1e-12, cross)  # a ray parallel to a wall
    distance = (offset[:, 0] * along[:, 1] - offset[:, 1] * along[:, 0]) / cross
    fraction = (offset[:, 0] * rays[..., 1] - offset[:, 1] * rays[..., 0]) / cross  # of the wall, from its start
    hits = (distance > 0.0) & (fraction >= 0.0) & (fraction <= 1.0)
    nearest: Array = np.where(hits, distance, np.inf).min(axis=1)
    return nearest


def draw_gazes(brush: Brush, humans: Sequence[HumanState], snapshot: Snapshot) -> None:
    """Draw the pedestrians' fields of view, which end at walls and doors."""
    walls = snapshot.scene.barriers.subset([*range(len(snapshot.scene.straight_walls))])  # walls come first
    rays = _blocked_rays(humans, walls.joined(Barriers.of([each.leaf for each in snapshot.doors])))
    for human in humans:
        r, activity = human.radius, human.activity
        position, gaze = human.pose.position, (math.cos(human.head), math.sin(human.head))
        if human.id in rays:  # the shape is unique, so that a cache would not help
            draw_fan(brush.at(position, gaze), activity, r, rays[human.id])
        else:
            brush.stamp(position, (("gaze", activity, r), partial(draw_fan, activity=activity, r=r), gaze))


def draw_fan(brush: Brush, activity: str, r: float, ray_lengths: Sequence[float] | None = None) -> None:
    """Draw a translucent fan ahead of a pedestrian of radius r (m), paler at its far end.

    Args:
        ray_lengths: upper limits of the fan's rays, m from the brush's position; by default none.
    """
    far = [r + _FAN_RANGE] * len(_RAYS) if ray_lengths is None else [min(d, r + _FAN_RANGE) for d in ray_lengths]
    near = [min(distance, r + 0.66 * _FAN_RANGE) for distance in far]
    rim, middle = ([(d * c, d * s) for d, (c, s) in zip(ends, _RAYS, strict=True)] for ends in (far, near))
    colour = ACTIVITY[activity].colour
    brush.wash(colour, 24, [*rim, *middle[::-1]])
    brush.wash(colour, 55, [(0.0, 0.0), *middle])


# Zones and velocities


def draw_zones(brush: Brush, humans: Sequence[HumanState], outline: Sequence[Point]) -> None:
    """Draw Hall's intimate zone and personal zone (dashed) around each pedestrian, as far as they are in the room.

    Args:
        outline: corners of the room, m; without any, zones are drawn whole.
    """
    with brush.inside(outline) if outline else nullcontext():
        for human in humans:
            r, shoulder = human.radius, human.shoulder
            draw = partial(draw_zones_of, r=r, shoulder=shoulder)
            # a disc's zones look alike at any heading
            direction = human.pose.direction if shoulder != 0.0 else brush.camera.up
            brush.stamp(human.pose.position, (("zones", r, shoulder), draw, direction), whole=True)


def draw_zones_of(brush: Brush, r: float, shoulder: float) -> None:
    """Draw the zones of a pedestrian, which extend from its outline.

    Args:
        r: half the depth of the body, m.
        shoulder: half the length of the shoulder line, m; see `Humans.shoulder`.
    """
    intimate, personal = r + INTIMATE_DISTANCE, r + PERSONAL_DISTANCE
    inner, outer = (body_arc(radius, shoulder, 0.0, 1.0, 65) for radius in (intimate, personal))
    brush.wash(BLUE, 13, [*outer, *inner[::-1]])
    brush.wash(BLUE, 30, inner)
    brush.stroke(_INTIMATE_LINE, body_arc(intimate - 0.006, shoulder, 0.0, 1.0, 65), 0.012)
    brush.dashed_body(_PERSONAL_LINE, personal, shoulder, 0.012, _DASHES)


def _draw_velocity(brush: Brush, position: Point, velocity: Point, colour: Colour) -> None:
    """Draw an arrow as long as the distance covered in one second; nothing below 0.05 m/s."""
    speed = math.hypot(*velocity)
    if speed < 0.05:
        return
    arrow = brush.at(position, (velocity[0] / speed, velocity[1] / speed))
    arrow.stroke(colour, [(0.0, 0.0), (max(speed - 0.1, 0.0), 0.0)], 0.03)
    arrow.polygon(colour, [(speed, 0.0), (speed - 0.14, 0.07), (speed - 0.14, -0.07)])


def draw_velocities(brush: Brush, snapshot: Snapshot, humans: Sequence[HumanState]) -> None:
    """Draw the velocity of each pedestrian and robot as an arrow."""
    for human in humans:
        _draw_velocity(brush, human.pose.position, human.velocity, shaded(ACTIVITY[human.activity].colour, 0.3))
    if "robot" not in snapshot.scene.unmeasured:
        for robot in (snapshot.robot, *snapshot.robots):
            _draw_velocity(brush, robot.position, robot.velocity, shaded(ROBOT, 0.3))


# Interactions


def draw_interactions(
    brush: Brush, snapshot: Snapshot, humans: Sequence[HumanState], *, spaces: bool, links: bool
) -> None:
    """Draw the spaces shared by interacting pedestrians, and the links between interacting entities."""
    ends = _link_ends(snapshot, humans)
    groups = [members for members, _ in _interacting_groups(snapshot, "talking")] if spaces else []
    for members in groups:
        _draw_group_space(brush, [ends[member][0] for member in members if member in ends])
    grouped = {member for members in groups for member in members}
    for link in snapshot.interactions if spaces else ():
        if link.src not in grouped:  # members of a group share the space of the group
            _draw_pair_space(brush, link, ends)
    things = {item.id for item in snapshot.objects}
    for link in visible_interactions(snapshot) if links else ():
        _draw_link(brush, link, ends, draw_regard_between if link.dst in things else draw_link_between)


def visible_interactions(snapshot: Snapshot) -> list[Interaction]:
    """The interactions to draw: in a group of more than two, only those between neighbours, which keeps it legible."""
    hidden = {pair for group, closed in _interacting_groups(snapshot) for pair in _distant_pairs(group, closed=closed)}
    return [link for link in snapshot.interactions if frozenset((link.src, link.dst)) not in hidden]


def _interacting_groups(snapshot: Snapshot, kind: str | None = None) -> list[tuple[list[int], bool]]:
    """Groups of which at least three members interact with each other at this tick.

    Args:
        kind: of the groups; by default any.

    Returns:
        For each group the ids of these members in their order, and whether the last one stands next to the first.
    """
    pairs = {frozenset((link.src, link.dst)) for link in snapshot.interactions}
    interacting = []
    for group in snapshot.scene.groups:
        if kind in (None, group.kind):
            members = [a for a in group.members if any(a != b and frozenset((a, b)) in pairs for b in group.members)]
            if len(members) > 2:
                interacting.append((members, group.formation == "circle"))
    return interacting


def _distant_pairs(members: Sequence[int], *, closed: bool) -> set[frozenset[int]]:
    """The pairs of a group that do not stand next to each other."""
    adjacent = {frozenset(pair) for pair in pairwise([*members, members[0]] if closed else members)}
    return {pair for a in members for b in members if a != b and (pair := frozenset((a, b))) not in adjacent}


def _link_ends(snapshot: Snapshot, humans: Sequence[HumanState]) -> _Ends:
    """Position of every entity that a link can join, and the radius at which the link ends, m, by id."""
    ends = {item.id: (item.pose.position, 0.8 * min(half_size(item))) for item in snapshot.objects}
    ends |= {human.id: (human.pose.position, human.radius) for human in humans}
    return ends | {robot.id: (robot.position, robot.radius) for robot in (snapshot.robot, *snapshot.robots)}


def _joined(brush: Brush, link: Interaction, ends: _Ends) -> tuple[Brush, float] | None:
    """A brush in the middle of two entities, directed to the second one, and their distance, m; None if one is absent.

    Entities at the same place count as absent.
    """
    if link.src not in ends or link.dst not in ends:
        return None
    (ax, ay), (bx, by) = ends[link.src][0], ends[link.dst][0]
    distance = math.hypot(bx - ax, by - ay)
    if distance == 0.0:
        return None
    return brush.at(((ax + bx) / 2, (ay + by) / 2), ((bx - ax) / distance, (by - ay) / distance)), distance


def _draw_link(brush: Brush, link: Interaction, ends: _Ends, draw: Callable[[Brush, Point, Point], None]) -> None:
    """Draw a line between the outlines of two entities."""
    if (joined := _joined(brush, link, ends)) is not None:
        centre, distance = joined
        first, last = ends[link.src][1] + _MARGIN - distance / 2, distance / 2 - ends[link.dst][1] - _MARGIN
        if first < last:
            draw(centre, (first, 0.0), (last, 0.0))


def draw_link_between(brush: Brush, start: Point, end: Point) -> None:
    """Draw a dotted line between two points: somebody attends to somebody, and nobody should pass between them."""
    brush.dots(FAINT, start, end, 0.022, 0.1)


def draw_regard_between(brush: Brush, start: Point, end: Point) -> None:
    """Draw a faint line between two points: somebody looks at a thing or works at it."""
    brush.stroke(REGARD, [start, end], 0.014)


def _draw_pair_space(brush: Brush, link: Interaction, ends: _Ends) -> None:
    """Draw the space between two entities that interact, which other pedestrians and the robot should not enter.

    Source: A. Kendon's o-space (Conducting Interaction, 1990), as an ellipse from one entity to the other.
    """
    if (joined := _joined(brush, link, ends)) is not None:
        centre, distance = joined
        draw_shared_space(centre, distance / 2, min(max(0.35 * distance, 0.3), 0.7))


def draw_shared_space(brush: Brush, half_length: float, half_width: float) -> None:
    """Draw an ellipse along the brush's axes, darker in the middle; m."""
    _draw_space(brush, [(half_length * c, half_width * s) for c, s in _CIRCLE])


def _draw_group_space(brush: Brush, places: Sequence[Point]) -> None:
    """Draw the o-space of a talking group: the polygon of its members' positions; nothing for fewer than three.

    Source: A. Kendon, Conducting Interaction, 1990.
    """
    if len(places) > 2:
        x, y = (sum(place[k] for place in places) / len(places) for k in (0, 1))
        _draw_space(brush.at((x, y)), [(px - x, py - y) for px, py in places])


def _draw_space(brush: Brush, outline: Sequence[Point]) -> None:
    """Draw a polygon around the brush, darker in the middle."""
    for factor in (1.0, 0.72):
        brush.wash(PURPLE, 26, [(factor * x, factor * y) for x, y in outline])
