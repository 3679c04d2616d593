"""Input devices: pygame's events of keyboard, mouse and game pads become device events and actions."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import pygame
from pygame._sdl2 import controller

from ..agents.controllers.teleoperation import DeviceMapping
from ..core.devices import DeviceEvent
from .actions import Action, key_name, key_with_modifiers
from .profiles import AXES, BUTTONS, DEFAULT_PROFILES, Profile, read_profiles

logger = logging.getLogger(__name__)

_KEYBOARD, _MOUSE = "keyboard", "mouse"
HOTPLUG_EVENTS = (
    pygame.JOYDEVICEADDED, pygame.JOYDEVICEREMOVED, pygame.CONTROLLERDEVICEADDED, pygame.CONTROLLERDEVICEREMOVED,
)  # fmt: skip
_JITTER = 0.01  # smaller changes of an axis are noise
_TRIGGER_REST = -0.9  # an unnamed axis that rests below this is a trigger
_JOYSTICK_RADIUS = 0.22  # drag for a full deflection of the mouse joystick, as a fraction of the window's smaller side
_PRESSED, _RELEASED = 0.55, 0.4  # an axis triggers its action above the first, and again after it was below the second
_CENTRED = 0.25  # a stick closer to its centre counts as released
_MOUSE_BUTTONS = {2: "middle_button", 3: "right_button"}  # the left button drags

_Key = tuple[str, str]  # device, control
_Reading = tuple[str, float, bool]  # control, value, whether it is a button


class _Move(NamedTuple):
    """New value of one control, -1 to 1."""

    slot: str
    control: str
    value: float
    is_button: bool


class MouseJoystick(NamedTuple):
    """Virtual joystick of a mouse drag: where the drag started, the mouse position, the full deflection; px."""

    anchor: tuple[int, int]
    position: tuple[int, int]
    radius: float


class _EventBuffer:
    """Collects the values of controls between two polls; each control yields at most one event per poll."""

    def __init__(self) -> None:
        self._values: dict[_Key, float] = {}
        self._reported: dict[_Key, float] = {}
        self._changed: dict[_Key, None] = {}  # in the order of the changes
        self._taps: dict[_Key, float] = {}

    def put(self, device: str, control: str, value: float, *, is_button: bool) -> None:
        """Store the new value of a control, -1 to 1."""
        key = device, control
        if is_button and value:
            self._taps[key] = value
        self._values[key] = value
        self._changed.pop(key, None)
        self._changed[key] = None

    def poll(self) -> tuple[DeviceEvent, ...]:
        """Changes since the previous poll, in order.

        A button that was pressed and released in between is reported as pressed now and as released by the next poll.
        """
        events, again = [], []
        for key in self._changed:
            reported, value = self._reported.get(key, 0.0), self._values[key]
            if value == reported == 0.0 and key in self._taps:
                value = self._taps[key]
                again.append(key)
            # Jitter is suppressed, but the centre and the ends are always reported.
            if value != reported and (abs(value - reported) >= _JITTER or value in (-1.0, 0.0, 1.0)):
                events.append(DeviceEvent(*key, value))
                self._reported[key] = value
        self._changed, self._taps = dict.fromkeys(again), {}
        return tuple(events)

    def release(self, device: str | None = None) -> None:
        """Set all controls, or the controls of one device, to zero."""
        for key in [key for key in self._values if device in (None, key[0])]:
            self._taps.pop(key, None)
            if self._values[key] or self._reported.get(key, 0.0):
                self.put(*key, 0.0, is_button=False)

    def values(self, device: str) -> Mapping[str, float]:
        """Current values of a device's controls."""
        return {control: value for (owner, control), value in self._values.items() if owner == device}

    def reported(self, device: str) -> Mapping[str, float]:
        """Values of a device's controls as of the last poll."""
        return {control: value for (owner, control), value in self._reported.items() if owner == device}

    def active(self) -> tuple[DeviceEvent, ...]:
        """Reported values other than zero: the initial events of a new episode."""
        return tuple(DeviceEvent(*key, value) for key, value in self._reported.items() if value)


@dataclass(slots=True)
class Pad:
    """A connected joystick or game pad.

    Attributes:
        instance: SDL's number of this connection; never reused.
        name: of the model.
        is_controller: whether SDL has names for its controls; otherwise they are numbered.
        rest: value of each axis when the pad was connected, -1 to 1; an axis that has not moved yet gives no input.
        device: pygame's object; keeps the device open.
    """

    instance: int
    name: str
    is_controller: bool
    rest: dict[str, float] = field(default_factory=dict)
    device: object = None
    _moved: set[str] = field(default_factory=set)

    def read(self, event: pygame.Event) -> tuple[_Reading, ...]:
        """Readings of the controls in an event of this device."""
        # SDL reports a named pad twice: its joystick events repeat its controller events.
        return self._read_named(event) if self.is_controller else self._read_numbered(event)

    def _read_named(self, event: pygame.Event) -> tuple[_Reading, ...]:
        if event.type == pygame.CONTROLLERAXISMOTION and event.axis < len(AXES):
            return self._read_axis(AXES[event.axis], _scaled(event.value))
        if event.type in (pygame.CONTROLLERBUTTONDOWN, pygame.CONTROLLERBUTTONUP) and event.button < len(BUTTONS):
            return ((BUTTONS[event.button], float(event.type == pygame.CONTROLLERBUTTONDOWN), True),)
        return ()

    def _read_numbered(self, event: pygame.Event) -> tuple[_Reading, ...]:
        if event.type == pygame.JOYAXISMOTION:
            return self._read_axis(f"axis{event.axis}", _clipped(float(event.value)))
        if event.type in (pygame.JOYBUTTONDOWN, pygame.JOYBUTTONUP):
            return ((f"button{event.button}", float(event.type == pygame.JOYBUTTONDOWN), True),)
        if event.type == pygame.JOYHATMOTION:
            x, y = event.value
            return ((f"hat{event.hat}_x", float(x), True), (f"hat{event.hat}_y", float(y), True))
        return ()

    def _read_axis(self, control: str, value: float) -> tuple[_Reading, ...]:
        """_Reading of an axis; none until the axis has left its value at connection."""
        rest = self.rest.setdefault(control, value)  # SDL reports the rest of an unnamed axis before its first move
        if control not in self._moved and abs(value - rest) < _JITTER:
            return ()
        self._moved.add(control)
        if rest < _TRIGGER_REST and not self.is_controller:
            value = max((value - rest) / (1.0 - rest), 0.0)
        return ((control, value, False),)


class SdlPads:
    """Finds the connected pads."""

    def start(self) -> bool:
        """Start looking for pads; False if this machine does not support them."""
        try:
            pygame.joystick.init()
            controller.init()
        except pygame.error as error:
            logger.warning("joysticks cannot be used here (%s); drive with keyboard or mouse", error)
            return False
        return True

    def open_new(self, known: Sequence[int]) -> list[Pad]:
        """Open the connected pads whose instance is not among the known ones, in SDL's order."""
        # The device index of an event is invalid once another device was added or removed, so check all devices.
        pads = []
        for index in range(pygame.joystick.get_count()):
            try:
                pad = self._open(index, known)
            except pygame.error as error:
                logger.warning("joystick %d cannot be opened: %s", index, error)
            else:
                pads += [pad] if pad else []
        return pads

    @staticmethod
    def _open(index: int, known: Sequence[int]) -> Pad | None:
        """Open the pad at an index of SDL's list; None if it is known."""
        joystick = pygame.joystick.Joystick(index)
        instance, name = joystick.get_instance_id(), joystick.get_name()
        if instance in known:
            return None
        if not controller.is_controller(index):
            return Pad(instance, name, False, device=joystick)
        pad = controller.Controller.from_joystick(joystick)
        rest = {axis: _scaled(pad.get_axis(number)) for number, axis in enumerate(AXES)}
        return Pad(instance, name, True, rest, device=(joystick, pad))


class InputDevices:
    """Keyboard, mouse and all pads. Create it after the window is open.

    Args:
        profiles: control assignments, as of `read_profiles`, which reads them by default.
        pads: finds pads; SDL by default.

    Attributes:
        profiles: control assignments.

    Raises:
        ConfigError: the file of controls is wrong.
    """

    def __init__(self, profiles: Mapping[str, Profile] | None = None, pads: SdlPads | None = None) -> None:
        self.profiles = read_profiles() if profiles is None else profiles
        self._source = pads or SdlPads()
        self._buffer = _EventBuffer()
        self._names: list[str] = []  # index: slot; name of the last pad in it
        self._pads: dict[int, Pad] = {}  # by slot: connected pads
        self._disconnected: list[str] = []
        self._connected: list[str] = []
        self._pressed: set[_Key] = set()
        self._joystick: MouseJoystick | None = None
        self._ignored: set[_Key] = set()  # controls of pads that were released by `release` while deflected
        self._has_pads = self._source.start()
        self._update_pads()
        self._connected.clear()  # pads that are there from the start are not news

    # Events

    def handle(self, event: pygame.Event, size: tuple[int, int]) -> Action | None:
        """Process an event of pygame; driving controls go to the buffer.

        Args:
            event: any event.
            size: of the window, px.

        Returns:
            The action that the event requests, if any.
        """
        action = None
        for move in self._moves(event, size):
            profile = self._profile(move.slot)
            if (move.slot, move.control) in self._ignored:
                if abs(move.value) < _CENTRED:
                    self._ignored.discard((move.slot, move.control))
            elif move.control in profile.mapping.controls:
                self._buffer.put(move.slot, move.control, move.value, is_button=move.is_button)
            else:
                action = self._triggered(move, profile) or action
        return action

    def _moves(self, event: pygame.Event, size: tuple[int, int]) -> tuple[_Move, ...]:
        """Changes of controls in an event, assigned or not."""
        if event.type in HOTPLUG_EVENTS:  # changes the devices, and moves no control
            self._update_pads(getattr(event, "instance_id", None))
        elif event.type == pygame.WINDOWFOCUSLOST:  # releases are not reported any more
            self.release()
        elif event.type in (pygame.KEYDOWN, pygame.KEYUP):
            return self._key_moves(event)
        elif event.type == pygame.MOUSEWHEEL and event.y:  # a turn is a button that is pressed and released at once
            wheel = "wheel_up" if event.y > 0 else "wheel_down"
            return _Move(_MOUSE, wheel, 1.0, True), _Move(_MOUSE, wheel, 0.0, True)
        elif event.type in (pygame.MOUSEBUTTONDOWN, pygame.MOUSEBUTTONUP, pygame.MOUSEMOTION):
            return self._mouse_moves(event, size)
        elif hasattr(event, "instance_id"):
            pads = [(slot, pad) for slot, pad in self._pads.items() if pad.instance == event.instance_id]
            return tuple(_Move(f"pad{slot}", *reading) for slot, pad in pads for reading in pad.read(event))
        return ()

    def poll(self) -> tuple[DeviceEvent, ...]:
        """Device events since the previous poll: one per control, in order; a short tap is not lost."""
        return self._buffer.poll()

    def active(self) -> tuple[DeviceEvent, ...]:
        """Reported values other than zero: the initial events of an episode that starts now."""
        return self._buffer.active()

    def release(self) -> None:
        """Set all controls to zero. A key counts again when it is pressed, a stick after it was centred."""
        self._joystick = None
        self._pressed.clear()
        pads = [f"pad{slot}" for slot in self._pads]
        self._ignored |= {
            (pad, control) for pad in pads for control, value in self._buffer.values(pad).items() if value
        }
        self._buffer.release()

    def is_driving(self, events: Iterable[DeviceEvent]) -> bool:
        """Whether any of the events just polled drives: an assigned control beyond its dead zone, except the brake."""
        slots = {event.device for event in events if event.value and self._has_slot(event.device)}
        demands = [self._profile(slot).mapping.read(self._buffer.reported(slot)) for slot in slots]
        return any(demand[axis] for demand in demands for axis in ("ahead", "left", "turn"))

    # Devices

    @property
    def joystick(self) -> MouseJoystick | None:
        """The mouse joystick to draw; None while the mouse is not dragged or dragging is not assigned."""
        return self._joystick if {"drag_x", "drag_y"} & set(self._profile(_MOUSE).mapping.controls) else None

    @property
    def mappings(self) -> Mapping[str, DeviceMapping]:
        """Mapping of each device, for `Teleoperation`; `pad` is for devices that are connected later."""
        pads = {slot: self._profile(slot).mapping for slot in (f"pad{k}" for k in range(len(self._names)))}
        return {kind: self.profiles[kind].mapping for kind in DEFAULT_PROFILES} | pads

    def pads_match(self, mappings: Mapping[str, DeviceMapping]) -> bool:
        """Whether other mappings read every connected pad in the same way."""
        present = self.mappings
        return all(mappings.get(f"pad{k}", mappings.get("pad")) == present[f"pad{k}"] for k in self._pads)

    def pop_disconnected(self) -> str | None:
        """Name of a device that was disconnected; each is returned once."""
        return self._disconnected.pop(0) if self._disconnected else None

    def pop_connected(self) -> str | None:
        """Name of a device that was connected; each is returned once."""
        return self._connected.pop(0) if self._connected else None

    # Internals

    def _profile(self, slot: str) -> Profile:
        """Profile of a device."""
        if not slot.startswith("pad"):
            return self.profiles[slot]
        return self.profiles.get(f"pads.{self._names[int(slot[3:])]}", self.profiles["pad"])

    def _has_slot(self, slot: str) -> bool:
        return slot in (_KEYBOARD, _MOUSE) or (slot.startswith("pad") and int(slot[3:]) < len(self._names))

    def _triggered(self, move: _Move, profile: Profile) -> Action | None:
        """Action of a control at the moment it is pressed, or its axis passes the threshold; None while it is held."""
        action = None
        for control, value in ((move.control, move.value), (f"-{move.control}", -move.value)):
            key = move.slot, control
            if value < _RELEASED:
                self._pressed.discard(key)
            elif value > _PRESSED and key not in self._pressed:
                self._pressed.add(key)
                action = profile.actions.get(control, action)
        return action

    def _key_moves(self, event: pygame.Event) -> tuple[_Move, ...]:
        """A key with Ctrl or Alt is a separate control; releasing the key releases all of its variants."""
        if event.type == pygame.KEYDOWN:
            pygame.key.set_repeat(0)  # a text field switches key repeat on, but text fields do not pass keys on
            return (_Move(_KEYBOARD, key_with_modifiers(event), 1.0, True),)
        return tuple(
            _Move(_KEYBOARD, prefix + key_name(event), 0.0, True) for prefix in ("", "ctrl+", "alt+", "ctrl+alt+")
        )

    def _mouse_moves(self, event: pygame.Event, size: tuple[int, int]) -> tuple[_Move, ...]:
        """The left button drags the joystick; each of the other buttons is a control."""
        if event.type == pygame.MOUSEMOTION:
            if self._joystick is None:
                return ()
            if not getattr(event, "buttons", (1,))[0]:  # the button was released outside the window
                return self._move_joystick(None)
            return self._move_joystick(self._joystick._replace(position=event.pos))
        is_down = event.type == pygame.MOUSEBUTTONDOWN
        if event.button == pygame.BUTTON_LEFT:
            if is_down:
                return self._move_joystick(MouseJoystick(event.pos, event.pos, max(_JOYSTICK_RADIUS * min(size), 1.0)))
            return self._move_joystick(None) if self._joystick else ()
        name = _MOUSE_BUTTONS.get(event.button)
        return (_Move(_MOUSE, name, float(is_down), True),) if name else ()

    def _move_joystick(self, joystick: MouseJoystick | None) -> tuple[_Move, ...]:
        """Store the mouse joystick; None releases it. Right and down are positive, as for the stick of a pad."""
        self._joystick = joystick
        x, y = ((joystick.position[i] - joystick.anchor[i]) / joystick.radius if joystick else 0.0 for i in (0, 1))
        return _Move(_MOUSE, "drag_x", _clipped(x), False), _Move(_MOUSE, "drag_y", _clipped(y), False)

    def _update_pads(self, removed: int | None = None) -> None:
        """Release the pad whose instance was removed, and open new pads."""
        for slot in [slot for slot, pad in self._pads.items() if pad.instance == removed]:
            pad = self._pads.pop(slot)
            self._buffer.release(f"pad{slot}")
            self._pressed = {key for key in self._pressed if key[0] != f"pad{slot}"}
            self._ignored = {key for key in self._ignored if key[0] != f"pad{slot}"}
            self._disconnected.append(pad.name)
        if not self._has_pads:
            return
        for pad in self._source.open_new([pad.instance for pad in self._pads.values()]):
            self._pads[self._slot_for(pad)] = pad
            self._connected.append(pad.name)

    def _slot_for(self, pad: Pad) -> int:
        """The free slot that a pad of the same model had, otherwise a new slot."""
        for slot, name in enumerate(self._names):
            if name == pad.name and slot not in self._pads:
                return slot
        self._names.append(pad.name)
        return len(self._names) - 1


def _scaled(value: int) -> float:
    """An axis of SDL, 16 bits, as -1 to 1."""
    return _clipped(value / 32767.0)


def _clipped(value: float) -> float:
    return min(max(value, -1.0), 1.0)
