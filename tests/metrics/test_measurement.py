"""Measuring data sets: stored metrics, scene hashes, tables; and metrics for which an imported episode lacks data."""

from __future__ import annotations

import hashlib
import json
import math
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

import sonata2d as s2
from sonata2d.core.proxemics import obstacle_clearance
from sonata2d.core.scene import Scene
from sonata2d.datasets import generate_dataset, mirror_dataset, verify
from sonata2d.errors import MetricError, RecordError
from sonata2d.metrics.catalogue import ALL, METRICS, NEEDING_RERUN, headline_metrics, select_metrics
from sonata2d.metrics.comparison import Comparison
from sonata2d.metrics.definition import DEFINITIONS_VERSION, NEEDS, Metric, metric
from sonata2d.metrics.disturbance import RunWithoutRobot
from sonata2d.metrics.evaluation import Evaluation
from sonata2d.metrics.evaluation_page import page_of
from sonata2d.metrics.interop import VARIANTS
from sonata2d.metrics.measurement import episode_files, measure, measure_files, save_metrics, scene_hash
from sonata2d.record.canonical import serialise
from sonata2d.record.reader import read_episode
from sonata2d.record.record import EpisodeRecord
from sonata2d.version import PHYSICS_VERSION

from ..conftest import room, times_to_collision
from .samples import measured, record, stay

ROOT = Path(__file__).parent.parent.parent
IMPORTED = {"format": "mine", "file": "a.csv", "sha256": "0" * 64, "derived": []}


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three short episodes."""
    out = tmp_path_factory.mktemp("sets") / "demo"
    generate_dataset(out, short_scenario(3.0), "straight-to-goal", episodes=3, seed=4)
    return out


def short_scenario(time_limit: float) -> s2.ScenarioConfig:
    config = s2.load_scenario("sonata-2020")
    return config.model_copy(update={"rules": replace(config.rules, time_limit=time_limit)})


def test_metrics_are_stored_with_the_episodes_and_the_data_set_stays_valid(dataset: Path) -> None:
    path = save_metrics(dataset, Evaluation("demo", measure_files(episode_files(dataset))))
    stored = json.loads(path.read_text())
    assert path.name == "metrics.json"
    assert (stored["format"], stored["version"]) == ("sonata2d-metrics", DEFINITIONS_VERSION)
    assert (stored["sonata2d"], stored["physics"]) == (s2.__version__, PHYSICS_VERSION)
    assert [episode["file"] for episode in stored["episodes"]] == ["000000.json", "000001.json", "000002.json"]
    first = stored["episodes"][0]
    assert first["sha256"] == hashlib.sha256((dataset / "000000.json").read_bytes()).hexdigest()
    assert first["values"].keys() == ALL.keys() == stored["metrics"].keys()
    assert stored["summary"]["all"]["success"]["n"] == 3
    succeeded = sum(episode["values"]["success"] for episode in stored["episodes"])
    assert stored["summary"]["successful"]["success"]["n"] == succeeded
    families = stored["summary"]["by_family"]
    assert sum(family["success"]["n"] for family in families.values()) == 3
    assert verify(dataset) == []


def test_clearances_and_times_to_collision_equal_those_of_controllers(dataset: Path) -> None:
    finite = 0
    for file, found in zip(episode_files(dataset), measure_files(episode_files(dataset), rerun=False), strict=True):
        snapshots = list(read_episode(file).snapshots())
        clearance, obstacles = min(map(s2.clearance, snapshots)), min(map(obstacle_clearance, snapshots))
        soonest = min(float(times_to_collision(snapshot).min(initial=math.inf)) for snapshot in snapshots)
        assert found.values["human_clearance_min"] == defined(max(clearance, 0.0))
        assert found.values["obstacle_clearance_min"] == defined(max(obstacles, 0.0))
        assert found.values["time_to_collision_min"] == defined(soonest)
        finite += math.isfinite(clearance) + math.isfinite(soonest)
    assert finite > 1


def defined(number: float) -> object:
    return pytest.approx(number, abs=1e-6) if math.isfinite(number) else None


def test_metrics_file_is_not_an_episode_of_a_folder_without_manifest(dataset: Path, tmp_path: Path) -> None:
    for name in ("000000.json", "000001.json"):
        (tmp_path / name).write_bytes((dataset / name).read_bytes())
    (tmp_path / "metrics.json").write_text("{}")
    assert episode_files(tmp_path) == [tmp_path / "000000.json", tmp_path / "000001.json"]


@pytest.mark.usefixtures("kept_processes")
def test_number_of_workers_does_not_change_the_metrics(dataset: Path) -> None:
    files, done = episode_files(dataset), []
    assert measure_files(files, workers=2, advance=done.append) == measure_files(files)
    assert done == [1, 1, 1]


def test_controllers_in_the_same_scenes_share_the_runs_without_a_robot(
    dataset: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    other = tmp_path / dataset.name
    generate_dataset(other, short_scenario(3.0), "social-planner", episodes=3, seed=4)
    files, runs, advanced = [episode_files(folder) for folder in (dataset, other)], [], []

    class Counted(RunWithoutRobot):
        def __init__(self, scene: Scene) -> None:
            super().__init__(scene)
            runs.append(scene)

    monkeypatch.setattr("sonata2d.metrics.disturbance.RunWithoutRobot", Counted)
    separate = [measured for own in files for measured in measure_files(own)]
    assert len(runs) == 4  # nobody walks in one of the three scenes
    together = measure_files([file for own in files for file in own], advance=advanced.append)
    assert together == separate
    assert len(runs) == 4 + 2
    assert sum(advanced) == 6


def test_mirror_image_is_another_scene_with_the_same_metrics(dataset: Path, tmp_path: Path) -> None:
    mirror_dataset(dataset, tmp_path / "image")
    images = measure_files(episode_files(tmp_path / "image"))
    for original, image in zip(measure_files(episode_files(dataset)), images, strict=True):
        assert original.scene != image.scene
        for name in METRICS.keys() - {"shortest_length", "spl", "stl"}:
            assert image.values[name] == pytest.approx(original.values[name], abs=2e-6), name


def test_scene_hash_depends_on_the_scene_and_not_on_the_controller(dataset: Path, tmp_path: Path) -> None:
    for name, time_limit in (("other-driver", 3.0), ("longer", 3.1)):
        generate_dataset(tmp_path / name, short_scenario(time_limit), "social-force", episodes=3, seed=4)
    original, other_driver, longer = (
        [one.scene for one in measure_files(episode_files(folder), rerun=False)]
        for folder in (dataset, tmp_path / "other-driver", tmp_path / "longer")
    )
    assert original == other_driver
    # people make choices from the seed
    hashes = {scene_hash(record(replace(room(), seed=seed), stay(0, 0, 2))) for seed in (1, 2)}
    assert len(hashes) == 2
    assert len({*original, *longer}) == 6


def test_folder_without_episodes_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RecordError, match="holds no episode files"):
        episode_files(tmp_path)


def test_metrics_are_selected_by_name_project_or_all() -> None:
    assert [metric.name for metric in select_metrics(["spl", "success", "spl"])] == ["spl", "success"]
    socnav3 = {metric.name for metric in VARIANTS if metric.name.startswith("socnav3.")}
    assert {metric.name for metric in select_metrics(["socnav3"])} == socnav3
    assert select_metrics(["all"]) == tuple(METRICS.values())
    with pytest.raises(MetricError, match="did you mean 'success'"):
        select_metrics(["sucess"])


def test_every_metric_has_unit_formula_and_source() -> None:
    for each in ALL.values():
        assert each.unit
        assert each.formula
        assert each.source
        assert each.better in ("more", "less", "neither")
    assert 10 <= len(headline_metrics()) <= 20


def test_difference_is_taken_over_common_scenes() -> None:
    first = Evaluation("a", [measured(k, {"t": t}) for k, t in ((0, 1.0), (1, 2.0), (2, 9.0))])
    second = Evaluation("b", [measured(k, {"t": t}) for k, t in ((1, 4.0), (0, 3.0), (3, 0.0))])
    difference = second.difference(first, "t")
    assert (difference.n, difference.mean) == (2, 2.0)
    assert difference.excludes_zero
    assert not first.difference(first, "t").excludes_zero


def test_table_shows_mean_interval_n_and_significance() -> None:
    """All differences of path_length are 1, so that the interval of the difference excludes 0."""
    first = Evaluation("a", [measured(k, {"path_length": float(k), "spl": None}) for k in range(4)])
    second = Evaluation("b", [measured(k, {"path_length": k + 1.0, "spl": 0.5 if k == 0 else None}) for k in range(4)])
    metrics = select_metrics(["path_length", "spl"])
    head, length, weighted = Comparison({}, [first, second], metrics, is_selected=True).table().splitlines()
    assert head.split() == ["metric", "unit", "a", "b"]
    assert length.startswith("path_length  ↓  m")
    assert "1.50 [" in length
    assert length.endswith("]*")
    assert "not defined" in weighted
    assert weighted.endswith("0.50 (n=1)")
    assert first.summary("path_length").text(4).count("n=") == 0


def test_example_of_the_documentation_runs(dataset: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    page = (ROOT / "docs/metrics.md").read_text("utf-8")
    monkeypatch.chdir(dataset.parent)  # the data set is called demo, as in the example
    names: dict[str, dict[str, float | None]] = {}
    exec(page.split("```python")[1].split("```")[0], names)
    assert names["values"].keys() == ALL.keys()


def test_documentation_lists_the_current_definitions() -> None:
    done = subprocess.run(
        [sys.executable, ROOT / "docs/generate_metrics.py", "--check"], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    page = (ROOT / "docs/metrics.md").read_text("utf-8")
    assert all(f"`{name}`" in page for name in ALL)


@pytest.fixture(scope="module")
def episode(tmp_path_factory: pytest.TempPathFactory) -> EpisodeRecord:
    """An episode that reaches the goal."""
    path = tmp_path_factory.mktemp("one") / "one.json"
    scene = s2.generate(s2.ScenarioConfig(humans=3, rules={"time_limit": 20.0}), seed=4)
    s2.Episode(scene, s2.SocialPlanner(), observers=[s2.JsonRecorder(path)]).run()
    return read_episode(path)


def without(record: EpisodeRecord, *lacks: str) -> EpisodeRecord:
    """An episode as if it had been imported from a source without some data."""
    return replace(record, document={**record.document, "imported": {"lacks": list(lacks)}})


def test_episode_without_a_goal_has_no_success(episode: EpisodeRecord) -> None:
    complete, lacking = (measure(one, rerun=False) for one in (episode, without(episode, "goal")))
    assert complete["success"] == 1.0
    assert lacking["success"] is lacking["spl"] is lacking["time_to_goal"] is lacking["success_strict"] is None
    assert lacking["path_length"] == complete["path_length"]


def test_episode_without_radii_has_no_clearances_to_people(episode: EpisodeRecord) -> None:
    lacking = measure(without(episode, "humans.radius"), rerun=False)
    assert lacking["human_clearance_min"] is lacking["collisions"] is lacking["time_to_collision_min"] is None
    assert lacking["success"] == 1.0
    assert lacking["obstacle_clearance_min"] is not None


def test_episode_without_a_robot_has_no_metrics(episode: EpisodeRecord) -> None:
    assert set(measure(without(episode, "robot"), rerun=False).values()) == {None}


def test_variant_needs_other_data_than_its_metric(episode: EpisodeRecord) -> None:
    """SocNavGym measures the distance between centres, and SocNav3 gives all people one radius."""
    lacking = measure(without(episode, "humans.radius", "goal"), rerun=False)
    assert lacking["hunavsim.goal_reached"] is lacking["hunavsim.personal_space_intrusions"] is None
    assert lacking["socnavgym.failure_to_progress"] is lacking["socnav3.path_efficiency_ratio"] is None
    measured = ("socnavgym.minimum_distance_to_human", "socnav3.hum_collision_flag", "socnavgym.stalled_time")
    assert all(lacking[name] is not None for name in measured)


@pytest.mark.parametrize("need", sorted({need for each in ALL.values() for need in each.needs} - {"headings"}))
def test_a_metric_is_not_computed_if_the_file_lacks_what_it_needs(episode: EpisodeRecord, need: str) -> None:
    lacking = measure(without(episode, need), rerun=False)
    assert all(lacking[name] is None for name, each in ALL.items() if need in each.needs)


def test_headings_that_were_derived_are_not_measured(episode: EpisodeRecord) -> None:
    document = {**episode.document, "imported": {"lacks": [], "derived": ["frames.humans.theta"]}}
    values = measure(replace(episode, document=document), rerun=False)
    assert values["hunavsim.robot_on_person_collision"] is None
    assert values["robot_on_person"] is not None


def test_a_metric_must_state_what_it_needs() -> None:
    def function(trajectory: object) -> float:
        return 0.0

    with pytest.raises(TypeError, match="needs"):
        Metric("mine", "m", "less", "0", "mine", function)  # type: ignore[call-arg]
    with pytest.raises(ValueError, match=r"metric 'mine': needs has the unknown name 'gaol'; did you mean 'goal'"):
        Metric("mine", "m", "less", "0", "mine", function, needs={"robot", "gaol"})  # type: ignore[arg-type]
    with pytest.raises(ValueError, match=r"unknown name 'x'; use robot, goal, "):
        metric("m", "less", needs="x")(function)  # type: ignore[arg-type]
    assert Metric("mine", "m", "less", "0", "mine", function, needs="goal").needs == {"goal"}  # type: ignore[arg-type]
    assert all(each.needs <= set(NEEDS) for each in ALL.values())


def test_a_decorated_function_is_a_metric_with_the_formula_of_its_docstring() -> None:
    @metric("m", "less", needs={"robot"}, name="project.mine")
    def mine(trajectory: object) -> float:
        """Sum of |x|.

        Not defined
        without x.

        Source: a paper, 2026 (X).
        """
        return 1.0

    assert (mine.name, mine.formula) == ("project.mine", "Sum of |x|. Not defined without x")
    assert (mine.source, mine.unit, mine.needs) == ("a paper, 2026 (X)", "m", {"robot"})


def test_metrics_of_the_run_without_a_robot_need_the_seed() -> None:
    assert {"human_slowing", "human_deviation_mean", "human_deviation_max"} == NEEDING_RERUN


def test_the_table_says_what_the_files_lack(episode: EpisodeRecord, tmp_path: Path) -> None:
    path = tmp_path / "foreign.json"
    names = {"robot.radius", "goal", "outcome", "seed"}
    document = episode.document | {"imported": {**IMPORTED, "lacks": sorted(names)}}
    path.write_bytes(serialise(document))
    evaluation = Evaluation("foreign", measure_files([path]))
    assert set(evaluation.episodes[0].lacks) == names
    assert evaluation.lacking("spl") == ["goal", "robot.radius"]
    metrics = select_metrics(["path_length", "success", "human_slowing", "spl"])
    comparison = Comparison({}, [evaluation, evaluation], metrics, is_selected=True)
    assert len(comparison.notes()) == 2, "an unknown outcome is neither a stop nor a failure"
    table = Comparison({}, [evaluation], metrics, is_selected=True).table()
    assert "not measured: lacks goal, robot.radius" in table
    assert [line.split()[3:] for line in table.splitlines()[2:4]] == [
        ["not", "measured:", "lacks", "goal"], ["not", "measured:", "lacks", "seed"],
    ]  # fmt: skip
    page = page_of([evaluation], metrics=metrics)
    assert '<small class="lacking">not measured: lacks goal</small>' in page
