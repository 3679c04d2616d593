"""`teleoperation`: a person drives; device events become twists, and labels given while driving."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal, Self

from ...core.devices import NETWORK_DEVICE, DeviceEvent
from ...core.geometry import Twist, quantised
from ...core.labels import LABEL_DEVICE, LabelSpec
from ...core.scene import Scene
from ...core.snapshot import Snapshot
from .base import Controller, Stop

Axis = Literal["ahead", "left", "turn", "brake"]
_AXES: tuple[Axis, ...] = ("ahead", "left", "turn", "brake")

# Words of a file of controls.
Direction = Literal["ahead", "back", "turn_left", "turn_right", "left", "right", "brake"]
DIRECTIONS: Mapping[Direction, tuple[Axis, float]] = {
    "ahead": ("ahead", 1.0), "back": ("ahead", -1.0), "turn_left": ("turn", 1.0), "turn_right": ("turn", -1.0),
    "left": ("left", 1.0), "right": ("left", -1.0), "brake": ("brake", 1.0),
}  # fmt: skip
# The tables that drive, dead zones and curves say how recorded runs without mappings are read: they do not change.
DEFAULT_CONTROLS = Path(__file__).with_name("controls.toml")

# Ends the run as an event, so that the end is recorded and replayed like all other input.
STOP = DeviceEvent("window", "stop", 1.0)

# Pairs of controls that form one stick; their dead zone is a disc. ("x" and "y" are buttons of a pad.)
_STICKS = (("left_x", "left_y"), ("right_x", "right_y"), ("axis0", "axis1"), ("axis2", "axis3"), ("drag_x", "drag_y"))


@dataclass(frozen=True, slots=True)
class DeviceMapping:
    """Mapping of the controls of one kind of device to the axes of the robot.

    Numbers are rounded to the precision of files, so that a run replays from its own file.

    Attributes:
        controls: for each control, the axis of the robot that it drives and its gain in [-1, 1]; -1 reverses the
            direction. Controls that are not listed have no effect.
        dead_zone: deflection of a stick, in [0, 1), below which it counts as centred.
        curve: in [0, 1], how much finer a stick responds near its centre: the deflection r becomes
            (1 - curve) r + curve r^3.

    Raises:
        ValueError: a number is out of range, or an axis does not exist.

    >>> DeviceMapping({"w": ("ahead", 1.0)}).read({"w": 1.0})["ahead"]
    1.0
    """

    controls: Mapping[str, tuple[Axis, float]]
    dead_zone: float = 0.0
    curve: float = 0.0

    def __post_init__(self) -> None:
        # 0.9999: the next larger number that files can hold is 1, at which `shape_stick` would divide by zero.
        if not (0.0 <= self.dead_zone <= 0.9999 and 0.0 <= self.curve <= 1.0):
            raise ValueError(f"dead_zone must be in [0, 1) and curve in [0, 1], got {self.dead_zone} and {self.curve}")
        for control, (axis, gain) in self.controls.items():
            if axis not in _AXES or not -1.0 <= gain <= 1.0:
                raise ValueError(
                    f"control {control!r} is mapped to axis {axis!r} with gain {gain}; "
                    f"axes are {', '.join(_AXES)}, gains are in [-1, 1]"
                )
        controls = {control: (axis, quantised(gain)) for control, (axis, gain) in self.controls.items()}
        object.__setattr__(self, "controls", controls)
        object.__setattr__(self, "dead_zone", quantised(self.dead_zone))
        object.__setattr__(self, "curve", quantised(self.curve))

    @classmethod
    def from_settings(cls, settings: Mapping[str, Any]) -> Self:
        """Reconstruct a mapping from what `settings` returns."""
        controls = {control: (axis, float(gain)) for control, (axis, gain) in settings["controls"].items()}
        return cls(controls, float(settings["dead_zone"]), float(settings["curve"]))

    def settings(self) -> dict[str, Any]:
        """The mapping as JSON-compatible values."""
        controls = {control: list(target) for control, target in self.controls.items()}
        return {"dead_zone": self.dead_zone, "curve": self.curve, "controls": controls}

    def read(self, values: Mapping[str, float]) -> dict[Axis, float]:
        """The command of the device on each axis.

        Args:
            values: state of the controls that have been used, in [-1, 1].

        Returns:
            For each axis the sum over its controls, as a fraction of the robot's limit; not clipped.
        """
        command: dict[Axis, float] = dict.fromkeys(_AXES, 0.0)
        shaped = dict(values)
        for x, y in _STICKS:
            if x in values or y in values:
                shaped[x], shaped[y] = self.shape_stick(values.get(x, 0.0), values.get(y, 0.0))
        for control, (axis, gain) in self.controls.items():
            command[axis] += gain * shaped.get(control, 0.0)
        return command

    def shape_stick(self, x: float, y: float) -> tuple[float, float]:
        """Apply dead zone and curve to a stick position; keeps its direction."""
        deflection = math.sqrt(x * x + y * y)
        if deflection <= self.dead_zone:
            return 0.0, 0.0
        shaped = min((deflection - self.dead_zone) / (1.0 - self.dead_zone), 1.0)
        shaped = (1.0 - self.curve) * shaped + self.curve * shaped * shaped * shaped
        return x * (shaped / deflection), y * (shaped / deflection)


DEFAULT_MAPPINGS: Mapping[str, DeviceMapping] = {
    device: DeviceMapping(
        {control: DIRECTIONS[word] for control, word in tables["drive"].items()},
        tables.get("dead_zone", 0.0),
        tables.get("curve", 0.0),
    )
    for device, tables in tomllib.loads(DEFAULT_CONTROLS.read_text("utf-8")).items()
}


class Teleoperation(Controller):
    """Turns the device events in the snapshots into twists; full deflection commands the robot's limit.

    Equal events give equal twists, so a recorded run can be rerun from its own file.

    Args:
        mappings: for each kind of device (`keyboard`, `mouse`, `pad`) or single device (`pad1`) how its controls are
            read; a single device takes precedence over its kind.
        label: the question to the person. If it is asked in every frame, the label given last is recorded with each
            frame, and None before the first.
    """

    version = "1"
    answers_after_arrival = True  # a person goes on to give labels, and ends the run

    def __init__(
        self, mappings: Mapping[str, DeviceMapping] = DEFAULT_MAPPINGS, label: LabelSpec | None = None
    ) -> None:
        self.mappings, self._label_spec = dict(mappings), label or LabelSpec()
        self.labels = {self._label_spec.name: self._label_spec.meaning} if self._label_spec.per_frame else {}
        self._controls: dict[str, dict[str, float]] = {}  # device -> control -> its last value
        self._label: bool | int | float | None = None

    @classmethod
    def from_settings(cls, settings: Mapping[str, Any]) -> Self:
        """Reconstruct the recorded controller; default mappings where the settings hold none."""
        mappings = {kind: DeviceMapping.from_settings(m) for kind, m in settings.get("hands", {}).items()}
        label = LabelSpec.from_settings(settings["label"]) if "label" in settings else None
        return cls(mappings or DEFAULT_MAPPINGS, label)

    @property
    def pressed(self) -> tuple[DeviceEvent, ...]:
        """The controls that are not at rest, with their values."""
        return tuple(
            DeviceEvent(device, control, value)
            for device, values in self._controls.items()
            for control, value in values.items()
            if value and device != NETWORK_DEVICE
        )

    def settings(self) -> dict[str, Any]:
        """Everything that determines how events are read, as JSON-compatible values."""
        mappings = {kind: mapping.settings() for kind, mapping in self.mappings.items()}
        return {"hands": mappings} | ({"label": asdict(self._label_spec)} if self._label_spec.per_frame else {})

    def reset(self, scene: Scene) -> None:
        self._controls, self._label = {}, None

    def act(self, snapshot: Snapshot) -> Twist | Stop:
        for event in snapshot.events:
            if event == STOP:
                return Stop("the person at the controls ended it")
            if event.device == LABEL_DEVICE:
                self._label = self._label_spec.label_at(max(event.value, 0.0)) if self._label_spec.per_frame else None
            else:
                self._controls.setdefault(event.device, {})[event.control] = event.value
        limits, command = snapshot.robot.body.limits, self._command()
        if command["brake"] > 0.5:  # the brake overrides everything else
            return Twist()
        ahead = command["ahead"] * (limits.ahead if command["ahead"] > 0.0 else limits.back)
        return Twist(ahead, command["left"] * snapshot.robot.body.sideways_limit, command["turn"] * limits.turn)

    def label(self, snapshot: Snapshot, twist: Twist) -> Any:
        return {self._label_spec.name: self._label} if self._label_spec.per_frame else None

    def _command(self) -> dict[Axis, float]:
        """The sum of the commands of all devices on each axis, clipped to [-1, 1]."""
        total: dict[Axis, float] = dict.fromkeys(_AXES, 0.0)
        for device, values in self._controls.items():
            mapping = self.mappings.get(device) or self.mappings.get(device.rstrip("0123456789"))
            for axis, value in (mapping.read(values) if mapping else {}).items():
                total[axis] += value
        return {axis: min(max(value, -1.0), 1.0) for axis, value in total.items()}
