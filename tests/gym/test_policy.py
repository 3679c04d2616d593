"""Policies as controllers: functions, files of perceptrons, descriptions; demonstrations."""

from __future__ import annotations

import json
import pickle
from itertools import pairwise
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest

import sonata2d as s2
import sonata2d.gym as s2g
from sonata2d.agents.controllers.loading import load_controller
from sonata2d.datasets.check.replay import check_replay, check_rerun
from sonata2d.errors import ControllerError
from sonata2d.gym.description import describe, environment_of
from sonata2d.gym.mlp import Mlp, read_mlp, write_mlp
from sonata2d.gym.pipeline import Pipeline
from sonata2d.record.reader import read_episode
from tests.gym.samples import CHAINS, SHORT, Env, actions, equal


def perceptron(env: Env, seed: int = 0, output: str = "clip") -> Mlp:
    """A perceptron with random weights for the flat observations of an environment."""
    shape, space = env.observation_space.shape, env.action_space
    assert shape is not None
    outputs = int(space.n) if isinstance(space, gymnasium.spaces.Discrete) else space.shape[0]  # type: ignore[index]
    rng, widths = np.random.default_rng(seed), (shape[0], 16, outputs)
    return Mlp(
        weights=[rng.normal(size=pair) / np.sqrt(pair[0]) for pair in pairwise(widths)],
        biases=[rng.normal(size=width) / 4.0 for width in widths[1:]],
        activation="tanh",
        output=output,
        environment=describe(env),
        mean=rng.normal(size=shape[0]),
        scale=rng.uniform(0.5, 2.0, shape[0]),
        limit=10.0,
    )


def make(**arguments: Any) -> Env:
    return s2g.Flat(s2g.SocialNavEnv("lively", settings=SHORT, **arguments))


@pytest.mark.parametrize("activation", ["tanh", "relu"])
@pytest.mark.parametrize("output", ["clip", "tanh", "argmax"])
def test_a_perceptron_computes_what_numpy_does(activation: str, output: str) -> None:
    env = make()
    env.reset(seed=0)
    mlp = perceptron(env, output=output)
    object.__setattr__(mlp, "activation", activation)
    for k in range(20):
        observation = env.reset(seed=k)[0]
        h = np.clip((observation - mlp.mean) * mlp.scale, -10.0, 10.0)
        h = h @ mlp.weights[0] + mlp.biases[0]
        h = (np.tanh(h) if activation == "tanh" else np.maximum(h, 0.0)) @ mlp.weights[1] + mlp.biases[1]
        expected = {"clip": np.clip(h, -1, 1), "tanh": np.tanh(h), "argmax": np.argmax(h)}[output]
        np.testing.assert_allclose(mlp(observation), expected, atol=0.01)


def test_a_file_of_a_perceptron_is_a_controller(tmp_path: Path) -> None:
    env, path = make(), tmp_path / "policy.npz"
    mlp = perceptron(env)
    write_mlp(path, mlp)
    first = path.read_bytes()
    write_mlp(path, mlp)
    assert path.read_bytes() == first
    again = read_mlp(path)
    observation = env.reset(seed=0)[0]
    np.testing.assert_allclose(again(observation), mlp(observation), atol=1e-3)
    controller = load_controller(str(path))
    assert isinstance(controller, s2g.PolicyController)
    scene = s2.generate(s2.load_scenario("lively").changed(**SHORT), 3)
    file = tmp_path / "run.json"
    with s2.JsonRecorder(file) as recorder:
        s2.Episode(scene, controller, observers=[recorder]).run()
    assert check_replay(read_episode(file)) == []
    assert check_rerun(read_episode(file), str(path)) == []
    commands = s2.read_episode(file).command
    env.reset(options={"episode": 0}, seed=3)
    for command in commands[:20]:  # the controller does in the episode what the policy does in the environment
        base = env.unwrapped
        assert isinstance(base, s2g.SocialNavEnv)
        twist = base.twist_of(again(observation_of(env)))
        np.testing.assert_allclose(command, [twist.vx, twist.vy, twist.omega], atol=1e-4)
        env.step(again(observation_of(env)))


def observation_of(env: Env) -> Any:
    """The present observation."""
    base = env.unwrapped
    assert isinstance(base, s2g.SocialNavEnv)
    assert isinstance(env, gymnasium.ObservationWrapper)
    return env.observation(base.encoder.encode(base.snapshot))


def test_settings_of_a_policy_reconstruct_it_only_with_the_same_file(tmp_path: Path) -> None:
    path = tmp_path / "policy.npz"
    write_mlp(path, perceptron(make()))
    settings = json.loads(json.dumps(s2g.PolicyController(path).settings()))
    assert s2g.PolicyController.from_settings(settings).settings() == settings
    write_mlp(path, perceptron(make(), seed=1))
    with pytest.raises(ControllerError, match="has other weights now"):
        s2g.PolicyController.from_settings(settings)


def test_functions_and_models_are_policies() -> None:
    env = s2g.SocialNavEnv("empty")
    scene = s2.generate(s2.load_scenario("empty"), 1)

    def act(observation: Any) -> list[float]:
        return [1.0, 0.0, float(np.arctan2(observation["goal"][1], observation["goal"][0]))]

    class Model:
        def predict(self, observation: Any, deterministic: bool = False) -> tuple[Any, None]:
            assert deterministic
            return act(observation), None

    class Plain:
        def predict(self, observation: Any) -> tuple[Any, None]:
            return act(observation), None

    outcomes = [s2.Episode(scene, s2g.PolicyController(policy, env)).run() for policy in (act, Model(), Plain())]
    assert outcomes[0] == outcomes[1] == outcomes[2]
    assert outcomes[0].status == "goal"


@pytest.mark.parametrize("chain", CHAINS)
def test_a_policy_sees_what_the_environment_shows(chain: str) -> None:
    """The controller of a policy in an episode gets the observations of the wrapped environment."""
    env = CHAINS[chain](s2g.SocialNavEnv("lively", settings=SHORT))
    env.action_space.seed(0)
    moves = [env.action_space.sample() for _ in range(60)]
    seen: list[Any] = []

    def act(observation: Any) -> Any:
        seen.append(observation)
        return moves[len(seen) - 1]

    scene = s2.generate(s2.load_scenario("lively").changed(**SHORT), 8)
    s2.Episode(scene, s2g.PolicyController(act, env)).run()
    expected = [env.reset(seed=8)[0]] + [env.step(move)[0] for move in moves[: len(seen) - 1]]
    assert len(seen) > 10
    assert all(equal(a, b) for a, b in zip(seen, expected, strict=True))


@pytest.mark.parametrize("chain", CHAINS)
def test_a_description_gives_the_same_observations_and_actions(chain: str) -> None:
    env = CHAINS[chain](s2g.SocialNavEnv("lively", settings={"robot": {"kinematics": "unicycle"}}, order="scene"))
    again = environment_of(json.loads(json.dumps(describe(env))))
    assert again.observation_space == env.observation_space
    assert again.action_space == env.action_space
    driven = s2g.SocialNavEnv("lively", settings={"robot": {"kinematics": "unicycle"}})
    driven.reset(seed=2)
    first, second = Pipeline(env), Pipeline(again)  # both see the same snapshots
    for move, action in zip(actions(driven, 20), actions(env, 20), strict=True):
        assert equal(first.observe(driven.snapshot), second.observe(driven.snapshot))
        assert first.twist(action) == second.twist(action)
        driven.step(move)


@pytest.mark.parametrize("preset", sorted(set(s2g.ENVIRONMENT_IDS.values())))
def test_a_description_has_the_rows_of_its_scenario(preset: str) -> None:
    env = s2g.Lidar(s2g.FieldOfView(s2g.SocialNavEnv(preset)), angle=3.0, mount=(0.2, 0.0), noise=0.01, sees="legs")
    again = environment_of(json.loads(json.dumps(describe(env))))
    assert again.observation_space == env.observation_space
    assert describe(again) == describe(env)


def test_numbers_of_numpy_can_be_arguments_of_wrappers() -> None:
    env = s2g.Noise(s2g.SocialNavEnv("empty"), position=np.float32(0.5))  # type: ignore[arg-type]
    description = json.loads(json.dumps(describe(env)))
    assert description["wrappers"] == [
        {"name": "Noise", "arguments": {"position": 0.5, "velocity": 0.05, "angle": 0.05}}
    ]


def test_a_policy_drives_with_the_limits_of_its_training() -> None:
    fast = {"robot": {"limits": {"ahead": 2.0, "turn": 3.0}}}
    env = s2g.Flat(s2g.SocialNavEnv("empty", settings=fast))
    controller = s2g.PolicyController(lambda observation: [1.0, 0.0, 1.0], env)
    scene = s2.generate(s2.load_scenario("empty").changed(**fast), 1)
    frame = s2.Episode(scene, controller).step()
    assert frame is not None
    assert (frame.command.vx, frame.command.omega) == (2.0, 3.0)
    unicycle = s2.generate(s2.load_scenario("empty").changed(robot={"kinematics": "unicycle"}), 1)
    with pytest.raises(ControllerError, match="holonomic"):
        s2.Episode(unicycle, controller)


def test_states_of_recurrent_models_go_from_step_to_step() -> None:
    class Counter:
        def predict(
            self, observation: Any, state: Any = None, episode_start: Any = None, deterministic: bool = False
        ) -> tuple[Any, Any]:
            count = 0 if episode_start[0] else state
            counts.append(count)
            return np.zeros(3), count + 1

    counts: list[int] = []
    controller = s2g.PolicyController(Counter(), s2g.SocialNavEnv("empty"))
    scene = s2.generate(s2.load_scenario("empty").changed(rules={"time_limit": 0.3}), 1)
    for _ in range(2):
        s2.Episode(scene, controller).run()
    assert counts == [0, 1, 2, 0, 1, 2]


def test_foreign_wrappers_cannot_be_described_but_used() -> None:
    env = make()
    halved = gymnasium.wrappers.TransformObservation(env, lambda x: x / 2.0, env.observation_space)
    with pytest.raises(TypeError, match="TransformObservation"):
        describe(halved)
    seen: list[Any] = []
    controller = s2g.PolicyController(lambda observation: seen.append(observation) or [0.0, 0.0, 0.0], halved)
    s2.Episode(s2.generate(s2.load_scenario("lively").changed(**SHORT), 2), controller).run()
    np.testing.assert_array_equal(seen[0], make().reset(seed=2)[0] / 2.0)


def test_bad_files_and_policies_are_named(tmp_path: Path) -> None:
    env = make()
    with pytest.raises(ControllerError, match="no file"):
        s2g.PolicyController(tmp_path / "missing.npz")
    (tmp_path / "policy.txt").write_text("")
    with pytest.raises(ControllerError, match="not a policy"):
        s2g.PolicyController(tmp_path / "policy.txt")
    with pytest.raises(TypeError, match="env"):
        s2g.PolicyController(lambda observation: None)
    with pytest.raises(TypeError, match="predict"):
        s2g.PolicyController(3, env)
    with pytest.raises(TypeError, match="SocialNavEnv"):
        s2g.PolicyController(lambda observation: None, gymnasium.make("CartPole-v1"))
    (tmp_path / "damaged.npz").write_bytes(b"PK")
    with pytest.raises(ControllerError, match="does not hold a policy"):
        s2g.PolicyController(tmp_path / "damaged.npz")
    with pytest.raises(TypeError, match="got 'lively'"):
        s2g.PolicyController(lambda observation: None, "lively")  # type: ignore[arg-type]
    with pytest.raises(ControllerError, match=r"norm.pkl cannot be read"):
        s2g.PolicyController(Still(), env, normalisation=tmp_path / "norm.pkl", trust=True)
    (tmp_path / "norm.pkl").write_text("no pickle")
    with pytest.raises(ControllerError, match="not a file of VecNormalize"):
        s2g.PolicyController(Still(), env, normalisation=tmp_path / "norm.pkl", trust=True)
    for wrong in (True, {}, "empty.pkl"):
        (tmp_path / "empty.pkl").write_bytes(pickle.dumps([]))
        path = tmp_path / wrong if isinstance(wrong, str) else wrong
        with pytest.raises(TypeError, match="must be a VecNormalize"):
            s2g.PolicyController(Still(), env, normalisation=path, trust=True)
    with pytest.raises(TypeError, match="a normalisation belongs to a model"):
        s2g.PolicyController(lambda observation: None, env, normalisation=tmp_path / "norm.pkl")
    with pytest.raises(ControllerError, match=r"policy.zip, which lacks its observations, so it cannot be created"):
        s2g.PolicyController.from_settings({"weights": "policy.zip"})
    mlp = perceptron(env)
    with pytest.raises(ControllerError, match="reads"):
        mlp(np.zeros(3))
    write_mlp(tmp_path / "policy.npz", mlp)
    with pytest.raises(ControllerError, match=r"the policy reads \d+ numbers, .* leave out the environment"):
        s2g.PolicyController(tmp_path / "policy.npz", s2g.Flat(s2g.SocialNavEnv("crowded-hall")))
    with pytest.raises(ValueError, match=r"\.npz"):
        write_mlp(tmp_path / "policy.json", mlp)
    fields = {
        name: getattr(mlp, name)
        for name in ("weights", "biases", "activation", "output", "environment", "mean", "scale")
    }
    for change, message in (
        ({"activation": "gelu"}, "one of tanh, relu .* got 'gelu'"),
        ({"weights": mlp.weights[:1]}, "1 weights and 2 biases"),
        ({"scale": mlp.scale[1:]}, "mean and scale have the shapes"),
        ({"biases": [mlp.biases[0], mlp.biases[1][1:]]}, "layer 1 has 16 inputs"),
        ({"mean": np.full_like(mlp.mean, np.nan)}, "not finite"),
    ):
        with pytest.raises(ValueError, match=message):
            Mlp(**{**fields, **change})


HARM = b"cos\nmkdir\n(S'harm'\ntR."  # a pickle that makes a folder


def test_pickled_files_are_loaded_only_if_they_are_trusted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    env = make()
    for name in ("normal.pkl", "normal", "model.zip"):
        Path(name).write_bytes(HARM)
    for normalisation in ("normal.pkl", Path("normal")):
        with pytest.raises(ControllerError, match=r"normal.* runs the code in it; give mean and deviation, or an .npz"):
            s2g.PolicyController(Still(), env, normalisation=normalisation)
    with pytest.raises(
        ControllerError, match=r"model\.zip is a pickled file, .*save_policy as \.npz or \.onnx, or give"
    ):
        s2g.PolicyController("model.zip", env)
    Path("normal.npz").write_bytes(HARM)
    with pytest.raises(ControllerError, match=r"normal\.npz does not hold a normalisation: it is truncated or damaged"):
        s2g.PolicyController(Still(), env, normalisation="normal.npz", trust=True)
    assert not Path("harm").exists()
    with pytest.raises(TypeError, match="must be a VecNormalize"):  # `mkdir` returns None, and no VecNormalize
        s2g.PolicyController(Still(), env, normalisation="normal.pkl", trust=True)
    assert Path("harm").exists()  # so trust is needed


class Echo:
    """A model that acts by the first numbers of its observation."""

    def __init__(self, env: Env) -> None:
        self.observation_space = env.observation_space

    def predict(self, observation: Any) -> tuple[Any, None]:
        return observation[:3], None


def test_a_normalisation_is_mean_and_deviation(tmp_path: Path) -> None:
    env = make()
    observation, _ = env.reset(seed=0)
    mean, deviation = np.full(observation.shape, 2.0), np.full(observation.shape, 0.5)
    expected = (observation[:3] - 2.0) * 2.0
    np.savez(tmp_path / "normal.npz", mean=mean, deviation=deviation)
    np.savez(tmp_path / "clipped.npz", mean=mean, deviation=deviation, clip=0.25)
    for normalisation in ((mean, deviation), tmp_path / "normal.npz", str(tmp_path / "normal.npz")):
        controller = s2g.PolicyController(Echo(env), env, normalisation=normalisation)
        np.testing.assert_allclose(controller._predict(observation), expected, rtol=1e-6)
    clipped = s2g.PolicyController(Echo(env), env, normalisation=tmp_path / "clipped.npz")
    np.testing.assert_allclose(clipped._predict(observation), np.clip(expected, -0.25, 0.25), rtol=1e-6)

    np.savez(tmp_path / "bad.npz", mean=mean)
    with pytest.raises(ControllerError, match="it lacks the array 'deviation'"):
        s2g.PolicyController(Echo(env), env, normalisation=tmp_path / "bad.npz")
    np.savez(tmp_path / "bad.npz", mean=mean, deviation=0.0 * deviation)
    with pytest.raises(ControllerError, match="deviations are above 0"):
        s2g.PolicyController(Echo(env), env, normalisation=tmp_path / "bad.npz")
    with pytest.raises(ControllerError, match="the normalisation has 3 numbers"):
        s2g.PolicyController(Echo(env), env, normalisation=(mean[:3], deviation[:3]))
    for numbers in ((mean * np.nan, deviation), (mean, deviation * np.inf)):
        with pytest.raises(ValueError, match="are finite"):
            s2g.PolicyController(Echo(env), env, normalisation=numbers)


class Still:
    """A model that stands still."""

    def predict(self, observation: Any, deterministic: bool = False) -> tuple[Any, None]:
        return np.zeros(3), None


def test_a_model_of_another_environment_is_refused() -> None:
    class Model:
        observation_space = make().observation_space
        action_space = make().action_space

        def predict(self, observation: Any, deterministic: bool = False) -> tuple[Any, None]:
            return np.zeros(3), None

    s2g.PolicyController(Model(), make())
    with pytest.raises(ControllerError, match=r"observation_spaces of Box\(\d+,\), the environment has activities"):
        s2g.PolicyController(Model(), s2g.SocialNavEnv("lively"))
    with pytest.raises(ControllerError, match=r"action_spaces of Box\(3,\), the environment has Discrete\(8\)"):
        s2g.PolicyController(Model(), s2g.DiscreteActions(make()))


def test_a_policy_that_does_not_observe_everybody_says_so_once(caplog: pytest.LogCaptureFixture) -> None:
    crowd = s2.generate(s2.load_scenario("crowded-hall"), 0)
    few = s2g.SocialNavEnv("empty", settings={"wandering": 2})
    policy = s2g.PolicyController(lambda observation: np.zeros(3), few)
    policy.reset(s2.generate(few.config, 0))
    assert not caplog.messages
    for _ in range(2):
        policy.reset(crowd)
    (message,) = caplog.messages
    assert message.startswith(f"the policy observes the nearest 2 of the {len(crowd.humans)} humans")
    chosen = s2g.SocialNavEnv("crowded-hall", sizes={"humans": 2})  # as in its training
    s2g.PolicyController(lambda observation: np.zeros(3), chosen).reset(crowd)
    assert len(caplog.messages) == 1


def test_demonstrations_are_episodes_of_the_controller() -> None:
    env = s2g.Flat(s2g.SocialNavEnv("lively", settings=SHORT))
    runs = s2g.demonstrate(env, s2.SocialPlanner(), seed=5, episodes=2)
    for number, run in enumerate(runs):
        scene = s2.generate(s2.load_scenario("lively").changed(**SHORT), 5, number)
        episode = s2.Episode(scene, s2.SocialPlanner())
        episode.run()
        assert len(run.actions) == len(episode.past) == len(run.observations) - 1
        assert run.terminated != run.truncated
        base = env.unwrapped
        assert isinstance(base, s2g.SocialNavEnv)
        for action, tick in list(zip(run.actions, episode.past, strict=True))[:10]:
            np.testing.assert_allclose(action, base.action_of(tick.command), atol=2e-3)


def test_noise_changes_what_is_executed_and_not_what_is_recorded() -> None:
    class Ahead(s2.Controller):
        def act(self, snapshot: s2.Snapshot) -> s2.Twist:
            return s2.Twist(vx=0.5)

    env = s2g.SocialNavEnv("empty", settings=SHORT)
    plain, noisy = (s2g.demonstrate(env, Ahead(), seed=1, episodes=1, noise=noise)[0] for noise in (0.0, 0.5))
    assert {tuple(action) for action in noisy.actions} == {tuple(plain.actions[0])}
    assert not np.allclose(noisy.observations[30]["goal"], plain.observations[30]["goal"], atol=0.1)
    with pytest.raises(TypeError, match="'social-planner'"):
        s2g.demonstrate(env, "social-planner", seed=1, episodes=1)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="Discrete"):
        s2g.demonstrate(s2g.DiscreteActions(env), Ahead(), seed=1, episodes=1, noise=0.5)


def test_demonstrations_in_discrete_actions_choose_the_nearest_move() -> None:
    env = s2g.DiscreteActions(s2g.SocialNavEnv("empty"))
    run = s2g.demonstrate(env, s2.StraightToGoal(), seed=1, episodes=1)[0]
    assert run.info["is_success"]
    assert {"forward"} <= {list(s2g.wrappers.MOVES)[int(k)] for k in run.actions}
