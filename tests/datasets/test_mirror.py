"""A mirror image is exact: twice gives the same bytes, and once gives what a mirror shows."""

from __future__ import annotations

import copy
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import sonata2d as s2
from sonata2d.agents.controllers.teleoperation import Teleoperation
from sonata2d.core.devices import DeviceEvent
from sonata2d.core.entities import Human
from sonata2d.core.geometry import Pose, Twist, canonical_angle, inside_polygon
from sonata2d.core.labels import LabelSpec
from sonata2d.core.scene import Rules
from sonata2d.core.snapshot import Snapshot
from sonata2d.core.vectors import wrap_angle
from sonata2d.datasets import mirror_image as image
from sonata2d.datasets.check import check_episode
from sonata2d.datasets.mirror import mirror_file, mirror_name, mirrored
from sonata2d.datasets.replay import branch, check_replay, check_rerun
from sonata2d.datasets.verification import verify
from sonata2d.errors import RecordError
from sonata2d.record.canonical import written
from sonata2d.record.files import read_bytes
from sonata2d.record.reader import read_episode, record_of
from sonata2d.record.record import EpisodeRecord
from sonata2d.view.things import front_of

from ..conftest import room
from .conftest import QUICK, odd_scene, recorded

GRID = st.integers(-31415, 31416).map(lambda n: n / 10_000 + 0.0)


def turned_back(snapshot: Snapshot) -> list[tuple[float, ...]]:
    """Where people are, seen from the robot."""
    pose = snapshot.robot.pose
    return [(*pose.to_local(human.pose.position), wrap_angle(human.head - pose.theta)) for human in snapshot.humans]


@pytest.mark.parametrize("suffix", [".json", ".json.gz", ".json.zst"])
@pytest.mark.parametrize("number", range(3))
def test_twice_gives_the_same_bytes(tmp_path: Path, number: int, suffix: str) -> None:
    path = tmp_path / f"one{suffix}"
    recorded(path, s2.generate(s2.ScenarioConfig(**QUICK), 7, number))
    mirror_file(path, tmp_path / f"two{suffix}")
    mirror_file(tmp_path / f"two{suffix}", tmp_path / f"three{suffix}")
    assert (tmp_path / f"three{suffix}").read_bytes() == path.read_bytes()
    assert read_bytes(tmp_path / f"two{suffix}") != read_bytes(path)


@given(theta=st.one_of(st.floats(-7.0, 7.0), GRID, st.integers(-3, 3)))
def test_twice_gives_the_same_bytes_whatever_a_hand_wrote(odd: EpisodeRecord, theta: float) -> None:
    document = copy.deepcopy(odd.document)
    for thing in [*document["objects"], *document["humans"], document["robot"], document["goal"]]:
        thing["theta"] = theta + 0  # no -0.0, as in any file
    record = record_of(document, odd.path)
    twin = mirrored(record)
    assert twin.document["mirrored_from"]["thetas"] or image.comes_back(theta + 0)
    assert written(mirrored(twin).document) == written(document)


@given(theta=GRID)
def test_angles_of_a_file_stay_angles_of_a_file_and_come_back(theta: float) -> None:
    for flip, exact in ((image.flipped_angle, -theta), (image.turned_angle, np.pi - theta)):
        twin = flip(theta)
        assert twin == canonical_angle(exact)
        assert flip(twin) == theta
        assert str(twin) != "-0.0"


def test_the_robot_sees_left_what_it_saw_right(odd: EpisodeRecord, generated: EpisodeRecord) -> None:
    for record in (odd, generated):
        for seen, image_seen in zip(record.snapshots(), mirrored(record).snapshots(), strict=True):
            for (x, y, head), (x2, y2, head2) in zip(turned_back(seen), turned_back(image_seen), strict=True):
                assert (x2, y2) == pytest.approx((x, -y), abs=1e-9)
                assert abs(wrap_angle(head2 + head)) < 3e-5  # half turns are 3.1416
            assert image_seen.robot.executed.omega == -seen.robot.executed.omega
            assert image_seen.interactions == seen.interactions
            assert image_seen.contacts == seen.contacts


def test_what_moves_and_what_is_asked_changes_sign(odd: EpisodeRecord) -> None:
    twin = mirrored(odd)
    sign = np.array([1, -1, -1])
    assert np.array_equal(twin.command, odd.command * sign)
    assert np.array_equal(twin.executed, odd.executed * sign)
    assert odd.command[:, 1:].any(axis=0).all()
    assert np.array_equal(twin.looks.humans[..., [1, 4, 5]], -odd.looks.humans[..., [1, 4, 5]])
    assert np.array_equal(twin.looks.humans[..., [0, 3]], odd.looks.humans[..., [0, 3]])
    assert twin.scene().rules.side == -odd.scene().rules.side
    assert twin.labels == odd.labels
    assert not any(str(number) == "-0.0" for row in twin.command.tolist() for number in row)


def test_the_room_stays_counter_clockwise_and_walls_keep_indices_and_hand(odd: EpisodeRecord) -> None:
    scene, twin = odd.scene(), mirrored(odd).scene()
    x, y = twin.outline.T
    assert (x * np.roll(y, -1) - np.roll(x, -1) * y).sum() > 0.0
    for wall, seen in zip(scene.walls, twin.walls, strict=True):
        assert {seen.start, seen.end} == {(x, -y) for x, y in (wall.start, wall.end)}
        middle = np.add(seen.start, seen.end) / 2
        along = np.subtract(seen.end, seen.start)
        left = middle + 0.01 * np.array([-along[1], along[0]]) / np.hypot(*along)
        assert inside_polygon(left[None], twin.outline)[0]
    assert any(contact["kind"] == "wall" for frame in odd.document["frames"] for contact in frame["contacts"])


def test_outlines_and_fronts_of_things_are_mirrored(odd: EpisodeRecord, generated: EpisodeRecord) -> None:
    for record in (odd, generated):
        for thing, twin in zip(record.scene().furniture, mirrored(record).scene().furniture, strict=True):
            (x, y), (x2, y2) = front_of(thing), front_of(twin)
            assert (x2, y2) == pytest.approx((x, -y), abs=2e-5)
            edges, seen = (np.array([[*a, *b] for a, b, _ in f.shape.edges(f.pose)]) for f in (thing, twin))
            corners, image_corners = edges[:, :2] * [1, -1], seen[:, :2]
            assert min(np.abs(np.roll(corners[::-1], k, 0) - image_corners).max() for k in range(len(corners))) < 2e-5


def test_an_image_tells_what_it_is_and_passes_the_checks(tmp_path: Path, generated: EpisodeRecord) -> None:
    path = tmp_path / "twin.json"
    twin = mirror_file(generated.path, path)
    assert twin.id == "000000-mirror"
    assert twin.document["mirrored_from"]["id"] == "000000"
    assert check_episode(path) == []
    assert check_replay(path) == []
    assert check_rerun(path) == []
    assert read_episode(path).document == twin.document


@pytest.mark.parametrize(
    ("told", "changed"),
    [
        (r'"executed":\[[^]]*\]', '"executed":[0.1,0.0,0.0]'),
        (r'"side":-1', '"side":1'),
        (r'"seed":4,', '"seed":5,'),
        (r'"sha256":"\w{3}', '"sha256":"000'),
    ],
)
def test_the_replay_of_an_image_finds_what_is_no_image(
    tmp_path: Path, generated: EpisodeRecord, told: str, changed: str
) -> None:
    path = tmp_path / "twin.json"
    mirror_file(generated.path, path)
    text, count = re.subn(told, changed, path.read_text(), count=1)
    assert count == 1
    path.write_text(text)
    places = {problem.place for problem in check_replay(path)}
    assert "mirrored_from" in places
    assert "sha256" in told or places & {"replay", "scene"}


def test_an_image_cannot_be_branched(tmp_path: Path, generated: EpisodeRecord) -> None:
    mirror_file(generated.path, tmp_path / "twin.json")
    with pytest.raises(RecordError, match="branch its original"):
        branch(tmp_path / "twin.json", 3, s2.StraightToGoal())


def test_labels_are_mirrored_by_a_function_that_is_its_own_inverse(tmp_path: Path, odd: EpisodeRecord) -> None:
    def turn(label: dict[str, object]) -> dict[str, object]:
        return label | {"turns": 0 - label["turns"]}  # type: ignore[operator]

    twin = mirrored(odd, label=turn)
    assert [label["turns"] for label in twin.labels] == [-label["turns"] for label in odd.labels]
    assert mirrored(twin, label=turn).document == odd.document
    with pytest.raises(RecordError, match="whose image is another"):
        mirrored(odd, label=lambda label: label | {"turns": 1.0})
    path = tmp_path / "twin.json"
    path.write_bytes(written(twin.document))
    assert check_replay(path) == []
    assert [problem.place for problem in check_rerun(path)] == ["rerun"]


def test_a_driven_run_is_mirrored_by_what_its_controls_mean(tmp_path: Path) -> None:
    path, spec = tmp_path / "driven.json", LabelSpec("slider", "frame")
    controller, events = Teleoperation(label=spec), iter(range(100))
    from sonata2d.sim.episode import Episode, author_of

    with s2.JsonRecorder(path) as recorder:
        author = author_of(controller, "teleoperation")
        episode = Episode(odd_scene(0.5), controller, observers=[recorder], author=author)
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
    twin = mirrored(record)
    again = Teleoperation.from_settings(twin.author.settings or {})
    again.reset(twin.scene())
    asked = [again.act(snapshot) for snapshot in list(twin.snapshots())[:-1]]
    assert [move.rounded() for move in asked if isinstance(move, Twist)] == [
        Twist(*row) for row in twin.command.tolist()
    ]
    assert [f["events"] for f in twin.document["frames"]] == [f["events"] for f in record.document["frames"]]
    mirror_file(path, tmp_path / "twin.json")
    assert verify(tmp_path / "twin.json", replay=True, rerun=True) == []
    assert written(mirrored(twin).document) == path.read_bytes()


def test_who_is_not_present_stays_so(odd: EpisodeRecord) -> None:
    document = copy.deepcopy(odd.document)
    for look in (*document["frames"][5:], document["final"]):
        look["humans"][1], look["activity"][1] = None, -1
    twin = mirrored(record_of(document, odd.path))
    assert not twin.looks.present[5:, 1].any()
    assert mirrored(twin).document == document


def test_a_file_that_only_claims_to_be_an_image_is_refused_in_one_line(odd: EpisodeRecord) -> None:
    for strange in ({"id": "x"}, 5, {"thetas": [[1]]}):
        document = odd.document | {"mirrored_from": strange}
        with pytest.raises(RecordError, match="no whole episode"):
            mirrored(record_of(document, odd.path))


def test_names_of_images_lead_back() -> None:
    for name in ("000007.json", "Ada__20250102T030405Z__000001.json.zst", "-mirror.json"):
        assert mirror_name(mirror_name(name)) == name


def test_people_who_come_and_go_are_mirrored_with_their_tracks_and_goals(tmp_path: Path) -> None:
    people = (
        Human(
            1, Pose(0.0, 1.0), behaviour="walking", goals=((1.0, 2.0), (0.0, -2.0)), velocity=(0.3, -0.4), exits=True
        ),
        Human(
            2, Pose(-1.0, 0.5), behaviour="recorded", track=((-1.0, 0.5), (-0.9, 0.6), (-0.8, 0.0)), enters=3, leaves=9
        ),
    )
    with s2.JsonRecorder(tmp_path / "one.json") as recorder:
        s2.Episode(room(people, rules=Rules(time_limit=2.0)), s2.StraightToGoal(), observers=[recorder]).run()
    record = read_episode(tmp_path / "one.json")
    twin = mirrored(record)
    one, other = twin.scene().humans
    assert one.goals == ((1.0, -2.0), (0.0, 2.0))
    assert one.velocity == (0.3, 0.4)
    assert other.track == ((-1.0, -0.5), (-0.9, -0.6), (-0.8, 0.0))
    assert (other.enters, other.leaves) == (3, 9)
    assert twin.present.tolist() == record.present.tolist()
    assert written(mirrored(twin).document) == written(record.document)
    mirror_file(tmp_path / "one.json", tmp_path / "one-mirror.json")
    assert check_replay(tmp_path / "one-mirror.json") == []
    assert check_episode(tmp_path / "one-mirror.json") == []
