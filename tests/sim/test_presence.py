"""Pedestrians enter and leave, and recorded ones follow their tracks."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from sonata2d_cli.main import main

import sonata2d as s2
from sonata2d.agents.pedestrians.routes import EXIT_DISTANCE
from sonata2d.core.entities import Group, Human, Interaction
from sonata2d.core.geometry import Point, Pose
from sonata2d.core.relations import TALKING, WALKING_TOGETHER
from sonata2d.core.scene import Rules, Scene
from sonata2d.core.snapshot import Snapshot
from sonata2d.datasets import verify
from sonata2d.datasets.check.replay import check_replay
from sonata2d.metrics.disturbance import without_robot
from sonata2d.record.reader import read_episode
from sonata2d.record.recorder import JsonRecorder
from sonata2d.sim.episode import Episode
from sonata2d.sim.kernel.presence import ENTRY_OVERLAP
from sonata2d.view.interpolation import between
from sonata2d.view.trails import Trails

from ..conftest import room, walker

RULES = Rules(time_limit=6.0, ends_on=("time",))
TRACK = tuple((round(-3.0 + 0.12 * k, 4), round(0.3 * math.sin(0.1 * k), 4)) for k in range(40))


class Idle(s2.Controller):
    """Stands."""

    def act(self, snapshot: Snapshot) -> s2.Twist:
        return s2.Twist()


def recorded(number: int, track: tuple[Point, ...] = TRACK, **fields: object) -> Human:
    """A recorded pedestrian."""
    return replace(Human(number, Pose(*track[0]), 0.2, behaviour="recorded", track=track), **fields)  # type: ignore[arg-type]


def passer(number: int, start: Point, goal: Point, **fields: object) -> Human:
    """A pedestrian that walks to a goal and leaves there."""
    human = Human(number, Pose(*start), 0.2, behaviour="walking", goals=(goal,), exits=True, velocity=(0.0, -0.5))
    return replace(human, **fields)  # type: ignore[arg-type]


def test_people_who_find_no_space_to_enter_are_noted(tmp_path: Path) -> None:
    """2 finds 1 in its place; 3 has space; 4 is not due before the end; 5 should have left before it finds space."""
    humans = (
        Human(1, Pose(2.0, 2.0), 0.2),
        passer(2, (2.1, 2.0), (2.0, -3.0), enters=10),
        passer(3, (-2.0, 2.0), (-2.0, -3.0), enters=10),
        passer(4, (2.0, 2.1), (2.0, -3.0), enters=61),
        passer(5, (1.9, 2.0), (2.0, -3.0), enters=10, leaves=20),
        recorded(6, enters=70),
    )
    path = tmp_path / "late.json"
    for people, noted in ((humans, [2, 5]), (humans[:1] + humans[2:4], None)):
        with JsonRecorder(path) as recorder:
            Episode(replace(room(), humans=people, rules=RULES), Idle(), observers=[recorder]).run()
        record = read_episode(path)
        assert record.document.get("never_entered") == noted
        assert record.never_entered == (noted or [])
        assert verify(path, replay=True) == []
    with JsonRecorder(path) as recorder:
        Episode(replace(room(), humans=humans, rules=RULES), Idle(), observers=[recorder]).run()
    line = " ".join(CliRunner().invoke(main, ["describe", str(path)]).output.split())
    assert "never entered 2, 5; the place where they enter was occupied" in line
    path.write_bytes(path.read_bytes().replace(b'"never_entered":[2,5]', b'"never_entered":[2]'))
    (problem,) = verify(path)
    assert "is [2], but the people who never entered are [2, 5]" in str(problem)


def scene_with_changes() -> Scene:
    """Pedestrians: 1 stands, 2 is recorded, 3 and 4 walk through together, 5 wanders, 6 wanders for a while."""
    pair = [passer(k, (0.5 * k - 1.5, 3.0), (0.5 * k - 1.5, -3.2), enters=2 * k, group=1) for k in (3, 4)]
    humans = (
        Human(1, Pose(2.0, 2.0), 0.2),
        recorded(2, enters=5, leaves=30),
        *pair,
        walker(5, 2.5, -2.5),
        walker(6, 0.0, 1.0, enters=40, leaves=55),
    )
    interactions = (Interaction(3, WALKING_TOGETHER, 4),)
    return replace(room(humans, rules=RULES), groups=(Group(1, "walking", (3, 4)),), interactions=interactions)


def snapshots(scene: Scene, controller: s2.Controller | None = None) -> list[Snapshot]:
    """The snapshots of an episode, including the last one."""
    episode, found = Episode(scene, controller or Idle()), []
    while episode.outcome is None:
        found.append(episode.snapshot())
        episode.step()
    return found


def test_snapshots_contain_exactly_the_pedestrians_that_are_present() -> None:
    scene = scene_with_changes()
    run = snapshots(scene)
    assert run[0].humans.id.tolist() == [1, 5]
    assert run[0].interactions == ()
    assert run[5].humans.id.tolist() == [1, 2, 5]
    assert run[8].humans.id.tolist() == [1, 2, 3, 4, 5]
    assert run[8].humans.row is not None
    assert run[8].humans.row.tolist() == [0, 1, 2, 3, 4]
    assert run[8].interactions == scene.interactions
    assert {tick for tick, snapshot in enumerate(run) if 2 in snapshot.humans.id} == set(range(5, 30))
    assert {tick for tick, snapshot in enumerate(run) if 6 in snapshot.humans.id} == set(range(40, 55))
    assert all(np.abs(snapshot.humans.position).max() < 4.0 for snapshot in run)


def test_a_pedestrian_that_exits_leaves_at_its_goal_at_full_speed() -> None:
    run = snapshots(room([passer(1, (0.0, 3.0), (0.0, -3.0))], rules=RULES))
    counts = [len(snapshot.humans) for snapshot in run]
    assert counts == sorted(counts, reverse=True)
    last = next(snapshot for snapshot in reversed(run) if len(snapshot.humans))
    assert last.humans.position[0] == pytest.approx((0.0, -3.0 + EXIT_DISTANCE), abs=0.15)
    assert np.hypot(*last.humans.velocity[0]) > 1.0


def test_a_recorded_pedestrian_is_on_its_track_and_pushes_others_aside() -> None:
    crowd = [walker(k, -1.0 + 0.5 * k, 0.1, math.pi) for k in range(2, 6)]
    run = snapshots(room([recorded(1, enters=3), *crowd], robot=Pose(-2.0, 0.0), rules=RULES))
    for tick, snapshot in enumerate(run):
        if 1 in snapshot.humans.id:
            assert snapshot.humans.position[0] == pytest.approx(TRACK[min(tick - 3, 39)], abs=1e-12)
        assert np.abs(snapshot.humans.velocity).max() < 3.0
        assert snapshot.robot.position == (-2.0, 0.0)  # on the track
    assert any(contact.other_at_fault for snapshot in run for contact in snapshot.contacts)


def test_the_velocity_of_a_recorded_pedestrian_is_that_of_its_track() -> None:
    run = snapshots(room([recorded(1, enters=3)], rules=RULES))
    step = np.array(TRACK[17]) - TRACK[16]
    assert run[3].humans.velocity[0] == pytest.approx((np.array(TRACK[1]) - TRACK[0]) / 0.1)
    assert run[20].humans.velocity[0] == pytest.approx(step / 0.1)
    assert run[20].humans[0].pose.theta == pytest.approx(math.atan2(*step[::-1]), abs=0.1)
    assert run[55].humans.velocity[0] == pytest.approx((0.0, 0.0))  # it stays at the end of the track


def test_absent_pedestrians_have_no_influence() -> None:
    # They do not touch each other: which of two bodies in contact is the first for the engine depends on all bodies.
    humans = [walker(k, 2.0 * k - 4.0, 2.0 * k - 5.0) for k in range(1, 4)]
    absent = [replace(walker(9, 0.0, 0.0), enters=1000), replace(recorded(8), enters=1000)]
    without, with_absent = (snapshots(room([*humans, *more], rules=RULES), s2.SocialForce()) for more in ([], absent))
    for expected, snapshot in zip(without, with_absent, strict=True):
        assert expected.humans.state.tolist() == snapshot.humans.state.tolist()
        assert expected.robot.pose == snapshot.robot.pose


@pytest.mark.usefixtures("motionless")
def test_a_pedestrian_neither_talks_with_nor_faces_an_absent_partner() -> None:
    humans = [
        Human(1, Pose(0.0, 0.0, 1.0), 0.2, group=1),
        Human(2, Pose(1.2, 0.0, 3.0), 0.2, group=1, enters=10, leaves=30),
    ]
    interactions, groups = (Interaction(1, TALKING, 2),), (Group(1, "talking", (1, 2)),)
    run = snapshots(room(humans, rules=RULES, groups=groups, interactions=interactions))
    activities = [snapshot.humans[0].activity for snapshot in run]
    assert activities == ["talking" if snapshot.interactions else "standing" for snapshot in run]
    assert [bool(snapshot.interactions) for snapshot in run] == [10 <= tick < 30 for tick in range(len(run))]
    assert run[10].humans[0].pose.theta == pytest.approx(1.0)
    assert run[30].humans[0].pose.theta == pytest.approx(0.0, abs=0.1)
    assert run[-1].humans[0].pose.theta == pytest.approx(1.0, abs=0.05)  # back to the initial heading


@pytest.mark.parametrize("leader", [recorded(1, group=1), passer(1, (0.0, 3.0), (0.0, 0.0), group=1)])
def test_a_follower_walks_on_if_its_leader_is_recorded_or_has_left(leader: Human) -> None:
    follower = walker(2, 1.0, 2.0, group=1)
    run = snapshots(room([leader, follower], rules=RULES, groups=(Group(1, "walking", (1, 2)),)))
    path = np.array([snapshot.humans.position[-1] for snapshot in run])
    assert np.abs(path).max() < 4.0
    assert np.hypot(*(path[-1] - path[-21])) > 0.5


def test_a_pedestrian_without_room_to_enter_waits() -> None:
    def scene(robot: Pose) -> Scene:
        return room([passer(1, (0.0, 3.0), (0.0, -3.0), enters=10)], robot=robot, rules=RULES)

    assert len(snapshots(scene(Pose(-3.0, 0.0)))[10].humans) == 1
    assert all(len(snapshot.humans) == 0 for snapshot in snapshots(scene(Pose(0.0, 3.0))))  # the robot is in the way
    twins = [passer(k, (0.0, 3.0), (0.0, -3.0), enters=10) for k in (1, 2)]
    run = snapshots(room(twins, rules=RULES))
    assert [len(run[tick].humans) for tick in (9, 10)] == [0, 1]
    position = next(snapshot.humans.position for snapshot in run if len(snapshot.humans) == 2)
    assert np.hypot(*(position[0] - position[1])) > 0.4 - ENTRY_OVERLAP - 1e-9


@pytest.mark.parametrize("controller", [s2.StraightToGoal, s2.SocialForce, s2.SocialPlanner])
def test_episodes_with_changing_pedestrians_are_recorded_and_replay(
    controller: type[s2.Controller], tmp_path: Path
) -> None:
    path, scene = tmp_path / "one.json", scene_with_changes()
    with JsonRecorder(path) as recorder:
        Episode(scene, controller(), observers=[recorder]).run()
    record = read_episode(path)
    assert verify(path) == []
    assert check_replay(read_episode(path)) == []
    assert record.scene() == scene
    assert record.present[:, 1].tolist() == [5 <= tick < 30 for tick in range(len(record))]
    assert np.isnan(record.humans[0, 1]).all()


@pytest.mark.parametrize("controller", [s2.SocialForce, s2.SocialPlanner])
def test_a_scene_can_be_without_pedestrians_for_a_while(controller: type[s2.Controller]) -> None:
    scene = room([recorded(1, enters=10, leaves=20)], rules=Rules(time_limit=3.0))
    counts = [len(snapshot.humans) for snapshot in snapshots(scene, controller())]
    assert counts == [0] * 10 + [1] * 10 + [0] * 11


def test_trails_have_gaps_where_pedestrians_were_absent() -> None:
    trails = Trails.of(snapshots(scene_with_changes()))
    assert trails.humans.shape[1] == 6
    assert np.isnan(trails.humans[0, 1]).all()
    assert np.isfinite(trails.humans[:, 0]).all()


def test_a_mirrored_scene_gives_mirrored_motion() -> None:
    def mirrored(human: Human) -> Human:
        x, y, theta = human.pose.x, human.pose.y, human.pose.theta
        return replace(
            human,
            pose=Pose(x, -y, -theta),
            velocity=(human.velocity[0], -human.velocity[1]),
            goals=tuple((x, -y) for x, y in human.goals),
            track=tuple((x, -y) for x, y in human.track),
        )

    scene = scene_with_changes()
    # Wandering pedestrians draw places at random.
    humans = tuple(human for human in scene.humans if human.behaviour != "wandering")
    scene = replace(scene, humans=humans)
    mirror = replace(scene, humans=tuple(map(mirrored, humans)), rules=replace(RULES, side=-1))
    for original, image in zip(snapshots(scene), snapshots(mirror), strict=True):
        assert original.humans.id.tolist() == image.humans.id.tolist()
        assert original.humans.position * (1.0, -1.0) == pytest.approx(image.humans.position, abs=1e-6)


def test_a_recorded_pedestrian_needs_a_track() -> None:
    with pytest.raises(ValueError, match="human 1 is recorded, but has no track"):
        snapshots(room([Human(1, Pose(0.0, 0.0), 0.2, behaviour="recorded")]))


def test_contacts_with_fast_recorded_pedestrians_are_detected() -> None:
    track = tuple((round(-3.5 + 0.5 * k, 4), 0.0) for k in range(14))  # 5 m/s
    run = snapshots(room([recorded(1, track)], robot=Pose(3.0, 0.0), rules=replace(RULES, time_limit=2.0)))
    assert any(snapshot.contacts for snapshot in run)


def test_interpolation_keeps_the_pedestrians_of_both_snapshots() -> None:
    run = snapshots(scene_with_changes())
    before, after = run[4], run[5]  # pedestrian 2 enters in between
    middle = between(before, after, 0.5)
    assert middle.humans.id.tolist() == [1, 5]
    assert middle.humans.row is not None
    assert middle.humans.row.tolist() == [0, 4]
    positions = before.humans.position + after.humans.position[[0, 2]]
    assert middle.humans.position == pytest.approx(positions / 2)


def test_disturbance_by_the_robot_is_measured_while_pedestrians_are_present_in_both_runs(tmp_path: Path) -> None:
    path = tmp_path / "one.json"
    with JsonRecorder(path) as recorder:
        Episode(scene_with_changes(), s2.SocialForce(), observers=[recorder]).run()
    positions = without_robot(read_episode(path))
    assert positions is not None
    assert np.isnan(positions[0, 1]).all()
    assert np.isfinite(positions[10, 1]).all()
