"""The benchmark of a machine times the same world that runs; its figures are text, JSON and a picture."""

from __future__ import annotations

import importlib
import json
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

import sonata2d as s2

BENCHMARKS = Path(__file__).parent.parent.parent / "benchmarks"


@pytest.fixture(scope="module")
def machine() -> Iterator[ModuleType]:
    """The script, which is no part of the package, with very short measurements."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(BENCHMARKS)
        module = importlib.import_module("machine")
        for name, value in {"PEOPLE": (2, 4), "_REPEATS": 1, "_PROBE": 4, "_LEAST_SECONDS": 0.01}.items():
            patch.setattr(module, name, value)
        patch.setattr(module, "_megabytes", lambda episodes: 100)
        yield module
    for name in ("machine", "engine"):
        sys.modules.pop(name)


@pytest.fixture(scope="module")
def figures(machine: ModuleType) -> Any:
    return machine.benchmark(workers=2)


def test_the_figures_are_consistent(figures: Any) -> None:
    assert [one.people for one in figures.throughput] == [2, 4]
    for one in figures.throughput:
        assert one.frame > one.engine > 0.0
        rounding = 0.005 + 0.05 * one.ratio * (1 / one.frame + 1 / one.engine)
        assert one.ratio == pytest.approx(one.frame / one.engine, abs=rounding)
    assert [one.workers for one in figures.scaling] == [1, 2]
    assert figures.scaling[0].speedup == 1.0
    assert figures.scaling[1].speedup > 0.0
    assert 0.0 < figures.startup["import"] < figures.startup["first_frame"]
    assert min(figures.reading.values()) > 0.0


def test_the_engine_is_timed_in_the_same_world(machine: ModuleType, tmp_path: Path) -> None:
    config = machine.crowded_room(3)
    path = tmp_path / "episode.json"

    def run() -> None:
        machine.run_episode(config, s2.StraightToGoal(), path)

    steps = machine.engine_steps(run)
    timed = path.read_bytes()
    assert len(steps) % machine.FRAMES == 0  # each substep of each frame
    assert min(steps) > 0.0
    run()
    assert path.read_bytes() == timed  # timing changes nothing


def test_the_script_prints_and_draws_the_figures(
    machine: ModuleType,
    figures: Any,
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    pytest.importorskip("matplotlib")
    monkeypatch.setattr(machine, "benchmark", lambda workers: figures)
    monkeypatch.setattr(sys, "argv", ["machine.py", "--picture", str(tmp_path / "bench.png")])
    machine.main()
    printed = capsys.readouterr().out
    for text in ("times the bare engine", "first frame after", "times as fast as one", "json.load"):
        assert text in printed
    assert (tmp_path / "bench.png").read_bytes().startswith(b"\x89PNG")
    monkeypatch.setattr(sys, "argv", ["machine.py", "--json"])
    machine.main()
    stored = json.loads(capsys.readouterr().out)
    assert stored["throughput"][0]["people"] == 2
    assert stored["machine"]["sonata2d"]
