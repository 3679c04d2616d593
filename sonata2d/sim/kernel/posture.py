"""Turning of bodies and heads towards their targets, with the dynamics of `core.turning`.

A head compensates the turn of its body, so that the gaze stays on its target.
"""

from __future__ import annotations

import math

from ...core.compiled.kernel import subroutine
from ...core.compiled.scalar import Vector, angle_of, clipped, rotation
from ...core.humans import BODY_X, BODY_Y, GAZE_X, GAZE_Y, OMEGA, VX, VY
from ...core.portable_math import PI, Array
from ...core.turning import BODY_TURN, critically_damped, turn_limits

HEAD_TURN = 4.5  # rad/s, maximum turn rate of a head relative to the body
HEAD_LIMIT = 1.2  # rad, maximum angle of a head to either side of the body's heading
HEAD_RATE = 10.0  # 1/s
ABOUT_TURN = 2.8  # rad; towards a target angle beyond it, a turn that has begun continues to the same side
TURNING = 0.2  # rad/s (of a head: rad); above it a turn has begun
_MAX_ROTATION = 0.45  # rad, up to which `rotation` is accurate enough

# Columns of the (N, 3) postures: turn rates at the end of the tick, rad/s, and angle of the head from the body, rad.
BODY_RATE, NECK_RATE, NECK = range(3)


@subroutine
def turn(state: Array, posture: Array, k: int, facing: Array, gaze: Array, side: float, dt: float) -> None:
    """Turn body and head of pedestrian k by one tick.

    Args:
        state: (N, 9), columns of `core.humans`; position and velocity at the start of the tick, the rest is updated.
        posture: (N, 3), is updated.
        k: index of the pedestrian.
        facing, gaze: (N, 2), unit vectors of the target headings and gazes, world frame.
        side: to which bodies turn about: 1 to the right, -1 to the left.
        dt: tick, s.
    """
    vx, vy, x, y = state[k, VX], state[k, VY], state[k, BODY_X], state[k, BODY_Y]
    rate, limit = turn_limits(math.sqrt(vx * vx + vy * vy))
    to_facing = _angle_between(x, y, facing[k, 0], facing[k, 1], side)
    to_gaze = _angle_between(x, y, gaze[k, 0], gaze[k, 1], side)
    remaining = _same_side(to_facing, posture[k, BODY_RATE])
    turned, posture[k, BODY_RATE] = critically_damped(remaining, posture[k, BODY_RATE], rate, limit, dt)
    x, y = _rotated(x, y, turned, BODY_TURN * dt)
    _turn_head(posture, k, turned, to_gaze - turned, dt)
    state[k, BODY_X], state[k, BODY_Y], state[k, OMEGA] = x, y, turned / dt
    state[k, GAZE_X], state[k, GAZE_Y] = _rotated(x, y, posture[k, NECK], HEAD_LIMIT)


@subroutine
def _turn_head(posture: Array, k: int, body_turned: float, target: float, dt: float) -> None:
    """Turn the head of pedestrian k towards a target angle relative to its body, which has just turned; rad."""
    before = posture[k, NECK]
    if target > PI:
        target -= 2.0 * PI
    elif target <= -PI:
        target += 2.0 * PI
    target = clipped(_same_side(target, before), -HEAD_LIMIT, HEAD_LIMIT)
    steady = before - body_turned  # the angle that keeps the gaze where it is
    step, rate = critically_damped(target - steady, posture[k, NECK_RATE], HEAD_RATE, HEAD_TURN, dt)
    maximum = HEAD_TURN * dt
    neck = clipped(before + clipped(steady + step - before, -maximum, maximum), -HEAD_LIMIT, HEAD_LIMIT)
    posture[k, NECK] = neck
    posture[k, NECK_RATE] = rate if abs(neck) < HEAD_LIMIT else 0.0


@subroutine
def _same_side(angle: float, turning: float) -> float:
    """The angle to a target, by the longer side where that is hardly longer and a turn to that side has begun.

    Without this, a target just past half a turn would reverse a turn in progress.
    """
    if abs(angle) > ABOUT_TURN and angle * turning < 0.0 and abs(turning) > TURNING:
        return angle - 2.0 * PI if angle > 0.0 else angle + 2.0 * PI
    return angle


@subroutine
def _angle_between(x: float, y: float, target_x: float, target_y: float, side: float) -> float:
    """Angle from a unit vector to a target, rad; to an opposite one, to the right for side 1, to the left for -1."""
    c = x * target_x + y * target_y
    s = x * target_y - y * target_x
    if s == 0.0 and c < 0.0:
        return -side * PI
    return angle_of(s, c)


@subroutine
def _rotated(x: float, y: float, angle: float, maximum: float) -> Vector:
    """A unit vector rotated by an angle of at most `maximum`, rad, in steps where `rotation` is accurate."""
    steps = math.floor(maximum / _MAX_ROTATION) + 1
    c, s = rotation(angle / steps)
    for _ in range(steps):
        x, y = x * c - y * s, x * s + y * c
    norm = math.sqrt(x * x + y * y)
    return x / norm, y / norm
