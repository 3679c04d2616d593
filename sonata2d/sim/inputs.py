"""Inputs of an episode, tick by tick."""

from __future__ import annotations

from array import array
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, overload

import numpy as np

from ..core.devices import DeviceEvent
from ..core.geometry import Twist, quantised
from ..core.portable_math import Array

USUAL = 1e4  # m/s, rad/s, beyond which the limits of files are looked at


@dataclass(frozen=True, slots=True)
class TickInput:
    """External input of one tick. The inputs of all ticks, together with the scene, determine an episode.

    Attributes:
        command: of the robot, body frame.
        label: of the controller.
        events: of input devices.
        others: commands and labels of the other robots.
    """

    command: Twist
    label: Any = None
    events: tuple[DeviceEvent, ...] = ()
    others: tuple[tuple[Twist, Any], ...] = ()


class Inputs(Sequence[TickInput]):
    """The inputs of consecutive ticks: 24 bytes a tick, where it has no label, no events and no other robots.

    Commands are rounded to the precision of files.

    Args:
        inputs: of the first ticks.
    """

    def __init__(self, inputs: Iterable[TickInput] = ()) -> None:
        self._numbers = array("d")  # three for each command
        self._others: dict[int, TickInput] = {}  # by tick, those with more than a command
        for each in inputs:
            self.append(each)

    def append(self, tick_input: TickInput) -> None:
        """Add the input of the next tick."""
        command = tick_input.command
        vx, vy, omega = _rounded(command.vx), _rounded(command.vy), _rounded(command.omega)
        if tick_input.label is not None or tick_input.events or tick_input.others:
            others = tuple(
                (Twist(_rounded(other.vx), _rounded(other.vy), _rounded(other.omega)), label)
                for other, label in tick_input.others
            )
            self._others[len(self)] = replace(tick_input, command=Twist(vx, vy, omega), others=others)
        self._numbers.extend((vx, vy, omega))

    def extend(self, commands: Array, labels: Sequence[Any] | None = None) -> None:
        """Add the inputs of the next ticks, which have no events.

        Args:
            commands: (T, 3).
            labels: of the T ticks; None: they have none.
        """
        for n, label in enumerate(labels or ()):
            if label is not None:
                self._others[len(self) + n] = TickInput(Twist(*commands[n].tolist()), label)
        self._numbers.frombytes(commands.tobytes())

    @property
    def commands(self) -> Array:
        """(T, 3), vx, vy (m/s), omega (rad/s), body frame."""
        return np.array(self._numbers).reshape(-1, 3)

    @property
    def has_events(self) -> bool:
        """Whether a tick has events of input devices."""
        return any(other.events for other in self._others.values())

    def labels(self, start: int, stop: int) -> list[Any] | None:
        """The labels of some ticks; None if there are none."""
        if not self._others:
            return None
        return [other.label if (other := self._others.get(n)) else None for n in range(start, stop)]

    def __len__(self) -> int:
        return len(self._numbers) // 3

    @overload
    def __getitem__(self, index: int) -> TickInput: ...
    @overload
    def __getitem__(self, index: slice) -> Inputs: ...
    def __getitem__(self, index: int | slice) -> TickInput | Inputs:
        if isinstance(index, slice):
            return Inputs(self._at(n) for n in range(*index.indices(len(self))))
        return self._at(range(len(self))[index])

    def _at(self, tick: int) -> TickInput:
        other = self._others.get(tick)
        return other or TickInput(Twist(*self._numbers[3 * tick : 3 * tick + 3]))

    def __iter__(self) -> Iterator[TickInput]:
        return (self._at(tick) for tick in range(len(self)))

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Sequence):
            return NotImplemented
        return len(self) == len(other) and all(a == b for a, b in zip(self, other, strict=True))

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        return f"Inputs({[*self]!r})"


def _rounded(value: float) -> float:
    """A number as a file holds it; unchanged if none can hold it."""
    if type(value) is float and -USUAL < value < USUAL:  # the usual case in half of the time
        return round(value * 1e4) / 1e4 + 0.0
    try:
        return quantised(float(value))
    except ValueError:
        return float(value)
