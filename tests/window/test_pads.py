"""Pads of SDL: virtual joysticks, connected by the test, take the same path as real pads."""

from __future__ import annotations

import ctypes
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pygame
import pytest
from pygame._sdl2 import controller

from sonata2d.window.actions import Action
from sonata2d.window.input import InputDevices
from sonata2d.window.profiles import DEFAULT_PROFILES

from . import fake_devices as p

_UNKNOWN, _GAMEPAD = 0, 1  # SDL's kinds of joystick
_A, _LEFT_SHOULDER = 0, 9


class VirtualPads:
    """SDL's virtual joysticks, which pygame does not provide."""

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
    monkeypatch.setenv("SDL_JOYSTICK_ALLOW_BACKGROUND_EVENTS", "1")  # the window of a test may have no focus
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


def process(devices: InputDevices) -> list[Action]:
    """Process SDL's events twice, because SDL reports a connection before the values."""
    return [action for _ in range(2) for action in p.feed(devices, *pygame.event.get())]


def instances() -> list[int]:
    return [pygame.joystick.Joystick(k).get_instance_id() for k in range(pygame.joystick.get_count())]


def test_a_pad_is_connected_read_disconnected_and_reconnected(pads: VirtualPads) -> None:
    devices = InputDevices(DEFAULT_PROFILES)
    pads.attach(_GAMEPAD)
    assert process(devices) == []
    assert p.polled(devices) == []
    assert devices.pop_connected() == p.connected(devices)["pad0"].name != ""
    assert p.connected(devices)["pad0"].is_controller
    (pad,) = instances()
    pads.axis(pad, 1, -32768)
    pads.button(pad, _A, 1)
    pads.button(pad, _LEFT_SHOULDER, 1)
    assert process(devices) == [Action.CONFIRM]
    assert p.polled(devices) == [("pad0", "left_y", -1.0), ("pad0", "left_shoulder", 1.0)]
    pads.detach(0)
    process(devices)
    assert {(c, v) for _, c, v in p.polled(devices)} == {("left_y", 0.0), ("left_shoulder", 0.0)}
    assert devices.pop_disconnected() is not None
    assert p.connected(devices) == {}
    pads.attach(_GAMEPAD)
    process(devices)
    assert list(p.connected(devices)) == ["pad0"]
    assert instances() != [pad]
    pads.detach(0)
    process(devices)


def test_a_device_without_names_is_read_by_numbers(pads: VirtualPads) -> None:
    pads.attach(_GAMEPAD)
    pads.attach(_UNKNOWN)
    devices = InputDevices(DEFAULT_PROFILES)
    process(devices)
    assert p.polled(devices) == []
    _, stick = instances()
    assert not p.connected(devices)["pad1"].is_controller
    pads.axis(stick, 1, -16384)
    pads.button(stick, 0, 1)
    assert process(devices) == [Action.CONFIRM]
    assert p.polled(devices) == [("pad1", "axis1", -0.5)]
    pads.detach(0)  # the other one: device indices change, instances do not
    process(devices)
    pads.axis(stick, 1, -32768)
    process(devices)
    assert p.polled(devices) == [("pad1", "axis1", -1.0)]
    pads.detach(0)
    process(devices)
