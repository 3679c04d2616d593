"""Metrics do not change when the scene is moved, rotated or mirrored."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from hypothesis import given, settings, strategies as st

from sonata2d.core.entities import Furniture, Goal, Group, Human, Wall
from sonata2d.core.geometry import Disc, Point, Pose, Rectangle
from sonata2d.core.relations import TALKING
from sonata2d.core.scene import Scene
from sonata2d.metrics.catalogue import ALL
from sonata2d.metrics.trajectory import Trajectory

from ..conftest import L_SHAPE, room
from .samples import record

STATES = 30
# Shortest paths go around corners by polygons that do not rotate with the room: equal to a few centimetres.
TOLERANCES = {"shortest_length": 0.08, "spl": 0.02, "stl": 0.02}
ASYMMETRIC = {  # as in HuNavSim: a right turn counts as standing, and arguments of atan2 are exchanged
    "hunavsim.time_not_moving", "hunavsim.robot_on_person_collision", "hunavsim.person_on_robot_collision",
}  # fmt: skip

ANGLES, METRES = (st.integers(-n, n).map(lambda v: v / 10_000) for n in (30_000, 500_000))  # at the files' precision

Tracks = list[list[list[float]]]  # x, y, theta of each agent in each state, the robot first
PointMap = Callable[[Point], Point]


def random_walks(seed: int) -> tuple[Scene, Tracks]:
    """A furnished room with a robot and four people who walk at random."""
    draw = np.random.Generator(np.random.PCG64(seed))
    people = [Human(k, Pose(0, 0), radius=float(draw.uniform(0.15, 0.25)), behaviour="wandering") for k in (1, 2, 3, 4)]
    furniture = [
        Furniture(20, "table", Pose(-2.0, -2.2, float(draw.uniform(-3, 3))), Rectangle(0.9, 0.6)),
        Furniture(21, "plant", Pose(-2.5, 1.2), Disc(0.1)),
    ]
    groups = (Group(7, "walking", (1, 2, 3)),)
    goal = (float(draw.uniform(-2.3, -1.3)), float(draw.uniform(2.0, 3.0)))
    scene = room(people, furniture, polygon=L_SHAPE, goal=goal, groups=groups)
    start = np.stack([draw.uniform((-3.4, -3.4), (-0.6, 3.4)) for _ in range(5)])
    start[0] = (-3.2, float(draw.uniform(-0.5, 0.4)))
    steps = draw.uniform(0.5, 3.0) * draw.normal(0.04, 0.08, size=(STATES, 5, 2))
    steps[0] = 0.0
    theta = np.cumsum(draw.normal(0.0, 0.3, size=(STATES, 5, 1)), axis=0)
    poses = np.concatenate((start + np.cumsum(steps, axis=0), theta), axis=2)
    return scene, [poses[:, k].tolist() for k in range(5)]


def measured(scene: Scene, tracks: Tracks) -> dict[str, float | None]:
    """All metrics of an episode in which people also interact and are disturbed."""
    interactions = {index: [[1, TALKING, 2], [3, "human_plant_interaction", 21]] for index in range(0, STATES, 2)}
    people = np.array(tracks[1:])[:, :, :2].transpose(1, 0, 2)
    undisturbed = people[:1] + 1.5 * (people - people[:1])
    trajectory = Trajectory(record(scene, tracks[0], tracks[1:], interactions=interactions), undisturbed)
    return {name: metric.of(trajectory) for name, metric in ALL.items()}


def mapped(scene: Scene, to: PointMap, turn: Callable[[float], float]) -> Scene:
    """The scene with all positions and headings mapped."""

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


def differing(first: dict[str, float | None], second: dict[str, float | None]) -> list[str]:
    """Names of the metrics that differ by more than their tolerance."""

    def is_same(name: str) -> bool:
        a, b = first[name], second[name]
        if a is None or b is None:
            return a is b
        return abs(a - b) <= TOLERANCES.get(name, 1e-5 * max(1.0, abs(a)))

    return [name for name in first if not is_same(name)]


@settings(max_examples=15)
@given(st.integers(0, 10_000), ANGLES, METRES, METRES)
def test_metrics_are_invariant_under_rotation_and_translation(seed: int, angle: float, dx: float, dy: float) -> None:
    scene, tracks = random_walks(seed)
    c, s = math.cos(angle), math.sin(angle)

    def to(point: Point) -> Point:
        return point[0] * c - point[1] * s + dx, point[0] * s + point[1] * c + dy

    moved = [[[*to((x, y)), theta + angle] for x, y, theta in track] for track in tracks]
    moved_scene = mapped(scene, to, lambda theta: theta + angle)
    assert differing(measured(scene, tracks), measured(moved_scene, moved)) == []


@settings(max_examples=15)
@given(st.integers(0, 10_000))
def test_metrics_are_invariant_under_reflection_except_asymmetric_variants(seed: int) -> None:
    scene, tracks = random_walks(seed)
    image = [[[x, -y, -theta] for x, y, theta in track] for track in tracks]
    image_scene = mapped(scene, lambda point: (point[0], -point[1]), lambda theta: -theta)
    image_scene = replace(image_scene, polygon=image_scene.polygon[::-1])
    assert set(differing(measured(scene, tracks), measured(image_scene, image))) <= ASYMMETRIC


def test_random_walks_give_several_values_of_nearly_every_metric() -> None:
    """Otherwise the invariance of a metric would not be tested."""
    values: dict[str, set[float | None]] = {name: set() for name in ALL}
    for seed in range(120):
        for name, value in measured(*random_walks(seed)).items():
            values[name].add(value)
    constant = {name for name, found in values.items() if len(found - {None}) < 2}
    # Random walks have no robot that stands, no people far away, and no driver in a browser.
    assert constant <= {
        "timeout", "stalled_time", "socnavgym.stalled_time", "hunavsim.time_not_moving", "zone_public",
        "round_trip_median", "round_trip_95",
    }  # fmt: skip
