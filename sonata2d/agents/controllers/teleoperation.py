"""A person at the controls: device events become twists, and labels given while driving."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any, Literal, Self

from ...core.devices import DeviceEvent
from ...core.geometry import Twist, quantised
from ...core.labels import DEVICE, LabelSpec
from ...core.scene import Scene
from ...core.snapshot import Snapshot
from .base import Controller, Stop

Axis = Literal["ahead", "left", "turn", "brake"]
STOP = DeviceEvent("window", "stop", 1.0)  # ends the run, as a person's doing: so it replays like the rest

AXES: tuple[Axis, ...] = ("ahead", "left", "turn", "brake")

# Sticks: controls that one hand moves together, so that their dead zone is round. (x and y are buttons of a pad.)
STICKS = (("left_x", "left_y"), ("right_x", "right_y"), ("axis0", "axis1"), ("axis2", "axis3"), ("drag_x", "drag_y"))


@dataclass(frozen=True, slots=True)
class Hand:
    """How one kind of device is read; its numbers are kept at the precision of files, so that a run can be run again.

    Attributes:
        controls: what each control does: an axis of the robot, and its share of it; -1 turns it round. Whatever is not
            named does nothing.
        dead_zone: 0..1, how far a stick may stand off its middle and still be at rest.
        curve: 0..1, how much finer a stick answers near its middle: r becomes (1 - curve) r + curve r^3.
    """

    controls: Mapping[str, tuple[Axis, float]]
    dead_zone: float = 0.0
    curve: float = 0.0

    def __post_init__(self) -> None:
        if not (0.0 <= self.dead_zone <= 0.9999 and 0.0 <= self.curve <= 1.0):
            raise ValueError(f"dead_zone {self.dead_zone} must be in 0..1 (below 1) and curve {self.curve} in 0..1")
        for control, (axis, share) in self.controls.items():
            if axis not in AXES or not -1.0 <= share <= 1.0:
                raise ValueError(f"{control} is bound to {axis} x {share}; axes are {', '.join(AXES)}, shares -1..1")
        controls = {control: (axis, quantised(share)) for control, (axis, share) in self.controls.items()}
        object.__setattr__(self, "controls", controls)
        object.__setattr__(self, "dead_zone", quantised(self.dead_zone))
        object.__setattr__(self, "curve", quantised(self.curve))

    @classmethod
    def restored(cls, told: Mapping[str, Any]) -> Self:
        """The inverse of `settings`."""
        controls = {control: (axis, float(share)) for control, (axis, share) in told["controls"].items()}
        return cls(controls, float(told["dead_zone"]), float(told["curve"]))

    def settings(self) -> dict[str, Any]:
        """As JSON holds it."""
        controls = {control: list(bound) for control, bound in self.controls.items()}
        return {"dead_zone": self.dead_zone, "curve": self.curve, "controls": controls}

    def read(self, values: Mapping[str, float]) -> dict[Axis, float]:
        """What the device asks for on each axis.

        Args:
            values: of the controls that were moved, -1..1.
        """
        asked: dict[Axis, float] = dict.fromkeys(AXES, 0.0)
        shaped = dict(values)
        for x, y in STICKS:
            if x in values or y in values:
                shaped[x], shaped[y] = self.shaped(values.get(x, 0.0), values.get(y, 0.0))
        for control, (axis, share) in self.controls.items():
            asked[axis] += share * shaped.get(control, 0.0)
        return asked

    def shaped(self, x: float, y: float) -> tuple[float, float]:
        """A stick's place after dead zone and curve, its direction kept."""
        reach = math.sqrt(x * x + y * y)
        if reach <= self.dead_zone:
            return 0.0, 0.0
        out = min((reach - self.dead_zone) / (1.0 - self.dead_zone), 1.0)
        out = (1.0 - self.curve) * out + self.curve * out * out * out
        return x * (out / reach), y * (out / reach)


KEYBOARD = Hand(
    {
        "w": ("ahead", 1.0), "up": ("ahead", 1.0), "s": ("ahead", -1.0), "down": ("ahead", -1.0),
        "a": ("turn", 1.0), "left": ("turn", 1.0), "d": ("turn", -1.0), "right": ("turn", -1.0),
        "q": ("left", 1.0), "e": ("left", -1.0), "space": ("brake", 1.0),
    }
)  # fmt: skip
MOUSE = Hand({"drag_y": ("ahead", -1.0), "drag_x": ("turn", -1.0)}, dead_zone=0.08)
PAD = Hand(
    {
        "left_y": ("ahead", -1.0), "left_x": ("turn", -1.0), "right_x": ("left", -1.0),
        "axis1": ("ahead", -1.0), "axis0": ("turn", -1.0), "left_shoulder": ("brake", 1.0),
    },
    dead_zone=0.1, curve=0.3,
)  # fmt: skip
HANDS: Mapping[str, Hand] = {"keyboard": KEYBOARD, "mouse": MOUSE, "pad": PAD}


@dataclass(slots=True)
class _Held:
    """Where each control of each device stands."""

    values: dict[str, dict[str, float]] = field(default_factory=dict)

    def take(self, event: DeviceEvent) -> None:
        self.values.setdefault(event.device, {})[event.control] = event.value


class Teleoperation(Controller):
    """Drives as the device events in the snapshots say: a full stick asks for the robot's limit.

    The same events bring the same twists, so a run that a person drove can be run again from its own file.

    Args:
        hands: how each kind of device is read, or a single one: `pad1` goes before `pad`; `HANDS` unless given.
        label: what is asked of the person; one per frame is noted with each frame, None before it is first given.
    """

    version = "1"

    def __init__(self, hands: Mapping[str, Hand] = HANDS, label: LabelSpec | None = None) -> None:
        self._hands, self._label = dict(hands), label or LabelSpec()
        self.labels = {self._label.name: self._label.meaning} if self._label.per_frame else {}
        self._held = _Held()
        self._given: bool | int | float | None = None

    @classmethod
    def from_settings(cls, settings: Mapping[str, Any]) -> Self:
        """The one that a file's settings tell of."""
        hands = {kind: Hand.restored(told) for kind, told in settings.get("hands", {}).items()}
        return cls(hands or HANDS, LabelSpec.restored(settings["label"]) if "label" in settings else None)

    @property
    def hands(self) -> Mapping[str, Hand]:
        """How each kind of device is read."""
        return self._hands

    def settings(self) -> dict[str, Any]:
        """Everything that decides how events are read."""
        hands = {kind: hand.settings() for kind, hand in self._hands.items()}
        return {"hands": hands} | ({"label": asdict(self._label)} if self._label.per_frame else {})

    def reset(self, scene: Scene) -> None:
        self._held, self._given = _Held(), None

    def act(self, snapshot: Snapshot) -> Twist | Stop:
        for event in snapshot.events:
            if event == STOP:
                return Stop("the person at the controls ended it")
            if event.device == DEVICE:
                self._given = self._label.label_at(max(event.value, 0.0)) if self._label.per_frame else None
            else:
                self._held.take(event)
        limits, asked = snapshot.robot.body.limits, self._asked()
        if asked["brake"] > 0.5:
            return Twist()
        ahead = asked["ahead"] * (limits.ahead if asked["ahead"] > 0.0 else limits.back)
        sideways = limits.sideways if snapshot.robot.body.kinematics == "holonomic" else 0.0
        return Twist(ahead, asked["left"] * sideways, asked["turn"] * limits.turn)

    def label(self, snapshot: Snapshot, twist: Twist) -> Any:
        return {self._label.name: self._given} if self._label.per_frame else None

    def _asked(self) -> dict[Axis, float]:
        """What all devices ask for together, each axis within -1..1."""
        total: dict[Axis, float] = dict.fromkeys(AXES, 0.0)
        for device, values in self._held.values.items():
            hand = self._hands.get(device) or self._hands.get(device.rstrip("0123456789"))
            for axis, value in (hand.read(values) if hand else {}).items():
                total[axis] += value
        return {axis: min(max(value, -1.0), 1.0) for axis, value in total.items()}
