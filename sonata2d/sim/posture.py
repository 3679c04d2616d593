"""Headings of bodies and gaze of heads, and how fast they can turn."""

from __future__ import annotations

import math

import numpy as np

from ..core.geometry import Point
from ..core.humans import VX, VY
from ..core.portable_math import PI, Array, arctan2, exp, rotation, unit_vectors
from ..core.scene import Scene
from ..core.vectors import X, Y, lengths

BODY_TURN = 2.6  # rad/s, maximum turn rate of a body
HEAD_TURN = 4.5  # rad/s, maximum turn rate of a head relative to the body
HEAD_LIMIT = 1.2  # rad, maximum angle of a head to either side of the body's heading
WALKING_RATE, STANDING_RATE = 8.0, 3.0  # 1/s, rate of a body that walks at `BRISK_SPEED` or more, and that stands
HEAD_RATE = 10.0  # 1/s
BRISK_SPEED = 1.0  # m/s
ABOUT_TURN = 2.8  # rad; towards a target angle beyond it, a turn that has begun continues to the same side
TURNING = 0.2  # rad/s (of a head: rad); above it a turn has begun
_MAX_ROTATION = 0.45  # rad, up to which `rotation` is accurate enough


class Posture:
    """Headings and gazes of all pedestrians, which follow their targets with critical damping and limited turn rates.

    The angle x to the target obeys x″ = −2 r x′ − r² x, solved in closed form over a tick. The rate r of a body grows
    with the walking speed, so that fast walkers face the direction in which they walk and slow ones turn calmly. A head
    compensates the turn of its body, so that the gaze stays on its target.

    Args:
        scene: number and initial headings of the pedestrians, tick, and the side to which they turn about.

    Attributes:
        direction: (N, 2), unit vectors of the bodies' headings, world frame.
        gaze: (N, 2), unit vectors of the gazes, world frame.
        omega: (N,), rad/s, change of the bodies' headings over the last tick, divided by the tick.

    Source: the headed social force of Farina et al., PLoS ONE 12(1) (2017) e0169734, whose torque
    −k_θ (θ − θ₀) − k_ω ω is damped critically for α = 1; its k_λ |f₀| is r² here.
    """

    def __init__(self, scene: Scene) -> None:
        self._dt, self._side = scene.rules.dt, scene.rules.side
        self.direction = unit_vectors(np.array([human.pose.theta for human in scene.humans]))
        self.gaze, self.omega = self.direction.copy(), np.zeros(len(scene.humans))
        self._body_rate, self._neck_rate = self.omega.copy(), self.omega.copy()  # rad/s, at the end of the tick
        self._neck = self.omega.copy()  # rad, angle of the head relative to the body

    def reset(self, k: int, direction: Point) -> None:
        """Set heading and gaze of pedestrian k, without rotation."""
        self.direction[k] = self.gaze[k] = direction
        self.omega[k] = self._body_rate[k] = self._neck_rate[k] = self._neck[k] = 0.0

    def turn(self, bodies: Array, facing: Array, gaze: Array) -> None:
        """Turn bodies and heads by one tick.

        Args:
            bodies: (N, 4), x, y, vx, vy; m and m/s, world frame.
            facing, gaze: (N, 2), unit vectors of the target headings and gazes, world frame.
        """
        speed = lengths(bodies[:, VX : VY + 1])
        rate = STANDING_RATE + (WALKING_RATE - STANDING_RATE) * np.minimum(speed / BRISK_SPEED, 1.0)
        targets = np.concatenate((facing, gaze))
        angles = _angle_between(np.concatenate((self.direction, self.direction)), targets, self._side)
        to_facing, to_gaze = angles[: len(rate)], angles[len(rate) :]
        remaining = _same_side(to_facing, self._body_rate)
        turned, self._body_rate = _critically_damped(remaining, self._body_rate, rate, BODY_TURN, self._dt)
        self.direction = _rotated(self.direction, turned, BODY_TURN * self._dt)
        self.omega = turned / self._dt
        self._turn_heads(turned, to_gaze - turned)
        self.gaze = _rotated(self.direction, self._neck, HEAD_LIMIT)

    def _turn_heads(self, body_turned: Array, target: Array) -> None:
        """Turn the heads relative to bodies that have just turned.

        Args:
            body_turned: (N,), turn of the bodies in this tick, rad.
            target: (N,), target angle of the heads relative to the bodies, rad.
        """
        before = self._neck
        target = np.where(target > PI, target - 2.0 * PI, np.where(target <= -PI, target + 2.0 * PI, target))
        target = _same_side(target, before)
        target = np.minimum(np.maximum(target, -HEAD_LIMIT), HEAD_LIMIT)
        steady = before - body_turned  # the angle that keeps the gaze where it is
        step, rate = _critically_damped(target - steady, self._neck_rate, HEAD_RATE, HEAD_TURN, self._dt)
        maximum = HEAD_TURN * self._dt
        turned = np.minimum(np.maximum(steady + step - before, -maximum), maximum)
        self._neck = np.minimum(np.maximum(before + turned, -HEAD_LIMIT), HEAD_LIMIT)
        self._neck_rate = np.where(np.abs(self._neck) < HEAD_LIMIT, rate, 0.0)


def _critically_damped(
    remaining: Array, speed: Array, rate: Array | float, maximum: float, dt: float
) -> tuple[Array, Array]:
    """Turn towards a target for one tick by the closed-form solution of a critically damped oscillator.

    Args:
        remaining: (N,), angle to the target, rad.
        speed: (N,), turn rate at the start, rad/s.
        rate: (N,) or for all, 1/s.
        maximum: turn rate that the result is limited to, rad/s.
        dt: s.

    Returns:
        Angle turned (N,), rad, and turn rate at the end (N,), rad/s.
    """
    slope = (speed - rate * remaining) * dt
    decay = exp(np.zeros(len(speed)) - rate * dt)
    turned = remaining + (slope - remaining) * decay
    after = (speed - rate * slope) * decay
    limit = maximum * dt
    return np.minimum(np.maximum(turned, -limit), limit), np.minimum(np.maximum(after, -maximum), maximum)


def _same_side(angle: Array, turning: Array) -> Array:
    """Angles to a target, by the longer side where that is hardly longer and a turn to that side has begun.

    Without this, a target just past half a turn would reverse a turn in progress.
    """
    continues = (np.abs(angle) > ABOUT_TURN) & (angle * turning < 0.0) & (np.abs(turning) > TURNING)
    return np.where(continues, np.where(angle > 0.0, angle - 2.0 * PI, angle + 2.0 * PI), angle)


def _angle_between(vectors: Array, targets: Array, side: int) -> Array:
    """Angles (N,) from unit vectors to targets, (N, 2) each, rad; to an opposite one, right for side 1, left for -1."""
    c = vectors[:, X] * targets[:, X] + vectors[:, Y] * targets[:, Y]
    s = vectors[:, X] * targets[:, Y] - vectors[:, Y] * targets[:, X]
    angle: Array = np.where((s == 0.0) & (c < 0.0), -side * PI, arctan2(s, c))
    return angle


def _rotated(vectors: Array, angle: Array, maximum: float) -> Array:
    """Unit vectors (N, 2) rotated by angles (N,) of at most `maximum`, rad, in steps where `rotation` is accurate."""
    steps = math.floor(maximum / _MAX_ROTATION) + 1
    c, s = rotation(angle / steps)
    for _ in range(steps):
        x, y = vectors[:, X], vectors[:, Y]
        vectors = np.stack((x * c - y * s, x * s + y * c), axis=1)
    unit: Array = vectors / lengths(vectors)[:, None]
    return unit
