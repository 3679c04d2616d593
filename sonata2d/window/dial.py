"""Where a label stands that is chosen by keys, wheel or triggers."""

from __future__ import annotations

from typing import Any

from ..labels import DEVICE, LabelSpec
from ..topics import DeviceEvent
from .actions import Action

_STEP = 0.05  # of the slider, a press


class Dial:
    """A label on its scale; at no place until it is first moved. `text` is the answer where text is asked for.

    Args:
        spec: what is asked.
    """

    def __init__(self, spec: LabelSpec) -> None:
        self.spec = spec
        self.place: float | None = None
        self.text = ""

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
                self.place = (action.level - 1) / (levels - 1)
        elif action in (Action.LABEL_UP, Action.LABEL_DOWN):
            step = 1.0 / (levels - 1) if levels else _STEP
            sign = 1.0 if action is Action.LABEL_UP else -1.0
            start = self.place if self.place is not None else 0.5 if not levels else (-step if sign > 0 else 1.0 + step)
            self.place = min(max(start + sign * step, 0.0), 1.0)
        return bool(action.level) or action in (Action.LABEL_UP, Action.LABEL_DOWN)

    def set(self, label: Any) -> None:
        """Stand at a label."""
        self.place = None if label is None else self.spec.place_of(label)


def in_words(spec: LabelSpec, label: Any) -> str:
    """A label as people read it; empty where none is asked for.

    >>> in_words(LabelSpec("classes", classes=("poor", "fair")), 2)
    '2 fair'
    """
    if spec.kind == "command":
        return ""
    if label is None:
        return "not given"
    if spec.kind == "yes_no":
        return "yes" if label else "no"
    if spec.kind == "classes":
        name = spec.classes[label - 1]
        return name if name == str(label) else f"{label} {name}"
    return f"{label:.2f}" if spec.kind == "slider" else str(label)
