"""The recorded format equals the published one and that of golden files."""

from __future__ import annotations

import re
import runpy
from dataclasses import fields
from pathlib import Path
from typing import Any

import pytest

from sonata2d.core.bounds import MAX_MAGNITUDE
from sonata2d.core.entities import Door, Furniture, Goal, Group, Human, Limits, Place, Queue, Robot
from sonata2d.core.geometry import Disc, Polygon, Rectangle
from sonata2d.core.labels import LabelSpec
from sonata2d.core.scene import Rules, Social
from sonata2d.datasets import verify
from sonata2d.record.models import Episode
from sonata2d.record.reader import read_episode
from sonata2d.record.recorder import EpisodeRecorder

from .samples import run, scene

GOLDEN = Path(__file__).with_name("golden.json")
GENERATOR = Path(__file__).parents[2] / "docs" / "generate_format.py"


def without_software(document: bytes) -> list[bytes]:
    return [line for line in document.splitlines() if not line.startswith(b'"software"')]


def test_recording_gives_the_bytes_of_the_golden_file() -> None:
    """After an intended change of the format, delete golden.json and run this test, which then writes a new one."""
    recorder = EpisodeRecorder(id="golden", contributor="Zoë", context="by hand")
    run(recorder, labels=lambda tick: {"near": tick > 2} if tick else None)
    if not GOLDEN.exists():
        GOLDEN.write_bytes(recorder.document())
        pytest.fail(f"{GOLDEN.name} was missing and has been written; check it and run the test again")
    assert without_software(recorder.document()) == without_software(GOLDEN.read_bytes())


def test_the_golden_file_is_read_and_passes_check() -> None:
    assert read_episode(GOLDEN).scene() == scene()
    assert verify(GOLDEN) == []


def test_published_pages_agree_with_the_models() -> None:
    pages: dict[Path, str] = runpy.run_path(str(GENERATOR))["pages"]()
    assert len(pages) == 6
    for path, text in pages.items():
        assert path.read_text("utf-8") == text, f"{path.name} is not up to date; run python docs/generate_format.py"


def test_the_definitions_of_the_published_schema_have_fixed_names() -> None:
    names = (
        "Area AttributeSpec Branch Column Columns Contact Controller DiscShape Door Event Frame Goal Group Human "
        "Imported ImportedTracks InteriorDoor LabelSpec LastLook Limits Mirror Object OtherFrame OtherRobot "
        "OtherState Outcome Place PolygonShape Queue RectangleShape Robot Room Rules Sensor Social Software"
    )
    assert sorted(Episode.model_json_schema()["$defs"]) == names.split()


@pytest.mark.parametrize(
    ("kind", "name"),
    [
        *((kind, kind.__name__) for kind in (Door, Goal, Group, Human, Limits, Place, Queue, Robot)),
        *((kind, kind.__name__) for kind in (LabelSpec, Rules, Social)),
        (Furniture, "Object"),
        (Disc, "DiscShape"),
        (Rectangle, "RectangleShape"),
        (Polygon, "PolygonShape"),
    ],
)
def test_a_field_of_an_entity_is_a_required_key_with_the_description_of_its_docstring(kind: type, name: str) -> None:
    definition = Episode.model_json_schema()["$defs"][name]
    names = [field.name for field in fields(kind)]
    keys = [key for name in names for key in (("x", "y", "theta") if name == "pose" else (name,))]
    assert [key for key in definition["properties"] if key in keys] == keys
    additive = {field.name for field in fields(kind) if field.metadata.get("additive")}
    assert set(definition["required"]) | additive == set(definition["properties"]) >= set(keys)
    assert not set(definition["required"]) & additive
    assert all(definition["properties"][key]["description"] for key in keys)
    attributes = (kind.__doc__ or "").partition("Attributes:")[2]
    described = [name for line in re.findall(r"^ {8}(\w[\w, ]*?):", attributes, re.M) for name in line.split(", ")]
    assert described == names


def test_a_number_has_the_bounds_of_its_field() -> None:
    keys = Episode.model_json_schema()["$defs"]["Human"]["properties"]
    assert (keys["reacts_to_robot"]["minimum"], keys["reacts_to_robot"]["maximum"]) == (0, 1)
    assert keys["radius"]["exclusiveMinimum"] == 0
    assert keys["goals"]["items"]["prefixItems"][0]["maximum"] == MAX_MAGNITUDE


def test_the_models_contain_every_recorded_key() -> None:
    def compare(recorded: Any, parsed: Any, key: str) -> None:
        if isinstance(recorded, dict) and key not in ("settings", "labels"):
            assert set(recorded) <= set(parsed), key
            for inner_key, value in recorded.items():
                compare(value, parsed[inner_key], inner_key)
        elif isinstance(recorded, list):
            for recorded_item, parsed_item in zip(recorded, parsed, strict=True):
                compare(recorded_item, parsed_item, key)

    record = read_episode(GOLDEN)
    compare(record.document, Episode.model_validate_json(GOLDEN.read_bytes()).model_dump(mode="json"), "")
