"""Built-in controllers: they reach the goal, and the planner respects pedestrians."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sonata2d.agents.controllers.base import Controller
from sonata2d.agents.controllers.loading import named_controllers
from sonata2d.agents.controllers.planner import CostField, SocialPlanner, roll_out
from sonata2d.core.entities import TALKING, Furniture, Human, Interaction, Robot
from sonata2d.core.geometry import Pose, Rectangle, Twist
from sonata2d.core.proxemics import clearance
from sonata2d.core.scene import Scene
from sonata2d.core.snapshot import Outcome, Snapshot
from sonata2d.registry import CONTROLLERS
from sonata2d.sim.episode import Episode, reachable_twist
from sonata2d.sim.world import World

from ..conftest import L_SHAPE, room, walker


def run(scene: Scene, controller: Controller) -> tuple[Outcome, list[Snapshot]]:
    """The outcome of an episode and all its snapshots."""
    episode, snapshots = Episode(scene, controller), []
    while (frame := episode.step()) is not None:
        snapshots.append(frame.snapshot)
    assert episode.outcome is not None
    return episode.outcome, [*snapshots, episode.snapshot()]


@pytest.mark.parametrize(
    "name", [name for name in CONTROLLERS.built_in if name not in ("teleoperation", "graph-policy")]
)
@pytest.mark.parametrize("kinematics", ["holonomic", "unicycle"])
def test_every_built_in_controller_reaches_the_goal_in_an_empty_room(name: str, kinematics: str) -> None:
    scene = room(robot=Pose(-3.0, 1.0, 2.0))
    scene = Scene(**{**vars(scene), "robot": Robot(scene.robot.pose, kinematics=kinematics)})  # type: ignore[arg-type]
    outcome, _ = run(scene, named_controllers()[name]())
    assert outcome.status == "goal"
    assert outcome.time < 15.0


@pytest.mark.parametrize("name", ["social-planner", "social-force"])
def test_planners_find_the_path_round_the_corner_of_an_l_shape(name: str) -> None:
    scene = room([], [Furniture(9, "table", Pose(-2.0, 0.2), Rectangle(1.0, 1.0))], polygon=L_SHAPE,
                 robot=Pose(-2.0, 3.0, 0.0), goal=(3.0, -2.0))  # fmt: skip
    outcome, snapshots = run(scene, named_controllers()[name]())
    assert outcome.status == "goal"
    assert not any(snapshot.contacts for snapshot in snapshots)


def test_planner_keeps_out_of_intimate_space_where_there_is_room() -> None:
    outcome, snapshots = run(room([Human(1, Pose(0.0, 0.1, 1.0))]), SocialPlanner())
    assert outcome.status == "goal"
    assert min(clearance(snapshot) for snapshot in snapshots) > 0.45


def test_planner_does_not_cross_between_people_who_talk() -> None:
    pair = [Human(1, Pose(0.0, 1.2, -math.pi / 2)), Human(2, Pose(0.0, -1.0, math.pi / 2))]
    outcome, snapshots = run(room(pair, interactions=(Interaction(1, TALKING, 2),)), SocialPlanner())
    assert outcome.status == "goal"
    positions = [snapshot.robot.position for snapshot in snapshots]
    assert not any(abs(x) < 0.3 and -0.8 < y < 1.0 for x, y in positions)


def test_planner_avoids_contacts_with_a_pedestrian_that_ignores_the_robot() -> None:
    for y in (-0.6, 0.0, 0.6):
        ignorant = walker(1, 3.0, y, math.pi, reacts_to_robot=0.0, desired_speed=1.4)
        outcome, snapshots = run(room([ignorant], seed=3), SocialPlanner())
        assert outcome.status == "goal"
        assert not any(contact.robot_at_fault for snapshot in snapshots for contact in snapshot.contacts)


def test_planner_slows_down_near_people() -> None:
    positions = [(-0.5, 1.1), (0.5, 1.1), (-0.5, -1.1), (0.5, -1.1)]
    humans = [Human(k, Pose(x, y)) for k, (x, y) in enumerate(positions, 1)]
    speed = []
    for crowd in ([], humans):
        _, snapshots = run(room(crowd), SocialPlanner())
        near = [snapshot.robot for snapshot in snapshots if abs(snapshot.robot.position[0]) < 1.0]
        speed.append(np.mean([math.hypot(*robot.velocity) for robot in near]))
    assert speed[1] < 0.8 * speed[0]


def test_cost_field_equals_the_path_length_in_the_open_and_goes_round_corners() -> None:
    field = CostField(room(goal=(3.0, 0.0)))
    near, far = field.at(np.array([2.0, 0.0]), np.array([0.0, 0.0]))
    assert far - near == pytest.approx(2.0, abs=0.05)
    corner = CostField(room(polygon=L_SHAPE, goal=(3.0, -1.0)))
    beyond_the_corner = corner.at(np.array([-1.0]), np.array([3.0]))[0]
    assert beyond_the_corner > math.hypot(1.5, 3.5) + math.hypot(3.5, 1.0) - 0.8


def test_rollout_predicts_the_motion_of_the_world() -> None:
    world = World(room(robot=Pose(0.0, 0.0, 0.5)))
    twist = Twist(0.8, 0.2, 0.7)
    predicted = roll_out(np.array([[twist.vx, twist.vy, twist.omega]]), world.snapshot(), horizon=1.6, step=0.2)
    commands = Episode(room(), SocialPlanner())._crowd.act(world.snapshot())
    for _ in range(16):
        robot = world.snapshot().robot
        world.step(reachable_twist(twist, robot.executed, robot.body, 0.1), commands)
    assert world.snapshot().robot.position == pytest.approx((predicted.x[-1, 0], predicted.y[-1, 0]), abs=0.05)


def test_velocity_and_acceleration_limits_hold_for_any_command() -> None:
    robot, current = Robot(Pose(0, 0)), Twist()
    for _ in range(30):
        after = reachable_twist(Twist(9.0, 9.0, 9.0), current, robot, 0.1)
        assert math.hypot(after.vx - current.vx, after.vy - current.vy) <= 0.15 + 1e-9
        assert abs(after.omega - current.omega) <= 0.3 + 1e-9
        current = after
    assert current == Twist(pytest.approx(1.0), pytest.approx(0.5), pytest.approx(1.5))  # type: ignore[arg-type]
    unicycle = Robot(Pose(0, 0), kinematics="unicycle")
    assert reachable_twist(Twist(-9.0, 1.0, 0.0), current, unicycle, 100.0).vy == 0.0
