"""`mirror`, `split` and `merge`, as a person would call them."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from .conftest import Run


@pytest.fixture
def made(sonata2d: Run, here: Path) -> Path:
    sonata2d("generate one --scenario quick.yaml --episodes 5 --seed 4 --workers 1 --no-picture")
    return here


def test_a_data_set_is_mirrored_merged_split_and_proven(sonata2d: Run, made: Path) -> None:
    told = json.loads(sonata2d("mirror one -o twin --json").output)
    assert told["episodes"] == 5
    assert "no problems" in sonata2d("check twin --replay --rerun --workers 1").output
    assert "10 episodes of one, twin" in sonata2d("merge one twin -o both").output
    split = json.loads(sonata2d("split both --parts train=3,test=2 --json").output)["split"]
    assert {part: len(names) for part, names in split.items()} == {"train": 6, "test": 4}
    assert json.loads((made / "both/manifest.json").read_text())["split"] == split
    assert "no problems" in sonata2d("check both --workers 1").output
    assert "10 of 10" in sonata2d("describe both").output


def test_a_file_is_mirrored_to_a_file_and_back(sonata2d: Run, made: Path) -> None:
    assert "1 episodes mirrored" in sonata2d("mirror one/000002.json -o twin.json.gz").output
    sonata2d("mirror twin.json.gz -o back.json")
    assert (made / "back.json").read_bytes() == (made / "one/000002.json").read_bytes()
    assert "no problems" in sonata2d("check twin.json.gz --replay").output


@pytest.mark.parametrize(
    ("line", "code", "message"),
    [
        ("mirror none -o x", 1, "none cannot be read"),
        ("mirror one -o one", 1, "one is there already"),
        ("mirror one/000000.json -o x.txt", 1, "an episode file ends in"),
        ("merge one -o x", 1, "merging takes two or more"),
        ("merge one one -o x", 1, "is the same episode as"),
        ("merge one none -o x", 1, "none holds no manifest.json"),
        ("split one --parts a=0.5,a=0.5", 2, "given twice"),
        ("split one --parts a=inf", 2, "is no part=share"),
        ("split one --parts a=1,b=1,c=1,d=1,e=1,f=1", 1, "5 scenes, too few for 6 parts"),
        ("split none", 1, "no data set"),
    ],
)
def test_what_cannot_be_done_is_told_in_one_line(sonata2d: Run, made: Path, line: str, code: int, message: str) -> None:
    assert message in sonata2d(line, code).output
    assert not (made / "x").exists()


def test_an_episode_is_drawn_as_a_graph(sonata2d: Run, made: Path) -> None:
    told = json.loads(sonata2d("render one/000000.json -o graph.png --graph --json").output)
    assert told["graphs"] == 3
    assert (made / "graph.png").read_bytes().startswith(b"\x89PNG")
    assert "takes none of" in sonata2d("render one/000000.json -o x.png --graph --ids", 2).output
    assert "end the name in .png" in sonata2d("render one/000000.json -o x.gif --graph", 1).output
