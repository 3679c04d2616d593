"""People come and go, and who is recorded keeps to their track."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import sonata2d as s2
from sonata2d.core.entities import TALKING, WALKING_TOGETHER, Group, Human, Interaction, Robot
from sonata2d.core.geometry import Pose
from sonata2d.core.scene import Rules, Scene
from sonata2d.core.snapshot import Snapshot
from sonata2d.datasets.check import check_episode
from sonata2d.datasets.replay import check_replay
from sonata2d.metrics.disturbance import without_robot
from sonata2d.record.reader import read_episode
from sonata2d.record.recorder import JsonRecorder
from sonata2d.sim.episode import Episode
from sonata2d.sim.presence import ENTRY_OVERLAP
from sonata2d.view.interpolation import between
from sonata2d.view.trails import Trails

from ..conftest import room, walker

RULES = Rules(time_limit=6.0, ends_on=("time",))
ALONG = tuple((round(-3.0 + 0.12 * k, 4), round(0.3 * math.sin(0.1 * k), 4)) for k in range(40))


def recorded(number: int, track: tuple[tuple[float, float], ...] = ALONG, **more: object) -> Human:
    return replace(Human(number, Pose(*track[0]), 0.2, behaviour="recorded", track=track), **more)  # type: ignore[arg-type]


def passer(number: int, start: tuple[float, float], goal: tuple[float, float], **more: object) -> Human:
    human = Human(number, Pose(*start), 0.2, behaviour="walking", goals=(goal,), exits=True, velocity=(0.0, -0.5))
    return replace(human, **more)  # type: ignore[arg-type]


def busy() -> Scene:
    """Somebody who stands, a recorded one, two who walk through together, one who comes late, one who wanders."""
    pair = [passer(k, (0.4 * k - 1.0, 3.0), (0.4 * k - 1.0, -3.2), enters=2 * k, group=1) for k in (3, 4)]
    people = (
        Human(1, Pose(2.0, 2.0), 0.2),
        recorded(2, enters=5, leaves=30),
        *pair,
        walker(5, 2.5, -2.5),
        walker(6, 0.0, 1.0),
    )
    people = (*people[:-1], replace(people[-1], enters=40, leaves=55))
    ties = (Interaction(3, WALKING_TOGETHER, 4),)
    return replace(room(people, rules=RULES), groups=(Group(1, "walking", (3, 4)),), interactions=ties)


def looks(scene: Scene, controller: s2.Controller | None = None) -> list[Snapshot]:
    episode, seen = Episode(scene, controller or Idle()), []
    while episode.outcome is None:
        seen.append(episode.look())
        episode.step()
    return seen


class Idle(s2.Controller):
    def act(self, snapshot: Snapshot) -> s2.Twist:
        return s2.Twist()


def test_a_snapshot_shows_who_is_there_and_nobody_else() -> None:
    seen = looks(busy())
    assert seen[0].humans.id.tolist() == [1, 5]
    assert seen[0].interactions == ()
    assert seen[5].humans.id.tolist() == [1, 2, 5]
    assert seen[8].humans.id.tolist() == [1, 2, 3, 4, 5]
    assert seen[8].humans.row.tolist() == [0, 1, 2, 3, 4]
    assert seen[8].interactions == busy().interactions
    assert {tick for tick, look in enumerate(seen) if 2 in look.humans.id} == set(range(5, 30))
    assert {tick for tick, look in enumerate(seen) if 6 in look.humans.id} == set(range(40, 55))
    assert all(np.abs(look.humans.position).max() < 4.0 for look in seen)


def test_who_leaves_at_their_goal_is_gone_when_they_reach_it() -> None:
    seen = looks(room([passer(1, (0.0, 3.0), (0.0, -3.0))], rules=RULES))
    there = [len(look.humans) for look in seen]
    assert there == sorted(there, reverse=True)
    last = next(look for look in reversed(seen) if len(look.humans))
    assert last.humans.position[0] == pytest.approx((0.0, -2.5), abs=0.15)
    assert np.hypot(*last.humans.velocity[0]) > 1.0  # nobody slows down to leave


def test_who_is_recorded_is_where_their_track_says_whoever_is_in_the_way() -> None:
    crowd = [walker(k, -1.0 + 0.5 * k, 0.1, math.pi) for k in range(2, 6)]
    seen = looks(room([recorded(1, enters=3), *crowd], robot=Pose(-2.0, 0.0), rules=RULES))
    for tick, look in enumerate(seen):
        if 1 in look.humans.id:
            assert look.humans.position[0] == pytest.approx(ALONG[min(tick - 3, 39)], abs=1e-12)
        assert np.abs(look.humans.velocity).max() < 3.0  # shoved, not shot
        assert np.abs(look.robot.velocity).max() < 2.0
    assert np.hypot(*(np.array(seen[-1].robot.position) - (-2.0, 0.0))) > 0.1  # it stood in the way
    assert any(contact.other_at_fault for look in seen for contact in look.contacts)


def test_velocity_of_who_is_recorded_is_that_of_the_track() -> None:
    seen = looks(room([recorded(1, enters=3)], rules=RULES))
    assert seen[3].humans.velocity[0] == pytest.approx((np.array(ALONG[1]) - ALONG[0]) / 0.1)
    assert seen[20].humans.velocity[0] == pytest.approx((np.array(ALONG[17]) - ALONG[16]) / 0.1)
    assert seen[20].humans[0].pose.theta == pytest.approx(math.atan2(*(np.array(ALONG[17]) - ALONG[16])[::-1]), abs=0.1)
    assert seen[55].humans.velocity[0] == pytest.approx((0.0, 0.0))  # they stay at the end


def test_whoever_is_absent_is_felt_by_nobody() -> None:
    people = [walker(k, k - 2.0, 0.5 * k) for k in range(1, 4)]
    ghosts = [replace(walker(9, 0.0, 0.0), enters=1000), replace(recorded(8), enters=1000)]
    alone, haunted = (looks(room([*people, *more], rules=RULES), s2.SocialForce()) for more in ([], ghosts))
    for one, other in zip(alone, haunted, strict=True):
        assert one.humans.state.tolist() == other.humans.state.tolist()
        assert one.robot.pose == other.robot.pose


def test_nobody_turns_to_or_talks_with_a_partner_who_is_absent() -> None:
    pair = [Human(1, Pose(0.0, 0.0), 0.2, group=1), Human(2, Pose(1.2, 0.0, 3.0), 0.2, group=1, enters=10, leaves=30)]
    ties, own = (Interaction(1, TALKING, 2),), (Group(1, "talking", (1, 2)),)
    turned = [replace(pair[0], pose=Pose(0.0, 0.0, 1.0)), pair[1]]
    seen = looks(room(turned, rules=RULES, groups=own, interactions=ties))
    doing = [look.humans[0].activity for look in seen]
    assert doing == ["talking" if look.interactions else "standing" for look in seen]
    assert [bool(look.interactions) for look in seen] == [10 <= tick < 30 for tick in range(len(seen))]
    assert seen[10].humans[0].pose.theta == pytest.approx(1.0)
    assert seen[30].humans[0].pose.theta == pytest.approx(0.0, abs=0.1)
    assert seen[-1].humans[0].pose.theta == pytest.approx(1.0, abs=0.05)  # as they stood before


@pytest.mark.parametrize("leader", [recorded(1, group=1), passer(1, (0.0, 3.0), (0.0, 0.0), group=1)])
def test_whoever_follows_one_who_has_no_way_or_is_gone_goes_their_own(leader: Human) -> None:
    follower = walker(2, 1.0, 2.0, group=1)
    seen = looks(room([leader, follower], rules=RULES, groups=(Group(1, "walking", (1, 2)),)))
    ways = np.array([look.humans.position[-1] for look in seen])
    assert np.abs(ways).max() < 4.0
    assert np.hypot(*(ways[-1] - ways[-21])) > 0.5


def test_who_finds_no_room_to_enter_waits() -> None:
    def scene(robot: Pose) -> Scene:
        return room([passer(1, (0.0, 3.0), (0.0, -3.0), enters=10)], robot=robot, rules=RULES)

    assert len(looks(scene(Pose(-3.0, 0.0)))[10].humans) == 1
    assert all(len(look.humans) == 0 for look in looks(scene(Pose(0.0, 3.0))))  # the robot stays there
    twins = [passer(k, (0.0, 3.0), (0.0, -3.0), enters=10) for k in (1, 2)]
    seen = looks(room(twins, rules=RULES))
    assert [len(seen[tick].humans) for tick in (9, 10)] == [0, 1]
    come = next(look for look in seen if len(look.humans) == 2)
    assert np.hypot(*(come.humans.position[0] - come.humans.position[1])) > 0.4 - ENTRY_OVERLAP - 1e-9


@pytest.mark.parametrize("controller", [s2.StraightToGoal, s2.SocialForce, s2.SocialPlanner])
def test_every_controller_drives_among_people_who_come_and_go(controller: type[s2.Controller], tmp_path: Path) -> None:
    path = tmp_path / "one.json"
    with JsonRecorder(path) as recorder:
        Episode(busy(), controller(), observers=[recorder]).run()
    record = read_episode(path)
    assert check_episode(path) == []
    assert check_replay(path) == []
    assert record.scene() == busy()
    assert record.present[:, 1].tolist() == [5 <= tick < 30 for tick in range(len(record))]
    assert np.isnan(record.humans[0, 1]).all()


def test_a_room_may_be_empty_for_a_while(tmp_path: Path) -> None:
    for controller in (s2.SocialForce(), s2.SocialPlanner()):
        scene = room([recorded(1, enters=10, leaves=20)], rules=Rules(time_limit=3.0))
        counts = [len(look.humans) for look in looks(scene, controller)]
        assert counts == [0] * 10 + [1] * 10 + [0] * 11


def test_ways_have_gaps_where_people_were_away() -> None:
    trails = Trails.of(looks(busy()))
    assert trails.humans.shape[1] == 6
    assert np.isnan(trails.humans[0, 1]).all()
    assert np.isfinite(trails.humans[:, 0]).all()


def test_a_mirrored_scene_moves_as_the_mirror_image() -> None:
    def image(human: Human) -> Human:
        x, y, theta = human.pose.x, human.pose.y, human.pose.theta
        return replace(
            human,
            pose=Pose(x, -y, -theta),
            velocity=(human.velocity[0], -human.velocity[1]),
            goals=tuple((x, -y) for x, y in human.goals),
            track=tuple((x, -y) for x, y in human.track),
        )

    scene = busy()
    people = tuple(human for human in scene.humans if human.behaviour != "wandering")  # they draw places
    scene = replace(scene, humans=people)
    twin = replace(scene, humans=tuple(map(image, people)), rules=replace(RULES, side=-1))
    for one, other in zip(looks(scene), looks(twin), strict=True):
        assert one.humans.id.tolist() == other.humans.id.tolist()
        assert one.humans.position * (1.0, -1.0) == pytest.approx(other.humans.position, abs=1e-6)


def test_who_is_recorded_needs_a_track() -> None:
    with pytest.raises(ValueError, match="human 1 is recorded, but has no track"):
        looks(room([Human(1, Pose(0.0, 0.0), 0.2, behaviour="recorded")]))


def test_the_robot_feels_who_is_recorded_however_fast_they_are() -> None:
    dash = tuple((round(-3.5 + 0.5 * k, 4), 0.0) for k in range(14))  # 5 m/s
    scene = room([recorded(1, dash)], robot=Pose(3.0, 0.0), rules=replace(RULES, time_limit=2.0))
    seen = looks(replace(scene, robot=replace(Robot(Pose(3.0, 0.0)), radius=0.3)))
    assert any(look.contacts for look in seen)


def test_between_two_looks_are_those_who_are_in_both() -> None:
    seen = looks(busy())
    before, after = seen[4], seen[5]  # one comes in
    middle = between(before, after, 0.5)
    assert middle.humans.id.tolist() == [1, 5]
    assert middle.humans.row.tolist() == [0, 4]
    places = before.humans.position + after.humans.position[[0, 2]]
    assert middle.humans.position == pytest.approx(places / 2)


def test_files_from_before_people_came_and_went_are_read(tmp_path: Path) -> None:
    path = tmp_path / "old.json"
    with JsonRecorder(path) as recorder:
        Episode(room([walker(1, 0.0, 0.0)], rules=RULES), Idle(), observers=[recorder]).run()
    document = json.loads(path.read_bytes())
    for key in ("enters", "leaves", "track", "exits", "goals", "velocity"):
        del document["humans"][0][key]
    path.write_text(json.dumps(document))
    assert read_episode(path).scene().humans == (walker(1, 0.0, 0.0),)


def test_what_the_robot_cost_is_measured_where_people_were_in_both_runs(tmp_path: Path) -> None:
    path = tmp_path / "one.json"
    with JsonRecorder(path) as recorder:
        Episode(busy(), s2.SocialForce(), observers=[recorder]).run()
    alone = without_robot(read_episode(path))
    assert alone is not None
    assert np.isnan(alone[0, 1]).all()
    assert np.isfinite(alone[10, 1]).all()
