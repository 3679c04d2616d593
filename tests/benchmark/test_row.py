"""Rows: the same bytes from every run, replayed and re-run, and no change goes unnoticed."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import orjson
import pytest

import sonata2d as s2
from sonata2d.benchmark import read_row, row as module, run_benchmark, verify_row
from sonata2d.benchmark.row import COMMANDS, EPISODES, ROW
from sonata2d.benchmark.suite import commitment, new_secret
from sonata2d.errors import BenchmarkError, ControllerError

from . import cheats
from .conftest import PARTS

FILE = """\
import sonata2d as s2

class Half(s2.StraightToGoal):
    def reset(self, scene):
        self.speed = 0.5
        super().reset(scene)
"""


def test_a_row_has_scores_of_all_scenes_and_its_card(row: Path) -> None:
    scores = read_row(row)
    assert scores["all"]["scenes"] == 4
    assert not scores["complete"]
    assert set(scores["parts"]) == {"encounters", "maps"}
    assert scores["all"]["task"]["success"]["n"] == 4
    assert scores["plan"]["controller"] == "social-planner"
    assert "Training data and seeds" in (row / "README.md").read_text()


def test_a_row_is_replayed_and_run_again(row: Path) -> None:
    found = verify_row(row, rerun=True)
    assert found.problems == ()
    assert found.badges == ("replayed", "re-run")


def test_the_number_of_workers_changes_no_byte(row: Path, tmp_path: Path) -> None:
    run_benchmark("social-planner", tmp_path / "row", parts=PARTS, scenes=2, workers=2)
    assert (tmp_path / "row" / ROW).read_bytes() == (row / ROW).read_bytes()
    assert (tmp_path / "row" / EPISODES).read_bytes() == (row / EPISODES).read_bytes()


def _change_score(folder: Path) -> None:
    content = orjson.loads((folder / ROW).read_bytes())
    content["all"]["strict"]["value"] = 0.123
    (folder / ROW).write_bytes(orjson.dumps(content))


def _change_value(folder: Path) -> None:
    content = orjson.loads((folder / EPISODES).read_bytes())
    content[1]["values"]["psc"] = 0.99
    (folder / EPISODES).write_bytes(orjson.dumps(content))


def _change_command(folder: Path) -> None:
    arrays = dict(np.load(folder / COMMANDS))
    arrays["commands"][20, 0] += 1
    np.savez(folder / COMMANDS, **arrays)


def _cut(folder: Path) -> None:
    arrays = dict(np.load(folder / COMMANDS))
    arrays["commands"], arrays["ticks"][-1] = arrays["commands"][:-5], arrays["ticks"][-1] - 5
    np.savez(folder / COMMANDS, **arrays)


def _hide_late(folder: Path) -> None:
    content = orjson.loads((folder / ROW).read_bytes())
    content["late"] = 3
    (folder / ROW).write_bytes(orjson.dumps(content))


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        (_change_score, "row.json does not hold the scores of its episodes"),
        (_change_value, "a replay gives another values"),
        (_change_command, "a replay gives another sha256"),
        (_cut, "a replay gives another"),
        (_hide_late, "row.json does not hold"),
    ],
)
def test_a_changed_row_is_noticed(row: Path, tmp_path: Path, change: Callable[[Path], None], problem: str) -> None:
    folder = tmp_path / "row"
    shutil.copytree(row, folder)
    change(folder)
    found = verify_row(folder, rerun=True)
    assert found.badges == ()
    assert problem in found.problems[0]


def test_a_controller_in_a_file_is_part_of_the_row(tmp_path: Path) -> None:
    (tmp_path / "half.py").write_text(FILE)
    folder = tmp_path / "row"
    run_benchmark(f"{tmp_path / 'half.py'}:Half", folder, parts=["frontal-approach"], scenes=1)
    assert read_row(folder)["plan"]["controller"] == "half.py:Half"
    (tmp_path / "half.py").unlink()
    assert verify_row(folder, rerun=True).badges == ("replayed", "re-run")
    (folder / "controller" / "half.py").write_text(FILE.replace("0.5", "0.7"))
    assert verify_row(folder).problems == ("controller/half.py is another file than the one that was run",)


class Wavering(s2.Controller):
    """Drives otherwise in each process."""

    deterministic = False

    def act(self, snapshot: s2.Snapshot) -> s2.Twist:
        return s2.Twist(vx=0.2 + 0.1 * np.random.default_rng().random())


def test_an_object_can_be_replayed_only(tmp_path: Path) -> None:
    run_benchmark(Wavering, tmp_path / "row", parts=["frontal-approach"], scenes=1)
    assert verify_row(tmp_path / "row").badges == ("replayed",)
    with pytest.raises(BenchmarkError, match="it can be replayed, not run"):
        verify_row(tmp_path / "row", rerun=True)


def test_a_run_that_was_interrupted_continues_to_the_same_bytes(
    row: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "row"
    kept: list[int] = []

    def interrupt(place: Path, k: int, runs: Any) -> None:
        original(place, k, runs)
        kept.append(k)
        raise KeyboardInterrupt

    original = module._keep
    monkeypatch.setattr(module, "_keep", interrupt)
    with pytest.raises(KeyboardInterrupt):
        run_benchmark("social-planner", folder, parts=PARTS, scenes=2)
    assert kept == [0]
    with pytest.raises(BenchmarkError, match="is no row, or one that is not finished"):
        read_row(folder)
    with pytest.raises(BenchmarkError, match="holds the beginning of another row"):
        run_benchmark("orca", folder, parts=PARTS, scenes=2)
    monkeypatch.setattr(module, "_keep", original)
    run_benchmark("social-planner", folder, parts=PARTS, scenes=2)
    assert (folder / ROW).read_bytes() == (row / ROW).read_bytes()
    with pytest.raises(BenchmarkError, match="holds a row already"):
        run_benchmark("social-planner", folder, parts=PARTS, scenes=2)


def test_hidden_seeds_stay_hidden(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    secret = new_secret()
    folder = tmp_path / "row"
    run_benchmark("orca", folder, seeds="hidden", secret=secret, parts=["frontal-approach"], scenes=1)
    plan = read_row(folder)["plan"]
    assert plan["seed"] is None
    assert secret.hex() not in "".join(path.read_text(errors="replace") for path in folder.iterdir() if path.is_file())
    with pytest.raises(BenchmarkError, match="verified with the secret"):
        verify_row(folder)
    with pytest.raises(BenchmarkError, match="another secret"):
        verify_row(folder, secret=new_secret())
    assert verify_row(folder, secret=secret, rerun=True).badges == ("replayed", "re-run")  # nobody announced it
    announced = {"2027q1": {"commitment": commitment(secret), "secret": None}}
    monkeypatch.setattr(module, "quarters_of", lambda suite: announced)
    assert verify_row(folder, secret=secret, rerun=True).badges == ("replayed", "re-run", "hidden")


def _with_plan(row: Path, folder: Path, **changes: Any) -> Path:
    shutil.copytree(row, folder)
    content = orjson.loads((folder / ROW).read_bytes())
    content["plan"] |= changes
    (folder / ROW).write_bytes(orjson.dumps(content))
    return folder


@pytest.mark.parametrize(
    "changes",
    [
        {"files": {"../mine.py": "0"}}, {"models": {"/tmp/x.json": "0"}}, {"scorers": ["loose.json"]}, {"scenes": "a"},
        {"suite": [1]}, {"track": "radar"}, {"files": {"a\\b.py": "0"}}, {"models": {"..": "0"}},
    ],
)  # fmt: skip
def test_a_row_names_no_files_of_others(row: Path, tmp_path: Path, changes: dict[str, Any]) -> None:
    with pytest.raises(BenchmarkError, match=r"does not say how it was made|no track|does not hold the model"):
        verify_row(_with_plan(row, tmp_path / "row", **changes))


def test_a_rating_model_cannot_stand_for_a_score(row: Path, tmp_path: Path) -> None:
    model = {"format": "sonata2d-rating-model", "version": 1, "question": "?", "episodes": 30, "raters": 1,
             "correlation": 1.0, "features": [], "mean": [], "scale": [], "weights": [], "bias": 1.0}  # fmt: skip
    content = orjson.dumps(model)
    folder = _with_plan(
        row, tmp_path / "row", scorers=["strict.json"], models={"strict.json": sha256(content).hexdigest()}
    )
    (folder / "controller").mkdir()
    (folder / "controller" / "strict.json").write_bytes(content)
    assert verify_row(folder).badges == ()
    (folder / "controller" / "extra.txt").write_text("more")
    assert "controller/extra.txt was not part of the run" in verify_row(folder).problems


def test_a_deterministic_controller_gives_equal_commands(tmp_path: Path) -> None:
    (tmp_path / "drifting.py").write_text(
        "import numpy as np\nimport sonata2d as s2\n\n\nclass Drifting(s2.Controller):\n"
        "    def act(self, snapshot):\n        return s2.Twist(vx=0.2 + 0.1 * np.random.default_rng().random())\n"
    )
    run_benchmark(str(tmp_path / "drifting.py"), tmp_path / "row", parts=["frontal-approach"], scenes=2)
    found = verify_row(tmp_path / "row", rerun=True)
    assert found.badges == ("replayed",)
    assert found.problems == ("the controller gives other commands in 2 scenes of a second run",)


def test_a_controller_that_always_fails_stops_the_run(tmp_path: Path) -> None:
    with pytest.raises(ControllerError, match="failed in all of the first 6 scenes: the controller failed: Runtime"):
        run_benchmark(cheats.Raises, tmp_path / "row", parts=["encounters"], scenes=2)


def test_a_start_that_failed_leaves_its_folder_to_the_next(tmp_path: Path) -> None:
    (tmp_path / "half.py").write_text(FILE.replace("0.5", "0.5 +"))
    arguments: dict[str, Any] = {"parts": ["frontal-approach"], "scenes": 1}
    with pytest.raises(ControllerError, match="cannot be loaded"):
        run_benchmark(f"{tmp_path / 'half.py'}:Half", tmp_path / "row", **arguments)
    (tmp_path / "half.py").write_text(FILE)
    run_benchmark(f"{tmp_path / 'half.py'}:Half", tmp_path / "row", **arguments)
    assert verify_row(tmp_path / "row").badges == ("replayed",)


def test_wrong_arguments_are_refused(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    for arguments, problem in (
        ({"track": "radar"}, "there is no track 'radar'; tracks are state, sees, lidar"),
        ({"suite": "s2b"}, "did you mean 's2b-1'"),
        ({"parts": ["map"]}, "did you mean 'maps'"),
        ({}, "is not empty"),
    ):
        with pytest.raises(BenchmarkError, match=problem):
            run_benchmark("orca", tmp_path, **arguments)  # type: ignore[arg-type]
    with pytest.raises(BenchmarkError, match=r"there is no file .*gone\.py"):
        run_benchmark("./gone.py", tmp_path / "row")
    with pytest.raises(BenchmarkError, match=r"has no row\.json"):
        verify_row(tmp_path)


@pytest.mark.parametrize(
    ("name", "content", "problem"),
    [
        (ROW, b"{", "is no JSON file"),
        (ROW, b"[]", "is no row of a benchmark"),
        (ROW, b'{"format":"sonata2d-benchmark-row","version":9}', "is a row of version 9"),
        (ROW, b'{"format":"sonata2d-benchmark-row","version":1}', "does not say how it was made"),
        (EPISODES, b"[1]", "is no complete row"),
        (EPISODES, b"null", "is no complete row"),
        (COMMANDS, b"PK", "is no complete row"),
    ],
)
def test_damaged_rows_are_refused(row: Path, tmp_path: Path, name: str, content: bytes, problem: str) -> None:
    folder = tmp_path / "row"
    shutil.copytree(row, folder)
    (folder / name).write_bytes(content)
    with pytest.raises(BenchmarkError, match=problem):
        verify_row(folder)
