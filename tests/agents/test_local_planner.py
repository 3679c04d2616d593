"""`dwa` and `mppi`: planners that see by laser scanner and odometry alone."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import orjson
import pytest

import sonata2d as s2
from sonata2d.agents import Dwa, Lidar, Mppi, Odometry, PeopleDetector
from sonata2d.agents.controllers.local_map import CELL, add_scan, find_way, local_map
from sonata2d.core.entities import Furniture, Robot
from sonata2d.core.geometry import Pose, Rectangle
from sonata2d.core.scene import Scene

from ..conftest import L_SHAPE, room

KINDS: list[Any] = [Dwa, Mppi]
CART = Rectangle(0.9, 0.6)


def driven(scene: Scene, controller: s2.Controller) -> tuple[str, bool]:
    """The outcome of an episode, and whether the robot touched anything by its own fault."""
    episode, at_fault = s2.Episode(scene, controller), False
    while episode.step() is not None:
        at_fault |= any(contact.robot_at_fault for contact in episode.snapshot().contacts)
    assert episode.outcome is not None
    return episode.outcome.status, at_fault


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("kinematics", ["holonomic", "unicycle", "differential", "omni", "bicycle"])
def test_planners_drive_every_drive_round_the_corner_of_an_l_shape(kind: Any, kinematics: str) -> None:
    table = Furniture(9, "table", Pose(-2.0, 0.2), Rectangle(1.0, 1.0))
    scene = room([], [table], polygon=L_SHAPE, robot=Pose(-2.0, 3.0, -1.5), goal=(3.0, -2.0))
    scene = replace(scene, robot=Robot(scene.robot.pose, kinematics=kinematics))
    assert driven(scene, kind()) == ("goal", False)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(3))
def test_planners_reach_goals_among_people_with_a_rectangle(kind: Any, seed: int) -> None:
    robot = {"kinematics": "unicycle", "body": {"shape": "rectangle", "length": 0.9, "width": 0.6}}
    scene = s2.generate(s2.load_scenario("sonata-2020").changed(robot=robot), 40 + seed)
    assert driven(scene, kind()) == ("goal", False)


@pytest.mark.parametrize("kind", KINDS)
def test_the_same_seed_gives_the_same_commands(kind: Any) -> None:
    scene = s2.generate("sonata-2020", 7)
    commands = []
    for _ in range(2):
        episode = s2.Episode(scene, kind())
        for _ in range(30):
            episode.step()
        commands.append(episode.past.commands)
    np.testing.assert_array_equal(*commands)


def test_settings_are_recorded_and_restored() -> None:
    sensors = (Lidar("scan", rays=90, mount=(0.2, 0.0)), Odometry(skid=0.1))
    planner = Mppi(samples=64, temperature=0.5, sensors=sensors)
    again = Mppi.from_settings(orjson.loads(orjson.dumps(planner.settings())))
    assert (again.samples, again.temperature, again.sensors) == (64, 0.5, sensors)
    with pytest.raises(ValueError, match="samples"):
        Mppi(samples=1)
    front = Lidar("front")
    for sensors in ((), (front,), (front, Lidar("rear"), Odometry()), (front, Odometry(), PeopleDetector()), front):
        with pytest.raises(ValueError, match="sensors of Dwa are one Lidar and one Odometry"):
            Dwa(sensors=sensors)  # type: ignore[arg-type]


@pytest.mark.parametrize("late", [{"latency": 0.3}, {"rate": 2.0}])
def test_scans_lie_where_the_robot_was_though_the_odometry_is_late(late: dict[str, float]) -> None:
    exact = Odometry(translation=0.0, rotation=0.0, skid=0.0, **late)  # type: ignore[arg-type]
    errors: list[float] = []

    class Watched(Dwa):
        def act(self, snapshot: Any) -> s2.Twist:
            twist, pose = super().act(snapshot), episode.snapshot().robot.pose
            if snapshot.sensors.odometry is not None:
                r, places = self._rollouts.value, snapshot.sensors.lidar.points.tolist()
                expected = [pose.to_world((x, y)) for x, y in places]
                errors.append(float(np.abs(r.points[: r.number[0]] - expected).max()))
            return twist

    planner = Watched(sensors=(Lidar(rays=180, distance=8.0), exact))
    episode = s2.Episode(s2.generate("sonata-2020", 2), planner)
    for _ in range(35):
        episode.step()
    assert len(errors) > 30
    assert max(errors) < 0.01


def test_sensors_of_other_names_rates_and_mounts_are_used() -> None:
    sensors = (Lidar("scan", rate=5.0, rays=90, mount=(0.2, 0.0)), Odometry("wheels", latency=0.1))
    assert driven(room(), Dwa(sensors=sensors)) == ("goal", False)


def test_a_scan_marks_what_it_meets_and_clears_what_it_crosses() -> None:
    grid = local_map((0.0, 0.0), (4.0, 0.0))

    def cell(x: float, y: float) -> float:
        i, j = np.round((np.array([x, y]) - grid.low) / CELL).astype(int)
        return float(grid.evidence[i, j])

    ends, is_hit = np.array([[2.0, 0.0], [2.0, 0.1]]), np.array([True, True])
    for _ in range(2):
        add_scan(grid.low, grid.evidence, 0.0, 0.0, ends, is_hit)
    assert cell(2.0, 0.0) > 0.9
    assert cell(1.0, 0.0) == 0.0
    beyond = np.array([[3.0, 0.0], [3.0, 0.15]])
    for _ in range(4):
        add_scan(grid.low, grid.evidence, 0.0, 0.0, beyond, np.array([False, False]))
    assert cell(2.0, 0.0) == 0.0


def test_the_way_leads_round_what_was_seen_and_through_what_is_unknown() -> None:
    grid = local_map((0.0, 0.0), (4.0, 0.0))
    find_way(grid.low, grid.evidence, grid.price, grid.value, 0.3, 4.0, 0.0)
    i, j = np.round((0.0 - grid.low) / CELL).astype(int)
    direct = grid.value[i, j]
    assert direct == pytest.approx(4.0, rel=0.02)
    wall = np.stack((np.full(41, 2.0), np.linspace(-2.0, 2.0, 41)), axis=1)
    for _ in range(2):
        add_scan(grid.low, grid.evidence, 0.0, 0.0, wall, np.ones(41, dtype=bool))
    find_way(grid.low, grid.evidence, grid.price, grid.value, 0.3, 4.0, 0.0)
    assert grid.value[i, j] > 2.0 * np.hypot(2.0, 2.3)


@pytest.mark.parametrize(("rate", "latency"), [(None, 0.5), (2.0, 0.0), (5.0, 0.3)])
def test_late_and_rare_scans_stay_where_they_were_taken(rate: float | None, latency: float) -> None:
    sensors = (Lidar(rate=rate, latency=latency), Odometry(translation=0.0, rotation=0.0, skid=0.0))
    scene, planner = room(robot=Pose(-3.0, 0.0)), Dwa(sensors=sensors)
    episode = s2.Episode(scene, planner)
    for _ in range(35):
        episode.step()
        r = planner._rollouts.value
        points = r.points[: r.number[0]]
        if len(points):
            assert scene.barriers.gaps(points).min(axis=0).max() < 1e-6


def test_a_planner_that_takes_over_knows_how_the_wheels_stand() -> None:
    scene = replace(room(), robot=Robot(Pose(-2.0, 0.0), kinematics="bicycle"))
    episode = s2.Episode(scene)
    for _ in range(15):
        episode.apply(s2.Twist(0.6, 0.0, 0.5))
    planner = Dwa()
    branch = episode.branch(15, planner)
    branch.step()
    twist = branch.snapshot().robot.executed
    assert planner._rollouts.value.memory[0] == pytest.approx(np.arctan(0.5 * twist.omega / twist.vx), abs=0.16)
    assert abs(planner._rollouts.value.memory[0]) > 0.1


@pytest.mark.parametrize("dt", [0.05, 0.1, 0.25])
def test_the_plan_of_mppi_moves_on_with_time_and_not_with_ticks(dt: float) -> None:
    class Still(Mppi):
        """Keeps the first commands of the plans that it prices."""

        def _prices(self, commands: Any) -> Any:
            first.append(int(commands[0, 0, 0]))
            return np.ones(len(commands))

    first: list[int] = []
    controller = Still(samples=2)
    controller.reset(s2.generate(s2.load_scenario("empty").changed(rules={"dt": dt}), seed=1))
    controller._low[:], controller._high[:] = -100.0, 100.0
    for _ in range(12):
        controller._nominal[:] = np.arange(10.0)[:, None]  # numbers of the steps
        controller._plan()
    assert set(first) <= {0, 1, 2}
    assert abs(sum(first) - 12 * dt / 0.2) <= 1.0
