"""`sonata2d evaluate`."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from sonata2d.metrics.catalogue import ALL, METRICS

from ..learning.samples import weights_file
from .conftest import Run


def test_metrics_of_a_data_set_are_shown_and_stored(sonata2d: Run, here: Path) -> None:
    sonata2d("generate out --scenario quick.yaml --episodes 2 --workers 1 --no-picture")
    output = sonata2d("evaluate out --workers 1").output
    assert output.splitlines()[0].split() == ["metric", "unit", "out"]
    assert "success_strict" in output
    assert "2 episodes of out; mean [95 % bootstrap interval]" in output
    stored = json.loads((here / "out/metrics.json").read_text())
    assert stored["episodes"][0]["values"].keys() == ALL.keys()
    assert "no problems" in sonata2d("check out").output


def test_controllers_are_compared_in_the_same_scenes(sonata2d: Run, here: Path) -> None:
    line = "evaluate --controller straight-to-goal --controller social-force --scenario quick.yaml --episodes 2"
    comparison = json.loads(sonata2d(f"{line} --workers 1 --json -o stored").output)
    assert [one["label"] for one in comparison["evaluations"]] == ["straight-to-goal", "social-force"]
    scenes = [[(e["seed"], e["episode"]) for e in one["episodes"]] for one in comparison["evaluations"]]
    assert scenes[0] == scenes[1] == [(0, 0), (0, 1)]
    (difference,) = comparison["differences"]
    means = [one["summary"]["all"]["path_length"]["mean"] for one in comparison["evaluations"]]
    assert difference["path_length"]["mean"] == pytest.approx(means[1] - means[0], abs=1e-5)
    assert {path.name for path in (here / "stored").iterdir()} == {
        "straight-to-goal",
        "social-force",
        "evaluation.json",
    }
    assert (here / "stored/social-force/quick/metrics.json").exists()
    assert json.loads((here / "stored/evaluation.json").read_text()) == comparison


def test_stored_episodes_are_continued(sonata2d: Run, here: Path) -> None:
    line = "evaluate --controller straight-to-goal --scenario quick.yaml --workers 1 -o stored --episodes"
    sonata2d(f"{line} 1")
    first = here / "stored/straight-to-goal/quick/000000.json"
    before = first.stat().st_mtime_ns
    assert "2 episodes of straight-to-goal" in sonata2d(f"{line} 2").output
    assert first.stat().st_mtime_ns == before


def test_weights_with_long_similar_paths_get_different_folders(sonata2d: Run, here: Path) -> None:
    deep = here / "-".join(["a-long-name"] * 8)
    names = [deep / which / "policy.npz" for which in ("first", "second")]
    for k, path in enumerate(names):
        path.parent.mkdir(parents=True)
        weights_file(path, seed=k)
    line = "evaluate --scenario quick.yaml --episodes 1 --workers 1 --no-rerun -o deep-runs"
    sonata2d(f"{line} --controller {names[0]} --controller {names[1]}")
    assert len([path for path in (here / "deep-runs").iterdir() if path.is_dir()]) == 2


def test_without_out_no_file_remains(sonata2d: Run, here: Path) -> None:
    before = sorted(here.iterdir())
    sonata2d("evaluate --controller straight-to-goal --scenario quick.yaml --episodes 1 --workers 1 --no-rerun")
    assert sorted(here.iterdir()) == before


def test_metrics_are_selected_by_name(sonata2d: Run) -> None:
    sonata2d("generate out --scenario quick.yaml --episodes 1 --workers 1 --no-picture")
    lines = sonata2d("evaluate out/000000.json --metric spl --metric socnav3 --workers 1").output.splitlines()
    names = [line.split()[0] for line in lines[1:-2]]
    assert names[0] == "spl"
    assert names[1:] == [name for name in ALL if name.startswith("socnav3.")]
    output = sonata2d("evaluate out --metric all --workers 1").output
    assert all(name in output for name in METRICS)


def test_page_shows_temporary_episodes(sonata2d: Run, here: Path) -> None:
    before = {path.name for path in here.iterdir()}
    line = "evaluate --controller straight-to-goal --controller social-force --scenario quick.yaml --episodes 2"
    assert "page  pages/a.html" in sonata2d(f"{line} --workers 1 --no-rerun --page pages/a.html").output
    assert {path.name for path in here.iterdir()} == before | {"pages"}
    page = (here / "pages/a.html").read_text("utf-8")
    assert page.count("<img") == 24
    assert page.count("driven by straight-to-goal") == page.count("driven by social-force") == 2


def test_page_of_recorded_episodes_shows_the_selected_metrics(sonata2d: Run, here: Path) -> None:
    sonata2d("generate out --scenario quick.yaml --episodes 2 --workers 1 --no-picture")
    sonata2d("evaluate out out/000000.json --metric stl --metric socnavgym --workers 1 --no-rerun --page a.html")
    page = (here / "a.html").read_text("utf-8")
    assert 'id="stl"' in page
    assert 'id="socnavgym.stalled_time"' in page
    assert 'id="spl"' not in page
    assert page.count("best and worst") > 0  # a single episode is both


@pytest.mark.parametrize(
    ("line", "code", "message"),
    [
        ("evaluate", 2, "neither was given"),
        ("evaluate out --controller social-force", 2, "not both"),
        ("evaluate out --scenario empty", 2, "recorded episodes have their own scenes"),
        ("evaluate --controller orca -o set", 2, "set is a data set; give a folder for the data sets of"),
        ("evaluate nowhere", 1, "nowhere does not exist"),
        ("evaluate quick.yaml", 1, "quick.yaml is not valid JSON"),
        ("evaluate --controller social-farce", 1, "did you mean 'social-force'?"),
        ("evaluate nowhere --metric jerk", 1, "no metric is named 'jerk'"),
        ("evaluate nowhere --page a.pdf", 1, "the name of an evaluation page must end in .html"),
    ],
)
def test_invalid_arguments_give_a_one_line_message(
    sonata2d: Run, here: Path, line: str, code: int, message: str
) -> None:
    (here / "set").mkdir()
    (here / "set/manifest.json").touch()
    output = sonata2d(line, code).output.strip()
    assert message in output.splitlines()[-1]


def test_a_killed_run_is_explained_and_not_evaluated_as_empty(sonata2d: Run, here: Path) -> None:
    sonata2d("generate out --scenario quick.yaml --episodes 2 --workers 1 --no-picture")
    manifest = json.loads((here / "out/manifest.json").read_bytes())
    empty = {"complete": False, "counts": {"outcome": {}, "family": {}}, "files": []}
    (here / "out/manifest.json").write_text(json.dumps(manifest | empty))  # as a run begins
    message = "2 episode files are not listed until `generate` with --resume has completed the data set"
    assert f"out lists no episodes: {message}" in sonata2d("evaluate out", code=1).output
    assert message in sonata2d("describe out").output
    assert sonata2d("check out", code=1).output.count(message) == 1


def test_the_scenes_over_which_differences_are_taken_are_counted(sonata2d: Run) -> None:
    for name, episodes in (("a", 2), ("b", 3)):
        sonata2d(f"generate {name} --scenario quick.yaml --episodes {episodes} --workers 1 --no-picture")
    line = "differences are over the scenes in common with a: 2 of b"
    assert line in sonata2d("evaluate a b --workers 1 --no-rerun").output.splitlines()
    assert "differences are over" not in sonata2d("evaluate a a/ --workers 1 --no-rerun").output


@pytest.mark.parametrize("option", ["--seed 3", "--episodes 9", "--scenario quick.yaml", "-o x"])
def test_settings_of_controllers_are_refused_for_recorded_episodes(sonata2d: Run, here: Path, option: str) -> None:
    sonata2d("generate out --scenario quick.yaml --episodes 1 --workers 1 --no-picture")
    assert "require --controller" in sonata2d(f"evaluate out {option}", code=2).output


@pytest.mark.parametrize(("option", "remedy"), [("", "keep the complete episodes with"), ("-o kept", "run the same")])
def test_an_error_of_a_controller_names_a_remedy_that_evaluate_has(
    sonata2d: Run, here: Path, option: str, remedy: str
) -> None:
    (here / "bad.py").write_text(
        "import sonata2d as s2\nclass Bad(s2.Controller):\n    def act(self, snapshot): raise ValueError('no')\n"
    )
    line = f"evaluate --controller ./bad.py --scenario quick.yaml --episodes 2 --workers 1 {option}"
    output = sonata2d(line, code=1).output
    assert remedy in output
    assert "--resume" not in output


def test_a_controller_that_does_not_exist_is_an_error_before_any_episode(sonata2d: Run, here: Path) -> None:
    line = "evaluate --controller straight-to-goal --controller social-planer --scenario quick.yaml -o kept"
    output = sonata2d(line, code=1).output
    assert output == "Error: ControllerError: no controller is named 'social-planer'; did you mean 'social-planner'?\n"
    assert not (here / "kept").exists()
