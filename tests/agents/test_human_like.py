"""`HumanLike`: delay, lag and noise; the noise is reproducible in the same episode."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import sonata2d as s2
from sonata2d.agents.controllers.base import Answer, Controller, Stop
from sonata2d.agents.controllers.human_like import HumanLike
from sonata2d.agents.controllers.loading import load_controller
from sonata2d.agents.controllers.reactive import SocialForce
from sonata2d.core.entities import Limits, Robot
from sonata2d.core.geometry import Pose, Twist
from sonata2d.core.portable_math import Array
from sonata2d.core.rng import RandomStream
from sonata2d.core.scene import Rules, Scene
from sonata2d.core.snapshot import Frame, Snapshot
from sonata2d.datasets.check.replay import check_replay, check_rerun
from sonata2d.errors import ControllerError
from sonata2d.record.reader import read_episode
from sonata2d.sim.episode import Episode

from ..conftest import room, walker


class Constant(Controller):
    """Always commands the same twist."""

    def __init__(self, vx: float = 0.6, vy: float = 0.0, omega: float = 0.0) -> None:
        self._twist = Twist(vx, vy, omega)

    def act(self, snapshot: Snapshot) -> Answer:
        return self._twist


class Labelling(Constant):
    """Labels each frame, and stops at tick 5."""

    labels = {"time": "s"}  # noqa: RUF012

    def act(self, snapshot: Snapshot) -> Answer:
        return Stop("enough") if snapshot.tick == 5 else self._twist

    def label(self, snapshot: Snapshot, twist: Twist) -> Any:
        return {"time": snapshot.time}


def run(scene: Scene, controller: Controller) -> list[Frame]:
    """Every frame of an episode."""
    episode, frames = Episode(scene, controller), []
    while (frame := episode.step()) is not None:
        frames.append(frame)
    return frames


def commands(scene: Scene, controller: Controller) -> Array:
    """The commands of an episode, (T, 3), body frame."""
    return np.array([[f.command.vx, f.command.vy, f.command.omega] for f in run(scene, controller)])


def timed_scene(**fields: Any) -> Scene:
    """A scene that lasts 20 s whatever the robot does."""
    return room(rules=Rules(time_limit=20.0, ends_on=()), **fields)


def test_without_delay_lag_and_noise_the_commands_are_the_inner_controllers() -> None:
    scene = room([walker(1, 0.0, 0.5), walker(2, 1.0, -1.0)])
    unchanged = HumanLike(delay=0.0, lag=0.0, noise=0.0)
    assert np.array_equal(commands(scene, unchanged), commands(scene, s2.SocialPlanner()))


def test_command_is_delayed_and_then_follows_a_first_order_lag() -> None:
    vx = commands(timed_scene(), HumanLike(Constant(), delay=0.3, lag=0.2, noise=0.0))[:, 0]
    assert (vx[:3] == 0.0).all()
    k = np.arange(len(vx) - 3) + 1
    assert vx[3:] == pytest.approx(0.6 * (1.0 - np.exp(-0.1 * k / 0.2)), abs=1e-4)


@pytest.mark.parametrize("command", [0.0, 0.4])
def test_noise_has_the_specified_size_and_grows_with_the_command(command: float) -> None:
    driver = HumanLike(Constant(command), lag=0.0, noise=0.2)
    vx = [commands(timed_scene(seed=seed), driver)[20:, 0] for seed in range(12)]
    assert np.std(vx) == pytest.approx(0.2 * (0.1 + 0.9 * command), rel=0.2)


def test_commands_stay_within_the_limits_of_the_robot() -> None:
    scene = timed_scene(limits=Limits(ahead=0.4, back=0.2, sideways=0.3, turn=0.8))
    extreme = commands(scene, HumanLike(Constant(9.0, -9.0, 9.0), noise=3.0))
    assert (extreme.min(axis=0) >= [-0.2, -0.3, -0.8]).all()
    assert (extreme.max(axis=0) <= [0.4, 0.3, 0.8]).all()
    unicycle = replace(scene, robot=Robot(scene.robot.pose, kinematics="unicycle"))
    assert not commands(unicycle, HumanLike(noise=1.0))[:, 1].any()


def test_noise_depends_on_seed_and_episode_only() -> None:
    driver = HumanLike()
    first = commands(timed_scene(seed=1), driver)
    assert not np.array_equal(first, commands(timed_scene(seed=2), driver))
    assert not np.array_equal(first, commands(replace(timed_scene(seed=1), episode=1), driver))
    assert np.array_equal(first, commands(timed_scene(seed=1), driver))
    assert RandomStream(1, 0, "controller").uniform() != RandomStream(1, 0, "people").uniform()


def test_noise_is_mirrored_with_the_scene_and_its_side() -> None:
    scene = room(robot=Pose(-3.0, 1.0, 0.5), goal=(3.0, -1.0), seed=4)
    mirrored = room(robot=Pose(-3.0, -1.0, -0.5), goal=(3.0, 1.0), seed=4, rules=Rules(side=-1))
    original, image = (commands(s, HumanLike(s2.StraightToGoal())) for s in (scene, mirrored))
    assert image == pytest.approx(original * [1.0, -1.0, -1.0], abs=1e-4)


def test_labels_are_the_inner_controllers_or_the_intention() -> None:
    assert all(frame.label is None for frame in run(room(), HumanLike()))
    frames = run(room(), HumanLike(Labelling()))
    assert [frame.label for frame in frames] == [{"time": frame.snapshot.time} for frame in frames]
    assert len(frames) == 5
    expert = HumanLike(Constant(0.123456, -0.00001, 0.5), labels_intention=True)
    assert list(expert.labels) == ["intention"]
    assert [frame.label for frame in run(timed_scene(), expert)] == [[0.1235, 0.0, 0.5]] * 200


@pytest.mark.parametrize("inner", [None, SocialForce(model="helbing1995", speed=0.6)])
def test_recorded_settings_reconstruct_the_controller_and_its_inner_one(
    inner: Controller | None, tmp_path: Path
) -> None:
    driver = HumanLike(inner, delay=0.1, lag=0.3, noise=0.123456789, labels_intention=True)
    path = tmp_path / "run.json"
    with s2.JsonRecorder(path) as recorder:
        Episode(room([walker(1, 0.0, 0.5)], rules=Rules(time_limit=4.0)), driver, observers=[recorder]).run()
    assert check_replay(read_episode(path)) == []
    assert check_rerun(read_episode(path)) == []
    recorded = read_episode(path).controller_info
    assert load_controller(recorded.path, recorded.settings or {}).settings() == recorded.settings


def test_a_branch_starts_from_the_present_motion() -> None:
    episode = Episode(timed_scene(), Constant())
    for _ in range(20):
        episode.step()
    frame = episode.branch(20, HumanLike(Constant(0.0), noise=0.0)).step()
    assert frame is not None
    assert frame.command.vx == pytest.approx(0.6)


@pytest.mark.parametrize(
    ("invalid", "problem"),
    [
        ({"delay": -0.1}, "delay must be 0 or more, got -0.1"),
        ({"lag": math.inf}, "lag must be finite, got inf"),
        ({"noise": math.nan}, "noise must be finite, got nan"),
    ],
)
def test_invalid_parameters_are_rejected(invalid: dict[str, float], problem: str) -> None:
    with pytest.raises(ValueError, match=problem):
        HumanLike(**invalid)  # type: ignore[arg-type]


def test_a_recorded_inner_controller_that_is_not_a_controller_is_rejected() -> None:
    with pytest.raises(ControllerError, match="math:inf is not a Controller class"):
        HumanLike.from_settings({"inner": {"path": "math:inf", "version": None, "settings": {}}})


def test_an_inner_controller_that_only_a_file_names_is_not_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("harm.py").write_text("open('harm', 'w')\n")
    for depth in range(2):
        path = tmp_path / f"{depth}.json"
        with s2.JsonRecorder(path) as recorder:
            driver = HumanLike(HumanLike() if depth else None)
            Episode(room([], rules=Rules(time_limit=1.0)), driver, observers=[recorder]).run()
        assert check_rerun(read_episode(path)) == []
        document = json.loads(path.read_bytes())
        settings = document["controller"]["settings"]
        inner = settings["inner"]["settings"]["inner"] if depth else settings["inner"]
        for place in ("./harm.py:Driver", "harm:Driver", "./harm.py", "os:system", 3):
            inner["path"] = place
            path.write_text(json.dumps(document))
            (problem,) = check_rerun(read_episode(path))
            assert "is neither built in nor a plug-in, and code that a file names is not run" in problem.message
            assert repr(str(settings["inner"]["path"])) in problem.message
        settings["inner"] = "harm"
        path.write_text(json.dumps(document))
        assert check_rerun(read_episode(path))
    assert not Path("harm").exists()


def test_it_reaches_the_goal_among_people() -> None:
    scenes = [s2.generate(s2.ScenarioConfig(), seed=3, episode=episode) for episode in range(6)]
    outcomes = [Episode(scene, HumanLike()).run().status for scene in scenes]
    assert outcomes.count("goal") >= 5
