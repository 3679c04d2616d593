"""A person's events become twists, the same ones whenever they are given."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sonata2d.agents.controllers.teleoperation import HANDS, STOP, Hand, Teleoperation
from sonata2d.core.devices import DeviceEvent
from sonata2d.core.entities import Kinematics
from sonata2d.core.geometry import Twist
from sonata2d.core.labels import LabelSpec
from sonata2d.core.scene import Scene
from sonata2d.sim.episode import Episode

from ..conftest import room

unit = st.floats(-1.0, 1.0)
STICK = {"left_y": ("ahead", 1.0), "left_x": ("turn", 1.0)}
hands = st.builds(lambda dead, curve: Hand(STICK, dead, curve), st.floats(0.0, 0.95), st.floats(0.0, 1.0))  # type: ignore[arg-type]
Tick = Sequence[DeviceEvent]


def at(hand: Hand, x: float, y: float) -> tuple[float, float]:
    """What a stick that stands there asks for, as it lies."""
    asked = hand.read({"left_x": x, "left_y": y})
    return asked["turn"], asked["ahead"]


# The hand


@given(hands, unit, unit)
def test_a_stick_asks_for_no_more_than_its_round(hand: Hand, x: float, y: float) -> None:
    assert math.hypot(*at(hand, x, y)) <= 1.0 + 1e-12


@given(hands, st.floats(0.0, 1.0), st.floats(-math.pi, math.pi))
def test_within_the_dead_zone_a_stick_is_at_rest(hand: Hand, share: float, angle: float) -> None:
    reach = hand.dead_zone * share * (1 - 1e-9)
    assert at(hand, reach * math.cos(angle), reach * math.sin(angle)) == (0.0, 0.0)


@given(hands, unit, unit)
def test_the_other_way_asks_for_the_opposite(hand: Hand, x: float, y: float) -> None:
    assert at(hand, -x, -y) == tuple(-value for value in at(hand, x, y))


@given(hands, unit, unit)
def test_the_direction_of_a_stick_is_kept(hand: Hand, x: float, y: float) -> None:
    ax, ay = at(hand, x, y)
    assert ax * y == pytest.approx(ay * x, abs=1e-9)
    assert ax * x + ay * y >= 0.0


@given(hands, unit, st.floats(0.0, 1.0))
def test_further_out_never_asks_for_less(hand: Hand, x: float, share: float) -> None:
    assert abs(at(hand, x * share, 0.0)[0]) <= abs(at(hand, x, 0.0)[0]) + 1e-12


def test_the_dead_zone_is_round() -> None:
    hand = replace(HANDS["pad"], dead_zone=0.2, curve=0.0)
    assert set(hand.read({"left_x": 0.14, "left_y": 0.14}).values()) == {0.0}
    assert hand.read({"left_x": 0.15, "left_y": 0.15})["turn"] != 0.0
    assert hand.read({"left_x": 0.19, "left_y": 0.19})["ahead"] != 0.0  # neither axis alone would pass


@given(hands)
def test_a_full_stick_asks_for_all(hand: Hand) -> None:
    assert at(hand, 1.0, 0.0)[0] == pytest.approx(1.0)
    assert at(hand, 0.0, -1.0)[1] == pytest.approx(-1.0)


def test_a_curve_is_finer_near_the_middle() -> None:
    straight, curved = (Hand(STICK, 0.0, curve) for curve in (0.0, 1.0))  # type: ignore[arg-type]
    assert at(straight, 0.5, 0.0)[0] == pytest.approx(0.5)
    assert at(curved, 0.5, 0.0)[0] == pytest.approx(0.125)


def test_buttons_of_a_pad_are_no_stick() -> None:
    hand = Hand({"x": ("turn", 1.0), "y": ("ahead", 1.0)}, dead_zone=0.5)
    asked = hand.read({"x": 1.0, "y": 1.0})
    assert (asked["turn"], asked["ahead"]) == (1.0, 1.0)


@pytest.mark.parametrize(
    ("controls", "dead_zone", "curve"),
    [({}, 1.0, 0.0), ({}, -0.1, 0.0), ({}, 0.0, 1.1), ({}, math.nan, 0.0), ({"a": ("fly", 1.0)}, 0.0, 0.0),
     ({"a": ("turn", 1.5)}, 0.0, 0.0), ({"a": ("turn", math.nan)}, 0.0, 0.0)],
)  # fmt: skip
def test_a_hand_that_makes_no_sense_is_refused(controls: Mapping[str, object], dead_zone: float, curve: float) -> None:
    with pytest.raises(ValueError, match=r"dead_zone|bound to"):
        Hand(controls, dead_zone, curve)  # type: ignore[arg-type]


@given(hands)
def test_a_hand_reads_back_from_json_as_it_was(hand: Hand) -> None:
    assert Hand.restored(json.loads(json.dumps(hand.settings()))) == hand


def test_a_hand_keeps_its_numbers_as_a_file_does() -> None:
    told = Hand({"a": ("turn", 0.33333)}, 0.12345678, 0.87654321).settings()
    assert told == {"dead_zone": 0.1235, "curve": 0.8765, "controls": {"a": ["turn", 0.3333]}}


# The controller


def scene_for(kinematics: Kinematics = "holonomic") -> Scene:
    scene = room()
    return replace(scene, robot=replace(scene.robot, kinematics=kinematics))


def driven(ticks: Sequence[Tick], controller: Teleoperation | None = None, scene: Scene | None = None) -> list[Twist]:
    """The twist of each tick."""
    episode = Episode(scene or scene_for(), controller or Teleoperation())
    for events in ticks:
        episode.step(events)
    return [moment.command for moment in episode.past]


def keys(*names: str, value: float = 1.0) -> list[DeviceEvent]:
    return [DeviceEvent("keyboard", name, value) for name in names]


stray = st.builds(
    DeviceEvent,
    st.sampled_from(["keyboard", "mouse", "pad0", "pad1"]),
    st.sampled_from(["w", "a", "e", "space", "left_x", "left_y", "right_x", "drag_x", "drag_y", "left_shoulder"]),
    unit,
)
drives = st.lists(st.lists(stray, max_size=3), min_size=1, max_size=8)


@given(drives)
def test_the_same_events_bring_the_same_twists(ticks: list[Tick]) -> None:
    mine = {"pad1": Hand({"left_y": ("turn", 0.333333)}, 0.123456, 0.654321)} | dict(HANDS)
    controller = Teleoperation(mine)
    once = driven(ticks, controller)
    assert driven(ticks, controller) == once
    told = json.loads(json.dumps(controller.settings()))
    assert driven(ticks, Teleoperation.from_settings(told)) == once


@given(drives)
def test_a_unicycle_never_goes_sideways(ticks: list[Tick]) -> None:
    assert all(twist.vy == 0.0 for twist in driven(ticks, scene=scene_for("unicycle")))


@given(drives)
def test_nothing_beyond_the_limits_is_asked_for(ticks: list[Tick]) -> None:
    limits = scene_for().robot.limits
    for twist in driven(ticks):
        assert -limits.back <= twist.vx <= limits.ahead
        assert abs(twist.vy) <= limits.sideways
        assert abs(twist.omega) <= limits.turn


def test_what_is_held_stays_until_it_is_let_go() -> None:
    limits = scene_for().robot.limits
    twists = driven([keys("w"), [], keys("a"), keys("w", value=0.0), keys("a", value=0.0), keys("s")])
    ahead, left = limits.ahead, limits.turn
    assert twists == [Twist(ahead), Twist(ahead), Twist(ahead, 0.0, left), Twist(0.0, 0.0, left), Twist(),
                      Twist(-limits.back)]  # fmt: skip


def test_two_keys_for_one_way_are_no_faster() -> None:
    assert driven([keys("w", "up")]) == driven([keys("w")])


def test_brake_wins_over_everything() -> None:
    events = [*keys("w", "a", "q"), DeviceEvent("pad0", "left_y", -1.0)]
    assert driven([[*events, *keys("space")]]) == [Twist()]
    assert driven([[*events, DeviceEvent("pad1", "left_shoulder", 1.0)]]) == [Twist()]


def test_dragging_up_and_a_stick_pushed_up_mean_ahead() -> None:
    for event in (DeviceEvent("mouse", "drag_y", -1.0), DeviceEvent("pad0", "left_y", -1.0)):
        assert driven([[event]])[0].vx > 0.9


def test_dragging_or_pushing_left_turns_left() -> None:
    for event in (DeviceEvent("mouse", "drag_x", -1.0), DeviceEvent("pad3", "left_x", -1.0)):
        assert driven([[event]])[0].omega > 1.0


def test_a_pad_of_its_own_hand_goes_before_its_kind() -> None:
    mine = Teleoperation({"pad": HANDS["pad"], "pad1": Hand({"left_y": ("turn", 1.0)})})
    assert driven([[DeviceEvent("pad0", "left_y", -1.0)]], mine)[0].omega == 0.0
    assert driven([[DeviceEvent("pad1", "left_y", -1.0)]], mine)[0] == Twist(0.0, 0.0, -1.5)


def test_a_device_nobody_reads_does_nothing() -> None:
    assert driven([[DeviceEvent("wheel", "left_y", 1.0)]]) == [Twist()]
    assert driven([keys("w")], Teleoperation({"mouse": HANDS["mouse"]})) == [Twist()]


def test_a_new_episode_begins_with_nothing_held() -> None:
    controller = Teleoperation()
    driven([keys("w")], controller)
    assert driven([[]], controller) == [Twist()]


def test_labels_come_as_events_and_stay() -> None:
    spec = LabelSpec("slider", "frame", "comfort")
    controller = Teleoperation(label=spec)
    episode = Episode(scene_for(), controller)
    for events in ([], [DeviceEvent("label", "comfort", 0.25)], keys("w"), [DeviceEvent("label", "comfort", 1.0)]):
        episode.step(events)
    assert [moment.label for moment in episode.past] == [{"comfort": label} for label in (None, 0.25, 0.25, 1.0)]
    assert Teleoperation.from_settings(controller.settings()).labels == controller.labels != {}


def test_a_label_that_nobody_asked_for_changes_nothing() -> None:
    events = [DeviceEvent("label", "comfort", 0.5)]
    assert driven([events]) == [Twist()]
    assert Teleoperation().labels == {}


def test_ending_the_run_is_an_event_as_well() -> None:
    episode = Episode(scene_for(), Teleoperation())
    episode.step(keys("w"))
    assert episode.step([STOP]) is None
    assert episode.outcome is not None
    assert episode.outcome.status == "stopped"
