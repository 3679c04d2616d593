"""`sonata2d run`, and `sonata2d render` of a folder."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from PIL import Image

import sonata2d as s2

from .conftest import Run


def test_one_episode_is_run_and_drawn(sonata2d: Run, here: Path) -> None:
    before = {path.name for path in here.iterdir()}
    output = sonata2d("run --scenario quick.yaml --seed 2").output
    assert {path.name for path in here.iterdir()} - before == {"run.png"}
    with Image.open(here / "run.png") as picture:
        assert min(picture.size) > 300
    lines = dict(line.split(maxsplit=1) for line in output.splitlines())
    assert lines["controller"] == "social-planner"
    assert lines["outcome"].startswith(("goal", "timeout"))
    assert lines["path_length"].endswith(" m")
    assert output.splitlines()[-1] == "written: run.png"


def test_the_episode_is_that_of_a_data_set(sonata2d: Run, here: Path) -> None:
    sonata2d("generate out --scenario quick.yaml --seed 5 --episodes 2 --workers 1 --no-picture")
    sonata2d("run --scenario quick.yaml --seed 5 --episode 1 -o 000001.json -o page.html -o b.json.zst")
    assert (here / "000001.json").read_bytes() == (here / "out/000001.json").read_bytes()
    assert s2.read_episode(here / "b.json.zst").document == s2.read_episode(here / "000001.json").document
    assert "<!DOCTYPE html>" in (here / "page.html").read_text()


def test_the_result_as_json(sonata2d: Run, here: Path) -> None:
    found = json.loads(sonata2d("run --scenario quick.yaml --controller orca -o new/a.svg --json").output)
    assert found["controller"] == "orca"
    assert found["written"] == ["new/a.svg"]
    assert found["metrics"]["path_length"] > 0.0


@pytest.mark.parametrize(
    ("line", "code", "message"),
    [
        ("run -o a.txt", 2, "a.txt: end the name in one of .png"),
        ("run -o A.JSON.ZST", 2, "A.JSON.ZST: end the name in one of .png"),
        ("run --controller social-planer", 1, "did you mean 'social-planner'"),
        ("run --scenario livly", 1, "did you mean 'lively'"),
        ("render out -o a.png --ids", 2, "out is a folder: only --count, --fps and --speed"),
        ("render out/000000.json -o a.png --count 2", 2, "--count is for folders"),
        ("render out -o a.png --fps 3", 1, "fps and speed have an effect on films only"),
        ("render empty -o a.png", 1, "empty holds no episode"),
    ],
)
def test_invalid_arguments(sonata2d: Run, here: Path, line: str, code: int, message: str) -> None:
    if line.startswith("render"):
        sonata2d("generate out --scenario quick.yaml --episodes 1 --workers 1 --no-picture")
        (here / "empty").mkdir()
    assert message in sonata2d(line, code).output
    assert not (here / "a.png").exists()


def test_a_folder_is_drawn_as_a_contact_sheet(sonata2d: Run, here: Path) -> None:
    sonata2d("generate out --scenario quick.yaml --episodes 5 --workers 1 --no-picture")
    assert sonata2d("render out -o all.png").output == "all.png: 5 of 5 episodes\n"
    assert json.loads(sonata2d("render out -o two.png --count 2 --json").output)["episodes"] == 2
    with Image.open(here / "all.png") as sheet, Image.open(here / "two.png") as two:
        assert sheet.height > two.height
