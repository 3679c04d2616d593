"""Social life: people take up things and talks, join, part and leave, and every frame says so."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import combinations, pairwise
from pathlib import Path

import numpy as np
import pytest

import sonata2d as s2
from sonata2d.agents.pedestrians.crowd import Crowd
from sonata2d.agents.pedestrians.social.f_formations import free_places, widened
from sonata2d.agents.pedestrians.social.state import SocialState
from sonata2d.core.entities import AT_LAPTOP, AT_PLANT, TALKING, Furniture, Group, Human, Interaction
from sonata2d.core.geometry import Disc, Pose, Rectangle, Twist
from sonata2d.core.humans import ACTIVITIES
from sonata2d.core.scene import Social
from sonata2d.core.snapshot import Snapshot
from sonata2d.datasets.replay import check_replay
from sonata2d.record.reader import read_episode
from sonata2d.record.recorder import JsonRecorder
from sonata2d.sim.world import World

from ..conftest import room, walker
from .test_crowd import watched

CORNER = Pose(-3.5, -3.5)


def when(seen: list[Snapshot], relation: str) -> list[int]:
    """The ticks at which somebody is in a relation."""
    return [s.tick for s in seen if any(tie.relation == relation for tie in s.interactions)]


@pytest.fixture(scope="module")
def lively() -> list[list[Snapshot]]:
    """A minute in each of some rooms where much happens."""
    config = s2.load_scenario("lively").changed(rules={"time_limit": 60, "ends_on": []})
    return [watched(s2.generate(config, seed), 60.0) for seed in range(4)]


def test_ties_and_activities_agree_in_every_frame(lively: list[list[Snapshot]]) -> None:
    kinds = {TALKING: "talking", AT_LAPTOP: "using", AT_PLANT: "looking"}
    changes = 0
    for seen in lively:
        for before, after in pairwise(seen):
            changes += before.interactions != after.interactions
        for snapshot in seen:
            doing = {human.id: human.activity for human in snapshot.humans}
            for tie in snapshot.interactions:
                assert doing[tie.src] == kinds.get(tie.relation, doing[tie.src])
            tied = {end for tie in snapshot.interactions for end in (tie.src, tie.dst)}
            assert all(kind in ("standing", "walking") for id, kind in doing.items() if id not in tied)
    assert changes > 20


def test_who_talks_talks_with_everybody_in_the_circle(lively: list[list[Snapshot]]) -> None:
    for snapshot in (snapshot for seen in lively for snapshot in seen[::5]):
        pairs = {frozenset((tie.src, tie.dst)) for tie in snapshot.interactions if tie.relation == TALKING}
        assert len(pairs) == sum(tie.relation == TALKING for tie in snapshot.interactions)
        for one, other in combinations(pairs, 2):
            if one & other:
                assert one ^ other in pairs


def test_everybody_walks_to_their_place_and_then_stays_there(lively: list[list[Snapshot]]) -> None:
    standing = [ACTIVITIES.index(kind) for kind in ("talking", "using", "looking")]
    for seen in lively:
        place = np.array([s.humans.position for s in seen])
        steps = np.linalg.norm(np.diff(place, axis=0), axis=2)
        assert steps.max() < 0.1 * 1.3 * 1.8 + 0.05
        stays = np.isin([s.humans.activity_index for s in seen], standing)
        for k in range(place.shape[1]):
            for t in range(0, len(seen) - 60, 10):
                if stays[t : t + 60, k].all():  # three seconds to settle, or to make room; then still
                    assert np.ptp(place[t + 30 : t + 60, k], axis=0).max() < 0.45


def test_places_are_free_and_in_reach(lively: list[list[Snapshot]]) -> None:
    for seen in lively:
        scene = seen[0].scene
        things = {thing.id: thing.pose.position for thing in scene.furniture}
        began = {(tie.src, tie.dst) for tie in scene.interactions}
        for snapshot in seen[::10]:
            assert (scene.barriers.gaps(snapshot.humans.position) > snapshot.humans.radius - 0.02).all()
            place = dict(zip(snapshot.humans.id.tolist(), snapshot.humans.position.tolist(), strict=True)) | things
            for tie in snapshot.interactions:
                if (tie.src, tie.dst) not in began and tie.relation != "wandering_human_interacting":
                    apart = math.dist(place[tie.src], place[tie.dst])
                    assert 0.45 < apart < 3.6


def test_nothing_changes_unless_asked_for() -> None:
    seen = watched(s2.generate(s2.load_scenario("sonata-2020"), 3), 20.0)
    assert {s.interactions for s in seen} == {seen[0].scene.interactions}


def test_a_wanderer_visits_a_plant_attends_to_it_and_goes_on() -> None:
    plant = Furniture(9, "plant", Pose(0.0, 0.0), Disc(0.2))
    social = Social(visits=1.0, visit_time=(5.0, 5.0))
    seen = watched(room([walker(1, -3.0, 2.0)], [plant], social=social, robot=CORNER, seed=2), 40.0)
    there = when(seen, AT_PLANT)
    first = seen[there[0] + 20].humans[0]
    assert first.activity == "looking"
    assert math.dist(first.pose.position, (0.0, 0.0)) == pytest.approx(0.85, abs=0.1)
    to_plant = math.atan2(-first.pose.y, -first.pose.x)
    assert abs(math.remainder(first.pose.theta - to_plant, math.tau)) < 0.15
    spells = np.split(np.array(there), np.flatnonzero(np.diff(there) > 1) + 1)
    assert len(spells) >= 2
    assert len(spells[0]) == 50


def test_who_uses_a_laptop_stands_before_the_table() -> None:
    table = Furniture(9, "table", Pose(0.0, 2.0), Rectangle(0.8, 0.8))
    laptop = Furniture(10, "laptop", Pose(0.0, 2.0), Rectangle(0.35, 0.25), on=9)
    social = Social(visits=1.0, visit_time=(10.0, 10.0))
    seen = watched(room([walker(1, -3.0, -2.0)], [table, laptop], social=social, robot=CORNER, seed=1), 30.0)
    x, y = seen[when(seen, AT_LAPTOP)[60]].humans.position[0]
    assert (x, y) == pytest.approx((0.0, 0.95), abs=0.1)


def test_a_comer_takes_the_free_place_of_a_pair_and_they_make_a_circle() -> None:
    pair = [Human(1, Pose(-0.5, 1.0), 0.2), Human(2, Pose(0.5, 1.0), 0.2)]
    social = Social(joins=1.0, talk_time=(15.0, 15.0))
    ties = (Interaction(1, TALKING, 2),)
    seen = watched(room([*pair, walker(3, 0.0, -3.0)], interactions=ties, social=social, robot=CORNER, seed=1), 30.0)
    threes = [s for s in seen if sum(tie.relation == TALKING for tie in s.interactions) == 3]
    assert len(threes) == 150
    place = threes[100].humans.position
    middle = place.mean(axis=0)
    assert np.linalg.norm(place - middle, axis=1) == pytest.approx(np.full(3, 0.65), abs=0.15)
    facing = ((middle - place) * threes[100].humans.direction).sum(axis=1) / np.linalg.norm(place - middle, axis=1)
    assert facing.min() > 0.95
    heads = np.array([s.humans.head[2] for s in threes[40:]])
    assert np.ptp(heads) > 0.3  # from face to face
    after = seen[threes[-1].tick + 30]
    assert after.interactions == ties
    assert after.humans[2].activity == "walking"


def test_two_who_meet_stop_talk_and_part() -> None:
    social = Social(meets=1.0, talk_time=(6.0, 6.0))
    people = [walker(1, -3.0, 0.0), walker(2, 3.0, 0.0, math.pi)]
    scene = room(people, social=social, robot=CORNER)
    world, crowd, seen = World(scene), Crowd(scene), []
    for k, goal in ((0, (3.5, 0.0)), (1, (-3.5, 0.0))):
        crowd._wanderers._ways[k] = np.array([scene.humans[k].pose.position, goal])
        crowd._wanderers._next[k] = 1
    for _ in range(150):
        seen.append(world.snapshot())
        world.step(Twist(), crowd.act(seen[-1]))
    talk = when(seen, TALKING)
    assert len(talk) >= 60
    place = seen[talk[30]].humans.position
    assert np.linalg.norm(place[0] - place[1]) == pytest.approx(1.2, abs=0.1)
    assert [h.activity for h in seen[talk[30]].humans] == ["talking", "talking"]
    assert [h.activity for h in seen[talk[0] + 70].humans] == ["walking", "walking"]


def test_who_is_to_leave_leaves_and_wanders_and_the_other_stays() -> None:
    pair, ties = [Human(1, Pose(0.0, 0.0), 0.2), Human(2, Pose(1.5, 0.0), 0.2)], (Interaction(1, TALKING, 2),)
    social = Social(leaves=1.0, talk_time=(5.0, 15.0))
    seen = watched(room(pair, interactions=ties, social=social, robot=CORNER, seed=1), 40.0)
    assert 45 < len(when(seen, TALKING)) < 155
    far = [np.linalg.norm(s.humans.position - seen[0].humans.position, axis=1).max() for s in seen]
    assert max(far) > 2.0
    assert max(far[: len(when(seen, TALKING))]) < 0.1


def test_who_comes_later_or_is_to_go_takes_up_nothing() -> None:
    pair = [Human(1, Pose(0.0, 0.0), 0.2, leaves=150), Human(2, Pose(1.5, 0.0), 0.2, enters=60)]
    social = Social(leaves=1.0, talk_time=(2.0, 3.0))
    seen = watched(room(pair, interactions=(Interaction(1, TALKING, 2),), social=social, robot=CORNER, seed=1), 20.0)
    for snapshot in seen:
        home = np.array([pair[id - 1].pose.position for id in snapshot.humans.id.tolist()])
        assert np.abs(snapshot.humans.position - home).max() < 0.05


def test_ways_no_longer_lead_round_what_a_group_shared_once_it_has_broken_up() -> None:
    ring = [Human(k, Pose(math.cos(k), math.sin(k), k + math.pi), 0.2, group=1) for k in (0.5, 1.5, 2.5, 3.5)]
    ring = [replace(human, id=k) for k, human in enumerate(ring, 1)]
    scene = replace(room(ring, robot=CORNER), groups=(Group(1, "talking", (1, 2, 3, 4), "circle"),))
    social = SocialState(scene)
    assert social.shared().start.tolist() == scene.shared.start.tolist()
    social.walk(1)
    assert len(social.shared()) == 3
    assert scene.humans[1].pose.position not in map(tuple, social.shared().start.tolist())


def test_a_lively_episode_is_the_same_again_and_its_file_proves_it(tmp_path: Path) -> None:
    config = s2.load_scenario("lively").changed(rules={"time_limit": 25, "ends_on": ["time"]})
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
    assert check_replay(path) == []


def test_the_widest_gap_of_a_circle_is_offered_first_and_mirrored() -> None:
    homes = [(0.7, 0.0), (0.0, 0.7), (-0.7, 0.0)]
    (centre, place), *_ = free_places(homes, (0.0, 0.0), (0.5, -3.0))
    assert place[1] < -0.5
    mirrored = free_places([(x, -y) for x, y in homes], (0.0, 0.0), (0.5, 3.0))[0]
    assert mirrored == (pytest.approx((centre[0], -centre[1])), pytest.approx((place[0], -place[1])))


def test_a_circle_widens_but_never_shrinks() -> None:
    assert widened((0.6, 0.0), (0.0, 0.0), 5) == pytest.approx((0.85, 0.0))
    assert widened((1.5, 0.0), (0.0, 0.0), 3) == (1.5, 0.0)
