"""Stops and via points of people on their way, times before they walk or react, and ways round a queue."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import sonata2d as s2
from sonata2d.agents.pedestrians.crowd import Crowd
from sonata2d.core.entities import Group, Human, Wall
from sonata2d.core.geometry import Pose, Twist
from sonata2d.core.portable_math import Array, BoolArray
from sonata2d.core.scene import Scene, Social
from sonata2d.sim.world import World

from ..conftest import room, walker

HALL = ((-30.0, -30.0), (30.0, -30.0), (30.0, 30.0), (-30.0, 30.0))
CORNER = Pose(-28.0, -28.0)
PER_SECOND = 10  # ticks


def tracks(scene: Scene, seconds: float) -> tuple[Array, BoolArray]:
    """Positions (T, N, 2), m, and whether each person walks, (T, N), while the robot stands."""
    world, crowd, places, walks = World(scene), Crowd(scene), [], []
    for _ in range(round(seconds * PER_SECOND)):
        snapshot = world.snapshot()
        places.append(snapshot.state.humans[:, :2].copy())
        world.step(Twist(), crowd.act(snapshot))
        walks.append(crowd.state.company.is_walking.copy())
    return np.array(places), np.array(walks)


def crossing(count: int, **fields: object) -> list[Human]:
    """People beside each other, 4 m apart, who walk 50 m to the right."""
    ys = [4.0 * k - 2.0 * (count - 1) for k in range(count)]
    return [walker(k + 1, -25.0, y, behaviour="walking", goals=((25.0, y),), **fields) for k, y in enumerate(ys)]


def stops_of(walks: BoolArray) -> list[tuple[int, int]]:
    """First tick and length of each time of standing between two times of walking."""
    found = []
    for own in walks.T:
        edges = np.flatnonzero(np.diff(own.astype(int)))
        pairs = zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True)
        found += [(start + 1, end - start) for start, end in pairs if not own[start + 1]]
    return found


def test_people_stop_at_the_given_rate_for_the_given_times_and_go_on() -> None:
    social = Social(stops=2.0, stop_time=(2.0, 10.0))
    track, walks = tracks(room(crossing(10), polygon=HALL, robot=CORNER, social=social, seed=3), 110.0)
    durations = np.array([length for _, length in stops_of(walks)]) / PER_SECOND
    expected = 2.0 * walks.sum() / PER_SECOND / 60.0
    assert 0.6 * expected < len(durations) < 1.4 * expected
    assert durations.min() >= 2.0
    assert durations.max() <= 10.7
    assert np.median(durations) == pytest.approx(2.0 + 8.0 / 8.0 + 0.5, abs=1.0)
    assert (track[-1, :, 0] > 24.0).all()


def test_nobody_stops_at_walls_or_beside_strangers() -> None:
    walls = [Wall((-30.0, y), (30.0, y)) for y in (-1.4, 1.4)]
    people = [
        walker(k + 1, -25.0 + 1.5 * k, 0.8 - 0.8 * (k % 3), behaviour="walking", goals=((25.0, 0.0),))
        for k in range(10)
    ]
    social = Social(stops=6.0, stop_time=(1.0, 4.0))
    scene = room(people, inner=walls, polygon=HALL, robot=CORNER, social=social, seed=1)
    track, walks = tracks(scene, 60.0)
    begun = [(t, k) for k in range(10) for t in np.flatnonzero(np.diff(walks[:, k].astype(int)) < 0) + 1]
    begun = [(t, k) for t, k in begun if track[t, k, 0] < 22.0]
    assert len(begun) > 10
    for tick, k in begun:
        later = min(tick + 10, len(track) - 1)
        assert 1.4 - abs(track[later, k, 1]) > 0.5
        others = np.delete(track[tick], k, axis=0)[~np.delete(walks[tick], k)]
        assert len(others) == 0 or np.hypot(*(others - track[later, k]).T).min() > 0.5


def test_a_group_stops_together() -> None:
    pair = [walker(k, -25.0, 0.8 * k, group=7, behaviour="walking", goals=((25.0, 0.8 * k),)) for k in (1, 2)]
    groups = (Group(7, "walking", (1, 2)),)
    social = Social(stops=4.0, stop_time=(3.0, 8.0))
    scene = room(pair, polygon=HALL, robot=CORNER, social=social, groups=groups, seed=2)
    track, walks = tracks(scene, 90.0)
    assert len(stops_of(walks)) >= 4
    assert (walks[:, 0] == walks[:, 1]).mean() > 0.9
    assert np.hypot(*(track[:, 0] - track[:, 1]).T).max() < 2.5


def test_the_largest_distances_from_the_straight_way_have_the_given_deviation() -> None:
    ratios = []
    for seed in range(6):
        scene = room(crossing(10), polygon=HALL, robot=CORNER, social=Social(detours=0.12), seed=seed)
        track, _ = tracks(scene, 60.0)
        off = track[:, :, 1] - track[0, :, 1]
        ratios += [own[np.abs(own).argmax()] / 50.0 for own in off.T]
    assert np.std(ratios) == pytest.approx(0.12, rel=0.25)
    assert abs(np.mean(ratios)) < 0.04


def test_a_group_shares_its_via_points() -> None:
    pair = [walker(k, -25.0, 0.8 * k, group=7, behaviour="walking", goals=((25.0, 0.8 * k),)) for k in (1, 2)]
    groups, farthest = (Group(7, "walking", (1, 2)),), 0.0
    for seed in range(3):
        scene = room(pair, polygon=HALL, robot=CORNER, social=Social(detours=0.2), groups=groups, seed=seed)
        track, _ = tracks(scene, 40.0)
        farthest = max(farthest, float(np.abs(track[:, :, 1] - track[0, :, 1]).max()))
        assert np.hypot(*(track[:, 0] - track[:, 1]).T).max() < 2.0
    assert farthest > 4.0


def test_pre_movement_and_reaction_times_are_given_or_drawn() -> None:
    config = s2.load_scenario("empty").changed(
        wandering=6, person={"pre_movement": [2.0, 6.0], "reaction_time": [0.2, 0.5]}
    )
    drawn = s2.generate(config, seed=1).humans
    assert len({human.pre_movement for human in drawn}) == 6
    assert all(2.0 <= h.pre_movement <= 6.0 and 0.2 <= h.reaction_time <= 0.5 for h in drawn)
    given = config.changed(
        wandering=0,
        people=[
            {"x": 0, "y": 0, "goals": [[1, 1]], "pre_movement": [3, 3], "reaction_time": [1, 1]},
            {"x": 1, "y": 0, "goals": [[1, 1]], "enters": 2.0},
        ],
    )
    times = [(human.pre_movement, human.reaction_time) for human in s2.generate(given, seed=1).humans]
    assert times[0] == (3.0, 1.0)
    assert times[1][0] == 0.0  # one that enters later walks at once


def test_a_person_stands_for_its_pre_movement_time() -> None:
    people = crossing(3)
    people = [replace(human, pre_movement=time) for human, time in zip(people, (0.0, 2.0, 5.0), strict=True)]
    track, walks = tracks(room(people, polygon=HALL, robot=CORNER), 20.0)
    assert [int(own.argmax()) / PER_SECOND for own in walks.T] == pytest.approx([0.0, 2.0, 5.0], abs=0.15)
    assert np.abs(track[:19, 1] - track[0, 1]).max() < 0.15


def test_a_reaction_to_the_robot_comes_after_the_reaction_time() -> None:
    def first_notice(time: float) -> int:
        human = replace(walker(1, 6.0, 0.0, np.pi), behaviour="walking", goals=((-6.0, 0.0),), reaction_time=time)
        scene = room([human], polygon=HALL, robot=Pose(-2.0, 0.0))
        world, crowd = World(scene), Crowd(scene)
        for tick in range(100):
            world.step(Twist(0.5), crowd.act(world.snapshot()))
            if crowd.state.reactions.notices[0]:
                return tick
        return 100

    without = first_notice(0.0)
    assert [first_notice(time) - without for time in (0.1, 0.3, 0.8, 1.0)] == [1, 3, 8, 10]


def test_people_with_goals_who_meet_talk_and_go_on() -> None:
    people = [
        walker(1, -6.0, 0.0, behaviour="walking", goals=((6.0, 0.0),)),
        walker(2, 6.0, 0.3, np.pi, behaviour="walking", goals=((-6.0, 0.3),)),
    ]
    scene = room(people, polygon=HALL, robot=CORNER, social=Social(meets=1.0, talk_time=(4.0, 4.0)))
    track, walks = tracks(scene, 30.0)
    assert [length for _, length in stops_of(walks)] == pytest.approx([40, 40], abs=2)
    assert track[-1, 0] == pytest.approx((6.0, 0.0), abs=0.8)
    assert track[-1, 1] == pytest.approx((-6.0, 0.3), abs=0.8)


def test_a_crowd_before_a_door_divides_over_two_of_them() -> None:
    walls = [
        Wall((-10.0, 0.0), (-5.4, 0.0)), Wall((-4.6, 0.0), (2.6, 0.0)), Wall((3.4, 0.0), (10.0, 0.0)),
        Wall((-10.0, 0.0), (-10.0, 10.0)), Wall((10.0, 0.0), (10.0, 10.0)), Wall((-10.0, 10.0), (10.0, 10.0)),
    ]  # fmt: skip
    people = [
        walker(k + 1, -8.0 + 0.7 * (k % 8), 2.0 + 0.7 * (k // 8), behaviour="walking", goals=((-5.0, -12.0),))
        for k in range(40)
    ]
    track, _ = tracks(room(people, inner=walls, polygon=HALL, robot=CORNER, seed=1), 60.0)
    is_out = track[:, :, 1] < 0.0
    assert is_out.any(axis=0).all()
    places = track[is_out.argmax(axis=0), np.arange(40), 0]
    assert 4 <= (places > 0.0).sum() < 20


def test_a_few_people_before_a_door_take_the_nearest() -> None:
    walls = [Wall((-30.0, 0.0), (-5.4, 0.0)), Wall((-4.6, 0.0), (2.6, 0.0)), Wall((3.4, 0.0), (30.0, 0.0))]
    people = [walker(k + 1, -6.0 + k, 3.0, behaviour="walking", goals=((-5.0, -12.0),)) for k in range(3)]
    track, _ = tracks(room(people, inner=walls, polygon=HALL, robot=CORNER, seed=1), 20.0)
    places = track[(track[:, :, 1] < 0.0).argmax(axis=0), np.arange(3), 0]
    assert (places < 0.0).all()


def test_wandering_people_stand_apart_from_strangers_and_do_not_face_walls() -> None:
    people = [walker(k + 1, -3.0 + 1.2 * (k % 5), -2.0 + 2.0 * (k // 5)) for k in range(10)]
    scene = room(people, robot=Pose(-3.5, -3.5), social=Social(pause=(2.0, 5.0)), seed=4)
    world, crowd, found = World(scene), Crowd(scene), []
    for _ in range(600):
        snapshot = world.snapshot()
        was_walking = crowd.state.company.is_walking.copy()
        world.step(Twist(), crowd.act(snapshot))
        company = crowd.state.company
        for k in np.flatnonzero(was_walking & ~company.is_walking):
            place, faced = company.standing_position[k], company.facing_point[k]
            others = [j for j in range(10) if j != k and not company.is_walking[j]]
            gap = min((float(np.hypot(*(company.standing_position[j] - place))) for j in others), default=9.0)
            ahead = (faced - place) / np.hypot(*(faced - place))
            found.append((gap, 4.0 - np.abs(place).max(), float(np.abs(place + 0.6 * ahead).max())))
    gaps, walls, faced_walls = np.array(found).T
    assert len(found) > 20
    assert (gaps > 0.6).mean() > 0.95
    assert (faced_walls < 4.0).all()
    assert np.median(walls) > 0.65


def test_a_via_point_on_which_a_robot_stands_is_given_up() -> None:
    human = walker(1, -6.0, 0.0, behaviour="walking", goals=((6.0, 0.0),))
    for seed in range(4):
        scene = room([human], polygon=HALL, robot=Pose(0.0, -10.0), social=Social(detours=0.3), seed=seed)
        world, crowd = World(scene), Crowd(scene)
        crowd.act(world.snapshot())
        via = crowd.state.routes.destination[0].copy()
        scene = replace(scene, robot=replace(scene.robot, pose=Pose(*via.tolist())))
        track, _ = tracks(scene, 60.0)
        assert track[-1, 0] == pytest.approx((6.0, 0.0), abs=0.8)


def test_a_person_that_meets_another_as_it_enters_goes_to_its_goal_afterwards() -> None:
    people = [
        walker(1, -12.0, -8.0, behaviour="walking", goals=((20.0, -8.0),)),
        walker(2, -11.0, -8.5, behaviour="walking", goals=((-11.0, -25.0),), enters=6),
    ]
    scene = room(people, polygon=HALL, robot=CORNER, social=Social(meets=1.0, talk_time=(3.0, 3.0)))
    world, crowd = World(scene), Crowd(scene)
    for _ in range(300):
        world.step(Twist(), crowd.act(world.snapshot()))
        onward = crowd.state.routes.onward[1]
        assert np.isnan(onward).all() or onward == pytest.approx((-11.0, -25.0))


def test_members_of_a_group_stay_together_before_a_crowded_door() -> None:
    walls = [
        Wall((-10.0, 0.0), (-5.4, 0.0)), Wall((-4.6, 0.0), (2.6, 0.0)), Wall((3.4, 0.0), (10.0, 0.0)),
        Wall((-10.0, 0.0), (-10.0, 10.0)), Wall((10.0, 0.0), (10.0, 10.0)), Wall((-10.0, 10.0), (10.0, 10.0)),
    ]  # fmt: skip
    places = [(-8.0 + 0.7 * (k % 8), 2.0 + 0.7 * (k // 8)) for k in range(40)]
    people = [
        walker(k + 1, *place, behaviour="walking", goals=((-5.0, -12.0),), group=1 + k // 2)
        for k, place in enumerate(places)
    ]
    groups = tuple(Group(1 + k, "walking", (2 * k + 1, 2 * k + 2)) for k in range(20))
    track, _ = tracks(room(people, inner=walls, polygon=HALL, robot=CORNER, seed=1, groups=groups), 60.0)
    is_out = track[:, :, 1] < 0.0
    by_right = track[is_out.argmax(axis=0), np.arange(40), 0] > 0.0
    assert (by_right[::2] == by_right[1::2]).all()


def test_a_group_has_via_points_on_every_leg() -> None:
    goals = ((-10.0, 0.0), (5.0, 0.0), (20.0, 0.0))
    found = 0
    for seed in range(4):
        pair = [walker(k, -25.0, 0.8 * k, group=7, behaviour="walking", goals=goals) for k in (1, 2)]
        scene = room(
            pair,
            polygon=HALL,
            robot=CORNER,
            social=Social(detours=0.2),
            groups=(Group(7, "walking", (1, 2)),),
            seed=seed,
        )
        world, crowd, had = World(scene), Crowd(scene), False
        for _ in range(450):
            world.step(Twist(), crowd.act(world.snapshot()))
            has = not np.isnan(crowd.state.routes.onward[0, 0])
            found += has and not had
            had = has
    assert found >= 8  # of 12 legs


def test_a_pre_movement_time_needs_a_person_that_walks() -> None:
    with pytest.raises(s2.errors.ConfigError, match=r"people\.0\.pre_movement: pre_movement needs a person that walks"):
        s2.load_scenario("empty").changed(people=[{"x": 0, "y": 0, "pre_movement": [3, 3]}])


@pytest.mark.parametrize("reacts", [1.0, 0.0])
def test_people_who_mind_the_robot_stop_away_from_it(reacts: float) -> None:
    people = [
        walker(k + 1, 3.0 * x, 3.0 * y, reacts_to_robot=reacts)
        for k, (x, y) in enumerate([(-1, -1), (-1, 1), (1, -1), (1, 1)])
    ]
    square = ((-4.0, -4.0), (4.0, -4.0), (4.0, 4.0), (-4.0, 4.0))
    social = Social(pause=(2.0, 6.0), stops=6.0, stop_time=(1.0, 4.0))
    nearest = []
    for seed in range(3):
        scene = room(people, polygon=square, robot=Pose(0.0, 0.0), social=social, seed=seed)
        track, walks = tracks(scene, 240.0)
        stands = ~walks[10:] & ~walks[:-10]
        nearest.append(np.hypot(*np.moveaxis(track[10:], -1, 0))[stands].min())
    assert (min(nearest) > 0.85) == (reacts > 0.0)
