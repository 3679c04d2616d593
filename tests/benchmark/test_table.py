"""Tables: Pareto fronts, gaps to hidden seeds, pages."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import orjson
import pytest

from sonata2d.benchmark import run_benchmark, table_of
from sonata2d.benchmark.row import ROW
from sonata2d.errors import BenchmarkError

from . import memorised


def _copy(row: Path, folder: Path, name: str, *, seeds: str = "test", **scores: float) -> Path:
    """A copy of a row with another controller, seeds and scores."""
    shutil.copytree(row, folder)
    content: dict[str, Any] = orjson.loads((row / ROW).read_bytes())
    content["plan"] |= {"controller": name, "seeds": seeds}
    for key, value in scores.items():
        for group in ("task", "safety", "people"):
            if key in content["all"][group]:
                content["all"][group][key]["value"] = value
        if key == "strict":
            content["all"]["strict"] |= {"value": value, "n": 400}
    (folder / ROW).write_bytes(orjson.dumps(content))
    return folder


def test_the_front_has_no_row_that_another_one_beats(row: Path, tmp_path: Path) -> None:
    scores = {
        "fast": (0.9, 0.5, 0.4), "polite": (0.5, 0.8, 0.9), "beaten": (0.5, 0.7, 0.9), "still": (0.0, 0.0, 0.0)
    }  # fmt: skip
    rows = [
        _copy(row, tmp_path / name, name, stl=stl, safe=safe, polite=polite, strict=safe)
        for name, (stl, safe, polite) in scores.items()
    ]
    table = table_of(rows)
    assert {line.controller: line.is_on_front for line in table.lines} == {
        "fast": True, "polite": True, "beaten": False, "still": False
    }  # fmt: skip
    assert [line.controller for line in table.lines] == ["polite", "fast", "beaten", "still"]


def test_a_row_of_other_scenes_or_seeds_takes_nobody_off_the_front(row: Path, tmp_path: Path) -> None:
    whole = _copy(row, tmp_path / "a", "whole", stl=0.5, safe=0.5, polite=0.5)
    few = _copy(row, tmp_path / "b", "few", stl=1.0, safe=1.0, polite=1.0)
    content = orjson.loads((few / ROW).read_bytes())
    content["plan"]["scenes"] = 1
    (few / ROW).write_bytes(orjson.dumps(content))
    tuned = _copy(row, tmp_path / "c", "tuned", seeds="dev", stl=1.0, safe=1.0, polite=1.0)
    assert all(line.is_on_front for line in table_of([whole, few, tuned]).lines)


def test_a_gap_to_hidden_seeds_is_flagged(row: Path, tmp_path: Path) -> None:
    rows = [
        _copy(row, tmp_path / "a", "memorised", strict=0.95),
        _copy(row, tmp_path / "b", "memorised", seeds="hidden", strict=0.6),
        _copy(row, tmp_path / "c", "honest", strict=0.8),
        _copy(row, tmp_path / "d", "honest", seeds="hidden", strict=0.78),
    ]
    table = table_of(rows)
    gaps = {line.controller: line.gaps["test"] for line in table.lines}
    assert gaps["memorised"] == (pytest.approx(0.35), True)
    assert gaps["honest"] == (pytest.approx(0.02), False)
    page = table.html()
    assert "0.350 better on test than on hidden seeds" in page
    assert "test +0.350 against hidden" in table.markdown()
    assert table.to_json()["lines"][0]["gaps"]["test"]["flag"] is (table.lines[0].controller == "memorised")


def test_pages_escape_names_and_need_no_other_file(row: Path, tmp_path: Path) -> None:
    table = table_of([_copy(row, tmp_path / "a", "<b>bold</b>")])
    for name in ("table.html", "table.md", "table.json"):
        table.save(tmp_path / name)
    page = (tmp_path / "table.html").read_text()
    assert "&lt;b&gt;bold" in page
    assert "<b>bold" not in page
    assert "http" not in page.replace("http-equiv", "")
    assert "not complete" in page
    assert orjson.loads((tmp_path / "table.json").read_bytes())["suite"] == "s2b-1"
    with pytest.raises(BenchmarkError, match=r"a table is written to \.html, \.md, \.json"):
        table.save(tmp_path / "table.pdf")


def test_rows_that_do_not_go_together_are_refused(row: Path, tmp_path: Path) -> None:
    with pytest.raises(BenchmarkError, match="two rows are of social-planner"):
        table_of([row, row])
    with pytest.raises(BenchmarkError, match="a table needs rows"):
        table_of([])
    with pytest.raises(BenchmarkError, match="is no row, or one that is not finished"):
        table_of([tmp_path])


def test_a_policy_that_remembers_the_test_scenes_is_flagged(tmp_path: Path) -> None:
    scenes: dict[str, Any] = {"parts": ["crossing-a-group"], "scenes": 12}
    run_benchmark("social-planner", tmp_path / "expert", **scenes)
    shutil.copy(memorised.__file__, tmp_path)
    memorised.memory_of(tmp_path / "expert", tmp_path / "memorised.npz")
    name = f"{tmp_path / 'memorised.py'}:Memorised"
    run_benchmark(name, tmp_path / "test", **scenes)
    run_benchmark(name, tmp_path / "hidden", seeds="hidden", secret=b"s" * 32, **scenes)
    (line,) = table_of([tmp_path / "test", tmp_path / "hidden"]).lines
    assert line.strict >= 0.9
    gap, is_flagged = line.gaps["test"]
    assert gap > 0.5
    assert is_flagged
