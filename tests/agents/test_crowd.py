"""People in motion: what any believable crowd does, whatever its formulas."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import sonata2d as s2
from sonata2d.agents.pedestrians.crowd import Crowd
from sonata2d.core.entities import AT_LAPTOP, TALKING, WALKING_TOGETHER, Furniture, Group, Human, Interaction, Wall
from sonata2d.core.geometry import Pose, Rectangle, Twist
from sonata2d.core.portable_math import Array
from sonata2d.core.scene import Rules, Scene
from sonata2d.core.snapshot import Snapshot
from sonata2d.sim.world import World

from ..conftest import L_SHAPE, room, walker


def watched(scene: Scene, seconds: float) -> list[Snapshot]:
    """What happens while the robot stands."""
    world, crowd, seen = World(scene), Crowd(scene), []
    for _ in range(int(seconds * 10)):
        seen.append(world.snapshot())
        world.step(Twist(), crowd.act(seen[-1]))
    return seen


def turned(scene: Scene, c: int, s: int) -> Scene:
    """The scene turned by a right angle or two: exact in floating point."""

    def point(p: tuple[float, float]) -> tuple[float, float]:
        return p[0] * c - p[1] * s, p[0] * s + p[1] * c

    def pose(p: Pose) -> Pose:
        return Pose(*point(p.position), p.theta + math.atan2(s, c))

    return replace(
        scene,
        polygon=tuple(map(point, scene.polygon)),
        walls=tuple(Wall(point(w.start), point(w.end)) for w in scene.walls),
        furniture=tuple(replace(f, pose=pose(f.pose)) for f in scene.furniture),
        humans=tuple(replace(h, pose=pose(h.pose)) for h in scene.humans),
        robot=replace(scene.robot, pose=pose(scene.robot.pose)),
    )


def test_forces_turn_with_the_scene(busy: Scene) -> None:
    """Where they go is chance, so one tick is compared: what the same people want in the turned room."""
    wanted = accelerations(busy, (1.0, 0.0))
    assert accelerations(turned(busy, 0, 1), (0.0, 1.0)) == pytest.approx(
        np.stack((-wanted[:, 1], wanted[:, 0]), axis=1), abs=1e-6
    )


def accelerations(scene: Scene, towards: tuple[float, float]) -> Array:
    """What all of them feel who want to go one way."""
    crowd, snapshot = Crowd(scene), World(scene).snapshot()
    direction = np.tile([towards], (len(scene.humans), 1))
    return crowd._acceleration(crowd._walkers(snapshot, direction, np.full(len(direction) + 1, 1.3)))


def test_a_lone_walker_reaches_the_desired_speed_and_faces_the_way() -> None:
    there_and_back = ((3.0, -1.0), (-3.0, -1.0)) * 3
    alone = walker(1, -3.0, -1.0, desired_speed=1.2, behaviour="walking", goals=there_and_back)
    seen = watched(room([alone], robot=Pose(-3.5, 3.5)), 20.0)
    speed = [math.hypot(*s.humans[0].velocity) for s in seen[20:]]
    assert np.median(speed) == pytest.approx(1.2, abs=0.05)
    straight = [s.humans[0] for s in seen[20:] if math.hypot(*s.humans[0].velocity) > 1.1]
    aside = [abs(math.remainder(h.pose.theta - math.atan2(h.velocity[1], h.velocity[0]), math.tau)) for h in straight]
    assert np.median(aside) < 0.1


def test_nobody_is_trapped_in_the_arm_of_an_l_or_behind_a_table() -> None:
    table = Furniture(9, "table", Pose(-2.0, 1.0), Rectangle(2.5, 0.8))
    seen = watched(room([walker(1, -2.0, 3.0), walker(2, 3.0, -1.0)], [table], polygon=L_SHAPE, seed=4), 60.0)
    for k in (0, 1):
        x = np.array([s.humans.position[k] for s in seen])
        assert (x[:, 0] > 1.0).any()  # each was in the one arm
        assert (x[:, 1] > 1.8).any()  # and in the other


@pytest.mark.parametrize("width", [0.9, 1.0, 1.2])
def test_a_doorway_is_passed_by_a_lone_walker(width: float) -> None:
    inner = [Wall((0.0, -4.0), (0.0, -width / 2)), Wall((0.0, width / 2), (0.0, 4.0))]
    seen = watched(room([walker(1, -3.0, 2.0)], inner=inner, robot=Pose(3.5, 3.5), seed=1), 60.0)
    x = np.array([s.humans.position[0, 0] for s in seen])
    assert (np.diff(np.sign(x)) != 0).sum() >= 2  # there and back


def test_people_who_meet_head_on_pass_without_touching() -> None:
    for y in (0.0, 0.05, -0.05, 0.1, -0.2):
        seen = watched(meeting(y), 4.2)
        apart = [np.linalg.norm(s.humans.position[0] - s.humans.position[1]) for s in seen]
        assert min(apart) - seen[0].humans.radius.sum() > 0.05
        assert seen[-1].humans.position[0, 0] > 0.8
        assert seen[-1].humans.position[1, 0] < -0.8


def meeting(y: float = 0.0, side: int = 1) -> Scene:
    """Two who meet head-on."""
    one = Human(1, Pose(-3.0, y), behaviour="walking", goals=((3.5, y),))
    other = Human(2, Pose(3.0, 0.0, math.pi), behaviour="walking", goals=((-3.5, 0.0),))
    return room([one, other], robot=Pose(0.0, 3.6), rules=Rules(side=side))  # type: ignore[arg-type]


def test_the_side_of_evasion_is_the_rules() -> None:
    passed = {side: watched(meeting(side=side), 2.6)[-1].humans.position[0, 1] for side in (1, -1)}
    assert passed[1] < -0.05
    assert passed[-1] == pytest.approx(-passed[1], abs=1e-6)


def test_who_stands_faces_the_partner_and_keeps_the_place_though_pushed_past() -> None:
    people = [Human(1, Pose(0.0, 0.0, 2.0)), Human(2, Pose(2.0, 0.0, 1.0)), Human(3, Pose(-1.0, 2.0, -1.0))]
    laptop = Furniture(9, "laptop", Pose(-1.0, 3.0), Rectangle(0.35, 0.25))
    ties = (Interaction(1, TALKING, 2), Interaction(3, AT_LAPTOP, 9))
    walkers = [walker(k, x, -2.0) for k, x in ((4, -2.0), (5, 0.0), (6, 2.0))]
    scene = room([*people, *walkers], [laptop], interactions=ties, robot=Pose(3.5, 3.5))
    seen = watched(scene, 30.0)
    last = seen[-1].humans
    assert last[0].pose.theta == pytest.approx(0.0, abs=0.1)
    assert abs(last[1].pose.theta) == pytest.approx(math.pi, abs=0.1)
    assert last[2].head == pytest.approx(math.pi / 2, abs=0.1)
    assert [last[k].activity for k in range(4)] == ["talking", "talking", "using", "walking"]
    home = np.array([human.pose.position for human in people])
    assert np.abs(np.array([s.humans.position[:3] for s in seen]) - home).max() < 0.25
    assert np.abs(last.position[:3] - home).max() < 0.05


def test_pairs_stay_together_at_the_observed_spacing() -> None:
    pair = [walker(1, 0.0, 0.0, group=1, desired_speed=1.1), walker(2, 0.0, 0.5, group=1, desired_speed=1.5)]
    groups, ties = (Group(1, "walking", (1, 2)),), (Interaction(1, WALKING_TOGETHER, 2),)
    seen = watched(room(pair, groups=groups, interactions=ties, robot=Pose(-3.5, 3.5), seed=2), 40.0)
    apart = [np.linalg.norm(s.humans.position[0] - s.humans.position[1]) for s in seen[20:]]
    assert 0.5 < np.median(apart) < 1.2
    assert np.quantile(apart, 0.95) < 2.0
    assert {h.activity for h in seen[-1].humans} == {"walking together"}


def test_who_ignores_the_robot_walks_as_if_it_were_not_there_and_others_do_not() -> None:
    closest = {}
    for reacts in (0.0, 1.0):
        gaps = []
        for y in (0.1, 0.25):
            scene = room([walker(1, -3.0, y, reacts_to_robot=reacts)], robot=Pose(0.0, 0.0))
            crowd = Crowd(scene)
            crowd._wanderers._ways[0] = np.array([[-3.0, y], [3.5, y]])
            crowd._wanderers._next[0] = 1
            world = World(scene)
            for _ in range(35):
                snapshot = world.snapshot()
                gaps.append(s2.clearance(snapshot))
                world.step(Twist(), crowd.act(snapshot))
        closest[reacts] = min(gaps)
    assert closest[0.0] < 0.01
    assert closest[1.0] > 0.1


def test_halving_the_step_hardly_changes_the_way() -> None:
    """Until chance takes over at the first new goal: 3 s of ten people, forces once a tick."""
    places = []
    for substeps in (10, 20):
        people = [walker(k + 1, -3.5 + 0.7 * k, -3.0 + (k % 3)) for k in range(10)]
        scene = room(people, rules=Rules(substeps=substeps), robot=Pose(3.5, 3.5), seed=8)
        places.append(watched(scene, 3.0)[-1].humans.position)
    assert np.abs(places[0] - places[1]).max() < 0.05


def test_models_that_are_unknown_or_mixed_are_refused() -> None:
    with pytest.raises(ValueError, match=r"no pedestrian model is named .helbing.; did you mean .helbing"):
        Crowd(room([walker(1, 0.0, 0.0, model="helbing")]))
