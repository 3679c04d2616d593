"""Joysticks and game pads: how SDL names their controls, and how they are found, opened and read."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol

import pygame
from pygame._sdl2 import controller

LOG = logging.getLogger(__name__)

STICK_AXES = ("left_x", "left_y", "right_x", "right_y")
AXES = (*STICK_AXES, "left_trigger", "right_trigger")  # by SDL's number, as the buttons
BUTTONS = (
    "a", "b", "x", "y", "back", "guide", "start", "left_stick", "right_stick", "left_shoulder", "right_shoulder",
    "dpad_up", "dpad_down", "dpad_left", "dpad_right", "misc1", "paddle1", "paddle2", "paddle3", "paddle4", "touchpad",
)  # fmt: skip
STEP = 0.01  # a smaller move of an axis is jitter
_TRIGGER = -0.9  # an unnamed axis that rests below this is a trigger
PLUGGING = (
    pygame.JOYDEVICEADDED, pygame.JOYDEVICEREMOVED, pygame.CONTROLLERDEVICEADDED, pygame.CONTROLLERDEVICEREMOVED,
)  # fmt: skip

Reading = tuple[str, float, bool]  # control, value, whether it is a button


@dataclass(slots=True)
class Pad:
    """A device that is plugged in.

    Attributes:
        instance: SDL's number of this plugging in; never given twice.
        guid: the same for all devices of one make, and each time.
        is_controller: SDL knows what its controls are called; else they are numbered.
        rest: where an axis stood when it was plugged in, -1..1; what is there from the start is no input.
        device: keeps it open.
    """

    instance: int
    guid: str
    name: str
    is_controller: bool
    rest: dict[str, float] = field(default_factory=dict)
    device: object = None
    _moved: set[str] = field(default_factory=set)

    def read(self, event: pygame.Event) -> tuple[Reading, ...]:
        """What an event of this device says of its controls."""
        if self.is_controller:  # its joystick events tell the same once more
            return self._named(event)
        return self._numbered(event)

    def _named(self, event: pygame.Event) -> tuple[Reading, ...]:
        if event.type == pygame.CONTROLLERAXISMOTION and event.axis < len(AXES):
            return self._axis(AXES[event.axis], scaled(event.value))
        if event.type in (pygame.CONTROLLERBUTTONDOWN, pygame.CONTROLLERBUTTONUP) and event.button < len(BUTTONS):
            return ((BUTTONS[event.button], float(event.type == pygame.CONTROLLERBUTTONDOWN), True),)
        return ()

    def _numbered(self, event: pygame.Event) -> tuple[Reading, ...]:
        if event.type == pygame.JOYAXISMOTION:
            return self._axis(f"axis{event.axis}", min(max(float(event.value), -1.0), 1.0))
        if event.type in (pygame.JOYBUTTONDOWN, pygame.JOYBUTTONUP):
            return ((f"button{event.button}", float(event.type == pygame.JOYBUTTONDOWN), True),)
        if event.type == pygame.JOYHATMOTION:
            x, y = event.value
            return ((f"hat{event.hat}_x", float(x), True), (f"hat{event.hat}_y", float(y), True))
        return ()

    def _axis(self, control: str, value: float) -> tuple[Reading, ...]:
        """Nothing as long as the axis stands where it stood when plugged in: that was nobody's doing."""
        rest = self.rest.setdefault(control, value)  # SDL tells where an unnamed axis rests before it tells of a move
        if control not in self._moved and abs(value - rest) < STEP:
            return ()
        self._moved.add(control)
        if rest < _TRIGGER and not self.is_controller:
            value = max((value - rest) / (1.0 - rest), 0.0)
        return ((control, value, False),)


class Plugs(Protocol):
    """Where pads are plugged in: SDL, or what a test pretends."""

    def start(self) -> bool:
        """Begin to look for pads. False: there is no way to, on this machine."""

    def plugged(self, known: Sequence[int]) -> list[Pad]:
        """Those that are plugged in and not among the known instances, opened, in SDL's order."""


class SdlPlugs:
    """Pads as SDL finds them."""

    def start(self) -> bool:
        try:
            pygame.joystick.init()
            controller.init()
        except pygame.error as error:
            LOG.warning("no joystick can be used here (%s); keyboard and mouse drive", error)
            return False
        return True

    def plugged(self, known: Sequence[int]) -> list[Pad]:
        # An event's device index is worth nothing once another device came or went, so look at all.
        found = []
        for index in range(pygame.joystick.get_count()):
            try:
                pad = _opened(index, known)
            except pygame.error as error:
                LOG.warning("joystick %d cannot be opened: %s", index, error)
            else:
                found += [pad] if pad else []
        return found


def _opened(index: int, known: Sequence[int]) -> Pad | None:
    """The pad that is at this place of SDL's list now, unless it is known."""
    joystick = pygame.joystick.Joystick(index)
    instance, guid, name = joystick.get_instance_id(), joystick.get_guid(), joystick.get_name()
    if instance in known:
        return None
    if not controller.is_controller(index):
        return Pad(instance, guid, name, False, device=joystick)
    pad = controller.Controller.from_joystick(joystick)
    rest = {name: scaled(pad.get_axis(number)) for number, name in enumerate(AXES)}
    return Pad(instance, guid, name, True, rest, device=(joystick, pad))


def scaled(value: int) -> float:
    """An axis of SDL, 16 bits, as -1..1."""
    return min(max(value / 32767.0, -1.0), 1.0)
