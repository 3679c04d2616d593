"""A person's hands: pygame's events become the device events that an episode is driven by."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Mapping
from typing import NamedTuple

import pygame

from ..agents.controllers.teleoperation import HANDS, Hand
from ..core.devices import DeviceEvent
from .actions import Action, key_of, with_modifiers
from .ledger import Ledger
from .pads import PLUGGING, Pad, Plugs, SdlPlugs
from .profiles import Profile, Profiles

LOG = logging.getLogger(__name__)

KEYBOARD, MOUSE = "keyboard", "mouse"
_REACH = 0.22  # of the window's smaller side: how far the mouse is dragged for a full stick
_ASKS, _ARMS = 0.55, 0.4  # an axis asks for its action beyond the first, and may again once it was below the second
_BACK = 0.25  # a stick nearer to its middle is back there
_BUTTONS = {2: "middle_button", 3: "right_button"}  # of the mouse; the left one drags


class Move(NamedTuple):
    """One control of a device has a new value, -1..1."""

    slot: str
    control: str
    value: float
    is_button: bool


class Drag(NamedTuple):
    """The stick that the mouse is dragged for: where it was seized, where the mouse is, its reach; pixels."""

    anchor: tuple[int, int]
    current: tuple[int, int]
    radius: float


class Device(NamedTuple):
    """What is there to drive with: `pad0`, its readable name, and by what its profile is kept (a GUID)."""

    slot: str
    name: str
    key: str


class Hands:
    """Keyboard, mouse and all pads. Make it once the window is open.

    Args:
        profiles: how devices are read; the person's own unless given.
        plugs: where pads are found; SDL unless given.
    """

    def __init__(self, profiles: Profiles | None = None, plugs: Plugs | None = None) -> None:
        self.profiles = profiles or Profiles()
        self._plugs = plugs or SdlPlugs()
        self._ledger = Ledger()
        self._slots: list[str] = []  # by slot: the GUID that had it last
        self._pads: dict[int, Pad] = {}  # by slot: those plugged in
        self._lost: list[str] = []
        self._found: list[str] = []
        self._pressed: set[tuple[str, str]] = set()
        self._drag: Drag | None = None
        self._off: set[tuple[str, str]] = set()  # controls of pads that were let go of while they were held
        self._can_plug = self._plugs.start()
        self._look_for_pads()
        self._found.clear()  # what was there from the start is no news

    # What a person does

    def handle(self, event: pygame.Event, size: tuple[int, int]) -> Action | None:
        """Take in an event; answers what it asks of the window, if anything.

        Args:
            event: any of pygame's.
            size: of the window, pixels.
        """
        asked = None
        for move in self.moves(event, size):
            profile = self.profile(move.slot)
            if (move.slot, move.control) in self._off:
                if abs(move.value) < _BACK:
                    self._off.discard((move.slot, move.control))
            elif move.control in profile.hand.controls:
                self._ledger.put(move.slot, move.control, move.value, is_button=move.is_button)
            else:
                asked = self._asked(move, profile) or asked
        return asked

    def moves(self, event: pygame.Event, size: tuple[int, int]) -> tuple[Move, ...]:
        """What an event says of controls, bound or not. Each event goes here or to `handle`, not to both."""
        if event.type in PLUGGING:
            self._look_for_pads(getattr(event, "instance_id", None))
        elif event.type == pygame.WINDOWFOCUSLOST:
            self.release()
        elif event.type in (pygame.KEYDOWN, pygame.KEYUP):
            return self._key(event)
        elif event.type == pygame.MOUSEWHEEL and event.y:
            wheel = "wheel_up" if event.y > 0 else "wheel_down"
            return Move(MOUSE, wheel, 1.0, True), Move(MOUSE, wheel, 0.0, True)
        elif event.type in (pygame.MOUSEBUTTONDOWN, pygame.MOUSEBUTTONUP, pygame.MOUSEMOTION):
            return self._mouse(event, size)
        elif hasattr(event, "instance_id"):
            return self._pad(event)
        return ()

    def look(self) -> tuple[DeviceEvent, ...]:
        """What changed since the last look: one event a control, in the order it happened; a tap is not lost."""
        return self._ledger.look()

    def held(self) -> tuple[DeviceEvent, ...]:
        """All that was told and is not at zero: what an episode that begins now should hear first."""
        return self._ledger.held()

    def release(self) -> None:
        """Let go of everything. A key counts again once it is pressed, a stick once it was back at its middle."""
        self._drag = None
        self._pressed.clear()
        pads = [f"pad{slot}" for slot in self._pads]
        self._off |= {(pad, control) for pad in pads for control, value in self._ledger.now(pad).items() if value}
        self._ledger.let_go()

    def is_input(self, events: Iterable[DeviceEvent]) -> bool:
        """Whether any of the events just told drives: a bound control beyond its dead zone, other than the brake."""
        moved: dict[str, dict[str, float]] = {}
        for event in events:
            if event.value and self._is_here(event.device):
                moved.setdefault(event.device, dict(self._ledger.told(event.device)))[event.control] = event.value
        asked = [self.profile(slot).hand.read(values) for slot, values in moved.items()]
        return any(each[axis] for each in asked for axis in ("ahead", "left", "turn"))

    # What there is

    @property
    def drag(self) -> Drag | None:
        """The stick that the mouse is dragged for, to be drawn; None if it is not, or drives nothing."""
        return self._drag if {"drag_x", "drag_y"} & set(self.profile(MOUSE).hand.controls) else None

    @property
    def hands(self) -> Mapping[str, Hand]:
        """How each device is read now, for `Teleoperation`; `pad` reads what is plugged in later."""
        pads = {f"pad{slot}": self.profiles.of(guid).hand for slot, guid in enumerate(self._slots)}
        return {slot: self.profile(slot).hand for slot in (KEYBOARD, MOUSE)} | {"pad": HANDS["pad"]} | pads

    def reads_as(self, hands: Mapping[str, Hand]) -> bool:
        """Whether every pad that is there is read alike by other hands."""
        own = self.hands
        return all(hands.get(f"pad{k}", hands.get("pad")) == own[f"pad{k}"] for k in self._pads)

    def devices(self) -> list[Device]:
        """Everything that is there, keyboard and mouse first."""
        pads = [Device(f"pad{slot}", pad.name, pad.guid) for slot, pad in sorted(self._pads.items())]
        return [Device(KEYBOARD, "Keyboard", KEYBOARD), Device(MOUSE, "Mouse", MOUSE), *pads]

    def key(self, slot: str) -> str:
        """By what the profile of a device is kept."""
        return self._slots[int(slot[3:])] if slot.startswith("pad") else slot

    def profile(self, slot: str) -> Profile:
        """How a device is read."""
        return self.profiles.of(self.key(slot))

    def is_named(self, slot: str) -> bool:
        """Whether the controls of a device have names, as far as is known; else they are numbered."""
        pad = self._pads.get(int(slot[3:])) if slot.startswith("pad") else None
        return pad is None or pad.is_controller

    def take_lost(self) -> str | None:
        """The name of a device that was unplugged since; told once."""
        return self._lost.pop(0) if self._lost else None

    def take_found(self) -> str | None:
        """The name of a device that was plugged in since; told once."""
        return self._found.pop(0) if self._found else None

    # How it comes about

    def _is_here(self, slot: str) -> bool:
        return slot in (KEYBOARD, MOUSE) or (slot.startswith("pad") and int(slot[3:]) < len(self._slots))

    def _asked(self, move: Move, profile: Profile) -> Action | None:
        """The action that a control asks for as it is pressed, or as its axis passes the half; not while it is held."""
        asked = None
        for control, value in ((move.control, move.value), (f"-{move.control}", -move.value)):
            key = move.slot, control
            if value < _ARMS:
                self._pressed.discard(key)
            elif value > _ASKS and key not in self._pressed:
                self._pressed.add(key)
                asked = profile.actions.get(control, asked)
        return asked

    def _key(self, event: pygame.Event) -> tuple[Move, ...]:
        """A key; with Ctrl or Alt it is another control, and its release lets go of both."""
        key = key_of(event)
        if event.type == pygame.KEYDOWN:
            pygame.key.set_repeat(0)  # a text field may have left it on; it is none that took this key
            return (Move(KEYBOARD, with_modifiers(event), 1.0, True),)
        return tuple(Move(KEYBOARD, name, 0.0, True) for name in (key, f"ctrl+{key}", f"alt+{key}", f"ctrl+alt+{key}"))

    def _mouse(self, event: pygame.Event, size: tuple[int, int]) -> tuple[Move, ...]:
        if event.type == pygame.MOUSEMOTION:
            if self._drag is None:
                return ()
            if not getattr(event, "buttons", (1,))[0]:  # released where the window did not hear of it
                return self._dragged_to(None)
            return self._dragged_to(Drag(self._drag.anchor, event.pos, self._drag.radius))
        is_down = event.type == pygame.MOUSEBUTTONDOWN
        if event.button == pygame.BUTTON_LEFT:
            if is_down:
                return self._dragged_to(Drag(event.pos, event.pos, max(_REACH * min(size), 1.0)))
            return self._dragged_to(None) if self._drag else ()
        name = _BUTTONS.get(event.button)
        return (Move(MOUSE, name, float(is_down), True),) if name else ()

    def _dragged_to(self, drag: Drag | None) -> tuple[Move, ...]:
        """The stick of the mouse is there now; None: let go of. Right and down are positive, as with a pad's stick."""
        self._drag = drag
        x, y = ((drag.current[i] - drag.anchor[i]) / drag.radius if drag else 0.0 for i in (0, 1))
        return Move(MOUSE, "drag_x", _clipped(x), False), Move(MOUSE, "drag_y", _clipped(y), False)

    def _pad(self, event: pygame.Event) -> tuple[Move, ...]:
        for slot, pad in self._pads.items():
            if pad.instance == event.instance_id:
                return tuple(Move(f"pad{slot}", *reading) for reading in pad.read(event))
        return ()

    def _look_for_pads(self, removed: int | None = None) -> None:
        """Let go of the one that was removed, take in those that are new."""
        for slot in [slot for slot, pad in self._pads.items() if pad.instance == removed]:
            pad = self._pads.pop(slot)
            self._ledger.let_go(f"pad{slot}")
            self._pressed = {key for key in self._pressed if key[0] != f"pad{slot}"}
            self._off = {key for key in self._off if key[0] != f"pad{slot}"}
            self._lost.append(pad.name)
        if not self._can_plug:
            return
        for pad in self._plugs.plugged([pad.instance for pad in self._pads.values()]):
            self._pads[self._slot_for(pad)] = pad
            self._found.append(pad.name)

    def _slot_for(self, pad: Pad) -> int:
        """The slot that a pad of its make had, if that is free, else a new one."""
        for slot, guid in enumerate(self._slots):
            if guid == pad.guid and slot not in self._pads:
                return slot
        self._slots.append(pad.guid)
        return len(self._slots) - 1


def _clipped(value: float) -> float:
    return min(max(value, -1.0), 1.0)
