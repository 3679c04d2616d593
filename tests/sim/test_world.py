"""Properties of the physical world for any commands of the crowd."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Literal

import numpy as np
import pytest

from sonata2d.core.entities import Furniture, Human, Limits, Wall
from sonata2d.core.geometry import (
    Disc,
    Pose,
    Rectangle,
    Twist,
    segment_distances,
    shoulder_line_distances,
    shoulder_lines,
)
from sonata2d.core.portable_math import Array
from sonata2d.core.proxemics import clearances
from sonata2d.core.scene import Rules
from sonata2d.core.snapshot import CrowdCommands, Snapshot
from sonata2d.core.turning import BODY_TURN
from sonata2d.core.vectors import X
from sonata2d.sim.kernel.posture import HEAD_LIMIT
from sonata2d.sim.world import World

from ..conftest import room, walker


def push(world: World, acceleration: Array | tuple[float, float], gaze: tuple[float, float] = (1.0, 0.0)) -> Snapshot:
    """Run one tick with given accelerations of the pedestrians, and a robot that stands.

    Args:
        acceleration: (N, 2), or one for all pedestrians, m/s^2.
        gaze: target of all bodies and heads, not necessarily of unit length.
    """
    count = len(world.scene.humans)
    rows = np.broadcast_to(np.array(acceleration), (count, 2))
    gazes = np.tile(np.array([gaze]), (count, 1))
    world.step(Twist(), CrowdCommands(rows, gazes, gazes, np.zeros(count, dtype=int), ()))
    return world.snapshot()


def drive(world: World, twist: Twist, ticks: int) -> Snapshot:
    """Drive the robot with a constant twist while the pedestrians do not accelerate; the last snapshot."""
    for _ in range(ticks):
        world.step(twist, still(world))
    return world.snapshot()


def still(world: World) -> CrowdCommands:
    """Commands of pedestrians that do not accelerate."""
    humans = world.snapshot().humans
    return CrowdCommands(np.zeros((len(humans), 2)), humans.direction, humans.gaze, humans.activity_index, ())


def test_a_free_robot_executes_its_twist() -> None:
    world = World(room(robot=Pose(-3.0, 0.0, 0.0)))
    robot = drive(world, Twist(vx=1.0), 20).robot
    assert robot.position[X] == pytest.approx(-3.0 + 2.0, abs=0.02)
    assert robot.executed == Twist(pytest.approx(1.0), pytest.approx(0.0), 0.0)  # type: ignore[arg-type]


def test_a_turning_robot_drives_a_circle() -> None:
    world = World(room(robot=Pose(0.0, 0.0, 0.0)))
    robot = drive(world, Twist(vx=0.5, omega=math.pi / 2), 40).robot  # one full circle of radius 0.5 / (pi / 2)
    assert robot.position == pytest.approx((0.0, 0.0), abs=0.02)
    assert abs(robot.pose.theta) < 1e-3


def test_a_snapshot_never_changes() -> None:
    world = World(room([walker(1, 0.0, 0.0)]))
    before = world.snapshot()
    state = before.humans.state.copy()
    push(world, (2.0, 0.0))
    assert np.array_equal(before.humans.state, state)
    with pytest.raises(ValueError, match="read-only"):
        before.humans.position[0] = 1.0


@pytest.mark.parametrize("shape", [Rectangle(0.8, 0.8), Disc(0.4)])
def test_forty_pushing_pedestrians_move_none_of_them_into_furniture_or_a_wall(shape: Rectangle | Disc) -> None:
    humans = [walker(k + 1, 0.5 * (k % 5) - 1.0, 0.5 * (k // 5) - 3.5) for k in range(40)]
    scene = room(humans, [Furniture(99, "thing", Pose(3.0, -1.0, 0.3), shape)], inner=[Wall((3.5, -4), (3.5, 4))])
    world = World(scene)
    for _ in range(50):
        velocity = world.snapshot().humans.velocity
        # All accelerate towards the wall to the highest speed of pedestrians.
        position = push(world, (np.array([1.8, 0.0]) - velocity) / 0.1).humans.position
        deepest = (0.2 - scene.barriers.gaps(position)).max()
        assert deepest < 0.035
    assert (position[:, X] < 3.5).all()
    assert position[:, X].max() > 3.0  # some reach the wall


def test_the_guard_stops_a_fast_robot_at_the_outline_of_a_pedestrian() -> None:
    fast = Limits(ahead=3.5, acceleration=100.0)
    human = Human(1, Pose(1.0, 0.0), 0.2)
    guarded = World(room([human], limits=fast))
    snapshot = drive(guarded, Twist(vx=3.5), 20)
    gap = 1.0 - 0.2 - 0.3 - snapshot.robot.position[X]
    assert -0.002 < gap < 0.01
    assert snapshot.robot.guarded
    contacts = [(c.kind, c.id, c.robot_at_fault, c.other_at_fault) for c in snapshot.contacts]
    assert contacts == [("human", 1, True, False)]
    assert np.abs(snapshot.humans.position[0] - (1.0, 0.0)).max() < 0.002

    unguarded = World(room([human], limits=fast, rules=Rules(guard=False)))
    snapshot = drive(unguarded, Twist(vx=3.5), 20)
    assert not snapshot.robot.guarded
    assert snapshot.humans.position[0, X] > 1.5  # pushed away by the robot


def test_a_pedestrian_that_walks_into_a_standing_robot_is_at_fault() -> None:
    world = World(room([walker(1, -2.2, 0.0, math.pi)]))
    contacts = [contact for _ in range(20) for contact in push(world, (-1.5, 0.0)).contacts]
    assert contacts
    assert not any(contact.robot_at_fault for contact in contacts)
    assert contacts[0].other_at_fault


def test_a_contact_with_a_running_person_is_noted_in_the_tick_in_which_it_begins() -> None:
    """At 2.4 m/s, whatever the desired speed of the person; the robot drives towards the person."""
    scene = room([walker(1, 0.0, 0.0, math.pi, breadth=0.4, desired_speed=0.5, velocity=(-2.4, 0.0))])
    robot = replace(scene.robot, pose=Pose(-0.2 - scene.robot.radius - 0.34, 0.0, 0.0))
    snapshot = drive(World(replace(scene, robot=robot)), Twist(robot.limits.ahead), ticks=1)
    assert [contact.kind for contact in snapshot.contacts] == ["human"]


def test_a_robot_at_a_wall_reports_the_contact() -> None:
    world = World(room(robot=Pose(3.0, 0.0, 0.0)))
    snapshot = drive(world, Twist(vx=1.0), 15)
    assert [(c.kind, c.id) for c in snapshot.contacts] == [("wall", 1)]
    assert snapshot.robot.position[X] == pytest.approx(3.7, abs=0.002)


def test_heads_turn_before_bodies_and_within_the_limit_of_the_neck() -> None:
    behind = (-1.0, 0.001)
    world = World(room([walker(1, 0.0, 0.0, 0.0)]))
    human = push(world, (0.0, 0.0), gaze=behind).humans[0]
    assert 0.05 < human.pose.theta < BODY_TURN * 0.1
    assert human.omega == pytest.approx(human.pose.theta / 0.1, abs=1e-5)
    assert human.head > human.pose.theta + 0.1
    for _ in range(30):
        human = push(world, (0.0, 0.0), gaze=behind).humans[0]
        assert math.cos(human.head - human.pose.theta) > math.cos(HEAD_LIMIT) - 1e-9
    assert abs(human.pose.theta) == pytest.approx(math.pi, abs=0.01)


def test_velocity_and_acceleration_limits_hold_for_any_command() -> None:
    world, before, limits = World(room(robot=Pose(0.0, 0.0))), Twist(), Limits()
    for _ in range(30):
        world.step(Twist(9.0, 9.0, 9.0), still(world), is_limited=True)
        after = world.snapshot().robot.executed
        assert math.hypot(after.vx - before.vx, after.vy - before.vy) <= limits.acceleration * 0.1 + 1e-9
        assert abs(after.omega - before.omega) <= limits.turn_acceleration * 0.1 + 1e-9
        before = after
    assert before == Twist(pytest.approx(1.0), pytest.approx(0.5), pytest.approx(1.5))  # type: ignore[arg-type]


def unicycle_among(humans: list[Human], *, robot: Pose, guard: bool = True, speed: float = 1.0) -> World:
    """A room of 8 x 8 m with a table and a unicycle."""
    table = Furniture(99, "table", Pose(2.0, 2.0, 0.4), Rectangle(1.2, 0.8))
    limits = Limits(ahead=speed, acceleration=100.0, turn_acceleration=100.0)
    scene = room(humans, [table], limits=limits, robot=robot, rules=Rules(guard=guard, substeps=10))
    return World(replace(scene, robot=replace(scene.robot, kinematics="unicycle")))


def assert_no_slip(before: Snapshot, after: Snapshot, dt: float = 0.1) -> None:
    """The robot has moved along its headings during a tick, and its velocity is along the last one."""
    robot, turn = after.robot, after.robot.executed.omega * dt
    c, s = math.cos(before.robot.pose.theta + turn / 2), math.sin(before.robot.pose.theta + turn / 2)
    dx, dy = (np.array(robot.position) - before.robot.position).tolist()
    ahead, left = dx * c + dy * s, dy * c - dx * s
    assert abs(left) <= abs(ahead) * math.tan(abs(turn) / 2) + 1e-9
    assert abs(robot.twist.vy) < 1e-9
    assert robot.executed.vy == 0.0
    arc = abs(robot.executed.vx) * dt
    assert arc * math.cos(turn / 2) - 1e-9 <= abs(ahead) <= arc + 1e-9


def pushing(world: World, target: tuple[float, float], speed: float = 1.8) -> CrowdCommands:
    """Commands of pedestrians that all walk to a target."""
    humans = world.snapshot().humans
    offset = np.array(target) - humans.position
    wanted = speed * offset / np.maximum(np.hypot(offset[:, :1], offset[:, 1:]), 1e-6)
    return still(world)._replace(acceleration=(wanted - humans.velocity) / 0.1)


def test_a_unicycle_does_not_move_sideways() -> None:
    world = unicycle_among([], robot=Pose(0.0, 0.0))
    for _ in range(10):
        world.step(Twist(0.0, 1.0, 0.0), still(world), is_limited=True)
    assert world.snapshot().robot.position == (0.0, 0.0)
    assert world.snapshot().robot.executed == Twist()


@pytest.mark.parametrize("guard", [True, False])
@pytest.mark.parametrize("degrees", [-170, -95, -60, -20, 0, 3, 30, 44, 75, 89, 120])
@pytest.mark.parametrize("omega", [0.0, 0.4])
def test_a_unicycle_that_hits_walls_furniture_and_people_does_not_slip(degrees: int, guard: bool, omega: float) -> None:
    humans = [walker(k + 1, 1.5 * math.cos(k), 1.5 * math.sin(k)) for k in range(6)]
    world = unicycle_among(humans, robot=Pose(0.0, 0.0, math.radians(degrees)), guard=guard)
    before, has_contact = world.snapshot(), False
    for _ in range(60):
        world.step(Twist(vx=1.0, omega=omega), pushing(world, before.robot.position))
        after = world.snapshot()
        assert_no_slip(before, after)
        before, has_contact = after, has_contact or bool(after.contacts)
        gap = world.scene.barriers.gaps(np.array([after.robot.position])).min() - after.robot.radius
        assert gap > -1e-6
    assert has_contact


@pytest.mark.parametrize("guard", [True, False])
@pytest.mark.parametrize("degrees", [2, 10, 45, 90])
def test_a_unicycle_stops_at_a_wall_and_drives_on_after_turning_away(degrees: int, guard: bool) -> None:
    world = unicycle_among([], robot=Pose(-3.0, -3.6, math.radians(-degrees)), guard=guard)
    there = drive(world, Twist(vx=1.0), 60).robot
    still_there = drive(world, Twist(vx=1.0), 100).robot
    assert there.position[1] == pytest.approx(-3.7, abs=1e-6)
    assert still_there.position == pytest.approx(there.position, abs=1e-6)
    assert still_there.velocity == pytest.approx((0.0, 0.0), abs=1e-6)
    turned = drive(world, Twist(omega=math.radians(degrees)), 11).robot
    assert turned.position == pytest.approx(there.position, abs=1e-6)
    assert drive(world, Twist(vx=1.0), 10).robot.position[X] == pytest.approx(there.position[0] + 1.0, abs=0.02)


@pytest.mark.parametrize("kinematics", ["holonomic", "unicycle"])
@pytest.mark.parametrize("guard", [True, False])
def test_a_crowd_does_not_move_a_standing_robot(guard: bool, kinematics: Literal["holonomic", "unicycle"]) -> None:
    humans = [walker(k + 1, 0.5 * (k % 5) - 3.4, 0.5 * (k // 5) - 2.0) for k in range(40)]
    scene = room(humans, robot=Pose(0.0, 0.0), rules=Rules(guard=guard))
    world = World(replace(scene, robot=replace(scene.robot, kinematics=kinematics)))
    for _ in range(60):
        world.step(Twist(), pushing(world, (0.0, 0.0)))
        snapshot = world.snapshot()
        assert snapshot.robot.position == (0.0, 0.0)
        assert snapshot.robot.velocity == (0.0, 0.0)
        distance = np.hypot(*snapshot.humans.position.T)
        assert distance.min() > 0.2 + 0.3 - 0.035
    assert snapshot.contacts


@pytest.mark.parametrize("speed", [1.0, 3.5])
@pytest.mark.parametrize("count", [1, 3])
def test_a_robot_without_guard_pushes_people_until_a_wall_stops_them(count: int, speed: float) -> None:
    """The people stand in a row before the wall."""
    humans = [walker(k + 1, 2.0 - 0.45 * k, 0.0) for k in range(count)]
    world = unicycle_among(humans, robot=Pose(-2.0, 0.0), guard=False, speed=speed)
    for _ in range(80):
        snapshot = drive(world, Twist(vx=speed), 1)
        overlap = 0.2 + 0.3 - np.hypot(*(snapshot.humans.position - snapshot.robot.position).T)
        assert overlap.max() < 0.01 + 2 * speed * 0.01  # the motion of robot and person in a substep
        assert world.scene.barriers.gaps(snapshot.humans.position).min() > 0.2 - 0.005 - speed * 0.01
    stopped = snapshot.robot.position
    assert stopped[X] == pytest.approx(4.0 - 0.4 * count - 0.3, abs=0.02 * (count + 1))
    assert drive(world, Twist(vx=speed), 200).robot.position == pytest.approx(stopped, abs=0.002)


@pytest.mark.parametrize("kinematics", ["holonomic", "unicycle"])
@pytest.mark.parametrize("theta", [0.0, 0.4, 0.8, 1.2, math.pi / 2, 2.5, -0.7])
@pytest.mark.parametrize("y", [0.0, 0.2, 0.45])
def test_guard_stops_the_robot_at_the_shoulders_of_a_standing_person(
    y: float, theta: float, kinematics: Literal["holonomic", "unicycle"]
) -> None:
    scene = room([Human(1, Pose(0.0, y, theta))], robot=Pose(-2.0, 0.0))
    world = World(replace(scene, robot=replace(scene.robot, kinematics=kinematics)))
    nearest = math.inf
    for _ in range(40):
        snapshot = drive(world, Twist(vx=1.0), 1)
        nearest = min(nearest, float(clearances(snapshot)[0]))
        touches = clearances(snapshot)[0] < scene.rules.contact_distance
        assert touches <= bool(snapshot.contacts)  # contacts within the tick are reported too
        assert snapshot.humans.position[0].tolist() == [0.0, y]
    assert nearest > -1e-9
    if y < 0.4:
        assert nearest < 0.001
        assert snapshot.contacts or kinematics == "holonomic"  # which slides past


@pytest.mark.parametrize("between", [0, 1])
def test_a_person_pressed_against_a_wall_by_the_robot_does_not_turn(between: int) -> None:
    """There is room for the depth of the body, but not for its shoulders; another person may pass the pressure on."""
    humans = [walker(k + 1, 3.855 - 0.285 * k, 0.0, radius=0.14) for k in range(1 + between)]
    world = World(room(humans, robot=Pose(3.855 - 0.285 * between - 0.145 - 0.3, 0.0)))
    heading = np.array([[0.0, 1.0]] + [[1.0, 0.0]] * between)
    for _ in range(20):
        acceleration = np.zeros((1 + between, 2))
        world.step(Twist(), CrowdCommands(acceleration, heading, heading, np.zeros(1 + between, dtype=int), ()))
    people = world.snapshot().humans
    assert people.theta[0] < 0.3
    assert people.head[0] > 1.0
    assert clearances(world.snapshot()).min() > -0.01
    if between:
        offset = people.position[1] - people.position[0]
        distance = shoulder_line_distances(
            offset, people.direction[0], people.shoulder[0], people.direction[1], people.shoulder[1]
        )
        assert distance > 0.28 - 0.01


def test_a_person_between_a_table_and_a_wall_turns_only_as_far_as_there_is_room() -> None:
    """The gap of 0.32 m has room for the depth of the body, 0.28 m, but not for its breadth, 0.45 m."""
    table = Furniture(10, "table", Pose(2.0, 3.28), Rectangle(0.8, 0.8))
    person = Human(1, Pose(2.0, 3.84, math.pi / 2), 0.14, breadth=0.45)
    world = World(room([person], [table], robot=Pose(-3.0, 0.0)))
    for _ in range(40):
        people = push(world, (0.0, 0.0)).humans
        line = shoulder_lines(people.position, people.direction, people.shoulder)
        assert segment_distances(*line, world.scene.barriers).min() - 0.14 > -0.045
    assert people.theta[0] > 0.9
    assert people.head[0] < people.theta[0] - 0.9


@pytest.mark.parametrize(("guard", "limit"), [(True, 2.69), (False, 2.69 + math.hypot(1.0, 0.5))])
def test_no_force_makes_a_person_faster_than_a_push_does(guard: bool, limit: float) -> None:
    """The limit is that of `check`: 1.3 times the desired speed and 1 m/s, without the guard the robot's speed, too."""
    world = World(room([walker(1, -3.0, 0.0), walker(2, -3.0, 2.0)], rules=Rules(guard=guard)))
    for _ in range(10):
        people = push(world, np.array([[30.0, 40.0], [0.1, 0.0]])).humans
    assert np.hypot(*people.velocity[0]) == pytest.approx(limit, rel=1e-12)
    assert people.velocity[0] == pytest.approx((0.6 * limit, 0.8 * limit))
    assert people.velocity[1] == pytest.approx((0.1, 0.0))


def test_a_shoulder_does_not_sink_into_the_corner_of_a_table() -> None:
    """Many people, each at a table of its own; the engine misses contacts of torsos with corners of polygons."""
    walls = ((-40.0, -40.0), (40.0, -40.0), (40.0, 40.0), (-40.0, 40.0))
    humans, tables, targets = [], [], []
    for k in range(400):
        theta, offset, (x, y) = (
            0.3 + 0.5 * (k % 20) / 10,
            -0.2 + 0.02 * (k // 20),
            (3.0 * (k % 20) - 30, 3.0 * (k // 20) - 30),
        )
        tables.append(Furniture(1000 + k, "table", Pose(x, y), Rectangle(0.8, 0.8)))
        start = Pose(x + 0.75 + offset, y + 0.75 - offset, theta + math.pi)
        humans.append(Human(k + 1, start, 0.13, behaviour="wandering", velocity=(-0.7, -0.7), breadth=0.5))
        targets.append(start.direction)
    rules = Rules(substeps=10)
    world = World(room(humans, tables, robot=Pose(-38.0, -38.0), goal=(38.0, 38.0), polygon=walls, rules=rules))
    deepest = 0.0
    for _ in range(6):
        headings = np.array(targets)
        world.step(Twist(), CrowdCommands(np.zeros((400, 2)), headings, headings, np.zeros(400, dtype=int), ()))
        people = world.snapshot().humans
        lines = shoulder_lines(people.position, people.direction, people.shoulder)
        gaps = segment_distances(*lines, world.scene.barriers).min(axis=0) - people.radius
        deepest = max(deepest, -float(gaps.min()))
    assert 0.0 < deepest < 0.012  # the motion in a substep
