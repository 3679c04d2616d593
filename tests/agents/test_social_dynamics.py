"""Social behaviour: pedestrians visit objects, talk, join, leave; every frame records it. F-formations."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import combinations, pairwise
from pathlib import Path

import numpy as np
import pytest

import sonata2d as s2
from sonata2d.agents.pedestrians.crowd import Crowd
from sonata2d.agents.pedestrians.crowd_state import CrowdState
from sonata2d.agents.pedestrians.social.company import start_walking
from sonata2d.agents.pedestrians.social.f_formations import CENTRE_X, MOST_POSITIONS, joining_positions, widened
from sonata2d.agents.pedestrians.wayfinding import update_obstacles
from sonata2d.core.entities import Formation, Furniture, Group, Human, Interaction
from sonata2d.core.geometry import Disc, Point, Pose, Rectangle, Twist, inside_polygon
from sonata2d.core.portable_math import Array
from sonata2d.core.relations import ACTIVITIES, AT_LAPTOP, AT_PLANT, TALKING
from sonata2d.core.scene import Scene, Social
from sonata2d.core.snapshot import Snapshot
from sonata2d.datasets.check.replay import check_replay
from sonata2d.record.reader import read_episode
from sonata2d.record.recorder import JsonRecorder
from sonata2d.scenegen.formations import talking_formation
from sonata2d.sim.world import World

from ..conftest import room, walker
from .test_crowd import positions, send_straight, simulate

CORNER = Pose(-3.5, -3.5)


def ticks_with(snapshots: list[Snapshot], relation: str) -> list[int]:
    """The ticks at which an interaction of a relation exists."""
    return [s.tick for s in snapshots if any(i.relation == relation for i in s.interactions)]


@pytest.fixture(scope="module")
def lively() -> list[list[Snapshot]]:
    """A minute each in four rooms with frequent social behaviour."""
    config = s2.load_scenario("lively").changed(rules={"time_limit": 60, "ends_on": []})
    return [simulate(s2.generate(config, seed), 60.0) for seed in range(4)]


def test_interactions_and_activities_agree_in_every_frame(lively: list[list[Snapshot]]) -> None:
    expected = {TALKING: "talking", AT_LAPTOP: "using", AT_PLANT: "looking"}
    changes = 0
    for snapshots in lively:
        changes += sum(before.interactions != after.interactions for before, after in pairwise(snapshots))
        for snapshot in snapshots:
            activity = {human.id: human.activity for human in snapshot.humans}
            for i in snapshot.interactions:
                assert activity[i.src] == expected.get(i.relation, activity[i.src])
            interacting = {end for i in snapshot.interactions for end in (i.src, i.dst)}
            alone = ("standing", "walking", "sitting")
            assert all(kind in alone for id, kind in activity.items() if id not in interacting)
    assert changes > 20


def test_all_members_of_a_group_talk_with_each_other(lively: list[list[Snapshot]]) -> None:
    for snapshot in (snapshot for snapshots in lively for snapshot in snapshots[::5]):
        pairs = {frozenset((i.src, i.dst)) for i in snapshot.interactions if i.relation == TALKING}
        assert len(pairs) == sum(i.relation == TALKING for i in snapshot.interactions)
        for a, b in combinations(pairs, 2):
            if a & b:
                assert a ^ b in pairs


def test_pedestrians_walk_to_their_positions_and_then_stand_still(lively: list[list[Snapshot]]) -> None:
    standing = [ACTIVITIES.index(kind) for kind in ("talking", "using", "looking")]
    for snapshots in lively:
        path = positions(snapshots)
        steps = np.linalg.norm(np.diff(path, axis=0), axis=2)
        assert steps.max() < 0.1 * 1.3 * 1.8 + 0.05
        stands = np.isin([s.humans.activity_index for s in snapshots], standing)
        for k in range(path.shape[1]):
            for t in range(0, len(snapshots) - 60, 10):
                if stands[t : t + 60, k].all():  # three seconds to settle, or to make room; then still
                    assert np.ptp(path[t + 30 : t + 60, k], axis=0).max() < 0.45


def test_positions_of_interactions_are_free_and_near_the_partner(lively: list[list[Snapshot]]) -> None:
    for snapshots in lively:
        scene = snapshots[0].scene
        objects = {thing.id: thing.pose.position for thing in scene.furniture}
        initial = {(i.src, i.dst) for i in scene.interactions}
        for snapshot in snapshots[::10]:
            humans = snapshot.humans
            sits = humans.activity_index == ACTIVITIES.index("sitting")
            assert (scene.barriers.gaps(humans.position[~sits]) > humans.radius[~sits] - 0.02).all()
            position = dict(zip(humans.id.tolist(), humans.position.tolist(), strict=True)) | objects
            for i in snapshot.interactions:
                if (i.src, i.dst) not in initial and i.relation != "wandering_human_interacting":
                    assert 0.4 < math.dist(position[i.src], position[i.dst]) < 3.6


def test_interactions_do_not_change_without_social_settings() -> None:
    snapshots = simulate(s2.generate(s2.load_scenario("sonata-2020"), 3), 20.0)
    assert {s.interactions for s in snapshots} == {snapshots[0].scene.interactions}


def test_a_wandering_pedestrian_visits_a_plant_and_leaves() -> None:
    plant = Furniture(9, "plant", Pose(0.0, 0.0), Disc(0.2))
    social = Social(visits=1.0, visit_time=(5.0, 5.0))
    snapshots = simulate(room([walker(1, -3.0, 2.0)], [plant], social=social, robot=CORNER, seed=2), 40.0)
    ticks = ticks_with(snapshots, AT_PLANT)
    visitor = snapshots[ticks[0] + 20].humans[0]
    assert visitor.activity == "looking"
    assert math.dist(visitor.pose.position, (0.0, 0.0)) == pytest.approx(0.7, abs=0.1)
    to_plant = math.atan2(-visitor.pose.y, -visitor.pose.x)
    assert abs(math.remainder(visitor.pose.theta - to_plant, math.tau)) < 0.15
    visits = np.split(np.array(ticks), np.flatnonzero(np.diff(ticks) > 1) + 1)
    assert len(visits) >= 2
    assert len(visits[0]) == 50


def test_a_pedestrian_uses_a_laptop_from_in_front_of_the_table() -> None:
    table = Furniture(9, "table", Pose(0.0, 2.0), Rectangle(0.8, 0.8))
    laptop = Furniture(10, "laptop", Pose(0.0, 2.0), Rectangle(0.35, 0.25), on=9)
    social = Social(visits=1.0, visit_time=(10.0, 10.0))
    snapshots = simulate(room([walker(1, -3.0, -2.0)], [table, laptop], social=social, robot=CORNER, seed=1), 30.0)
    x, y = snapshots[ticks_with(snapshots, AT_LAPTOP)[60]].humans.position[0]
    assert (x, y) == pytest.approx((0.0, 1.1), abs=0.1)


@pytest.mark.usefixtures("no_deviations")
def test_a_newcomer_completes_a_pair_to_a_circle() -> None:
    pair = [Human(1, Pose(-0.5, 1.0), 0.2), Human(2, Pose(0.5, 1.0), 0.2)]
    social = Social(joins=1.0, talk_time=(15.0, 15.0))
    interactions = (Interaction(1, TALKING, 2),)
    scene = room([*pair, walker(3, 0.0, -3.0)], interactions=interactions, social=social, robot=CORNER, seed=2)
    snapshots = simulate(scene, 29.0)
    circles = [s for s in snapshots if sum(i.relation == TALKING for i in s.interactions) == 3]
    assert len(circles) == 150
    position = circles[100].humans.position
    to_centre = position.mean(axis=0) - position
    radius = np.linalg.norm(to_centre, axis=1)
    assert radius == pytest.approx(np.full(3, 0.65), abs=0.15)
    assert ((to_centre * circles[100].humans.direction).sum(axis=1) / radius).min() > 0.95
    assert np.ptp([s.humans.head[2] for s in circles[40:]]) > 0.3  # looks from face to face
    after = snapshots[circles[-1].tick + 30]
    assert after.interactions == interactions
    assert after.humans[2].activity == "walking"


def test_a_pair_that_meets_stops_talks_and_parts() -> None:
    social = Social(meets=1.0, talk_time=(6.0, 6.0))
    scene = room([walker(1, -3.0, 0.0), walker(2, 3.0, 0.0, math.pi)], social=social, robot=CORNER)
    world, crowd, snapshots = World(scene), Crowd(scene), []
    for k, goal in ((0, (3.5, 0.0)), (1, (-3.5, 0.0))):
        send_straight(crowd, k, scene.humans[k].pose.position, goal)
    for _ in range(150):
        snapshots.append(world.snapshot())
        world.step(Twist(), crowd.act(snapshots[-1]))
    ticks = ticks_with(snapshots, TALKING)
    assert len(ticks) >= 60
    position = snapshots[ticks[30]].humans.position
    assert np.linalg.norm(position[0] - position[1]) == pytest.approx(1.0, abs=0.1)
    assert [h.activity for h in snapshots[ticks[30]].humans] == ["talking", "talking"]
    assert [h.activity for h in snapshots[ticks[0] + 70].humans] == ["walking", "walking"]


def test_a_partner_that_leaves_wanders_off() -> None:
    pair, interactions = [Human(1, Pose(0.0, 0.0), 0.2), Human(2, Pose(1.5, 0.0), 0.2)], (Interaction(1, TALKING, 2),)
    social = Social(leaves=1.0, talk_time=(5.0, 15.0))
    snapshots = simulate(room(pair, interactions=interactions, social=social, robot=CORNER, seed=1), 40.0)
    duration = len(ticks_with(snapshots, TALKING))
    assert 45 < duration < 155
    moved = [np.linalg.norm(s.humans.position - snapshots[0].humans.position, axis=1).max() for s in snapshots]
    assert max(moved) > 2.0
    assert max(moved[:duration]) < 0.1


def test_pedestrians_with_limited_presence_do_not_leave_their_positions() -> None:
    pair = [Human(1, Pose(0.0, 0.0), 0.2, leaves=150), Human(2, Pose(1.5, 0.0), 0.2, enters=60)]
    social = Social(leaves=1.0, talk_time=(2.0, 3.0))
    scene = room(pair, interactions=(Interaction(1, TALKING, 2),), social=social, robot=CORNER, seed=1)
    for snapshot in simulate(scene, 20.0):
        start = np.array([pair[id - 1].pose.position for id in snapshot.humans.id.tolist()])
        assert np.abs(snapshot.humans.position - start).max() < 0.05


def shared_edges(state: CrowdState) -> set[tuple[float, ...]]:
    """Start and end of the edges of the spaces inside groups, m."""
    update_obstacles(state.obstacles, state.doorways, state.robots, state.company, state.is_present, True)
    bodies, around = state.obstacles.passable.added, state.obstacles.space.added
    return {tuple(row[:4]) for row in around.table[bodies.used[0] : around.used[0]].tolist()}


def test_shared_space_shrinks_when_a_member_leaves() -> None:
    ring = [Human(k, Pose(math.cos(k), math.sin(k), k + math.pi), 0.2, group=1) for k in (0.5, 1.5, 2.5, 3.5)]
    ring = [replace(human, id=k) for k, human in enumerate(ring, 1)]
    scene = replace(room(ring, robot=CORNER), groups=(Group(1, "talking", (1, 2, 3, 4), "circle"),))
    state = Crowd(scene).state
    places = [human.pose.position for human in ring]
    assert shared_edges(state) == {(*a, *b) for a, b in pairwise([*places, places[0]])}
    start_walking(state.company, 1, state.is_present)
    assert len(shared_edges(state)) == 3
    assert scene.humans[1].pose.position not in {edge[:2] for edge in shared_edges(state)}


def test_a_lively_episode_gives_the_same_bytes_and_replays(tmp_path: Path) -> None:
    config = s2.load_scenario("lively").changed(rules={"time_limit": 80, "ends_on": ["time"]})
    scene, written = s2.generate(config, 5), []
    path = tmp_path / "one.json"
    for _ in range(2):
        with JsonRecorder(path) as recorder:
            s2.Episode(scene, s2.SocialPlanner(), observers=[recorder]).run()
        written.append(path.read_bytes())
    assert written[0] == written[1]
    record = read_episode(path)
    assert record.scene() == scene
    assert len({str(frame["interactions"]) for frame in record.document["frames"]}) > 2
    assert check_replay(read_episode(path)) == []


def test_others_walk_round_people_who_talk() -> None:
    pair = [Human(1, Pose(1.0, -0.6, math.pi / 2)), Human(2, Pose(1.0, 0.6, -math.pi / 2))]
    goes = walker(3, -1.0, 0.0, behaviour="walking", goals=((3.0, 0.0),))
    scene = room([*pair, goes], interactions=(Interaction(1, TALKING, 2),), social=Social(joins=0.1), robot=CORNER)
    path = np.array([s.humans.position[2] for s in simulate(scene, 8.0)])
    assert path[-1, 0] > 2.0
    assert abs(path[np.abs(path[:, 0] - 1.0).argmin(), 1]) > 0.6  # beside both


def test_a_conversation_that_has_grown_can_be_joined() -> None:
    ring = [(math.cos(a), math.sin(a), a + math.pi) for a in (0.0, 2.1, 4.2)]
    people = [Human(k, Pose(0.7 * x, 0.7 * y, theta)) for k, (x, y, theta) in enumerate(ring, 1)]
    talks = (Interaction(1, TALKING, 2), Interaction(1, TALKING, 3), Interaction(2, TALKING, 3))
    social = Social(joins=1.0, talk_time=(15.0, 15.0))
    scene = room([*people, walker(4, -3.0, 0.0)], interactions=talks, social=social, robot=CORNER)
    assert max(sum(i.relation == TALKING for i in s.interactions) for s in simulate(scene, 25.0)) == 6


# F-formations


def talking_group(
    formation: Formation, size: int, *, is_recorded: bool = True, others: tuple[Human, ...] = ()
) -> Scene:
    """A talking group around the origin; `is_recorded`: whether the scene names the formation."""
    poses = talking_formation(formation, size, 1.0).poses
    humans = tuple(Human(k, pose, group=1) for k, pose in enumerate(poses, 1))
    ids = tuple(human.id for human in humans)
    interactions = tuple(Interaction(a, TALKING, b) for a, b in combinations(ids, 2))
    group = Group(1, "talking", ids, formation if is_recorded else None)
    return room([*humans, *others], groups=(group,), interactions=interactions, robot=CORNER)


@pytest.mark.usefixtures("motionless")
@pytest.mark.parametrize(("formation", "size"), [("l", 2), ("side_by_side", 2), ("circle", 5), ("semicircle", 4)])
def test_members_of_a_named_formation_keep_it(formation: Formation, size: int) -> None:
    snapshots = simulate(talking_group(formation, size), 4.0)
    start, end = snapshots[0].humans, snapshots[-1].humans
    assert np.allclose(start.direction, end.direction, atol=1e-6)
    assert np.abs(start.position - end.position).max() < 0.02


@pytest.mark.usefixtures("motionless")
@pytest.mark.parametrize("size", [3, 4, 6])
def test_without_a_named_formation_members_turn_to_the_centre_of_the_others(size: int) -> None:
    scene = talking_group("circle", size, is_recorded=False)
    turned = tuple(replace(human, pose=replace(human.pose, theta=1.0)) for human in scene.humans)
    end = simulate(replace(scene, humans=turned), 3.0)[-1].humans
    for k, human in enumerate(end):
        others = np.delete(end.position, k, axis=0).mean(axis=0)
        ahead, left = human.pose.to_local((float(others[0]), float(others[1])))
        assert abs(math.atan2(left, ahead)) < 0.02


@pytest.mark.usefixtures("motionless")
def test_without_a_named_formation_a_pair_faces_each_other() -> None:
    end = simulate(talking_group("l", 2, is_recorded=False), 3.0)[-1].humans
    assert np.allclose(end.direction[0], -end.direction[1], atol=1e-2)


def test_walkers_go_round_a_talking_group() -> None:
    passing = replace(walker(9, -3.0, 0.1), behaviour="walking", goals=((3.0, 0.1),), desired_speed=1.3)
    path = positions(simulate(talking_group("circle", 6, others=(passing,)), 8.0))
    assert not inside_polygon(path[:, 6], path[0, :6]).any()
    assert path[-1, 6] == pytest.approx((3.0, 0.1), abs=0.6)


def best_position(members: list[Point], newcomer: Point) -> Array:
    """Centre and position that are offered first."""
    ranked = np.empty((MOST_POSITIONS, 6))
    assert joining_positions(np.array(members), 0.0, 0.0, *newcomer, ranked) > 0
    return ranked[0, CENTRE_X:]


def test_the_widest_gap_of_a_formation_is_offered_first_and_mirrors() -> None:
    members = [(0.7, 0.0), (0.0, 0.7), (-0.7, 0.0)]
    best = best_position(members, (0.5, -3.0))
    assert best[3] < -0.5
    mirrored = best_position([(x, -y) for x, y in members], (0.5, 3.0))
    assert mirrored == pytest.approx(best * (1.0, -1.0, 1.0, -1.0))


def test_a_formation_widens_but_never_shrinks() -> None:
    assert widened(0.6, 0.0, 0.0, 0.0, 5) == pytest.approx((0.85, 0.0))
    assert widened(1.5, 0.0, 0.0, 0.0, 3) == (1.5, 0.0)
