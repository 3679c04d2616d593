"""Overlaps of outlines in a recorded episode."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import accumulate, combinations

import numpy as np

from ...core.compiled.kernel import kernel, subroutine
from ...core.compiled.scalar import (
    END_X,
    END_Y,
    RADIUS,
    START_X,
    START_Y,
    gap,
    length,
    line_gap,
    shoulder_line_distance,
)
from ...core.geometry import Barriers
from ...core.humans import X, Y
from ...core.outlines import side_lines
from ...core.portable_math import Array, BoolArray, IntArray, unit_vectors
from ...core.relations import ACTIVITIES
from ...core.separation import DISTANCE, SEPARATION_SIZE, outline_gaps, place_corners, separate
from ...core.vectors import lengths
from ...record.motion import THETA
from ...record.record import EpisodeRecord

_SITTING = ACTIVITIES.index("sitting")  # also while a pedestrian sits down and gets up


def overlaps(record: EpisodeRecord, left_out: BoolArray, maximum: float) -> Iterator[tuple[int, str, str, str]]:
    """Outlines that overlap by more than a maximum.

    Args:
        record: the episode.
        left_out: (T + 1, N + 1) of bool, pedestrians, and the robot last, that may overlap others in a state.
        maximum: m.

    Returns:
        Of each body and what it is in: the worst tick, the section of a frame, the body, and the depth in words.
    """
    scene, states = record.scene(), record.states
    robot = states.robot[:, None]  # the humans have a column more
    rows = np.concatenate((states.humans[..., : robot.shape[2]], robot), axis=1)
    position = np.where(left_out[..., None], np.nan, rows[..., X : Y + 1])
    table, count = scene.human_table, len(scene.humans)
    outline = scene.robot.outline
    sizes = np.array([[*table.radius, outline.rounding], [*table.shoulder, 0.0]])
    solids = [thing for thing in scene.furniture if thing.on is None]  # bodies do not collide with things on a table
    edges = [[(wall.start, wall.end, 0.0) for wall in scene.straight_walls.values()]]
    edges += [thing.shape.edges(thing.pose) for thing in solids]
    owner = np.repeat(np.arange(len(edges)), [len(own) for own in edges])
    corners = [thing.shape.corners(thing.pose) if len(thing.shape.core) > 1 else [] for thing in solids]
    start = np.array([0, *accumulate(map(len, corners), initial=0)])  # walls have no inside
    inside = np.array([corner for own in corners for corner in own], dtype=float).reshape(-1, 2)
    is_seat = np.array([False, *(thing.is_seat for thing in solids)])
    sitting = np.zeros(position.shape[:2], dtype=bool)
    sitting[:, :count] = states.activity == _SITTING
    shape = count + 1, len(edges) + count + 1
    worst, tick, number = np.zeros(shape), np.zeros(shape, dtype=np.int64), np.zeros(shape, dtype=np.int64)
    _find_depths(
        np.ascontiguousarray(position), unit_vectors(rows[..., THETA]), sizes,
        Barriers.of(edge for own in edges for edge in own).table.copy(), owner, start, inside, is_seat, sitting,
        float(maximum), np.array(outline.core), float(outline.circumradius), worst, tick, number,
    )  # fmt: skip
    names = [*(f"human {human.id}" for human in scene.humans), "the robot"]
    things = ["a wall", *(f"{thing.type} {thing.id}" for thing in solids), *names]
    sections = ["walls"] + ["objects"] * len(solids) + ["humans"] * len(names)
    for k, n in np.argwhere(number > 0).tolist():
        ticks = f" (the worst of {number[k, n]} ticks)" if number[k, n] > 1 else ""
        yield int(tick[k, n]), sections[n], names[k], f"{worst[k, n]:.3f} m too deep in {things[n]}{ticks}"


def overlaps_of_robots(record: EpisodeRecord, maximum: float) -> Iterator[tuple[int, str]]:
    """Robots whose outlines overlap by more than a maximum, m: of each pair the worst tick, and the depth in words."""
    scene, robots = record.scene(), np.concatenate((record.states.robot[:, None], record.states.robots), axis=1)
    position, direction = robots[..., X : Y + 1], unit_vectors(robots[..., THETA])
    for (a, (robot, _)), (b, (other, _)) in combinations(enumerate(scene.tasks), 2):
        near = np.flatnonzero(lengths(position[:, a] - position[:, b]) < robot.radius + other.radius)
        if not len(near):
            continue
        sides = side_lines(other.outline, position[near, b], direction[near, b])
        depth = -outline_gaps(robot.outline, position[near, a], direction[near, a], sides).min(axis=1)
        worst = int(np.argmax(depth))
        if depth[worst] > maximum:
            ids = scene.robot_ids
            yield int(near[worst]), f"robot {ids[a]} is {depth[worst]:.3f} m too deep in robot {ids[b]}"


@kernel
def _find_depths(
    position: Array, direction: Array, sizes: Array, barriers: Array, owner: IntArray, start: IntArray, inside: Array,
    is_seat: BoolArray, sitting: BoolArray, maximum: float, core: Array, circumradius: float, worst: Array,
    tick: IntArray, number: IntArray,
) -> None:  # fmt: skip
    """Find how deep K bodies are in S solids and in one another, beyond the maximum.

    Args:
        position, direction: (T, K, 2), m, NaN where a body is left out, and unit vectors of the headings.
        sizes: (2, K), m, radii and halves of the shoulder lines; of the robot, the rounding of its outline, and 0.
        barriers, owner: (M, 8) and (M,), edges of the solids, and the index of each one's solid.
        start, inside: (S + 1,) of int and (C, 2), m, where the corners of each solid begin, and all corners.
        is_seat, sitting: (S,) and (T, K) of bool; who sits may overlap seats.
        maximum: m.
        core, circumradius: corners of the robot's outline in its frame, (C, 2), and radius of the circle around it, m.
        worst, tick, number: (K, S + K), m, the worst depth, its tick, and the number of ticks; are filled.
    """
    solids, robot, is_disc = len(start) - 1, position.shape[1] - 1, len(core) == 1
    depths, found, corners = np.empty(solids), np.empty(SEPARATION_SIZE), core.copy()
    for t in range(len(position)):
        for k in range(position.shape[1]):
            x, y, radius, shoulder = position[t, k, X], position[t, k, Y], sizes[0, k], sizes[1, k]
            if x != x:
                continue
            bx, by, least = direction[t, k, X], direction[t, k, Y], radius - maximum
            left_x, left_y = x - by * shoulder, y + bx * shoulder
            right_x, right_y = x + by * shoulder, y - bx * shoulder
            for s in range(solids):
                depths[s] = -1.0
            if not is_disc and k == robot:
                place_corners(core, x, y, bx, by, corners)
            for m in range(len(barriers)):
                if not is_disc and k == robot:
                    if gap(barriers, m, x, y) < circumradius:
                        ends = barriers[m, START_X], barriers[m, START_Y], barriers[m, END_X], barriers[m, END_Y]
                        separate(corners, *ends, found)
                        depth = least + barriers[m, RADIUS] - found[DISTANCE]
                        depths[owner[m]] = max(depths[owner[m]], depth)
                elif gap(barriers, m, x, y) - shoulder < least:
                    depth = least - line_gap(barriers, m, left_x, left_y, right_x, right_y)
                    depths[owner[m]] = max(depths[owner[m]], depth)
            for s in range(solids):
                solid = inside[start[s] : start[s + 1]]
                if len(solid) > 0:
                    # an end or the middle of the shoulder line is inside
                    beyond = min(_beyond(solid, x, y, found), _beyond(solid, left_x, left_y, found))
                    beyond = min(beyond, _beyond(solid, right_x, right_y, found))
                    if beyond < 0.0:
                        depths[s] = max(depths[s], least - beyond)
                if depths[s] > 0.0 and not (is_seat[s] and sitting[t, k]):
                    _note(worst, tick, number, k, s, depths[s], t)
            for j in range(k + 1, position.shape[1]):
                dx, dy = position[t, j, X] - x, position[t, j, Y] - y
                reach = least + sizes[0, j]
                if not is_disc and j == robot:
                    if length(dx, dy) < least + shoulder + circumradius:
                        heading_x, heading_y = direction[t, j, X], direction[t, j, Y]
                        place_corners(core, position[t, j, X], position[t, j, Y], heading_x, heading_y, corners)
                        separate(corners, left_x, left_y, right_x, right_y, found)
                        if reach > found[DISTANCE]:
                            _note(worst, tick, number, k, solids + j, reach - found[DISTANCE], t)
                elif length(dx, dy) < reach + shoulder + sizes[1, j]:
                    other_bx, other_by = direction[t, j, X], direction[t, j, Y]
                    depth = reach - shoulder_line_distance(dx, dy, bx, by, shoulder, other_bx, other_by, sizes[1, j])
                    if depth > 0.0:
                        _note(worst, tick, number, k, solids + j, depth, t)


@subroutine
def _beyond(corners: Array, x: float, y: float, found: Array) -> float:
    """Distance from a point to a convex polygon, m; negative inside."""
    separate(corners, x, y, x, y, found)
    return float(found[DISTANCE])


@subroutine
def _note(worst: Array, tick: IntArray, number: IntArray, k: int, n: int, depth: float, t: int) -> None:
    number[k, n] += 1
    if depth > worst[k, n]:
        worst[k, n], tick[k, n] = depth, t
