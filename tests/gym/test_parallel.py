"""`SocialNavParallelEnv`: robots as agents of PettingZoo; and one agent among robots in `SocialNavEnv`."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest

import sonata2d as s2
from sonata2d.datasets import verify

pytest.importorskip("pettingzoo", reason="PettingZoo is missing; pip install 'sonata2d[pettingzoo]'")

with warnings.catch_warnings():
    warnings.simplefilter("ignore")  # it loads modules that it deprecates
    from pettingzoo.test import parallel_api_test

from sonata2d.gym import SocialNavEnv, SocialNavParallelEnv

FLEET = {"robots": [{"kinematics": "unicycle"}, {"body": {"shape": "rectangle", "length": 0.8, "width": 0.5}}]}


def drive(env: SocialNavParallelEnv, ticks: int) -> dict[str, float]:
    """Drive straight ahead; the sum of rewards by agent."""
    total = dict.fromkeys(env.possible_agents, 0.0)
    for _ in range(ticks):
        if not env.agents:
            break
        ahead = {agent: np.eye(1, *env.action_space(agent).shape)[0] for agent in env.agents}  # type: ignore[misc]
        _, rewards, *_ = env.step(ahead)
        for agent, reward in rewards.items():
            total[agent] += reward
    return total


def test_the_api_test_of_pettingzoo_passes() -> None:
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", ".*'options' is ignored")
        for settings in (FLEET, {"robots": 2, "rules": {"time_limit": 3.0}}):
            parallel_api_test(SocialNavParallelEnv("sonata-2020", settings=settings), num_cycles=300)


def test_each_agent_has_the_space_of_its_drive() -> None:
    env = SocialNavParallelEnv("sonata-2020", settings=FLEET)
    assert env.possible_agents == ["robot_0", "robot_1", "robot_2"]
    assert [env.action_space(agent).shape for agent in env.possible_agents] == [(3,), (2,), (3,)]
    observations, infos = env.reset(seed=4)
    for agent, observation in observations.items():
        assert env.observation_space(agent).contains(observation)
    assert infos["robot_1"] == {"seed": 4, "episode_number": 0}
    again = SocialNavParallelEnv("sonata-2020", settings=FLEET)
    again.reset(seed=4)
    assert drive(env, 20) == drive(again, 20)
    assert env.reset()[1]["robot_0"] == {"seed": 4, "episode_number": 1}
    assert env.reset(options={"episode": 7})[1]["robot_0"] == {"seed": 4, "episode_number": 7}


def test_an_agent_observes_what_its_robot_would_alone_and_others_as_people() -> None:
    env = SocialNavParallelEnv("empty", settings={"robots": 3})
    observations, _ = env.reset(seed=1)
    scene = s2.generate(s2.load_scenario("empty").changed(robots=3), seed=1)
    starts = np.array([robot.pose.position for robot, _ in scene.tasks])
    for k, agent in enumerate(env.possible_agents):
        assert observations[agent]["humans_mask"].sum() == 2
        seen = np.linalg.norm(observations[agent]["humans"][:2, :2], axis=1)
        expected = np.linalg.norm(np.delete(starts, k, axis=0) - starts[k], axis=1)
        assert sorted(seen) == pytest.approx(sorted(expected), abs=1e-3)


def test_agents_terminate_at_their_goals_and_the_others_go_on(tmp_path: Path) -> None:
    near = {"pose": [0, 0, 0], "goal": {"position": [1.5, 0.0], "min_distance": 0.5}}
    settings = {
        "robot": {"pose": [-2, 2, 0]}, "goal": {"position": [3.0, 2.0]}, "robots": [near],
        "room": {"polygon": [[-5, -5], [5, -5], [5, 5], [-5, 5]]},
    }  # fmt: skip
    env = SocialNavParallelEnv("empty", settings=settings, record=tmp_path / "runs")
    env.reset(seed=2)
    ends: dict[str, tuple[int, Any]] = {}
    for tick in range(100):
        if not env.agents:
            break
        _, _, terminations, _, infos = env.step({agent: np.array([1.0, 0.0, 0.0]) for agent in env.agents})
        ends |= {agent: (tick, infos[agent]) for agent, is_over in terminations.items() if is_over}
    assert ends["robot_1"][0] < ends["robot_0"][0]
    assert {info["outcome"] for _, info in ends.values()} == {"goal"}
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step({})
    env.close()
    (file,) = (tmp_path / "runs").glob("*.json")
    assert s2.read_episode(file).outcome.status == "goal"
    assert verify(file, replay=True) == []


def test_wrong_arguments_and_actions_are_refused() -> None:
    with pytest.raises(ValueError, match="render_mode must be one of human, rgb_array, or None"):
        SocialNavParallelEnv(render_mode="rgb_array_list")
    env = SocialNavParallelEnv("empty", settings={"robots": 2}, render_mode="rgb_array", render_size=(80, 60))
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step({})
    with pytest.warns(UserWarning, match="reset knows the option 'episode' only; 'state' is ignored"):
        env.reset(options={"state": 1})
    with pytest.raises(ValueError, match="seed must be an integer from 0"):
        env.reset(seed=-1)
    env.reset(seed=1)
    with pytest.raises(KeyError, match="step needs an action of each agent, robot_1 has none"):
        env.step({"robot_0": np.zeros(3)})
    with pytest.raises(ValueError, match=r"an action has the shape \(3,\)"):
        env.step({"robot_0": np.zeros(3), "robot_1": np.zeros(2)})
    assert env.render().shape == (60, 80, 3)
    env.close()


def test_one_agent_drives_among_robots_with_controllers() -> None:
    env = SocialNavEnv("sonata-2020", settings={"robots": 3}, render_mode="rgb_array", render_size=(200, 200))
    observation, _ = env.reset(seed=1)
    assert env.observation_space.contains(observation)
    expert = s2.SocialPlanner()
    expert.reset(env.scene)
    info: dict[str, Any] = {}
    others = env.snapshot.humans.position[-2:].copy()
    over = False
    while not over:
        observation, _, terminated, truncated, info = env.step(env.action_of(expert.act(env.snapshot)))
        assert env.observation_space.contains(observation)
        over = terminated or truncated
    assert info["is_success"]
    assert np.linalg.norm(env.snapshot.humans.position[-2:] - others, axis=1).min() > 0.3  # they drove too
    assert env.render().shape == (200, 200, 3)


def test_an_arrival_in_the_last_tick_is_a_success_and_unknown_agents_are_refused() -> None:
    def settings(time_limit: float) -> dict[str, Any]:
        other = {"pose": [-2, 2, 0], "limits": {"ahead": 0.1}, "goal": {"position": [2, 2]}}
        task = {"robot": {"pose": [-2, -2, 0]}, "goal": {"position": [0, -2]}, "robots": [other], "humans": 0}
        return task | {"room": {"kinds": "square", "side": 8}, "rules": {"time_limit": time_limit}}

    ticks = 0
    for time_limit in (20.0, 0.0):
        env = SocialNavEnv("empty", settings=settings(time_limit or 0.1 * ticks))
        env.reset(seed=1)
        steps = 0
        while True:
            _, _, terminated, truncated, info = env.step(np.array([1.0, 0.0, 0.0], dtype=np.float32))
            steps += 1
            if terminated or truncated:
                break
        assert (terminated, truncated, info["outcome"]) == (True, False, "goal")
        assert ticks in (0, steps)
        ticks = steps
    parallel = SocialNavParallelEnv("empty", settings=settings(20.0))
    parallel.reset(seed=1)
    action = np.zeros(3, dtype=np.float32)
    for wrong in ({**dict.fromkeys(parallel.agents, action), "robot_9": action}, [action, action]):
        with pytest.raises(KeyError, match="step takes actions by the names of agents"):
            parallel.step(wrong)  # type: ignore[arg-type]


def test_vectors_and_worlds_refuse_several_robots() -> None:
    from sonata2d.gym import SocialNavVectorEnv

    scene = s2.generate(s2.load_scenario("empty").changed(robots=2), seed=1)
    message = r"has 2 robots; vectors and Worlds take scenes with one robot"
    with pytest.raises(ValueError, match=message):
        s2.Worlds([scene]).reset()
    vector = SocialNavVectorEnv(2, "empty", settings={"robots": 2})
    with pytest.raises(ValueError, match=message):
        vector.reset(seed=1)
