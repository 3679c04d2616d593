"""Pads as SDL has them: its own virtual joysticks, plugged in from here, go the whole way that a real pad goes."""

from __future__ import annotations

import ctypes
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pygame
import pytest
from pygame._sdl2 import controller

from sonata2d.window.actions import Action
from sonata2d.window.hands import Hands
from sonata2d.window.profiles import Profiles

from . import fake_devices as p

_UNKNOWN, _GAMEPAD = 0, 1  # SDL's kinds of joystick
_A, _LEFT_SHOULDER = 0, 9


class VirtualPads:
    """SDL's virtual joysticks, which pygame does not offer."""

    def __init__(self, sdl: Any) -> None:
        self._sdl = sdl
        sdl.SDL_JoystickFromInstanceID.restype = ctypes.c_void_p

    def attach(self, kind: int) -> None:
        assert self._sdl.SDL_JoystickAttachVirtual(kind, 6, 15, 1) >= 0

    def detach(self, index: int) -> None:
        assert self._sdl.SDL_JoystickDetachVirtual(index) == 0

    def axis(self, instance: int, number: int, value: int) -> None:
        self._sdl.SDL_JoystickSetVirtualAxis(self._opened(instance), number, ctypes.c_int16(value))

    def button(self, instance: int, number: int, value: int) -> None:
        self._sdl.SDL_JoystickSetVirtualButton(self._opened(instance), number, ctypes.c_uint8(value))

    def _opened(self, instance: int) -> ctypes.c_void_p:
        return ctypes.c_void_p(self._sdl.SDL_JoystickFromInstanceID(instance))


@pytest.fixture
def pads(monkeypatch: pytest.MonkeyPatch) -> Iterator[VirtualPads]:
    monkeypatch.setenv("SDL_JOYSTICK_ALLOW_BACKGROUND_EVENTS", "1")  # the window of a test has the focus or not
    controller.quit()
    pygame.quit()
    pygame.display.init()
    pygame.display.set_mode(p.SIZE)
    maps = Path("/proc/self/maps")
    loaded = (
        {line.split()[-1] for line in maps.read_text().splitlines() if "libSDL2-2" in line} if maps.exists() else ()
    )
    sdl: Any = ctypes.CDLL(next(iter(loaded))) if loaded else None
    if not hasattr(sdl, "SDL_JoystickAttachVirtual"):
        pytest.skip("SDL's virtual joysticks cannot be reached here")
    yield VirtualPads(sdl)
    controller.quit()
    pygame.quit()


def turn(hands: Hands) -> list[Action]:
    """Hand on what SDL tells, twice, since it tells of a plugging in before it tells of values."""
    return [action for _ in range(2) for action in p.feed(hands, *pygame.event.get())]


def instances(hands: Hands) -> list[int]:
    return [pad.instance for _, pad in sorted(hands._pads.items())]


def test_a_pad_is_found_read_lost_and_found_again(pads: VirtualPads, tmp_path: Path) -> None:
    hands = Hands(Profiles(tmp_path))
    pads.attach(_GAMEPAD)
    assert turn(hands) == []
    assert p.told(hands) == []
    assert hands.take_found() == hands.devices()[-1].name != ""
    assert hands.is_named("pad0")
    (pad,) = instances(hands)
    pads.axis(pad, 1, -32768)
    pads.button(pad, _A, 1)
    pads.button(pad, _LEFT_SHOULDER, 1)
    assert turn(hands) == [Action.CONFIRM]
    assert p.told(hands) == [("pad0", "left_y", -1.0), ("pad0", "left_shoulder", 1.0)]
    pads.detach(0)
    turn(hands)
    assert {(c, v) for _, c, v in p.told(hands)} == {("left_y", 0.0), ("left_shoulder", 0.0)}
    assert hands.take_lost() is not None
    assert len(hands.devices()) == 2
    pads.attach(_GAMEPAD)
    turn(hands)
    assert [device.slot for device in hands.devices()[2:]] == ["pad0"]
    assert instances(hands) != [pad]
    pads.detach(0)
    turn(hands)


def test_a_device_without_names_is_read_by_numbers(pads: VirtualPads, tmp_path: Path) -> None:
    pads.attach(_GAMEPAD)
    pads.attach(_UNKNOWN)
    hands = Hands(Profiles(tmp_path))
    turn(hands)
    assert p.told(hands) == []
    _, stick = instances(hands)
    assert not hands.is_named("pad1")
    pads.axis(stick, 1, -16384)
    pads.button(stick, 0, 1)
    assert turn(hands) == [Action.CONFIRM]
    assert p.told(hands) == [("pad1", "axis1", -0.5)]
    pads.detach(0)  # the other one: numbers of places move, ours does not
    turn(hands)
    pads.axis(stick, 1, -32768)
    turn(hands)
    assert p.told(hands) == [("pad1", "axis1", -1.0)]
    pads.detach(0)
    turn(hands)
