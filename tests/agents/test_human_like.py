"""A hand is late, smooth and unsteady, and the same hand again in the same episode."""

from __future__ import annotations

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
from sonata2d.core.rng import RandomStream
from sonata2d.core.scene import Rules, Scene
from sonata2d.core.snapshot import Frame, Snapshot
from sonata2d.datasets.replay import check_replay, check_rerun
from sonata2d.record.reader import read_episode
from sonata2d.record.recorder import EpisodeRecorder
from sonata2d.sim.episode import Episode

from ..conftest import room, walker


class Steady(Controller):
    """Wants one twist throughout."""

    def __init__(self, twist: Twist = Twist(0.6)) -> None:  # noqa: B008
        self._twist = twist

    def act(self, snapshot: Snapshot) -> Answer:
        return self._twist


class Labelling(Steady):
    """Stops after a while, and labels until then."""

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


def commands(scene: Scene, controller: Controller) -> Any:
    """(T, 3), body frame."""
    return np.array([[f.command.vx, f.command.vy, f.command.omega] for f in run(scene, controller)])


def still(**more: Any) -> Scene:
    """A scene that lasts 20 s whatever the robot does."""
    return room(rules=Rules(time_limit=20.0, ends_on=()), **more)


def test_without_delay_lag_and_noise_it_is_the_inner_controller() -> None:
    scene = room([walker(1, 0.0, 0.5), walker(2, 1.0, -1.0)])
    bare = HumanLike(delay=0.0, lag=0.0, noise=0.0)
    assert np.array_equal(commands(scene, bare), commands(scene, s2.SocialPlanner()))


def test_the_hand_is_late_and_then_follows_as_a_lag() -> None:
    vx = commands(still(), HumanLike(Steady(), delay=0.3, lag=0.2, noise=0.0))[:, 0]
    assert (vx[:3] == 0.0).all()
    k = np.arange(len(vx) - 3) + 1
    assert vx[3:] == pytest.approx(0.6 * (1.0 - np.exp(-0.1 * k / 0.2)), abs=1e-4)


def test_noise_is_as_large_as_said_and_grows_with_the_command() -> None:
    spread = []
    for share in (0.0, 0.4):
        told = [commands(still(seed=s), HumanLike(Steady(Twist(share)), lag=0.0, noise=0.2))[20:, 0] for s in range(12)]
        spread.append(np.std(told))
    assert spread[0] == pytest.approx(0.2 * 0.1, rel=0.2)
    assert spread[1] == pytest.approx(0.2 * (0.1 + 0.9 * 0.4), rel=0.2)


def test_the_hand_keeps_within_the_limits_of_the_robot() -> None:
    scene = still(limits=Limits(ahead=0.4, back=0.2, sideways=0.3, turn=0.8))
    wild = commands(scene, HumanLike(Steady(Twist(9.0, -9.0, 9.0)), noise=3.0))
    assert (wild.min(axis=0) >= [-0.2, -0.3, -0.8]).all()
    assert (wild.max(axis=0) <= [0.4, 0.3, 0.8]).all()
    unicycle = replace(scene, robot=Robot(scene.robot.pose, kinematics="unicycle"))
    assert not commands(unicycle, HumanLike(noise=1.0))[:, 1].any()


def test_an_episode_has_its_own_noise_and_always_the_same() -> None:
    hand = HumanLike()
    first = commands(still(seed=1), hand)
    assert not np.array_equal(first, commands(still(seed=2), hand))
    assert not np.array_equal(first, commands(replace(still(seed=1), episode=1), hand))
    assert np.array_equal(first, commands(still(seed=1), hand))
    assert RandomStream(1, 0, "controller").uniform() != RandomStream(1, 0, "people").uniform()


def test_the_hand_mirrors_with_the_scene_and_its_side() -> None:
    scene = room(robot=Pose(-3.0, 1.0, 0.5), goal=(3.0, -1.0), seed=4)
    image = room(robot=Pose(-3.0, -1.0, -0.5), goal=(3.0, 1.0), seed=4, rules=Rules(side=-1))
    there, here = (commands(s, HumanLike(s2.StraightToGoal())) for s in (scene, image))
    assert here == pytest.approx(there * [1.0, -1.0, -1.0], abs=1e-4)


def test_labels_are_the_inner_controllers_or_what_it_intends() -> None:
    assert all(frame.label is None for frame in run(room(), HumanLike()))
    frames = run(room(), HumanLike(Labelling()))
    assert [frame.label for frame in frames] == [{"time": frame.snapshot.time} for frame in frames]
    assert len(frames) == 5
    teacher = HumanLike(Steady(Twist(0.123456, -0.00001, 0.5)), labels_intention=True)
    assert list(teacher.labels) == ["intention"]
    assert [frame.label for frame in run(still(), teacher)] == [[0.1235, 0.0, 0.5]] * 200


@pytest.mark.parametrize("inner", [None, SocialForce(model="helbing1995", speed=0.6)])
def test_a_file_restores_the_hand_and_what_it_carries_out(inner: Controller | None, tmp_path: Path) -> None:
    hand = HumanLike(inner, delay=0.1, lag=0.3, noise=0.123456789, labels_intention=True)
    path = tmp_path / "run.json"
    with s2.JsonRecorder(path) as recorder:
        Episode(room([walker(1, 0.0, 0.5)], rules=Rules(time_limit=4.0)), hand, observers=[recorder]).run()
    assert check_replay(path) == []
    assert check_rerun(path) == []
    told = read_episode(path).author
    assert load_controller(told.path, told.settings or {}).settings() == told.settings


def test_a_branch_goes_on_from_where_the_drive_is() -> None:
    episode = Episode(still(), Steady())
    for _ in range(20):
        episode.step()
    frame = episode.branch(20, HumanLike(Steady(Twist()), noise=0.0)).step()
    assert frame is not None
    assert frame.command.vx == pytest.approx(0.6)


@pytest.mark.parametrize("wrong", [{"delay": -0.1}, {"lag": math.inf}, {"noise": math.nan}])
def test_numbers_that_make_no_hand_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=f"{next(iter(wrong))} must be 0 or more"):
        HumanLike(**wrong)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="no Controller"):
        HumanLike.from_settings({"inner": {"path": "math:inf", "version": None, "settings": {}}})


def test_it_drives_to_the_goal_among_people() -> None:
    outcomes = []
    for episode in range(6):
        recorder = EpisodeRecorder()
        scene = s2.generate(s2.ScenarioConfig(), seed=3, episode=episode)
        outcomes.append(Episode(scene, HumanLike(), observers=[recorder]).run().status)
    assert outcomes.count("goal") >= 5
