"""Nothing is measured of what an imported run does not tell."""

from __future__ import annotations

from dataclasses import replace

import pytest

from sonata2d.agents.controllers.planner import SocialPlanner
from sonata2d.metrics.catalogue import ALL
from sonata2d.metrics.measurement import measure
from sonata2d.metrics.missing import RESTS_ON
from sonata2d.record.reader import read_episode
from sonata2d.record.record import EpisodeRecord
from sonata2d.record.recorder import JsonRecorder
from sonata2d.scenegen.generator import generate
from sonata2d.scenegen.scenario.config import ScenarioConfig
from sonata2d.sim.episode import Episode


@pytest.fixture(scope="module")
def record(tmp_path_factory: pytest.TempPathFactory) -> EpisodeRecord:
    path = tmp_path_factory.mktemp("one") / "one.json"
    scene = generate(ScenarioConfig(humans=3, rules={"time_limit": 20.0}), seed=4)
    Episode(scene, SocialPlanner(), observers=[JsonRecorder(path)]).run()
    return read_episode(path)


def without(record: EpisodeRecord, *lacks: str) -> EpisodeRecord:
    return replace(record, document={**record.document, "imported": {"lacks": list(lacks)}})


def test_a_run_without_a_goal_has_no_success(record: EpisodeRecord) -> None:
    whole, blind = (measure(one, rerun=False) for one in (record, without(record, "goal")))
    assert whole["success"] == 1.0
    assert blind["success"] is blind["spl"] is blind["time_to_goal"] is blind["success_strict"] is None
    assert blind["path_length"] == whole["path_length"]


def test_without_radii_there_are_no_gaps_but_speeds(record: EpisodeRecord) -> None:
    blind = measure(without(record, "humans.radius"), rerun=False)
    assert blind["human_clearance_min"] is blind["collisions"] is blind["time_to_collision_min"] is None
    assert blind["success"] == 1.0
    assert blind["obstacle_clearance_min"] is not None


def test_without_a_robot_nothing_is_measured(record: EpisodeRecord) -> None:
    assert set(measure(without(record, "robot"), rerun=False).values()) == {None}


def test_a_variant_rests_on_what_its_metric_does(record: EpisodeRecord) -> None:
    blind = measure(without(record, "humans.radius", "goal"), rerun=False)
    resting = [m.name for m in ALL.values() if m.variant_of in ("success", "human_clearance_min", "collisions")]
    assert resting
    assert all(blind[name] is None for name in resting)


@pytest.mark.parametrize("key", RESTS_ON)
def test_each_key_bars_some_metric(key: str) -> None:
    assert any(metric.name.startswith(RESTS_ON[key]) for metric in ALL.values())
    for prefix in RESTS_ON[key]:
        assert any(metric.name.startswith(prefix) for metric in ALL.values()), prefix
