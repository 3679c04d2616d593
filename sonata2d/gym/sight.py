"""The parts in `STANDARD` of an observation, written by one kernel."""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..core.compiled.kernel import kernel, subroutine
from ..core.compiled.packing import Floats, Floats2, Ints, Ints2, unpack
from ..core.compiled.scalar import clipped, length, to_line
from ..core.entities import Furniture, Goal as EntityGoal
from ..core.geometry import Disc
from ..core.humans import BODY_X, BODY_Y, GAZE_X, GAZE_Y, OMEGA, VX, VY, X, Y
from ..core.leaves import door_frames, leaf_end
from ..core.portable_math import Array, BoolArray, IntArray
from ..core.scene import Scene
from ..core.state import HUMAN_SIZE, ROBOT_SIZE
from ..registry import furniture_type
from .parts import FARTHEST, FASTEST, FASTEST_TURN, Floats32, Goal, Humans, Objects, Robot, Rows, Walls, places

Short = Annotated[NDArray[np.float32], np.float32, 1]
Short2 = Annotated[NDArray[np.float32], np.float32, 2]


class Arrays(NamedTuple):
    """The arrays of an observation, by part."""

    robot: Short
    goal: Short
    humans: Short2
    objects: Short2
    walls: Short2
    activities: Ints
    object_types: Ints
    interactions: Ints2
    humans_mask: Short
    objects_mask: Short
    walls_mask: Short
    interactions_mask: Short


class Sight(NamedTuple):
    """The constants of an episode, the rows, and the observation.

    Attributes:
        goal: (6,), columns of `Goal`, world frame.
        bodies: (N, 2), radius and half the shoulder line of each pedestrian, m.
        objects: (M, 7), columns of `Objects`, world frame.
        object_types: (M,) of int.
        walls: (W + D, 4), columns of `Walls`, world frame; the leaves of the doors that move are the last ones.
        doors: (D, 9), see `core.leaves.door_frames`.
        rows: the entities that have rows.
        is_sorted: whether the nearest entities come first.
        robot_radius: m.
        arrays: that are written.
    """

    goal: Floats
    bodies: Floats2
    objects: Floats2
    object_types: Ints
    walls: Floats2
    doors: Floats2
    rows: Rows
    is_sorted: bool
    robot_radius: float
    arrays: Arrays


def sight_of(scene: Scene, rows: Rows, arrays: Arrays, is_sorted: bool) -> Sight:
    """The constants of a scene, with rows and arrays to write into."""
    types = [furniture_type(piece.type).number for piece in scene.furniture]
    walls = [(*wall.start, *wall.end) for wall in scene.walls]
    doors = sorted(scene.interior_doors, key=lambda door: door.moves)
    walls += [(*start, *end) for start, end, _ in (door.leaf(door.opening) for door in doors)]
    return Sight(
        goal=goal_columns(scene.goal),
        bodies=np.array([(human.radius, human.shoulder) for human in scene.humans], dtype=float).reshape(-1, 2),
        objects=np.array([_object_row(piece) for piece in scene.furniture], dtype=float).reshape(-1, 7),
        object_types=np.array(types, dtype=np.int64),
        walls=np.array(walls, dtype=float).reshape(-1, 4),
        doors=door_frames(scene.moving_doors, scene.rules.dt),
        rows=rows,
        is_sorted=is_sorted,
        robot_radius=scene.robot.radius,
        arrays=arrays,
    )


def goal_columns(goal: EntityGoal) -> Array:
    """(6,), columns of `Goal`, world frame."""
    heading = (math.cos(goal.theta), math.sin(goal.theta))
    return np.array([goal.x, goal.y, *heading, min(goal.distance, FARTHEST), goal.angle], dtype=float)


def _object_row(piece: Furniture) -> tuple[float, ...]:
    """Columns of `Objects`, world frame."""
    shape, pose, is_disc = piece.shape, piece.pose, isinstance(piece.shape, Disc)
    length, width = shape.sides
    return *pose.position, *pose.direction, min(length, FARTHEST), min(width, FARTHEST), float(is_disc)


@kernel
def write_observation(
    packed_sight: Any, row: Array, is_present: BoolArray, activity: IntArray, links: IntArray, link_count: int,
    time: float,
) -> None:  # fmt: skip
    """Write all arrays of an observation.

    Args:
        packed_sight: packed `Sight`.
        row: of a `State`.
        is_present: (N,), pedestrians that are in the room.
        activity: (N,) of int, into `ACTIVITIES`.
        links: (K, 3), source, destination, relation; indices of entities, pedestrians first.
        link_count: number of links.
        time: fraction of the time limit that is over.
    """
    sight = unpack(packed_sight, Sight)
    arrays, rows = sight.arrays, sight.rows
    _clear(arrays)
    first = len(sight.walls) - len(sight.doors)
    for d in range(len(sight.doors)):
        end_x, end_y = leaf_end(sight.doors, d, row[len(row) - len(sight.doors) + d])
        sight.walls[first + d, 2], sight.walls[first + d, 3] = end_x, end_y
    _choose_rows(sight, row, is_present, links, link_count)
    _fill_robot(row, sight.robot_radius, time, arrays.robot)
    _fill_goal(row, sight.goal, arrays.goal)
    _fill_humans(row, sight.bodies, rows.humans, arrays.humans)
    _fill_objects(row, sight.objects, rows.objects, arrays.objects)
    _fill_walls(row, sight.walls, rows.walls, arrays.walls)
    _pick(activity, rows.humans, arrays.activities)
    _pick(sight.object_types, rows.objects, arrays.object_types)


@subroutine
def _clear(arrays: Arrays) -> None:
    """Set all rows of tables, and all masks, to 0."""
    for table in (arrays.humans, arrays.objects, arrays.walls):
        for n in range(len(table)):
            for column in range(table.shape[1]):
                table[n, column] = 0.0
    for n in range(len(arrays.interactions)):
        arrays.interactions[n, 0] = arrays.interactions[n, 1] = arrays.interactions[n, 2] = 0
    for mask in (arrays.humans_mask, arrays.objects_mask, arrays.walls_mask, arrays.interactions_mask):
        for n in range(len(mask)):
            mask[n] = 0.0
    for index in (arrays.activities, arrays.object_types):
        for n in range(len(index)):
            index[n] = 0


@subroutine
def _choose_rows(sight: Sight, row: Array, is_present: BoolArray, links: IntArray, link_count: int) -> None:
    """Choose the entities that have rows, and write `Rows` and the masks; see `write_observation`."""
    scene, arrays, x, y, is_sorted = sight, sight.arrays, row[X], row[Y], sight.is_sorted
    human_rows, object_rows, wall_rows = scene.rows.humans, scene.rows.objects, scene.rows.walls
    humans, objects, walls = len(is_present), len(scene.objects), len(scene.walls)
    distance = np.empty(max(len(human_rows), len(object_rows), len(wall_rows)))

    count = 0
    keeps_rows = not is_sorted and humans <= len(human_rows)
    for k in range(humans):
        if keeps_rows:  # the row of an absent pedestrian stays empty
            human_rows[k], count = k if is_present[k] else -1, k + 1
        elif is_present[k]:
            at = ROBOT_SIZE + HUMAN_SIZE * k
            count = _insert(human_rows, distance, count, k, length(row[at + X] - x, row[at + Y] - y))
    if not keeps_rows:
        _arrange(human_rows, count, is_sorted)
    _finish(human_rows, count, arrays.humans_mask)

    count = 0
    for k in range(objects):
        away = length(scene.objects[k, 0] - x, scene.objects[k, 1] - y)
        count = _insert(object_rows, distance, count, k, away)
    _arrange(object_rows, count, is_sorted)
    _finish(object_rows, count, arrays.objects_mask)

    count, visible_part = 0, np.empty(4, np.float32)
    for k in range(walls):
        wall = scene.walls[k]
        if put_wall(visible_part, wall, row):  # else all of it is too far away
            along_x, along_y = wall[2] - wall[0], wall[3] - wall[1]
            square = max(along_x * along_x + along_y * along_y, 1e-12)
            to_x, to_y = to_line(x - wall[0], y - wall[1], along_x, along_y, 1.0 / square)
            count = _insert(wall_rows, distance, count, k, length(to_x, to_y))
    _arrange(wall_rows, count, is_sorted)
    _finish(wall_rows, count, arrays.walls_mask)

    slot = np.full(humans + objects, -1, np.int64)  # row of each entity; objects follow the rows of pedestrians
    for n in range(len(human_rows)):
        if human_rows[n] >= 0:
            slot[human_rows[n]] = n
    for n in range(len(object_rows)):
        if object_rows[n] >= 0:
            slot[humans + object_rows[n]] = len(human_rows) + n
    table, mask, count = arrays.interactions, arrays.interactions_mask, 0
    for k in range(link_count):
        source, destination = slot[links[k, 0]], slot[links[k, 1]]
        if source >= 0 and destination >= 0 and count < len(mask):
            table[count, 0], table[count, 1], table[count, 2] = source, links[k, 2], destination
            mask[count] = 1.0
            count += 1


@subroutine
def _insert(rows: IntArray, distance: Array, count: int, k: int, away: float) -> int:
    """Insert entity k at a distance, m, into the nearest ones, ordered by distance; returns their number.

    Args:
        rows: indices of the entities; the first `count` are taken.
        distance: of these, m.
    """
    if count == len(rows):
        if not away < distance[count - 1]:
            return count
        count -= 1
    n = count
    while n > 0 and away < distance[n - 1]:
        rows[n], distance[n] = rows[n - 1], distance[n - 1]
        n -= 1
    rows[n], distance[n] = k, away
    return count + 1


@subroutine
def _arrange(rows: IntArray, count: int, is_sorted: bool) -> None:
    """Put the first `count` entities into the order of the scene, unless they stay sorted by distance."""
    for n in range(1, 0 if is_sorted else count):
        k, m = rows[n], n
        while m > 0 and rows[m - 1] > k:
            rows[m] = rows[m - 1]
            m -= 1
        rows[m] = k


@subroutine
def _finish(rows: IntArray, count: int, mask: Floats32) -> None:
    """Mark the rows beyond `count` as empty, and write the mask."""
    for n in range(len(rows)):
        if n >= count:
            rows[n] = -1
        if rows[n] >= 0:
            mask[n] = 1.0


# First columns of the vectors, and the other columns, by part.
_VELOCITY, _TURN_RATE, _ROBOT_RADIUS, _TIME = places(Robot, "vx", "omega", "radius", "time")
_GOAL_POINT, _GOAL_HEADING, _DISTANCE, _ANGLE = places(Goal, "x", "cos", "distance", "angle")
_HUMAN_POINT, _HUMAN_VELOCITY, _BODY, _GAZE, _HUMAN_OMEGA, _RADIUS, _SHOULDER = places(
    Humans, "x", "vx", "cos", "gaze_cos", "omega", "radius", "shoulder"
)
_OBJECT_POINT, _OBJECT_DIRECTION, _LENGTH = places(Objects, "x", "cos", "length")
_START, _END = places(Walls, "start_x", "end_x")

# The subroutines take the `row` of a `State`, which begins with the robot's pose.


@subroutine
def _fill_robot(row: Array, radius: float, time: float, out: Floats32) -> None:
    _put_vector(out, _VELOCITY, row[VX], row[VY], row, FASTEST)
    out[_TURN_RATE] = clipped(row[OMEGA], -FASTEST_TURN, FASTEST_TURN)
    out[_ROBOT_RADIUS], out[_TIME] = radius, time


@subroutine
def _fill_goal(row: Array, goal: Array, out: Floats32) -> None:
    _put_point(out, _GOAL_POINT, goal[_GOAL_POINT], goal[_GOAL_POINT + 1], row)
    _put_vector(out, _GOAL_HEADING, goal[_GOAL_HEADING], goal[_GOAL_HEADING + 1], row, 1.0)
    out[_DISTANCE], out[_ANGLE] = goal[_DISTANCE], goal[_ANGLE]


@subroutine
def _fill_humans(row: Array, bodies: Array, index: IntArray, out: Floats32) -> None:
    for n in range(len(index)):
        k = index[n]
        if k < 0:
            continue
        human, target = row[ROBOT_SIZE + HUMAN_SIZE * k : ROBOT_SIZE + HUMAN_SIZE * (k + 1)], out[n]
        _put_point(target, _HUMAN_POINT, human[X], human[Y], row)
        _put_vector(target, _HUMAN_VELOCITY, human[VX], human[VY], row, FASTEST)
        _put_vector(target, _BODY, human[BODY_X], human[BODY_Y], row, 1.0)
        _put_vector(target, _GAZE, human[GAZE_X], human[GAZE_Y], row, 1.0)
        target[_HUMAN_OMEGA] = clipped(human[OMEGA], -FASTEST_TURN, FASTEST_TURN)
        target[_RADIUS], target[_SHOULDER] = bodies[k, 0], bodies[k, 1]


@subroutine
def _fill_objects(row: Array, objects: Array, index: IntArray, out: Floats32) -> None:
    for n in range(len(index)):
        if index[n] < 0:
            continue
        piece, target = objects[index[n]], out[n]
        _put_point(target, _OBJECT_POINT, piece[_OBJECT_POINT], piece[_OBJECT_POINT + 1], row)
        _put_vector(target, _OBJECT_DIRECTION, piece[_OBJECT_DIRECTION], piece[_OBJECT_DIRECTION + 1], row, 1.0)
        for column in range(_LENGTH, len(piece)):
            target[column] = piece[column]


@subroutine
def _fill_walls(row: Array, walls: Array, index: IntArray, out: Floats32) -> None:
    for n in range(len(index)):
        if index[n] >= 0:
            put_wall(out[n], walls[index[n]], row)


@subroutine
def _pick(values: IntArray, index: IntArray, out: IntArray) -> None:
    """Write the value of the entity of each row."""
    for n in range(len(index)):
        if index[n] >= 0:
            out[n] = values[index[n]]


@subroutine
def _put_point(out: Floats32, at: int, x: float, y: float, row: Array) -> None:
    """Write a point in the robot's frame, m."""
    _put_vector(out, at, x - row[X], y - row[Y], row, FARTHEST)


@subroutine
def _put_vector(out: Floats32, at: int, x: float, y: float, row: Array, limit: float) -> None:
    """Write a vector along the robot's axes, shortened so that no component exceeds a limit."""
    ahead, left = x * row[BODY_X] + y * row[BODY_Y], y * row[BODY_X] - x * row[BODY_Y]
    factor = limit / max(abs(ahead), abs(left), limit)
    out[at], out[at + 1] = clipped(ahead * factor, -limit, limit), clipped(left * factor, -limit, limit)


@subroutine
def put_wall(out: Floats32, wall: Array, row: Array) -> bool:
    """Write the part of a wall whose coordinates in the robot's frame do not exceed `FARTHEST`; False if all do.

    Source: Y.-D. Liang & B. Barsky, ACM Trans. Graph. 3 (1984) 1: clipping of lines.
    """
    x, y, c, s = row[X], row[Y], row[BODY_X], row[BODY_Y]
    start_x, start_y = (wall[0] - x) * c + (wall[1] - y) * s, (wall[1] - y) * c - (wall[0] - x) * s
    dx, dy = (wall[2] - x) * c + (wall[3] - y) * s - start_x, (wall[3] - y) * c - (wall[2] - x) * s - start_y
    first, last = 0.0, 1.0
    for start, change in ((start_x, dx), (start_y, dy)):
        for side in (-1.0, 1.0):
            room, approach = FARTHEST - side * start, side * change
            if approach == 0.0:
                if room < 0.0:
                    return False
            elif approach > 0.0:
                last = min(last, room / approach)
            else:
                first = max(first, room / approach)
    if first > last:
        return False
    for at, part in ((_START, first), (_END, last)):
        out[at] = clipped(start_x + part * dx, -FARTHEST, FARTHEST)
        out[at + 1] = clipped(start_y + part * dy, -FARTHEST, FARTHEST)
    return True
