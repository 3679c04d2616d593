"""`evaluate` with controllers and recorded episodes, and what its result shows, saves and deletes."""

from __future__ import annotations

import gc
import json
import sys
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

import sonata2d as s2
from sonata2d.errors import ConfigError, ControllerError, MetricError, RecordError, RenderError
from sonata2d.metrics import METRICS
from sonata2d.metrics.summary import bootstrap_interval

from .samples import evaluation

SHORT = s2.ScenarioConfig(name="short", humans=2, rules={"time_limit": 3.0})


class Ahead(s2.Controller):
    """Drives ahead."""

    version = "1"

    def __init__(self, speed: float = 0.5) -> None:
        self.speed = speed

    def act(self, snapshot: s2.Snapshot) -> s2.Twist:
        return s2.Twist(vx=self.speed)


@pytest.fixture(scope="module")
def compared() -> s2.Comparison:
    return s2.evaluate({"slow": Ahead(0.2), "fast": Ahead(0.8), "named": "orca"}, SHORT, episodes=3, seed=4)


def test_classes_objects_and_names_are_run_in_the_same_scenes(compared: s2.Comparison) -> None:
    assert repr(compared) == "<Comparison of slow (3 episodes), fast (3 episodes), named (3 episodes)>"
    assert [one.label for one in compared] == ["slow", "fast", "named"]
    assert compared["fast"] is compared[1]
    assert compared[0].scenes == compared[1].scenes == compared[2].scenes
    slow, fast = (compared[label].summary("path_length").mean for label in ("slow", "fast"))
    assert slow == pytest.approx(0.6, abs=0.02)
    assert fast is not None
    assert fast > slow
    assert compared.datasets["fast"][1].controller_info.settings == {"speed": 0.8}


def test_the_result_holds_the_episodes_until_it_is_deleted() -> None:
    result = s2.evaluate(Ahead, SHORT, episodes=1, rerun=False)
    folder = result.datasets["Ahead"].path
    assert len(result.datasets["Ahead"][0]) == 30
    del result
    gc.collect()
    assert not folder.exists()


def test_episodes_are_stored_and_continued(tmp_path: Path) -> None:
    settings: dict[str, Any] = {"out": tmp_path / "kept", "rerun": False}
    first = s2.evaluate([Ahead], SHORT, episodes=1, **settings)
    file = first.datasets["Ahead"].files[0]
    before = file.stat().st_mtime_ns
    del first
    assert len(s2.evaluate([Ahead], SHORT, episodes=2, **settings)["Ahead"].episodes) == 2
    assert file.stat().st_mtime_ns == before
    stored = json.loads((tmp_path / "kept/evaluation.json").read_text())
    assert [one["label"] for one in stored["evaluations"]] == ["Ahead"]
    assert (file.parent / "metrics.json").exists()


def test_recorded_episodes_are_evaluated_and_stay_as_they_are(tmp_path: Path) -> None:
    dataset = s2.generate_dataset(tmp_path / "runs", SHORT, Ahead, episodes=3)
    before = sorted(path.name for path in dataset.path.iterdir())
    result = s2.evaluate({"all": dataset, "some": dataset[:2], "file": dataset.files[0]}, rerun=False)
    assert [len(one.episodes) for one in result] == [3, 2, 1]
    assert result["file"].episodes[0] == result["all"].episodes[0]
    assert result.datasets["all"] is dataset
    assert sorted(path.name for path in dataset.path.iterdir()) == before
    assert s2.evaluate(dataset.path, rerun=False)[0].label == str(dataset.path)
    mixed = s2.evaluate({"recorded": dataset, "run": Ahead}, SHORT, episodes=3, rerun=False)
    assert mixed["recorded"].scenes == mixed["run"].scenes
    # only whole data sets get a metrics.json
    s2.evaluate(dataset[:2], rerun=False).save_metrics()
    assert not (dataset.path / "metrics.json").exists()


def test_several_scenarios_are_evaluated_together(tmp_path: Path) -> None:
    result = s2.evaluate(Ahead, [SHORT, SHORT.changed(name="other", humans=0)], episodes=2, rerun=False)
    assert {episode.name for episode in result["Ahead"].episodes} == {"short", "other"}
    assert len(result.datasets["Ahead"]) == 4
    with pytest.raises(ConfigError, match="two scenarios have the name 'short'; give them different names"):
        s2.evaluate(Ahead, [SHORT, SHORT])


def test_tables(compared: s2.Comparison) -> None:
    lines = str(compared).splitlines()
    assert lines[0].split() == ["metric", "unit", "slow", "fast", "named"]
    assert lines[1].split()[0] == next(name for name, metric in METRICS.items() if metric.headline)
    assert "intervals of fewer than 20 episodes are too narrow" in lines
    assert lines[-5] == (
        "3 episodes of slow, 3 episodes of fast, 3 episodes of named; mean [95 % bootstrap interval]; * significant "
        "difference from the first, in the common scenes"
    )
    frame = compared.to_pandas()
    assert len(frame) == 9
    assert frame.groupby("label")["path_length"].mean()["slow"] == pytest.approx(0.6, abs=0.02)
    other = compared.to_polars()
    assert other["label"].to_list() == frame["label"].tolist()
    assert other["time_to_goal"].null_count() == frame["time_to_goal"].isna().sum() > 0


def test_differences_are_from_the_first_evaluation(compared: s2.Comparison) -> None:
    document = compared.to_json()
    assert [(each["of"], each["from"]) for each in document["differences"]] == [("fast", "slow"), ("named", "slow")]


def test_intervals_follow_from_the_stated_settings_of_the_bootstrap() -> None:
    values = np.geomspace(0.001, 1.0, 40)
    document = evaluation("a", *values.tolist()).to_json()
    stated = document["summary"]["all"]["spl"]
    assert bootstrap_interval(values, **document["bootstrap"]) == (stated["low"], stated["high"])
    other = document["bootstrap"] | {"seed": 1}
    assert bootstrap_interval(values, **other) != (stated["low"], stated["high"])


@pytest.mark.parametrize("count", [19, 20, 21])
def test_fewer_than_20_episodes_are_noted(count: int) -> None:
    comparison = s2.Comparison({}, [evaluation("a", *np.full(count, 0.5))], [METRICS["spl"]], is_selected=True)
    assert ("intervals of fewer than 20 episodes are too narrow" in comparison.notes()) == (count < 20)


def test_notes_name_the_scenes_in_common_with_the_first() -> None:
    evaluations = [evaluation("a", 0.1, 0.2, 0.3), evaluation("b", 0.1, 0.2), evaluation("c", 0.5)]
    notes = s2.Comparison({}, evaluations, [METRICS["spl"]], is_selected=True).notes()
    assert "differences are over the scenes in common with a: 2 of b, 1 of c" in notes


def test_a_notebook_shows_a_table(compared: s2.Comparison) -> None:
    text = compared._repr_html_()
    assert text.count("<tr>") == 1 + len(compared.metrics)


@pytest.mark.parametrize("name", ["a.html", "a.json"])
def test_a_comparison_is_saved(compared: s2.Comparison, name: str, tmp_path: Path) -> None:
    compared.save(tmp_path / name)
    assert (tmp_path / name).stat().st_size > 2000
    if name == "a.html":
        assert (tmp_path / name).read_text().count("driven by tests.metrics.test_comparison:Ahead") >= 2


def test_a_page_shows_the_selected_metrics_only(tmp_path: Path) -> None:
    pages = []
    for metrics in (["spl", "time_to_goal"], None):
        s2.evaluate(Ahead(0.8), SHORT, episodes=2, seed=4, metrics=metrics).save(tmp_path / "a.html")
        pages.append((tmp_path / "a.html").read_text())
    assert ["jerk_mean" in page for page in pages] == [False, True]
    assert ["time_to_goal" in page for page in pages] == [True, True]


def test_another_suffix_is_refused(compared: s2.Comparison, tmp_path: Path) -> None:
    with pytest.raises(RenderError, match=r"must end in .html or .json"):
        compared.save(tmp_path / "a.gif")
    with pytest.raises(KeyError, match="did you mean 'fast'"):
        compared["fats"]


def test_progress_is_reported_to_a_function() -> None:
    seen: dict[str, list[int]] = {}

    @contextmanager
    def bar(total: int, unit: str) -> Any:
        seen[unit] = [total, 0]

        def advance(steps: int) -> None:
            seen[unit][1] += steps

        yield advance

    s2.evaluate(Ahead, SHORT, episodes=2, rerun=False, progress=bar)
    assert seen == {"episodes of Ahead": [2, 2], "episodes measured": [2, 2]}


def test_progress_is_shown_on_request(capfd: pytest.CaptureFixture[str]) -> None:
    s2.evaluate(Ahead, SHORT, episodes=1, rerun=False, progress=True)
    assert "episodes of Ahead" in capfd.readouterr().err
    s2.evaluate(Ahead, SHORT, episodes=1, rerun=False)
    assert capfd.readouterr().err == ""


def test_invalid_arguments(tmp_path: Path) -> None:
    (tmp_path / "runs").mkdir()
    cases: list[tuple[Any, dict[str, Any], type[Exception], str]] = [
        ([], {}, ValueError, "nothing to evaluate"),
        ([Ahead(0.1), Ahead(0.2)], {}, ValueError, "two subjects have the label 'Ahead'; name them"),
        (3, {}, TypeError, "got 3; recorded episodes are a sonata2d.Dataset or a pathlib.Path"),
        ("social-planer", {}, ControllerError, "did you mean 'social-planner'"),
        (str(tmp_path / "runs"), {}, ControllerError, "no controller is named"),
        (tmp_path / "runs", {}, RecordError, "no episode"),
        (tmp_path / "none", {}, RecordError, "does not exist"),
        (Ahead, {"episodes": 0}, ValueError, "episodes must be 1 or more, got 0"),
        (Ahead, {"workers": 0}, ValueError, "workers must be 1 or more, got 0"),
        (Ahead, {"resamples": "many"}, TypeError, "resamples must be a whole number, got 'many'"),
        (Ahead, {"metrics": ["sucess"]}, MetricError, "did you mean 'success'"),
    ]
    for subjects, settings, kind, message in cases:
        with pytest.raises(kind, match=message):
            s2.evaluate(subjects, SHORT, **settings)
    dataset = s2.generate_dataset(tmp_path / "set", SHORT, Ahead, episodes=1)
    with pytest.raises(ValueError, match="all subjects are recorded episodes"):
        s2.evaluate(dataset, out=tmp_path / "out")
    with pytest.raises(RecordError, match="set is a data set; choose a folder"):
        s2.evaluate(Ahead, SHORT, out=dataset.path)
    with pytest.raises(ControllerError) as caught:
        s2.evaluate(str(dataset.path))
    assert "recorded episodes are evaluated with Dataset(" in caught.value.__notes__[0]


def test_a_baseline_can_be_used_again_and_keeps_its_episodes() -> None:
    first = s2.evaluate(Ahead, SHORT, episodes=1, rerun=False)
    second = s2.evaluate({"old": first.datasets["Ahead"], "new": Ahead(0.8)}, SHORT, episodes=1, rerun=False)
    part = first.datasets["Ahead"][:1]
    del second
    gc.collect()
    assert len(first.datasets["Ahead"][0]) == 30
    del first
    gc.collect()
    assert len(part[0]) == 30  # a part keeps the folder


def test_a_loop_over_episodes_keeps_their_folder() -> None:
    for record in s2.evaluate(Ahead, SHORT, episodes=2, rerun=False).datasets["Ahead"]:
        gc.collect()
        assert len(record) == 30


def test_episodes_of_several_scenarios_have_different_ids() -> None:
    scenarios = [SHORT, SHORT.changed(name="other")]
    dataset = s2.evaluate(Ahead, scenarios, episodes=2, rerun=False).datasets["Ahead"]
    ids = dataset.to_pandas("episodes")["episode_id"].tolist()
    assert ids == ["short/000000", "short/000001", "other/000000", "other/000001"]
    with pytest.raises(KeyError, match=r"2 episodes of .* are named '000000'; give a number"):
        dataset["000000"]


def test_episodes_of_changed_code_are_not_continued(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "__main__", ModuleType("__main__"))  # as in a notebook, without a file
    space: dict[str, Any] = {"s2": s2, "__name__": "__main__"}
    code = "class Mine(s2.Controller):\n    def act(self, snapshot):\n        return s2.Twist(vx=SPEED)\n"
    settings: dict[str, Any] = {"episodes": 1, "out": tmp_path / "kept", "rerun": False}
    exec(code.replace("SPEED", "0.2"), space)
    s2.evaluate(space["Mine"], SHORT, **settings)
    s2.evaluate(space["Mine"], SHORT, **settings)  # the same code
    exec(code.replace("SPEED", "0.9"), space)
    with pytest.raises(RecordError, match=r"the code of __main__:Mine, SHA-256 .* now; choose another folder"):
        s2.evaluate(space["Mine"], SHORT, **settings)


def test_recorded_data_sets_beside_controllers_are_not_changed(tmp_path: Path) -> None:
    dataset = s2.generate_dataset(tmp_path / "runs", SHORT, Ahead, episodes=1)
    s2.evaluate({"recorded": dataset, "run": Ahead}, SHORT, episodes=1, out=tmp_path / "out", rerun=False)
    assert not (dataset.path / "metrics.json").exists()
    assert (tmp_path / "out/run/short/metrics.json").exists()
