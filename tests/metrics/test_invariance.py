"""Metrics do not change with anything that does not matter: each change below is a sentence that a reader can state.

All registered metrics are tested, with those of installed plug-ins; metrics that change for a good reason are listed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from sonata2d.core.entities import Furniture, Goal, Group, Human, Wall
from sonata2d.core.geometry import Disc, Point, Pose, Rectangle
from sonata2d.core.portable_math import Array
from sonata2d.core.relations import TALKING
from sonata2d.core.scene import Rules, Scene
from sonata2d.core.snapshot import Status
from sonata2d.metrics.catalogue import ALL, FAMILIES
from sonata2d.metrics.definition import Metric, metric
from sonata2d.metrics.trajectory import Trajectory
from sonata2d.record.record import EpisodeRecord

from ..conftest import L_SHAPE, room
from .samples import record

STATES = 30


@dataclass(frozen=True)
class Run:
    """A recorded run.

    Attributes:
        scene: at the start.
        poses: (L, 1 + N, 3), x, y, theta of the robot and the people.
        undisturbed: (L, N, 2), positions of the people without the robot.
        interactions, contacts: rows by state.
        first_tick: of the recording.
    """

    scene: Scene
    poses: Array
    undisturbed: Array
    interactions: Mapping[int, list[Any]]
    contacts: Mapping[int, list[Any]]
    first_tick: int = 0
    status: Status = "stopped"


Change = Callable[[Run, np.random.Generator], Run]


def measured(run: Run, metrics: Mapping[str, Metric] = ALL) -> dict[str, float | None]:
    """The metrics of a run, those that need data which no metric here lacks included."""
    made: EpisodeRecord = record(
        run.scene, run.poses[:, 0].tolist(), [run.poses[:, k].tolist() for k in range(1, run.poses.shape[1])],
        interactions=run.interactions, contacts=run.contacts, status=run.status,
    )  # fmt: skip
    states = made.states
    tick = states.tick + run.first_tick
    moved = replace(made, states=replace(states, tick=tick, time=tick * run.scene.rules.dt))
    trajectory = Trajectory(moved, run.undisturbed)
    return {name: each.of(trajectory) for name, each in metrics.items()}


def random_walks(seed: int) -> Run:
    """A furnished room with a robot and four people who walk at random; contacts and interactions are recorded."""
    draw = np.random.Generator(np.random.PCG64(seed))
    people = [Human(k, Pose(0, 0), radius=float(draw.uniform(0.15, 0.25)), behaviour="wandering") for k in (1, 2, 3, 4)]
    furniture = [
        Furniture(20, "table", Pose(-2.0, -2.2, float(draw.uniform(-3, 3))), Rectangle(0.9, 0.6)),
        Furniture(21, "plant", Pose(-2.5, 1.2), Disc(0.1)),
    ]
    goal = (float(draw.uniform(-2.3, -1.3)), float(draw.uniform(2.0, 3.0)))
    scene = room(people, furniture, polygon=L_SHAPE, goal=goal, groups=(Group(7, "walking", (1, 2, 3)),))
    start = np.stack([draw.uniform((-3.4, -3.4), (-0.6, 3.4)) for _ in range(5)])
    start[0] = (-3.2, float(draw.uniform(-0.5, 0.4)))
    steps = draw.uniform(0.5, 3.0) * draw.normal(0.04, 0.08, size=(STATES, 5, 2))
    steps[0] = 0.0
    theta = np.cumsum(draw.normal(0.0, 0.3, size=(STATES, 5, 1)), axis=0)
    poses = np.concatenate((start + np.cumsum(steps, axis=0), theta), axis=2)
    if seed % 4 == 0:
        poses[10:16, :, :2] = poses[10, :, :2]  # all stand, and turn at first
        poses[13:16, :, 2] = poses[13, :, 2]
    return Run(scene, poses, _undisturbed(poses), *_events(draw))


def smooth_drive(seed: int) -> Run:
    """A robot on a wavy line to the goal past people who walk straight, in ticks of 0.05 s."""
    draw = np.random.Generator(np.random.PCG64(seed))
    people = [Human(k, Pose(0, 0), behaviour="wandering") for k in (1, 2, 3, 4)]
    furniture = [
        Furniture(20, "table", Pose(0.5, -2.2), Rectangle(0.9, 0.6)),
        Furniture(21, "plant", Pose(1, 2), Disc(0.1)),
    ]
    scene = room(people, furniture, groups=(Group(7, "walking", (1, 2, 3)),), rules=Rules(dt=0.05))
    time = np.arange(161) * 0.05
    along = np.stack((0.75 * time + 0.1 * np.sin(time) - 3.0, 0.4 * np.sin(0.8 * time)), axis=1)
    velocity = np.gradient(along, axis=0)
    robot = np.column_stack((along, np.arctan2(velocity[:, 1], velocity[:, 0])))
    starts, headings = draw.uniform((-2, 1.0), (3, 3), (4, 2)), draw.uniform(-2.5, -0.5, 4)
    walks = [
        np.column_stack((start + 0.5 * time[:, None] * (math.cos(h), math.sin(h)), np.full(len(time), h)))
        for start, h in zip(starts, headings, strict=True)
    ]
    poses = np.stack((robot, *walks), axis=1)
    return Run(scene, poses, _undisturbed(poses), {k: [[1, TALKING, 2]] for k in range(20, 81)}, {})


def _undisturbed(poses: Array) -> Array:
    people = poses[:, 1:, :2]
    return np.asarray(people[:1] + 1.5 * (people - people[:1]))


def _events(draw: np.random.Generator) -> tuple[dict[int, list[Any]], dict[int, list[Any]]]:
    """Interactions in every second state, and contacts in some states with a person, an object and a wall."""
    interactions = {k: [[1, TALKING, 2], [3, "human_plant_interaction", 21]] for k in range(0, STATES, 2)}
    contacts: dict[int, list[Any]] = {}
    for kind, id in (("human", 2), ("object", 20), ("wall", 3)):
        first = int(draw.integers(1, 3 * STATES))  # in some runs there is no contact
        for k in (first, first + 1, first + 4):
            faults = {
                "robot_at_fault": bool(draw.integers(2)),
                "other_at_fault": kind == "human" and bool(draw.integers(2)),
            }
            contacts.setdefault(k, []).append({"kind": kind, "id": id, **faults})
    return interactions, contacts


# Changes of the room and of the coordinates


def moved(run: Run, draw: np.random.Generator) -> Run:
    """The scene is rotated by any angle and moved."""
    angle, shift = draw.uniform(-math.pi, math.pi), draw.uniform(-50.0, 50.0, 2)
    c, s = math.cos(angle), math.sin(angle)
    turn = np.array([[c, s], [-s, c]])
    poses = np.concatenate((run.poses[..., :2] @ turn + shift, run.poses[..., 2:] + angle), axis=2)

    def to(point: Point) -> Point:
        x, y = (np.array(point) @ turn + shift).tolist()
        return x, y

    scene = mapped(run.scene, to, lambda theta: theta + angle)
    return replace(run, scene=scene, poses=poses, undisturbed=run.undisturbed @ turn + shift)


def mirrored(run: Run, draw: np.random.Generator) -> Run:
    """Left and right are exchanged."""
    scene = mapped(run.scene, lambda point: (point[0], -point[1]), lambda theta: -theta)
    scene = replace(scene, polygon=scene.polygon[::-1])
    return replace(run, scene=scene, poses=run.poses * (1, -1, -1), undisturbed=run.undisturbed * (1, -1))


def mapped(scene: Scene, to: Callable[[Point], Point], turn: Callable[[float], float]) -> Scene:
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


def split_walls(run: Run, draw: np.random.Generator) -> Run:
    """Walls are drawn in pieces; recorded contacts name the piece."""
    walls, pieces = list(run.scene.walls), {}
    for k, wall in enumerate(run.scene.walls):
        middle = _between(wall, draw.uniform(0.2, 0.8))
        walls[k], pieces[k] = Wall(wall.start, middle), len(walls)
        walls.append(Wall(middle, wall.end))
    contacts = {
        state: [row | {"id": pieces[row["id"]]} if row["kind"] == "wall" and state % 2 else row for row in rows]
        for state, rows in run.contacts.items()
    }
    return replace(run, scene=replace(run.scene, walls=tuple(walls)), contacts=contacts)


def reversed_walls(run: Run, draw: np.random.Generator) -> Run:
    """Walls are drawn from the other end."""
    return replace(run, scene=replace(run.scene, walls=tuple(Wall(w.end, w.start) for w in run.scene.walls)))


def walls_twice(run: Run, draw: np.random.Generator) -> Run:
    """Some walls are drawn a second time, in part and from the other end."""
    again = [Wall(_between(w, 0.9), _between(w, draw.uniform(0.0, 0.5))) for w in run.scene.walls[::2]]
    return replace(run, scene=replace(run.scene, walls=(*run.scene.walls, *again)))


def more_vertices(run: Run, draw: np.random.Generator) -> Run:
    """The polygon has further vertices on its sides, with an edge between any two of them."""
    polygon: list[Point] = []
    edges: list[tuple[int, Wall]] = []
    for k, wall in enumerate(run.scene.walls):
        ends = [wall.start, _between(wall, draw.uniform(0.1, 0.5)), _between(wall, draw.uniform(0.5, 0.9)), wall.end]
        polygon += ends[:3]
        edges += [(k, Wall(a, b)) for a, b in pairwise(ends)]
    first = {k: 3 * k for k in range(len(run.scene.walls))}
    contacts = {
        state: [row | {"id": first[row["id"]]} if row["kind"] == "wall" else row for row in rows]
        for state, rows in run.contacts.items()
    }
    walls = tuple(wall for _, wall in edges)
    return replace(run, scene=replace(run.scene, polygon=tuple(polygon), walls=walls), contacts=contacts)


def _between(wall: Wall, t: float) -> Point:
    """A point of a wall, at the precision of files."""
    (ax, ay), (bx, by) = wall.start, wall.end
    return round(ax + t * (bx - ax), 4), round(ay + t * (by - ay), 4)


# Changes of people, objects and time


def renumbered(run: Run, draw: np.random.Generator) -> Run:
    """People, objects and walls have other ids and another order."""
    scene = run.scene
    ids = {human.id: 101 + 3 * human.id for human in scene.humans} | {f.id: 300 - f.id for f in scene.furniture}
    order, walls = draw.permutation(len(scene.humans)), draw.permutation(len(scene.walls))
    place = {int(old): new for new, old in enumerate(walls)}
    scene = replace(
        scene,
        humans=tuple(replace(scene.humans[k], id=ids[scene.humans[k].id]) for k in order),
        furniture=tuple(replace(piece, id=ids[piece.id]) for piece in reversed(scene.furniture)),
        groups=tuple(replace(g, id=g.id + 1, members=tuple(ids[m] for m in reversed(g.members))) for g in scene.groups),
        walls=tuple(scene.walls[k] for k in walls),
    )
    contacts = {
        state: [row | {"id": (place if row["kind"] == "wall" else ids)[row["id"]]} for row in reversed(rows)]
        for state, rows in run.contacts.items()
    }
    interactions = {
        k: [[ids[a], name, ids[b]] for a, name, b in reversed(rows)] for k, rows in run.interactions.items()
    }
    poses = run.poses[:, [0, *(order + 1)]]
    return replace(
        run,
        scene=scene,
        poses=poses,
        undisturbed=run.undisturbed[:, order],
        contacts=contacts,
        interactions=interactions,
    )


def person_far_away(run: Run, draw: np.random.Generator) -> Run:
    """A person stands 100 m away."""
    person = Human(50, Pose(0, 0), behaviour="standing")
    place = np.tile([[[-70.0, 70.0, 1.0]]], (len(run.poses), 1, 1))
    return replace(
        run,
        scene=replace(run.scene, humans=(*run.scene.humans, person)),
        poses=np.concatenate((run.poses, place), axis=1),
        undisturbed=np.concatenate((run.undisturbed, place[..., :2]), axis=1),
    )


def object_far_away(run: Run, draw: np.random.Generator) -> Run:
    """An object stands 100 m away."""
    thing = Furniture(60, "table", Pose(70.0, 70.0, 0.3), Rectangle(2.0, 1.0))
    return replace(run, scene=replace(run.scene, furniture=(*run.scene.furniture, thing)))


def later_clock(run: Run, draw: np.random.Generator) -> Run:
    """The clock begins at another time."""
    return replace(run, first_tick=int(draw.integers(1, 100_000)))


def longer_after_the_goal(run: Run, draw: np.random.Generator) -> Run:
    """The robot goes on after it has reached the goal, against a wall; the run has no such part without a goal."""
    at_goal = np.hypot(*(run.poses[:, 0, :2] - run.scene.goal.position).T) <= run.scene.goal.distance
    if not at_goal.any():
        return run
    end = int(np.argmax(at_goal)) + 1
    later = run.poses[end - 1 : end] + np.cumsum(draw.normal(0.0, 0.5, (20, *run.poses.shape[1:])), axis=0)
    contacts = {k: rows for k, rows in run.contacts.items() if k < end}
    wall = {"kind": "wall", "id": 0, "robot_at_fault": True, "other_at_fault": False}
    poses = np.concatenate((run.poses[:end], later))
    return replace(run, poses=poses, undisturbed=_undisturbed(poses), contacts=contacts | {end + 2: [wall]})


def resampled(run: Run, draw: np.random.Generator) -> Run:
    """The tick is twice as long."""
    rules = replace(run.scene.rules, dt=2 * run.scene.rules.dt)
    interactions = {k // 2: rows for k, rows in run.interactions.items() if k % 2 == 0}
    scene = replace(run.scene, rules=rules)
    return replace(run, scene=scene, poses=run.poses[::2], undisturbed=run.undisturbed[::2], interactions=interactions)


CHANGES: tuple[Change, ...] = (
    moved, mirrored, split_walls, reversed_walls, walls_twice, more_vertices, renumbered, person_far_away,
    object_far_away, later_clock, longer_after_the_goal,
)  # fmt: skip

_ATAN2 = "as in HuNavSim: arguments of atan2 are exchanged, so that directions of the world matter"
_PER_STATE = "counts states, not seconds, as in the other project"
_FIRST_STATE = "the velocity before the start counts as zero, as in SocNavGym: a jump that a shorter tick makes larger"
NOT_INVARIANT: dict[Change, dict[str, str]] = {
    mirrored: {
        "hunavsim.time_not_moving": "as in HuNavSim: a right turn counts as standing",
        "hunavsim.robot_on_person_collision": _ATAN2,
        "hunavsim.person_on_robot_collision": _ATAN2,
    },
    resampled: {
        "hunavsim.robot_on_person_collision": _PER_STATE,
        "hunavsim.person_on_robot_collision": _PER_STATE,
        "socnavgym.failure_to_progress": _PER_STATE,
        "socnavgym.jerk_avg": _FIRST_STATE,
        "hunavsim.avg_overacceleration": "divides a change of speed by the square of the tick, as in HuNavSim",
    },
}


def differing(
    first: Mapping[str, float | None], second: Mapping[str, float | None], tolerance: float = 1e-5
) -> dict[str, tuple[float | None, float | None]]:
    """The metrics that differ by more than a tolerance, relative for values above 1 or 100 %, with both values."""

    def is_same(name: str, a: float | None, b: float | None) -> bool:
        if a is None or b is None:
            return a is b
        least = 100.0 if name in ALL and ALL[name].unit == "%" else 1.0
        return abs(a - b) <= tolerance * max(least, abs(a))

    return {name: (a, second[name]) for name, a in first.items() if not is_same(name, a, second[name])}


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("change", CHANGES, ids=lambda change: change.__name__)
def test_metrics_do_not_change_if(change: Change, seed: int) -> None:
    run = random_walks(seed)
    values = measured(run)
    changed = measured(change(run, np.random.default_rng(seed)))
    assert differing(values, changed).keys() <= NOT_INVARIANT.get(change, {}).keys()


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("change", [*CHANGES, resampled], ids=lambda change: change.__name__)
def test_metrics_of_a_smooth_drive_do_not_change_if(change: Change, seed: int) -> None:
    """To 1e-5; if the tick changes, to 5 %, or 0.05 of the unit for values below 1."""
    run = smooth_drive(seed)
    changed = measured(change(run, np.random.default_rng(seed)))
    found = differing(measured(run), changed, 0.05 if change is resampled else 1e-5)
    assert found.keys() <= NOT_INVARIANT.get(change, {}).keys(), found


def test_exceptions_are_metrics_that_change() -> None:
    for change, names in NOT_INVARIANT.items():
        seen: set[str] = set()
        for seed in range(60):
            run = smooth_drive(seed) if change is resampled and seed % 2 else random_walks(seed)
            seen |= differing(measured(run), measured(change(run, np.random.default_rng(seed)))).keys()
        assert names.keys() <= seen


@metric("m", "neither", needs={"robot"})
def northing(trajectory: Trajectory) -> float:
    """Largest y of the robot, a metric that depends on the coordinates."""
    return float(trajectory.position[:, 1].max())


@metric("count", "neither", needs={"walls"})
def walls_drawn(trajectory: Trajectory) -> float:
    """Number of walls in the file."""
    return float(len(trajectory.scene.walls))


def test_a_metric_that_is_not_invariant_is_found() -> None:
    found = {}
    run, metrics = random_walks(1), {"northing": northing, "walls_drawn": walls_drawn}
    for change in CHANGES:
        changed = change(run, np.random.default_rng(1))
        found[change.__name__] = set(differing(measured(run, metrics), measured(changed, metrics)))
    assert {name for name, names in found.items() if "northing" in names} == {"moved", "mirrored"}
    assert {name for name, names in found.items() if "walls_drawn" in names} == {
        "split_walls", "walls_twice", "more_vertices"
    }  # fmt: skip


def test_the_runs_give_several_values_of_nearly_every_metric() -> None:
    """Otherwise the invariance of a metric would not be tested."""
    values: dict[str, set[float | None]] = {name: set() for name in ALL}
    for run in (*map(random_walks, range(100)), *map(smooth_drive, range(10))):
        for name, value in measured(run).items():
            values[name].add(value)
    constant = {name for name, found in values.items() if len(found - {None}) < 2}
    # They have no people far away, no driver in a browser, no other robots, no areas, and no task with a person.
    families = "Several robots", "Delay of the driver", "Areas with rules"
    rare = {metric.name for family in families for metric in FAMILIES[family]}
    assert constant <= {"timeout", "zone_public", "company"} | rare
