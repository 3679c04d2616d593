"""Label specifications, valid labels, and device events."""

from __future__ import annotations

from dataclasses import asdict

import pytest

from sonata2d.core.devices import DeviceEvent
from sonata2d.core.labels import LabelSpec
from sonata2d.errors import ConfigError
from sonata2d.scenegen.scenario.config import ScenarioConfig

CLASSES = LabelSpec("classes", classes=("poor", "fair", "good"))


@pytest.mark.parametrize("spec", [LabelSpec("yes_no"), CLASSES, LabelSpec("slider")])
def test_label_and_scale_position_are_inverse(spec: LabelSpec) -> None:
    for position in (0.0, 0.5, 1.0):
        label = spec.label_at(position)
        assert spec.validate(label) == label
        assert spec.label_at(spec.position_of(label)) == label


@pytest.mark.parametrize(
    ("spec", "invalid"),
    [
        (LabelSpec("yes_no"), 1),
        (CLASSES, 0),
        (CLASSES, 4),
        (CLASSES, True),
        (LabelSpec("slider"), 1.01),
        (LabelSpec("slider"), True),
        (LabelSpec("text"), 3),
        (LabelSpec(), "anything"),
    ],
)
def test_invalid_labels_are_rejected(spec: LabelSpec, invalid: object) -> None:
    with pytest.raises(ValueError, match="is not a valid label"):
        spec.validate(invalid)


def test_a_spec_is_reconstructed_from_json_values() -> None:
    settings = {key: list(value) if isinstance(value, tuple) else value for key, value in asdict(CLASSES).items()}
    assert LabelSpec.from_settings(settings) == CLASSES


def test_a_scenario_defines_the_label() -> None:
    config = ScenarioConfig(label={"kind": "classes", "classes": 3, "question": "How polite was it?"})
    assert config.label.classes == ("1", "2", "3")
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
def test_a_scenario_with_an_invalid_label_is_rejected(label: dict[str, object]) -> None:
    with pytest.raises(ConfigError, match="label"):
        ScenarioConfig(label=label)


def test_event_values_have_file_precision_and_a_range() -> None:
    assert DeviceEvent("pad0", "left_x", 0.123456).value == 0.1235
    assert DeviceEvent("pad12", "left_x", 0.0).kind == "pad"
    with pytest.raises(ValueError, match=r"pad0/left_x is 1\.5"):
        DeviceEvent("pad0", "left_x", 1.5)
    with pytest.raises(ValueError, match="nan"):
        DeviceEvent("pad0", "left_x", float("nan"))
