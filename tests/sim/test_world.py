"""Facts that hold in any world, whatever the people want."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sonata2d.core.entities import Furniture, Human, Limits, Wall
from sonata2d.core.geometry import Disc, Pose, Rectangle, Twist
from sonata2d.core.portable_math import Array
from sonata2d.core.scene import Rules
from sonata2d.core.snapshot import CrowdCommands, Snapshot
from sonata2d.sim.posture import BODY_TURN, HEAD_LIMIT
from sonata2d.sim.world import World

from ..conftest import room, walker


def push(world: World, acceleration: Array | tuple[float, float], look: tuple[float, float] = (1.0, 0.0)) -> Snapshot:
    """One tick in which people are pushed, all alike if there is one push, and the robot stands."""
    count = len(world.scene.humans)
    rows = np.broadcast_to(np.array(acceleration), (count, 2))
    looks = np.tile(np.array([look]), (count, 1))
    world.step(Twist(), CrowdCommands(rows, looks, looks, np.zeros(count, dtype=int), ()))
    return world.snapshot()


def drive(world: World, twist: Twist, ticks: int) -> Snapshot:
    for _ in range(ticks):
        humans = world.snapshot().humans
        still = np.zeros((len(humans), 2))
        world.step(twist, CrowdCommands(still, humans.direction, humans.look, humans.activity_index, ()))
    return world.snapshot()


def test_a_free_robot_goes_where_the_twist_says() -> None:
    world = World(room(robot=Pose(-3.0, 0.0, 0.0)))
    seen = drive(world, Twist(vx=1.0), 20)
    assert seen.robot.position[0] == pytest.approx(-3.0 + 2.0, abs=0.02)
    assert seen.robot.executed == Twist(pytest.approx(1.0), pytest.approx(0.0), 0.0)  # type: ignore[arg-type]


def test_a_turning_robot_drives_a_circle() -> None:
    world = World(room(robot=Pose(0.0, 0.0, 0.0)))
    seen = drive(world, Twist(vx=0.5, omega=math.pi / 2), 40)  # once round, radius 0.5 / (pi / 2)
    assert seen.robot.position == pytest.approx((0.0, 0.0), abs=0.02)
    assert abs(seen.robot.pose.theta) < 1e-3


def test_a_snapshot_stays_as_it_was() -> None:
    world = World(room([walker(1, 0.0, 0.0)]))
    before = world.snapshot()
    held = before.humans.state.copy()
    push(world, (2.0, 0.0))
    assert np.array_equal(before.humans.state, held)
    with pytest.raises(ValueError, match="read-only"):
        before.humans.position[0] = 1.0


@pytest.mark.parametrize("furniture", [Rectangle(0.8, 0.8), Disc(0.4)])
def test_forty_people_push_nobody_into_furniture_or_wall(furniture: Rectangle | Disc) -> None:
    people = [walker(k + 1, 0.5 * (k % 5) - 1.0, 0.5 * (k // 5) - 3.5) for k in range(40)]
    scene = room(people, [Furniture(99, "thing", Pose(3.0, -1.0, 0.3), furniture)], inner=[Wall((3.5, -4), (3.5, 4))])
    world = World(scene)
    for _ in range(50):
        velocity = world.snapshot().humans.velocity
        hurry = (np.array([1.8, 0.0]) - velocity) / 0.1  # all of them as fast as people walk, and on into the wall
        seen = push(world, hurry)
        deepest = (0.2 - scene.barriers.gaps(seen.humans.position)).max()
        assert deepest < 0.035
    assert (seen.humans.position[:, 0] < 3.5).all()
    assert seen.humans.position[:, 0].max() > 3.0  # they did get there


def test_the_guard_stops_a_racing_robot_at_the_skin() -> None:
    fast = Limits(ahead=3.5, acceleration=100.0)
    human = Human(1, Pose(1.0, 0.0), 0.2)
    guarded = World(room([human], limits=fast))
    seen = drive(guarded, Twist(vx=3.5), 20)
    gap = 1.0 - 0.2 - 0.3 - seen.robot.position[0]
    assert -0.002 < gap < 0.01
    assert seen.robot.guarded
    assert [(c.kind, c.id, c.robot_at_fault, c.other_at_fault) for c in seen.contacts] == [("human", 1, True, False)]
    assert np.abs(seen.humans.position[0] - (1.0, 0.0)).max() < 0.002

    free = World(room([human], limits=fast, rules=Rules(guard=False)))
    seen = drive(free, Twist(vx=3.5), 20)
    assert not seen.robot.guarded
    assert seen.humans.position[0, 0] > 1.5  # run over


def test_who_walks_into_a_standing_robot_is_at_fault() -> None:
    world = World(room([walker(1, -2.2, 0.0, math.pi)]))
    contacts = [contact for _ in range(20) for contact in push(world, (-1.5, 0.0)).contacts]
    assert contacts
    assert not any(contact.robot_at_fault for contact in contacts)
    assert contacts[0].other_at_fault


def test_the_robot_that_grazes_a_wall_is_told_so() -> None:
    world = World(room(robot=Pose(3.0, 0.0, 0.0)))
    seen = drive(world, Twist(vx=1.0), 15)
    assert [(c.kind, c.id) for c in seen.contacts] == [("wall", 1)]
    assert seen.robot.position[0] == pytest.approx(3.7, abs=0.002)


def test_heads_turn_before_bodies_and_no_further_than_a_neck_allows() -> None:
    world = World(room([walker(1, 0.0, 0.0, 0.0)]))
    seen = push(world, (0.0, 0.0), look=(-1.0, 0.001))  # turn right round
    human = seen.humans[0]
    assert 0.05 < human.pose.theta < BODY_TURN * 0.1
    assert human.omega == pytest.approx(human.pose.theta / 0.1, abs=1e-5)
    assert human.head > human.pose.theta + 0.1
    for _ in range(30):
        seen = push(world, (0.0, 0.0), look=(-1.0, 0.001))
        human = seen.humans[0]
        assert math.cos(human.head - human.pose.theta) > math.cos(HEAD_LIMIT) - 1e-9
    assert abs(human.pose.theta) == pytest.approx(math.pi, abs=0.01)
