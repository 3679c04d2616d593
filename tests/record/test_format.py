"""The published format is the one that is written; a golden file guards it."""

from __future__ import annotations

import runpy
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from sonata2d.datasets.check import check_episode
from sonata2d.record.models import Episode
from sonata2d.record.reader import read_episode
from sonata2d.record.recorder import EpisodeRecorder

from .samples import run, scene

GOLDEN = Path(__file__).with_name("golden.json")
PHYSICS_1 = Path(__file__).with_name("physics_1.json")
GENERATOR = Path(__file__).parents[2] / "docs" / "generate_format.py"


def without_software(document: bytes) -> list[bytes]:
    return [line for line in document.splitlines() if not line.startswith(b'"software"')]


def test_the_golden_file_is_still_what_is_written() -> None:
    """Where the format was changed on purpose: delete golden.json, and this test writes it anew."""
    recorder = EpisodeRecorder(id="golden", contributor="Zoë", context="by hand")
    run(recorder, labels=lambda tick: {"near": tick > 2} if tick else None)
    if not GOLDEN.exists():
        GOLDEN.write_bytes(recorder.document())
        pytest.fail(f"{GOLDEN.name} was missing and is written; look at it and run again")
    assert without_software(recorder.document()) == without_software(GOLDEN.read_bytes())


def test_the_golden_file_reads_and_makes_sense() -> None:
    assert read_episode(GOLDEN).scene() == scene()
    assert check_episode(GOLDEN) == []


def test_a_file_of_physics_1_still_reads_and_makes_sense() -> None:
    """It has none of the keys that were added since."""
    humans = tuple(replace(human, model="moussaid2009") for human in scene().humans)
    assert read_episode(PHYSICS_1).scene() == replace(scene(), humans=humans)
    assert check_episode(PHYSICS_1) == []


def test_published_pages_are_those_of_the_models() -> None:
    pages: dict[Path, str] = runpy.run_path(str(GENERATOR))["pages"]()
    assert len(pages) == 4
    for path, text in pages.items():
        assert path.read_text("utf-8") == text, f"{path.name} is old; run python docs/generate_format.py"


def test_the_models_know_every_key_that_is_written() -> None:
    def compare(told: Any, kept: Any, place: str) -> None:
        if isinstance(told, dict) and place not in ("settings", "labels"):
            assert set(told) <= set(kept), place
            for key, value in told.items():
                compare(value, kept[key], key)
        elif isinstance(told, list):
            for one, other in zip(told, kept, strict=True):
                compare(one, other, place)

    record = read_episode(GOLDEN)
    compare(record.document, Episode.model_validate_json(GOLDEN.read_bytes()).model_dump(mode="json"), "")
