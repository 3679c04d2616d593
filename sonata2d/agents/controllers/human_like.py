"""Any controller as a person's hand would put it through: late, smoothed by muscles, and never twice the same."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping
from importlib import import_module
from typing import Any, Self

import numpy as np

from ...core.entities import Robot
from ...core.geometry import Twist
from ...core.portable_math import exp
from ...core.rng import RandomStream
from ...core.scene import Scene
from ...core.snapshot import Snapshot
from .base import Answer, Controller, current_path, recorded_path
from .planner import SocialPlanner

FLOOR = 0.1  # of the noise at full command, what is left when nothing is asked for
FADING = 0.5  # s in which a tremble of the hand is forgotten
OWN = ("delay", "lag", "noise", "labels_intention")
MEANING = "the label is [vx, vy, omega], the twist intended at that look: without delay, lag and noise"
Three = tuple[float, float, float]


class HumanLike(Controller):
    """Drives as a person would who wants what another controller wants: with delay, muscles and an unsteady hand.

    What is intended is held back by the reaction delay. The remnant, an Ornstein-Uhlenbeck process in each axis, is
    added to it: it grows with the command, as a share of the robot's limits. The hand follows as a first-order lag,
    within the limits. The remnant is drawn from the episode's stream `controller`, and mirrors with `rules.side`.

    Args:
        inner: what is intended; the expert, `SocialPlanner`, unless given. A `Stop` of its is not held back.
        delay: s from seeing to acting, to the nearest tick.
        lag: s, time constant of the muscles; 0 for none.
        noise: standard deviation of the remnant at a full command, of the limit in each axis, before the lag.
        labels_intention: label each frame with what is intended at that look, [vx, vy, omega], as an expert would.
            Otherwise the inner controller labels; the expert does not, so that the command itself is the label.

    Raises:
        ValueError: a number is negative or not finite.

    Source: D. T. McRuer & H. R. Jex, "A review of quasi-linear pilot models", IEEE Trans. Human Factors in Electronics
    HFE-8 (1967) 231: a describing function with reaction delay and neuromuscular lag, and a remnant that scales with
    the operator's signals. How the remnant fades, its floor and all default values are ours.
    """

    version = "1"

    def __init__(
        self,
        inner: Controller | None = None,
        *,
        delay: float = 0.2,
        lag: float = 0.1,
        noise: float = 0.15,
        labels_intention: bool = False,
    ) -> None:
        for name, value in (("delay", delay), ("lag", lag), ("noise", noise)):
            if not 0.0 <= value < math.inf:
                raise ValueError(f"{name} must be 0 or more, and finite, got {value}")
        self.delay, self.lag, self.noise, self.labels_intention = delay, lag, noise, labels_intention
        self._inner = inner or SocialPlanner()
        self.image, self.deterministic = self._inner.image, self._inner.deterministic
        self.labels = {"intention": MEANING} if labels_intention else self._inner.labels

    @classmethod
    def from_settings(cls, settings: Mapping[str, Any]) -> Self:
        """As a file tells of it, with its inner controller."""
        controller = cls()
        own = {name: settings.get(name, getattr(controller, name)) for name in OWN}
        HumanLike.__init__(controller, _inner_of(settings, controller._inner), **own)
        return controller

    def settings(self) -> dict[str, Any]:
        inner = {"path": recorded_path(type(self._inner)), "version": self._inner.version}
        return {**super().settings(), "inner": inner | {"settings": dict(self._inner.settings())}}

    def reset(self, scene: Scene) -> None:
        self._inner.reset(scene)
        self._rng = RandomStream(scene.seed, scene.episode, "controller")
        self._side, dt = float(scene.rules.side), scene.rules.dt
        self._follows, self._fades = 1.0 - _decay(dt, self.lag), _decay(dt, FADING)
        self._held: deque[Twist] = deque(maxlen=int(self.delay / dt + 0.5) + 1)
        self._hand: Twist | None = None
        self._trembles: Three = (0.0, 0.0, 0.0)

    def act(self, snapshot: Snapshot) -> Answer:
        intended, robot = self._inner.act(snapshot), snapshot.robot
        if not isinstance(intended, Twist):
            return intended
        if self._hand is None:  # the hand is at what the drive does: at rest, or, in a branch, as it was left
            self._hand = robot.executed
            self._held.extend([robot.executed] * (self._held.maxlen or 0))
        self._held.append(intended)
        wanted = within(self._held[0], robot.body)
        vx, vy, omega = self._remnant(wanted, robot.body)
        aim = Twist(wanted.vx + vx, wanted.vy + vy, wanted.omega + omega)
        self._hand = within(_nearer(self._hand, aim, self._follows), robot.body)
        return self._hand

    def label(self, snapshot: Snapshot, twist: Twist) -> Any:
        if not self.labels_intention:
            return self._inner.label(snapshot, twist)
        intended = self._held[-1].rounded()
        return [intended.vx, intended.vy, intended.omega]

    def _remnant(self, wanted: Twist, robot: Robot) -> Three:
        """What an unsteady hand adds: m/s, m/s, rad/s."""
        limits, kept = robot.limits, self._fades
        stir = math.sqrt(1.0 - kept * kept)  # so that the variance stays
        draws = [self._rng.normal(0.0, 1.0, -3.0, 3.0) for _ in self._trembles]
        a, b, c = (kept * last + stir * new for last, new in zip(self._trembles, draws, strict=True))
        self._trembles = a, b, c
        ahead = limits.ahead if wanted.vx >= 0.0 else limits.back
        x, y, turn = wanted.vx / ahead, wanted.vy / limits.sideways, wanted.omega / limits.turn
        size = self.noise * (FLOOR + (1.0 - FLOOR) * min(math.sqrt(x * x + y * y + turn * turn), 1.0))
        return size * limits.ahead * a, size * limits.sideways * b * self._side, size * limits.turn * c * self._side


def within(twist: Twist, robot: Robot) -> Twist:
    """The twist cut to what the robot's velocities may be; a unicycle has no sideways one."""
    limits = robot.limits
    sideways = limits.sideways if robot.kinematics == "holonomic" else 0.0
    return Twist(
        min(max(twist.vx, -limits.back), limits.ahead),
        min(max(twist.vy, -sideways), sideways),
        min(max(twist.omega, -limits.turn), limits.turn),
    )


def _nearer(at: Twist, to: Twist, share: float) -> Twist:
    """A share of the way from one twist to another."""
    return Twist(
        at.vx + share * (to.vx - at.vx), at.vy + share * (to.vy - at.vy), at.omega + share * (to.omega - at.omega)
    )


def _decay(dt: float, constant: float) -> float:
    """What is left after dt of what fades with a time constant, s."""
    return float(exp(np.array(-dt / constant))) if constant > 0.0 else 0.0


def _inner_of(settings: Mapping[str, Any], usual: Controller) -> Controller:
    """The inner controller that settings tell of; the usual one if they tell of none.

    Raises:
        ValueError: what they name is no controller.
    """
    told = settings.get("inner")
    if told is None:
        return usual
    kind: Any = type(usual)
    if told["path"] != recorded_path(kind):
        module, _, name = current_path(str(told["path"])).partition(":")
        kind = getattr(import_module(module), name, None)
        if not (isinstance(kind, type) and issubclass(kind, Controller)):
            raise ValueError(f"{told['path']} is no Controller that can be had again; name a class of your own")
    inner: Controller = kind.from_settings(told["settings"])
    return inner
