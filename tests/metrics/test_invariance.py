"""No metric knows where the room stands, which way it is turned, or left from right."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from sonata2d.core.entities import TALKING, Furniture, Goal, Group, Human, Wall
from sonata2d.core.geometry import Disc, Point, Pose, Rectangle
from sonata2d.core.scene import Scene
from sonata2d.metrics.catalogue import ALL
from sonata2d.metrics.trajectory import Trajectory

from ..conftest import L_SHAPE, room
from .samples import record

LOOKS = 30
# Shortest ways go round corners by polygons that do not turn with the room: right to a few centimetres.
ROUGH = {"shortest_length": 0.08, "spl": 0.02, "stl": 0.02}
ONE_HANDED = {  # as they are in HuNavSim: a turn to the right is standing, and exchanged arguments of atan2
    "hunavsim.time_not_moving", "hunavsim.robot_on_person_collision", "hunavsim.person_on_robot_collision",
}  # fmt: skip

ANGLES, METRES = (st.integers(-n, n).map(lambda v: v / 10_000) for n in (30_000, 500_000))  # as files hold them

Places = list[list[list[float]]]
Map = Callable[[Point], Point]


def walked(seed: int) -> tuple[Scene, Places]:
    """A room full of things, and somebody walking at random in it, the robot first."""
    draw = np.random.Generator(np.random.PCG64(seed))
    people = [Human(k, Pose(0, 0), radius=float(draw.uniform(0.15, 0.25)), behaviour="wandering") for k in (1, 2, 3, 4)]
    things = [
        Furniture(20, "table", Pose(-2.0, -2.2, float(draw.uniform(-3, 3))), Rectangle(0.9, 0.6)),
        Furniture(21, "plant", Pose(-2.5, 1.2), Disc(0.1)),
    ]
    groups = (Group(7, "walking", (1, 2, 3)),)
    goal = (float(draw.uniform(-2.3, -1.3)), float(draw.uniform(2.0, 3.0)))
    scene = room(people, things, polygon=L_SHAPE, goal=goal, groups=groups)
    start = np.stack([draw.uniform((-3.4, -3.4), (-0.6, 3.4)) for _ in range(5)])
    start[0] = (-3.2, float(draw.uniform(-0.5, 0.4)))
    steps = draw.uniform(0.5, 3.0) * draw.normal(0.04, 0.08, size=(LOOKS, 5, 2))
    steps[0] = 0.0
    theta = np.cumsum(draw.normal(0.0, 0.3, size=(LOOKS, 5, 1)), axis=0)
    places = np.concatenate((start + np.cumsum(steps, axis=0), theta), axis=2)
    return scene, [places[:, k].tolist() for k in range(5)]


def measured(scene: Scene, places: Places) -> dict[str, float | None]:
    ties = {look: [[1, TALKING, 2], [3, "human_plant_interaction", 21]] for look in range(0, LOOKS, 2)}
    people = np.array(places[1:])[:, :, :2].transpose(1, 0, 2)
    alone = people[:1] + 1.5 * (people - people[:1])
    run = Trajectory(record(scene, places[0], places[1:], ties=ties), alone)
    return {name: metric.of(run) for name, metric in ALL.items()}


def mapped(scene: Scene, to: Map, turn: Callable[[float], float]) -> Scene:
    """The scene with every place and direction changed."""

    def pose(of: Pose) -> Pose:
        return Pose(*to(of.position), turn(of.theta))

    goal = scene.goal
    return replace(
        scene,
        polygon=tuple(to(corner) for corner in scene.polygon),
        walls=tuple(Wall(to(wall.start), to(wall.end)) for wall in scene.walls),
        furniture=tuple(replace(thing, pose=pose(thing.pose)) for thing in scene.furniture),
        robot=replace(scene.robot, pose=pose(scene.robot.pose)),
        goal=Goal(*to(goal.position), turn(goal.theta), goal.distance, goal.angle),
    )


def differing(a: dict[str, float | None], b: dict[str, float | None]) -> list[str]:
    def same(name: str) -> bool:
        one, other = a[name], b[name]
        if one is None or other is None:
            return one is other
        return abs(one - other) <= ROUGH.get(name, 1e-5 * max(1.0, abs(one)))

    return [name for name in a if not same(name)]


@settings(deadline=None, max_examples=15)
@given(st.integers(0, 10_000), ANGLES, METRES, METRES)
def test_turning_and_shifting_the_scene_changes_nothing(seed: int, angle: float, dx: float, dy: float) -> None:
    scene, places = walked(seed)
    c, s = math.cos(angle), math.sin(angle)

    def to(at: Point) -> Point:
        return at[0] * c - at[1] * s + dx, at[0] * s + at[1] * c + dy

    moved = [[[*to((x, y)), theta + angle] for x, y, theta in way] for way in places]
    there = mapped(scene, to, lambda theta: theta + angle)
    assert differing(measured(scene, places), measured(there, moved)) == []


@settings(deadline=None, max_examples=15)
@given(st.integers(0, 10_000))
def test_mirroring_the_scene_changes_nothing_but_what_is_one_handed(seed: int) -> None:
    scene, places = walked(seed)
    image = [[[x, -y, -theta] for x, y, theta in way] for way in places]
    there = mapped(scene, lambda at: (at[0], -at[1]), lambda theta: -theta)
    there = replace(there, polygon=there.polygon[::-1])
    assert set(differing(measured(scene, places), measured(there, image))) <= ONE_HANDED


def test_the_walks_of_these_tests_meet_all_that_metrics_tell_of() -> None:
    """Each metric takes several values, and is defined, somewhere among the walks."""
    seen: dict[str, set[float | None]] = {name: set() for name in ALL}
    for seed in range(120):
        for name, number in measured(*walked(seed)).items():
            seen[name].add(number)
    dull = {name for name, numbers in seen.items() if len(numbers - {None}) < 2}
    stands_or_is_far = {"timeout", "stalled_time", "socnavgym.stalled_time", "hunavsim.time_not_moving", "zone_public"}
    assert dull <= stands_or_is_far
