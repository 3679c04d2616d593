"""`mcap`: messages read back with the reader of mcap and with rosbags, and compared with the record."""

from __future__ import annotations

import io
import json
import sys
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import sonata2d as s2
from sonata2d.core.geometry import Pose
from sonata2d.errors import RecordError
from sonata2d.formats import export_to, import_from, mcap
from sonata2d.formats.format import Options
from sonata2d.record.recorder import JsonRecorder
from tests.running import record_of

reader = pytest.importorskip("mcap.reader", reason="not installed; pip install 'sonata2d[mcap]'")
typesys = pytest.importorskip("rosbags.typesys", reason="not installed; pip install 'sonata2d[mcap]'")
highlevel = pytest.importorskip("rosbags.highlevel", reason="not installed; pip install 'sonata2d[mcap]'")

COMING: dict[str, Any] = {
    "humans": 0, "tables": 1, "plants": 1, "laptops_on_tables": 1, "relations": 0,
    "robot": {"pose": [-2, -2, 1]}, "goal": {"position": [2, 2]}, "rules": {"time_limit": 2.0, "ends_on": ["time"]},
    "people": [{"x": 1, "y": 1, "enters": 0.5}, {"x": -1, "y": 2, "leaves": 1}, {"x": 1, "y": -1}],
    "room": {"polygon": [[-4, -4], [4, -4], [4, 4], [-4, 4]]},
}  # fmt: skip
ADD, DELETE_ALL = 0, 3


def run(**changes: Any) -> s2.EpisodeRecord:
    return record_of(s2.generate(s2.ScenarioConfig(**COMING | changes), 1))


@pytest.fixture(scope="module")
def record() -> s2.EpisodeRecord:
    """An episode in which one person enters and another one leaves."""
    return run(talking_pairs=1)


@pytest.fixture(scope="module")
def data(record: s2.EpisodeRecord) -> bytes:
    return mcap.export(record, Options())


def read(data: bytes, folder: Path) -> dict[str, list[tuple[int, Any]]]:
    """Time, ns, and message of each topic, as rosbags reads a single file."""
    path, messages = folder / "one.mcap", dict[str, list[tuple[int, Any]]]()
    path.write_bytes(data)
    with highlevel.AnyReader([path]) as bag:
        for connection, time, raw in bag.messages():
            messages.setdefault(connection.topic, []).append((time, bag.deserialize(raw, connection.msgtype)))
    return messages


def of_people(message: Any, group: str) -> dict[int, Any]:
    """The markers of a group by id, after one that deletes all former ones."""
    assert [marker.action for marker in message.markers] == [DELETE_ALL, *[ADD] * (len(message.markers) - 1)]
    return {marker.id: marker for marker in message.markers[1:] if marker.ns == group}


def in_plane(pose: Any) -> list[float]:
    o = pose.orientation
    return [pose.position.x, pose.position.y, 2.0 * float(np.arctan2(o.z, o.w))]


def test_the_summary_counts_a_message_for_each_state_and_command(record: s2.EpisodeRecord, data: bytes) -> None:
    summary = reader.make_reader(io.BytesIO(data)).get_summary()
    topics = {channel.topic: id for id, channel in summary.channels.items()}
    counts = {topic: summary.statistics.channel_message_counts[id] for topic, id in topics.items()}
    states = len(record) + 1
    of_states = ("/tf", "/odom", "/scan", "/scan/points", "/robots", "/people", "/people/poses", "/people/points")
    assert counts == {
        "/map": 1, "/scene": 1, "/goal": 1, "/cmd_vel": len(record), "/interactions": states,
        **dict.fromkeys(of_states, states),
    }  # fmt: skip
    times = summary.statistics.message_start_time, summary.statistics.message_end_time
    assert times == (0, round(record.states.time[-1] * 1e9))
    assert {schema.encoding for schema in summary.schemas.values()} == {"ros2msg"}
    assert reader.make_reader(io.BytesIO(data)).get_header().profile == "ros2"
    for _, _, message in reader.make_reader(io.BytesIO(data)).iter_messages():
        assert message.log_time == message.publish_time


def test_metadata_and_attachment_describe_the_episode(record: s2.EpisodeRecord, data: bytes) -> None:
    (metadata,) = reader.make_reader(io.BytesIO(data)).iter_metadata()
    assert (metadata.name, metadata.metadata["id"], metadata.metadata["seed"]) == ("sonata2d", record.id, "1")
    assert metadata.metadata["outcome"] == record.outcome.status
    assert metadata.metadata["software.sonata2d"] == s2.__version__
    (attachment,) = reader.make_reader(io.BytesIO(data)).iter_attachments()
    header = json.loads(attachment.data)
    assert (attachment.name, header["settings"]) == ("episode.json", record.document["settings"])
    assert "frames" not in header


def test_messages_have_the_values_of_the_record(record: s2.EpisodeRecord, data: bytes, tmp_path: Path) -> None:
    messages, t = read(data, tmp_path), 7
    time, odometry = messages["/odom"][t]
    x, y, theta, vx, vy, omega = record.states.robot[t].tolist()
    assert time == round(record.states.time[t] * 1e9)
    assert (odometry.header.stamp.sec, odometry.header.stamp.nanosec) == divmod(time, 1_000_000_000)
    assert in_plane(odometry.pose.pose) == pytest.approx([x, y, theta])
    forward = vx * np.cos(theta) + vy * np.sin(theta)
    assert (odometry.twist.twist.linear.x, odometry.twist.twist.angular.z) == pytest.approx((forward, omega))
    (transform,) = messages["/tf"][t][1].transforms
    assert (transform.header.frame_id, transform.child_frame_id) == ("map", "base_link")
    assert (transform.transform.translation.x, transform.transform.translation.y) == (x, y)
    command = messages["/cmd_vel"][t][1]
    assert command.header.frame_id == "base_link"
    twist = command.twist.linear.x, command.twist.linear.y, command.twist.angular.z
    assert twist == tuple(record.command[t].tolist())
    ((_, goal),) = messages["/goal"]
    assert in_plane(goal.pose)[:2] == [record.scene().goal.x, record.scene().goal.y]


def test_the_scan_meets_the_wall_behind_the_points(record: s2.EpisodeRecord, data: bytes, tmp_path: Path) -> None:
    messages, t = read(data, tmp_path), 0
    scan, cloud = messages["/scan"][t][1], messages["/scan/points"][t][1]
    assert (scan.header.frame_id, cloud.header.frame_id, len(scan.ranges)) == ("base_link", "base_link", 360)
    angles = scan.angle_min + np.arange(360) * scan.angle_increment
    pose = Pose(*record.states.robot[t, :3].tolist())
    down = int(np.argmin(np.abs(np.angle(np.exp(1j * (angles + pose.theta + np.pi / 2))))))  # towards the wall y = -4
    heading = angles[down] + pose.theta
    assert scan.ranges[down] == pytest.approx((pose.y + 4) / -np.sin(heading), abs=1e-3)
    points = np.frombuffer(cloud.data, dtype="<f4").reshape(-1, 3)
    is_hit = np.isfinite(scan.ranges)
    assert len(points) == cloud.width == is_hit.sum()
    assert np.hypot(points[:, 0], points[:, 1]) == pytest.approx(scan.ranges[is_hit], abs=1e-4)


def test_people_come_and_go(record: s2.EpisodeRecord, data: bytes, tmp_path: Path) -> None:
    messages, ids = read(data, tmp_path), record.scene().human_table.id
    numbers = Counter[int]()
    for t, present in enumerate(record.states.present):
        markers = messages["/people"][t][1]
        bodies, names = of_people(markers, "people"), of_people(markers, "people names")
        assert list(bodies) == list(names) == ids[present].tolist()
        poses = messages["/people/poses"][t][1].poses
        rows = record.states.humans[t][present]
        assert [in_plane(pose) for pose in poses] == [pytest.approx(row) for row in rows[:, :3].tolist()]
        assert [in_plane(body.pose) for body in bodies.values()] == [pytest.approx(row) for row in rows[:, :3].tolist()]
        points = np.frombuffer(messages["/people/points"][t][1].data, dtype="<f4").reshape(-1, 3)
        assert points[:, :2] == pytest.approx(rows[:, :2], abs=1e-5)
        numbers[len(bodies)] += 1
    assert len(numbers) == 2
    human = record.snapshot(0).humans[0]
    body = of_people(messages["/people"][0][1], "people")[human.id]
    assert (body.scale.x, body.scale.y) == pytest.approx((2.0 * human.radius, human.breadth))
    name = of_people(messages["/people"][0][1], "people names")[human.id]
    assert name.text == f"{human.id} {human.activity}"


def test_interactions_are_lines_between_positions(record: s2.EpisodeRecord, data: bytes, tmp_path: Path) -> None:
    snapshot, messages = record.snapshot(0), read(data, tmp_path)
    assert snapshot.interactions
    at = {human.id: human.pose.position for human in snapshot.humans}
    expected = [at[id] for link in snapshot.interactions for id in (link.src, link.dst)]
    lines = of_people(messages["/interactions"][0][1], snapshot.interactions[0].relation)[0]
    assert [(point.x, point.y) for point in lines.points] == expected


def test_the_room_has_walls_furniture_and_a_map(record: s2.EpisodeRecord, data: bytes, tmp_path: Path) -> None:
    messages, scene = read(data, tmp_path), record.scene()
    ((_, markers),), ((_, grid),) = messages["/scene"], messages["/map"]
    (walls,) = of_people(markers, "walls").values()
    ends = [(*wall.start, *wall.end) for wall in scene.walls]
    pairs = zip(walls.points[::2], walls.points[1::2], strict=True)
    assert [(a.x, a.y, b.x, b.y) for a, b in pairs] == ends
    pieces = of_people(markers, "furniture")
    assert {id: in_plane(piece.pose)[:2] for id, piece in pieces.items()} == {
        thing.id: list(thing.pose.position) for thing in scene.furniture
    }
    names = of_people(markers, "furniture names")
    assert {name.text for name in names.values()} == {f"{thing.type} {thing.id}" for thing in scene.furniture}
    cells = grid.data.reshape(grid.info.height, grid.info.width)
    table = next(thing for thing in scene.furniture if thing.type == "table")
    origin, size = grid.info.origin.position, grid.info.resolution
    column, row = (int((p - o) / size) for p, o in zip(table.pose.position, (origin.x, origin.y), strict=True))
    assert (cells[row, column], set(np.unique(cells))) == (100, {-1, 0, 100})


def test_the_same_episode_gives_the_same_bytes(record: s2.EpisodeRecord, data: bytes) -> None:
    assert mcap.export(record, Options()) == data


def test_doors_that_move_areas_and_polygons_are_drawn(tmp_path: Path) -> None:
    record = run(
        people=[], interior_doors=[{"x": 0, "y": 0, "theta": 1.5707963}], tables=0, plants=0, laptops_on_tables=0,
        room={**COMING["room"], "walls": [[0, -4, 0, -0.5], [0, 0.5, 0, 4]]},
        areas=[{"name": "carpet", "polygon": [[3, 3], [4, 3], [4, 4], [3, 4]]}],
        robot={"pose": [-2, 0, 0], "body": {"shape": "polygon", "points": [[0.3, 0], [-0.2, 0.2], [-0.2, -0.2]]}},
    )  # fmt: skip
    messages = read(mcap.export(record, Options()), tmp_path)
    for (_, message), snapshot in zip(messages["/doors"], record.snapshots(), strict=True):
        (leaf,) = of_people(message, "doors").values()
        (start, end, _) = snapshot.doors[0].leaf
        assert [(point.x, point.y) for point in leaf.points] == [start, end]
    assert set(of_people(messages["/scene"][0][1], "area carpet")) == {0, 1}
    (robot,) = of_people(messages["/robots"][0][1], "robots").values()
    assert [(point.x, point.y) for point in robot.points] == [(0.3, 0.0), (-0.2, 0.2), (-0.2, -0.2)]


def test_a_goal_that_moves_is_written_when_it_changes(tmp_path: Path) -> None:
    record = run(goal={"position": [-1, -1.5], "then": [[2, 2]]}, rules={"time_limit": 20}, people=[])
    goals = [in_plane(goal.pose)[:2] for _, goal in read(mcap.export(record, Options()), tmp_path)["/goal"]]
    assert goals == [[-1.0, -1.5], [2.0, 2.0]]


def test_other_robots_are_people_or_robots(tmp_path: Path) -> None:
    path = tmp_path / "several.json"
    scene = s2.generate(s2.load_scenario("empty").changed(robots=2), seed=1)
    with JsonRecorder(path) as recorder:
        s2.Episode(scene, s2.StraightToGoal(), observers=[recorder]).run()
    for options, people, robots in ((Options(), 1, 1), (Options(robots_as="objects", robot=1), 0, 2)):
        (file,) = export_to(path, "mcap", tmp_path / "out", options).files
        messages = read(file.read_bytes(), tmp_path)
        assert len(of_people(messages["/people"][0][1], "people")) == people
        assert len(of_people(messages["/robots"][0][1], "robots")) == robots
        x = s2.read_episode(path).seen_by(scene.robot_ids[options.robot]).robot[0, 0]
        assert messages["/odom"][0][1].pose.pose.position.x == x


def test_episodes_without_a_robot_are_skipped(records: list[s2.EpisodeRecord], tmp_path: Path) -> None:
    tracks = export_to(records[0].path, "csv", tmp_path / "tracks").files
    episode = import_from(tracks[0], "csv", tmp_path / "back").files
    result = export_to(episode[0], "mcap", tmp_path / "out")
    assert result.files == []
    assert ["no recorded robot" in omission.reason for omission in result.skipped] == [True]


def test_what_an_imported_episode_lacks_is_left_out(tmp_path: Path) -> None:
    rows = [f"{t / 10},{row}" for t in range(30) for row in (f"1,{t / 10},1,robot", "2,1,2,person")]
    (tmp_path / "t.csv").write_text("\n".join(["time,id,x,y,class", *rows, ""]))
    (episode,) = import_from(tmp_path / "t.csv", "tracks", tmp_path / "back").files
    messages = read(mcap.export(s2.read_episode(episode), Options()), tmp_path)
    assert {"/cmd_vel", "/goal"}.isdisjoint(messages)
    assert messages["/odom"][10][1].pose.pose.position.x == pytest.approx(1.0, abs=1e-3)
    lines = [marker for marker in messages["/scene"][0][1].markers[1:] if marker.type == marker.LINE_LIST]
    assert [line.ns for line in lines if len(line.points)] == ["room"]  # the recording has no walls
    assert len(lines) == 1


@pytest.mark.parametrize("module", ["mcap.writer", "rosbags.typesys"])
def test_a_missing_package_is_named(record: s2.EpisodeRecord, monkeypatch: pytest.MonkeyPatch, module: str) -> None:
    mcap._store.cache_clear()
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(RecordError, match=rf"needs {module.split('.')[0]}, .* pip install 'sonata2d\[mcap\]'"):
        mcap.export(record, Options())
