"""Input for tests: events of keys, mouse and pads, and pads that exist only in the test."""

from __future__ import annotations

from collections.abc import Sequence

import pygame

from sonata2d.core.devices import DeviceEvent
from sonata2d.window.actions import Action
from sonata2d.window.input import InputDevices, Pad, SdlPads
from sonata2d.window.profiles import AXES, BUTTONS

SIZE = (1000, 500)  # full deflection of the mouse joystick: 110 px
XBOX, STICK = "Pad", "Stick"


class FakePads(SdlPads):
    """Pads that are connected by the test."""

    def __init__(self, *, works: bool = True) -> None:
        self.works, self._pads, self._count = works, list[tuple[int, str, bool]](), 0

    def start(self) -> bool:
        return self.works

    def open_new(self, known: Sequence[int]) -> list[Pad]:
        rest = dict.fromkeys(AXES, 0.0)
        return [
            Pad(number, name, named, dict(rest) if named else {})
            for number, name, named in self._pads
            if number not in known
        ]

    def plug(self, name: str = XBOX, *, named: bool = True) -> int:
        """Connect a pad; returns its instance."""
        self._count += 1
        self._pads.append((self._count, name, named))
        return self._count

    def unplug(self, instance: int) -> None:
        self._pads = [pad for pad in self._pads if pad[0] != instance]


def connected(devices: InputDevices) -> dict[str, Pad]:
    """The connected pads by slot."""
    return {f"pad{slot}": pad for slot, pad in devices._pads.items()}


def plugged_in() -> pygame.Event:
    return pygame.event.Event(pygame.JOYDEVICEADDED, device_index=0, guid="")


def unplugged(instance: int) -> pygame.Event:
    return pygame.event.Event(pygame.JOYDEVICEREMOVED, instance_id=instance)


def key(code: int, *, down: bool = True, mod: int = 0, scancode: int = 0) -> pygame.Event:
    return pygame.event.Event(pygame.KEYDOWN if down else pygame.KEYUP, key=code, mod=mod, scancode=scancode)


def axis(instance: int, control: str, value: float) -> pygame.Event:
    """A named axis moves; the ends are -1 and 1."""
    number, raw = AXES.index(control), round(32767 * value)
    return pygame.event.Event(pygame.CONTROLLERAXISMOTION, instance_id=instance, axis=number, value=raw)


def raw_axis(instance: int, number: int, value: float) -> pygame.Event:
    return pygame.event.Event(pygame.JOYAXISMOTION, instance_id=instance, joy=0, axis=number, value=value)


def button(instance: int, control: str, *, down: bool = True) -> pygame.Event:
    kind = pygame.CONTROLLERBUTTONDOWN if down else pygame.CONTROLLERBUTTONUP
    return pygame.event.Event(kind, instance_id=instance, button=BUTTONS.index(control))


def mouse(kind: int, x: int, y: int, *, held: bool = True, number: int = 1) -> pygame.Event:
    if kind == pygame.MOUSEMOTION:
        return pygame.event.Event(kind, pos=(x, y), rel=(0, 0), buttons=(int(held), 0, 0))
    return pygame.event.Event(kind, pos=(x, y), button=number)


def feed(devices: InputDevices, *events: pygame.Event) -> list[Action]:
    """Pass events on; returns the actions that they request."""
    answers = [devices.handle(event, SIZE) for event in events]
    return [action for action in answers if action is not None]


def polled(devices: InputDevices) -> list[tuple[str, str, float]]:
    """The events of a poll as tuples."""
    return [as_tuple(event) for event in devices.poll()]


def as_tuple(event: DeviceEvent) -> tuple[str, str, float]:
    return event.device, event.control, event.value
