"""`sonata2d benchmark`."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from .conftest import Run


def test_the_list_names_parts_tracks_and_baselines(sonata2d: Run) -> None:
    output = sonata2d("benchmark list").output
    for word in ("s2b-1: 2800 scenes", "encounters (1040 scenes)", "lidar", "standing-still"):
        assert word in output
    assert json.loads(sonata2d("benchmark list --json").output)["scenes"] == 2800
    assert "recorded-person" not in output
    assert "recorded-person" in sonata2d("benchmark list --suite s2b-1-recorded").output


def test_a_row_is_run_verified_and_compared(sonata2d: Run, here: Path) -> None:
    output = sonata2d("benchmark run --controller orca -o row --part frontal-approach --scenes 2 --workers 1").output
    assert "row  row/row.json" in output.replace("\\", "/")
    assert "2 scenes; replayed, re-run" in sonata2d("benchmark verify row --rerun --workers 1").output
    assert "orca" in sonata2d("benchmark table row -o table.html").output
    assert "<html" in (here / "table.html").read_text()
    content = json.loads((here / "row" / "row.json").read_text())
    content["late"] = 1
    (here / "row" / "row.json").write_text(json.dumps(content))
    assert "does not hold the scores" in sonata2d("benchmark verify row --workers 1", 1).output


def test_baselines_that_are_there_stay(sonata2d: Run, here: Path) -> None:
    line = "benchmark baselines rows --only standing-still --only dwa --part home --scenes 1 --workers 1"
    assert "dwa: " in sonata2d(line).output
    before = (here / "rows" / "dwa" / "run.json").stat().st_mtime_ns
    sonata2d(line)
    assert (here / "rows" / "dwa" / "run.json").stat().st_mtime_ns == before
    assert json.loads((here / "rows" / "dwa" / "row.json").read_text())["plan"]["track"] == "lidar"
    assert "is a row of other seeds; choose another folder" in sonata2d(f"{line} --seeds dev", 2).output


def test_a_keeper_makes_and_reveals_a_secret(sonata2d: Run, here: Path) -> None:
    commitment = sonata2d("benchmark commit secret.txt").output.split()[-1]
    assert commitment in sonata2d("benchmark reveal secret.txt").output
    sonata2d(
        "benchmark run --controller orca -o row --seeds hidden --secret secret.txt --part home --scenes 1 --workers 1"
    )
    assert json.loads((here / "row" / "row.json").read_text())["plan"]["commitment"] == commitment
    assert "already exists" in sonata2d("benchmark commit secret.txt", 2).output


@pytest.mark.parametrize(
    ("line", "code", "problem"),
    [
        ("benchmark run --controller orca -o row --suite s2b-9", 1, "there is no suite 's2b-9'"),
        ("benchmark run --controller orca -o row --seeds hidden", 1, "need the secret"),
        ("benchmark run --controller orca -o row --secret gone.txt --seeds hidden", 1, "gone.txt"),
        ("benchmark baselines rows --only dva", 2, "did you mean 'dwa'"),
        ("benchmark verify nowhere", 1, "is no row"),
        ("benchmark table nowhere", 1, "is no row"),
        ("benchmark table nowhere -o table.pdf", 1, "a table is written to"),
    ],
)
def test_wrong_arguments_get_a_line_that_says_so(sonata2d: Run, line: str, code: int, problem: str) -> None:
    assert problem in sonata2d(line, code).output
