"""Drives: what they execute of a command, and how a recorded robot moves."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import pytest

import sonata2d as s2
from sonata2d.agents.drives.base import Drive, limit_speeds
from sonata2d.agents.drives.built_in import Bicycle, Differential, Omni
from sonata2d.core.compiled.kernel import kernel
from sonata2d.core.entities import Limits, Robot
from sonata2d.core.geometry import Pose, Twist
from sonata2d.core.portable_math import Array
from sonata2d.core.scene import Scene
from sonata2d.errors import ConfigError
from sonata2d.registry import DRIVES, drive_class

from ..conftest import room

LIMITS = Limits(ahead=2.0, back=1.0, sideways=1.0, turn=3.0, acceleration=20.0, turn_acceleration=60.0)


class Wild(s2.Controller):
    """Random commands, which change every half second."""

    def reset(self, scene: Scene) -> None:
        self._draw = np.random.default_rng(scene.seed)

    def act(self, snapshot: s2.Snapshot) -> Twist:
        if snapshot.tick % 5 == 0:
            self._command = Twist(*self._draw.uniform((-1.5, -1.0, -3.0), (2.5, 1.0, 3.0)).tolist())
        return self._command


def executed(drive: Drive, name: str, limits: Limits = LIMITS, seed: int = 1) -> Array:
    """(T, 3), executed twists of a robot in an empty hall."""
    scene = room(polygon=((-40.0, -40.0), (40.0, -40.0), (40.0, 40.0), (-40.0, 40.0)), seed=seed)
    robot = Robot(Pose(0.0, 0.0), 0.3, name, limits, None, drive.parameters or None)
    scene = s2.Scene(**{**{key: getattr(scene, key) for key in scene.__dataclass_fields__}, "robot": robot})
    episode = s2.Episode(scene, Wild())
    rows = []
    for _ in range(200):
        episode.step()
        twist = episode.snapshot().robot.executed
        rows.append((twist.vx, twist.vy, twist.omega))
    return np.array(rows)


def test_wheels_of_a_differential_drive_keep_their_limits() -> None:
    drive = Differential(track=0.5, wheel_speed=0.8, wheel_acceleration=2.0)
    twists = executed(drive, "differential")
    wheels = np.stack((twists[:, 0] - 0.25 * twists[:, 2], twists[:, 0] + 0.25 * twists[:, 2]))
    assert np.abs(wheels).max() == pytest.approx(0.8, abs=1e-9)
    assert np.abs(np.diff(wheels)).max() == pytest.approx(0.2, abs=1e-9)
    assert not twists[:, 1].any()


def test_wheels_of_an_omnidirectional_drive_keep_their_limits() -> None:
    drive = Omni(wheels=4.0, reach=0.3, wheel_speed=0.9, wheel_acceleration=3.0)
    twists = executed(drive, "omni")
    angle = math.pi * (2.0 * np.arange(4) + 1.0) / 4
    wheels = np.cos(angle)[:, None] * twists[:, 1] - np.sin(angle)[:, None] * twists[:, 0] + 0.3 * twists[:, 2]
    assert np.abs(wheels).max() == pytest.approx(0.9, abs=1e-6)
    assert np.abs(np.diff(wheels)).max() == pytest.approx(0.3, abs=1e-6)
    assert np.abs(twists[:, 1]).max() > 0.1


def test_a_bicycle_turns_only_as_it_moves_and_its_wheels_turn_slowly() -> None:
    drive = Bicycle(wheel_base=0.6, steering=0.5, steering_rate=1.0, rear=0.2)
    twists = executed(drive, "bicycle")
    moving = np.abs(twists[:, 0]) > 1e-3
    steering = np.arctan(twists[moving, 2] / twists[moving, 0] * 0.6)
    assert np.abs(steering).max() == pytest.approx(0.5, abs=1e-5)
    steps = np.abs(np.diff(steering))[np.diff(np.flatnonzero(moving)) == 1]
    assert steps.max() == pytest.approx(0.1, abs=1e-5)
    np.testing.assert_allclose(twists[:, 1], 0.2 * twists[:, 2], atol=1e-12)  # of the centre, before the rear axle
    assert np.abs(twists[~moving, 2]).max(initial=0.0) < 1e-2


@pytest.mark.parametrize("name", ["holonomic", "unicycle"])
def test_drives_without_parameters_keep_the_limits(name: str) -> None:
    limits = Limits(ahead=1.2, back=0.4, sideways=0.6, turn=1.0, acceleration=2.0, turn_acceleration=4.0)
    twists = executed(drive_class(name)(), name, limits)
    assert twists[:, 0].max() == pytest.approx(1.2)
    assert twists[:, 0].min() == pytest.approx(-0.4)
    assert np.abs(twists[:, 2]).max() == pytest.approx(1.0)
    assert np.linalg.norm(np.diff(twists[:, :2], axis=0), axis=1).max() == pytest.approx(0.2)
    assert twists[:, 1].any() == (name == "holonomic")


@kernel
def _halve(parameters: Array, limits: Array, memory: Array, now: Array, command: Array, dt: float) -> None:
    limit_speeds(limits, now, command, dt)
    for axis in range(3):
        command[axis] *= parameters[0]


@dataclass(frozen=True)
class Sluggish(Drive):
    """Executes a part of each command.

    Attributes:
        part: of the command.
    """

    part: float = 0.5
    kernel: ClassVar[Any] = _halve


def test_a_registered_drive_has_a_scenario_a_file_and_a_replay(tmp_path: Any) -> None:
    DRIVES.register("sluggish", Sluggish)
    try:
        scenario = s2.ScenarioConfig(humans=1, robot={"kinematics": "sluggish", "drive": {"part": 0.25}})
        s2.generate_dataset(tmp_path / "o", scenario, controller=s2.StraightToGoal(), episodes=1, workers=1)
        record = s2.read_episode(tmp_path / "o" / "000000.json")
        assert record.scene().robot.drive == {"part": 0.25, "sideways": 0.0}
        assert 0.0 < record.executed[:, 0].max() <= 0.25 + 1e-9
        assert not list(s2.datasets.verify(tmp_path / "o", replay=True))
    finally:
        del DRIVES.registered["sluggish"]


@pytest.mark.parametrize(
    ("robot", "message"),
    [
        ({"kinematics": "bicyle"}, "no drive is named 'bicyle'; did you mean 'bicycle'"),
        ({"kinematics": "bicycle", "drive": {"wheelbase": 1.0}}, "no parameter 'wheelbase'; did you mean 'wheel_base'"),
        ({"kinematics": "bicycle", "drive": {"wheel_base": -1.0}}, "greater than 0, got -1.0"),
        ({"kinematics": "unicycle", "drive": {"track": 1.0}}, "no parameter 'track'; it has none"),
    ],
)
def test_settings_of_drives_are_checked(robot: dict[str, Any], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        s2.ScenarioConfig(robot=robot)


def test_a_kernel_that_is_an_ordinary_function_is_refused() -> None:
    @dataclass(frozen=True)
    class Plain(Drive):
        kernel: ClassVar[Any] = staticmethod(lambda *_: None)

    if s2.core.compiled.kernel.IS_COMPILED:
        with pytest.raises(TypeError, match="decorator `kernel`"):
            Plain.address()


@pytest.mark.parametrize(("name", "axes"), [("omni", 3), ("holonomic", 3), ("differential", 2), ("bicycle", 2)])
def test_actions_have_a_sideways_axis_if_the_drive_has_one(name: str, axes: int) -> None:
    pytest.importorskip("gymnasium")
    scenario = s2.ScenarioConfig(humans=2, robot={"kinematics": name})
    from sonata2d.gym import SocialNavEnv

    env = SocialNavEnv(scenario)
    env.reset(seed=1)
    start = env.unwrapped.snapshot.robot.position
    assert env.action_space.shape == (axes,)
    worlds = s2.Worlds([s2.generate(scenario, 1)])
    worlds.reset()
    command = np.linspace(1.0, 0.4, axes)
    for _ in range(30):
        env.step(command.astype(np.float32))
        worlds.step(command[None])
    assert worlds.action_size == axes
    assert math.dist(env.unwrapped.snapshot.robot.position, start) > 0.2


def test_worlds_begin_each_episode_with_straight_wheels() -> None:
    """The memory of a drive is cleared between episodes."""
    scenario = s2.ScenarioConfig(humans=0, robot={"kinematics": "bicycle"}, rules={"time_limit": 2.0})
    worlds = s2.Worlds([s2.generate(scenario, 1)])
    worlds.reset()
    episodes: list[list[Any]] = [[]]
    for _ in range(50):
        step = worlds.step(np.array([[1.0, 1.0]]))
        if step.is_first[0]:
            episodes.append([])
        else:
            episodes[-1].append(step.observations["robot"][0].tolist())
    assert len(episodes) > 2
    assert episodes[1] == episodes[0]
    assert episodes[0][0] != episodes[0][-1]


@kernel
def _overflow(parameters: Array, limits: Array, memory: Array, now: Array, command: Array, dt: float) -> None:
    command[0] = command[0] / parameters[0]


@dataclass(frozen=True)
class Broken(Drive):
    """Divides by zero."""

    divisor: float = 0.0
    kernel: ClassVar[Any] = _overflow


def test_a_drive_whose_velocity_is_not_finite_ends_the_episode_with_an_error() -> None:
    DRIVES.register("broken", Broken)
    try:
        scene = s2.generate(s2.ScenarioConfig(humans=0, robot={"kinematics": "broken"}), 1)
        with pytest.raises((ValueError, ZeroDivisionError)):
            s2.Episode(scene, s2.StraightToGoal()).run()
    finally:
        del DRIVES.registered["broken"]


@pytest.mark.parametrize(
    ("kinematics", "drive", "message"),
    [
        ("differential", {"track": 1e-5}, "greater than 0"),
        ("omni", {"wheels": 2.0}, "greater than or equal to 3"),
        ("omni", {"wheels": 3.5}, "multiple of 1"),
        ("bicycle", {"steering": 1.6}, "less than or equal to 1.5"),
    ],
)
def test_parameters_that_no_robot_has_are_refused(kinematics: str, drive: dict[str, float], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        s2.ScenarioConfig(robot={"kinematics": kinematics, "drive": drive})


def test_another_drive_has_its_own_parameters_in_a_derived_scenario() -> None:
    base = s2.ScenarioConfig(robot={"kinematics": "differential", "drive": {"track": 0.6}})
    assert base.changed(robot={"kinematics": "unicycle"}).robot.drive is None
    assert base.changed(robot={"kinematics": "bicycle"}).robot.drive == Bicycle().parameters
    assert base.changed(robot={"drive": {"track": 0.5}}).robot.drive["track"] == 0.5  # type: ignore[index]
    assert base.changed(robot={"radius": 0.2}).robot.drive == base.robot.drive
