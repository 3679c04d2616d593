"""`save_policy`: files of models of Stable-Baselines3 do what the models do."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import sonata2d as s2
import sonata2d.gym as s2g
from sonata2d.errors import ControllerError
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


@pytest.mark.parametrize("normalised", [False, True])
def test_an_onnx_file_of_a_policy_of_the_dictionary(normalised: bool, tmp_path: Path) -> None:
    for package in ("onnx", "onnxruntime", "onnxscript"):
        pytest.importorskip(package)
    from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize

    worlds: Any = DummyVecEnv([lambda: s2g.SocialNavEnv("lively", settings=SHORT)])
    if normalised:  # only its rewards
        worlds = VecNormalize(worlds, norm_obs=False)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        model = sb3.PPO("MultiInputPolicy", worlds, n_steps=64, batch_size=64, seed=0, device="cpu")
        env = s2g.SocialNavEnv("lively", settings=SHORT)
        s2g.save_policy(tmp_path / "policy.onnx", model, env)
    predict, live = s2g.PolicyController(tmp_path / "policy.onnx")._predict, s2g.PolicyController(model, env)._predict
    for observation in observations(env):
        np.testing.assert_allclose(predict(observation), live(observation), atol=1e-4)


def test_a_model_from_its_file_needs_its_normalisation(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        model, env = model_of("PPO", normalised=True)
        normalisation = tmp_path / "normalisation.pkl"
        model.get_vec_normalize_env().save(str(normalisation))
        model.save(tmp_path / "model.zip")
        s2g.save_policy(tmp_path / "live.npz", model, env)
        loaded = sb3.PPO.load(tmp_path / "model.zip", device="cpu")
        s2g.save_policy(tmp_path / "loaded.npz", loaded, env, normalisation=normalisation, trust=True)
    assert (tmp_path / "live.npz").read_bytes() == (tmp_path / "loaded.npz").read_bytes()
    live = s2g.PolicyController(model, env)
    again = s2g.PolicyController(tmp_path / "model.zip", env, normalisation=normalisation, trust=True)
    for observation in observations(env):
        np.testing.assert_allclose(again._predict(observation), live._predict(observation), atol=1e-6)
    s2g.PolicyController(tmp_path / "model.zip", env, normalisation=False, trust=True)
    assert not caplog.messages
    s2g.PolicyController(tmp_path / "model.zip", env, trust=True)
    (message,) = caplog.messages
    assert "does not say whether its observations were normalised" in message
    (tmp_path / "damaged.zip").write_bytes(b"PK")
    with pytest.raises(ControllerError, match=r"damaged.zip is not a model of Stable-Baselines3"):
        s2g.PolicyController(tmp_path / "damaged.zip", env, trust=True)


def test_a_normalisation_in_numbers_equals_the_one_of_the_training(tmp_path: Path) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        model, env = model_of("PPO", normalised=True)
        normal = model.get_vec_normalize_env()
        statistics, path = normal.obs_rms, tmp_path / "normalisation.npz"
        deviation = np.sqrt(statistics.var + normal.epsilon)
        np.savez(path, mean=statistics.mean, deviation=deviation, clip=normal.clip_obs)
        live = s2g.PolicyController(model, env)
        numbers = s2g.PolicyController(model, env, normalisation=path)
        for observation in observations(env):
            np.testing.assert_allclose(numbers._predict(observation), live._predict(observation), atol=1e-6)
        s2g.save_policy(tmp_path / "numbers.npz", model, env, normalisation=path)
        s2g.save_policy(tmp_path / "live.npz", model, env)
    assert (tmp_path / "numbers.npz").read_bytes() == (tmp_path / "live.npz").read_bytes()


def test_a_file_that_would_act_otherwise_is_refused(tmp_path: Path) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        relu = {"activation_fn": torch.nn.ReLU}
        model = sb3.PPO("MlpPolicy", make(), n_steps=64, batch_size=64, seed=0, device="cpu", policy_kwargs=relu)
        layers = [*model.policy.mlp_extractor.policy_net, model.policy.action_net]
        for layer, factor in ((layers[0], 20.0), (layers[-1], 0.5)):
            with torch.no_grad():
                layer.weight.mul_(factor)
        with pytest.raises(ValueError, match=r"otherwise than the model, by up to .* numbers beyond ±64"):
            s2g.save_policy(tmp_path / "policy.npz", model, make())
    assert not list(tmp_path.iterdir())


def test_what_a_file_cannot_hold_is_refused(tmp_path: Path) -> None:
    env = make()
    ppo = sb3.PPO("MlpPolicy", make(), n_steps=64, batch_size=64, device="cpu")
    with pytest.raises(ValueError, match="another observation_space"):
        s2g.save_policy(tmp_path / "policy.npz", ppo, s2g.Flat(s2g.SocialNavEnv("empty")))
    with pytest.raises(TypeError, match=r"needs a model .* got ActorCritic"):
        s2g.save_policy(tmp_path / "policy.npz", ppo.policy, env)
    with pytest.raises(ValueError, match=r"\.npz or \.onnx"):
        s2g.save_policy(tmp_path / "policy.pt", ppo, env)
    with torch.no_grad():
        ppo.policy.action_net.bias[0] = torch.nan
    with pytest.raises(ValueError, match="not finite"):
        s2g.save_policy(tmp_path / "policy.npz", ppo, env)
    rounded = {"activation_fn": torch.nn.GELU}
    gelu = sb3.PPO("MlpPolicy", make(), n_steps=64, batch_size=64, device="cpu", policy_kwargs=rounded)
    with pytest.raises(ValueError, match="GELU"):
        s2g.save_policy(tmp_path / "policy.npz", gelu, env)
    parts = s2g.SocialNavEnv("lively", settings=SHORT)
    several = sb3.PPO("MultiInputPolicy", parts, n_steps=64, batch_size=64, device="cpu")
    with pytest.raises(ValueError, match="observations in one array"):
        s2g.save_policy(tmp_path / "policy.npz", several, parts)


def module_of(env: Env, *, last: Any = None, seed: int = 0) -> Any:
    """A module with random weights."""
    torch.manual_seed(seed)
    width, space = int(np.prod(env.observation_space.shape or ())), env.action_space
    outputs = int(space.n) if hasattr(space, "n") else int(np.prod(space.shape or ()))
    nn = torch.nn
    tanh = last or nn.Tanh()  # the same object in several places
    hidden = nn.Sequential(nn.Linear(width, 32), tanh, nn.Linear(32, 32), tanh)
    return nn.Sequential(hidden, nn.Linear(32, outputs), *([tanh] if last else []))


@pytest.mark.parametrize("kind", ["clip", "tanh", "argmax"])
@pytest.mark.parametrize("normalised", [False, True])
def test_a_file_does_what_a_torch_module_does(kind: str, normalised: bool, tmp_path: Path) -> None:
    env = make(discrete=kind == "argmax")
    module = module_of(env, last=torch.nn.Tanh() if kind == "tanh" else None)
    seen = np.stack(observations(env))
    normalisation = (seen.mean(axis=0), seen.std(axis=0) + 0.1) if normalised else None
    path = tmp_path / "policy.npz"
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        s2g.save_policy(path, module, env, normalisation=normalisation, note="not trained")
    assert module.training  # its training may go on
    live = s2g.PolicyController(module, env, normalisation=normalisation)._predict
    stored = s2g.PolicyController(path)._predict
    for observation in seen:
        np.testing.assert_allclose(stored(observation), live(observation), atol=0.02)
    scene = s2.generate("lively", seed=3)
    outcomes = [
        s2.Episode(scene, controller).run()
        for controller in (
            s2g.PolicyController(path),
            s2g.PolicyController(module, env, normalisation=normalisation),
        )
    ]
    assert outcomes[0].status == outcomes[1].status


def test_a_module_that_is_no_perceptron_is_refused(tmp_path: Path) -> None:
    env, nn = make(), torch.nn
    width = int(np.prod(env.observation_space.shape or ()))
    cases = [
        (
            nn.Sequential(nn.Linear(width, 8), nn.ELU(), nn.Linear(8, 3)),
            "with tanh, or with ReLU, between them, got Linear, ELU, Linear",
        ),
        (nn.Sequential(), "between them, got nothing"),
        (nn.Sequential(nn.Linear(width, 8), nn.Linear(8, 3)), "got Linear, Linear"),
        (nn.Linear(4, 3), "layer 0 has"),
        (nn.Sequential(nn.Linear(4, 8), nn.Tanh(), nn.Linear(8, 3)), "layer 0 has"),
    ]
    for module, message in cases:
        with pytest.raises(ValueError, match=message):
            s2g.save_policy(tmp_path / "a.npz", module, env)
    with pytest.raises(ValueError, match=r"is written as \.npz, got"):
        s2g.save_policy(tmp_path / "a.onnx", module_of(env), env)
    with pytest.raises(ValueError, match="wrap the environment in Flat"):
        s2g.save_policy(tmp_path / "a.npz", module_of(env), s2g.SocialNavEnv("lively", settings=SHORT))
    with pytest.raises(TypeError, match=r"is \(mean, deviation\), got 3"):
        s2g.save_policy(tmp_path / "a.npz", module_of(env), env, normalisation=3)
    with pytest.raises(TypeError, match="or a PyTorch module, got 3"):
        s2g.save_policy(tmp_path / "a.npz", 3, env)
    plain = s2g.PolicyController(module_of(env), s2g.SocialNavEnv("lively", settings=SHORT))
    with pytest.raises(ControllerError, match="wrap the environment in Flat"):
        s2.Episode(s2.generate("lively", seed=1), plain).run()


def test_a_module_drives_without_dropout_and_with_its_own_type() -> None:
    env, nn = make(), torch.nn
    width = int(np.prod(env.observation_space.shape or ()))
    module = nn.Sequential(nn.Linear(width, 8), nn.Dropout(0.5), nn.Linear(8, 3)).double().train()
    predict = s2g.PolicyController(module, env)._predict
    observation = observations(env)[0]
    np.testing.assert_array_equal(predict(observation), predict(observation))
    with pytest.raises(ValueError, match="deviations are above 0"):
        s2g.PolicyController(module, env, normalisation=(np.zeros(width), np.zeros(width)))
    other = s2g.PolicyController(module, env, normalisation=(np.zeros(3), np.ones(3)))
    with pytest.raises(ControllerError, match="the normalisation has 3 numbers"):
        s2.Episode(s2.generate("lively", seed=1), other).run()
