"""Readings of sensors in episode files."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import orjson
import pytest

import sonata2d as s2
from sonata2d.agents import Camera, Dwa, FieldOfView, Lidar, Odometry, PeopleDetector, Reading, Sensor
from sonata2d.datasets import verify
from sonata2d.datasets.check.replay import check_replay
from sonata2d.datasets.transforms.mirror import mirrored
from sonata2d.errors import InvalidFileError, RecordError
from sonata2d.formats import export_to, import_from
from sonata2d.record.canonical import serialise
from sonata2d.record.record import EpisodeRecord
from sonata2d.registry import SENSORS

ALL = (
    Lidar(rays=90, noise=0.02, dropout=0.05, mount=(0.1, 0.2), heading=0.3, record=True),
    Lidar("front", rays=31, angle=2.0, distance=3.0, rate=5, latency=0.25, sees="legs", record=True),
    Odometry(record=True),
    PeopleDetector(rate=2, false_alarms=0.5, record=True),
    FieldOfView(angle=6.28, latency=0.3, record=True),
)


class Sensing(s2.SocialPlanner):
    """Keeps what it reads; it also has a sensor that is not recorded."""

    sensors = (*ALL, Odometry("hidden"))

    def __init__(self) -> None:
        super().__init__()
        self._read: list[dict[str, Any]] = []

    def act(self, snapshot: s2.Snapshot) -> s2.Twist:
        self._read.append(dict(snapshot.sensors))
        twist = super().act(snapshot)
        assert isinstance(twist, s2.Twist)
        return twist


@dataclass(frozen=True)
class Counter(Sensor):
    """A reading of every third tick; without a mirror image."""

    def start(self, scene: s2.Scene) -> Any:
        return lambda snapshot, noise: None if snapshot.tick % 3 else {"count": snapshot.tick, "half": np.array([0.5])}


def recorded(controller: s2.Controller, tmp_path: Path, scene: s2.Scene, others: Any = None) -> EpisodeRecord:
    with s2.JsonRecorder(tmp_path / "episode.json") as recorder:
        s2.Episode(scene, controller, others=others, observers=[recorder]).run()
    return s2.read_episode(tmp_path / "episode.json")


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> tuple[EpisodeRecord, list[dict[str, Any]]]:
    """An episode, and what its controller read."""
    controller = Sensing()
    record = recorded(controller, tmp_path_factory.mktemp("readings"), s2.generate("sonata-2020", seed=3))
    return record, controller._read


def test_a_record_has_the_readings_that_the_controller_got(run: tuple[EpisodeRecord, list[dict[str, Any]]]) -> None:
    record, read = run
    assert [*record.sensors.values()] == [*ALL]
    compared = dict.fromkeys(record.sensors, 0)
    for snapshot, live in zip(record, read, strict=True):
        assert [*snapshot.sensors] == [*record.sensors]
        for name, got in snapshot.sensors.items():
            expected = live[name]
            assert (got is None) == (expected is None)
            if got is None:
                continue
            compared[name] += 1
            assert type(got) is type(expected)
            assert got.tick == expected.tick
            for key, value in _numbers(got).items():
                np.testing.assert_allclose(value, _numbers(expected)[key], rtol=0.0, atol=5.001e-5, equal_nan=True)
    assert min(compared.values()) > len(record) - 5


def _numbers(reading: Any) -> dict[str, Any]:
    if hasattr(reading, "ranges"):
        return {key: getattr(reading, key) for key in ("ranges", "angles", "range_min", "range_max", "mount")}
    if hasattr(reading, "pose"):
        pose, twist = reading.pose, reading.twist
        return {"pose": [pose.x, pose.y, pose.theta], "twist": [twist.vx, twist.vy, twist.omega]}
    if hasattr(reading, "humans"):
        robots = [(robot.id, *robot.position, *robot.direction, *robot.velocity) for robot in reading.robots]
        humans = reading.humans
        return {"id": humans.id, "position": humans.position, "velocity": humans.velocity, "robots": robots}
    return {"position": reading.position, "velocity": reading.velocity}


def test_a_replay_measures_again_and_finds_a_changed_reading(
    run: tuple[EpisodeRecord, list[dict[str, Any]]], tmp_path: Path
) -> None:
    record, _ = run
    assert check_replay(record) == []
    document = orjson.loads(record.path.read_bytes())
    document["frames"][7]["sensors"]["lidar"]["ranges"][3] = 1.0
    changed = tmp_path / "changed.json"
    changed.write_bytes(serialise(document))
    assert [problem.place for problem in check_replay(s2.read_episode(changed))] == ["replay"]


def test_mirror_images_have_mirrored_readings(run: tuple[EpisodeRecord, list[dict[str, Any]]], tmp_path: Path) -> None:
    record, _ = run
    image = mirrored(record)
    assert serialise(mirrored(image).document) == serialise(record.document)
    path = tmp_path / "image.json"
    path.write_bytes(serialise(image.document))
    assert check_replay(s2.read_episode(path)) == []
    flip = np.array([1.0, -1.0])
    for before, after in zip(record, image, strict=True):
        for name in ("lidar", "front"):
            if before.sensors[name] is not None:
                points = before.sensors[name].points * flip
                difference = np.sort(points, axis=0) - np.sort(after.sensors[name].points, axis=0)
                assert np.abs(difference).max(initial=0.0) < 1e-9
        pose, image_pose = before.sensors.odometry.pose, after.sensors.odometry.pose
        assert (image_pose.x, image_pose.y) == (pose.x, -pose.y)
        assert abs(np.sin(image_pose.theta + pose.theta)) < 2e-5
        assert after.sensors.odometry.twist.omega == -before.sensors.odometry.twist.omega
        detected = before.sensors.people_detector
        np.testing.assert_array_equal(after.sensors.people_detector.position, detected.position * flip)
        if (view := before.sensors.field_of_view) is not None:
            np.testing.assert_array_equal(after.sensors.field_of_view.humans.position, view.humans.position * flip)


def test_robots_in_view_are_recorded(tmp_path: Path) -> None:
    scene = s2.generate(s2.ScenarioConfig(humans=2, robots=3, rules={"time_limit": 4}), seed=4)
    controller = Sensing()
    record = recorded(controller, tmp_path, scene)
    seen = []
    for snapshot, live in zip(record, controller._read, strict=False):  # which is not asked after its arrival
        view, expected = snapshot.sensors.field_of_view, live["field_of_view"]
        if view is not None:
            seen.append(len(view.robots))
            for key, value in _numbers(view).items():
                np.testing.assert_allclose(value, _numbers(expected)[key], rtol=0.0, atol=6e-5)
    assert max(seen) > 0
    assert check_replay(record) == []
    assert serialise(mirrored(mirrored(record)).document) == serialise(record.document)


def test_other_robots_record_their_own_sensors(tmp_path: Path) -> None:
    scene = s2.generate(s2.ScenarioConfig(humans=3, robots=3, rules={"time_limit": 3}), seed=4)
    planner = Dwa(sensors=(Lidar(rays=40, record=True), Odometry()))
    record = recorded(s2.StraightToGoal(), tmp_path, scene, [planner, s2.StraightToGoal()])
    assert record.document["version"] == 2
    assert "sensors" not in record.document
    assert record.sensors == {}
    assert record[0].sensors is None
    ids = [other.id for other in scene.robots]
    assert [[*record.seen_by(id).sensors] for id in ids] == [["lidar"], []]
    seen = record.seen_by(ids[0])
    assert all(snapshot.sensors.lidar.tick == snapshot.tick for snapshot in seen)
    assert check_replay(record) == []
    image = mirrored(record)
    assert serialise(mirrored(image).document) == serialise(record.document)
    ranges = seen[2].sensors.lidar.ranges
    np.testing.assert_array_equal(image.seen_by(ids[0])[2].sensors.lidar.ranges, np.roll(ranges[::-1], 1))
    frames = [*record.frames()]
    assert [[*readings] for readings in frames[1].readings] == [[], ["lidar"], []]


def test_a_sensor_of_other_code_is_kept_as_json(tmp_path: Path) -> None:
    class Counting(s2.StraightToGoal):
        sensors = (Counter(record=True), Lidar(rays=8, record=True))

    scene = s2.generate("empty", seed=1)
    record = recorded(Counting(), tmp_path, scene)
    assert record.sensors == {"counter": None, "lidar": Lidar(rays=8, record=True)}
    assert record.document["sensors"][0]["type"].endswith("test_readings:Counter")
    assert record[4].sensors.counter == {"count": 3, "half": [0.5]}
    assert "counter" not in record.document["frames"][4]["sensors"]
    assert check_replay(record) == []  # its readings are taken as they are
    with pytest.raises(RecordError, match="Counter cannot be mirrored without its code"):
        mirrored(record)
    SENSORS.register("counter", Counter)
    try:
        again = recorded(Counting(), tmp_path, scene)
        assert again.document["sensors"][0]["type"] == "counter"
        assert again.sensors["counter"] == Counter(record=True)
        assert check_replay(again) == []
        with pytest.raises(RecordError, match=r"define Counter.mirrored_json, or set record=False"):
            mirrored(again)
    finally:
        del SENSORS.registered["counter"]


def test_a_data_set_with_readings_has_the_same_bytes_with_two_workers(tmp_path: Path) -> None:
    code = (
        "import sonata2d as s2\n"
        "from sonata2d.agents import Lidar, Odometry\n"
        "class Scanning(s2.StraightToGoal):\n"
        "    sensors = (Lidar(rays=20, noise=0.01, record=True), Odometry(record=True))\n"
    )
    (tmp_path / "scanning.py").write_text(code)
    path = f"{tmp_path / 'scanning.py'}:Scanning"
    for workers in (1, 2):
        s2.generate_dataset(tmp_path / str(workers), "empty", path, episodes=2, workers=workers)
    for name in ("000000.json", "000001.json"):
        assert (tmp_path / "1" / name).read_bytes() == (tmp_path / "2" / name).read_bytes()
    assert not [*verify(tmp_path / "1", replay=True, rerun=True, controller=path)]


def test_arrays_and_tables_keep_readings_and_robots(tmp_path: Path) -> None:
    scene = s2.generate(s2.ScenarioConfig(humans=2, robots=2, rules={"time_limit": 2}), seed=5)
    recorded(Sensing(), tmp_path, scene)
    original = (tmp_path / "episode.json").read_bytes()
    for name in ("npz", "parquet"):
        if name == "parquet":
            pytest.importorskip("pyarrow")
        export_to(tmp_path / "episode.json", name, tmp_path / name)
        import_from(tmp_path / name, name, tmp_path / f"{name}-back")
        (back,) = (tmp_path / f"{name}-back").glob("*.json")
        assert back.read_bytes() == original


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            lambda d: d["frames"][2]["sensors"]["lidar"]["ranges"].pop(),
            "frames.2.sensors: lidar: ranges must be 90 numbers, null or -1, got [",
        ),
        (
            lambda d: d["frames"][2]["sensors"]["lidar"]["ranges"].__setitem__(0, -0.5),
            "a range must be 0 to 10, null or -1, got -0.5",
        ),
        (lambda d: d["frames"][2]["sensors"]["lidar"].pop("ranges"), "frames.2.sensors: lidar: 'ranges' is missing"),
        (lambda d: d["frames"][2]["sensors"]["lidar"].update(tick=3), "tick must be 0 to 2, is 3"),
        (lambda d: d["frames"][2]["sensors"]["lidar"].update(tick=1.5), "tick must be 0 to 2, is 1.5"),
        (lambda d: d["frames"][2]["sensors"].update(radar=1), "there is no sensor 'radar'"),
        (
            lambda d: d["frames"][9]["sensors"]["field_of_view"].update(humans=[999]),
            "field_of_view: there is no person or robot 999 at tick",
        ),
        (
            lambda d: d["frames"][0]["sensors"]["odometry"].update(pose=[1.0]),
            "odometry: pose must be 3 numbers, got [1.0]",
        ),
        (
            lambda d: d["frames"][0]["sensors"]["people_detector"].update(position=[[1.0, 2.0]] * 50),
            "there are 50 positions and ",
        ),
        (lambda d: d["sensors"][0]["settings"].update(rays=0), "sensors: lidar: rays must be"),
        (lambda d: d["sensors"][0]["settings"].update(mount=[{}, 0]), "sensors: lidar: mount"),
        (lambda d: d["sensors"][0]["settings"].update(rate=1e-320), "rate must be positive, and at least 1e-06 1/s"),
        (lambda d: d["sensors"][0]["settings"].update(latency=1e308), "latency must be at most 1e+06 s"),
        (lambda d: d["frames"][2]["sensors"]["lidar"].update(ranges=["a"] * 90), "90 numbers, null or -1, got ['a'"),
        (lambda d: d["frames"][2]["sensors"]["lidar"]["ranges"].__setitem__(0, 300.0), "0 to 10, null or -1, got 300"),
        (lambda d: d["frames"][9]["sensors"]["field_of_view"].update(tick=False), "tick must be 0 to 9, is False"),
        (lambda d: d["frames"][0]["sensors"]["odometry"].update(twist=[0, 0, "x"]), "twist must be 3 numbers"),
        (lambda d: d["frames"][0]["sensors"]["people_detector"].update(position=[1, 2]), "each position must be 2"),
        (lambda d: d["sensors"].append(d["sensors"][0]), "two have the same name"),
        (lambda d: d.pop("sensors"), "there is no sensor 'lidar'"),
    ],
)
def test_a_file_with_impossible_readings_is_invalid(
    run: tuple[EpisodeRecord, list[dict[str, Any]]], tmp_path: Path, change: Callable[[Any], Any], message: str
) -> None:
    document = orjson.loads(run[0].path.read_bytes())
    change(document)
    path = tmp_path / "changed.json"
    path.write_bytes(serialise(document))
    with pytest.raises(InvalidFileError) as caught:
        s2.read_episode(path)
    assert message in str(caught.value)


def test_what_cannot_be_recorded_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="files of episodes hold no pictures"):
        Camera(record=True)
    with pytest.raises(ValueError, match="record must be True or False, got 'yes'"):
        Lidar(record="yes")  # type: ignore[arg-type]

    @dataclass(frozen=True)
    class Odd(Sensor):
        def start(self, scene: s2.Scene) -> Any:
            return lambda snapshot, noise: {"set": {1, 2}}

    class Controller(s2.StraightToGoal):
        sensors = (Odd(record=True),)

    with pytest.raises(RecordError, match="the reading odd at tick 0 contains a set"):
        recorded(Controller(), tmp_path, s2.generate("empty", seed=1))


def test_a_reading_of_an_own_class_is_recorded_by_its_fields(tmp_path: Path) -> None:
    @dataclass(frozen=True)
    class Distance(Reading):
        metres: float

    @dataclass(frozen=True)
    class ToGoal(Sensor):
        def start(self, scene: s2.Scene) -> Any:
            def measure(snapshot: s2.Snapshot, noise: Any) -> Distance:
                ahead, left = snapshot.robot.pose.to_local(snapshot.goal)
                return Distance(snapshot.tick, float(np.hypot(ahead, left)))

            return measure

    class Controller(s2.StraightToGoal):
        sensors = (ToGoal(record=True),)

    record = recorded(Controller(), tmp_path, s2.generate("empty", seed=1))
    metres = [snapshot.sensors.to_goal["metres"] for snapshot in record]
    assert metres == sorted(metres, reverse=True)
    assert metres[0] > 1.0
