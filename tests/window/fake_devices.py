"""Keys, mouse and pads for tests: pygame's events by hand, and pads that nobody has to plug in."""

from __future__ import annotations

from collections.abc import Sequence

import pygame

from sonata2d.core.devices import DeviceEvent
from sonata2d.window.actions import Action
from sonata2d.window.hands import Hands
from sonata2d.window.pads import AXES, BUTTONS, Pad

SIZE = (1000, 500)  # a full stick is 110 pixels of drag
XBOX, STICK = "guid-xbox", "guid-stick"


class PretendPlugs:
    """Pads that a test plugs in."""

    def __init__(self, *, works: bool = True) -> None:
        self.works, self._pads, self._count = works, list[tuple[int, str, str, bool]](), 0

    def start(self) -> bool:
        return self.works

    def plugged(self, known: Sequence[int]) -> list[Pad]:
        rest = dict.fromkeys(AXES, 0.0)
        return [
            Pad(number, guid, name, named, dict(rest) if named else {})
            for number, guid, name, named in self._pads
            if number not in known
        ]

    def plug(self, guid: str = XBOX, name: str = "Pad", *, named: bool = True) -> int:
        self._count += 1
        self._pads.append((self._count, guid, name, named))
        return self._count

    def unplug(self, instance: int) -> None:
        self._pads = [pad for pad in self._pads if pad[0] != instance]


def plugged_in() -> pygame.Event:
    return pygame.event.Event(pygame.JOYDEVICEADDED, device_index=0, guid="")


def unplugged(instance: int) -> pygame.Event:
    return pygame.event.Event(pygame.JOYDEVICEREMOVED, instance_id=instance)


def key(code: int, *, down: bool = True, mod: int = 0, scancode: int = 0) -> pygame.Event:
    return pygame.event.Event(pygame.KEYDOWN if down else pygame.KEYUP, key=code, mod=mod, scancode=scancode)


def axis(instance: int, control: str, value: float) -> pygame.Event:
    """A named axis moved, 1 being the end."""
    number = AXES.index(control)
    return pygame.event.Event(
        pygame.CONTROLLERAXISMOTION, instance_id=instance, axis=number, value=round(32767 * value)
    )


def raw_axis(instance: int, number: int, value: float) -> pygame.Event:
    return pygame.event.Event(pygame.JOYAXISMOTION, instance_id=instance, joy=0, axis=number, value=value)


def button(instance: int, control: str, *, down: bool = True) -> pygame.Event:
    kind = pygame.CONTROLLERBUTTONDOWN if down else pygame.CONTROLLERBUTTONUP
    return pygame.event.Event(kind, instance_id=instance, button=BUTTONS.index(control))


def mouse(kind: int, x: int, y: int, *, held: bool = True, number: int = 1) -> pygame.Event:
    if kind == pygame.MOUSEMOTION:
        return pygame.event.Event(kind, pos=(x, y), rel=(0, 0), buttons=(int(held), 0, 0))
    return pygame.event.Event(kind, pos=(x, y), button=number)


def feed(hands: Hands, *events: pygame.Event) -> list[Action]:
    """Hand the events on; answers the actions they asked for."""
    answers = [hands.handle(event, SIZE) for event in events]
    return [action for action in answers if action is not None]


def told(hands: Hands) -> list[tuple[str, str, float]]:
    """What a look tells, short."""
    return [short(event) for event in hands.look()]


def short(event: DeviceEvent) -> tuple[str, str, float]:
    return event.device, event.control, event.value
