"""Straight walls in several pieces: one wall for contacts, collisions, faults and encounters."""

from __future__ import annotations

import math
import random
import tracemalloc
from dataclasses import replace
from itertools import combinations, pairwise

import numpy as np
import pytest

from sonata2d.agents.controllers.base import Controller
from sonata2d.core.entities import Furniture, Wall
from sonata2d.core.geometry import Point, Pose, Rectangle, Twist
from sonata2d.core.scene import Rules, Scene
from sonata2d.core.snapshot import Snapshot
from sonata2d.core.wall_lines import straight_walls, wall_lines
from sonata2d.metrics.encounters import doorways
from sonata2d.metrics.trajectory import Trajectory
from sonata2d.record.recorder import EpisodeRecorder
from sonata2d.sim.episode import Episode

from ..conftest import SQUARE, room

A, B = (-3.0, 1.0), (3.0, 1.0)


def pieces(*xs: float, y: float = 1.0) -> list[Wall]:
    """Consecutive walls between points at y."""
    return [Wall((a, y), (b, y)) for a, b in pairwise(xs)]


EVEN = [-3.0 + 0.5 * k for k in range(13)]
DRAWINGS = {
    "one": [Wall(A, B)],
    "reversed": [Wall(B, A)],
    "two": pieces(-3.0, 0.2, 3.0),
    "twelve": pieces(*EVEN),
    "not in order": [*pieces(*EVEN)[::2], *pieces(*EVEN)[1::2]],
    "some reversed": [wall if k % 3 else Wall(wall.end, wall.start) for k, wall in enumerate(pieces(*EVEN))],
    "overlapping": [Wall(A, (1.0, 1.0)), Wall((-1.0, 1.0), B), Wall((0.0, 1.0), (0.5, 1.0))],
    "twice": [Wall(A, B), Wall(B, A), Wall(A, B)],
    "rounded": [Wall(A, (0.1, 1.00005)), Wall((0.1, 0.99995), B)],
    "0.9 mm aside": [Wall(A, (0.1, 1.0009)), Wall((0.1, 1.0009), B)],
    "0.9 mm apart": [Wall(A, (0.1, 1.0)), Wall((0.1009, 1.0), B)],
}


class Scrape(Controller):
    """Drives ahead and to the left, or straight ahead from a tick on."""

    def __init__(self, straight_from: int = 1000) -> None:
        self.straight_from = straight_from

    def act(self, snapshot: Snapshot) -> Twist:
        return Twist(0.6, 0.5 if snapshot.tick < self.straight_from else 0.0)


def run(scene: Scene, controller: Controller) -> Trajectory:
    recorder = EpisodeRecorder()
    Episode(scene, controller, observers=[recorder]).run()
    return Trajectory(recorder.record())


def along_wall(inner: list[Wall], polygon: tuple[Point, ...] = SQUARE, y: float = 0.6) -> Scene:
    rules = Rules(time_limit=8.0)
    return room(inner=inner, polygon=polygon, robot=Pose(-2.8, y), goal=(3.0, -3.0), rules=rules)


@pytest.mark.parametrize("drawing", DRAWINGS)
def test_a_straight_wall_is_one_wall_however_it_is_drawn(drawing: str) -> None:
    walls = DRAWINGS[drawing]
    assert wall_lines(walls) == (0,) * len(walls)
    (whole,) = straight_walls(walls, wall_lines(walls)).values()
    assert {whole.start, whole.end} == {A, B}
    assert (whole.end[0] > whole.start[0]) == (walls[0].end[0] > walls[0].start[0])


@pytest.mark.parametrize("drawing", DRAWINGS)
def test_one_scrape_along_a_wall_in_pieces_is_one_collision_with_the_same_motion(drawing: str) -> None:
    whole = run(along_wall([Wall(A, B)]), Scrape())
    trajectory = run(along_wall(DRAWINGS[drawing]), Scrape())
    assert [(c.kind, c.id, c.robot_at_fault) for c in trajectory.collisions] == [("wall", 4, True)]
    assert np.allclose(trajectory.position, whole.position, rtol=0.0, atol=2e-3)
    contacts = [row["id"] for frame in trajectory.record.document["frames"] for row in frame["contacts"]]
    assert len(contacts) > 20
    assert set(contacts) == {4}


def test_recorded_contacts_with_several_pieces_are_one_collision() -> None:
    """Files of earlier versions name the piece that was touched."""
    trajectory = run(along_wall(pieces(*EVEN)), Scrape())
    for number, frame in enumerate(trajectory.record.document["frames"]):
        for row in frame["contacts"]:
            row["id"] = 4 + number % 12
    assert len(Trajectory(trajectory.record).collisions) == 1


def test_vertices_on_a_side_of_the_polygon_make_no_further_walls() -> None:
    polygon = (*SQUARE[:2], *((x, 4.0) for x in (4.0, 2.0, 1.0, 0.0, -2.5, -4.0)))
    scene = along_wall([], polygon, y=3.5)
    assert scene.wall_lines == (0, 1, 2, 2, 2, 2, 2, 7)
    assert len(run(scene, Scrape()).collisions) == 1


def test_an_inner_wall_on_an_edge_of_the_room_is_part_of_it() -> None:
    scene = along_wall([Wall((2.0, 4.0), (-1.0, 4.0))], y=3.5)
    assert scene.wall_lines == (0, 1, 2, 3, 2)
    assert len(run(scene, Scrape()).collisions) == 1


def test_walls_with_a_gap_or_an_angle_or_in_parallel_are_several() -> None:
    assert wall_lines(pieces(-3.0, 0.0) + pieces(0.0011, 3.0)) == (0, 1)
    assert wall_lines([Wall(A, (0.0, 1.0)), Wall((0.0, 1.0), (3.0, 1.01))]) == (0, 1)
    assert wall_lines([Wall(A, B), *pieces(-3.0, 3.0, y=1.0011)]) == (0, 1)
    assert wall_lines([Wall((0.0, 0.0), (0.0, 2.0)), Wall((-1.0, 1.0), (1.0, 1.0))]) == (0, 1)
    assert wall_lines([]) == ()


def random_walls(seed: int) -> list[Wall]:
    """Straight walls in pieces, in any order and direction, with gaps, overlaps and ends off the line near 1 mm."""
    rng, walls = random.Random(seed), list[Wall]()
    for _ in range(rng.randint(1, 6)):
        at = np.array([rng.uniform(-5.0, 5.0), rng.uniform(-5.0, 5.0)])
        turn = rng.choice((0.0, 1.5, rng.uniform(0.0, 7.0)))
        along = np.array([math.cos(turn), math.sin(turn)])
        cuts = sorted(rng.uniform(0.0, 9.0) for _ in range(rng.randint(2, 9)))
        for a, b in pairwise(cuts):
            off = rng.choice((0.0, 0.0, 0.0003, 0.001, 0.002))
            end = b + rng.choice((0.0, 0.0, 0.2, 0.0008, -0.1))
            ends = [tuple((at + along * k + rng.uniform(-off, off)).round(4).tolist()) for k in (a, end)]
            rng.shuffle(ends)
            walls += [Wall(*ends)] if ends[0] != ends[1] else []
    rng.shuffle(walls)
    return walls


def is_straight(points: list[tuple[float, float]]) -> bool:
    """Whether all points are within 1 mm of the line through the point farthest from the first, and the one from it."""
    far = max(points, key=lambda point: math.dist(point, points[0]))
    x, y = (a - b for a, b in zip(max(points, key=lambda point: math.dist(point, far)), far, strict=True))
    return all(abs(x * (q - far[1]) - y * (p - far[0])) <= 1e-3 * math.hypot(x, y) for p, q in points)


def plain_wall_lines(walls: list[Wall]) -> list[int]:
    """The rule as a plain loop over all pairs."""
    members = [[k] for k in range(len(walls))]
    ends = [[wall.start, wall.end] for wall in walls]
    for i, j in combinations(range(len(walls)), 2):
        near = all(
            min(ends[a][0][k], ends[a][1][k]) <= max(ends[b][0][k], ends[b][1][k]) + 1e-3
            for a, b in ((i, j), (j, i))
            for k in (0, 1)
        )
        both = members[i] + members[j]
        is_pair = near and members[i] is not members[j] and is_straight(ends[i] + ends[j])
        if is_pair and is_straight([end for k in both for end in ends[k]]):
            for k in both:
                members[k] = both
    return [min(group) for group in members]


def test_lines_are_those_of_a_plain_loop_over_all_pairs(monkeypatch: pytest.MonkeyPatch) -> None:
    for seed in range(300):
        walls = random_walls(seed)
        monkeypatch.setattr("sonata2d.core.wall_lines._PAIRS_OF_BLOCK", 40 if seed % 2 else 200_000)
        assert list(wall_lines(walls)) == plain_wall_lines(walls), f"seed {seed}"


def test_memory_of_many_parallel_walls_is_bounded() -> None:
    """All boxes around 4 000 slanting walls overlap: 8 million pairs."""
    walls = [Wall((0.0, 0.01 * k), (50.0, 50.0 + 0.01 * k)) for k in range(4000)]
    tracemalloc.start()
    assert wall_lines(walls) == tuple(range(4000))
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 50_000_000


def test_a_round_wall_of_short_pieces_is_no_straight_wall() -> None:
    """Of 360 pieces of 9 mm, those that lie within 1 mm of a line are joined: up to 65 mm of an arc of 0.5 m."""
    corners = [(0.5 * math.cos(math.radians(k)), 0.5 * math.sin(math.radians(k))) for k in range(360)]
    walls = [Wall(a, b) for a, b in zip(corners, corners[1:] + corners[:1], strict=True)]
    lengths = [math.dist(wall.start, wall.end) for wall in straight_walls(walls, wall_lines(walls)).values()]
    assert max(lengths) < 2.0 * math.sqrt(2.0 * 0.5 * 0.001)
    assert sum(lengths) == pytest.approx(math.pi, abs=0.01)


def test_a_wall_in_two_pieces_is_crossed_by_no_doorway() -> None:
    walls = [*pieces(-4.0, -2.0, -0.5), *pieces(-4.0, -0.5), *pieces(0.5, 2.0), *pieces(1.0, 4.0)]
    (door,) = doorways(room(inner=walls))
    assert sorted(door) == [(-0.5, 1.0), (0.5, 1.0)]


def test_sliding_along_a_table_towards_its_corner_is_no_fault_at_the_next_side() -> None:
    """The robot presses against the side at first, then slides past the corner without pressing: one collision."""
    table = Furniture(9, "table", Pose(0.0, 1.5), Rectangle(4.0, 1.0))
    scene = replace(
        room(furniture=[table]), robot=replace(room().robot, pose=Pose(-1.8, 0.6)), rules=Rules(time_limit=7)
    )
    trajectory = run(scene, Scrape(straight_from=20))
    assert [(c.kind, c.id) for c in trajectory.collisions] == [("object", 9)]
    faults = [
        (frame["tick"], row["robot_at_fault"])
        for frame in trajectory.record.document["frames"]
        for row in frame["contacts"]
    ]
    assert {fault for tick, fault in faults if tick < 20} == {True}
    assert {fault for tick, fault in faults if tick > 22} == {False}
