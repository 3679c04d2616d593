"""Scores: a scene that failed counts in every number, and what must not pay does not."""

from __future__ import annotations

from pathlib import Path

import pytest

from sonata2d.benchmark import BASELINES, SCORES, read_row, run_benchmark, verify_row
from sonata2d.benchmark.scorers import checked_scorers
from sonata2d.benchmark.scoring import judged, summary, third_of
from sonata2d.errors import ConfigError
from sonata2d.record.record import EpisodeRecord
from sonata2d.registry import SCORERS

GOOD: dict[str, float | None] = {
    "success": 1.0, "spl": 0.9, "stl": 0.8, "time_ratio": 1.2, "contact_at_fault": 0.0, "contact": 0.0,
    "obstacle_contact": 0.0, "time_to_collision": 3.0, "psc": 0.95, "group_intrusion": 0.0,
    "interaction_intrusion": 0.0, "human_slowing": 0.01, "human_deviation": 0.1,
}  # fmt: skip


@pytest.mark.parametrize(
    ("changed", "expected"),
    [
        ({}, (1.0, 1.0, 1.0)),
        ({"success": 0.0}, (0.0, 0.0, 0.0)),
        ({"contact_at_fault": 1.0}, (0.0, 1.0, 0.0)),
        ({"obstacle_contact": 1.0}, (0.0, 1.0, 0.0)),
        ({"contact": 1.0}, (1.0, 1.0, 1.0)),  # by the fault of the person
        ({"psc": 0.7}, (1.0, 0.0, 0.0)),
        ({"interaction_intrusion": 0.1}, (1.0, 0.0, 0.0)),
        ({"psc": None, "interaction_intrusion": None}, (1.0, 1.0, 1.0)),  # nobody is there
    ],
)
def test_a_scene_is_safe_polite_and_strict(changed: dict[str, float], expected: tuple[float, ...]) -> None:
    found = judged(GOOD | changed)
    assert (found["safe"], found["polite"], found["strict"]) == expected


def test_summaries_have_intervals_and_thirds() -> None:
    values = [GOOD | judged(GOOD) for _ in range(20)]
    values += [each | {"success": 0.0, "stl": 0.0, "safe": 0.0, "polite": 0.0, "strict": 0.0} for each in values[:10]]
    found = summary(values, [0] * 15 + [2] * 14 + [None])
    assert found["strict"]["value"] == pytest.approx(2 / 3, abs=1e-5)
    assert found["strict"]["low"] < 2 / 3 < found["strict"]["high"]
    assert [third["n"] for third in found["strict_by_thirds"]] == [15, 0, 14]
    assert found["task"]["stl"]["value"] == pytest.approx(0.8 * 2 / 3, abs=1e-5)
    assert found["safety"]["time_to_collision"] == {"value": 3.0, "low": None, "high": None, "n": 30}
    assert {name for group in ("task", "safety", "people") for name in found[group]} == set(SCORES)


def test_thirds_are_by_difficulty() -> None:
    assert [third_of(value, (5.0, 9.0)) for value in (1.0, 5.0, 8.9, 9.0, None)] == [0, 1, 1, 2, None]


@pytest.fixture(scope="module")
def strict(tmp_path_factory: pytest.TempPathFactory) -> dict[str, dict[str, float]]:
    """Scores of some baselines in 24 scenes."""
    found = {}
    for name in ("standing-still", "racing", "waiting", "straight-to-goal", "social-planner"):
        folder = tmp_path_factory.mktemp("rows") / name
        parts = ["crowded-hall", "sonata-2020", "unyielding-lively", "orca-people"]
        run_benchmark(BASELINES[name].controller, folder, parts=parts, scenes=6)
        scores = read_row(folder)["all"]
        found[name] = {
            key: scores[group][key]["value"] for group in ("task", "safety", "people") for key in scores[group]
        } | {"strict": scores["strict"]["value"]}
    return found


def test_what_must_not_pay_scores_badly(strict: dict[str, dict[str, float]]) -> None:
    expert = strict["social-planner"]
    assert expert["strict"] >= 0.6
    assert strict["standing-still"]["strict"] == strict["standing-still"]["success"] == 0.0
    assert strict["standing-still"]["safe"] == strict["standing-still"]["polite"] == 0.0
    assert strict["racing"]["strict"] < 0.6 * expert["strict"]
    assert strict["racing"]["safe"] < expert["safe"]
    assert strict["waiting"]["stl"] < 0.8 * expert["stl"]
    assert strict["straight-to-goal"]["strict"] < 0.8 * expert["strict"]


def test_learned_scores_are_advisory_columns(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(SCORERS.registered, "brevity", _brevity)
    folder = tmp_path / "row"
    run_benchmark("orca", folder, parts=["frontal-approach"], scenes=2, scorers=["brevity"])
    scores = read_row(folder)["all"]
    assert 0.0 < scores["advisory"]["learned.brevity"]["value"] < 1.0
    assert "learned.brevity" not in scores["people"]
    with pytest.raises(ConfigError, match="no learned score is named 'brevty'; did you mean 'brevity'"):
        checked_scorers(["brevty"])
    with pytest.raises(ConfigError, match="two columns would have the name 'brevity'"):
        checked_scorers(["brevity", "brevity"])


def _brevity(record: EpisodeRecord) -> float:
    return 1.0 / (1.0 + record.outcome.time)


@pytest.mark.parametrize("name", ["ppo", "attention", "r-gcn"])
def test_trained_baselines_drive_from_the_weights_of_the_package(name: str, tmp_path: Path) -> None:
    baseline = BASELINES[name]
    run_benchmark(baseline.controller, tmp_path / "row", track=baseline.track, parts=["frontal-approach"], scenes=2)
    row = read_row(tmp_path / "row")
    assert row["failed"] == 0
    assert row["plan"]["files"]
    assert row["all"]["task"]["spl"]["n"] == 2
    assert verify_row(tmp_path / "row", rerun=True).badges == ("replayed", "re-run")
