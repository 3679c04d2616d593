"""What a person is asked for, and what is an answer."""

from __future__ import annotations

from dataclasses import asdict

import pytest

from sonata2d.core.devices import DeviceEvent
from sonata2d.core.labels import LabelSpec
from sonata2d.scenegen.scenario.config import ScenarioConfig

THREE = LabelSpec("classes", classes=("poor", "fair", "good"))


@pytest.mark.parametrize("spec", [LabelSpec("yes_no"), THREE, LabelSpec("slider")])
def test_every_label_has_a_place_on_its_scale(spec: LabelSpec) -> None:
    for place in (0.0, 0.5, 1.0):
        label = spec.label_at(place)
        assert spec.checked(label) == label
        assert spec.label_at(spec.place_of(label)) == label


@pytest.mark.parametrize(
    ("spec", "wrong"),
    [
        (LabelSpec("yes_no"), 1),
        (THREE, 0),
        (THREE, 4),
        (THREE, True),
        (LabelSpec("slider"), 1.01),
        (LabelSpec("slider"), True),
        (LabelSpec("text"), 3),
        (LabelSpec(), "anything"),
    ],
)
def test_what_is_no_answer_is_refused_by_name(spec: LabelSpec, wrong: object) -> None:
    with pytest.raises(ValueError, match="is no label"):
        spec.checked(wrong)


def test_a_spec_comes_back_from_what_a_file_holds() -> None:
    told = {key: list(value) if isinstance(value, tuple) else value for key, value in asdict(THREE).items()}
    assert LabelSpec.restored(told) == THREE


def test_a_scenario_says_what_is_asked() -> None:
    config = ScenarioConfig(label={"kind": "classes", "classes": 3, "question": "How polite was it?"})
    assert config.label.spec().classes == ("1", "2", "3")
    assert ScenarioConfig(**config.settings()) == config


@pytest.mark.parametrize(
    "label",
    [
        {"kind": "classes"},
        {"kind": "slider", "classes": 3},
        {"kind": "classes", "classes": 1},
        {"kind": "classes", "classes": 10},
        {"kind": "text", "when": "frame"},
        {"kind": "stars"},
    ],
)
def test_a_scenario_that_asks_nonsense_is_refused(label: dict[str, object]) -> None:
    with pytest.raises(ValueError, match="label"):
        ScenarioConfig(label=label)


def test_an_event_is_at_the_precision_of_files_and_within_its_range() -> None:
    assert DeviceEvent("pad0", "left_x", 0.123456).value == 0.1235
    assert DeviceEvent("pad12", "left_x", 0.0).kind == "pad"
    with pytest.raises(ValueError, match=r"pad0/left_x is 1\.5"):
        DeviceEvent("pad0", "left_x", 1.5)
    with pytest.raises(ValueError, match="nan"):
        DeviceEvent("pad0", "left_x", float("nan"))
