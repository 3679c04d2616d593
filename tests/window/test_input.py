"""Input devices: every change of a control becomes a device event or an action, and nothing else does."""

from __future__ import annotations

from dataclasses import replace

import pygame
import pytest

from sonata2d.agents.controllers.teleoperation import STOP
from sonata2d.core.devices import DeviceEvent
from sonata2d.window.actions import Action
from sonata2d.window.input import InputDevices
from sonata2d.window.profiles import DEFAULT_PROFILES

from . import fake_devices as p

W, UP, SPACE, H = pygame.K_w, pygame.K_UP, pygame.K_SPACE, pygame.K_h


@pytest.fixture(autouse=True)
def _display() -> None:
    pygame.display.init()
    pygame.display.set_mode(p.SIZE)


@pytest.fixture
def pads() -> p.FakePads:
    return p.FakePads()


@pytest.fixture
def devices(pads: p.FakePads) -> InputDevices:
    return InputDevices(DEFAULT_PROFILES, pads)


@pytest.fixture
def pad(devices: InputDevices, pads: p.FakePads) -> int:
    instance = pads.plug()
    p.feed(devices, p.plugged_in())
    return instance


# Keyboard


def test_keys_are_reported_by_name_in_order(devices: InputDevices) -> None:
    p.feed(devices, p.key(SPACE), p.key(W), p.key(UP))
    assert p.polled(devices) == [("keyboard", "space", 1.0), ("keyboard", "w", 1.0), ("keyboard", "up", 1.0)]
    assert p.polled(devices) == []
    p.feed(devices, p.key(W, down=False))
    assert p.polled(devices) == [("keyboard", "w", 0.0)]


def test_a_tap_between_two_polls_is_reported_for_one_poll(devices: InputDevices) -> None:
    p.feed(devices, p.key(W), p.key(W, down=False))
    assert p.polled(devices) == [("keyboard", "w", 1.0)]
    assert p.polled(devices) == [("keyboard", "w", 0.0)]
    assert p.polled(devices) == []


def test_a_key_pressed_again_after_a_tap_stays_pressed(devices: InputDevices) -> None:
    p.feed(devices, p.key(W), p.key(W, down=False), p.key(W))
    assert p.polled(devices) == [("keyboard", "w", 1.0)]
    assert p.polled(devices) == []


def test_two_taps_in_two_polls_are_both_reported(devices: InputDevices) -> None:
    p.feed(devices, p.key(W), p.key(W, down=False))
    first = p.polled(devices)
    p.feed(devices, p.key(W), p.key(W, down=False))
    assert first == [("keyboard", "w", 1.0)]
    assert sum(value for _, _, value in p.polled(devices) + p.polled(devices)) <= 1.0
    assert devices.active() == ()


def test_key_repeat_gives_no_events_and_one_action(devices: InputDevices) -> None:
    assert p.feed(devices, p.key(W), p.key(H)) == [Action.HUD]
    assert len(p.polled(devices)) == 1
    assert p.feed(devices, p.key(W), p.key(W), p.key(H), p.key(H)) == []
    assert p.polled(devices) == []
    assert p.feed(devices, p.key(H, down=False), p.key(H)) == [Action.HUD]


def test_a_key_without_driving_assignment_gives_no_event(devices: InputDevices) -> None:
    p.feed(devices, p.key(H), p.key(pygame.K_j))
    assert p.polled(devices) == []


def test_a_key_with_ctrl_does_not_drive(devices: InputDevices) -> None:
    assert p.feed(devices, p.key(W, mod=pygame.KMOD_LCTRL)) == []
    assert p.polled(devices) == []
    assert p.feed(devices, p.key(pygame.K_z, mod=pygame.KMOD_LCTRL)) == [Action.UNDO]
    p.feed(devices, p.key(pygame.K_z, down=False))
    assert p.feed(devices, p.key(pygame.K_z)) == [Action.ZONES]


def test_a_key_released_while_ctrl_is_held_is_released(devices: InputDevices) -> None:
    p.feed(devices, p.key(W))
    devices.poll()
    p.feed(devices, p.key(W, down=False, mod=pygame.KMOD_LCTRL))
    assert p.polled(devices) == [("keyboard", "w", 0.0)]


def test_keys_of_other_layouts_are_identified_by_position(devices: InputDevices) -> None:
    french_1, russian_w = p.key(pygame.K_AMPERSAND, scancode=pygame.KSCAN_1), p.key(0x446, scancode=pygame.KSCAN_W)
    assert p.feed(devices, french_1, russian_w) == [Action.LABEL_1]
    assert p.polled(devices) == [("keyboard", "w", 1.0)]


def test_no_default_control_both_drives_and_requests_an_action() -> None:
    for profile in DEFAULT_PROFILES.values():
        assert not set(profile.mapping.controls) & {control.lstrip("-") or "-" for control in profile.actions}


def test_default_keys_request_the_actions_of_the_help_page(devices: InputDevices) -> None:
    wheel = pygame.event.Event(pygame.MOUSEWHEEL, y=1, x=0)
    keys = [p.key(code) for code in (pygame.K_RETURN, pygame.K_ESCAPE, pygame.K_7, pygame.K_PAGEDOWN, W)]
    actions = [Action.CONFIRM, Action.MENU, Action.LABEL_7, Action.LABEL_DOWN, Action.LABEL_UP]
    assert p.feed(devices, *keys, wheel, p.key(W, down=False)) == actions
    assert Action.LABEL_7.level == 7
    assert set(Action) - {Action.NEW_PERSON} == set(DEFAULT_PROFILES["keyboard"].actions.values()), (
        "a new person comes by the menu"
    )


# Mouse


def test_dragging_is_a_stick_that_springs_back(devices: InputDevices) -> None:
    p.feed(devices, p.mouse(pygame.MOUSEBUTTONDOWN, 300, 200), p.mouse(pygame.MOUSEMOTION, 355, 90))
    assert p.polled(devices) == [("mouse", "drag_x", 0.5), ("mouse", "drag_y", -1.0)]
    joystick = devices.joystick
    assert joystick is not None
    assert (joystick.anchor, joystick.position) == ((300, 200), (355, 90))
    assert joystick.radius == pytest.approx(110.0)
    p.feed(devices, p.mouse(pygame.MOUSEBUTTONUP, 355, 90))
    assert devices.joystick is None
    assert p.polled(devices) == [("mouse", "drag_x", 0.0), ("mouse", "drag_y", 0.0)]


def test_dragging_far_gives_full_deflection(devices: InputDevices) -> None:
    p.feed(devices, p.mouse(pygame.MOUSEBUTTONDOWN, 500, 250), p.mouse(pygame.MOUSEMOTION, 5000, -4000))
    assert p.polled(devices) == [("mouse", "drag_x", 1.0), ("mouse", "drag_y", -1.0)]


def test_moving_the_mouse_without_its_button_gives_no_event(devices: InputDevices) -> None:
    p.feed(devices, p.mouse(pygame.MOUSEMOTION, 900, 40, held=False))
    p.feed(devices, p.mouse(pygame.MOUSEBUTTONDOWN, 10, 10, number=3), p.mouse(pygame.MOUSEMOTION, 90, 90, held=False))
    assert p.polled(devices) == []


def test_a_button_released_outside_the_window_releases_the_joystick(devices: InputDevices) -> None:
    p.feed(devices, p.mouse(pygame.MOUSEBUTTONDOWN, 300, 200), p.mouse(pygame.MOUSEMOTION, 400, 200))
    devices.poll()
    p.feed(devices, p.mouse(pygame.MOUSEMOTION, 100, 200, held=False))
    assert p.polled(devices) == [("mouse", "drag_x", 0.0)]


def test_each_notch_of_the_wheel_requests_an_action(devices: InputDevices) -> None:
    notch = pygame.event.Event(pygame.MOUSEWHEEL, x=0, y=-1)
    assert p.feed(devices, notch, notch) == [Action.LABEL_DOWN] * 2


# Pads


def test_sticks_report_their_latest_value_once_per_poll(devices: InputDevices, pad: int) -> None:
    p.feed(devices, *(p.axis(pad, "left_y", -k / 10) for k in range(11)))
    assert p.polled(devices) == [("pad0", "left_y", -1.0)]


def test_the_lowest_value_of_sdl_is_minus_one(devices: InputDevices, pad: int) -> None:
    p.feed(devices, pygame.event.Event(pygame.CONTROLLERAXISMOTION, instance_id=pad, axis=0, value=-32768))
    assert p.polled(devices) == [("pad0", "left_x", -1.0)]


def test_jitter_is_suppressed_but_the_centre_is_reported(devices: InputDevices, pad: int) -> None:
    p.feed(devices, p.axis(pad, "left_x", 0.5))
    devices.poll()
    p.feed(devices, p.axis(pad, "left_x", 0.505))
    assert p.polled(devices) == []
    p.feed(devices, p.axis(pad, "left_x", 0.52))
    assert len(p.polled(devices)) == 1
    p.feed(devices, p.axis(pad, "left_x", 0.008))
    devices.poll()
    p.feed(devices, p.axis(pad, "left_x", 0.0))
    assert p.polled(devices) == [("pad0", "left_x", 0.0)]


def test_the_position_at_connection_is_no_input(devices: InputDevices, pads: p.FakePads) -> None:
    instance = pads.plug(p.STICK, named=False)
    p.feed(devices, p.plugged_in(), p.raw_axis(instance, 1, -1.0), p.raw_axis(instance, 0, 0.4))
    assert p.polled(devices) == []
    p.feed(devices, p.raw_axis(instance, 0, 0.9))
    assert p.polled(devices) == [("pad0", "axis0", 0.9)]


def test_an_unnamed_axis_that_rests_at_its_end_is_a_trigger(devices: InputDevices, pads: p.FakePads) -> None:
    instance = pads.plug(p.STICK, named=False)
    p.feed(devices, p.plugged_in(), p.raw_axis(instance, 1, -1.0), p.raw_axis(instance, 1, 0.0))
    assert p.polled(devices) == [("pad0", "axis1", 0.5)]


def test_a_named_pad_is_reported_once(devices: InputDevices, pad: int) -> None:
    p.feed(devices, p.raw_axis(pad, 0, 1.0), p.axis(pad, "left_x", 1.0), p.raw_axis(pad, 1, 1.0))
    p.feed(devices, pygame.event.Event(pygame.CONTROLLERDEVICEADDED, device_index=0), p.plugged_in())
    assert p.polled(devices) == [("pad0", "left_x", 1.0)]
    assert list(p.connected(devices)) == ["pad0"]


def test_buttons_and_triggers_request_actions_when_pressed(devices: InputDevices, pad: int) -> None:
    assert p.feed(devices, p.button(pad, "a"), p.button(pad, "a", down=False)) == [Action.CONFIRM]
    assert p.feed(devices, *(p.axis(pad, "right_trigger", v) for v in (0.3, 0.6, 0.5, 0.6, 1.0))) == [Action.LABEL_UP]
    assert p.feed(devices, *(p.axis(pad, "right_trigger", v) for v in (0.2, 0.9))) == [Action.LABEL_UP]
    assert p.polled(devices) == []


def test_buttons_x_and_y_are_not_a_stick(devices: InputDevices, pad: int) -> None:
    assert p.feed(devices, p.button(pad, "x"), p.button(pad, "y")) == [Action.REDO, Action.NEXT]


def test_events_of_unknown_devices_are_ignored(devices: InputDevices) -> None:
    assert p.feed(devices, p.axis(99, "left_x", 1.0), p.unplugged(98), p.raw_axis(97, 0, 1.0)) == []
    assert p.polled(devices) == []


def test_disconnecting_releases_and_names_the_device(devices: InputDevices, pads: p.FakePads, pad: int) -> None:
    assert devices.pop_connected() == "Pad"
    p.feed(devices, p.axis(pad, "left_y", -1.0), p.button(pad, "left_shoulder"), p.key(W))
    devices.poll()
    pads.unplug(pad)
    p.feed(devices, p.unplugged(pad), p.unplugged(pad))
    assert p.polled(devices) == [("pad0", "left_y", 0.0), ("pad0", "left_shoulder", 0.0)]
    assert (devices.pop_disconnected(), devices.pop_disconnected()) == ("Pad", None)
    assert p.connected(devices) == {}


def test_a_reconnected_pad_has_its_old_slot(devices: InputDevices, pads: p.FakePads, pad: int) -> None:
    other = pads.plug(p.STICK, named=False)
    p.feed(devices, p.plugged_in())
    for instance in (pad, other):
        pads.unplug(instance)
        p.feed(devices, p.unplugged(instance))
    pads.plug(p.STICK, named=False)
    again = pads.plug()
    p.feed(devices, p.plugged_in())
    assert {slot: pad.name for slot, pad in p.connected(devices).items()} == {"pad0": p.XBOX, "pad1": p.STICK}
    p.feed(devices, p.axis(again, "left_x", 1.0))
    assert p.polled(devices) == [("pad0", "left_x", 1.0)]


def test_two_pads_of_one_model_are_two_devices(devices: InputDevices, pads: p.FakePads, pad: int) -> None:
    second = pads.plug()
    p.feed(devices, p.plugged_in(), p.axis(second, "left_x", 1.0), p.axis(pad, "left_x", -1.0))
    assert p.polled(devices) == [("pad1", "left_x", 1.0), ("pad0", "left_x", -1.0)]


def test_pads_connected_from_the_start_are_not_announced(pads: p.FakePads) -> None:
    pads.plug()
    devices = InputDevices(DEFAULT_PROFILES, pads)
    assert devices.pop_connected() is None
    assert list(p.connected(devices)) == ["pad0"]


def test_without_joysticks_keyboard_and_mouse_still_drive() -> None:
    devices = InputDevices(DEFAULT_PROFILES, p.FakePads(works=False))
    p.feed(devices, p.plugged_in(), p.key(W))
    assert p.polled(devices) == [("keyboard", "w", 1.0)]


# Release


def test_losing_the_focus_releases_everything(devices: InputDevices, pad: int) -> None:
    p.feed(devices, p.key(W), p.axis(pad, "left_x", 0.7), p.mouse(pygame.MOUSEBUTTONDOWN, 1, 1))
    p.feed(devices, p.mouse(pygame.MOUSEMOTION, 90, 1))
    devices.poll()
    p.feed(devices, pygame.event.Event(pygame.WINDOWFOCUSLOST))
    assert {(d, c): v for d, c, v in p.polled(devices)} == {
        ("keyboard", "w"): 0.0, ("pad0", "left_x"): 0.0, ("mouse", "drag_x"): 0.0,
    }  # fmt: skip
    assert (devices.active(), devices.joystick) == ((), None)


def test_a_tap_before_the_release_is_dropped(devices: InputDevices) -> None:
    p.feed(devices, p.key(W), p.key(W, down=False))
    devices.release()
    assert p.polled(devices) == []


def test_a_release_during_a_tap_still_reports_its_end(devices: InputDevices) -> None:
    p.feed(devices, p.key(W), p.key(W, down=False))
    devices.poll()
    devices.release()
    assert p.polled(devices) == [("keyboard", "w", 0.0)]


def test_held_controls_are_active(devices: InputDevices, pad: int) -> None:
    p.feed(devices, p.key(W), p.axis(pad, "left_x", 0.5))
    devices.poll()
    assert sorted(map(p.as_tuple, devices.active())) == [("keyboard", "w", 1.0), ("pad0", "left_x", 0.5)]


# What counts as driving


def test_a_drifting_stick_and_the_brake_do_not_count_as_driving(devices: InputDevices, pad: int) -> None:
    p.feed(devices, p.axis(pad, "left_x", 0.06), p.axis(pad, "left_y", 0.06), p.button(pad, "left_shoulder"))
    p.feed(devices, p.key(SPACE))
    events = devices.poll()
    assert len(events) == 4
    assert not devices.is_driving(events)
    p.feed(devices, p.axis(pad, "left_x", 0.085), p.axis(pad, "left_y", 0.085))  # together beyond 0.1
    assert devices.is_driving(devices.poll())


def test_releases_and_labels_do_not_count_as_driving(devices: InputDevices) -> None:
    p.feed(devices, p.key(W))
    assert devices.is_driving(devices.poll())
    p.feed(devices, p.key(W, down=False))
    assert not devices.is_driving(devices.poll())
    assert not devices.is_driving([DeviceEvent("label", "slider", 1.0), DeviceEvent("pad7", "left_x", 1.0), STOP])


def test_mappings_use_the_profile_of_each_pad(pads: p.FakePads) -> None:
    stock = DEFAULT_PROFILES["pad"]
    own = replace(stock, mapping=replace(stock.mapping, dead_zone=0.4))
    pads.plug()
    devices = InputDevices({**DEFAULT_PROFILES, f"pads.{p.XBOX}": own}, pads)
    assert devices.mappings["pad0"].dead_zone == 0.4
    assert devices.mappings["pad"] == stock.mapping
    assert set(devices.mappings) == {"keyboard", "mouse", "pad", "pad0"}
