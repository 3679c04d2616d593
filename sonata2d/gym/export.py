"""Files of policies that run without the library in which they were trained."""

from __future__ import annotations

import copy
import json
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

from ..core.files.whole_file import whole_file
from ..core.portable_math import Array
from ..core.wording import shown
from ..learning.fixed_point import LARGEST_VALUE, LARGEST_WEIGHT
from .description import describe, environment_of
from .env import Env, base_of
from .mlp import Mlp, write_mlp
from .policy import METADATA_KEY, Model, Normalisation, TorchPolicy, is_torch_module, normalisation_of

_Layers = tuple[list[Any], dict[str, Any]]
_EPISODES, _STEPS, _TOLERANCE = 4, 50, 0.02  # of the comparison of a file with its model


def save_policy(
    path: str | Path, model: Any, env: Env, *, normalisation: Any = None, note: str = "", trust: bool = False
) -> None:
    """Write a policy as a file that is a controller by itself.

    `sonata2d evaluate --controller ./policy.npz` and `PolicyController("policy.npz")` drive with it.

    Args:
        path: ends in .npz (multilayer perceptrons; needs no deep-learning library, the same bits on every processor)
            or in .onnx (any policy; needs ONNX Runtime, and `onnxscript` to write).
        model: of Stable-Baselines3, e.g. PPO or SAC, or a PyTorch module that reads observations in one array: for
            .npz a `torch.nn.Sequential` of linear layers with tanh or ReLU between them, whose last layer may be
            followed by tanh.
        env: in which it was trained, with its wrappers.
        normalisation: of the observations, as of `PolicyController`.
        note: how the policy was trained, for human readers.
        trust: whether to load a pickled normalisation (.pkl), which runs the code in the file: only if its origin is
            trusted.

    Raises:
        ControllerError: the file of the normalisation cannot be read, or is pickled and not trusted.
        ValueError: the path has another suffix, the environment has other spaces than the model, such a file cannot
            hold the policy, or a .npz file would act otherwise than the model in some episodes of the environment.
        TypeError: it is neither a model of Stable-Baselines3 nor a PyTorch module, or a wrapper of observations or
            actions is not one of `sonata2d.gym`.
    """
    is_module, is_discrete = is_torch_module(model), isinstance(env.action_space, gymnasium.spaces.Discrete)
    if not is_module and not (hasattr(model, "policy") and hasattr(model, "get_vec_normalize_env")):
        raise TypeError(
            "save_policy needs a model of Stable-Baselines3, such as PPO or SAC, or a PyTorch module, got "
            f"{shown(model)}"
        )
    path, environment = Path(path), describe(env)
    if is_module:
        # A module need not be a perceptron, but then torch exports it better than this function could.
        if path.suffix != ".npz":
            raise ValueError(f"a PyTorch module is written as .npz, got {path}; for .onnx use torch.onnx.export")
    else:
        # A model knows its spaces, so that a wrong environment is found before anything is written.
        for name in ("observation_space", "action_space"):
            if getattr(model, name) != getattr(env, name):
                raise ValueError(
                    f"the model has another {name} than the environment; give the one in which it was trained"
                )
        if path.suffix not in (".npz", ".onnx"):
            raise ValueError(f"the name of a policy ends in .npz or .onnx, got {path}")
        normalisation = normalisation_of(model, normalisation, trust=trust)
    if not all(parameter.isfinite().all() for parameter in (model if is_module else model.policy).parameters()):
        raise ValueError("a weight of the policy is not finite: the training has diverged")
    if path.suffix == ".onnx":
        _write_onnx(path, model, environment, normalisation)
        return
    if not isinstance(env.observation_space, gymnasium.spaces.Box):
        raise ValueError(
            "a .npz file holds policies of observations in one array; wrap the environment in Flat, or write .onnx"
        )
    policy: TorchPolicy | Model
    if is_module:
        # A copy: the policy drives in evaluation mode, and the training of the module may go on.
        policy = TorchPolicy(copy.deepcopy(model), normalisation, is_discrete=is_discrete)
        layers = _layers_of_module(model, policy, int(np.prod(env.observation_space.shape)), is_discrete=is_discrete)
    else:
        policy, layers = Model(model, normalisation), _layers_of_model(model, normalisation, is_discrete=is_discrete)
    modules, settings = layers
    mlp = _perceptron(modules, environment=environment, note=note, **settings)
    _require_same_actions(mlp, policy, environment_of(environment, base_of(env).config))
    write_mlp(path, mlp)


def _layers_of_module(module: Any, policy: TorchPolicy, width: int, *, is_discrete: bool) -> _Layers:
    """The layers of a PyTorch module for observations of a width, and other arguments of `Mlp`."""
    from torch import nn

    modules, output = _sequence(module), "argmax" if is_discrete else "clip"
    if modules and isinstance(modules[-1], nn.Tanh) and not is_discrete:
        output = "tanh"
        modules.pop()
    mean, scale, limit = _normalisation(policy.normalisation, (width,))
    return modules, {"output": output, "mean": mean, "scale": scale, "limit": min(limit, LARGEST_VALUE)}


def _sequence(module: Any) -> list[Any]:
    """The modules of a `torch.nn.Sequential` in the order in which they run; nested ones are flattened."""
    from torch import nn

    return [layer for part in module for layer in _sequence(part)] if isinstance(module, nn.Sequential) else [module]


def _require_same_actions(mlp: Mlp, model: Model | TorchPolicy, env: Env) -> None:
    """Require that a perceptron acts as the model does, in episodes that the model drives.

    Raises:
        ValueError: the actions differ, because the numbers of a perceptron are rounded and clipped.
    """
    is_discrete, differences = mlp.output == "argmax", []
    for seed in range(_EPISODES):
        model.begin()
        observation, _ = env.reset(seed=seed)
        for _ in range(_STEPS):
            action, rounded = model(observation), mlp(observation)
            differences.append(float(rounded != action) if is_discrete else float(np.abs(rounded - action).max()))
            observation, _, terminated, truncated, _ = env.step(action)
            if terminated or truncated:
                break
    env.close()
    difference = float(np.mean(differences) if is_discrete else np.max(differences))
    if difference > _TOLERANCE:
        extent = f"in {100.0 * difference:.0f} % of the steps" if is_discrete else f"by up to {difference:.2g}"
        raise ValueError(
            f"a .npz file would act otherwise than the model, {extent}: it clips numbers beyond ±{LARGEST_VALUE:g} "
            "within the network; write .onnx"
        )


def _layers_of_model(model: Any, normalisation: Any, *, is_discrete: bool) -> _Layers:
    """The layers of a model of Stable-Baselines3, and other arguments of `Mlp`.

    Raises:
        ValueError: it is not a perceptron.
    """
    from stable_baselines3.common.torch_layers import FlattenExtractor
    from torch import nn

    policy = model.policy
    if hasattr(policy, "mlp_extractor"):  # PPO, A2C
        layers = [*policy.mlp_extractor.policy_net, policy.action_net]
        extractor = policy.pi_features_extractor
        output = "argmax" if is_discrete else "tanh" if policy.squash_output else "clip"
    elif hasattr(policy, "actor") and hasattr(policy.actor, "latent_pi"):  # SAC
        layers, extractor, output = [*policy.actor.latent_pi, policy.actor.mu], policy.actor.features_extractor, "tanh"
    elif hasattr(policy, "actor") and hasattr(policy.actor, "mu"):  # TD3, DDPG: the last one is tanh
        layers, extractor, output = list(policy.actor.mu)[:-1], policy.actor.features_extractor, "tanh"
    elif hasattr(policy, "q_net"):  # DQN
        layers, extractor, output = list(policy.q_net.q_net), policy.q_net.features_extractor, "argmax"
    else:
        raise ValueError(f"{type(policy).__name__} is not a perceptron; write it as .onnx")
    if type(extractor) is not FlattenExtractor:
        raise ValueError(f"a .npz file holds no {type(extractor).__name__}; write .onnx")
    modules = [module for layer in layers for module in _sequence(layer)]
    mean, scale, limit = _normalisation(normalisation, model.observation_space.shape)
    settings = {"output": output, "mean": mean.ravel(), "scale": scale.ravel(), "limit": min(limit, LARGEST_VALUE)}
    if isinstance(modules[-1], nn.Hardtanh):  # of SAC with noise that depends on the state
        settings["output_limit"] = float(modules.pop().max_val)
    return modules, settings


def _perceptron(modules: list[Any], **settings: Any) -> Mlp:
    """The perceptron of linear layers and activations.

    Raises:
        ValueError: there is another module, or a weight is too large.
    """
    from torch import nn

    linear, kinds = modules[::2], {type(module) for module in modules[1::2]}
    is_alternating = len(modules) % 2 == 1 and all(isinstance(module, nn.Linear) for module in linear)
    if not is_alternating or len(kinds) > 1 or not kinds <= {nn.Tanh, nn.ReLU}:
        names = ", ".join(type(module).__name__ for module in modules) or "nothing"
        raise ValueError(
            f"a .npz file holds linear layers with tanh, or with ReLU, between them, got {names}; write .onnx, or "
            "drive with PolicyController(model, env)"
        )
    largest = max(float(layer.weight.detach().abs().max()) for layer in linear)
    if largest > LARGEST_WEIGHT:
        raise ValueError(f"a .npz file holds weights within ±{LARGEST_WEIGHT:g}, got {largest:g}; write .onnx")
    return Mlp(
        weights=[layer.weight.detach().cpu().numpy().T.astype(float) for layer in linear],
        biases=[layer.bias.detach().cpu().numpy().astype(float) for layer in linear],
        activation="relu" if kinds == {nn.ReLU} else "tanh",
        **settings,
    )


def _normalisation(normalisation: Any, shape: tuple[int, ...]) -> tuple[Array, Array, float]:
    """Mean, scale and limit of the inputs."""
    if normalisation is None:
        return np.zeros(shape), np.ones(shape), LARGEST_VALUE
    if isinstance(normalisation, Normalisation):
        scale = 1.0 / normalisation.deviation
        return normalisation.mean.reshape(shape), scale.reshape(shape), normalisation.clip
    mean, variance = normalisation.obs_rms.mean, normalisation.obs_rms.var
    return np.asarray(mean, dtype=float), 1.0 / np.sqrt(variance + normalisation.epsilon), float(normalisation.clip_obs)


def _write_onnx(path: Path, model: Any, environment: dict[str, Any], normalisation: Any) -> None:
    try:
        import onnx
        import onnxscript  # noqa: F401  torch writes with it
    except ModuleNotFoundError as error:
        raise ValueError(f"writing {path.name} needs {error.name}; pip install onnx onnxscript") from error
    import torch

    policy, space = model.policy, model.observation_space
    is_dictionary = isinstance(space, gymnasium.spaces.Dict)
    if is_dictionary and normalisation is not None:
        raise ValueError("an .onnx file with normalised observations needs flat ones; wrap the environment in Flat")
    parts = dict(space.spaces) if is_dictionary else {"observation": space}

    class Actor(torch.nn.Module):  # type: ignore[misc]
        def __init__(self) -> None:
            super().__init__()
            self.policy = policy
            if normalisation is not None:
                mean, scale, self.limit = _normalisation(normalisation, space.shape)
                self.register_buffer("mean", torch.tensor(mean, dtype=torch.float32))
                self.register_buffer("scale", torch.tensor(scale, dtype=torch.float32))

        def forward(self, *values: Any) -> Any:
            observation: Any = dict(zip(parts, values, strict=True)) if is_dictionary else values[0]
            if normalisation is not None:
                observation = torch.clip((observation - self.mean) * self.scale, -self.limit, self.limit)
            action = self.policy._predict(observation, deterministic=True)
            return action if action.dtype == torch.int64 else torch.clip(action, -1.0, 1.0)

    device, was_training = model.device, policy.training
    actor = Actor().to("cpu").eval()
    example = tuple(torch.as_tensor(np.zeros((1, *(part.shape or ())), dtype=part.dtype)) for part in parts.values())
    is_checking = torch.distributions.Distribution._validate_args
    torch.distributions.Distribution.set_default_validate_args(False)  # ONNX has no operators for the checks
    try:
        with whole_file(path) as temporary:
            program = torch.onnx.export(actor, example, input_names=list(parts), output_names=["action"], dynamo=True)
            written = program.model_proto
            onnx.helper.set_model_props(written, {METADATA_KEY: json.dumps(environment)})
            Path(temporary).write_bytes(written.SerializeToString())
    finally:
        torch.distributions.Distribution.set_default_validate_args(is_checking)
        policy.to(device)
        policy.set_training_mode(was_training)
