"""Floor plans: sizes as set, passable doors, and paths between all free points."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sonata2d.core.geometry import inside_polygon
from sonata2d.core.navigation import FreeSpace
from sonata2d.core.rng import RandomStream
from sonata2d.core.scene import Scene
from sonata2d.errors import ConfigError
from sonata2d.scenegen.floor_plans import FloorPlan, draw_floor_plan
from sonata2d.scenegen.generator import generate
from sonata2d.scenegen.scenario.config import ScenarioConfig
from sonata2d.scenegen.scenario.rooms import RoomConfig

KINDS = ("t", "u", "corridor", "doorway", "crossing", "hall")


def plans(kind: str, **sizes: object) -> list[FloorPlan]:
    config = RoomConfig(kinds=[kind], **sizes)
    return [draw_floor_plan(config, RandomStream(3, k, "scene")) for k in range(40)]


def area(plan: FloorPlan) -> float:
    x, y = plan.outline.T
    return float((x * np.roll(y, -1) - np.roll(x, -1) * y).sum()) / 2


@pytest.mark.parametrize(
    ("kind", "expected"),
    [
        ("t", 10 * 3 + (8 - 3) * 3),
        ("u", 10 * 3 + 2 * (8 - 3) * 3),
        ("corridor", 12 * 2),
        ("doorway", 2 * 5 * 5),
        ("crossing", 2 * 12 * 2 - 2 * 2),
        ("hall", 14 * 14),
    ],
)
def test_areas_follow_from_the_sizes(kind: str, expected: float) -> None:
    sizes = {"span": 10, "depth": 8, "arm": 3, "corridor_length": 12, "corridor_width": 2, "chamber": 5, "hall": 14}
    assert all(area(plan) == pytest.approx(expected) for plan in plans(kind, **sizes))


@pytest.mark.parametrize("kind", KINDS)
def test_plans_are_centred_and_counter_clockwise(kind: str) -> None:
    for plan in plans(kind):
        assert area(plan) > 0.0
        assert np.allclose(plan.outline.max(axis=0), -plan.outline.min(axis=0), atol=2e-4)


@pytest.mark.parametrize(("kind", "orientations"), [("t", 4), ("u", 4), ("corridor", 2), ("doorway", 2), ("l", 4)])
def test_plans_have_all_orientations(kind: str, orientations: int) -> None:
    sizes = {"span": 10, "depth": 8, "arm": 3, "corridor_length": 12, "corridor_width": 2, "chamber": 5, "unit": 3}
    assert len({frozenset(plan.polygon) for plan in plans(kind, **sizes)}) == orientations


def test_turns_0_gives_one_orientation() -> None:
    sizes = {"span": 10, "depth": 8, "arm": 3}
    assert len({plan.polygon for plan in plans("t", **sizes, turns=0)}) == 1


def test_a_doorway_has_the_given_width_and_lies_within_its_wall() -> None:
    for plan in plans("doorway", door=(0.9, 1.2), door_offset=(-9, 9)):
        lower, upper = plan.inner_walls
        assert 0.9 - 2e-4 <= math.dist(lower.end, upper.start) <= 1.2 + 2e-4
        for wall in plan.inner_walls:
            assert math.dist(wall.start, wall.end) >= 0.299


@pytest.mark.parametrize("kind", KINDS)
def test_all_free_points_are_connected(kind: str) -> None:
    for episode in range(6):
        scene = generate(ScenarioConfig(humans=0, relations=0, tables=0, plants=0, room={"kinds": kind}), 1, episode)
        space = FreeSpace(scene.outline, scene.barriers, 0.35)
        points = free_points(scene, space)
        assert all(math.isfinite(space.distance(point, points[0])) for point in points)


def free_points(scene: Scene, space: FreeSpace) -> list[tuple[float, float]]:
    low, high = scene.outline.min(axis=0), scene.outline.max(axis=0)
    grid = np.stack(np.meshgrid(*np.linspace(low, high, 9).T), axis=-1).reshape(-1, 2)
    grid = grid[inside_polygon(grid, scene.outline)]
    return [tuple(point) for point in grid[space.is_free(grid)].tolist()]


@pytest.mark.parametrize("kind", KINDS)
def test_the_family_contains_the_kind_of_room(kind: str) -> None:
    assert generate(ScenarioConfig(humans=3, room={"kinds": kind}), 1).family == f"custom/{kind}"


def test_mirroring_a_plan_changes_the_sign_of_y() -> None:
    for plan in plans("l"):
        assert {(x, -y) for x, y in plan.mirrored().polygon} == set(plan.polygon)
        assert plan.mirrored().mirrored() == plan
        assert area(plan.mirrored()) == pytest.approx(area(plan))


@pytest.mark.parametrize(
    ("sizes", "message"),
    [
        ({"arm": 5}, "5 m must be less than half the span, which may be 4 m"),
        ({"corridor_width": 12}, "12 m must be less than the corridor's length, which may be 10 m"),
        ({"door": 4.5}, "4.5 m must be less than a chamber's side, which may be 4 m"),
        ({"door": 0.3}, "a door must be 0.7 m wide or more"),
        ({"hall": 0}, "a room's size must be above 0"),
        ({"kinds": "hal"}, "no room kind is named 'hal'; did you mean 'hall'?"),
    ],
)
def test_invalid_sizes_are_refused(sizes: dict[str, object], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        RoomConfig(**sizes)
