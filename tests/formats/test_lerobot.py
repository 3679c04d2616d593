"""`lerobot`: what the files hold, and that LeRobot reads them."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import sonata2d as s2
from sonata2d.agents.sensors.base import SensorNoise
from sonata2d.agents.sensors.lidar import Lidar
from sonata2d.errors import RecordError
from sonata2d.formats import Options, export_to, import_from, lerobot
from sonata2d.formats.lerobot import PEOPLE, RAYS, Observer

pa = pytest.importorskip("pyarrow", reason="pyarrow comes with the parquet extra")
pq = pytest.importorskip("pyarrow.parquet")
VISITED = s2.ScenarioConfig(standing=(1, 2), wandering=2, tables=1, plants=0, doors=[{"inflow": 12}],
                            social={"exits": 0.3}, rules={"time_limit": 10.0})  # fmt: skip


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("lerobot") / "runs"
    s2.generate_dataset(folder, VISITED, episodes=5, seed=2, progress=False)
    return folder


@pytest.fixture(scope="module")
def exported(runs: Path) -> Path:
    result = export_to(runs, "lerobot", runs.parent / "exported")
    assert (result.refused, result.skipped) == ([], [])
    assert all(file.is_file() for file in result.files)
    return runs.parent / "exported"


def table(folder: Path, name: str) -> list[dict[str, Any]]:
    rows: list[dict[str, Any]] = pq.read_table(folder / f"{name}.parquet").to_pylist()
    return rows


def test_frames_count_over_all_episodes(runs: Path, exported: Path) -> None:
    records, info = list(s2.Dataset(runs)), json.loads((exported / "meta/info.json").read_text())
    rows, episodes = table(exported, "data/chunk-000/file-000"), table(exported, "meta/episodes/chunk-000/file-000")
    assert (info["codebase_version"], info["fps"], info["total_episodes"]) == ("v3.0", 10, 5)
    assert info["total_frames"] == len(rows) == sum(map(len, records))
    assert info["data_path"] == "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
    assert [row["index"] for row in rows] == list(range(len(rows)))
    for number, (record, episode) in enumerate(zip(records, episodes, strict=True)):
        own = rows[episode["dataset_from_index"] : episode["dataset_to_index"]]
        assert {row["episode_index"] for row in own} == {number}
        assert [row["frame_index"] for row in own] == list(range(len(record)))
        assert np.array([row["action"] for row in own]) == pytest.approx(record.command, abs=1e-6)
        assert [row["timestamp"] for row in own] == pytest.approx(record.time.tolist(), abs=1e-6)
        assert episode["sonata2d/outcome"] == record.outcome.status
        assert [row["observation.pose"] for row in own] == pytest.approx(record.robot[:, :3], abs=1e-6)
    sentences = {row["task_index"]: row["task"] for row in table(exported, "meta/tasks")}
    assert [sentences[rows[each["dataset_from_index"]]["task_index"]] for each in episodes] == [
        each["tasks"][0] for each in episodes
    ]
    assert all(sentence.startswith("Go to ") for sentence in sentences.values())


def test_statistics_are_those_of_all_frames(exported: Path) -> None:
    rows = table(exported, "data/chunk-000/file-000")
    statistics = json.loads((exported / "meta/stats.json").read_text())
    for name in ("action", "observation.state", "observation.environment_state"):
        values = np.array([row[name] for row in rows])
        for kind in ("min", "max", "mean", "std"):
            assert statistics[name][kind] == pytest.approx(getattr(np, kind)(values, axis=0), abs=1e-4)
        assert statistics[name]["count"] == [len(rows)]
        assert (np.array(statistics[name]["q10"]) <= np.array(statistics[name]["q90"]) + 1e-9).all()


def test_the_observation_is_in_the_frame_of_the_robot(runs: Path) -> None:
    record = s2.Dataset(runs)[1]
    snapshot = record.snapshot(12)
    robot, goal, twist = snapshot.robot, snapshot.goal, snapshot.robot.twist
    found = Observer(snapshot.scene)(snapshot)
    assert found["observation.state"].dtype == np.float32
    place, angle = robot.pose.to_local(goal.position), goal.theta - robot.pose.theta
    state = [twist.vx, twist.vy, twist.omega, *place, math.cos(angle), math.sin(angle)]
    assert found["observation.state"].tolist() == pytest.approx(state, abs=1e-4)
    people = found["observation.environment_state"][: 6 * PEOPLE].reshape(PEOPLE, 6)
    positions = snapshot.humans.position.tolist()
    local = sorted((robot.pose.to_local((x, y)) for x, y in positions), key=lambda point: math.hypot(*point))
    assert len(local) > 1
    assert people[: len(local), :2] == pytest.approx(np.array(local), abs=1e-4)
    assert people[:, 5].tolist() == [1.0] * len(local) + [0.0] * (PEOPLE - len(local))
    assert not people[len(local) :].any()
    reading = Lidar(rays=RAYS).start(snapshot.scene)(snapshot, SensorNoise(snapshot.scene, "lidar", 12))
    ranges = found["observation.environment_state"][6 * PEOPLE :]
    assert ranges == pytest.approx(np.minimum(reading.ranges, 10.0), abs=1e-5)


def test_films_show_the_room_from_above(runs: Path, tmp_path: Path) -> None:
    ffmpeg = pytest.importorskip("imageio_ffmpeg", reason="imageio-ffmpeg comes with the video extra")
    export_to(s2.Dataset(runs)[:2], "lerobot", tmp_path / "films", Options(pictures=True))
    info = json.loads((tmp_path / "films/meta/info.json").read_text())
    assert info["features"]["observation.images.top"]["dtype"] == "video"
    for number, episode in enumerate(table(tmp_path / "films", "meta/episodes/chunk-000/file-000")):
        path = info["video_path"].format(
            video_key="observation.images.top", chunk_index=episode["videos/observation.images.top/chunk_index"],
            file_index=episode["videos/observation.images.top/file_index"],
        )  # fmt: skip
        assert path == f"videos/observation.images.top/chunk-000/file-{number:03d}.mp4"
        count, seconds = ffmpeg.count_frames_and_secs(str(tmp_path / "films" / path))
        assert (count, seconds) == (episode["length"], pytest.approx(episode["length"] / 10, abs=0.01))
    statistics = json.loads((tmp_path / "films/meta/stats.json").read_text())["observation.images.top"]
    assert np.array(statistics["mean"]).shape == (3, 1, 1)
    assert 0.3 < np.mean(statistics["mean"]) < 1.0


def test_what_lerobot_cannot_hold_is_refused(runs: Path, exported: Path, tmp_path: Path) -> None:
    with pytest.raises(RecordError, match="holds a LeRobot data set, or the beginning of one; choose another folder"):
        export_to(runs, "lerobot", exported)
    with pytest.raises(RecordError, match="the format lerobot has no shards"):
        export_to(runs, "lerobot", tmp_path / "parts", shard_size=2)
    s2.generate_dataset(tmp_path / "mixed", VISITED, episodes=1, seed=1, progress=False)
    unicycle = VISITED.model_copy(update={"robot": s2.ScenarioConfig(robot={"kinematics": "unicycle"}).robot})
    s2.generate_dataset(tmp_path / "other", unicycle, episodes=1, seed=1, progress=False)
    (tmp_path / "other/000000.json").rename(tmp_path / "mixed/000001.json")
    files = s2.Dataset.of_files(tmp_path / "mixed", sorted((tmp_path / "mixed").glob("00*.json")))
    with pytest.raises(RecordError, match="has one robot, got holonomic and unicycle; export them apart"):
        export_to(files, "lerobot", tmp_path / "out")
    assert not (tmp_path / "out/meta/info.json").exists()
    quick = s2.ScenarioConfig(standing=0, wandering=0, tables=0, plants=0, rules={"dt": 0.15, "time_limit": 3.0})
    s2.generate_dataset(tmp_path / "quick", quick, episodes=1, progress=False)
    result = export_to(tmp_path / "quick", "lerobot", tmp_path / "rates")
    assert "a frame lasts 0.15 s" in str(result.skipped[0])


def test_large_data_sets_have_several_files(runs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lerobot, "_CHUNK", 2)
    export_to(runs, "lerobot", tmp_path / "parts")
    places = [f"chunk-{chunk:03d}/file-{file:03d}" for chunk, file in ((0, 0), (0, 1), (1, 0))]
    rows = [row for place in places for row in table(tmp_path / "parts", f"data/{place}")]
    episodes = [row for place in places for row in table(tmp_path / "parts", f"meta/episodes/{place}")]
    assert [row["index"] for row in rows] == list(range(sum(map(len, s2.Dataset(runs)))))
    assert [row["episode_index"] for row in episodes] == list(range(5))
    assert [(row["data/chunk_index"], row["data/file_index"]) for row in episodes] == [
        (0, 0), (0, 0), (0, 1), (0, 1), (1, 0)
    ]  # fmt: skip
    statistics = json.loads((tmp_path / "parts/meta/stats.json").read_text())["action"]
    assert statistics["std"] == pytest.approx(np.std([row["action"] for row in rows], axis=0), abs=1e-4)


@pytest.mark.parametrize("format", ["lerobot", "webdataset"])
def test_runs_without_commands_are_skipped(runs: Path, tmp_path: Path, format: str) -> None:
    export_to(s2.Dataset(runs)[:1], "socnav3", tmp_path / "raw")
    (file,) = (tmp_path / "raw").glob("*.json")
    content = json.loads(file.read_text())
    del content["sonata2d"]
    for step in content["sequence"]:
        step.pop("sonata2d", None)
    file.write_text(json.dumps(content))
    import_from(tmp_path / "raw", "socnav3", tmp_path / "imported")
    result = export_to(tmp_path / "imported", format, tmp_path / "out")
    assert "has no recorded command" in str(result.skipped[0])
    assert result.files == []


def test_lerobot_reads_the_data_set(exported: Path, runs: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HF_HUB_OFFLINE", "1")
    module = pytest.importorskip("lerobot.datasets.lerobot_dataset", reason="lerobot is not installed")
    dataset, record = module.LeRobotDataset("sonata2d/runs", root=exported), s2.Dataset(runs)[1]
    assert (dataset.num_episodes, dataset.fps) == (5, 10)
    item = dataset[len(s2.Dataset(runs)[0]) + 3]
    assert item["action"].tolist() == pytest.approx(record.command[3].tolist(), abs=1e-6)
    assert item["task"].startswith("Go to ")
