"""The interaction range: which pedestrians are neighbours, and what those beyond it do."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from sonata2d.agents.pedestrians.crowd import Crowd
from sonata2d.agents.pedestrians.models.base import Walkers
from sonata2d.agents.pedestrians.neighbours import (
    FADING_DISTANCE,
    INTERACTION_RANGE,
    WALL_RANGE,
    find_neighbours,
    find_walls,
    range_of,
    with_longer_lists,
)
from sonata2d.core.barrier_grid import Solids, solids_of
from sonata2d.core.compiled.kernel import kernel
from sonata2d.core.compiled.packing import pack, unpack
from sonata2d.core.entities import Group, Human, Wall
from sonata2d.core.geometry import Barriers, Pose, Twist, segments_cross
from sonata2d.core.portable_math import Array, BoolArray, IntArray
from sonata2d.registry import PEDESTRIAN_MODELS
from sonata2d.sim.world import World

from ..conftest import room, walker

HALL = ((-40.0, -40.0), (40.0, -40.0), (40.0, 40.0), (-40.0, 40.0))
NO_WALLS = solids_of(Barriers.of(()))


@kernel
def compiled_search(packed_walkers: Any, is_present: BoolArray, packed_view_blocks: Any) -> int:
    return find_neighbours(unpack(packed_walkers, Walkers), is_present, unpack(packed_view_blocks, Solids))


def walkers_at(position: Array, group: IntArray, capacity: int) -> Walkers:
    count = len(position)
    vectors, numbers = np.zeros((count, 2)), np.zeros(count)
    lists = np.zeros(count + 1, dtype=np.int64), np.zeros(capacity, dtype=np.int64), np.full(capacity, np.nan)
    flags = numbers > 0.0
    return Walkers(
        position,
        vectors,
        vectors,
        vectors,
        numbers,
        numbers,
        flags,
        *lists,
        lists[0],
        lists[1][:0],
        group,
        flags,
        numbers,
        numbers,
        numbers,
        numbers,
        vectors,
    )


def positions(rng: np.random.Generator, count: int) -> Array:
    """Random positions in areas of all sizes and shapes, some of them on the edges of cells."""
    size = 10.0 ** rng.uniform(-1.0, 3.0, 2)
    found: Array = rng.uniform(-size, size, (count, 2))
    if rng.random() < 0.3:
        found = np.round(found / INTERACTION_RANGE) * INTERACTION_RANGE
    return found


@pytest.mark.parametrize("seed", range(40))
def test_the_neighbours_are_those_of_a_search_through_all_pairs(seed: int) -> None:
    rng = np.random.default_rng(seed)
    count = int(rng.integers(0, 60))
    position, group = positions(rng, count), rng.integers(-1, max(count // 4, 1), count)
    is_present = rng.random(count) < rng.choice([0.0, 0.7, 1.0], p=[0.05, 0.45, 0.5])
    x, y = (position[:, None, axis] - position[None, :, axis] for axis in (0, 1))
    distance = np.sqrt(x * x + y * y)
    is_neighbour = (distance < INTERACTION_RANGE) | ((group[:, None] == group) & (group >= 0))
    is_neighbour &= is_present[:, None] & is_present & ~np.eye(count, dtype=bool)
    ends = positions(rng, 2 * int(rng.integers(0, 8))).reshape(-1, 4).tolist()
    walls = Barriers.of([((ax, ay), (bx, by), 0.05) for ax, ay, bx, by in ends])
    i, j = (index.ravel() for index in np.indices((count, count)))
    is_seen = ~segments_cross(position[i], position[j], walls).any(axis=0).reshape(count, count)
    is_seen &= distance < INTERACTION_RANGE
    in_sight = (is_neighbour & is_seen).sum(axis=1).tolist()
    reach = np.array([range_of(number) for number in in_sight]).reshape(-1, 1)
    attention = np.clip((reach - distance) / FADING_DISTANCE, 0.0, 1.0) * is_seen
    view_blocks = solids_of(walls)
    is_listed = is_neighbour & ((attention > 0.0) | ((group[:, None] == group) & (group >= 0)))

    for is_compiled in (False, True):
        walkers = walkers_at(position, group, count * count)
        if is_compiled:
            total = compiled_search(pack(walkers), is_present, pack(view_blocks))
        else:
            total = find_neighbours(walkers, is_present, view_blocks)
        assert total == is_neighbour.sum()
        assert walkers.neighbour_start[-1] == is_listed.sum()
        for i in range(count):
            row = slice(*walkers.neighbour_start[i : i + 2])
            assert walkers.neighbour[row].tolist() == np.flatnonzero(is_listed[i]).tolist()
            assert walkers.attention[row].tolist() == attention[i, is_listed[i]].tolist()


@pytest.mark.parametrize("seed", range(10))
def test_the_walls_of_each_pedestrian_are_those_within_the_range(seed: int) -> None:
    rng = np.random.default_rng(seed)
    count, start, along = int(rng.integers(1, 20)), rng.uniform(-10.0, 10.0, (60, 2)), rng.uniform(-4.0, 4.0, (60, 2))
    rows = zip(start.tolist(), (start + along * (rng.random((60, 1)) < 0.8)).tolist(), strict=True)
    barriers = Barriers.of([((x, y), (to_x, to_y), float(rng.uniform(0.0, 0.3))) for (x, y), (to_x, to_y) in rows])
    is_present = rng.random(count) < 0.8
    walkers = walkers_at(rng.uniform(-11.0, 11.0, (count, 2)), np.full(count, -1), 0)
    needed = find_walls(walkers, is_present, solids_of(barriers))
    walkers = with_longer_lists(walkers, 0, needed)
    assert find_walls(walkers, is_present, solids_of(barriers)) == needed == walkers.wall_start[-1]
    gaps = barriers.gaps(walkers.position)
    for i in range(count):
        expected = np.flatnonzero(gaps[:, i] < WALL_RANGE) if is_present[i] else []
        assert walkers.wall[slice(*walkers.wall_start[i : i + 2])].tolist() == list(expected)


def test_the_range_shrinks_in_a_crowd_and_people_behind_walls_are_not_counted() -> None:
    assert [range_of(number) for number in (0, 20)] == [INTERACTION_RANGE] * 2
    assert range_of(80) == INTERACTION_RANGE / 2.0
    position = np.array([(0.0, 0.0), (4.0, 0.0), *((0.0, -1.0 - 0.02 * k) for k in range(79))])
    walkers = walkers_at(position, np.full(81, -1), 81 * 81)
    for walls, expected in ((NO_WALLS, False), (solids_of(Barriers.of([((-5.0, -0.5), (5.0, -0.5), 0.05)])), True)):
        find_neighbours(walkers, np.ones(81, dtype=bool), walls)
        assert (walkers.neighbour[0] == 1) == expected  # the first pedestrian attends to the second


def test_lists_that_are_too_short_are_left_alone_and_their_length_is_returned() -> None:
    walkers = walkers_at(np.zeros((3, 2)), np.full(3, -1), 5)
    assert find_neighbours(walkers, np.ones(3, dtype=bool), NO_WALLS) == 6
    assert not walkers.neighbour.any()


def test_people_who_were_close_together_walk_among_many_walls() -> None:
    """The list of neighbours, which has grown at the start, is not shortened when that of walls grows."""
    places = [(0.7 * (k % 4) - 6.0, 0.7 * (k // 4)) for k in range(10)]
    people = [
        Human(k, Pose(x, y), behaviour="walking", goals=((9.0, 4.0 * k - 20.0),)) for k, (x, y) in enumerate(places, 1)
    ]
    ends = [(0.15 * (k % 60), 0.37 * (k // 60) - 20.0) for k in range(6000)]
    walls = [Wall((x, y), (x + 0.05, y + 0.01)) for x, y in ends if abs(x - 4.0) < 2.0 and y % 4.0 > 1.5]
    scene = room(people, polygon=HALL, inner=walls, robot=Pose(-35.0, -35.0))
    crowd, world = Crowd(scene), World(scene)
    lengths = []
    for _ in range(120):
        world.step(Twist(), crowd.act(world.snapshot()))
        lists = crowd._state.value.walkers
        lengths.append((len(lists.neighbour), len(lists.wall)))
    assert lengths[-1] > lengths[0]
    assert lengths == sorted(lengths)


def accelerations(*humans: Human, groups: tuple[Group, ...] = ()) -> Array:
    """Of the pedestrians in a large hall, in the first tick."""
    scene = room(humans, polygon=HALL, robot=Pose(-35.0, -35.0), groups=groups)
    return Crowd(scene).act(World(scene).snapshot()).acceleration


@pytest.mark.parametrize("model", PEDESTRIAN_MODELS.built_in)
def test_pedestrians_beyond_the_range_have_no_effect(model: str) -> None:
    kind = {"model": model, "behaviour": "walking", "velocity": (1.3, 0.0), "goals": ((30.0, 0.0),)}
    first = walker(1, 0.0, 0.0, **kind)

    def with_another(distance: float) -> Array:
        other = walker(2, distance, 0.1, **{**kind, "velocity": (-1.3, 0.0), "goals": ((-30.0, 0.0),)})
        return accelerations(first, other)[0]

    alone = accelerations(first)[0]
    assert np.array_equal(with_another(INTERACTION_RANGE), alone)
    assert not np.array_equal(with_another(1.5), alone)


@pytest.mark.parametrize("model", ["sonata2026", "moussaid2009", "farina2017"])
def test_members_of_a_group_keep_together_beyond_the_range(model: str) -> None:
    pair = [walker(k + 1, 8.0 * k, 0.0, model=model, group=1) for k in range(2)]
    alone = accelerations(*(walker(k + 1, 8.0 * k, 0.0, model=model) for k in range(2)))
    assert not np.array_equal(accelerations(*pair, groups=(Group(1, "walking", (1, 2)),))[1], alone[1])
