"""Motion of the crowd with the default model: properties that hold for any believable crowd."""

from __future__ import annotations

import itertools
import math
import pickle
import re
import subprocess
import sys
from collections.abc import Callable
from copy import deepcopy
from dataclasses import replace

import numpy as np
import pytest

import sonata2d as s2
from sonata2d.agents.pedestrians.crowd import Crowd
from sonata2d.agents.pedestrians.models.base import attention_to
from sonata2d.agents.pedestrians.routes import point_ahead
from sonata2d.agents.pedestrians.wayfinding import set_path
from sonata2d.core.entities import Furniture, Group, Human, Interaction, Wall
from sonata2d.core.geometry import Point, Pose, Rectangle, Twist
from sonata2d.core.portable_math import Array, BoolArray
from sonata2d.core.relations import AT_LAPTOP, TALKING, WALKING_TOGETHER
from sonata2d.core.scene import Rules, Scene
from sonata2d.core.snapshot import Snapshot
from sonata2d.sim.world import World

from ..conftest import L_SHAPE, room, walker


def simulate(scene: Scene, seconds: float) -> list[Snapshot]:
    """The snapshots of a simulation in which the robot stands."""
    world, crowd, snapshots = World(scene), Crowd(scene), []
    for _ in range(int(seconds * 10)):
        snapshots.append(world.snapshot())
        world.step(Twist(), crowd.act(snapshots[-1]))
    return snapshots


def positions(snapshots: list[Snapshot]) -> Array:
    """(T, N, 2), m."""
    return np.array([snapshot.humans.position for snapshot in snapshots])


def rotated(scene: Scene, c: int, s: int) -> Scene:
    """The scene turned by a multiple of a right angle, (cos, sin): exact in floating point."""

    def point(p: tuple[float, float]) -> tuple[float, float]:
        return p[0] * c - p[1] * s, p[0] * s + p[1] * c

    def pose(p: Pose) -> Pose:
        return Pose(*point(p.position), p.theta + math.atan2(s, c))

    return replace(
        scene,
        polygon=tuple(map(point, scene.polygon)),
        walls=tuple(Wall(point(w.start), point(w.end)) for w in scene.walls),
        furniture=tuple(replace(f, pose=pose(f.pose)) for f in scene.furniture),
        humans=tuple(replace(h, pose=pose(h.pose), goals=tuple(map(point, h.goals))) for h in scene.humans),
        robot=replace(scene.robot, pose=pose(scene.robot.pose)),
    )


def send_straight(crowd: Crowd, k: int, start: Point, goal: Point) -> None:
    """Send pedestrian k from its position straight to a goal."""
    set_path(crowd.state.routes, crowd.state.journeys, k, np.array([start, goal]), 2, 1)


def accelerations(scene: Scene, direction: tuple[float, float]) -> Array:
    """The accelerations of pedestrians that all want to walk in one direction at 1.3 m/s."""
    crowd, snapshot = Crowd(scene), World(scene).snapshot()
    crowd.act(snapshot)  # fills positions, velocities and what blocks the view
    crowd.state.walkers.desired_direction[:], crowd.state.walkers.desired_speed[:] = direction, 1.3
    return crowd._acceleration().copy()


def test_forces_rotate_with_the_scene(busy: Scene) -> None:
    """Compares one tick with given directions, because destinations are random and do not rotate."""
    expected = accelerations(busy, (1.0, 0.0))
    assert accelerations(rotated(busy, 0, 1), (0.0, 1.0)) == pytest.approx(
        np.stack((-expected[:, 1], expected[:, 0]), axis=1), abs=1e-6
    )


@pytest.mark.usefixtures("no_deviations")
def test_a_lone_walker_reaches_the_desired_speed_and_faces_its_path() -> None:
    there_and_back = ((3.0, -1.0), (-3.0, -1.0)) * 3
    alone = walker(1, -3.0, -1.0, desired_speed=1.2, behaviour="walking", goals=there_and_back)
    humans = [s.humans[0] for s in simulate(room([alone], robot=Pose(-3.5, 3.5)), 20.0)[20:]]
    assert np.median([math.hypot(*h.velocity) for h in humans]) == pytest.approx(1.2, abs=0.05)
    straight = [h for h in humans if math.hypot(*h.velocity) > 1.1]
    errors = [abs(math.remainder(h.pose.theta - math.atan2(h.velocity[1], h.velocity[0]), math.tau)) for h in straight]
    assert np.median(errors) < 0.1


def test_pedestrians_leave_the_arms_of_an_l_shape_and_pass_a_table() -> None:
    table = Furniture(9, "table", Pose(-2.0, 1.0), Rectangle(2.5, 0.8))
    humans = [walker(1, -2.0, 3.0), walker(2, 3.0, -1.0)]
    path = positions(simulate(room(humans, [table], polygon=L_SHAPE, seed=5), 60.0))
    for k in (0, 1):
        assert (path[:, k, 0] > 1.0).any()  # each visits one arm
        assert (path[:, k, 1] > 1.8).any()  # and the other


def two_rooms(width: float, humans: list[Human], **fields: object) -> Scene:
    """Two rooms with a door between them at the origin."""
    inner = [Wall((0.0, -4.0), (0.0, -width / 2)), Wall((0.0, width / 2), (0.0, 4.0))]
    return room(humans, inner=inner, **fields)  # type: ignore[arg-type]


@pytest.mark.parametrize("width", [0.9, 1.0, 1.2])
def test_a_lone_walker_passes_a_doorway_both_ways(width: float) -> None:
    path = positions(simulate(two_rooms(width, [walker(1, -3.0, 2.0)], robot=Pose(3.5, 3.5), seed=1), 60.0))
    assert (np.diff(np.sign(path[:, 0, 0])) != 0).sum() >= 2


@pytest.mark.usefixtures("motionless")
@pytest.mark.parametrize("is_closed", [False, True])
def test_a_walker_between_walls_on_all_sides_stands(is_closed: bool) -> None:
    corners = ((1.3, 1.3), (2.7, 1.3), (2.7, 2.7), (1.3, 2.7), (1.3, 1.3))
    inner = [Wall(*ends) for ends in itertools.pairwise(corners)][0 if is_closed else 2 :]
    snapshots = simulate(room([walker(1, 2.1, 1.95)], inner=inner, robot=Pose(-3.5, 3.5), seed=1), 30.0)
    standing = np.mean([s.humans[0].activity == "standing" for s in snapshots[1:]])
    moved = float(np.max(np.linalg.norm(positions(snapshots)[:, 0] - (2.1, 1.95), axis=1)))
    assert (standing > 0.9 and moved < 0.2) if is_closed else (standing < 0.5 and moved > 2.0)


def head_on_scene(y: float = 0.0, side: int = 1, **fields: object) -> Scene:
    """Two pedestrians that meet head-on, at a lateral offset y, m, with further `fields` of both."""
    east = Human(1, Pose(-3.0, y), behaviour="walking", goals=((3.5, y),), **fields)  # type: ignore[arg-type]
    west = Human(2, Pose(3.0, 0.0, math.pi), behaviour="walking", goals=((-3.5, 0.0),), **fields)  # type: ignore[arg-type]
    return room([east, west], robot=Pose(0.0, 3.6), rules=Rules(side=side))  # type: ignore[arg-type]


@pytest.mark.parametrize("y", [0.0, 0.05, -0.05, 0.1, -0.2])
def test_pedestrians_that_meet_head_on_pass_without_contact(y: float) -> None:
    snapshots = simulate(head_on_scene(y), 4.2)
    distances = [np.linalg.norm(s.humans.position[0] - s.humans.position[1]) for s in snapshots]
    assert min(distances) - snapshots[0].humans.radius.sum() > 0.05
    assert snapshots[-1].humans.position[0, 0] > 0.8
    assert snapshots[-1].humans.position[1, 0] < -0.8


@pytest.mark.usefixtures("motionless")
def test_standing_pedestrians_face_their_partners_and_return_when_pushed() -> None:
    humans = [Human(1, Pose(0.0, 0.0, 2.0)), Human(2, Pose(2.0, 0.0, 1.0)), Human(3, Pose(-1.0, 2.0, -1.0))]
    laptop = Furniture(9, "laptop", Pose(-1.0, 3.0), Rectangle(0.35, 0.25))
    interactions = (Interaction(1, TALKING, 2), Interaction(3, AT_LAPTOP, 9))
    walkers = [walker(k, x, -2.0) for k, x in ((4, -2.0), (5, 0.0), (6, 2.0))]
    scene = room([*humans, *walkers], [laptop], interactions=interactions, robot=Pose(3.5, 3.5))
    snapshots = simulate(scene, 30.0)
    last = snapshots[-1].humans
    assert last[0].pose.theta == pytest.approx(0.0, abs=0.1)
    assert abs(last[1].pose.theta) == pytest.approx(math.pi, abs=0.1)
    assert last[2].head == pytest.approx(math.pi / 2, abs=0.1)
    assert [last[k].activity for k in range(4)] == ["talking", "talking", "using", "walking"]
    start = np.array([human.pose.position for human in humans])
    assert np.abs(positions(snapshots)[:, :3] - start).max() < 0.25
    assert np.abs(last.position[:3] - start).max() < 0.05


def test_pairs_stay_together_at_the_observed_spacing() -> None:
    pair = [walker(1, 0.0, 0.0, group=1, desired_speed=1.1), walker(2, 0.0, 0.5, group=1, desired_speed=1.5)]
    groups, interactions = (Group(1, "walking", (1, 2)),), (Interaction(1, WALKING_TOGETHER, 2),)
    scene = room(pair, groups=groups, interactions=interactions, robot=Pose(-3.5, 3.5), seed=2)
    snapshots = simulate(scene, 40.0)
    distances = [np.linalg.norm(s.humans.position[0] - s.humans.position[1]) for s in snapshots[20:]]
    assert 0.5 < np.median(distances) < 1.2
    assert np.quantile(distances, 0.95) < 2.0
    assert {h.activity for h in snapshots[-1].humans} == {"walking together"}


def test_only_pedestrians_that_react_to_the_robot_keep_clear_of_it() -> None:
    """The robot moves slowly; round one that stands all walk, as round a piece of furniture."""
    closest = {}
    for reacts in (0.0, 1.0):
        clearances = []
        for y in (0.1, 0.25):
            scene = room([walker(1, -3.0, y, reacts_to_robot=reacts)], robot=Pose(0.0, 0.0))
            world, crowd = World(scene), Crowd(scene)
            send_straight(crowd, 0, (-3.0, y), (3.5, y))
            for _ in range(35):
                snapshot = world.snapshot()
                clearances.append(s2.clearance(snapshot))
                world.step(Twist(0.1), crowd.act(snapshot))
        closest[reacts] = min(clearances)
    assert closest[0.0] < 0.01
    assert closest[1.0] > 0.1


def test_halving_the_physics_step_hardly_changes_the_paths() -> None:
    """Ten people for 3 s, forces once per tick; later, random destinations dominate."""
    ends = []
    for substeps in (10, 20):
        humans = [walker(k + 1, -3.5 + 0.7 * k, -3.0 + (k % 3)) for k in range(10)]
        scene = room(humans, rules=Rules(substeps=substeps), robot=Pose(3.5, 3.5), seed=8)
        ends.append(simulate(scene, 3.0)[-1].humans.position)
    difference = np.linalg.norm(ends[0] - ends[1], axis=1)
    assert np.median(difference) < 0.01
    assert np.quantile(difference, 0.8) < 0.05  # those who arrive a tick sooner differ by more


def test_unknown_models_are_rejected() -> None:
    with pytest.raises(ValueError, match=r"no pedestrian model is named .helbing.; did you mean .helbing"):
        Crowd(room([walker(1, 0.0, 0.0, model="helbing")]))


def test_different_models_in_one_scene_are_rejected() -> None:
    with pytest.raises(ValueError, match="must have the same model, got helbing1995, sonata2026"):
        Crowd(room([walker(1, 0.0, 0.0), walker(2, 1.0, 0.0, model="helbing1995")]))


def views(scene: Scene) -> tuple[Array, BoolArray]:
    """Who attends to whom, (N, N), and who has the robot in sight, (N,), at the start."""
    crowd = Crowd(scene)
    crowd.act(World(scene).snapshot())
    count = len(scene.humans)
    attention = [[attention_to(crowd.state.walkers, i, j) for j in range(count)] for i in range(count)]
    return np.array(attention), crowd.state.intentions.robot_in_sight


def test_walls_block_the_line_of_sight() -> None:
    position = [(-2.0, 2.0), (0.8, -0.5), (-3.0, -1.0), (-3.0, -3.0)]
    scene = room(
        [walker(k + 1, x, y) for k, (x, y) in enumerate(position)],
        polygon=L_SHAPE,
        inner=[Wall((-4.0, -2.0), (-1.0, -2.0))],
        robot=Pose(-1.0, -2.5),
    )
    attention, robot_in_sight = views(scene)
    assert attention[0, 1] == 0.0  # round the corner of the L
    assert attention[0, 2] == 1.0
    assert attention[2, 3] == 0.0  # through the inner wall
    assert np.array_equal(attention, attention.T)
    assert robot_in_sight.tolist() == [False, True, False, True]


def test_the_walls_of_a_square_room_block_no_view() -> None:
    attention, robot_in_sight = views(room([walker(1, -3.0, -1.0), walker(2, 1.0, -1.0)]))
    assert attention.tolist() == [[0.0, 1.0], [1.0, 0.0]]
    assert robot_in_sight.all()


def test_a_follower_before_its_leader_looks_where_it_walks() -> None:
    """In the first tick it copies the leader's path, which is empty then."""
    people = [walker(1, 3.0, 3.0), walker(2, 3.0, 2.0)]
    scene = room(people, groups=(Group(1, "walking", (2, 1)),))
    crowd = Crowd(scene)
    crowd.act(World(scene).snapshot())
    routes = crowd.state.routes
    assert routes.length.tolist() == [0, 2]
    routes.target[0] = 3.5, 3.0
    assert point_ahead(routes, 0, 3.0, 3.0, 1.0) == (3.5, 3.0)


def test_a_crowd_goes_on_in_another_process() -> None:
    """A copy must not hold addresses of the arrays that it was copied from."""
    scene = s2.generate("lively", 3)
    world, crowd = World(scene), Crowd(scene)
    for _ in range(20):
        world.step(Twist(), crowd.act(world.snapshot()))
    copy, code = (
        pickle.dumps((crowd, world.snapshot())),
        (
            "import pickle, sys; crowd, snapshot = pickle.load(sys.stdin.buffer);"
            "print(crowd.act(snapshot).acceleration.tobytes().hex())"
        ),
    )
    run = subprocess.run([sys.executable, "-c", code], input=copy, capture_output=True, check=True)
    assert run.stdout.decode().strip() == crowd.act(world.snapshot()).acceleration.tobytes().hex()


@pytest.mark.parametrize("copied", [deepcopy, lambda crowd: pickle.loads(pickle.dumps(crowd))], ids=["copy", "pickle"])
def test_a_copy_of_a_crowd_goes_on_by_itself(busy: Scene, copied: Callable[[Crowd], Crowd]) -> None:
    world, crowd = World(busy), Crowd(busy)
    for _ in range(3):
        world.step(Twist(), crowd.act(world.snapshot()))
    other, snapshot = copied(crowd), world.snapshot()
    assert other.act(snapshot).acceleration.tobytes() == crowd.act(snapshot).acceleration.tobytes()
    world.step(Twist(), crowd.act(snapshot))
    before = [array.copy() for array in crowd.state.intentions]
    del world
    other.act(replace(snapshot, tick=snapshot.tick + 1))
    assert all(np.array_equal(array, old) for array, old in zip(crowd.state.intentions, before, strict=True))


def test_a_snapshot_of_another_scene_is_refused(busy: Scene) -> None:
    with pytest.raises(ValueError, match=r"a crowd of 1 got a snapshot of \d+ pedestrians"):
        Crowd(room([walker(1, 0.0, 0.0)])).act(World(busy).snapshot())


@pytest.mark.parametrize(
    ("answer", "found"),
    [
        (np.zeros((1, 2)), "shape (1, 2)"),
        (np.zeros((2, 1)), "shape (2, 1)"),
        (np.zeros(4), "shape (4,)"),
        (None, "None"),
        ([[0.0, 0.0]], "[[0.0, 0.0]]"),
    ],
)
def test_accelerations_of_another_shape_are_refused(answer: object, found: str) -> None:
    scene = room([walker(1, 0.0, 0.0), walker(2, 1.0, 1.0)])
    crowd, snapshot = Crowd(scene), World(scene).snapshot()
    crowd._model.acceleration = lambda walkers: answer  # type: ignore[method-assign, assignment, return-value]
    with pytest.raises(ValueError, match=rf"of shape \(2, 2\), one row for each agent, got {re.escape(found)}"):
        crowd.act(snapshot)


@pytest.mark.parametrize("kind", [list, np.asfortranarray, np.float32])
def test_accelerations_may_be_of_any_kind_of_numbers(kind: Callable[[Array], object]) -> None:
    scene = room([walker(1, 0.0, 0.0), walker(2, 1.0, 1.0)])
    crowd, snapshot = Crowd(scene), World(scene).snapshot()
    crowd._model.acceleration = lambda walkers: kind(np.full((2, 2), 0.5))  # type: ignore[method-assign, assignment, return-value]
    assert crowd.act(snapshot).acceleration == pytest.approx(np.full((2, 2), 0.5))
