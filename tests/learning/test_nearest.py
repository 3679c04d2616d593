"""The nearest place and the gap that a modern graph tells of a node are those of the outlines themselves."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import sonata2d as s2
from sonata2d.core.entities import Furniture, Human, Wall
from sonata2d.core.geometry import Barriers, Disc, Pose, Rectangle, shape_gap
from sonata2d.core.rng import RandomStream
from sonata2d.core.scene import Scene
from sonata2d.learning.graph.graph import Graph
from sonata2d.learning.graph.modern import graph_of_looks
from sonata2d.learning.graph.source import look_of

from ..conftest import room

ORIGINS = ([0.0, 0.0, 0.0], [1.0, -2.0, 2.5])


def scattered(seed: int) -> Scene:
    """Discs and oblongs turned every way, and inner walls, round a robot that stands free of all."""
    chance = RandomStream(seed, 0, "people")

    def pose() -> Pose:
        along = chance.uniform(-3.5, -1.0) if chance.uniform() < 0.5 else chance.uniform(1.0, 3.5)
        return Pose(along, chance.uniform(-3.5, 3.5), chance.uniform(-3.0, 3.0))

    shapes = [Rectangle(chance.uniform(0.2, 1.2), chance.uniform(0.2, 1.2)) for _ in range(6)]
    shapes += [Disc(chance.uniform(0.1, 0.4)) for _ in range(3)]
    things = [Furniture(20 + k, "thing", pose(), shape) for k, shape in enumerate(shapes)]
    people = [Human(k, pose(), chance.uniform(0.15, 0.3)) for k in range(1, 6)]
    return room(people, things, robot=Pose(chance.uniform(-0.1, 0.1), chance.uniform(-1, 1), 0.3), goal=(3.0, 3.0),
                inner=[Wall((1.5, -1.0), (2.5, 1.0)), Wall((-2.0, 2.0), (-2.0, 3.7))])  # fmt: skip


def live(scene: Scene, origin: list[float]) -> Graph:
    snapshot = s2.Episode(scene, s2.StraightToGoal()).look()
    return graph_of_looks(scene, [look_of(snapshot)], np.array(origin))


def column(graph: Graph, *names: str) -> np.ndarray:  # type: ignore[type-arg]
    return graph.features[:, [graph.feature_names.index(name) for name in names]]


@pytest.mark.parametrize("seed", range(20))
def test_gaps_are_those_between_outlines(seed: int) -> None:
    scene = scattered(seed)
    robot, graph = scene.robot, live(scene, ORIGINS[0])
    gap = column(graph, "gap")[:, 0]
    body, people, things = Disc(robot.radius), len(scene.humans), len(scene.furniture)
    assert gap[0] == 0.0
    for k, human in enumerate(scene.humans, 1):
        assert max(gap[k], 0.0) == pytest.approx(shape_gap(Disc(human.radius), human.pose, body, robot.pose), abs=1e-9)
    for k, thing in enumerate(scene.furniture, 1 + people):
        assert max(gap[k], 0.0) == pytest.approx(shape_gap(thing.shape, thing.pose, body, robot.pose), abs=1e-9)
    at = np.array([robot.pose.position])
    for k, wall in enumerate(scene.walls):
        pieces = gap[(graph.node_type == 3) & (graph.entity == k)]
        whole = Barriers.of([(wall.start, wall.end, 0.0)]).gaps(at)[0, 0]
        assert pieces.min() == pytest.approx(whole - robot.radius, abs=1e-9)
    goal = gap[1 + people + things]
    dx, dy = scene.goal.x - robot.pose.x, scene.goal.y - robot.pose.y
    assert goal == pytest.approx(np.hypot(dx, dy) - scene.goal.distance - robot.radius, abs=1e-9)


@pytest.mark.parametrize("origin", ORIGINS)
@pytest.mark.parametrize("seed", range(5))
def test_the_nearest_place_is_on_the_outline_and_as_far_as_the_gap_says(seed: int, origin: list[float]) -> None:
    scene = scattered(seed)
    graph, frame = live(scene, origin), Pose(*origin)
    near, gap = column(graph, "near_x", "near_y"), column(graph, "gap")[:, 0]
    robot = frame.to_local(scene.robot.pose.position)
    apart = np.hypot(near[:, 0] - robot[0], near[:, 1] - robot[1])
    assert apart[1:] == pytest.approx(gap[1:] + scene.robot.radius, abs=1e-9)
    outlines = [(Disc(human.radius), human.pose) for human in scene.humans]
    outlines += [(thing.shape, thing.pose) for thing in scene.furniture]
    for (shape, pose), place in zip(outlines, near[1:].tolist(), strict=False):
        world = Pose(*frame.to_world((place[0], place[1])))
        assert shape_gap(shape, pose, Disc(0.0), world) == pytest.approx(0.0, abs=1e-9)


def test_a_robot_within_an_outline_has_a_gap_below_zero_and_a_place_all_the_same() -> None:
    table = Furniture(9, "table", Pose(-3.0, 0.0, 0.4), Rectangle(2.0, 2.0))
    person = Human(1, Pose(-3.0, 0.0), 0.2)
    graph = live(room([person], [table]), ORIGINS[0])
    assert column(graph, "gap")[1:3, 0] == pytest.approx([-0.5, -0.3])
    assert column(graph, "near_x", "near_y")[1:3] == pytest.approx(np.array([[-3.0, 0.0], [-3.0, 0.0]]))


def test_recorded_gaps_are_the_clearance_that_the_snapshot_has(tmp_path: Path) -> None:
    from sonata2d.core.proxemics import clearance
    from sonata2d.learning.graph.modern import modern_graph
    from sonata2d.record.reader import read_episode

    with s2.JsonRecorder(tmp_path / "a.json") as recorder:
        s2.Episode(s2.generate(s2.ScenarioConfig(humans=(4, 6)), 3), s2.SocialPlanner(), observers=[recorder]).run()
    record = read_episode(tmp_path / "a.json")
    for tick in range(0, len(record), 7):
        graph = modern_graph(record, tick, instants=1)
        gaps = column(graph, "gap")[graph.node_type == 0, 0]
        assert max(gaps.min(), 0.0) == pytest.approx(clearance(record.snapshot(tick)), abs=1e-9)
