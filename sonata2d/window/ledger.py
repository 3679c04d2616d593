"""What was told of each control, and what is to be told at the next look."""

from __future__ import annotations

from collections.abc import Mapping

from ..core.devices import DeviceEvent
from .pads import STEP

Key = tuple[str, str]  # device, control


class Ledger:
    """Keeps where controls stand, so that a look tells what changed: each control once, in the order of the changes."""

    def __init__(self) -> None:
        self._now: dict[Key, float] = {}
        self._told: dict[Key, float] = {}
        self._changed: dict[Key, None] = {}  # in order
        self._taps: dict[Key, float] = {}

    def put(self, device: str, control: str, value: float, *, is_button: bool) -> None:
        """A control has a new value, -1..1."""
        key = device, control
        if is_button and value:
            self._taps[key] = value
        self._now[key] = value
        self._changed.pop(key, None)
        self._changed[key] = None

    def look(self) -> tuple[DeviceEvent, ...]:
        """What changed since the last look. What was pressed and released between the two is told as pressed now, and
        as released at the next look."""
        events, again = [], []
        for key in self._changed:
            told, value = self._told.get(key, 0.0), self._now[key]
            if value == told == 0.0 and key in self._taps:
                value = self._taps[key]
                again.append(key)
            if _is_worth_telling(told, value):
                events.append(DeviceEvent(*key, value))
                self._told[key] = value
        self._changed, self._taps = dict.fromkeys(again), {}
        return tuple(events)

    def let_go(self, device: str | None = None) -> None:
        """Everything, or all of one device, goes to zero."""
        for key in [key for key in self._now if device in (None, key[0])]:
            self._taps.pop(key, None)
            if self._now[key] or self._told.get(key, 0.0):
                self.put(*key, 0.0, is_button=False)

    def now(self, device: str) -> Mapping[str, float]:
        """Where the controls of a device stand."""
        return {control: value for (owner, control), value in self._now.items() if owner == device}

    def told(self, device: str) -> Mapping[str, float]:
        """Where they stand by what was told."""
        return {control: value for (owner, control), value in self._told.items() if owner == device}

    def held(self) -> tuple[DeviceEvent, ...]:
        """Everything that was told and is not at zero: all that someone needs to know who has heard nothing yet."""
        return tuple(DeviceEvent(*key, value) for key, value in self._told.items() if value)


def _is_worth_telling(told: float, value: float) -> bool:
    """Whether it differs by more than jitter, or came to rest, or to an end."""
    return value != told and (abs(value - told) >= STEP or value in (-1.0, 0.0, 1.0))
