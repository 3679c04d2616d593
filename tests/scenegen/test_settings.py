"""Ranges and settings: accepted values, and error messages for others."""

from __future__ import annotations

import json

import pytest
from hypothesis import given, strategies as st

from sonata2d.core.rng import RandomStream
from sonata2d.core.scene import Rules
from sonata2d.errors import ConfigError
from sonata2d.scenegen.scenario.base import IntRange, Range
from sonata2d.scenegen.scenario.config import ScenarioConfig


@pytest.mark.parametrize("value", [[2, 6], (2, 6), {"min": 2, "max": 6}, IntRange(2, 6)])
def test_a_range_has_several_forms(value):
    assert ScenarioConfig(tables=value).tables == IntRange(2, 6)


def test_one_number_is_a_range():
    assert ScenarioConfig(tables=3).tables == IntRange(3, 3)
    assert ScenarioConfig(pair_spacing=0.7).pair_spacing == Range(0.7, 0.7)


@pytest.mark.parametrize(
    "value", ["many", None, [1, 2, 3], [1], {"min": 1}, {"min": 1, "max": 2, "mox": 3}, 1.5, -1, True]
)
def test_an_invalid_count_is_refused(value):
    with pytest.raises(ConfigError):
        ScenarioConfig(tables=value)


def test_min_above_max_is_an_error_with_field_and_values():
    with pytest.raises(ConfigError, match=r"talking_distance: min 3 is above max 1.5"):
        ScenarioConfig(talking_distance=(3.0, 1.5))


@given(st.integers(0, 50), st.integers(0, 50), st.integers(0, 2**32))
def test_drawn_values_lie_in_the_range(low, more, seed):
    rng = RandomStream(seed, 0, "scene")
    assert low <= IntRange(low, low + more).draw(rng) <= low + more
    assert low <= Range(low, low + more).draw(rng) <= low + more


@given(st.floats(-5, 5), st.floats(0, 5), st.floats(0.01, 2), st.integers(0, 2**32))
def test_drawn_values_are_multiples_of_the_step(low, more, step, seed):
    value = Range(low, low + more, step).draw(RandomStream(seed, 0, "scene"))
    steps = (value - low) / step
    assert steps == pytest.approx(round(steps), abs=1e-6)
    assert value <= low + more + 1e-6


@given(st.floats(-100, 100), st.floats(0, 100))
def test_ranges_read_back_equal(low, more):
    config = ScenarioConfig(furniture_yaw=(low, low + more))
    assert ScenarioConfig(**json.loads(json.dumps(config.settings()))) == config


def test_both_ends_of_a_step_are_drawn():
    rng = RandomStream(0, 0, "scene")
    assert {Range(6, 10, 1).draw(rng) for _ in range(200)} == {6.0, 7.0, 8.0, 9.0, 10.0}


def test_an_unknown_key_is_an_error_with_a_suggestion():
    with pytest.raises(ConfigError, match="unknown key 'tabels'; did you mean 'tables'"):
        ScenarioConfig(tabels=3)
    with pytest.raises(ConfigError, match="unknown key 'radios'; did you mean 'radius'"):
        ScenarioConfig(robot={"radios": 0.2})


def test_humans_and_standing_exclude_each_other():
    with pytest.raises(ConfigError, match="give humans, or standing and wandering, not both"):
        ScenarioConfig(humans=4, standing=2)


def test_an_unknown_type_of_furniture_needs_a_size():
    sofa = {"type": "sofa", "x": 0, "y": 0}
    with pytest.raises(ConfigError, match="furniture of unknown type needs a size"):
        ScenarioConfig(furniture=(sofa,))
    ScenarioConfig(furniture=(sofa | {"size": [2.0, 0.9]},))
    ScenarioConfig(furniture=(sofa,), sizes={"sofa": [2.0, 0.9]})


@pytest.mark.parametrize(
    "corners", [[[0, 0], [3, 3], [3, 0], [0, 3]], [[0, 0], [4, 0], [4, 0], [0, 4]], [[0, 0], [4, 0], [2, 0], [2, 3]]]
)
def test_a_room_whose_edges_cross_or_touch_is_refused(corners):
    with pytest.raises(ConfigError, match="edges of the polygon cross or touch"):
        ScenarioConfig(room={"polygon": corners})


@pytest.mark.parametrize(
    "room",
    [{"kinds": {"square": 0}}, {"kinds": []}, {"side": 0}, {"walls": [[1, 1, 1, 1]]}, {"polygon": [[0, 0], [1, 1]]}],
)
def test_an_invalid_room_is_refused(room):
    with pytest.raises(ConfigError):
        ScenarioConfig(room=room)


def test_the_robot_may_not_start_on_its_goal():
    with pytest.raises(ConfigError, match="the robot would start on its goal"):
        ScenarioConfig(robot={"pose": [1, 1, 0]}, goal={"position": [1.2, 1.0]})


@pytest.mark.parametrize(
    "settings",
    [
        {"rules": {"time_limit": 1e12}},
        {"robot": {"limits": {"ahead": 1e12}}},
        {"robot": {"pose": [1e12, 0, 0]}},
        {"goal": {"position": [0, -1e12]}},
        {"talking_distance": [1, 1e12]},
        {"furniture": [{"type": "table", "x": 1e12, "y": 0}]},
        {"sizes": {"table": 1e12}},
        {"doors": [{"x": 1e12, "y": 0}]},
        {"places": [{"x": 0, "y": 0, "weight": 1e12}]},
        {"people": [{"x": 0, "y": 1e12}]},
        {"people": [{"track": [[0, 0, 0], [1, 1e12, 0]]}]},
        {"people": [{"x": 0, "y": 0, "id": 10**17}]},
        {"social": {"pause": 1e12}},
        {"room": {"polygon": [[0, 0], [1e12, 0], [0, 1]]}},
        {"person": {"desired_speed": {"max": 1e12}}},
        {"clearance": 1e12},
    ],
)
def test_a_number_that_no_file_holds_is_refused(settings):
    with pytest.raises(ConfigError, match=r"should be .* or equal to"):
        ScenarioConfig(**settings)


def test_a_section_may_be_given_as_an_object_of_its_class():
    assert ScenarioConfig(rules=Rules(dt=0.05)) == ScenarioConfig(rules={"dt": 0.05})
    with pytest.raises(ConfigError, match=r"rules\.dt: Input should be greater than 0 \(got -1\)"):
        ScenarioConfig(rules=Rules(dt=-1))


def test_settings_are_frozen():
    with pytest.raises(ConfigError, match=r"settings are fixed; changed\(drop=True\) returns others"):
        ScenarioConfig().drop = True


def test_only_the_default_scenario_is_named_sonata_2020():
    assert ScenarioConfig().name == "sonata-2020"
    assert ScenarioConfig(humans=3).name == "custom"


def test_the_schema_contains_every_field_and_is_json():
    schema = ScenarioConfig.model_json_schema()
    assert set(schema["properties"]) == set(ScenarioConfig.model_fields)
    json.dumps(schema)
