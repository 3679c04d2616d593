"""The benchmark measures what it says, and shows it as text, JSON and a picture."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner
from sonata2d_cli import main

from sonata2d.errors import RenderError
from sonata2d.testing import benchmark as module


@pytest.fixture(scope="module")
def found() -> module.Benchmark:
    """The figures of a very short run."""
    with pytest.MonkeyPatch.context() as patch:
        shorten(patch)
        steps: list[int] = []
        result = module.benchmark(workers=2, advance=steps.append)
    assert sum(steps) == module.STEPS
    return result


def shorten(patch: pytest.MonkeyPatch) -> None:
    for name, value in {"PEOPLE": (2, 4), "_REPEATS": 1, "_PROBE": 4, "_LEAST_SECONDS": 0.01}.items():
        patch.setattr(module, name, value)
    patch.setattr(module, "_megabytes", lambda episodes: 100)


def test_the_figures_are_consistent(found: module.Benchmark) -> None:
    assert [one.people for one in found.throughput] == [2, 4]
    for one in found.throughput:
        assert one.frame > one.engine > 0.0
        rounding = 0.005 + 0.05 * one.ratio * (1 / one.frame + 1 / one.engine)
        assert one.ratio == pytest.approx(one.frame / one.engine, abs=rounding)
    assert [one.workers for one in found.scaling] == [1, 2]
    assert found.scaling[0].speedup == 1.0
    assert found.scaling[1].speedup > 0.0
    assert 0.0 < found.startup["import"] < found.startup["first_frame"]
    assert min(found.reading.values()) > 0.0


def test_the_engine_is_timed_in_the_same_world(tmp_path: Path) -> None:
    config = module.crowded_room(3)
    path = tmp_path / "episode.json"

    def run() -> None:
        module.run_episode(config, module.StraightToGoal(), path)

    steps = module.engine_steps(run)
    timed = path.read_bytes()
    assert len(steps) % module.FRAMES == 0  # each substep of each frame
    assert min(steps) > 0.0
    run()
    assert path.read_bytes() == timed  # timing changes nothing


def test_figures_are_saved(found: module.Benchmark, tmp_path: Path) -> None:
    found.save(tmp_path / "bench.json")
    stored = json.loads((tmp_path / "bench.json").read_text())
    assert stored["scaling"][1]["workers"] == 2
    assert stored["machine"]["sonata2d"]
    pytest.importorskip("matplotlib")
    found.save(tmp_path / "bench.png")
    assert (tmp_path / "bench.png").read_bytes().startswith(b"\x89PNG")
    with pytest.raises(RenderError):
        found.save(tmp_path / "bench.xyz")


def test_the_command_prints_the_figures(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, found: Any) -> None:
    monkeypatch.setattr(module, "benchmark", lambda **options: found)
    monkeypatch.chdir(tmp_path)
    pytest.importorskip("matplotlib")
    result = CliRunner().invoke(main, ["bench", "--picture", "bench.svg"])
    assert result.exit_code == 0, result.output
    for text in ("times the bare engine", "first frame after", "times as fast as one", "json.load", "bench.svg"):
        assert text in result.output
    result = CliRunner().invoke(main, ["bench", "--json"])
    assert json.loads(result.output)["throughput"][0]["people"] == 2
    assert CliRunner().invoke(main, ["bench", "--picture", "bench.txt"]).exit_code == 1
