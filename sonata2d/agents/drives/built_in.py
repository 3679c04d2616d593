"""The built-in drives besides holonomic and unicycle, which have no parameters."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np
from annotated_types import Ge, Gt, Le, MultipleOf

from ...core.bounds import NotNegative, Positive
from ...core.compiled.kernel import kernel, subroutine
from ...core.compiled.scalar import angle_of, clipped, unit_vector
from ...core.portable_math import PI, Array
from .base import TURN, Drive, limit_speeds

_STEERING = 0  # item of the memory of a bicycle, rad
_SLOWEST = 0.02  # m/s, at which the curve of a bicycle says where its wheels point


@kernel
def _limit_to_limits(parameters: Array, limits: Array, memory: Array, now: Array, command: Array, dt: float) -> None:
    limit_speeds(limits, now, command, dt)


@dataclass(frozen=True)
class Holonomic(Drive):
    """Moves in every direction, within `Limits`."""

    moves_sideways: ClassVar[bool] = True
    kernel: ClassVar[Any] = _limit_to_limits


@kernel
def _limit_unicycle(parameters: Array, limits: Array, memory: Array, now: Array, command: Array, dt: float) -> None:
    command[1] = 0.0
    limit_speeds(limits, now, command, dt)


@dataclass(frozen=True)
class Unicycle(Drive):
    """Moves along its heading and turns, within `Limits`, of which each holds by itself."""

    kernel: ClassVar[Any] = _limit_unicycle


@kernel
def _limit_wheels(parameters: Array, limits: Array, memory: Array, now: Array, command: Array, dt: float) -> None:
    half, speed, acceleration = parameters[0] / 2.0, parameters[1], parameters[2]
    command[1] = 0.0
    limit_speeds(limits, now, command, dt)
    left, right = command[0] - command[2] * half, command[0] + command[2] * half
    fastest = max(abs(left), abs(right))
    if fastest > speed:  # both wheels lose the same fraction, so that the curve stays the same
        left, right = left * (speed / fastest), right * (speed / fastest)
    now_left, now_right = now[0] - now[2] * half, now[0] + now[2] * half
    change, most = max(abs(left - now_left), abs(right - now_right)), acceleration * dt
    if change > most:
        left = now_left + (left - now_left) * (most / change)
        right = now_right + (right - now_right) * (most / change)
    command[0], command[2] = (left + right) / 2.0, (right - left) / (2.0 * half)


@dataclass(frozen=True)
class Differential(Drive):
    """Two wheels on one axle, through the centre, with a motor each.

    Attributes:
        track: distance of the wheels, m.
        wheel_speed: largest speed of a wheel over the ground, m/s.
        wheel_acceleration: largest acceleration of a wheel, m/s².
    """

    track: Positive = 0.4
    wheel_speed: Positive = 1.0
    wheel_acceleration: Positive = 1.5
    kernel: ClassVar[Any] = _limit_wheels


@subroutine
def _wheel(axis_x: float, axis_y: float, reach: float, twist: Array) -> float:
    """Speed of an omnidirectional wheel, m/s.

    Args:
        axis_x, axis_y: unit vector from the centre to the wheel, body frame.
        reach: distance of the wheel from the centre, m.
        twist: (3,).
    """
    return float(axis_x * twist[1] - axis_y * twist[0] + reach * twist[2])


@kernel
def _limit_omni(parameters: Array, limits: Array, memory: Array, now: Array, command: Array, dt: float) -> None:
    wheels, reach, speed = int(parameters[0]), parameters[1], parameters[2]
    most = parameters[3] * dt
    limit_speeds(limits, now, command, dt)
    fastest = 0.0
    for n in range(wheels):
        x, y = unit_vector(PI * (2.0 * n + 1.0) / wheels)
        fastest = max(fastest, abs(_wheel(x, y, reach, command)))
    if fastest > speed:
        for axis in range(3):
            command[axis] *= speed / fastest
    change = 0.0
    for n in range(wheels):
        x, y = unit_vector(PI * (2.0 * n + 1.0) / wheels)
        change = max(change, abs(_wheel(x, y, reach, command) - _wheel(x, y, reach, now)))
    if change > most:
        for axis in range(3):
            command[axis] = now[axis] + (command[axis] - now[axis]) * (most / change)


@dataclass(frozen=True)
class Omni(Drive):
    """Omnidirectional wheels in a circle around the centre, each of which drives across its axis.

    All three velocities of a command lose the same fraction where a wheel is too fast.

    Attributes:
        wheels: their number, 3 to 64.
        reach: distance of the wheels from the centre, m.
        wheel_speed: largest speed of a wheel over the ground, m/s.
        wheel_acceleration: largest acceleration of a wheel, m/s².
    """

    wheels: Annotated[float, Ge(3), Le(64), MultipleOf(1)] = 3.0
    reach: Positive = 0.25
    wheel_speed: Positive = 1.0
    wheel_acceleration: Positive = 1.5
    moves_sideways: ClassVar[bool] = True
    kernel: ClassVar[Any] = _limit_omni


@kernel
def _limit_steering(parameters: Array, limits: Array, memory: Array, now: Array, command: Array, dt: float) -> None:
    base, maximum, rate, rear = parameters[0], parameters[1], parameters[2], parameters[3]
    wanted_v, wanted_omega, turn_limit = command[0], command[2], limits[TURN]
    command[1] = 0.0
    limit_speeds(limits, now, command, dt)
    wanted = memory[_STEERING]
    if wanted_v != 0.0 or wanted_omega != 0.0:  # the angle of the curve, even while the robot still stands
        wanted = angle_of(base * (wanted_omega if wanted_v >= 0.0 else -wanted_omega), abs(wanted_v))
    wanted = clipped(wanted, -maximum, maximum)
    steering = memory[_STEERING] + clipped(wanted - memory[_STEERING], -rate * dt, rate * dt)
    memory[_STEERING] = steering
    cosine, sine = unit_vector(steering)
    curvature = sine / (cosine * base)
    vx = command[0]
    if abs(vx * curvature) > turn_limit:
        vx *= turn_limit / abs(vx * curvature)
    command[0], command[1], command[2] = vx, vx * curvature * rear, vx * curvature


@dataclass(frozen=True)
class Bicycle(Drive):
    """A steered front axle and a fixed rear axle, as of a car (Ackermann steering); it turns only as it moves.

    The wanted angle of the front wheels is that of the curve which a command describes, omega / vx. Its sideways
    velocity is ignored; the executed one is that of the centre, which lies before the rear axle.

    Attributes:
        wheel_base: distance of the axles, m.
        steering: largest angle of the front wheels, rad; 1.5 or less.
        steering_rate: largest rate at which they are turned, rad/s.
        rear: distance from the rear axle to the centre of the robot, m.

    Source: kinematic bicycle model with the steering angle delta, omega = v tan(delta) / wheel_base; Rajamani, Vehicle
    Dynamics and Control (2012), section 2.2.
    """

    wheel_base: Positive = 0.5
    steering: Annotated[float, Gt(0), Le(1.5)] = 0.6
    steering_rate: Positive = 1.5
    rear: NotNegative = 0.25
    is_coupled: ClassVar[bool] = True
    kernel: ClassVar[Any] = _limit_steering

    @classmethod
    def memory_of(cls, parameters: Array, twist: Array) -> Array | None:
        if abs(twist[0]) < _SLOWEST:
            return None
        side = 1.0 if twist[0] > 0.0 else -1.0
        return np.array([angle_of(float(side * parameters[0] * twist[2]), float(abs(twist[0]))), 0.0, 0.0, 0.0])
