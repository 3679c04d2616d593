"""Built-in controllers: they reach the goal, and the planner respects pedestrians."""

from __future__ import annotations

import math
import os
import pickle
import subprocess
import sys
from copy import deepcopy
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import sonata2d as s2
from sonata2d.agents.controllers import planner
from sonata2d.agents.controllers.base import Controller
from sonata2d.agents.controllers.cost_field import CELL, CostField
from sonata2d.agents.controllers.loading import named_controllers
from sonata2d.agents.controllers.planner import HAS_NEGATIVE_WEIGHTS, STEP, SocialPlanner, Weights
from sonata2d.agents.controllers.reactive import SocialForce
from sonata2d.core.entities import Furniture, Human, Interaction, Robot
from sonata2d.core.geometry import Pose, Rectangle, Twist
from sonata2d.core.proxemics import clearance
from sonata2d.core.relations import TALKING
from sonata2d.core.scene import Rules, Scene
from sonata2d.core.snapshot import Outcome, Snapshot
from sonata2d.metrics.situations import rehearse
from sonata2d.registry import CONTROLLERS
from sonata2d.sim.episode import Episode
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


def test_planner_rests_at_its_goal_in_an_episode_that_goes_on() -> None:
    _, snapshots = run(room([], rules=Rules(time_limit=12.0, ends_on=("time",))), SocialPlanner())
    arrived = next(k for k, snapshot in enumerate(snapshots) if snapshot.goal.is_reached(snapshot.robot.pose))
    assert arrived < 100
    assert all(math.hypot(*s.robot.velocity) < 1e-3 and abs(s.robot.omega) < 1e-3 for s in snapshots[arrived + 15 :])


def test_planner_slows_down_near_people() -> None:
    positions = [(-0.5, 1.1), (0.5, 1.1), (-0.5, -1.1), (0.5, -1.1)]
    humans = [Human(k, Pose(x, y)) for k, (x, y) in enumerate(positions, 1)]
    speed = []
    for crowd in ([], humans):
        _, snapshots = run(room(crowd), SocialPlanner())
        near = [snapshot.robot for snapshot in snapshots if abs(snapshot.robot.position[0]) < 1.0]
        speed.append(np.mean([math.hypot(*robot.velocity) for robot in near]))
    assert speed[1] < 0.8 * speed[0]


def cost_from(field: CostField, x: float, y: float) -> float:
    """Cost of the path to the goal from the cell nearest to a point, in metres of open ground."""
    i, j = np.rint((np.array([x, y]) - field.low) / CELL).astype(int)
    return float(field.value[i, j])


def test_cost_field_equals_the_path_length_in_the_open_and_goes_round_corners() -> None:
    field = CostField(room(goal=(3.0, 0.0)))
    assert cost_from(field, 0.0, 0.0) - cost_from(field, 2.0, 0.0) == pytest.approx(2.0, abs=0.05)
    corner = CostField(room(polygon=L_SHAPE, goal=(3.0, -1.0)))
    assert cost_from(corner, -1.0, 3.0) > math.hypot(1.5, 3.5) + math.hypot(3.5, 1.0) - 0.8


def crowded_scene() -> Scene:
    """A corner, a table and people who stand, talk and walk towards the robot."""
    humans = [Human(1, Pose(1.0, 2.0)), Human(2, Pose(2.0, 2.0)), walker(3, -1.0, 0.0, math.pi), walker(4, 1.0, -1.0)]
    table = Furniture(9, "table", Pose(-2.0, 0.2), Rectangle(1.0, 1.0))
    return room(humans, [table], polygon=L_SHAPE, robot=Pose(-2.0, 3.0, 0.0), goal=(3.0, -2.0),
                interactions=(Interaction(1, TALKING, 2),))  # fmt: skip


def test_cost_field_solves_the_upwind_equation_in_each_cell() -> None:
    field = CostField(crowded_scene())
    around = np.pad(field.value, 1, constant_values=1e6)
    a = np.minimum(around[:-2, 1:-1], around[2:, 1:-1])
    b = np.minimum(around[1:-1, :-2], around[1:-1, 2:])
    step = field.price * CELL
    both = (a + b + np.sqrt(np.maximum(2.0 * step**2 - (a - b) ** 2, 0.0))) / 2.0
    solution = np.where(np.abs(a - b) >= step, np.minimum(a, b) + step, both)
    is_goal = field.value == 0.0
    assert is_goal.sum() == 1
    assert field.value[~is_goal] == pytest.approx(solution[~is_goal], rel=1e-12)


def test_prediction_agrees_with_the_motion_of_the_world() -> None:
    scene, planner, steps = room(robot=Pose(0.0, 0.0, 0.5)), SocialPlanner(), 8
    start = World(scene).snapshot()
    planner.reset(scene)
    planner.act(start)
    commands = Episode(scene, SocialPlanner())._crowd.act(start)
    memory = planner._memory.value
    for v, t in memory.pairs[:-1:13].tolist():
        world, twist = World(scene), Twist(*memory.velocities[v].tolist(), float(memory.turns[t]))
        for _ in range(int(steps * STEP / 0.1 + 0.5)):
            world.step(twist, commands, is_limited=True)
        assert world.snapshot().robot.position == pytest.approx(memory.positions[:, steps, t, v], abs=0.05)


def commands_in(scene: Scene, controller: Controller, ticks: int) -> list[Twist]:
    """The first commands in an episode."""
    episode = Episode(scene, controller)
    frames = [episode.step() for _ in range(ticks)]
    return [frame.command for frame in frames if frame]


@pytest.mark.parametrize("weights", [Weights(), Weights(intimate=-2.5, change=-0.1)])
def test_candidates_that_are_ruled_out_early_are_never_the_cheapest(weights: Weights) -> None:
    class Exhaustive(SocialPlanner):
        """Computes all costs in full, as if a weight were negative."""

        def reset(self, scene: Scene) -> None:
            super().reset(scene)
            self._memory.value.numbers[HAS_NEGATIVE_WEIGHTS] = 1.0

    scene = crowded_scene()
    assert commands_in(scene, SocialPlanner(weights), 80) == commands_in(scene, Exhaustive(weights), 80)


def test_price_of_obstacles_keeps_the_robot_away_from_them() -> None:
    class Careful(SocialPlanner):
        obstacle_price, obstacle_distance = 2.0, 0.3

    scene = replace(crowded_scene(), humans=(), interactions=())

    def nearest(controller: Controller) -> float:
        outcome, snapshots = run(scene, controller)
        assert outcome.status == "goal"
        gaps = snapshots[0].scene.barriers.gaps(np.array([snapshot.robot.position for snapshot in snapshots]))
        return float(gaps.min())

    assert nearest(Careful()) > nearest(SocialPlanner()) + 0.05


def test_goal_outside_the_room_is_approached() -> None:
    scene = room(goal=(9.0, 0.0))
    twists = commands_in(scene, SocialPlanner(), 30)
    assert twists[-1].vx > 0.5


def save_planner(file: str) -> None:
    """Write a cost field, and the commands in it, to a file."""
    scene = crowded_scene()
    field, twists = CostField(scene), commands_in(scene, SocialPlanner(), 20)
    np.savez(file, field=field.layers, commands=[(twist.vx, twist.vy, twist.omega) for twist in twists])


def test_the_interpreter_gives_the_bits_of_the_compiled_planner(tmp_path: Path) -> None:
    save_planner(str(tmp_path / "compiled.npz"))
    code = "import sys; from tests.agents.test_controllers import save_planner; save_planner(sys.argv[1])"
    command = [sys.executable, "-W", "error", "-c", code, str(tmp_path / "interpreted.npz")]
    subprocess.run(command, cwd=Path(__file__).parents[2], env=os.environ | {"NUMBA_DISABLE_JIT": "1"}, check=True)
    with np.load(tmp_path / "compiled.npz") as compiled, np.load(tmp_path / "interpreted.npz") as interpreted:
        assert all(np.array_equal(compiled[name], interpreted[name]) for name in ("field", "commands"))


@pytest.mark.parametrize("name", ["social-planner", "social-force", "orca"])
def test_people_who_are_absent_have_no_effect(name: str) -> None:
    human, table = walker(1, -2.0, 0.5), [Furniture(9, "table", Pose(-1.0, 0.2), Rectangle(1.0, 1.0))]
    late = replace(walker(2, 0.0, 0.0), enters=1000)
    with_absent, without = (
        commands_in(room(humans, table), named_controllers()[name](), 40) for humans in ([late, human], [human])
    )
    assert with_absent == without


def test_the_robot_keeps_its_memory_under_a_model_when_people_come_and_go() -> None:
    """Rows of absent people are kept, since the model remembers the deviation of each row."""
    leaves = replace(walker(1, -2.0, 3.5), leaves=5)
    episode = Episode(room([leaves, walker(2, -2.0, -3.5)]), controller := SocialForce(model="sonata2026"))
    memory = []
    for _ in range(10):
        episode.step()
        memory.append(controller._model._input.value.memory.deviation.copy())  # type: ignore[attr-defined]
    changes = np.abs(np.diff(np.array(memory), axis=0))
    assert changes.shape[1] == 3
    assert (changes[:, 2] > 0.0).all()
    assert (changes[:, :2] == 0.0).all()


def test_a_copy_of_social_force_gives_the_same_commands() -> None:
    episode = Episode(room([walker(1, 0.0, 0.5), walker(2, -1.0, -0.5)]), controller := SocialForce())
    for _ in range(3):
        episode.step()
    copies = deepcopy(controller), pickle.loads(pickle.dumps(controller))
    snapshot = episode.observe()
    assert [copied.act(snapshot) for copied in copies] == [controller.act(snapshot)] * 2


def test_error_classes_are_attributes_of_the_package() -> None:
    assert issubclass(s2.errors.SceneError, s2.Sonata2dError)


@pytest.mark.parametrize("seed", [*range(20), 40, 66])
def test_planner_overtakes_a_person_who_walks_slowly_ahead(seed: int) -> None:
    verdict = rehearse(s2.load_scenario("overtaking"), "overtaking", SocialPlanner(), episode=seed)
    assert verdict.took_place, verdict.description


@pytest.mark.parametrize("dt", [0.1, 0.25, 0.5])
def test_planner_loses_patience_only_below_half_of_its_top_speed(dt: float) -> None:
    config = s2.ScenarioConfig(
        room={"polygon": [[0, -2], [40, -2], [40, 2], [0, 2]]}, standing=0, wandering=0, relations=0,
        robot={"pose": [1, 0, 0]}, goal={"position": [39, 0]}, rules={"dt": dt},
    )  # fmt: skip
    for share, is_patient in ((0.55, True), (0.45, False)):
        memory = SocialPlanner().memory(s2.generate(config, seed=1))
        courtesies = [
            planner._courtesy(memory.numbers, memory.layers, memory.progress, tick, (2.0 + share * tick * dt, 0.0))
            for tick in range(round(30 / dt))
        ]
        assert courtesies[0] == 1.0
        assert (min(courtesies) == 1.0) == is_patient


def test_planner_without_patience_keeps_off_furniture() -> None:
    config = s2.load_scenario("sonata-2020").changed(person={"ignores_robot": 0.5})
    contacts = []
    episode = Episode(s2.generate(config, seed=100035), SocialPlanner())
    while (frame := episode.step()) is not None:
        contacts += [contact for contact in frame.snapshot.contacts if contact.kind == "object"]
    assert contacts == []
