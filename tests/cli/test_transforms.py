"""`sonata2d mirror`, `split` and `merge`, and the picture of a graph."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from .conftest import Run


@pytest.fixture
def folder(sonata2d: Run, here: Path) -> Path:
    """A folder with the data set `one` of five episodes."""
    sonata2d("generate one --scenario quick.yaml --episodes 5 --seed 4 --workers 1 --no-picture")
    return here


def test_data_set_is_mirrored_merged_and_split(sonata2d: Run, folder: Path) -> None:
    result = json.loads(sonata2d("mirror one -o twin --json").output)
    assert result["episodes"] == 5
    assert "no problems" in sonata2d("check twin --replay --rerun --workers 1").output
    assert "10 episodes of one, twin" in sonata2d("merge one twin -o both").output
    split = json.loads(sonata2d("split both --parts train=3,test=2 --json").output)["split"]
    assert {part: len(names) for part, names in split.items()} == {"train": 6, "test": 4}
    assert json.loads((folder / "both/manifest.json").read_text())["split"] == split
    assert "no problems" in sonata2d("check both --workers 1").output
    assert "10 of 10" in sonata2d("describe both").output


def test_file_mirrored_twice_has_the_same_bytes(sonata2d: Run, folder: Path) -> None:
    assert "1 episode mirrored" in sonata2d("mirror one/000002.json -o twin.json.gz").output
    sonata2d("mirror twin.json.gz -o back.json")
    assert (folder / "back.json").read_bytes() == (folder / "one/000002.json").read_bytes()
    assert "no problems" in sonata2d("check twin.json.gz --replay").output


@pytest.mark.parametrize(
    ("line", "code", "message"),
    [
        ("mirror none -o x", 1, "none cannot be read"),
        ("mirror one -o one", 1, "one already exists"),
        ("mirror one/000000.json -o x.txt", 1, "an episode file ends in"),
        ("merge one -o x", 1, "merging needs two or more"),
        ("merge one one -o x", 1, "is the same episode as"),
        ("merge one none -o x", 1, "none is not a data set"),
        ("split one --parts a=0.5,a=0.5", 2, "given twice"),
        ("split one --parts a=inf", 2, "is not of the form part=fraction"),
        ("split one --parts train=.8,test=.3", 2, "the fractions add up to 1.1 and not to 1"),
        ("split one --parts a=1,b=1,c=1,d=1,e=1,f=1", 1, "5 scenes, too few for 6 parts"),
        ("split none", 1, "not a data set"),
    ],
)
def test_invalid_arguments_give_a_one_line_message(
    sonata2d: Run, folder: Path, line: str, code: int, message: str
) -> None:
    assert message in sonata2d(line, code).output
    assert not (folder / "x").exists()


def test_episode_is_drawn_as_a_graph(sonata2d: Run, folder: Path) -> None:
    result = json.loads(sonata2d("render one/000000.json -o graph.png --graph --json").output)
    assert result["graphs"] == 3
    assert (folder / "graph.png").read_bytes().startswith(b"\x89PNG")
    assert "--graph cannot be combined with" in sonata2d("render one/000000.json -o x.png --graph --ids", 2).output
    assert "end the name in .png" in sonata2d("render one/000000.json -o x.gif --graph", 1).output
