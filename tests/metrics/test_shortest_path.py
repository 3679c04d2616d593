"""Shortest paths of a disc: by hand, and by a brute-force visibility graph over densely sampled outlines."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from sonata2d.core.entities import Furniture, Goal, Wall
from sonata2d.core.geometry import Barriers, Disc, Point, Pose, Rectangle, segment_distances
from sonata2d.core.portable_math import Array, BoolArray
from sonata2d.core.scene import Scene
from sonata2d.metrics.shortest_path import shortest_length

from ..conftest import room
from .samples import stay, value

R = 0.3  # m, of the robot in `room`


def length(scene: Scene, start: Point = (-3.0, 0.0)) -> float | None:
    """The metric for a robot that stands at the start."""
    return value("shortest_length", scene, stay(*start, 2))


def around(end: Point, start: Point, goal: Point) -> float:
    """Two tangents and an arc around one point at the robot's radius, on the outer side of the bend."""
    legs = math.dist(start, end), math.dist(goal, end)
    chord = math.acos((legs[0] ** 2 + legs[1] ** 2 - math.dist(start, goal) ** 2) / (2 * legs[0] * legs[1]))
    arc = 2.0 * math.pi - chord - sum(math.acos(R / leg) for leg in legs)
    return sum(math.sqrt(leg**2 - R**2) for leg in legs) + R * arc


def test_a_path_bends_around_the_end_of_a_wall() -> None:
    scene = room(inner=[Wall((0.0, -4.0), (0.0, 0.0))])
    tangent = math.sqrt(9.0 - 0.09)
    assert length(scene) == pytest.approx(2.0 * tangent + R * 2.0 * math.asin(0.1) - 0.4, abs=1e-5)
    assert length(scene) == pytest.approx(around((0.0, 0.0), (-3.0, 0.0), (3.0, 0.0)) - 0.4, abs=1e-5)


def test_a_path_around_a_round_table_has_one_arc() -> None:
    scene = room(furniture=[Furniture(9, "table", Pose(0.0, 0.0), Disc(0.6))])
    tangent, angle = math.sqrt(9.0 - 0.81), math.acos(0.9 / 3.0)
    assert length(scene) == pytest.approx(2.0 * tangent + 0.9 * (math.pi - 2.0 * angle) - 0.4, abs=1e-5)


@pytest.mark.parametrize("theta", [0.0, math.pi / 2.0, math.pi])
def test_a_path_around_a_rectangle_has_two_arcs_and_its_side(theta: float) -> None:
    """A square of 2 m: around the two corners at y = 1, whatever its quarter turns."""
    scene = room(furniture=[Furniture(9, "table", Pose(0.0, 0.0, theta), Rectangle(2.0, 2.0))])
    leg = math.sqrt(4.0 + 1.0 - R**2)
    turned = math.atan2(1.0, 2.0) + math.asin(R / math.sqrt(5.0))  # from the first leg to the side
    assert length(scene) == pytest.approx(2.0 * (leg + R * turned) + 2.0 - 0.4, abs=1e-5)


def test_a_rotated_rectangle_is_passed_at_its_corner() -> None:
    """A square with a diagonal of 2 m, whose upper and lower corners are 1 m from the straight line."""
    table = Furniture(9, "table", Pose(0.0, 0.0, math.pi / 4.0), Rectangle(math.sqrt(2.0), math.sqrt(2.0)))
    exact = around((0.0, 1.0), (-3.0, 0.0), (3.0, 0.0)) - 0.4
    assert length(room(furniture=[table])) == pytest.approx(exact, abs=1e-4)


@pytest.mark.parametrize(("width", "is_open"), [(0.6001, True), (0.6, True), (0.5999, False)])
def test_a_door_must_be_as_wide_as_the_robot(width: float, is_open: bool) -> None:
    doors = [Wall((0.0, -4.0), (0.0, 2.0)), Wall((0.0, 2.0 + width), (0.0, 4.0))]
    found = length(room(inner=doors))
    assert (found is not None) == is_open
    if is_open:  # through the middle of the door, around its lower jamb
        assert found == pytest.approx(around((0.0, 2.0), (-3.0, 0.0), (3.0, 0.0)) - 0.4, abs=1e-3)


def test_a_path_ends_at_the_first_position_within_the_distance_of_the_goal() -> None:
    assert length(room()) == pytest.approx(5.6)
    assert length(room(goal=(-2.7, 0.2))) == 0.0
    assert length(room(goal=(-2.6, 0.0))) == 0.0
    # The goal is 0.1 m from a wall; the robot passes 0.3 m from it, and is 0.4 m from the goal √(0.4² - 0.2²) m before.
    at_wall = room(goal=(3.0, 3.9), robot=Pose(-3.0, 3.7))
    assert length(at_wall, (-3.0, 3.7)) == pytest.approx(6.0 - math.sqrt(0.4**2 - 0.2**2), abs=1e-5)
    # The goal is behind the wall, within its distance: success counts positions on this side.
    behind = room(goal=(3.0, 0.0), inner=[Wall((2.9, -4.0), (2.9, 4.0))])
    assert length(behind) == pytest.approx(5.6)
    # No position within the distance is free.
    assert length(replace(room(), goal=Goal(3.0, 3.95, distance=0.2))) is None


def test_a_path_ends_on_an_arc_if_the_corner_is_within_the_distance_of_the_goal() -> None:
    """The corner is 0.35 m from the goal, beyond it: the robot is 0.4 m from the goal before it has left the corner."""
    goal = (0.35, -0.05)
    scene = room(goal=goal, inner=[Wall((0.0, -4.0), (0.0, 0.0))], robot=Pose(-3.0, -2.0))
    exact = min(
        math.sqrt(math.dist((-3.0, -2.0), (0.0, 0.0)) ** 2 - R**2) + R * turned
        for turned in np.linspace(0.0, math.pi, 100_001)
        if math.dist(on_arc(turned), goal) <= 0.4
    )
    assert length(scene, (-3.0, -2.0)) == pytest.approx(exact, abs=1e-4)


def on_arc(turned: float) -> Point:
    """A point of the circle around (0, 0) after the tangent from (-3, -2) and a right turn."""
    first = math.atan2(-2.0, -3.0) - math.acos(R / math.dist((-3.0, -2.0), (0.0, 0.0)))
    return R * math.cos(first - turned), R * math.sin(first - turned)


def test_a_robot_that_starts_too_near_to_a_wall_moves_away_from_it() -> None:
    assert length(room(robot=Pose(-3.0, -3.8)), (-3.0, -3.8)) == pytest.approx(math.hypot(6.0, 3.8) - 0.4, abs=1e-5)


def test_a_path_keeps_the_smaller_distance_from_a_wall_that_the_robot_starts_too_near_to() -> None:
    """Along the wall at 0.2 m, around its end at 0.2 m, and straight to the goal."""
    scene = room(inner=[Wall((0.0, -4.0), (0.0, 0.0))], goal=(3.0, -2.0))
    arc_end, tangent = math.atan2(-2.0, 3.0) + math.acos(0.2 / math.sqrt(13.0)), math.sqrt(13.0 - 0.2**2)
    exact = 2.0 + 0.2 * (math.pi - arc_end) + tangent - 0.4
    assert length(scene, (-0.2, -2.0)) == pytest.approx(exact, abs=1e-5)
    assert length(scene, (0.0, -2.0)) is None  # on the wall itself
    beyond = math.pi / 2.0 - arc_end
    assert length(scene, (0.0, 0.2)) == pytest.approx(0.2 * beyond + tangent - 0.4, abs=1e-5)


def test_a_path_leads_out_of_a_round_table_that_the_robot_starts_in_but_not_through_the_sides_of_others() -> None:
    scene = room(furniture=[Furniture(9, "table", Pose(0.0, 0.0), Disc(0.6))])
    tangent, angle = math.sqrt(9.0 - 0.25), math.acos(0.5 / 3.0)
    assert length(scene, (-0.5, 0.0)) == pytest.approx(tangent + 0.5 * (math.pi - angle) - 0.4, abs=1e-5)
    assert length(room(furniture=[Furniture(9, "table", Pose(0.0, 0.0), Rectangle(2.0, 1.0))]), (-0.5, 0.0)) is None


def cluttered(seed: int) -> Barriers:
    """A room of 8 m by 8 m with two inner walls, five rectangles and five discs."""
    draw = np.random.default_rng(seed)
    furniture = [
        Furniture(
            k,
            "table",
            Pose(*draw.uniform(-3.0, 3.0, 2), draw.uniform(-3.0, 3.0)),
            Rectangle(*draw.uniform(0.3, 1.2, 2)),
        )
        for k in range(5)
    ]
    furniture += [
        Furniture(k, "plant", Pose(*draw.uniform(-3.5, 3.5, 2)), Disc(draw.uniform(0.1, 0.5))) for k in range(5)
    ]
    inner = [Wall((-1.0, -4.0), (-1.0, draw.uniform(-1.0, 2.0))), Wall((1.0, 4.0), (1.0, draw.uniform(-1.0, 1.0)))]
    return room(furniture=furniture, inner=inner).barriers


@pytest.mark.parametrize("too_near", [0, 1])
@pytest.mark.parametrize("seed", range(20))
def test_paths_are_as_short_as_those_of_a_dense_visibility_graph(seed: int, too_near: int) -> None:
    """From free positions, and from positions that one barrier is too near to."""
    draw, barriers = np.random.default_rng(seed), cluttered(seed)
    radius, distance = draw.uniform(0.15, 0.4), draw.uniform(0.1, 1.0)
    points = draw.uniform(-3.8, 3.8, (500, 2))
    start, goal = points[(barriers.gaps(points) < radius).sum(axis=0) == too_near][0], points[-1]
    found = shortest_length(barriers.table, radius, *start.tolist(), *goal.tolist(), distance)
    less = np.minimum(barriers.gaps(start[None])[:, 0] - radius, 0.0)
    barriers = Barriers(barriers.start, barriers.end, barriers.radius + less)
    expected = sampled_length(barriers, radius, start, goal, distance)
    assert found == pytest.approx(expected, abs=0.01)
    assert found <= expected + 1e-6


def sampled_length(barriers: Barriers, radius: float, start: Array, goal: Array, distance: float) -> float:
    """Dijkstra's algorithm over points of the circles around the ends of barriers and around the goal."""
    if math.dist(start, goal) <= distance:
        return 0.0
    ends = np.concatenate((barriers.start, barriers.end))
    reach = (np.tile(barriers.radius, 2) + radius) / math.cos(math.radians(2.5))  # so that chords stay outside
    circles = np.unique(np.column_stack((ends, reach)), axis=0)
    x, y = (start - circles[:, :2]).T
    around = np.exp(1j * np.arctan2(y, x))[:, None] * np.exp(2j * np.pi * np.arange(72) / 72)  # from the start's side
    nodes = (circles[:, None, :2] + circles[:, None, 2:] * np.stack((around.real, around.imag), axis=2)).reshape(-1, 2)
    targets = goal + distance * directions(720)
    targets = targets[is_free(barriers, radius, targets)]
    nodes = np.concatenate((start[None], nodes[is_free(barriers, radius, nodes)]))
    lengths, is_open, best = np.full(len(nodes), np.inf), np.ones(len(nodes), dtype=bool), math.inf
    lengths[0] = 0.0
    while True:
        k = int(np.argmin(np.where(is_open, lengths, np.inf)))
        if not is_open[k] or not lengths[k] < best:
            return best
        is_open[k] = False
        reached = reachable(barriers, radius, nodes[k], lengths[k], targets, np.full(len(targets), best))
        best = min(best, float(reached.min(initial=np.inf)))
        lengths = np.minimum(lengths, reachable(barriers, radius, nodes[k], lengths[k], nodes, lengths))


def reachable(barriers: Barriers, radius: float, at: Array, travelled: float, points: Array, known: Array) -> Array:
    """Lengths of paths straight on to points; infinite where these are longer than known, or not free."""
    found = travelled + np.hypot(*(points - at).T)
    shorter = np.flatnonzero(found < known)
    gaps = segment_distances(np.tile(at, (len(shorter), 1)), points[shorter], barriers).min(axis=0)
    result = np.full(len(points), np.inf)
    result[shorter[gaps >= radius - 1e-6]] = found[shorter[gaps >= radius - 1e-6]]
    return result


def directions(count: int) -> Array:
    angles = np.arange(count) * (2.0 * np.pi / count)
    return np.stack((np.cos(angles), np.sin(angles)), axis=1)


def is_free(barriers: Barriers, radius: float, points: Array) -> BoolArray:
    free: BoolArray = barriers.gaps(points).min(axis=0) >= radius - 1e-6
    return free
