"""Overlaps of outlines in a recorded episode."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ...core.compiled.kernel import kernel, subroutine
from ...core.compiled.scalar import gap, length, line_gap, shoulder_line_distance
from ...core.geometry import Barriers, Disc
from ...core.humans import X, Y
from ...core.portable_math import Array, BoolArray, IntArray, unit_vectors
from ...core.relations import ACTIVITIES
from ...record.motion import THETA
from ...record.record import EpisodeRecord

_SITTING = ACTIVITIES.index("sitting")  # also while a pedestrian sits down and gets up
# Columns of the solids: centre, direction of the length, and half of length and width of a rectangle, or -1.
_COS, _SIN, _HALF_LENGTH, _HALF_WIDTH = 2, 3, 4, 5


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
    sizes = np.array([[*table.radius, scene.robot.radius], [*table.shoulder, 0.0]])
    solids = [thing for thing in scene.furniture if thing.on is None]  # bodies do not collide with things on a table
    edges = [[(wall.start, wall.end, 0.0) for wall in scene.straight_walls.values()]]
    edges += [thing.shape.edges(thing.pose) for thing in solids]
    owner = np.repeat(np.arange(len(edges)), [len(own) for own in edges])
    frames = np.full((len(edges), 6), -1.0)
    for row, thing in zip(frames[1:], solids, strict=True):
        row[: _SIN + 1] = *thing.pose.position, *thing.pose.direction
        if not isinstance(thing.shape, Disc):
            row[_HALF_LENGTH:] = thing.shape.length / 2, thing.shape.width / 2
    is_seat = np.array([False, *(thing.is_seat for thing in solids)])
    sitting = np.zeros(position.shape[:2], dtype=bool)
    sitting[:, :count] = states.activity == _SITTING
    shape = count + 1, len(edges) + count + 1
    worst, tick, number = np.zeros(shape), np.zeros(shape, dtype=np.int64), np.zeros(shape, dtype=np.int64)
    _find_depths(
        np.ascontiguousarray(position), unit_vectors(rows[..., THETA]), sizes,
        Barriers.of(edge for own in edges for edge in own).table.copy(), owner, frames, is_seat, sitting,
        float(maximum), worst, tick, number,
    )  # fmt: skip
    names = [*(f"human {human.id}" for human in scene.humans), "the robot"]
    things = ["a wall", *(f"{thing.type} {thing.id}" for thing in solids), *names]
    sections = ["walls"] + ["objects"] * len(solids) + ["humans"] * len(names)
    for k, n in np.argwhere(number > 0).tolist():
        ticks = f" (the worst of {number[k, n]} ticks)" if number[k, n] > 1 else ""
        yield int(tick[k, n]), sections[n], names[k], f"{worst[k, n]:.3f} m too deep in {things[n]}{ticks}"


@kernel
def _find_depths(
    position: Array, direction: Array, sizes: Array, barriers: Array, owner: IntArray, frames: Array,
    is_seat: BoolArray, sitting: BoolArray, maximum: float, worst: Array, tick: IntArray, number: IntArray,
) -> None:  # fmt: skip
    """Find how deep K bodies are in S solids and in one another, beyond the maximum.

    Args:
        position, direction: (T, K, 2), m, NaN where a body is left out, and unit vectors of the headings.
        sizes: (2, K), m, radii and halves of the shoulder lines.
        barriers, owner: (M, 8) and (M,), edges of the solids, and the index of each one's solid.
        frames: (S, 6), see above.
        is_seat, sitting: (S,) and (T, K) of bool; who sits may overlap seats.
        maximum: m.
        worst, tick, number: (K, S + K), m, the worst depth, its tick, and the number of ticks; are filled.
    """
    solids = len(frames)
    depths = np.empty(solids)
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
            for m in range(len(barriers)):
                if gap(barriers, m, x, y) - shoulder < least:
                    depth = least - line_gap(barriers, m, left_x, left_y, right_x, right_y)
                    depths[owner[m]] = max(depths[owner[m]], depth)
            for s in range(solids):
                if frames[s, _HALF_LENGTH] >= 0.0:
                    # an end or the middle of the shoulder line is inside
                    inside = min(
                        _beyond(frames, s, x, y),
                        _beyond(frames, s, left_x, left_y),
                        _beyond(frames, s, right_x, right_y),
                    )
                    if inside < 0.0:
                        depths[s] = max(depths[s], least - inside)
                if depths[s] > 0.0 and not (is_seat[s] and sitting[t, k]):
                    _note(worst, tick, number, k, s, depths[s], t)
            for j in range(k + 1, position.shape[1]):
                dx, dy = position[t, j, X] - x, position[t, j, Y] - y
                reach = least + sizes[0, j]
                if length(dx, dy) < reach + shoulder + sizes[1, j]:
                    other_bx, other_by = direction[t, j, X], direction[t, j, Y]
                    depth = reach - shoulder_line_distance(dx, dy, bx, by, shoulder, other_bx, other_by, sizes[1, j])
                    if depth > 0.0:
                        _note(worst, tick, number, k, solids + j, depth, t)


@subroutine
def _beyond(frames: Array, s: int, x: float, y: float) -> float:
    """Distance from a point to the sides of a rectangle, m; negative inside."""
    dx, dy = x - frames[s, X], y - frames[s, Y]
    along, across = dx * frames[s, _COS] + dy * frames[s, _SIN], dy * frames[s, _COS] - dx * frames[s, _SIN]
    return float(max(abs(along) - frames[s, _HALF_LENGTH], abs(across) - frames[s, _HALF_WIDTH]))


@subroutine
def _note(worst: Array, tick: IntArray, number: IntArray, k: int, n: int, depth: float, t: int) -> None:
    number[k, n] += 1
    if depth > worst[k, n]:
        worst[k, n], tick[k, n] = depth, t
