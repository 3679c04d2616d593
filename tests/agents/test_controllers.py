"""The stock controllers, and what an episode makes of any controller's answers."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sonata2d.agents.controllers.base import Controller
from sonata2d.agents.controllers.loading import named_controllers
from sonata2d.agents.controllers.planner import CostField, SocialPlanner, rolled_out
from sonata2d.core.entities import TALKING, Furniture, Human, Interaction, Robot
from sonata2d.core.geometry import Pose, Rectangle, Twist
from sonata2d.core.proxemics import clearance
from sonata2d.core.scene import Scene
from sonata2d.core.snapshot import Author, Frame, Outcome, Snapshot
from sonata2d.registry import CONTROLLERS
from sonata2d.sim.episode import Episode, executable
from sonata2d.sim.world import World

from ..conftest import L_SHAPE, room, walker


class Watch:
    """Keeps what an episode shows."""

    def __init__(self) -> None:
        self.seen: list[Snapshot] = []

    def open(self, scene: Scene, author: Author) -> None: ...

    def note(self, frame: Frame) -> None:
        self.seen.append(frame.snapshot)

    def close(self, last: Snapshot, outcome: Outcome) -> None:
        self.seen.append(last)


def run(scene: Scene, controller: Controller) -> tuple[Outcome, list[Snapshot]]:
    watch = Watch()
    return Episode(scene, controller, observers=[watch]).run(), watch.seen


@pytest.mark.parametrize(
    "name", [name for name in CONTROLLERS.built_in if name not in ("teleoperation", "graph-policy")]
)
@pytest.mark.parametrize("kinematics", ["holonomic", "unicycle"])
def test_every_stock_controller_reaches_the_goal_in_an_empty_room(name: str, kinematics: str) -> None:
    scene = room(robot=Pose(-3.0, 1.0, 2.0))
    scene = Scene(**{**vars(scene), "robot": Robot(scene.robot.pose, kinematics=kinematics)})  # type: ignore[arg-type]
    outcome, _ = run(scene, named_controllers()[name]())
    assert outcome.status == "goal"
    assert outcome.time < 15.0


@pytest.mark.parametrize("name", ["social-planner", "social-force"])
def test_planners_find_the_way_round_the_corner_of_an_l(name: str) -> None:
    scene = room([], [Furniture(9, "table", Pose(-2.0, 0.2), Rectangle(1.0, 1.0))], polygon=L_SHAPE,
                 robot=Pose(-2.0, 3.0, 0.0), goal=(3.0, -2.0))  # fmt: skip
    outcome, seen = run(scene, named_controllers()[name]())
    assert outcome.status == "goal"
    assert not any(snapshot.contacts for snapshot in seen)


def test_the_planner_keeps_out_of_personal_space_where_there_is_room() -> None:
    outcome, seen = run(room([Human(1, Pose(0.0, 0.1, 1.0))]), SocialPlanner())
    assert outcome.status == "goal"
    assert min(clearance(snapshot) for snapshot in seen) > 0.45


def test_the_planner_goes_round_people_who_talk() -> None:
    pair = [Human(1, Pose(0.0, 1.2, -math.pi / 2)), Human(2, Pose(0.0, -1.0, math.pi / 2))]
    scene = room(pair, interactions=(Interaction(1, TALKING, 2),))
    outcome, seen = run(scene, SocialPlanner())
    assert outcome.status == "goal"
    cuts = [abs(s.robot.position[0]) < 0.3 and -0.8 < s.robot.position[1] < 1.0 for s in seen]
    assert not any(cuts)


def test_the_planner_lets_someone_pass_who_ignores_it() -> None:
    for y in (-0.6, 0.0, 0.6):
        blind = walker(1, 3.0, y, math.pi, reacts_to_robot=0.0, desired_speed=1.4)
        outcome, seen = run(room([blind], seed=3), SocialPlanner())
        assert outcome.status == "goal"
        assert not any(c.robot_at_fault for s in seen for c in s.contacts)


def test_the_planner_slows_down_near_people() -> None:
    people = [Human(k, Pose(x, y)) for k, (x, y) in enumerate([(-0.5, 1.1), (0.5, 1.1), (-0.5, -1.1), (0.5, -1.1)], 1)]
    pace = []
    for crowd in ([], people):
        _, seen = run(room(crowd), SocialPlanner())
        pace.append(np.mean([math.hypot(*s.robot.velocity) for s in seen if abs(s.robot.position[0]) < 1.0]))
    assert pace[1] < 0.8 * pace[0]


def test_cost_field_grows_by_the_metre_in_the_open_and_goes_round_corners() -> None:
    field = CostField(room(goal=(3.0, 0.0)))
    ahead, far = field.at(np.array([2.0, 0.0]), np.array([0.0, 0.0]))
    assert far - ahead == pytest.approx(2.0, abs=0.05)
    corner = CostField(room(polygon=L_SHAPE, goal=(3.0, -1.0)))
    over_the_notch = corner.at(np.array([-1.0]), np.array([3.0]))[0]
    assert over_the_notch > math.hypot(1.5, 3.5) + math.hypot(3.5, 1.0) - 0.8  # by way of the corner


def test_rollout_is_what_the_world_then_does() -> None:
    world = World(room(robot=Pose(0.0, 0.0, 0.5)))
    twist = Twist(0.8, 0.2, 0.7)
    ways = rolled_out(np.array([[twist.vx, twist.vy, twist.omega]]), world.snapshot(), horizon=1.6, step=0.2)
    still = Episode(room(), SocialPlanner())._crowd.act(world.snapshot())
    for _ in range(16):
        seen = world.snapshot()
        world.step(executable(twist, seen.robot.executed, seen.robot.body, 0.1), still)
    assert world.snapshot().robot.position == pytest.approx((ways.x[-1, 0], ways.y[-1, 0]), abs=0.05)


def test_limits_hold_for_any_command() -> None:
    robot, now = Robot(Pose(0, 0)), Twist()
    for _ in range(30):
        after = executable(Twist(9.0, 9.0, 9.0), now, robot, 0.1)
        assert math.hypot(after.vx - now.vx, after.vy - now.vy) <= 0.15 + 1e-9
        assert abs(after.omega - now.omega) <= 0.3 + 1e-9
        now = after
    assert now == Twist(pytest.approx(1.0), pytest.approx(0.5), pytest.approx(1.5))  # type: ignore[arg-type]
    assert executable(Twist(-9.0, 1.0, 0.0), now, Robot(Pose(0, 0), kinematics="unicycle"), 100.0).vy == 0.0
