"""What hands do becomes device events, none lost and none invented."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pygame
import pytest

from sonata2d.agents.controllers.teleoperation import STOP
from sonata2d.core.devices import DeviceEvent
from sonata2d.window.actions import KEYBOARD_ACTIONS, Action, action_of, in_words
from sonata2d.window.hands import Hands
from sonata2d.window.pads import AXES, BUTTONS
from sonata2d.window.profiles import Profile, Profiles

from . import fake_devices as p

W, UP, SPACE, H = pygame.K_w, pygame.K_UP, pygame.K_SPACE, pygame.K_h


@pytest.fixture(autouse=True)
def _window() -> object:
    pygame.display.init()
    pygame.display.set_mode(p.SIZE)
    yield
    pygame.display.quit()


@pytest.fixture
def plugs() -> p.PretendPlugs:
    return p.PretendPlugs()


@pytest.fixture
def hands(plugs: p.PretendPlugs, tmp_path: Path) -> Hands:
    return Hands(Profiles(tmp_path), plugs)


@pytest.fixture
def pad(hands: Hands, plugs: p.PretendPlugs) -> int:
    instance = plugs.plug()
    p.feed(hands, p.plugged_in())
    return instance


# Keyboard


def test_keys_are_told_by_name_in_the_order_they_were_pressed(hands: Hands) -> None:
    p.feed(hands, p.key(SPACE), p.key(W), p.key(UP))
    assert p.told(hands) == [("keyboard", "space", 1.0), ("keyboard", "w", 1.0), ("keyboard", "up", 1.0)]
    assert p.told(hands) == []
    p.feed(hands, p.key(W, down=False))
    assert p.told(hands) == [("keyboard", "w", 0.0)]


def test_a_tap_between_two_looks_lasts_one_look(hands: Hands) -> None:
    p.feed(hands, p.key(W), p.key(W, down=False))
    assert p.told(hands) == [("keyboard", "w", 1.0)]
    assert p.told(hands) == [("keyboard", "w", 0.0)]
    assert p.told(hands) == []


def test_a_key_pressed_again_after_a_tap_stays_pressed(hands: Hands) -> None:
    p.feed(hands, p.key(W), p.key(W, down=False), p.key(W))
    assert p.told(hands) == [("keyboard", "w", 1.0)]
    assert p.told(hands) == []


def test_two_taps_in_two_looks_are_both_told(hands: Hands) -> None:
    p.feed(hands, p.key(W), p.key(W, down=False))
    first = p.told(hands)
    p.feed(hands, p.key(W), p.key(W, down=False))
    assert first == [("keyboard", "w", 1.0)]
    assert sum(value for _, _, value in p.told(hands) + p.told(hands)) <= 1.0
    assert hands.held() == ()


def test_key_repeat_makes_no_events_and_asks_once(hands: Hands) -> None:
    assert p.feed(hands, p.key(W), p.key(H)) == [Action.HUD]
    assert len(p.told(hands)) == 1
    assert p.feed(hands, p.key(W), p.key(W), p.key(H), p.key(H)) == []
    assert p.told(hands) == []
    assert p.feed(hands, p.key(H, down=False), p.key(H)) == [Action.HUD]


def test_a_key_that_drives_nothing_is_no_input(hands: Hands) -> None:
    p.feed(hands, p.key(H), p.key(pygame.K_j))
    assert p.told(hands) == []


def test_a_key_with_ctrl_does_not_drive(hands: Hands) -> None:
    assert p.feed(hands, p.key(W, mod=pygame.KMOD_LCTRL)) == []
    assert p.told(hands) == []
    assert p.feed(hands, p.key(pygame.K_z, mod=pygame.KMOD_LCTRL)) == [Action.UNDO]
    p.feed(hands, p.key(pygame.K_z, down=False))
    assert p.feed(hands, p.key(pygame.K_z)) == [Action.ZONES]


def test_a_key_let_go_while_ctrl_is_held_is_let_go(hands: Hands) -> None:
    p.feed(hands, p.key(W))
    hands.look()
    p.feed(hands, p.key(W, down=False, mod=pygame.KMOD_LCTRL))
    assert p.told(hands) == [("keyboard", "w", 0.0)]


def test_digits_and_letters_of_other_layouts_go_by_place(hands: Hands) -> None:
    french_1, russian_w = p.key(pygame.K_AMPERSAND, scancode=pygame.KSCAN_1), p.key(0x446, scancode=pygame.KSCAN_W)
    assert p.feed(hands, french_1, russian_w) == [Action.LABEL_1]
    assert p.told(hands) == [("keyboard", "w", 1.0)]


def test_no_key_both_drives_and_asks() -> None:
    for kind in ("keyboard", "mouse", "pad"):
        profile = Profile.stock(kind)
        assert not set(profile.hand.controls) & {control.lstrip("-") or "-" for control in profile.actions}


def test_stock_keys_ask_for_what_help_says() -> None:
    assert action_of(p.key(pygame.K_RETURN)) is Action.CONFIRM
    assert action_of(p.key(pygame.K_ESCAPE)) is Action.MENU
    assert action_of(p.key(pygame.K_7)) is Action.LABEL_7
    assert Action.LABEL_7.level == 7
    assert action_of(p.key(pygame.K_PAGEDOWN)) is Action.LABEL_DOWN
    assert action_of(pygame.event.Event(pygame.MOUSEWHEEL, y=1, x=0)) is Action.LABEL_UP
    assert action_of(p.key(W)) is None
    assert action_of(p.key(W, down=False)) is None
    assert set(Action) == set(KEYBOARD_ACTIONS.values())


def test_every_control_has_words() -> None:
    controls = [c for kind in ("keyboard", "mouse", "pad") for c in (*Profile.stock(kind).actions, *BUTTONS, *AXES)]
    assert all(in_words(control).strip() and "_" not in in_words(control) for control in controls)


# Mouse


def test_dragging_is_a_stick_that_springs_back(hands: Hands) -> None:
    p.feed(hands, p.mouse(pygame.MOUSEBUTTONDOWN, 300, 200), p.mouse(pygame.MOUSEMOTION, 355, 90))
    assert p.told(hands) == [("mouse", "drag_x", 0.5), ("mouse", "drag_y", -1.0)]
    drag = hands.drag
    assert drag is not None
    assert (drag.anchor, drag.current) == ((300, 200), (355, 90))
    assert drag.radius == pytest.approx(110.0)
    p.feed(hands, p.mouse(pygame.MOUSEBUTTONUP, 355, 90))
    assert hands.drag is None
    assert p.told(hands) == [("mouse", "drag_x", 0.0), ("mouse", "drag_y", 0.0)]


def test_dragging_far_is_a_full_stick(hands: Hands) -> None:
    p.feed(hands, p.mouse(pygame.MOUSEBUTTONDOWN, 500, 250), p.mouse(pygame.MOUSEMOTION, 5000, -4000))
    assert p.told(hands) == [("mouse", "drag_x", 1.0), ("mouse", "drag_y", -1.0)]


def test_moving_the_mouse_without_its_button_is_nothing(hands: Hands) -> None:
    p.feed(hands, p.mouse(pygame.MOUSEMOTION, 900, 40, held=False))
    p.feed(hands, p.mouse(pygame.MOUSEBUTTONDOWN, 10, 10, number=3), p.mouse(pygame.MOUSEMOTION, 90, 90, held=False))
    assert p.told(hands) == []


def test_a_release_that_the_window_did_not_hear_of_lets_go(hands: Hands) -> None:
    p.feed(hands, p.mouse(pygame.MOUSEBUTTONDOWN, 300, 200), p.mouse(pygame.MOUSEMOTION, 400, 200))
    hands.look()
    p.feed(hands, p.mouse(pygame.MOUSEMOTION, 100, 200, held=False))
    assert p.told(hands) == [("mouse", "drag_x", 0.0)]


def test_each_notch_of_the_wheel_asks(hands: Hands) -> None:
    notch = pygame.event.Event(pygame.MOUSEWHEEL, x=0, y=-1)
    assert p.feed(hands, notch, notch) == [Action.LABEL_DOWN] * 2


# Pads


def test_sticks_are_told_latest_value_once_a_look(hands: Hands, pad: int) -> None:
    p.feed(hands, *(p.axis(pad, "left_y", -k / 10) for k in range(11)))
    assert p.told(hands) == [("pad0", "left_y", -1.0)]


def test_the_lowest_value_of_sdl_is_minus_one(hands: Hands, pad: int) -> None:
    p.feed(hands, pygame.event.Event(pygame.CONTROLLERAXISMOTION, instance_id=pad, axis=0, value=-32768))
    assert p.told(hands) == [("pad0", "left_x", -1.0)]


def test_jitter_is_not_told_but_coming_to_rest_is(hands: Hands, pad: int) -> None:
    p.feed(hands, p.axis(pad, "left_x", 0.5))
    hands.look()
    p.feed(hands, p.axis(pad, "left_x", 0.505))
    assert p.told(hands) == []
    p.feed(hands, p.axis(pad, "left_x", 0.52))
    assert len(p.told(hands)) == 1
    p.feed(hands, p.axis(pad, "left_x", 0.008))
    hands.look()
    p.feed(hands, p.axis(pad, "left_x", 0.0))
    assert p.told(hands) == [("pad0", "left_x", 0.0)]


def test_where_a_stick_stands_when_plugged_in_is_no_input(hands: Hands, plugs: p.PretendPlugs) -> None:
    instance = plugs.plug(p.STICK, named=False)
    p.feed(hands, p.plugged_in(), p.raw_axis(instance, 1, -1.0), p.raw_axis(instance, 0, 0.4))
    assert p.told(hands) == []
    p.feed(hands, p.raw_axis(instance, 0, 0.9))
    assert p.told(hands) == [("pad0", "axis0", 0.9)]


def test_an_unnamed_axis_that_rests_at_its_end_is_a_trigger(hands: Hands, plugs: p.PretendPlugs) -> None:
    instance = plugs.plug(p.STICK, named=False)
    p.feed(hands, p.plugged_in(), p.raw_axis(instance, 1, -1.0), p.raw_axis(instance, 1, 0.0))
    assert p.told(hands) == [("pad0", "axis1", 0.5)]


def test_a_named_pad_is_not_heard_twice(hands: Hands, pad: int) -> None:
    p.feed(hands, p.raw_axis(pad, 0, 1.0), p.axis(pad, "left_x", 1.0), p.raw_axis(pad, 1, 1.0))
    p.feed(hands, pygame.event.Event(pygame.CONTROLLERDEVICEADDED, device_index=0), p.plugged_in())
    assert p.told(hands) == [("pad0", "left_x", 1.0)]
    assert [device.slot for device in hands.devices()] == ["keyboard", "mouse", "pad0"]


def test_buttons_and_triggers_ask_as_they_are_pressed(hands: Hands, pad: int) -> None:
    assert p.feed(hands, p.button(pad, "a"), p.button(pad, "a", down=False)) == [Action.CONFIRM]
    assert p.feed(hands, *(p.axis(pad, "right_trigger", v) for v in (0.3, 0.6, 0.5, 0.6, 1.0))) == [Action.LABEL_UP]
    assert p.feed(hands, *(p.axis(pad, "right_trigger", v) for v in (0.2, 0.9))) == [Action.LABEL_UP]
    assert p.told(hands) == []


def test_buttons_x_and_y_are_no_stick(hands: Hands, pad: int) -> None:
    assert p.feed(hands, p.button(pad, "x"), p.button(pad, "y")) == [Action.REDO, Action.NEXT]


def test_events_of_devices_nobody_knows_are_nothing(hands: Hands) -> None:
    assert p.feed(hands, p.axis(99, "left_x", 1.0), p.unplugged(98), p.raw_axis(97, 0, 1.0)) == []
    assert p.told(hands) == []


def test_unplugging_lets_go_and_names_the_device(hands: Hands, plugs: p.PretendPlugs, pad: int) -> None:
    assert hands.take_found() == "Pad"
    p.feed(hands, p.axis(pad, "left_y", -1.0), p.button(pad, "left_shoulder"), p.key(W))
    hands.look()
    plugs.unplug(pad)
    p.feed(hands, p.unplugged(pad), p.unplugged(pad))
    assert p.told(hands) == [("pad0", "left_y", 0.0), ("pad0", "left_shoulder", 0.0)]
    assert (hands.take_lost(), hands.take_lost()) == ("Pad", None)
    assert [device.slot for device in hands.devices()] == ["keyboard", "mouse"]


def test_a_pad_that_comes_back_has_its_old_slot(hands: Hands, plugs: p.PretendPlugs, pad: int) -> None:
    other = plugs.plug(p.STICK, "Stick", named=False)
    p.feed(hands, p.plugged_in())
    for instance in (pad, other):
        plugs.unplug(instance)
        p.feed(hands, p.unplugged(instance))
    plugs.plug(p.STICK, "Stick", named=False)
    again = plugs.plug()
    p.feed(hands, p.plugged_in())
    assert {device.slot: device.key for device in hands.devices()[2:]} == {"pad0": p.XBOX, "pad1": p.STICK}
    p.feed(hands, p.axis(again, "left_x", 1.0))
    assert p.told(hands) == [("pad0", "left_x", 1.0)]


def test_two_pads_of_one_make_are_two_devices(hands: Hands, plugs: p.PretendPlugs, pad: int) -> None:
    second = plugs.plug()
    p.feed(hands, p.plugged_in(), p.axis(second, "left_x", 1.0), p.axis(pad, "left_x", -1.0))
    assert p.told(hands) == [("pad1", "left_x", 1.0), ("pad0", "left_x", -1.0)]


def test_pads_that_were_there_from_the_start_are_no_news(plugs: p.PretendPlugs, tmp_path: Path) -> None:
    plugs.plug()
    hands = Hands(Profiles(tmp_path), plugs)
    assert hands.take_found() is None
    assert hands.devices()[-1].slot == "pad0"


def test_without_joysticks_keyboard_and_mouse_still_drive(tmp_path: Path) -> None:
    hands = Hands(Profiles(tmp_path), p.PretendPlugs(works=False))
    p.feed(hands, p.plugged_in(), p.key(W))
    assert p.told(hands) == [("keyboard", "w", 1.0)]


# Letting go


def test_losing_the_focus_lets_go_of_everything(hands: Hands, pad: int) -> None:
    p.feed(hands, p.key(W), p.axis(pad, "left_x", 0.7), p.mouse(pygame.MOUSEBUTTONDOWN, 1, 1))
    p.feed(hands, p.mouse(pygame.MOUSEMOTION, 90, 1))
    hands.look()
    p.feed(hands, pygame.event.Event(pygame.WINDOWFOCUSLOST))
    assert {(d, c): v for d, c, v in p.told(hands)} == {
        ("keyboard", "w"): 0.0, ("pad0", "left_x"): 0.0, ("mouse", "drag_x"): 0.0,
    }  # fmt: skip
    assert (hands.held(), hands.drag) == ((), None)


def test_a_tap_before_letting_go_is_dropped(hands: Hands) -> None:
    p.feed(hands, p.key(W), p.key(W, down=False))
    hands.release()
    assert p.told(hands) == []


def test_letting_go_within_a_tap_still_tells_its_end(hands: Hands) -> None:
    p.feed(hands, p.key(W), p.key(W, down=False))
    hands.look()
    hands.release()
    assert p.told(hands) == [("keyboard", "w", 0.0)]


def test_what_is_held_is_known_to_who_comes_late(hands: Hands, pad: int) -> None:
    p.feed(hands, p.key(W), p.axis(pad, "left_x", 0.5))
    hands.look()
    assert sorted(map(p.short, hands.held())) == [("keyboard", "w", 1.0), ("pad0", "left_x", 0.5)]


# What counts as driving


def test_a_drifting_stick_and_the_brake_do_not_start_the_world(hands: Hands, pad: int) -> None:
    p.feed(hands, p.axis(pad, "left_x", 0.06), p.axis(pad, "left_y", 0.06), p.button(pad, "left_shoulder"))
    p.feed(hands, p.key(SPACE))
    events = hands.look()
    assert len(events) == 4
    assert not hands.is_input(events)
    p.feed(hands, p.axis(pad, "left_x", 0.085), p.axis(pad, "left_y", 0.085))  # together beyond 0.1
    assert hands.is_input(hands.look())


def test_letting_go_and_labels_do_not_start_the_world(hands: Hands) -> None:
    p.feed(hands, p.key(W))
    assert hands.is_input(hands.look())
    p.feed(hands, p.key(W, down=False))
    assert not hands.is_input(hands.look())
    assert not hands.is_input([DeviceEvent("label", "slider", 1.0), DeviceEvent("pad7", "left_x", 1.0), STOP])


def test_hands_for_teleoperation_know_each_pad_by_its_own_profile(hands: Hands, pad: int) -> None:
    stock = Profile.stock(p.XBOX)
    hands.profiles.put(p.XBOX, replace(stock, hand=replace(stock.hand, dead_zone=0.4)))
    assert hands.hands["pad0"].dead_zone == 0.4
    assert hands.hands["pad"] == stock.hand
    assert set(hands.hands) == {"keyboard", "mouse", "pad", "pad0"}
