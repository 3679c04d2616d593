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

    Commands have the precision of files.

    Args:
        inputs: of the first ticks; their commands are rounded.
    """

    def __init__(self, inputs: Iterable[TickInput] = ()) -> None:
        self._numbers = array("d")  # three for each command
        self._others: dict[int, TickInput] = {}  # by tick, those with more than a command
        for each in inputs:
            others = tuple((_rounded(command), label) for command, label in each.others)
            self.append(replace(each, command=_rounded(each.command), others=others))

    def append(self, tick_input: TickInput) -> None:
        """Add the input of the next tick, whose commands are rounded already."""
        command = tick_input.command
        if tick_input.label is not None or tick_input.events or tick_input.others:
            self._others[len(self)] = tick_input
        self._numbers.extend((command.vx, command.vy, command.omega))

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


def _rounded(command: Twist) -> Twist:
    """A command as a file holds it; numbers that no file can hold stay unchanged."""
    return Twist(*(_rounded_number(value) for value in (command.vx, command.vy, command.omega)))


def _rounded_number(value: float) -> float:
    try:
        return quantised(float(value))
    except ValueError:
        return float(value)
