"""Reactions to the robot: ignore, avoid, stop, approach or keep away; none of them lasts for ever."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from sonata2d.agents.pedestrians.crowd import Crowd
from sonata2d.core import proxemics
from sonata2d.core.entities import Goal, Human, Limits, OtherRobot, Reaction, Robot, Wall
from sonata2d.core.geometry import Pose, Twist
from sonata2d.core.portable_math import Array
from sonata2d.core.scene import Rules, Scene
from sonata2d.core.snapshot import Snapshot
from sonata2d.sim.world import World

from ..conftest import room, walker

HALL = ((-8.0, -8.0), (8.0, -8.0), (8.0, 8.0), (-8.0, 8.0))
REACTIONS: tuple[Reaction, ...] = ("ignores", "avoids", "stops", "curious", "scared")


def simulate(scene: Scene, speed: float, ticks: int, until: float = 7.0) -> list[Snapshot]:
    """The snapshots while the robot drives straight ahead, as far as x = `until`."""
    world, crowd, snapshots = World(scene), Crowd(scene), []
    for _ in range(ticks):
        snapshots.append(world.snapshot())
        is_driving = snapshots[-1].robot.position[0] < until
        world.step(Twist(speed if is_driving else 0.0), crowd.act(snapshots[-1]))
    return snapshots


def crossing_human(reaction: Reaction, clearance: float = 0.1, goal: float = 7.0) -> Human:
    """A pedestrian that walks up from y = -6 m at full speed and would be at the origin after 4.6 s."""
    return Human(
        1, Pose(0.0, -6.0, math.pi / 2), behaviour="walking", goals=((0.0, goal),), velocity=(0.0, 1.3),
        reaction=reaction, robot_clearance=clearance,
    )  # fmt: skip


def crossing(reaction: Reaction, offset: float = 0.0, clearance: float = 0.1) -> list[Snapshot]:
    """A pedestrian crosses the robot's path; the robot is `offset` m behind a collision at the origin."""
    robot = Pose(-4.6 - offset, 0.0)
    return simulate(room([crossing_human(reaction, clearance)], robot=robot, polygon=HALL, limits=Limits()), 1.0, 95)


def clearances(snapshots: list[Snapshot], k: int = 0) -> Array:
    """(T,), m, between the outlines of pedestrian k and the robot."""
    return np.array([proxemics.clearances(s)[k] for s in snapshots])


def fraction_looking_at_robot(snapshots: list[Snapshot], k: int = 0) -> float:
    """The fraction of snapshots in which the gaze of pedestrian k is within 15 degrees of the robot."""
    to_robot = np.array([s.robot.position - s.humans.position[k] for s in snapshots])
    gaze = np.array([s.humans.gaze[k] for s in snapshots])
    return float(((to_robot * gaze).sum(axis=1) > math.cos(0.26) * np.linalg.norm(to_robot, axis=1)).mean())


@pytest.mark.usefixtures("no_deviations")
def test_crossing_walkers_keep_the_clearance_that_is_given() -> None:
    kept = [clearances(crossing("avoids", -0.3 + 0.1 * k, 0.1 * k)).min() for k in range(7)]
    assert kept == pytest.approx([0.1 * k for k in range(7)], abs=0.1)


def test_avoiding_pedestrians_pass_behind_the_robot() -> None:
    snapshots = crossing("avoids")
    closest = int(np.abs([s.humans.position[0, 1] for s in snapshots]).argmin())
    assert snapshots[closest].humans.position[0, 0] < snapshots[closest].robot.position[0]


@pytest.mark.parametrize(("early", "goes_first"), [(0.8, True), (-0.8, False)])
def test_who_comes_first_to_a_crossing_goes_first(early: float, goes_first: bool) -> None:
    snapshots = crossing("avoids", early)
    robot = np.array([s.robot.position[0] for s in snapshots])
    human = np.array([s.humans.position[0, 1] for s in snapshots])
    assert bool(np.argmax(human > 0.0) < np.argmax(robot > 0.0)) is goes_first


def test_pedestrians_do_not_react_to_a_robot_behind_them_but_look_back() -> None:
    """Both walk to the right; the robot comes nearer than 1 m."""
    alone, followed = (
        simulate(
            room([Human(1, Pose(-3.0, 0.0), behaviour="walking", goals=((7.0, 0.0),), velocity=(1.0, 0.0),
                        desired_speed=1.0)], robot=Pose(x, y), polygon=HALL, limits=Limits()),
            1.25, 50,
        )
        for x, y in ((-7.5, 7.0), (-5.0, 0.0))
    )  # fmt: skip
    assert 0.1 < clearances(followed).min() < 1.0
    assert np.abs([s.humans.position[0, 1] for s in followed]).max() < 0.35
    turned = [max(abs(s.humans.gaze[0, 1]) for s in snapshots) for snapshots in (alone, followed)]
    assert turned[0] < 0.5 < turned[1]


def test_a_walker_waits_before_a_robot_in_a_door_without_pacing_and_goes_on() -> None:
    walls = [Wall((0.0, -8.0), (0.0, -0.4)), Wall((0.0, 0.4), (0.0, 8.0))]
    human = Human(1, Pose(-4.0, 0.2), behaviour="walking", goals=((5.0, 0.0),))
    world_room = room([human], robot=Pose(0.0, 0.0), polygon=HALL, inner=walls)
    world, crowd, snapshots = World(world_room), Crowd(world_room), []
    for tick in range(260):
        snapshots.append(world.snapshot())
        world.step(Twist(1.0 if 150 < tick < 180 else 0.0), crowd.act(snapshots[-1]))
    states = np.array([s.humans.state[0] for s in snapshots])
    waiting = states[60:150]
    assert np.hypot(*np.diff(waiting[:, :2], axis=0).T).sum() < 0.5
    angle = np.unwrap(np.arctan2(waiting[:, 5], waiting[:, 4]))
    assert np.abs(np.diff(angle)).sum() < math.radians(90)
    assert clearances(snapshots).min() > 0.0
    assert states[-1, 0] > 1.0


@pytest.mark.parametrize("width", [1.5, 1.8, 2.2])
@pytest.mark.parametrize("aside", [0.0, 0.3])
def test_a_robot_that_stands_in_a_corridor_is_passed(width: float, aside: float) -> None:
    walls = [Wall((-8.0, y), (8.0, y)) for y in (-width / 2, width / 2)]
    human = Human(1, Pose(-4.0, aside), behaviour="walking", goals=((5.0, 0.0),))
    snapshots = simulate(room([human], robot=Pose(0.0, 0.0), polygon=HALL, inner=walls), 0.0, 150)
    assert snapshots[-1].humans.position[0, 0] > 3.0


def test_people_who_enter_later_and_ignore_the_robot_walk_into_it_too() -> None:
    human = replace(crossing_human("ignores"), enters=30, velocity=(0.0, 0.0))
    snapshots = simulate(room([human], robot=Pose(0.0, 0.0), polygon=HALL), 0.0, 110)
    assert min(clearances([s for s in snapshots if len(s.humans)])) < 0.02


def test_a_robot_in_front_is_evaded_although_another_one_follows_near_by() -> None:
    human = Human(1, Pose(-3.0, 0.0), behaviour="walking", goals=((7.0, 0.0),), velocity=(1.2, 0.0))
    other = OtherRobot(11, Robot(Pose(-4.2, 0.0), limits=Limits()), Goal(7.0, 1.0))
    scene = room([human], robot=Pose(4.0, 0.0, math.pi), polygon=HALL, limits=Limits())
    scene = replace(scene, robots=(other,))
    world, crowd, gap = World(scene), Crowd(scene), []
    for _ in range(40):
        snapshot = world.snapshot()
        gap.append(proxemics.clearances(snapshot)[0])
        world.step(Twist(0.8), crowd.act(snapshot), others=[Twist(1.0)])
    assert min(gap) > 0.05


def test_a_standing_person_keeps_the_side_to_which_it_steps() -> None:
    scene = room([Human(1, Pose(0.0, 0.0, math.pi))], robot=Pose(-4.0, 0.0), polygon=HALL, limits=Limits())
    world, crowd, aside = World(scene), Crowd(scene), []
    for tick in range(60):
        snapshot = world.snapshot()
        aside.append(snapshot.humans.position[0, 1])
        world.step(Twist(0.8, omega=0.1 * math.cos(tick / 5)), crowd.act(snapshot))
    assert np.abs(aside).max() > 0.3
    assert min(aside) > -0.05 or max(aside) < 0.05


def test_standing_people_step_out_of_the_way_of_the_robot_and_return() -> None:
    scene = room([Human(1, Pose(0.0, 0.2, math.pi))], robot=Pose(-5.0, 0.0), polygon=HALL)
    snapshots = simulate(scene, 1.0, 140)
    moved = np.array([s.humans.position[0] - (0.0, 0.2) for s in snapshots])
    assert 0.2 < moved[:, 1].max() < 0.85
    assert np.abs(moved[-1]).max() < 0.05
    assert clearances(snapshots).min() > 0.0


@pytest.mark.usefixtures("no_deviations")
def test_paths_of_pedestrians_that_ignore_the_robot_lead_through_it() -> None:
    """The robot stands in the way for longer than it takes to count as an obstacle for the others."""
    aside = {}
    for reaction in ("ignores", "avoids"):
        human = replace(crossing_human(reaction), pose=Pose(0.0, -7.0, math.pi / 2))
        snapshots = simulate(room([human], robot=Pose(0.0, 0.0), polygon=HALL), 0.0, 60)
        aside[reaction] = np.abs([s.humans.position[0, 0] for s in snapshots if s.humans.position[0, 1] < -0.5]).max()
    assert aside["ignores"] < 0.1 < aside["avoids"]


def test_ignoring_pedestrians_walk_as_if_the_robot_were_far_away() -> None:
    near = simulate(room([crossing_human("ignores")], robot=Pose(-4.0, 2.0), polygon=HALL), 0.0, 60)
    far = simulate(room([crossing_human("ignores")], robot=Pose(-7.0, 7.0), polygon=HALL), 0.0, 60)
    assert all((a.humans.state == b.humans.state).all() for a, b in zip(near, far, strict=True))


@pytest.mark.usefixtures("no_deviations")
def test_stopping_pedestrians_stand_until_the_robot_has_passed() -> None:
    snapshots = crossing("stops", 0.3)
    speed = np.array([np.linalg.norm(s.humans.velocity[0]) for s in snapshots])
    standing = np.flatnonzero(speed[10:] < 0.25) + 10
    assert len(standing) > 5
    assert all(snapshots[int(k)].robot.position[0] < 0.5 for k in standing[standing < 80])
    assert snapshots[-1].humans.position[0, 1] > 2.0
    assert clearances(snapshots).min() > 0.3


@pytest.mark.usefixtures("no_deviations")
@pytest.mark.parametrize("offset", [-1.0, -0.5, 0.0, 0.5, 1.0, 1.5])
def test_nobody_stops_in_the_way_of_the_robot(offset: float) -> None:
    assert clearances(crossing("stops", offset)).min() > 0.05


@pytest.mark.parametrize("reaction", REACTIONS[1:])
def test_a_waiting_robot_blocks_no_pedestrian_for_ever(reaction: Reaction) -> None:
    snapshots = simulate(room([crossing_human(reaction, goal=4.0)], robot=Pose(0.0, 0.0), polygon=HALL), 0.0, 300)
    assert snapshots[-1].humans.position[0, 1] > 3.0
    assert clearances(snapshots).min() > 0.0


def test_curious_pedestrians_approach_and_face_the_robot_and_lose_interest() -> None:
    snapshots = simulate(room([crossing_human("curious")], robot=Pose(-2.0, 0.0), polygon=HALL), 0.0, 250)
    near = [s for s, clearance in zip(snapshots, clearances(snapshots), strict=True) if abs(clearance - 1.2) < 0.15]
    assert len(near) > 40
    humans = near[20].humans
    to_robot = np.array(near[20].robot.position) - humans.position[0]
    assert humans.direction[0] @ to_robot > 0.98 * np.linalg.norm(to_robot)
    assert humans.gaze[0] @ to_robot > 0.98 * np.linalg.norm(to_robot)
    assert snapshots[-1].humans.position[0, 1] > 4.0


def test_scared_pedestrians_keep_farther_away_and_look_more_than_avoiding_ones() -> None:
    runs = {reaction: crossing(reaction) for reaction in ("avoids", "scared")}
    assert clearances(runs["scared"]).min() > clearances(runs["avoids"]).min() + 0.4
    assert fraction_looking_at_robot(runs["scared"][10:50]) > fraction_looking_at_robot(runs["avoids"][10:50])


def test_standing_scared_pedestrians_step_aside_and_return() -> None:
    scene = room([Human(1, Pose(0.0, 1.0, -1.5), reaction="scared")], robot=Pose(-5.0, 0.0), polygon=HALL)
    moved = np.array([np.linalg.norm(s.humans.position[0] - (0.0, 1.0)) for s in simulate(scene, 1.0, 140)])
    assert 0.3 < moved.max() < 0.85
    assert moved[-1] < 0.05


def test_glances_of_standing_pedestrians_depend_on_the_reaction() -> None:
    fraction = {}
    for reaction in REACTIONS:
        scene = room([Human(1, Pose(0.0, 1.5, math.pi), reaction=reaction)], robot=Pose(-4.0, 0.0), polygon=HALL)
        fraction[reaction] = fraction_looking_at_robot(simulate(scene, 1.0, 45))
    assert fraction["ignores"] < 0.1
    assert fraction["ignores"] < fraction["avoids"] < fraction["scared"]
    assert fraction["curious"] > 0.5


@pytest.mark.usefixtures("motionless")
def test_pedestrians_do_not_react_through_walls() -> None:
    wall = [Wall((-8.0, 0.6), (8.0, 0.6))]
    standing = Human(1, Pose(0.0, 1.5, -1.5), reaction="scared")
    snapshots = simulate(room([standing], robot=Pose(-4.0, 0.0), polygon=HALL, inner=wall), 1.0, 70)
    assert np.ptp([s.humans.head[0] for s in snapshots]) < 1e-6
    assert np.abs(np.array([s.humans.position[0] for s in snapshots]) - (0.0, 1.5)).max() < 1e-6


@pytest.mark.parametrize("reaction", REACTIONS)
def test_reactions_are_mirrored_with_the_scene(reaction: Reaction) -> None:
    states = []
    for side in (1, -1):
        humans = [
            replace(crossing_human(reaction), pose=Pose(0.0, -6.0 * side, side * math.pi / 2),
                    velocity=(0.0, 1.3 * side), goals=((0.0, 7.0 * side),)),
            Human(2, Pose(1.0, 1.4 * side, -1.5 * side), reaction=reaction),
        ]  # fmt: skip
        rules = Rules(side=side)  # type: ignore[arg-type]
        scene = room(humans, robot=Pose(-4.6, 0.0), polygon=HALL, rules=rules, limits=Limits())
        states.append(np.array([s.humans.state for s in simulate(scene, 1.0, 90)]))
    signs = np.array([1, -1, 1, -1, 1, -1, 1, -1, -1])
    assert states[0] == pytest.approx(states[1] * signs, abs=1e-6)


def test_reacts_to_robot_of_zero_equals_the_reaction_ignores() -> None:
    assert walker(1, 0.0, 0.0, reacts_to_robot=0.0).reaction == "ignores"
    assert walker(1, 0.0, 0.0, reaction="ignores").reacts_to_robot == 0.0
