"""Objects of a program that are registered under a name: known in worker processes, replaced by the next one."""

from __future__ import annotations

import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import sonata2d as s2
import sonata2d.datasets
from sonata2d.datasets.check.replay import check_replay
from sonata2d.errors import ConfigError, ControllerError, RecordError
from sonata2d.record.reader import read_episode
from sonata2d.registry import METRICS, PEDESTRIAN_MODELS

from ..datasets.test_generate import contents


class Straight:
    """Walks straight on, and avoids nothing."""

    evaluations, headed = 1, False

    def __init__(self, scene: s2.Scene) -> None:
        pass

    def acceleration(self, walkers: Any) -> Any:
        return (walkers.desired_direction * walkers.desired_speed[:, None] - walkers.velocity) / 0.5


class Still(Straight):
    """Does not move."""

    def acceleration(self, walkers: Any) -> Any:
        return -walkers.velocity / 0.5


class Fails(Straight):
    """Raises an error."""

    def acceleration(self, walkers: Any) -> Any:
        raise RuntimeError("no law")


@pytest.fixture(autouse=True)
def _nothing_stays_registered() -> Iterator[None]:
    yield
    PEDESTRIAN_MODELS.registered.clear()


def config(model: str = "mine") -> s2.ScenarioConfig:
    return s2.ScenarioConfig(name="own", wandering=3, person={"model": model}, rules={"time_limit": 2.0})


def walked(record: s2.EpisodeRecord) -> float:
    """The mean distance that people walk, m."""
    return float(np.linalg.norm(record.humans[-1, :, :2] - record.humans[0, :, :2], axis=1).mean())


@pytest.mark.usefixtures("kept_processes")
def test_a_registered_model_is_used_in_this_process_and_in_workers(tmp_path: Path) -> None:
    PEDESTRIAN_MODELS.register("mine", Straight)
    assert "mine" in PEDESTRIAN_MODELS
    for workers in (1, 2):
        dataset = s2.generate_dataset(tmp_path / str(workers), config(), "orca", episodes=6, workers=workers)
    assert contents(tmp_path / "1") == contents(tmp_path / "2")
    assert max(walked(record) for record in dataset) > 1.0
    assert check_replay(read_episode(dataset.files[0])) == []
    comparison = s2.evaluate("orca", config(), episodes=6, workers=2)
    assert comparison["orca"].summary("human_slowing").n > 0  # runs without the robot are run in the workers too


def test_the_next_object_of_a_name_replaces_the_former_one() -> None:
    walks = []
    for model in (Straight, Still):
        PEDESTRIAN_MODELS.register("mine", model)
        recorder = s2.EpisodeRecorder()
        s2.Episode(s2.generate(config(), seed=1), s2.StraightToGoal(), observers=[recorder]).run()
        walks.append(walked(recorder.record()))
    assert walks[0] > 2.0 * walks[1]


def test_episodes_of_another_law_are_not_continued(tmp_path: Path) -> None:
    settings: dict[str, Any] = {"controller": "orca", "resume": True}
    PEDESTRIAN_MODELS.register("mine", Straight)
    dataset = s2.generate_dataset(tmp_path / "out", config(), episodes=1, **settings)
    assert list((dataset.manifest or {})["controller_sha256"]) == ["pedestrian model mine"]
    assert s2.datasets.verify(tmp_path / "out", replay=True, rerun=True) == []
    s2.generate_dataset(tmp_path / "out", config(), episodes=2, **settings)
    PEDESTRIAN_MODELS.register("mine", Still)
    with pytest.raises(RecordError, match=r"the code of pedestrian model mine, SHA-256 .* stored"):
        s2.generate_dataset(tmp_path / "out", config(), episodes=3, **settings)


def test_an_object_that_cannot_be_sent_is_named(tmp_path: Path) -> None:
    class Locked(Straight):
        lock = threading.Lock()

    PEDESTRIAN_MODELS.register("mine", Locked)
    with pytest.raises(
        ConfigError, match=r"pedestrian model .mine. cannot be sent to other processes: .*; use one worker"
    ):
        s2.generate_dataset(tmp_path / "out", "empty", "orca", episodes=6, workers=2)


def test_what_cannot_be_registered() -> None:
    for name in (None, 3, " "):
        with pytest.raises(ValueError, match="the name of a pedestrian model is a text that is not empty"):
            PEDESTRIAN_MODELS.register(name, Straight)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="a pedestrian model named 'orca2011' exists already; choose another name"):
        PEDESTRIAN_MODELS.register("orca2011", Straight)
    with pytest.raises(ValueError, match="give them as objects"):
        METRICS.register("mine", Straight)
    PEDESTRIAN_MODELS.register("mine", object)
    with pytest.raises(ConfigError, match="pedestrian model 'mine' is not a pedestrian model; it lacks acceleration"):
        s2.Episode(s2.generate(config(), seed=1), s2.StraightToGoal())


def test_an_unknown_name_says_how_to_register() -> None:
    with pytest.raises(ConfigError, match="if it is an object of a notebook or script, register it first"):
        config("another-law")


NOTEBOOK = """
import sonata2d as s2
from sonata2d.registry import PEDESTRIAN_MODELS

class Mine:
    evaluations, headed = 1, False
    def __init__(self, scene): pass
    def acceleration(self, walkers): return -2.0 * walkers.velocity

PEDESTRIAN_MODELS.register("mine", Mine)
if __name__ == "__main__":
    config = s2.load_scenario("empty").changed(wandering=2, person={"model": "mine"}, rules={"time_limit": 1})
    print(s2.generate_dataset("out", config, "orca", episodes=6, workers=2))
"""


def test_a_model_of_a_notebook_is_sent_with_its_code(tmp_path: Path) -> None:
    result = subprocess.run(
        [sys.executable, "-c", NOTEBOOK], cwd=tmp_path, capture_output=True, text=True, timeout=200, check=False
    )
    assert result.returncode == 0, result.stderr
    assert result.stdout == "<Dataset out: 6 episodes>\n"


@pytest.mark.usefixtures("kept_processes")
@pytest.mark.parametrize("workers", [1, 2])
def test_errors_of_a_model_are_those_of_an_episode(workers: int, tmp_path: Path) -> None:
    PEDESTRIAN_MODELS.register("mine", Fails)
    with pytest.raises(ControllerError, match="no law"):
        s2.generate_dataset(tmp_path / "out", config(), "orca", episodes=6, workers=workers)
