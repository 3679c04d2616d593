"""Where a label stands that is chosen by keys, wheel or triggers."""

from __future__ import annotations

from typing import Any

from ..core.devices import DeviceEvent
from ..core.labels import DEVICE, LabelSpec
from .actions import Action

_STEP = 0.05  # of the slider, a press


class Dial:
    """A label on its scale; at no place until it is first moved.

    Args:
        spec: what is asked.
    """

    def __init__(self, spec: LabelSpec) -> None:
        self.spec = spec
        self.place: float | None = None

    @property
    def label(self) -> Any:
        """The label it shows; None before it is moved."""
        return None if self.place is None else self.spec.label_at(self.place)

    @property
    def event(self) -> DeviceEvent | None:
        """What an episode hears of it."""
        return None if self.place is None else DeviceEvent(DEVICE, "value", self.place)

    def turn(self, action: Action) -> bool:
        """Move as an action says; whether it is an action of the dial's."""
        levels = self.spec.levels
        if action.level:
            if self.spec.kind == "slider":
                self.place = (action.level - 1) / 8
            elif action.level <= levels:
                place = (action.level - 1) / (levels - 1)
                self.place = 1.0 - place if self.spec.kind == "yes_no" else place  # yes stands first
        elif action in (Action.LABEL_UP, Action.LABEL_DOWN):
            step = 1.0 / (levels - 1) if levels else _STEP
            sign = 1.0 if action is Action.LABEL_UP else -1.0
            start = self.place if self.place is not None else 0.5 if not levels else (-step if sign > 0 else 1.0 + step)
            self.place = min(max(start + sign * step, 0.0), 1.0)
        return bool(action.level) or action in (Action.LABEL_UP, Action.LABEL_DOWN)

    def set(self, label: Any) -> None:
        """Stand at a label."""
        self.place = None if label is None else self.spec.place_of(label)
