"""`Teleoperation`: device mappings, and that equal events give equal twists."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import pytest
from hypothesis import given, strategies as st

from sonata2d.agents.controllers.teleoperation import DEFAULT_MAPPINGS, STOP, DeviceMapping, Teleoperation
from sonata2d.core.devices import DeviceEvent
from sonata2d.core.geometry import Twist
from sonata2d.core.labels import LabelSpec
from sonata2d.core.scene import Scene
from sonata2d.sim.episode import Episode

from ..conftest import room

unit = st.floats(-1.0, 1.0)
STICK = {"left_y": ("ahead", 1.0), "left_x": ("turn", 1.0)}


def stick(dead_zone: float, curve: float) -> DeviceMapping:
    return DeviceMapping(STICK, dead_zone, curve)  # type: ignore[arg-type]


mappings = st.builds(stick, st.floats(0.0, 0.95), st.floats(0.0, 1.0))
Events = Sequence[DeviceEvent]


def stick_command(mapping: DeviceMapping, x: float, y: float) -> tuple[float, float]:
    """The commands (turn, ahead) for a stick position (x, y)."""
    command = mapping.read({"left_x": x, "left_y": y})
    return command["turn"], command["ahead"]


# Device mappings


@given(mappings, unit, unit)
def test_stick_commands_stay_within_the_unit_disc(mapping: DeviceMapping, x: float, y: float) -> None:
    assert math.hypot(*stick_command(mapping, x, y)) <= 1.0 + 1e-12


@given(mappings, st.floats(0.0, 1.0), st.floats(-math.pi, math.pi))
def test_a_stick_within_the_dead_zone_is_centred(mapping: DeviceMapping, fraction: float, angle: float) -> None:
    radius = mapping.dead_zone * fraction * (1 - 1e-9)
    assert stick_command(mapping, radius * math.cos(angle), radius * math.sin(angle)) == (0.0, 0.0)


@given(mappings, unit, unit)
def test_the_opposite_stick_position_gives_the_opposite_command(mapping: DeviceMapping, x: float, y: float) -> None:
    assert stick_command(mapping, -x, -y) == tuple(-value for value in stick_command(mapping, x, y))


@given(mappings, unit, unit)
def test_the_direction_of_a_stick_is_kept(mapping: DeviceMapping, x: float, y: float) -> None:
    ax, ay = stick_command(mapping, x, y)
    assert ax * y == pytest.approx(ay * x, abs=1e-9)
    assert ax * x + ay * y >= 0.0


@given(mappings, unit, st.floats(0.0, 1.0))
def test_stick_commands_grow_with_the_deflection(mapping: DeviceMapping, x: float, fraction: float) -> None:
    assert abs(stick_command(mapping, x * fraction, 0.0)[0]) <= abs(stick_command(mapping, x, 0.0)[0]) + 1e-12


@given(mappings)
def test_full_deflection_gives_the_full_command(mapping: DeviceMapping) -> None:
    assert stick_command(mapping, 1.0, 0.0)[0] == pytest.approx(1.0)
    assert stick_command(mapping, 0.0, -1.0)[1] == pytest.approx(-1.0)


def test_the_dead_zone_is_a_disc() -> None:
    mapping = replace(DEFAULT_MAPPINGS["pad"], dead_zone=0.2, curve=0.0)
    assert set(mapping.read({"left_x": 0.14, "left_y": 0.14}).values()) == {0.0}
    assert mapping.read({"left_x": 0.15, "left_y": 0.15})["turn"] != 0.0
    assert mapping.read({"left_x": 0.19, "left_y": 0.19})["ahead"] != 0.0  # each axis alone is within the dead zone


def test_a_curve_is_finer_near_the_centre() -> None:
    assert stick_command(stick(0.0, 0.0), 0.5, 0.0)[0] == pytest.approx(0.5)
    assert stick_command(stick(0.0, 1.0), 0.5, 0.0)[0] == pytest.approx(0.125)


def test_the_x_and_y_buttons_of_a_pad_do_not_form_a_stick() -> None:
    command = DeviceMapping({"x": ("turn", 1.0), "y": ("ahead", 1.0)}, dead_zone=0.5).read({"x": 1.0, "y": 1.0})
    assert (command["turn"], command["ahead"]) == (1.0, 1.0)


@pytest.mark.parametrize(
    ("controls", "dead_zone", "curve"),
    [({}, 1.0, 0.0), ({}, -0.1, 0.0), ({}, 0.0, 1.1), ({}, math.nan, 0.0), ({"a": ("fly", 1.0)}, 0.0, 0.0),
     ({"a": ("turn", 1.5)}, 0.0, 0.0), ({"a": ("turn", math.nan)}, 0.0, 0.0)],
)  # fmt: skip
def test_invalid_mappings_are_rejected(controls: Mapping[str, object], dead_zone: float, curve: float) -> None:
    with pytest.raises(ValueError, match=r"dead_zone must be|is mapped to axis"):
        DeviceMapping(controls, dead_zone, curve)  # type: ignore[arg-type]


@given(mappings)
def test_a_mapping_reads_back_equal_from_json(mapping: DeviceMapping) -> None:
    assert DeviceMapping.from_settings(json.loads(json.dumps(mapping.settings()))) == mapping


def test_a_mapping_rounds_its_numbers_to_the_precision_of_files() -> None:
    settings = DeviceMapping({"a": ("turn", 0.33333)}, 0.12345678, 0.87654321).settings()
    assert settings == {"dead_zone": 0.1235, "curve": 0.8765, "controls": {"a": ["turn", 0.3333]}}


# The controller


def scene_for(kinematics: str = "holonomic") -> Scene:
    scene = room()
    return replace(scene, robot=replace(scene.robot, kinematics=kinematics))


def drive(ticks: Sequence[Events], controller: Teleoperation | None = None, scene: Scene | None = None) -> list[Twist]:
    """The twist of each tick, given its events."""
    episode = Episode(scene or scene_for(), controller or Teleoperation())
    for events in ticks:
        episode.step(events)
    return [frame.command for frame in episode.past]


def keys(*names: str, value: float = 1.0) -> list[DeviceEvent]:
    return [DeviceEvent("keyboard", name, value) for name in names]


random_event = st.builds(
    DeviceEvent,
    st.sampled_from(["keyboard", "mouse", "pad0", "pad1"]),
    st.sampled_from(["w", "a", "e", "space", "left_x", "left_y", "right_x", "drag_x", "drag_y", "left_shoulder"]),
    unit,
)
random_ticks = st.lists(st.lists(random_event, max_size=3), min_size=1, max_size=8)


@given(random_ticks)
def test_equal_events_give_equal_twists_also_with_recorded_settings(ticks: list[Events]) -> None:
    own = {"pad1": DeviceMapping({"left_y": ("turn", 0.333333)}, 0.123456, 0.654321)} | dict(DEFAULT_MAPPINGS)
    controller = Teleoperation(own)
    once = drive(ticks, controller)
    assert drive(ticks, controller) == once
    settings = json.loads(json.dumps(controller.settings()))
    assert drive(ticks, Teleoperation.from_settings(settings)) == once


@given(random_ticks)
def test_a_unicycle_never_moves_sideways(ticks: list[Events]) -> None:
    assert all(twist.vy == 0.0 for twist in drive(ticks, scene=scene_for("unicycle")))


@given(random_ticks)
def test_commands_stay_within_the_limits_of_the_robot(ticks: list[Events]) -> None:
    limits = scene_for().robot.limits
    for twist in drive(ticks):
        assert -limits.back <= twist.vx <= limits.ahead
        assert abs(twist.vy) <= limits.sideways
        assert abs(twist.omega) <= limits.turn


def test_a_held_key_drives_until_it_is_released() -> None:
    limits = scene_for().robot.limits
    twists = drive([keys("w"), [], keys("a"), keys("w", value=0.0), keys("a", value=0.0), keys("s")])
    ahead, left = limits.ahead, limits.turn
    assert twists == [Twist(ahead), Twist(ahead), Twist(ahead, 0.0, left), Twist(0.0, 0.0, left), Twist(),
                      Twist(-limits.back)]  # fmt: skip


def test_two_keys_for_one_direction_are_no_faster_than_one() -> None:
    assert drive([keys("w", "up")]) == drive([keys("w")])


def test_the_brake_overrides_everything_else() -> None:
    events = [*keys("w", "a", "q"), DeviceEvent("pad0", "left_y", -1.0)]
    assert drive([[*events, *keys("space")]]) == [Twist()]
    assert drive([[*events, DeviceEvent("pad1", "left_shoulder", 1.0)]]) == [Twist()]


@pytest.mark.parametrize(("device", "stick"), [("mouse", "drag"), ("pad0", "left"), ("pad3", "left")])
def test_dragging_or_pushing_up_drives_ahead_and_left_turns_left(device: str, stick: str) -> None:
    assert drive([[DeviceEvent(device, f"{stick}_y", -1.0)]])[0].vx > 0.9
    assert drive([[DeviceEvent(device, f"{stick}_x", -1.0)]])[0].omega > 1.0


def test_the_mapping_of_a_single_pad_takes_precedence_over_its_kind() -> None:
    controller = Teleoperation({"pad": DEFAULT_MAPPINGS["pad"], "pad1": DeviceMapping({"left_y": ("turn", 1.0)})})
    assert drive([[DeviceEvent("pad0", "left_y", -1.0)]], controller)[0].omega == 0.0
    assert drive([[DeviceEvent("pad1", "left_y", -1.0)]], controller)[0] == Twist(0.0, 0.0, -1.5)


def test_a_device_without_a_mapping_has_no_effect() -> None:
    assert drive([[DeviceEvent("wheel", "left_y", 1.0)]]) == [Twist()]
    assert drive([keys("w")], Teleoperation({"mouse": DEFAULT_MAPPINGS["mouse"]})) == [Twist()]


def test_reset_releases_all_controls() -> None:
    controller = Teleoperation()
    drive([keys("w")], controller)
    assert drive([[]], controller) == [Twist()]


def test_label_events_set_the_label_of_all_later_frames() -> None:
    spec = LabelSpec("slider", "frame", "comfort")
    controller = Teleoperation(label=spec)
    episode = Episode(scene_for(), controller)
    for events in ([], [DeviceEvent("label", "comfort", 0.25)], keys("w"), [DeviceEvent("label", "comfort", 1.0)]):
        episode.step(events)
    assert [frame.label for frame in episode.past] == [{"comfort": label} for label in (None, 0.25, 0.25, 1.0)]
    assert Teleoperation.from_settings(controller.settings()).labels == controller.labels != {}


def test_label_events_without_a_question_have_no_effect() -> None:
    assert drive([[DeviceEvent("label", "comfort", 0.5)]]) == [Twist()]
    assert Teleoperation().labels == {}


def test_the_stop_event_ends_the_episode() -> None:
    episode = Episode(scene_for(), Teleoperation())
    episode.step(keys("w"))
    assert episode.step([STOP]) is None
    assert episode.outcome is not None
    assert episode.outcome.status == "stopped"
