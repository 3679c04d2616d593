"""The features of the nodes of one instant, of recorded and of running episodes."""

from __future__ import annotations

import math

import numpy as np

from ...core.compiled.kernel import kernel, subroutine
from ...core.compiled.scalar import Vector, angle_of, exp, length, unit_vector, wrap_angle
from ...core.humans import BODY_X, BODY_Y, GAZE_X, GAZE_Y, OMEGA, VX, VY, X, Y
from ...core.portable_math import PI, Array, BoolArray, IntArray
from ...record.layout import ROW_HEAD, ROW_OMEGA, ROW_THETA, ROW_VX, ROW_VY, ROW_X, ROW_Y
from .features import (
    AXIS_X,
    AXIS_Y,
    CLOSE,
    COLUMNS,
    CROWD,
    FEATURES,
    INPUTS,
    LARGEST_DISTANCE,
    LENGTH,
    MODERN_FEATURES,
    NEAR,
    POSITION_SCALE,
    RADIUS,
    SCALE,
    WIDTH,
)
from .graph import NODE_TYPES

_HUMAN, _OBJECT, _ROOM, _WALL, _GOAL = (NODE_TYPES.index(kind) for kind in ("human", "object", "room", "wall", "goal"))
_TYPES = len(NODE_TYPES)

# First columns of groups of features: of modern graphs, of the inputs of a network, of graphs of the paper.
_AGE, _POSITION, _DIRECTION, _VELOCITY, _HEAD_DIRECTION, _SIZE, _NEAREST, _GAP = (
    MODERN_FEATURES.index(name) for name in ("age", "x", "cos", "vx", "head_cos", "length", "near_x", "gap")
)
_TO_NEAREST, _TO_CENTRE, _DISTANCE, _SCALED_GAP, _TO_GOAL, _OWN_VELOCITY = (
    INPUTS.index(name) for name in ("near_x", "to_x", "distance", "gap", "goal_x", "own_vx")
)
_INSTANT, _TIME, _OF_HUMAN, _OF_OBJECT, _OF_ROOM, _OF_WALL, _OF_GOAL = (
    FEATURES.index(name)
    for name in ("is_t_0", "is_first_frame", "hum_x_pos", "obj_x_pos", "room_humans", "wall_x_pos", "goal_x_pos")
)


@kernel
def observe(
    state: Array, row: IntArray, robot_state: tuple[float, ...], humans: Array, present: BoolArray, robot: Array
) -> None:
    """Convert the state of a running episode to rows with angles, as in files.

    Args:
        state: (n, 9), pedestrians that are present; the columns of `core.humans`.
        row: (n,), index of each of them in the scene.
        robot_state: position, unit vector of the heading, velocity and turn rate.
        humans: (N, 7), written; NaN where absent.
        present: (N,), written.
        robot: (6,), written.
    """
    x, y, c, s, vx, vy, omega = robot_state
    robot[ROW_X], robot[ROW_Y], robot[ROW_THETA] = x, y, angle_of(s, c)
    robot[ROW_VX], robot[ROW_VY], robot[ROW_OMEGA] = vx, vy, omega
    for i in range(len(humans)):
        present[i] = False
        for column in range(humans.shape[1]):
            humans[i, column] = math.nan
    for k in range(len(row)):
        i = row[k]
        present[i] = True
        humans[i, ROW_X], humans[i, ROW_Y] = state[k, X], state[k, Y]
        humans[i, ROW_THETA] = angle_of(state[k, BODY_Y], state[k, BODY_X])
        humans[i, ROW_VX], humans[i, ROW_VY], humans[i, ROW_OMEGA] = state[k, VX], state[k, VY], state[k, OMEGA]
        humans[i, ROW_HEAD] = angle_of(state[k, GAZE_Y], state[k, GAZE_X])


@kernel
def modern_features(
    fixed: Array,
    goal: int,
    present: IntArray,
    humans: Array,
    radius: Array,
    shoulder: Array,
    robot: Array,
    robot_radius: float,
    origin: Array,
    age: float,
    features: Array,
) -> None:
    """Compute the features of the N nodes of one instant of a modern graph.

    Args:
        fixed: (O + 1 + M, 12), objects, goal and pieces of walls; the columns of `features`.
        goal: node of the goal, 1 + P + O.
        present: (P,), indices of the pedestrians that are nodes.
        humans: (H, 7), all pedestrians, world frame.
        radius, shoulder: (H,), of all pedestrians, m; see `Humans`.
        robot: (6,), world frame.
        robot_radius: m.
        origin: (3,), x, y, theta of the frame of reference, world frame.
        age: of the instant, s.
        features: (N, 20), written; `MODERN_FEATURES`.
    """
    people = len(present)
    cos, sin = unit_vector(origin[ROW_THETA])
    body = np.zeros(COLUMNS)
    for k in range(len(features)):
        if k > people:
            _copy(fixed[k - people - 1], body)
        else:
            _copy(robot if k == 0 else humans[present[k - 1]], body)
            size: float = robot_radius if k == 0 else radius[present[k - 1]]
            half: float = 0.0 if k == 0 else shoulder[present[k - 1]]
            body[LENGTH], body[WIDTH] = 2 * (size + max(-half, 0.0)), 2 * (size + max(half, 0.0))
            body[RADIUS] = size
            body[AXIS_X], body[AXIS_Y] = unit_vector(body[ROW_THETA])
        if k == 0:
            body[ROW_HEAD] = robot[ROW_THETA]
        row = features[k]
        for column in range(_TYPES):
            row[column] = 0.0
        row[_kind(k, people, goal)] = 1.0
        row[_AGE] = age
        row[_POSITION], row[_POSITION + 1] = _rotated(
            body[ROW_X] - origin[ROW_X], body[ROW_Y] - origin[ROW_Y], cos, sin
        )
        row[_DIRECTION], row[_DIRECTION + 1] = unit_vector(body[ROW_THETA] - origin[ROW_THETA])
        row[_VELOCITY], row[_VELOCITY + 1] = _rotated(body[ROW_VX], body[ROW_VY], cos, sin)
        row[_VELOCITY + 2] = body[ROW_OMEGA]
        row[_HEAD_DIRECTION], row[_HEAD_DIRECTION + 1] = unit_vector(body[ROW_HEAD] - origin[ROW_THETA])
        row[_SIZE], row[_SIZE + 1] = body[LENGTH], body[WIDTH]
        x, y, distance = _nearest_point(body, robot[ROW_X], robot[ROW_Y])
        row[_NEAREST], row[_NEAREST + 1] = _rotated(x - origin[ROW_X], y - origin[ROW_Y], cos, sin)
        row[_GAP] = distance - body[RADIUS] - robot_radius if k > 0 else 0.0


@subroutine
def _copy(source: Array, target: Array) -> None:
    """Copy the first elements of a row."""
    for column in range(len(source)):
        target[column] = source[column]


@subroutine
def _kind(node: int, people: int, goal: int) -> int:
    """Type of a node, by the order of `Nodes`."""
    if node <= people:
        return _HUMAN if node > 0 else _ROOM
    if node < goal:
        return _OBJECT
    return _GOAL if node == goal else _WALL


@subroutine
def _rotated(x: float, y: float, cos: float, sin: float) -> Vector:
    """A vector in axes whose x points along (cos, sin)."""
    return x * cos + y * sin, y * cos - x * sin


@subroutine
def _nearest_point(body: Array, robot_x: float, robot_y: float) -> tuple[float, float, float]:
    """The point of an outline that is nearest to the robot's centre, and the distance from the outline's core, m.

    Every outline is a core, the centre of a disc, the shoulder line of a person or a rectangle, widened by the radius.
    """
    c: float = body[AXIS_X]
    s: float = body[AXIS_Y]
    radius: float = body[RADIUS]
    half_length: float = body[LENGTH] / 2 - radius
    half_width: float = body[WIDTH] / 2 - radius
    dx, dy = robot_x - body[ROW_X], robot_y - body[ROW_Y]
    x = min(max(dx * c + dy * s, -half_length), half_length)
    y = min(max(dy * c - dx * s, -half_width), half_width)
    core_x, core_y = body[ROW_X] + (x * c - y * s), body[ROW_Y] + (x * s + y * c)
    to_x, to_y = robot_x - core_x, robot_y - core_y
    distance = length(to_x, to_y)
    scale = radius / (distance if distance > 0.0 else 1.0)
    return core_x + scale * to_x, core_y + scale * to_y, distance


@kernel
def modern_inputs(features: Array, goal: int, inputs: Array) -> None:
    """Compute the inputs of a network from the features of a modern graph in the robot's frame.

    Args:
        features: (N, 20), `MODERN_FEATURES`; the first row is the robot at the newest instant.
        goal: node of the goal at that instant.
        inputs: (N, 31), written; `INPUTS`.
    """
    for k in range(len(features)):
        row, feature = inputs[k], features[k]
        for column in range(_NEAREST):
            row[column] = feature[column]
        row[_POSITION], row[_POSITION + 1] = (
            feature[_POSITION] / POSITION_SCALE,
            feature[_POSITION + 1] / POSITION_SCALE,
        )
        row[_TO_NEAREST], row[_TO_NEAREST + 1], _ = _direction_and_length(feature[_NEAREST], feature[_NEAREST + 1])
        row[_TO_CENTRE], row[_TO_CENTRE + 1], distance = _direction_and_length(
            feature[_POSITION], feature[_POSITION + 1]
        )
        row[_DISTANCE] = distance / POSITION_SCALE
        row[_SCALED_GAP] = min(feature[_GAP], LARGEST_DISTANCE) / NEAR
        free = max(feature[_GAP], 0.0)
        row[_SCALED_GAP + 1], row[_SCALED_GAP + 2] = exp(-free / CLOSE), exp(-free / NEAR)
        x, y, distance = _direction_and_length(features[goal, _POSITION], features[goal, _POSITION + 1])
        row[_TO_GOAL], row[_TO_GOAL + 1] = x, y
        row[_TO_GOAL + 2] = min(distance, LARGEST_DISTANCE) / POSITION_SCALE
        for column in range(3):
            row[_OWN_VELOCITY + column] = features[0, _VELOCITY + column]


@subroutine
def _direction_and_length(x: float, y: float) -> tuple[float, float, float]:
    """Unit vector and length; a zero vector has the direction (0, 0)."""
    size = length(x, y)
    divisor = max(size, 1e-6)
    return x / divisor, y / divisor, size


@kernel
def paper_features(
    fixed: Array,
    goal: int,
    pieces: Array,
    present: IntArray,
    humans: Array,
    humans_before: Array,
    robot: Array,
    robot_before: Array,
    instant: int,
    is_first: float,
    tick: int,
    features: Array,
    position: Array,
) -> None:
    """Compute the features and positions of the N nodes of one instant of a graph of the paper.

    Args:
        fixed: (O + 1 + M, 12), objects, goal and pieces of walls; the columns of `features`.
        goal: node of the goal, 1 + P + O.
        pieces: (M, 4), ends of the pieces of walls, m.
        present: (P,), indices of the pedestrians that are nodes.
        humans, humans_before: (H, 7), all pedestrians, at the instant and at the tick before, world frame.
        robot, robot_before: (6,), likewise.
        instant: 0 for the newest.
        is_first: 1 if it is the first of the episode, else 0.
        tick: of the instant.
        features: (N, 42), written; `FEATURES`.
        position: (N, 2), written; m, x to the robot's right, y ahead; the room is at the robot.
    """
    people = len(present)
    cos, sin = unit_vector(robot[ROW_THETA])
    cos_before, sin_before = unit_vector(robot_before[ROW_THETA])
    for k in range(len(features)):
        row, kind = features[k], _kind(k, people, goal)
        for column in range(len(row)):
            row[column] = 0.0
        row[kind] = 1.0
        row[_INSTANT + instant] = 1.0
        row[_TIME], row[_TIME + 1] = is_first, 1.0 / (tick + 1)
        x, y = 0.0, 0.0
        if kind == _ROOM:
            crowding = people / CROWD
            row[_OF_ROOM], row[_OF_ROOM + 1] = crowding, crowding * crowding
        elif kind == _GOAL:
            node = fixed[k - people - 1]
            x, y = _right_and_ahead(node[ROW_X], node[ROW_Y], robot, cos, sin)
            _write_position(row, _OF_GOAL, 2, x, y)
        elif kind == _WALL:
            piece = pieces[k - goal - 1]
            x, y = _right_and_ahead(piece[0], piece[1], robot, cos, sin)
            end_x, end_y = _right_and_ahead(piece[2], piece[3], robot, cos, sin)
            # The unit vector (right, ahead) is the sine and cosine of the angle from straight ahead.
            size = length(end_x - x, end_y - y)
            row[_OF_WALL + 2], row[_OF_WALL + 3] = (end_x - x) / size, (end_y - y) / size
            x, y = (x + end_x) / 2, (y + end_y) / 2
            _write_position(row, _OF_WALL, 4, x, y)
        else:
            first = _OF_HUMAN if kind == _HUMAN else _OF_OBJECT
            node = humans[present[k - 1]] if kind == _HUMAN else fixed[k - people - 1]
            x, y = _right_and_ahead(node[ROW_X], node[ROW_Y], robot, cos, sin)
            angle = -wrap_angle(node[ROW_THETA] - robot[ROW_THETA] + PI / 2)
            row[first + 6], row[first + 5] = unit_vector(angle)
            if kind == _OBJECT:
                row[first + 7], row[first + 8] = node[LENGTH], node[WIDTH]
            _write_position(row, first, 7 if kind == _HUMAN else 9, x, y)
            node = humans_before[present[k - 1]] if kind == _HUMAN else fixed[k - people - 1]
            last_x, last_y = _right_and_ahead(node[ROW_X], node[ROW_Y], robot_before, cos_before, sin_before)
            turn = wrap_angle(-wrap_angle(node[ROW_THETA] - robot_before[ROW_THETA] + PI / 2) - angle)
            row[first + 2], row[first + 3], row[first + 4] = turn / SCALE, (last_x - x) / SCALE, (last_y - y) / SCALE
        position[k, 0], position[k, 1] = x, y


@subroutine
def _right_and_ahead(x: float, y: float, robot: Array, cos: float, sin: float) -> Vector:
    """A point in the frame of the robot, m, x to the right and y ahead."""
    dx, dy = x - robot[ROW_X], y - robot[ROW_Y]
    return dx * sin - dy * cos, dx * cos + dy * sin


@subroutine
def _write_position(row: Array, first: int, offset: int, x: float, y: float) -> None:
    """Write the scaled position from the column `first`, and distance and 1 - distance `offset` columns further."""
    row[first], row[first + 1] = x / SCALE, y / SCALE
    distance = length(x / SCALE, y / SCALE)
    row[first + offset], row[first + offset + 1] = distance, 1.0 - distance
