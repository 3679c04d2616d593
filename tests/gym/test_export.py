"""`save_policy`: files of models of Stable-Baselines3 do what the models do."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import sonata2d as s2
import sonata2d.gym as s2g
from tests.gym.samples import SHORT, Env

sb3 = pytest.importorskip("stable_baselines3", reason="not installed; pip install 'sonata2d[rl]'")
torch = pytest.importorskip("torch")

MODELS: dict[str, tuple[str, dict[str, Any]]] = {
    "PPO": ("PPO", {"n_steps": 64, "batch_size": 64}),
    "PPO with state-dependent noise": ("PPO", {"n_steps": 64, "batch_size": 64, "use_sde": True}),
    "PPO that squashes": (
        "PPO", {"n_steps": 64, "batch_size": 64, "use_sde": True, "policy_kwargs": {"squash_output": True}},
    ),
    "A2C": ("A2C", {}),
    "SAC": ("SAC", {"learning_starts": 10}),
    "SAC with state-dependent noise": ("SAC", {"learning_starts": 10, "use_sde": True}),
    "TD3": ("TD3", {"learning_starts": 10}),
    "DQN": ("DQN", {"learning_starts": 10}),
}  # fmt: skip


def make(discrete: bool = False) -> Env:
    env: Env = s2g.Flat(s2g.SocialNavEnv("lively", settings=SHORT))
    return s2g.DiscreteActions(env) if discrete else env


def model_of(name: str, normalised: bool) -> tuple[Any, Env]:
    """A model with strong random weights, whose actions differ much from place to place."""
    from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize

    algorithm, arguments = MODELS[name]
    env = make(discrete=name == "DQN")
    worlds: Any = DummyVecEnv([lambda: make(discrete=name == "DQN")])
    if normalised:
        worlds = VecNormalize(worlds)
    model = getattr(sb3, algorithm)("MlpPolicy", worlds, seed=0, device="cpu", **arguments)
    model.learn(128)
    with torch.no_grad():
        for parameter in model.policy.parameters():
            parameter.mul_(1.5)
    return model, env


def observations(env: Env) -> list[Any]:
    """Some observations of an environment."""
    found = []
    for seed in range(4):
        found.append(env.reset(seed=seed)[0])
        env.action_space.seed(seed)
        found += [env.step(env.action_space.sample())[0] for _ in range(8)]
    return found


@pytest.mark.parametrize("normalised", [False, True])
@pytest.mark.parametrize("suffix", [".npz", ".onnx"])
@pytest.mark.parametrize("name", MODELS)
def test_a_file_does_what_the_model_does(name: str, suffix: str, normalised: bool, tmp_path: Path) -> None:
    if suffix == ".onnx":
        if not normalised:
            pytest.skip("the export takes long; the one with normalisation contains the other")
        for package in ("onnx", "onnxruntime", "onnxscript"):
            pytest.importorskip(package)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of other packages
        model, env = model_of(name, normalised)
        path = tmp_path / f"policy{suffix}"
        s2g.save_policy(path, model, env)
        predict = s2g.PolicyController(path)._predict
        live = s2g.PolicyController(model, env)._predict
        for observation in observations(env):
            expected = live(observation)
            if name == "DQN":
                assert predict(observation) == expected
            else:
                np.testing.assert_allclose(predict(observation), expected, atol=0.02)


def test_the_file_drives(tmp_path: Path) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        model, env = model_of("SAC with state-dependent noise", normalised=True)
        s2g.save_policy(tmp_path / "policy.npz", model, env)
    scene = s2.generate(s2.load_scenario("lively").changed(**SHORT), 1)
    assert s2.Episode(scene, s2g.PolicyController(tmp_path / "policy.npz")).run().status == "timeout"


def test_what_a_file_cannot_hold_is_refused(tmp_path: Path) -> None:
    env = make()
    ppo = sb3.PPO("MlpPolicy", make(), n_steps=64, batch_size=64, device="cpu")
    with pytest.raises(ValueError, match="another observation_space"):
        s2g.save_policy(tmp_path / "policy.npz", ppo, s2g.Flat(s2g.SocialNavEnv("empty")))
    with pytest.raises(ValueError, match=r"\.npz or \.onnx"):
        s2g.save_policy(tmp_path / "policy.pt", ppo, env)
    rounded = {"activation_fn": torch.nn.GELU}
    gelu = sb3.PPO("MlpPolicy", make(), n_steps=64, batch_size=64, device="cpu", policy_kwargs=rounded)
    with pytest.raises(ValueError, match="GELU"):
        s2g.save_policy(tmp_path / "policy.npz", gelu, env)
    parts = s2g.SocialNavEnv("lively", settings=SHORT)
    several = sb3.PPO("MultiInputPolicy", parts, n_steps=64, batch_size=64, device="cpu")
    with pytest.raises(ValueError, match="flat observations"):
        s2g.save_policy(tmp_path / "policy.npz", several, parts)
