"""A mirror image is exact: mirroring twice gives the same bytes, mirroring once flips left and right."""

from __future__ import annotations

import copy
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, strategies as st

import sonata2d as s2
from sonata2d.agents.controllers.teleoperation import Teleoperation
from sonata2d.core.devices import DeviceEvent
from sonata2d.core.entities import Human
from sonata2d.core.geometry import Pose, Twist, canonical_angle, inside_polygon
from sonata2d.core.labels import LabelSpec
from sonata2d.core.scene import Rules
from sonata2d.core.snapshot import Snapshot
from sonata2d.core.vectors import wrap_angle
from sonata2d.datasets import verify
from sonata2d.datasets.check.replay import branch, check_replay, check_rerun
from sonata2d.datasets.transforms.mirror import (
    flipped_angle,
    is_turn_reversible,
    mirror_file,
    mirror_name,
    mirrored,
    turned_angle,
    twist_image,
)
from sonata2d.errors import InvalidFileError, RecordError
from sonata2d.record.canonical import serialise, to_json_value
from sonata2d.record.files import read_bytes
from sonata2d.record.reader import read_episode
from sonata2d.record.record import EpisodeRecord, record_from_document
from sonata2d.record.validate import require_valid

from ..conftest import room
from .conftest import QUICK, odd_scene, recorded

FILE_ANGLES = st.integers(-31415, 31416).map(lambda n: n / 10_000 + 0.0)


def humans_in_robot_frame(snapshot: Snapshot) -> list[tuple[float, ...]]:
    """Position (m) and head angle (rad) of each human, relative to the robot."""
    pose = snapshot.robot.pose
    return [(*pose.to_local(human.pose.position), wrap_angle(human.head - pose.theta)) for human in snapshot.humans]


@pytest.mark.parametrize("suffix", [".json", ".json.gz", ".json.zst"])
@pytest.mark.parametrize("number", range(3))
def test_mirroring_twice_gives_the_same_bytes(tmp_path: Path, number: int, suffix: str) -> None:
    path = tmp_path / f"one{suffix}"
    recorded(path, s2.generate(s2.ScenarioConfig(**QUICK), 7, number))
    mirror_file(path, tmp_path / f"two{suffix}")
    mirror_file(tmp_path / f"two{suffix}", tmp_path / f"three{suffix}")
    assert (tmp_path / f"three{suffix}").read_bytes() == path.read_bytes()
    assert read_bytes(tmp_path / f"two{suffix}") != read_bytes(path)


@given(theta=st.one_of(st.floats(-7.0, 7.0), FILE_ANGLES, st.integers(-3, 3)))
def test_mirroring_twice_restores_any_angle_of_a_hand_written_file(odd: EpisodeRecord, theta: float) -> None:
    document = copy.deepcopy(odd.document)
    for thing in [*document["objects"], *document["humans"], document["robot"], document["goal"]]:
        thing["theta"] = theta + 0  # files contain no -0.0
    record = record_from_document(document, odd.path)
    image = mirrored(record)
    assert image.document["mirrored_from"]["thetas"] or is_turn_reversible(theta + 0)
    assert serialise(mirrored(image).document) == serialise(document)


@given(theta=FILE_ANGLES)
def test_mirroring_angles_of_files_is_exact_and_its_own_inverse(theta: float) -> None:
    for flip, exact in ((flipped_angle, -theta), (turned_angle, np.pi - theta)):
        image = flip(theta)
        assert image == canonical_angle(exact)
        assert flip(image) == theta
        assert str(image) != "-0.0"


def test_doors_queues_places_and_seats_are_mirrored(tmp_path: Path) -> None:
    config = s2.load_scenario("waiting-room").changed(
        rules={"time_limit": 6, "ends_on": ["time"]}, places=[{"x": 1, "y": -1}], seated=3
    )
    record = recorded(tmp_path / "one.json", s2.generate(config, 2))
    image = mirrored(record)
    assert serialise(mirrored(image).document) == serialise(record.document)
    before, after = record.scene(), image.scene()
    for a, b in zip((*before.doors, *before.queues), (*after.doors, *after.queues), strict=True):
        assert (b.pose.x, b.pose.y) == (a.pose.x, -a.pose.y)
        assert b.pose.direction == pytest.approx((a.pose.direction[0], -a.pose.direction[1]), abs=1e-4)
    assert [(place.x, place.y) for place in after.places] == [(1.0, 1.0)]
    for a, b in zip(before.furniture, after.furniture, strict=True):
        assert b.front == pytest.approx((a.front[0], -a.front[1]), abs=1e-4)
    path = tmp_path / "image.json"
    mirror_file(tmp_path / "one.json", path)
    assert verify(path) == check_replay(read_episode(path)) == []


def test_left_and_right_of_the_robot_are_swapped(odd: EpisodeRecord, generated: EpisodeRecord) -> None:
    for record in (odd, generated):
        for snapshot, image in zip(record.snapshots(), mirrored(record).snapshots(), strict=True):
            for (x, y, head), (x2, y2, head2) in zip(
                humans_in_robot_frame(snapshot), humans_in_robot_frame(image), strict=True
            ):
                assert (x2, y2) == pytest.approx((x, -y), abs=1e-9)
                assert abs(wrap_angle(head2 + head)) < 3e-5  # half turns are 3.1416
            assert image.robot.executed.omega == -snapshot.robot.executed.omega
            assert image.interactions == snapshot.interactions
            assert image.contacts == snapshot.contacts


def test_lateral_velocities_commands_and_the_side_of_evasion_change_sign(odd: EpisodeRecord) -> None:
    image = mirrored(odd)
    sign = np.array([1, -1, -1])
    assert np.array_equal(image.command, odd.command * sign)
    assert np.array_equal(image.executed, odd.executed * sign)
    assert odd.command[:, 1:].any(axis=0).all()
    assert np.array_equal(image.states.humans[..., [1, 4, 5]], -odd.states.humans[..., [1, 4, 5]])
    assert np.array_equal(image.states.humans[..., [0, 3]], odd.states.humans[..., [0, 3]])
    assert image.scene().rules.side == -odd.scene().rules.side
    assert image.labels == odd.labels
    assert not any(str(number) == "-0.0" for row in image.command.tolist() for number in row)


def test_the_room_stays_counter_clockwise_and_walls_keep_indices_and_hand(odd: EpisodeRecord) -> None:
    scene, image = odd.scene(), mirrored(odd).scene()
    x, y = image.outline.T
    assert (x * np.roll(y, -1) - np.roll(x, -1) * y).sum() > 0.0
    for wall, seen in zip(scene.walls, image.walls, strict=True):
        assert {seen.start, seen.end} == {(x, -y) for x, y in (wall.start, wall.end)}
        middle = np.add(seen.start, seen.end) / 2
        along = np.subtract(seen.end, seen.start)
        left = middle + 0.01 * np.array([-along[1], along[0]]) / np.hypot(*along)
        assert inside_polygon(left[None], image.outline)[0]
    assert any(contact["kind"] == "wall" for frame in odd.document["frames"] for contact in frame["contacts"])


def test_outlines_and_fronts_of_objects_are_mirrored(odd: EpisodeRecord, generated: EpisodeRecord) -> None:
    for record in (odd, generated):
        for thing, image in zip(record.scene().furniture, mirrored(record).scene().furniture, strict=True):
            (x, y), (x2, y2) = thing.front, image.front
            assert (x2, y2) == pytest.approx((x, -y), abs=2e-5)
            edges, seen = (np.array([[*a, *b] for a, b, _ in f.shape.edges(f.pose)]) for f in (thing, image))
            corners, image_corners = edges[:, :2] * [1, -1], seen[:, :2]
            assert min(np.abs(np.roll(corners[::-1], k, 0) - image_corners).max() for k in range(len(corners))) < 2e-5


def test_an_image_names_its_original_and_passes_all_checks(tmp_path: Path, generated: EpisodeRecord) -> None:
    path = tmp_path / "image.json"
    image = mirror_file(generated.path, path)
    assert image.id == "000000-mirror"
    assert image.document["mirrored_from"]["id"] == "000000"
    assert verify(path) == []
    assert check_replay(read_episode(path)) == []
    assert check_rerun(read_episode(path)) == []
    assert read_episode(path).document == image.document


@pytest.mark.parametrize(
    ("pattern", "changed"),
    [
        (r'"executed":\[[^]]*\]', '"executed":[0.1,0.0,0.0]'),
        (r'"side":-1', '"side":1'),
        (r'"seed":4,', '"seed":5,'),
        (r'"sha256":"\w{3}', '"sha256":"000'),
    ],
)
def test_the_replay_of_an_image_finds_changes(
    tmp_path: Path, generated: EpisodeRecord, pattern: str, changed: str
) -> None:
    path = tmp_path / "image.json"
    mirror_file(generated.path, path)
    text, count = re.subn(pattern, changed, path.read_text(), count=1)
    assert count == 1
    path.write_text(text)
    places = {problem.place for problem in check_replay(read_episode(path))}
    assert "mirrored_from" in places
    assert "sha256" in pattern or places & {"replay", "scene"}


def test_an_image_cannot_be_branched(tmp_path: Path, generated: EpisodeRecord) -> None:
    mirror_file(generated.path, tmp_path / "image.json")
    with pytest.raises(RecordError, match="branch its original"):
        branch(tmp_path / "image.json", 3, s2.StraightToGoal())


def test_the_function_that_mirrors_labels_must_be_its_own_inverse(tmp_path: Path, odd: EpisodeRecord) -> None:
    def turn(label: dict[str, object]) -> dict[str, object]:
        return label | {"turns": 0 - label["turns"]}  # type: ignore[operator]

    image = mirrored(odd, label=turn)
    assert [label["turns"] for label in image.labels] == [-label["turns"] for label in odd.labels]
    assert mirrored(image, label=turn).document == odd.document
    with pytest.raises(RecordError, match="whose image is another"):
        mirrored(odd, label=lambda label: label | {"turns": 1.0})
    path = tmp_path / "image.json"
    path.write_bytes(serialise(image.document))
    assert check_replay(read_episode(path)) == []
    assert [problem.place for problem in check_rerun(read_episode(path))] == ["rerun"]


def test_the_device_mappings_of_a_driven_run_are_mirrored(tmp_path: Path) -> None:
    path, spec = tmp_path / "driven.json", LabelSpec("slider", "frame")
    controller, events = Teleoperation(label=spec), iter(range(100))
    from sonata2d.sim.driver import controller_info_of
    from sonata2d.sim.episode import Episode

    with s2.JsonRecorder(path) as recorder:
        controller_info = controller_info_of(controller, "teleoperation")
        episode = Episode(odd_scene(0.5), controller, observers=[recorder], controller_info=controller_info)
        while episode.outcome is None:
            keys = {
                3: ("keyboard", "w", 1.0),
                5: ("keyboard", "a", 1.0),
                9: ("pad0", "right_x", 0.7),
                12: ("label", "label", 0.4),
            }
            found = keys.get(next(events))
            episode.step((DeviceEvent(*found),) if found else ())
    record = read_episode(path)
    assert record.command[:, 1].any()
    assert record.command[:, 2].any()
    image = mirrored(record)
    again = Teleoperation.from_settings(image.controller_info.settings or {})
    again.reset(image.scene())
    commands = [again.act(snapshot) for snapshot in list(image.snapshots())[:-1]]
    assert [move.rounded() for move in commands if isinstance(move, Twist)] == [
        Twist(*row) for row in image.command.tolist()
    ]
    assert [f["events"] for f in image.document["frames"]] == [f["events"] for f in record.document["frames"]]
    mirror_file(path, tmp_path / "image.json")
    assert verify(tmp_path / "image.json", replay=True, rerun=True) == []
    assert serialise(mirrored(image).document) == path.read_bytes()


def test_absent_humans_stay_absent(odd: EpisodeRecord) -> None:
    document = copy.deepcopy(odd.document)
    for frame in (*document["frames"][5:], document["final"]):
        frame["humans"][1], frame["activity"][1] = None, -1
    image = mirrored(record_from_document(document, odd.path))
    assert not image.states.present[5:, 1].any()
    assert mirrored(image).document == document


def test_a_malformed_mirrored_from_is_refused(odd: EpisodeRecord) -> None:
    for malformed in ({"id": "x"}, 5, {"thetas": [[1]]}):
        document = odd.document | {"mirrored_from": malformed}
        with pytest.raises(InvalidFileError, match=r"is not a valid episode: mirrored_from"):
            require_valid(document, odd.path)


def test_mirroring_a_name_twice_gives_the_name() -> None:
    for name in ("000007.json", "Ada__20250102T030405Z__000001.json.zst", "-mirror.json"):
        assert mirror_name(mirror_name(name)) == name


def test_tracks_goals_and_velocities_of_passing_humans_are_mirrored(tmp_path: Path) -> None:
    humans = (
        Human(
            1, Pose(0.0, 1.0), behaviour="walking", goals=((1.0, 2.0), (0.0, -2.0)), velocity=(0.3, -0.4), exits=True
        ),
        Human(
            2, Pose(-1.0, 0.5), behaviour="recorded", track=((-1.0, 0.5), (-0.9, 0.6), (-0.8, 0.0)), enters=3, leaves=9
        ),
    )
    with s2.JsonRecorder(tmp_path / "one.json") as recorder:
        s2.Episode(room(humans, rules=Rules(time_limit=2.0)), s2.StraightToGoal(), observers=[recorder]).run()
    record = read_episode(tmp_path / "one.json")
    image = mirrored(record)
    one, other = image.scene().humans
    assert one.goals == ((1.0, -2.0), (0.0, 2.0))
    assert one.velocity == (0.3, 0.4)
    assert other.track == ((-1.0, -0.5), (-0.9, -0.6), (-0.8, 0.0))
    assert (other.enters, other.leaves) == (3, 9)
    assert image.present.tolist() == record.present.tolist()
    assert serialise(mirrored(image).document) == serialise(record.document)
    mirror_file(tmp_path / "one.json", tmp_path / "one-mirror.json")
    assert check_replay(read_episode(tmp_path / "one-mirror.json")) == []
    assert verify(tmp_path / "one-mirror.json") == []


@pytest.mark.parametrize("twist", [[0.5, 0.1, -0.3], [0.0, 0.0, 0.0], [1, 0, -2], [-0.25, 0.0001, 0.0]])
def test_mirroring_a_twist_is_its_own_inverse(twist: list[float]) -> None:
    assert twist_image(twist) == [twist[0], -twist[1], -twist[2]]
    assert repr(twist_image(twist_image(twist))) == repr(twist)
    assert to_json_value(twist_image(twist), "label") == twist_image(twist)


@pytest.mark.parametrize(
    "label", [None, True, 0.5, "left", [0.1, 0.2], [0.1, 0.2, None], [0.1, 0.2, True], {"vx": 1.0}]
)
def test_mirroring_a_label_that_is_not_a_twist_is_refused(odd: EpisodeRecord, label: object) -> None:
    with pytest.raises(RecordError, match=r"is not a twist \[vx, vy, omega\]; mirror without changing the labels"):
        twist_image(label)
    with pytest.raises(RecordError, match="is not a twist"):
        mirrored(odd, label=twist_image)
