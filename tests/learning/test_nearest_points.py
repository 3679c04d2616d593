"""The nearest points and gaps in modern graphs are those of the outlines."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import sonata2d as s2
from sonata2d.core.entities import Furniture, Human, Wall
from sonata2d.core.geometry import Barriers, Disc, Pose, Rectangle
from sonata2d.core.outlines import shape_gap
from sonata2d.core.portable_math import Array
from sonata2d.core.proxemics import clearance
from sonata2d.core.rng import RandomStream
from sonata2d.core.scene import Scene
from sonata2d.learning.graph.graph import Graph
from sonata2d.learning.graph.modern import graph_of_observations, modern_graph
from sonata2d.learning.graph.source import SceneNodes, observation_of
from sonata2d.record.reader import read_episode

from ..conftest import room

ORIGINS = ([0.0, 0.0, 0.0], [1.0, -2.0, 2.5])


def random_scene(seed: int) -> Scene:
    """Return discs and rectangles in all orientations, and inner walls, around a robot that touches none of them."""
    rng = RandomStream(seed, 0, "people")

    def pose() -> Pose:
        x = rng.uniform(-3.5, -1.0) if rng.uniform() < 0.5 else rng.uniform(1.0, 3.5)
        return Pose(x, rng.uniform(-3.5, 3.5), rng.uniform(-3.0, 3.0))

    shapes = [Rectangle(rng.uniform(0.2, 1.2), rng.uniform(0.2, 1.2)) for _ in range(6)]
    shapes += [Disc(rng.uniform(0.1, 0.4)) for _ in range(3)]
    furniture = [Furniture(20 + k, "thing", pose(), shape) for k, shape in enumerate(shapes)]
    people = [Human(k, pose(), rng.uniform(0.15, 0.3)) for k in range(1, 6)]
    return room(people, furniture, robot=Pose(rng.uniform(-0.1, 0.1), rng.uniform(-1, 1), 0.3), goal=(3.0, 3.0),
                inner=[Wall((1.5, -1.0), (2.5, 1.0)), Wall((-2.0, 2.0), (-2.0, 3.7))])  # fmt: skip


def live_graph(scene: Scene, origin: list[float]) -> Graph:
    snapshot = s2.Episode(scene, s2.StraightToGoal()).snapshot()
    return graph_of_observations(SceneNodes(scene), [observation_of(snapshot)], np.array(origin))


def column(graph: Graph, *names: str) -> Array:
    return graph.features[:, [graph.feature_names.index(name) for name in names]]


@pytest.mark.parametrize("seed", range(20))
def test_gaps_are_those_between_outlines(seed: int) -> None:
    scene = random_scene(seed)
    robot, graph = scene.robot, live_graph(scene, ORIGINS[0])
    gap = column(graph, "gap")[:, 0]
    body, people, objects = Disc(robot.radius), len(scene.humans), len(scene.furniture)
    assert gap[0] == 0.0
    outlines = Barriers.of(edge for human in scene.humans for edge in human.shape.edges(human.pose))
    expected = outlines.gaps(np.array([robot.pose.position]))[:, 0] - robot.radius
    assert gap[1 : 1 + people] == pytest.approx(expected, abs=1e-9)
    for k, thing in enumerate(scene.furniture, 1 + people):
        assert max(gap[k], 0.0) == pytest.approx(shape_gap(thing.shape, thing.pose, body, robot.pose), abs=1e-9)
    position = np.array([robot.pose.position])
    for k, wall in enumerate(scene.walls):
        pieces = gap[(graph.node_type == 3) & (graph.entity == k)]
        distance = Barriers.of([(wall.start, wall.end, 0.0)]).gaps(position)[0, 0]
        assert pieces.min() == pytest.approx(distance - robot.radius, abs=1e-9)
    goal = gap[1 + people + objects]
    dx, dy = scene.goal.x - robot.pose.x, scene.goal.y - robot.pose.y
    assert goal == pytest.approx(np.hypot(dx, dy) - scene.goal.distance - robot.radius, abs=1e-9)


@pytest.mark.parametrize("origin", ORIGINS)
@pytest.mark.parametrize("seed", range(5))
def test_nearest_point_is_on_the_outline_at_the_distance_of_the_gap(seed: int, origin: list[float]) -> None:
    scene = random_scene(seed)
    graph, frame = live_graph(scene, origin), Pose(*origin)
    near, gap = column(graph, "near_x", "near_y"), column(graph, "gap")[:, 0]
    robot = frame.to_local(scene.robot.pose.position)
    distance = np.hypot(near[:, 0] - robot[0], near[:, 1] - robot[1])
    assert distance[1:] == pytest.approx(gap[1:] + scene.robot.radius, abs=1e-9)
    outlines = [(human.shape, human.pose) for human in scene.humans]
    outlines += [(thing.shape, thing.pose) for thing in scene.furniture]
    for (shape, pose), point in zip(outlines, near[1:].tolist(), strict=False):
        world = frame.to_world((point[0], point[1]))
        assert Barriers.of(shape.edges(pose)).gaps(np.array([world])).min() == pytest.approx(0.0, abs=1e-9)


def test_robot_inside_an_outline_has_a_negative_gap_and_a_finite_point() -> None:
    table = Furniture(9, "table", Pose(-3.0, 0.0, 0.4), Rectangle(2.0, 2.0))
    person = Human(1, Pose(-3.0, 0.0), 0.2)
    graph = live_graph(room([person], [table]), ORIGINS[0])
    assert column(graph, "gap")[1:3, 0] == pytest.approx([-0.5, -0.3])
    assert column(graph, "near_x", "near_y")[1:3] == pytest.approx(np.array([[-3.0, 0.0], [-3.0, 0.0]]))


def test_smallest_recorded_gap_is_the_clearance_of_the_snapshot(tmp_path: Path) -> None:
    with s2.JsonRecorder(tmp_path / "a.json") as recorder:
        s2.Episode(s2.generate(s2.ScenarioConfig(humans=(4, 6)), 3), s2.SocialPlanner(), observers=[recorder]).run()
    record = read_episode(tmp_path / "a.json")
    for tick in range(0, len(record), 7):
        graph = modern_graph(record, tick, instants=1)
        gaps = column(graph, "gap")[graph.node_type == 0, 0]
        assert max(gaps.min(), 0.0) == pytest.approx(clearance(record.snapshot(tick)), abs=1e-9)
