"""Overlaps of outlines in a recorded episode."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import combinations

import numpy as np

from ...core.compiled.kernel import kernel, subroutine
from ...core.compiled.scalar import (
    END_X,
    END_Y,
    RADIUS,
    START_X,
    START_Y,
    gap,
    half_line,
    length,
    line_gap,
    shoulder_line_distance,
    unit_vector,
)
from ...core.doors import leaf_lines
from ...core.geometry import Outline
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
    position = np.where(left_out[..., None], np.nan, rows[..., : THETA + 1])
    table, count = scene.human_table, len(scene.humans)
    outline = scene.robot.outline
    sizes = np.array([[*table.radius, outline.rounding], [*table.shoulder, 0.0]])
    solids = [thing for thing in scene.furniture if thing.on is None]  # bodies do not collide with things on a table
    place = {("object", thing.id): k for k, thing in enumerate(solids, 1)}
    barriers = scene.barriers.table.copy()
    owners = scene.barrier_owner[: len(barriers)]
    owner = np.array([place.get(each, 0) for each in owners], dtype=np.int64)
    order = np.argsort(owner, kind="stable")  # doors that never move come last, and count as walls
    barriers, owner = barriers[order], owner[order]
    is_seat = np.array([False, *(thing.is_seat for thing in solids)])
    sitting = np.zeros(position.shape[:2], dtype=bool)
    sitting[:, :count] = states.activity == _SITTING
    shape = count + 1, 1 + len(solids) + count + 1
    worst, tick, number = np.zeros(shape), np.zeros(shape, dtype=np.int64), np.zeros(shape, dtype=np.int64)
    _find_depths(
        position, sizes, barriers, barriers[:, : START_Y + 1].copy(), owner,
        np.searchsorted(owner, np.arange(len(solids) + 2)), is_seat, sitting, float(maximum), np.array(outline.core),
        float(outline.circumradius), worst, tick, number,
    )  # fmt: skip
    names = [*(f"human {human.id}" for human in scene.humans), "the robot"]
    things = ["a wall", *(f"{thing.type} {thing.id}" for thing in solids), *names]
    sections = ["walls"] + ["objects"] * len(solids) + ["humans"] * len(names)
    for k, n in np.argwhere(number > 0).tolist():
        ticks = f" (the worst of {number[k, n]} ticks)" if number[k, n] > 1 else ""
        yield int(tick[k, n]), sections[n], names[k], f"{worst[k, n]:.3f} m too deep in {things[n]}{ticks}"


def overlaps_with_doors(record: EpisodeRecord, left_out: BoolArray, maximum: float) -> Iterator[tuple[int, str]]:
    """Bodies that are deeper than a maximum in the leaf of a door that moves: the worst tick, and the depth in words.

    Args:
        record, left_out, maximum: as of `overlaps`.
    """
    scene, states = record.scene(), record.states
    if not scene.moving_doors:
        return
    leaves = leaf_lines(scene.moving_doors, states.doors)
    bodies: list[tuple[str, Outline, Array]]
    bodies = [(f"human {human.id}", human.shape, states.humans[:, k]) for k, human in enumerate(scene.humans)]
    bodies.append(("the robot", scene.robot.outline, states.robot))
    for k, (name, shape, rows) in enumerate(bodies):
        shown = np.flatnonzero(~left_out[:, k] & np.isfinite(rows[:, X]))
        depth = -outline_gaps(shape, rows[shown, X : Y + 1], unit_vectors(rows[shown, THETA]), leaves[shown])
        for d, door in enumerate(scene.moving_doors):
            if len(shown) and depth[:, d].max() > maximum:
                worst = int(np.argmax(depth[:, d]))
                yield int(shown[worst]), f"{name} is {depth[worst, d]:.3f} m too deep in the leaf of door {door.id}"


def overlaps_of_robots(record: EpisodeRecord, maximum: float) -> Iterator[tuple[int, str]]:
    """Robots whose outlines overlap by more than a maximum, m: of each pair the worst tick, and the depth in words."""
    scene = record.scene()
    if not scene.robots:
        return
    robots = np.concatenate((record.states.robot[:, None], record.states.robots), axis=1)
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
    pose: Array, sizes: Array, barriers: Array, starts: Array, owner: IntArray, first: IntArray, is_seat: BoolArray,
    sitting: BoolArray, maximum: float, core: Array, circumradius: float, worst: Array, tick: IntArray,
    number: IntArray,
) -> None:  # fmt: skip
    """Find how deep K bodies are in S solids and in one another, beyond the maximum.

    Args:
        pose: (T, K, 3), m, and rad, NaN where a body is left out.
        sizes: (2, K), m, radii and shoulders, see `Humans`; of the robot, the rounding of its outline, and 0.
        barriers, starts: (M, 8) and (M, 2), m, edges of the solids, and their starts.
        owner, first: (M,) and (S + 1,) of int, the solid of each edge, and the first edge of each; walls are solid 0.
        is_seat, sitting: (S,) and (T, K) of bool; who sits may overlap seats.
        maximum: m.
        core, circumradius: corners of the robot's outline in its frame, (C, 2), and radius of the circle around it, m.
        worst, tick, number: (K, S + K), m, the worst depth, its tick, and the number of ticks; are filled.
    """
    solids, bodies, robot, is_disc = len(first) - 1, pose.shape[1], pose.shape[1] - 1, len(core) == 1
    depths, found, corners = np.empty(solids), np.empty(SEPARATION_SIZE), core.copy()
    direction, boxes = np.zeros((bodies, 2)), np.empty((solids, 4))
    for s in range(solids):
        # Walls have no inside, and discs have one edge.
        is_polygon = s > 0 and first[s + 1] - first[s] > 2
        _enclose(starts[first[s] : first[s + 1] if is_polygon else first[s]], boxes[s])
    for t in range(len(pose)):
        for k in range(bodies):
            if pose[t, k, THETA] == pose[t, k, THETA]:
                direction[k, X], direction[k, Y] = unit_vector(pose[t, k, THETA])
        for k in range(bodies):
            x, y, radius, shoulder = pose[t, k, X], pose[t, k, Y], sizes[0, k], sizes[1, k]
            if x != x:
                continue
            bx, by, least = direction[k, X], direction[k, Y], radius - maximum
            half_x, half_y = half_line(bx, by, shoulder)
            left_x, left_y, right_x, right_y = x + half_x, y + half_y, x - half_x, y - half_y
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
                elif gap(barriers, m, x, y) - abs(shoulder) < least:
                    depth = least - line_gap(barriers, m, left_x, left_y, right_x, right_y)
                    depths[owner[m]] = max(depths[owner[m]], depth)
            for s in range(solids):
                # Whether an end or the middle of the shoulder line is inside.
                if (
                    max(left_x, right_x) > boxes[s, 0]
                    and min(left_x, right_x) < boxes[s, 1]
                    and max(left_y, right_y) > boxes[s, 2]
                    and min(left_y, right_y) < boxes[s, 3]
                ):
                    solid = starts[first[s] : first[s + 1]]
                    beyond = min(_beyond(solid, x, y, found), _beyond(solid, left_x, left_y, found))
                    beyond = min(beyond, _beyond(solid, right_x, right_y, found))
                    if beyond < 0.0:
                        depths[s] = max(depths[s], least - beyond)
                if depths[s] > 0.0 and not (is_seat[s] and sitting[t, k]):
                    _note(worst, tick, number, k, s, depths[s], t)
            for j in range(k + 1, bodies):
                dx, dy = pose[t, j, X] - x, pose[t, j, Y] - y
                reach = least + sizes[0, j]
                if not is_disc and j == robot:
                    if length(dx, dy) < least + abs(shoulder) + circumradius:
                        place_corners(core, pose[t, j, X], pose[t, j, Y], direction[j, X], direction[j, Y], corners)
                        separate(corners, left_x, left_y, right_x, right_y, found)
                        if reach > found[DISTANCE]:
                            _note(worst, tick, number, k, solids + j, reach - found[DISTANCE], t)
                elif length(dx, dy) < reach + abs(shoulder) + abs(sizes[1, j]):
                    ahead_x, ahead_y = direction[j, X], direction[j, Y]
                    depth = reach - shoulder_line_distance(dx, dy, bx, by, shoulder, ahead_x, ahead_y, sizes[1, j])
                    if depth > 0.0:
                        _note(worst, tick, number, k, solids + j, depth, t)


@subroutine
def _enclose(corners: Array, box: Array) -> None:
    """West, east, south and north edge of points, (C, 2), m; without points nothing is within."""
    box[0], box[1], box[2], box[3] = math.inf, -math.inf, math.inf, -math.inf
    for c in range(len(corners)):
        box[0], box[1] = min(box[0], corners[c, X]), max(box[1], corners[c, X])
        box[2], box[3] = min(box[2], corners[c, Y]), max(box[3], corners[c, Y])


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
