"""Scenes among recorded people, from local copies of recordings."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import orjson
import pytest

import sonata2d as s2
from sonata2d.benchmark import load_suite, read_row, run_benchmark, suite, verify_row
from sonata2d.benchmark.run import RECORDED_PERSON
from sonata2d.errors import BenchmarkError

SETTINGS = {"robot": {"limits": {"ahead": 2.0, "sideways": 1.0}}, "rules": {"guard": False}}


@pytest.fixture
def recordings(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder with a recording of six people in a street, for which there is a suite `mine`."""
    rows = ["t,ped,x,y"]
    for ped in range(1, 7):
        direction = 1.0 if ped % 2 else -1.0
        rows += [
            f"{0.4 * (k + 3 * ped):.1f},{ped},{direction * (0.48 * k - 6.0):.3f},{1.6 * ped - 5.0:.3f}"
            for k in range(26)
        ]
    folder = tmp_path / "recordings"
    folder.mkdir()
    content = "\n".join(rows).encode()
    (folder / "street.csv").write_bytes(content)
    (folder / "street.json").write_text('{"desired_speed": 1.2}')
    document = {
        "suite": "mine", "physics": load_suite().physics, "metrics": load_suite().metrics, "ends": "2028-12-31",
        "test_seed": 5, "questions": {"replayed": "?", "simulated": "?"},
        "thirds": {"replayed": [5.0, 8.0], "simulated": [5.0, 8.0]},
        "recordings": {
            "street": {"file": "street.csv", "sha256": hashlib.sha256(content).hexdigest(), "source": "the authors"}
        },
        "defaults": s2.ScenarioConfig().settings(),
        "entries": [
            {"part": people, "name": f"street-{people}", "scenes": 3, "scenes_sha256": "", "settings": SETTINGS,
             "recording": {"name": "street", "people": people, "seconds": 20.0}}
            for people in ("replayed", "simulated")
        ],
    }  # fmt: skip
    suites = tmp_path / "suites"
    suites.mkdir()
    (suites / "mine.json").write_bytes(orjson.dumps(document))
    monkeypatch.setattr(suite, "SUITES", suites)
    load_suite.cache_clear()
    yield folder
    load_suite.cache_clear()


def test_the_robot_takes_the_place_of_a_person(recordings: Path) -> None:
    entry = load_suite("mine", str(recordings)).entry("street-replayed")
    assert entry.recording is not None
    for episode in range(3):
        scene = entry.scene(1, episode)
        _, track = entry.recording.scenario(1, episode)
        assert scene.robot.pose.position == pytest.approx(tuple(track.position[0]), abs=1e-4)
        assert scene.goal.position == pytest.approx(tuple(track.position[-1]), abs=1e-4)
        assert track.id not in {human.id for human in scene.humans}
        assert scene.humans
        assert all(human.behaviour == "recorded" for human in scene.humans)
        assert scene.robot.limits.ahead == 2.0
        assert not scene.rules.guard
        assert entry.scene(1, episode) == scene


def test_people_are_replayed_or_simulated_in_other_scenes_for_other_seeds(recordings: Path) -> None:
    whole = load_suite("mine", str(recordings))
    simulated = whole.entry("street-simulated").scene(1, 0)
    assert all(human.behaviour == "walking" for human in simulated.humans)
    starts = {whole.entry("street-replayed").scene(seed, 0).robot.pose for seed in range(6)}
    assert len(starts) > 1


def test_the_recorded_person_walks_its_way_again(recordings: Path, tmp_path: Path) -> None:
    arguments = {"suite": "mine", "seeds": "dev", "recordings": recordings}
    run_benchmark(RECORDED_PERSON, tmp_path / "row", **arguments)  # type: ignore[arg-type]
    scores = read_row(tmp_path / "row")["all"]
    assert scores["task"]["success"]["value"] == 1.0
    assert scores["task"]["spl"]["value"] > 0.95
    assert verify_row(tmp_path / "row", rerun=True, recordings=recordings).badges == ("replayed", "re-run")
    entry = load_suite("mine", str(recordings)).entry("street-replayed")
    assert entry.recording is not None
    scene, (_, track) = entry.scene(1, 0), entry.recording.scenario(1, 0)
    commands = np.load(tmp_path / "row" / "commands.npz")["commands"][30:50, 0] / 1e4
    assert commands == pytest.approx(1.2, abs=0.1)
    assert scene.goal.position == pytest.approx(tuple(track.position[-1]), abs=1e-4)


def test_missing_and_other_recordings_are_refused(recordings: Path, tmp_path: Path) -> None:
    with pytest.raises(BenchmarkError, match="needs a folder with recordings"):
        load_suite("mine").entry("street-replayed").scene(1, 0)
    with pytest.raises(BenchmarkError, match=r"street\.csv is missing; get it from the authors"):
        load_suite("mine", str(tmp_path))
    (recordings / "street.csv").write_text("frame,ped,x,y\n0,1,0,0\n")
    with pytest.raises(BenchmarkError, match="is another file than the one of the suite"):
        load_suite("mine", str(recordings))
    with pytest.raises(BenchmarkError, match="needs a folder with recordings"):
        run_benchmark(RECORDED_PERSON, tmp_path / "row", suite="mine", seeds="dev")
