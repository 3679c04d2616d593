"""`human-like`: adds a human operator's reaction delay, motor lag and noise to another controller's commands."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping
from typing import Any, Self

from ...core.arguments import finite_number
from ...core.entities import Robot
from ...core.geometry import Twist
from ...core.portable_math import exp_of
from ...core.rng import RandomStream
from ...core.scene import Scene
from ...core.snapshot import Snapshot
from ...core.wording import shown
from ..sensors.base import known_to, shown_to
from .base import Answer, Controller, recorded_path
from .loading import find_controller
from .planner import SocialPlanner

_NOISE_FLOOR = 0.1  # noise at zero command, as a fraction of the noise at full command
_NOISE_TIME = 0.5  # s, correlation time of the noise
_RECORDED_SETTINGS = ("delay", "lag", "noise", "labels_intention")
# Recorded in files: do not change the text.
_INTENTION_MEANING = "the label is [vx, vy, omega], the twist intended at that look: without delay, lag and noise"
Vector3 = tuple[float, float, float]


class HumanLike(Controller):
    """Wraps a controller with human reaction delay, motor lag and noise.

    The inner controller's command (the intention) is delayed by the reaction time. Noise is added: the remnant of the
    quasi-linear pilot model, an Ornstein-Uhlenbeck process in each axis, whose amplitude grows with the command as a
    fraction of the robot's limits. The result passes through a first-order lag and is clipped to the limits. The
    noise is drawn from the episode's random stream `controller` and is mirrored with `rules.side`.

    Args:
        inner: the intention; by default the expert, `SocialPlanner`. Its `Stop` and `Regenerate` take effect at once.
        delay: reaction time, s, rounded to the nearest tick.
        lag: time constant of the motor lag, s; 0 disables it.
        noise: standard deviation of the noise at full command, before the lag, as a fraction of the limit in each axis.
        labels_intention: label each frame with the current intention, [vx, vy, omega], as an expert would label it.
            Otherwise the inner controller labels; the expert returns no label, so that the command itself is the
            label.

    Raises:
        ValueError: delay, lag or noise is negative or not finite.

    Source: D. T. McRuer & H. R. Jex, "A review of quasi-linear pilot models", IEEE Trans. Human Factors in Electronics
    HFE-8 (1967) 231: a describing function with reaction delay and neuromuscular lag, and a remnant that scales with
    the operator's signals. The correlation time and floor of the noise and all default values are ours.
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
        if inner is not None and not isinstance(inner, Controller):
            raise TypeError(f"the inner controller must be an object of a Controller class, got {shown(inner)}")
        self.delay, self.lag = finite_number("delay", delay, 0.0), finite_number("lag", lag, 0.0)
        self.noise, self.labels_intention = finite_number("noise", noise, 0.0), labels_intention
        self._inner = inner or SocialPlanner()
        self.image, self.deterministic = self._inner.image, self._inner.deterministic
        self.sensors = tuple(self._inner.sensors)
        self.labels = {"intention": _INTENTION_MEANING} if labels_intention else self._inner.labels

    @classmethod
    def from_settings(cls, settings: Mapping[str, Any]) -> Self:
        """Reconstruct a recorded controller together with its inner controller."""
        controller = cls()
        recorded = {name: settings.get(name, getattr(controller, name)) for name in _RECORDED_SETTINGS}
        # A subclass may take other arguments, so the recorded ones are passed to this class's initialiser.
        HumanLike.__init__(controller, _inner_from_settings(settings, controller._inner), **recorded)
        return controller

    def settings(self) -> dict[str, Any]:
        inner = {"path": recorded_path(type(self._inner)), "version": self._inner.version}
        return {**super().settings(), "inner": inner | {"settings": dict(self._inner.settings())}}

    def reset(self, scene: Scene) -> None:
        self._inner.reset(known_to(self._inner, scene))
        self._rng = RandomStream(scene.seed, scene.episode, "controller", scene.robot_id or None)
        self._side, dt = float(scene.rules.side), scene.rules.dt
        self._lag_gain, self._noise_decay = 1.0 - _decay(dt, self.lag), _decay(dt, _NOISE_TIME)
        self._delayed: deque[Twist] = deque(maxlen=int(self.delay / dt + 0.5) + 1)
        self._output: Twist | None = None
        self._noise_state: Vector3 = (0.0, 0.0, 0.0)

    def act(self, snapshot: Snapshot) -> Answer:
        intention, robot = self._inner.act(shown_to(self._inner, snapshot)), snapshot.robot
        if not isinstance(intention, Twist):
            return intention
        if self._output is None:
            # The first tick starts from the robot's motion: at rest, or moving where an episode was branched.
            self._output = robot.executed
            self._delayed.extend([robot.executed] * (self._delayed.maxlen or 0))
        self._delayed.append(intention)
        command = _clip_to_limits(self._delayed[0], robot.body)
        vx, vy, omega = self._noise(command, robot.body)
        noisy = Twist(command.vx + vx, command.vy + vy, command.omega + omega)
        self._output = _clip_to_limits(_interpolate(self._output, noisy, self._lag_gain), robot.body)
        return self._output

    def label(self, snapshot: Snapshot, twist: Twist) -> Any:
        if not self.labels_intention:
            return self._inner.label(snapshot, twist)
        intention = self._delayed[-1].rounded()
        return [intention.vx, intention.vy, intention.omega]

    def _noise(self, command: Twist, robot: Robot) -> Vector3:
        """Advance the noise by one tick; (vx, vy, omega) in m/s, m/s, rad/s."""
        limits, decay = robot.limits, self._noise_decay
        excitation = math.sqrt(1.0 - decay * decay)  # keeps the variance constant
        draws = [self._rng.normal(0.0, 1.0, -3.0, 3.0) for _ in self._noise_state]
        a, b, c = (decay * old + excitation * new for old, new in zip(self._noise_state, draws, strict=True))
        self._noise_state = a, b, c
        ahead = limits.ahead if command.vx >= 0.0 else limits.back
        x, y, turn = command.vx / ahead, command.vy / limits.sideways, command.omega / limits.turn
        fraction = min(math.sqrt(x * x + y * y + turn * turn), 1.0)  # of full command
        size = self.noise * (_NOISE_FLOOR + (1.0 - _NOISE_FLOOR) * fraction)
        return size * limits.ahead * a, size * limits.sideways * b * self._side, size * limits.turn * c * self._side


def _clip_to_limits(twist: Twist, robot: Robot) -> Twist:
    """Clip a twist to the robot's velocity limits; the sideways limit of a unicycle is 0."""
    limits, sideways = robot.limits, robot.sideways_limit
    return Twist(
        min(max(twist.vx, -limits.back), limits.ahead),
        min(max(twist.vy, -sideways), sideways),
        min(max(twist.omega, -limits.turn), limits.turn),
    )


def _interpolate(start: Twist, end: Twist, fraction: float) -> Twist:
    """The twist at a fraction, 0 to 1, of the way from start to end."""
    return Twist(
        start.vx + fraction * (end.vx - start.vx),
        start.vy + fraction * (end.vy - start.vy),
        start.omega + fraction * (end.omega - start.omega),
    )


def _decay(dt: float, time_constant: float) -> float:
    """Factor by which an exponential decay falls in dt, s; 0 for a time constant of 0 s."""
    return exp_of(-dt / time_constant) if time_constant > 0.0 else 0.0


def _inner_from_settings(settings: Mapping[str, Any], default: Controller) -> Controller:
    """Reconstruct the inner controller from recorded settings.

    Args:
        settings: of the outer controller.
        default: its inner controller if none is recorded.

    Raises:
        ControllerError: the recorded class cannot be imported, or is not a controller.
    """
    recorded = settings.get("inner")
    if recorded is None:
        return default
    is_default = recorded["path"] == recorded_path(type(default))
    return (type(default) if is_default else find_controller(recorded["path"])).from_settings(recorded["settings"])
