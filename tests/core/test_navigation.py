"""The free space of a scene and the shortest paths through it."""

import math
import os
import pickle
import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

import sonata2d as s2
from sonata2d.core.geometry import Barriers, Disc, Pose, Rectangle
from sonata2d.core.navigation import FreeSpace

SQUARE = ((0.0, 0.0), (8.0, 0.0), (8.0, 8.0), (0.0, 8.0))
L_SHAPE = ((0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (8.0, 4.0), (8.0, 8.0), (0.0, 8.0))


def space(corners=SQUARE, walls=(), objects=(), clearance=0.3):
    """The free space of a room with inner walls, and objects given as (shape, pose)."""
    following = (*corners[1:], corners[0])
    edges = [(a, b, 0.0) for a, b in zip(corners, following, strict=True)]
    edges += [(a, b, 0.0) for a, b in walls]
    edges += [edge for shape, pose in objects for edge in shape.edges(pose)]
    return FreeSpace(np.array(corners), Barriers.of(edges), clearance)


def furnished(seed):
    """The free space of a room with two inner walls, five tables and six plants."""
    rng = np.random.default_rng(seed)
    objects = [(Rectangle(0.8, 0.8), Pose(*rng.uniform(1, 7, 2), rng.uniform(-3, 3))) for _ in range(5)]
    objects += [(Disc(0.2), Pose(*rng.uniform(0.5, 7.5, 2))) for _ in range(6)]
    return space(walls=[((3.0, 0.0), (3.0, 3.0)), ((5.0, 8.0), (5.0, 5.0))], objects=objects)


def free_points(room, count, seed):
    points = np.random.default_rng(seed).uniform(0.0, 8.0, (20 * count, 2))
    return points[room.is_free(points)][:count]


def nearest_free(room, point):
    """The free position by which paths from a point pass; None where it has no path to itself."""
    path = room.path(point, point)
    return None if path is None else tuple(path[min(1, len(path) - 1)].tolist())


def length(path):
    return float(sum(math.dist(a, b) for a, b in pairwise(path)))


def test_free_space_ends_at_its_clearance_from_walls_and_furniture():
    room = space(objects=[(Rectangle(1.0, 1.0), Pose(4.0, 4.0)), (Disc(0.2), Pose(2.0, 2.0))])
    points = np.array([[0.31, 4.0], [0.29, 4.0], [4.0, 4.81], [4.0, 4.79], [2.51, 2.0], [2.49, 2.0], [-1.0, 4.0]])
    assert room.is_free(points).tolist() == [True, False, True, False, True, False, False]


def test_the_inside_of_large_furniture_is_not_free():
    room = space(objects=[(Rectangle(3.0, 2.0), Pose(4.0, 4.0, 0.3)), (Disc(0.2), Pose(1.0, 1.0))])
    assert room.is_free(np.array([[4.0, 4.0], [4.0, 6.0]])).tolist() == [False, True]


@pytest.mark.parametrize("seed", range(4))
def test_a_line_is_clear_where_all_its_points_keep_the_clearance(seed):
    room = furnished(seed)
    start, end = np.random.default_rng(seed).uniform(0.0, 8.0, (2, 200, 2))
    clear = room.is_clear(start, end)
    for a, b, is_clear in zip(start, end, clear, strict=True):
        margin = room.barriers.gaps(np.linspace(a, b, 400)).min() - room.clearance
        assert is_clear == (margin >= 0.0) or abs(margin) < 0.02
    assert 0 < clear.sum() < 200


@pytest.mark.parametrize("seed", range(4))
def test_a_place_is_open_if_it_is_free_and_can_be_reached_straight(seed):
    room = furnished(seed)
    start, end = np.random.default_rng(seed).uniform(-0.5, 8.5, (2, 60, 2))
    expected = room.is_free(end) & room.is_clear(start, end)
    pairs = zip(map(tuple, start.tolist()), map(tuple, end.tolist()), strict=True)
    assert [room.is_open(a, b) for a, b in pairs] == expected.tolist()


def test_an_unobstructed_path_is_straight():
    path = space().path((1.0, 1.0), (7.0, 6.0))
    assert path.tolist() == [[1.0, 1.0], [7.0, 6.0]]


def test_a_path_turns_at_the_corner_of_an_l_shape():
    path = space(L_SHAPE).path((2.0, 1.0), (7.0, 6.0))
    assert len(path) == 3
    assert math.dist(path[1], (4.0, 4.0)) == pytest.approx(0.3 * math.sqrt(2), abs=0.01)


def test_a_path_needs_a_doorway_wider_than_the_disc():
    def doorway(width):
        return space(walls=[((4.0, 0.0), (4.0, 4.0)), ((4.0, 4.0 + width), (4.0, 8.0))])

    assert doorway(0.62).distance((1.0, 1.0), (7.0, 1.0)) > 8.0
    assert doorway(0.58).path((1.0, 1.0), (7.0, 1.0)) is None
    assert doorway(0.58).distance((1.0, 1.0), (7.0, 1.0)) == math.inf


def test_a_path_passes_close_to_the_end_of_a_wall():
    room = space(walls=[((4.0, 0.0), (4.0, 5.0))])
    shortest = 2 * math.dist((1.0, 4.0), (4.0, 5.3))
    assert room.distance((1.0, 4.0), (7.0, 4.0)) == pytest.approx(shortest, abs=0.1)


@pytest.mark.parametrize("seed", range(6))
def test_every_path_keeps_the_clearance(seed):
    room = furnished(seed)
    starts, goals = free_points(room, 15, seed), free_points(room, 15, seed + 100)
    paths = [room.path(tuple(a), tuple(b)) for a, b in zip(starts.tolist(), goals.tolist(), strict=True)]
    for path in [path for path in paths if path is not None]:
        samples = np.concatenate([np.linspace(a, b, 40) for a, b in pairwise(path)])
        assert room.barriers.gaps(samples).min() >= room.clearance - 1e-5


@pytest.mark.parametrize("seed", range(4))
def test_path_lengths_agree_with_dijkstra_on_a_fine_grid(seed):
    room = furnished(seed)
    xs = np.linspace(0.0, 8.0, 81)
    grid = np.stack(np.meshgrid(xs, xs, indexing="ij"), axis=-1).reshape(-1, 2)
    free = room.is_free(grid).reshape(81, 81)
    start, goal = (int(k) for k in np.random.default_rng(seed).choice(np.flatnonzero(free), 2, replace=False))
    expected = grid_distance(free, divmod(start, 81), divmod(goal, 81)) * 0.1
    found = room.distance(tuple(grid[start]), tuple(grid[goal]))
    assert found == pytest.approx(expected, rel=0.09) if expected < math.inf else found == math.inf


def grid_distance(free, start, goal):
    """Dijkstra's algorithm on eight neighbours, in cells; up to 8 % too long, as it turns by 45° only."""
    import heapq

    best, heap = {start: 0.0}, [(0.0, start)]
    while heap:
        distance, (i, j) = heapq.heappop(heap)
        if (i, j) == goal:
            return distance
        for di, dj in ((0, 1), (1, 0), (0, -1), (-1, 0), (1, 1), (1, -1), (-1, 1), (-1, -1)):
            cell, cost = (i + di, j + dj), distance + math.hypot(di, dj)
            inside = 0 <= cell[0] < len(free) and 0 <= cell[1] < len(free)
            if inside and free[cell] and cost < best.get(cell, math.inf):
                best[cell] = cost
                heapq.heappush(heap, (cost, cell))
    return math.inf


@pytest.mark.parametrize("seed", range(4))
def test_distances_equal_the_lengths_of_paths(seed):
    room = furnished(seed)
    points = free_points(room, 30, seed).tolist()
    for point in points:
        path = room.path(point, points[0])
        assert room.distance(point, points[0]) == (math.inf if path is None else pytest.approx(length(path)))


def test_earlier_searches_change_no_path():
    """The graph is built when it is first needed."""
    used = furnished(2)
    starts, goals = free_points(used, 20, 1), free_points(used, 20, 2)
    assert used.distance((1.0, 1.0), (7.0, 7.0)) < math.inf
    for start, goal in zip(map(tuple, starts.tolist()), map(tuple, goals.tolist()), strict=True):
        assert np.array_equal(furnished(2).path(start, goal), used.path(start, goal))
        assert nearest_free(furnished(2), start) == nearest_free(used, start) == start


def test_distance_is_symmetric():
    room = furnished(1)
    a, b = (tuple(point) for point in free_points(room, 2, 5).tolist())
    assert room.distance(a, b) == pytest.approx(room.distance(b, a))


@settings(max_examples=50)
@given(st.floats(0.01, 7.99), st.floats(0.01, 7.99))
def test_the_nearest_free_position_is_free_and_near(x, y):
    room = space(objects=[(Disc(0.2), Pose(2.0, 2.0)), (Rectangle(0.8, 0.8), Pose(5.0, 5.0))])
    position = nearest_free(room, (x, y))
    if position is not None:
        assert room.is_free(np.array([position]))[0]
        assert math.dist(position, (x, y)) < 1.3
    if room.is_free(np.array([[x, y]]))[0]:
        assert position == (x, y)


def test_a_start_too_near_to_a_wall_still_has_a_path():
    room = space(L_SHAPE)
    for start in ((0.05, 0.05), (3.9, 1.0), (2.0, 0.1)):
        path = room.path(start, (7.0, 6.0))
        assert tuple(path[0]) == start
        assert tuple(path[-1]) == (7.0, 6.0)
        assert not math.isinf(room.distance(start, (7.0, 6.0)))


def test_the_nearest_free_position_is_never_behind_a_wall():
    room = space(walls=[((4.0, 0.0), (4.0, 8.0)), ((4.1, 0.0), (4.1, 8.0))])
    assert nearest_free(room, (4.05, 4.0)) is None
    assert room.path((4.05, 4.0), (1.0, 1.0)) is None


def test_standing_pedestrians_block_a_gap():
    door = [((4.0, 0.0), (4.0, 3.5)), ((4.0, 4.5), (4.0, 8.0))]
    room = space(walls=door)
    standing = Barriers.of(Disc(0.2).edges(Pose(4.0, 4.0)))
    closed = FreeSpace(room.outline, room.barriers.joined(standing), room.clearance)
    assert room.path((1.0, 4.0), (7.0, 4.0)) is not None
    assert closed.path((1.0, 4.0), (7.0, 4.0)) is None


def test_a_clearance_of_zero_is_rejected():
    with pytest.raises(ValueError, match="clearance must be positive, got 0"):
        space(clearance=0.0)


def test_a_wall_across_the_room_leaves_no_path():
    room = space(walls=[((4.0, 0.0), (4.0, 8.0))])
    assert room.path((1.0, 1.0), (7.0, 1.0)) is None
    assert room.distance((1.0, 1.0), (7.0, 1.0)) == math.inf


def test_a_room_without_barriers_is_free():
    room = FreeSpace(np.array(SQUARE), Barriers.of([]), 0.3)
    assert room.path((1.0, 1.0), (7.0, 7.0)).tolist() == [[1.0, 1.0], [7.0, 7.0]]


def cluttered(seed):
    """A room with random walls, tables and plants, and the discs of four standing people."""
    rng = np.random.default_rng(seed)
    tables, plants, number = rng.integers(0, 14), rng.integers(0, 8), rng.integers(0, 10)
    objects = [(Rectangle(0.8, 0.6), Pose(*rng.uniform(0.5, 7.5, 2), rng.uniform(-3, 3))) for _ in range(tables)]
    objects += [(Disc(0.2), Pose(*rng.uniform(0.5, 7.5, 2))) for _ in range(plants)]
    walls = []
    for x, y, size, angle in zip(*rng.uniform(0, 8, (2, number)), *rng.uniform(0.5, 3, (2, number)), strict=True):
        walls.append(((x, y), (x + size * math.cos(2 * angle), y + size * math.sin(2 * angle))))
    people = [(tuple(place), tuple(place), 0.2) for place in rng.uniform(0.5, 7.5, (4, 2)).tolist()]
    return space(walls=walls, objects=objects, clearance=rng.uniform(0.15, 0.45)), Barriers.of(people)


def shortest_over_nodes(room, start, goal):
    """Length of the shortest path over all nodes of the graph of a room, by Dijkstra's algorithm on all pairs."""
    graph = room._graph.value
    nodes = [*graph.nodes[~graph.is_covered, :2], *graph.added_nodes[: max(graph.added_count[0], 0), :2]]
    places = np.array([start, goal, *nodes])
    i, j = np.triu_indices(len(places), 1)
    lengths = np.full((len(places), len(places)), np.inf)
    lengths[i, j] = np.where(room.is_clear(places[i], places[j]), np.hypot(*(places[i] - places[j]).T), np.inf)
    lengths = np.minimum(lengths, lengths.T)
    best, is_done = np.full(len(places), np.inf), np.zeros(len(places), dtype=bool)
    best[0] = 0.0
    for _ in places:
        k = int(np.argmin(np.where(is_done, np.inf, best)))
        is_done[k] = True
        best = np.minimum(best, best[k] + lengths[k])
    return best[1]


@pytest.mark.parametrize("seed", range(60))
@pytest.mark.parametrize("finds_edges", [False, True])
def test_paths_are_the_shortest_ones_over_the_graph(seed, finds_edges, monkeypatch):
    """Where all edges were found before, paths between unconnected parts are not searched."""
    room, people = cluttered(seed)
    if finds_edges:
        monkeypatch.setattr("sonata2d.core.navigation._MANY", 0)
        room.find_edges()
    among = room.with_added(people)
    for one in (room, among):
        points = free_points(one, 8, seed).tolist()
        one.path((-1.0, -1.0), (-1.0, -1.0))  # beyond the walls: the graph is complete from now on
        for start, goal in zip(points[::2], points[1::2], strict=False):
            assert one.distance(start, goal) == pytest.approx(shortest_over_nodes(one, start, goal), abs=1e-9)


@pytest.mark.parametrize("seed", range(60))
def test_obstacles_that_are_added_have_the_effect_of_others(seed):
    room, people = cluttered(seed)
    added, joined = room.with_added(people), FreeSpace(room.outline, room.barriers.joined(people), room.clearance)
    places = np.random.default_rng(seed).uniform(0.0, 8.0, (300, 2))
    assert np.array_equal(added.is_free(places), joined.is_free(places))
    assert np.array_equal(added.is_clear(places[::2], places[1::2]), joined.is_clear(places[::2], places[1::2]))
    points = free_points(added, 8, seed).tolist()
    for start, goal in zip(points[::2], points[1::2], strict=False):
        # The nodes differ where both an added obstacle and another one leave little room.
        assert added.distance(start, goal) == pytest.approx(joined.distance(start, goal), abs=0.05)


def test_floor_plans_are_shared_and_added_obstacles_are_not():
    room, people = cluttered(3)
    again, _ = cluttered(3)
    assert again._plan is room._plan is room.with_added(people)._plan
    assert room.with_added(people).with_added(Barriers.of(())).added is not people


def save_paths(file: str) -> None:
    """Write distances and paths in a furnished room to a file; starts and goals may lie in furniture."""
    rng, arrays = np.random.default_rng(3), {}
    for seed in range(2):
        room = furnished(seed)
        starts, goals = rng.uniform(0.0, 8.0, (2, 12, 2))
        arrays[f"distances{seed}"] = np.array([room.distance(start, goals[0]) for start in starts])
        for k in range(12):
            path = room.path(tuple(starts[k]), tuple(goals[k]))
            arrays[f"path{seed}-{k}"] = np.zeros((0, 2)) if path is None else path
    np.savez(file, **arrays)


def test_the_interpreter_gives_the_bits_of_compiled_code(tmp_path):
    save_paths(str(tmp_path / "compiled.npz"))
    code = "import sys; from tests.core.test_navigation import save_paths; save_paths(sys.argv[1])"
    command = [sys.executable, "-W", "error", "-c", code, str(tmp_path / "interpreted.npz")]
    subprocess.run(command, cwd=Path(__file__).parents[2], env=os.environ | {"NUMBA_DISABLE_JIT": "1"}, check=True)
    with np.load(tmp_path / "compiled.npz") as compiled, np.load(tmp_path / "interpreted.npz") as interpreted:
        assert max(len(compiled[name]) for name in compiled.files) > 3
        for name in compiled.files:
            assert np.array_equal(compiled[name], interpreted[name]), name


def hollow_pillars():
    """36 hollow octagons in a square room, whose walls are not in order, so that they are no solid objects."""
    corners = [(0.45 * math.cos(k * math.pi / 4), 0.45 * math.sin(k * math.pi / 4)) for k in range(8)]
    edges = list(zip(corners, corners[1:] + corners[:1], strict=True))
    centres = [(1.0 + 1.2 * i, 1.0 + 1.2 * j) for i in range(6) for j in range(6)]
    walls = [((x + a, y + b), (x + c, y + d)) for (a, b), (c, d) in edges[::2] + edges[1::2] for x, y in centres]
    return space(walls=walls, clearance=0.1), centres


def test_there_is_no_path_into_a_closed_space_or_out_of_it():
    room, centres = hollow_pillars()
    fresh = hollow_pillars()[0]
    outside = [(0.2, 0.2), (7.8, 7.8), (0.3, 7.7), (1.6, 1.6), (4.6, 5.8)]
    for inside in centres[::5]:
        for point in outside:
            assert room.path(inside, point) is None
            assert room.distance(point, inside) == math.inf
        assert room.path(inside, centres[1]) is None
        assert len(room.path(inside, (inside[0] + 0.1, inside[1]))) == 2
    for start in outside:  # and what earlier searches have found changes no path
        for goal in outside:
            assert np.array_equal(room.path(start, goal), hollow_pillars()[0].path(start, goal))
    assert len(fresh.path(outside[0], outside[1])) > 3


@pytest.mark.parametrize("seed", [97, 98])
def test_a_path_does_not_depend_on_earlier_searches_in_a_room_with_narrow_places(seed):
    """In room 98 some positions see nodes on both sides of a place that has no node of its own."""
    small = ((0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 4.0))
    draw, walls = np.random.default_rng(seed), []
    for _ in range(12):
        x, y = draw.uniform(0.0, 4.0, 2).tolist()
        size, angle = draw.uniform(0.3, 1.5), draw.uniform(0.0, 6.28)
        walls.append(((x, y), (x + size * math.cos(angle), y + size * math.sin(angle))))
    searched, draw = space(small, walls, clearance=0.2), np.random.default_rng(seed)
    for start, goal in draw.uniform(0.0, 4.0, (30, 2, 2)).tolist():
        assert np.array_equal(searched.path(start, goal), space(small, walls, clearance=0.2).path(start, goal))


def test_paths_in_another_process_have_the_same_lengths() -> None:
    """Addresses of kernels are valid in one process only."""
    scene = s2.generate("sonata-2020", 1)
    free = FreeSpace(scene.outline, scene.barriers, 0.3)
    code = "import pickle, sys; print(pickle.load(sys.stdin.buffer).distance((-2.0, -2.0), (2.0, 2.0)))"
    run = subprocess.run([sys.executable, "-c", code], input=pickle.dumps(free), capture_output=True, check=True)
    assert float(run.stdout) == free.distance((-2.0, -2.0), (2.0, 2.0))
