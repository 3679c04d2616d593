"""The recorded format equals the published one and that of golden files."""

from __future__ import annotations

import runpy
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from sonata2d.datasets import check_episode
from sonata2d.record.models import Episode
from sonata2d.record.reader import read_episode
from sonata2d.record.recorder import EpisodeRecorder

from .samples import run, scene

GOLDEN = Path(__file__).with_name("golden.json")
PHYSICS_1 = Path(__file__).with_name("physics_1.json")
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
    assert check_episode(GOLDEN) == []


def test_a_file_of_physics_1_is_read_and_passes_check() -> None:
    """The file lacks all keys that were added after physics 1; its people are discs."""
    humans = tuple(replace(human, model="moussaid2009", breadth=2 * human.radius) for human in scene().humans)
    assert read_episode(PHYSICS_1).scene() == replace(scene(), humans=humans)
    assert check_episode(PHYSICS_1) == []


def test_published_pages_agree_with_the_models() -> None:
    pages: dict[Path, str] = runpy.run_path(str(GENERATOR))["pages"]()
    assert len(pages) == 6
    for path, text in pages.items():
        assert path.read_text("utf-8") == text, f"{path.name} is not up to date; run python docs/generate_format.py"


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
