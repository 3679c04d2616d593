"""Narrow passages: pedestrians do not enter a door or a gap in which others walk the other way; they wait beside it.

One direction has the right of way. It keeps it while those who walk that way follow each other closely, until others
have waited for `PATIENCE`. So the direction alternates, as Helbing & Molnár (Phys. Rev. E 51 (1995) 4282, section III)
describe it for two crowds at a door; the rules and figures are ours.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ...core.compiled import kernel, subroutine
from ...core.humans import X, Y
from ...core.packing import Floats, Floats2, Ints, Ints2
from ...core.portable_math import Array, BoolArray
from ...core.scalar import END_X, RADIUS, START_X, gap, is_inside, length, towards
from ...core.scene import Scene
from .models.base import Walkers
from .routes import Routes

NARROWEST, WIDEST = 0.3, 1.1  # m: one person passes, and two do not pass each other comfortably
ROOM_AHEAD, ROOM = 0.8, 0.6  # m: on both sides of a passage there is a free circle of this radius at this distance
SAME_PLACE = 0.5  # m, between the middles of two passages, below which they are one
RANGE = 3.0  # m, in which pedestrians consider a passage
INSIDE, CLAIM = 0.45, 1.5  # m, from the middle of a passage: those who are in it, and those who claim it
PATIENCE = 6.0  # s, for which one direction waits for the other
WAITING_DISTANCE = 1.1  # m, from the middle of a passage
LANE, LANE_LENGTH = 0.55, 2.2  # m, half the width and the length of what is kept free for those who come out
STEP_ASIDE = 0.5  # m/s
BRAKING = 0.8  # m/s^2


class Passages(NamedTuple):
    """All narrow passages of a scene, for kernels.

    Attributes:
        frame: (G, 5), x and y of the middle, m, unit vector across the passage, and half its width, m.
        holder: (G,) of int, direction with the right of way: 1 to the left of the vector across, -1 to the right; 0.
        waited: (G,), for which the other direction has been waiting, s.
        way: (G, N) of int, direction in which each pedestrian is about to pass, or passes; 0 if it does not.
        distance: (G, N), of each pedestrian from the passage, m; 0 behind it.
    """

    frame: Floats2
    holder: Ints
    waited: Floats
    way: Ints2
    distance: Floats2


def find_passages(scene: Scene) -> Passages:
    """The narrow passages between walls and furniture that have room for those who wait on both sides."""
    barriers, outline = scene.barriers.table, scene.outline
    edges = np.concatenate((outline, np.roll(outline, -1, axis=0)), axis=1)
    frame = np.zeros((2 * len(barriers), 5))
    count = _find(barriers, edges, frame)
    shape = count, len(scene.humans)
    return Passages(
        frame[:count].copy(), np.zeros(count, dtype=np.int64), np.zeros(count), np.zeros(shape, dtype=np.int64),
        np.zeros(shape),
    )  # fmt: skip


@kernel
def _find(barriers: Array, edges: Array, frame: Array) -> int:
    """Fill the rows of `Passages.frame` and return their number; every passage begins at an end of a barrier."""
    count = 0
    for k in range(len(barriers)):
        for column in (START_X, END_X):
            x, y = barriers[k, column], barriers[k, column + 1]
            for j in range(len(barriers)):
                dx, dy = towards(barriers, j, x, y)
                size = max(length(dx, dy), 1e-6)
                width = size - barriers[k, RADIUS] - barriers[j, RADIUS]
                if not NARROWEST < width < WIDEST or count == len(frame):
                    continue
                ux, uy, middle = dx / size, dy / size, barriers[k, RADIUS] + 0.5 * width
                mx, my = x + ux * middle, y + uy * middle
                if _is_passage(barriers, edges, mx, my, ux, uy, width) and not _is_known(frame[:count], mx, my):
                    row = frame[count]
                    row[0], row[1], row[2], row[3], row[4] = mx, my, ux, uy, 0.5 * width
                    count += 1
    return count


@subroutine
def _is_passage(barriers: Array, edges: Array, x: float, y: float, ux: float, uy: float, width: float) -> bool:
    """Whether a circle round (x, y), as wide as the gap, is free, and so are larger ones on both sides of it."""
    dx, dy = -uy * ROOM_AHEAD, ux * ROOM_AHEAD
    for k in range(len(barriers)):
        if gap(barriers, k, x, y) < 0.5 * width - 1e-6:
            return False
        if min(gap(barriers, k, x + dx, y + dy), gap(barriers, k, x - dx, y - dy)) < ROOM:
            return False
    return is_inside(edges, x, y)


@subroutine
def _is_known(frame: Array, x: float, y: float) -> bool:
    """Whether a passage was found near (x, y) already, as from the other one of its two ends."""
    for n in range(len(frame)):
        if length(frame[n, 0] - x, frame[n, 1] - y) < SAME_PLACE:
            return True
    return False


@subroutine
def give_way(
    passages: Passages, routes: Routes, walkers: Walkers, humans: Array, is_present: BoolArray, side: float, dt: float
) -> None:
    """Let pedestrians wait beside passages in which others have the right of way.

    Args:
        passages: updated.
        routes: of the pedestrians.
        walkers: desired directions and speeds of those who wait are changed.
        humans: (N, 9), columns of `core.humans`.
        is_present: (N,).
        side: of the rules, +1 or -1: to which those step who wait right in front of a passage.
        dt: tick, s.
    """
    for g in range(len(passages.holder)):
        _find_ways(passages, g, routes, walkers, humans, is_present)
        _choose_holder(passages, g, dt)
        for k in range(len(humans)):
            way, holder = passages.way[g, k], passages.holder[g]
            has_way = way * holder > 0 and passages.waited[g] <= PATIENCE
            if way * holder != 0 and not has_way and passages.distance[g, k] > INSIDE:
                _wait(passages, g, k, walkers, humans, side)
                routes.checkpoint[k, 0] = math.nan  # it makes no progress, but is not stuck


@subroutine
def _find_ways(
    passages: Passages, g: int, routes: Routes, walkers: Walkers, humans: Array, is_present: BoolArray
) -> None:
    """Find who is about to walk through passage g, who is in it, and in which direction."""
    mx, my, ux, uy = passages.frame[g, 0], passages.frame[g, 1], passages.frame[g, 2], passages.frame[g, 3]
    half = passages.frame[g, 4]
    for k in range(len(humans)):
        passages.way[g, k] = 0
        x, y = humans[k, X] - mx, humans[k, Y] - my
        if not is_present[k] or not walkers.walks[k] or x * x + y * y > RANGE * RANGE:
            continue
        aside, ahead = x * ux + y * uy, y * ux - x * uy
        passages.distance[g, k] = length(x, y)
        last_aside, last_ahead = aside, ahead
        for n in range(max(routes.next[k], 0), min(routes.next[k] + 3, routes.length[k])):
            x, y = routes.path[k, n, 0] - mx, routes.path[k, n, 1] - my
            next_aside, next_ahead = x * ux + y * uy, y * ux - x * uy
            if last_ahead * next_ahead < 0.0:
                part = last_ahead / (last_ahead - next_ahead)
                if abs(last_aside + part * (next_aside - last_aside)) < half:
                    passages.way[g, k] = 1 if next_ahead > 0.0 else -1
                    break
            last_aside, last_ahead = next_aside, next_ahead
        if passages.way[g, k] == 0 and abs(ahead) < INSIDE and abs(aside) < half:
            along = walkers.desired_direction[k, 1] * ux - walkers.desired_direction[k, 0] * uy
            if along * ahead > 0.0:
                passages.way[g, k], passages.distance[g, k] = 1 if ahead > 0.0 else -1, 0.0


@subroutine
def _choose_holder(passages: Passages, g: int, dt: float) -> None:
    """Keep the right of way, or give it to the direction whose first walker is nearest."""
    left, right, first = math.inf, math.inf, 0
    for k in range(passages.way.shape[1]):
        distance = passages.distance[g, k]
        if passages.way[g, k] > 0:
            if distance < min(left, right):
                first = 1
            left = min(left, distance)
        elif passages.way[g, k] < 0:
            if distance < min(left, right):
                first = -1
            right = min(right, distance)
    holder = passages.holder[g]
    own, other = (left, right) if holder > 0 else (right, left)
    if holder != 0:
        passages.waited[g] = passages.waited[g] + dt if other < 2.0 * CLAIM else 0.0
        if passages.waited[g] > PATIENCE and own > INSIDE:
            passages.holder[g], passages.waited[g] = -holder, 0.0
            return
        if own < CLAIM:
            return
    passages.waited[g] = 0.0
    passages.holder[g] = first if min(left, right) < CLAIM else 0


@subroutine
def _wait(passages: Passages, g: int, k: int, walkers: Walkers, humans: Array, side: float) -> None:
    """Let pedestrian k come no closer to passage g, and step out of the way of those who come out."""
    mx, my, ux, uy = passages.frame[g, 0], passages.frame[g, 1], passages.frame[g, 2], passages.frame[g, 3]
    x, y = humans[k, X] - mx, humans[k, Y] - my
    aside, ahead = x * ux + y * uy, y * ux - x * uy
    distance = max(passages.distance[g, k], 1e-6)
    rest = max(distance - WAITING_DISTANCE, 0.0)
    speed, limit = walkers.desired_speed[k], math.sqrt(2.0 * BRAKING * rest)
    if abs(aside) < LANE and distance < LANE_LENGTH:
        # The side of the rules is that of a walker who faces the passage.
        outwards = -side * ahead if aside == 0.0 else aside
        outwards = 1.0 if outwards > 0.0 else -1.0
        # Besides, it approaches if it is still far.
        dx, dy = outwards * ux - min(rest, 1.0) * x / distance, outwards * uy - min(rest, 1.0) * y / distance
        size = max(length(dx, dy), 1e-6)
        walkers.desired_direction[k, 0], walkers.desired_direction[k, 1] = dx / size, dy / size
        limit = max(limit, STEP_ASIDE)
    walkers.desired_speed[k] = min(speed, limit)
