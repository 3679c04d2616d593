"""Bodies and heads: which way people face and look, and how fast they can turn."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..core.geometry import Point
from ..core.portable_math import PI, Array, arctan2, exp, rotation, unit_vectors
from ..core.scene import Scene
from ..core.vectors import lengths

BODY_TURN = 2.6  # rad/s, the fastest that a body turns
HEAD_TURN = 4.5  # rad/s, the fastest that a head turns on the body
HEAD_LIMIT = 1.2  # rad, to either side of the body's direction
BODY_RATE, CALM_RATE = 8.0, 3.0  # 1/s, of a body that walks at `BRISK` or more, and of one that stands
HEAD_RATE = 10.0  # 1/s
BRISK = 1.0  # m/s
RIGHT_ABOUT = 2.8  # rad, past which who turns already goes on the same way round
_SMALL = 0.45  # rad, up to which `rotation` is exact enough


class Posture:
    """Directions of all bodies and heads, which follow what people want, critically damped and with a limit.

    An angle x from where it shall be obeys x″ = −2 r x′ − r² x, solved in closed form over a tick. A body's rate r
    grows with the walker's speed, so that brisk walkers face the way they go and slow ones keep calm. A head counters
    the turn of its body, so that a look stays where it is.

    Args:
        scene: who there is, how they face at the start, and the side by which people turn right about.

    Attributes:
        faces, looks: (N, 2), unit vectors of bodies and heads, world frame.
        omega: (N,), rad/s, by which the bodies turned in the last tick: the change of their direction over the tick.

    Source: the headed social force of Farina et al., PLoS ONE 12(1) (2017) e0169734, whose torque
    −k_θ (θ − θ₀) − k_ω ω is damped critically for α = 1; its k_λ |f₀| is r² here.
    """

    def __init__(self, scene: Scene) -> None:
        self._dt, self._side = scene.rules.dt, scene.rules.side
        self.faces = unit_vectors(np.array([human.pose.theta for human in scene.humans]))
        self.looks, self.omega = self.faces.copy(), np.zeros(len(scene.humans))
        self._rate, self._neck_rate = self.omega.copy(), self.omega.copy()  # rad/s, now
        self._neck = self.omega.copy()  # rad, the head on its body

    def begin(self, k: int, direction: Point) -> None:
        """Somebody comes in, and looks ahead."""
        self.faces[k] = self.looks[k] = direction
        self.omega[k] = self._rate[k] = self._neck_rate[k] = self._neck[k] = 0.0

    def turn(self, bodies: Array, facing: Array, look: Array) -> None:
        """Turn by one tick.

        Args:
            bodies: (N, 4), x, y, vx, vy, m and m/s, world frame.
            facing, look: (N, 2), unit vectors to which bodies and heads shall turn, world frame.
        """
        speed = lengths(bodies[:, 2:])
        rate = CALM_RATE + (BODY_RATE - CALM_RATE) * np.minimum(speed / BRISK, 1.0)
        angles = _angle(np.concatenate((self.faces, self.faces)), np.concatenate((facing, look)), self._side)
        to_face, to_look = angles[: len(rate)], angles[len(rate) :]
        still_to_go = _right_about(to_face, self._rate)
        moved, self._rate = _damped(still_to_go, self._rate, rate, BODY_TURN, self._dt)
        self.faces = _rotated(self.faces, moved, BODY_TURN * self._dt)
        self.omega = moved / self._dt
        self._turn_heads(moved, to_look - moved)
        self.looks = _rotated(self.faces, self._neck, HEAD_LIMIT)

    def _turn_heads(self, moved: Array, wanted: Array) -> None:
        """Turn heads on bodies that have just turned by `moved`, to where they are wanted, rad, on the body."""
        before = self._neck
        wanted = np.where(wanted > PI, wanted - 2.0 * PI, np.where(wanted <= -PI, wanted + 2.0 * PI, wanted))
        wanted = _right_about(wanted, before)
        wanted = np.minimum(np.maximum(wanted, -HEAD_LIMIT), HEAD_LIMIT)
        steady = before - moved
        gone, rate = _damped(wanted - steady, self._neck_rate, HEAD_RATE, HEAD_TURN, self._dt)
        most = HEAD_TURN * self._dt
        turned = np.minimum(np.maximum(steady + gone - before, -most), most)
        self._neck = np.minimum(np.maximum(before + turned, -HEAD_LIMIT), HEAD_LIMIT)
        self._neck_rate = np.where(np.abs(self._neck) < HEAD_LIMIT, rate, 0.0)


def _damped(still_to_go: Array, speed: Array, rate: Any, fastest: float, dt: float) -> tuple[Array, Array]:
    """Go towards an angle for `dt`, critically damped: by how much, and how fast then; (N,) each, rad and rad/s."""
    push = (speed - rate * still_to_go) * dt
    decay = exp(np.zeros(len(speed)) - rate * dt)
    moved = still_to_go + (push - still_to_go) * decay
    after = (speed - rate * push) * decay
    most = fastest * dt
    return np.minimum(np.maximum(moved, -most), most), np.minimum(np.maximum(after, -fastest), fastest)


def _right_about(angle: Array, turning: Array) -> Array:
    """Angles still to go, the long way round where that is hardly longer and the turn has begun that way."""
    goes_on = (np.abs(angle) > RIGHT_ABOUT) & (angle * turning < 0.0) & (np.abs(turning) > 0.2)
    return np.where(goes_on, np.where(angle > 0.0, angle - 2.0 * PI, angle + 2.0 * PI), angle)


def _angle(now: Array, target: Array, side: int) -> Array:
    """(N,), rad, from unit vectors to others, (N, 2). Right about is to the right for side 1, to the left for -1."""
    c = now[:, 0] * target[:, 0] + now[:, 1] * target[:, 1]
    s = now[:, 0] * target[:, 1] - now[:, 1] * target[:, 0]
    angle: Array = np.where((s == 0.0) & (c < 0.0), -side * PI, arctan2(s, c))
    return angle


def _rotated(vectors: Array, angle: Array, largest: float) -> Array:
    """Unit vectors (N, 2) turned by angles (N,), rad, none beyond the largest, in parts small enough to be exact."""
    parts = math.floor(largest / _SMALL) + 1
    c, s = rotation(angle / parts)
    for _ in range(parts):
        vectors = np.stack((vectors[:, 0] * c - vectors[:, 1] * s, vectors[:, 0] * s + vectors[:, 1] * c), axis=1)
    unit: Array = vectors / lengths(vectors)[:, None]
    return unit
