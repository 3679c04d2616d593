"""Frames that are found valid by their columns are those that the schema finds valid."""

from __future__ import annotations

import copy
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import orjson
import pytest

from sonata2d.errors import InvalidFileError
from sonata2d.record.columns import columns_of, frames_to_compare
from sonata2d.record.models import Episode
from sonata2d.record.validate import require_valid, schema_findings

WRONG = (None, True, "x", "1", -2, 0, 1, 0.5, -0.5, 1e12, -1e12, 10**400, 1 << 64, [], [1], [[]], {}, {"a": 1})


def places(value: Any, place: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Keys of all values within a value."""
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, item in items:
        yield (*place, key)
        yield from places(item, (*place, key))


def damaged(document: dict[str, Any], place: tuple[Any, ...]) -> Iterator[dict[str, Any]]:
    """Copies with a wrong value at a place, without it, and with it twice."""
    for change in (*WRONG, "remove", "repeat"):
        changed = copy.deepcopy(document)
        part: Any = changed
        for key in place[:-1]:
            part = part[key]
        if change == "remove":
            del part[place[-1]]
        elif change != "repeat":
            part[place[-1]] = change
        elif isinstance(part, list):
            part.append(part[place[-1]])
        yield changed


@pytest.mark.parametrize("part", [("frames", 1), ("frames", 2), ("frames", 4), ("final",)])
def test_damaged_values_give_the_findings_of_the_schema(episode: Path, part: tuple[Any, ...]) -> None:
    document = orjson.loads(episode.read_bytes())
    document["frames"] = document["frames"][:5]
    document["final"]["tick"], document["outcome"]["tick"] = 5, 5
    for absent in (1, 4):
        document["frames"][absent]["humans"][1], document["frames"][absent]["activity"][1] = None, -1
    inner: Any = document
    for key in part:
        inner = inner[key]
    refused = 0
    for place in list(places(inner)):
        for changed in damaged(document, (*part, *place)):
            findings = list(schema_findings(changed, Episode))
            if findings:
                with pytest.raises(InvalidFileError) as error:
                    require_valid(changed, episode)
                assert error.value.findings == findings, place
                refused += 1
    assert refused > 100


@pytest.mark.parametrize("frames", [{}, "", None, 0, {"tick": 0}])
def test_frames_that_are_no_list_are_refused(episode: Path, frames: Any) -> None:
    document = orjson.loads(episode.read_bytes()) | {"frames": frames}
    document["final"]["tick"] = document["outcome"]["tick"] = 0
    with pytest.raises(InvalidFileError, match="frames: Input should be a valid list"):
        require_valid(document, episode)


def test_only_frames_with_rare_content_are_compared_with_the_schema(episode: Path) -> None:
    document = orjson.loads(episode.read_bytes())
    compared = frames_to_compare(document, columns_of(document))
    assert [frame["tick"] for frame in compared] == [2]
