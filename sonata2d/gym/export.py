"""Files of policies that run without the library in which they were trained."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

from ..core.portable_math import Array
from ..core.whole_file import whole_file
from ..learning.fixed_point import LARGEST_VALUE
from .description import describe
from .mlp import Mlp, write_mlp
from .policy import METADATA_KEY

Env = gymnasium.Env[Any, Any]


def save_policy(path: str | Path, model: Any, env: Env, *, normalisation: Any = None, note: str = "") -> None:
    """Write the policy of a model of Stable-Baselines3 as a file that is a controller by itself.

    `sonata2d evaluate --controller ./policy.npz` and `PolicyController("policy.npz")` drive with it.

    Args:
        path: ends in .npz (multilayer perceptrons only; needs NumPy only, the same bits on every processor) or in .onnx
            (any policy; needs ONNX Runtime, and `onnxscript` to write).
        model: of Stable-Baselines3, e.g. PPO or SAC.
        env: in which it was trained, with its wrappers.
        normalisation: the `VecNormalize` around the environments of the training, if there was one.
        note: how the policy was trained, for human readers.

    Raises:
        ValueError: the path has another suffix, or the policy cannot be written as such a file.
        TypeError: a wrapper of observations or actions is not one of `sonata2d.gym`.
    """
    path, environment = Path(path), describe(env)
    if path.suffix == ".npz":
        write_mlp(path, _mlp_of(model, environment, normalisation, note))
    elif path.suffix == ".onnx":
        _write_onnx(path, model, environment, normalisation)
    else:
        raise ValueError(f"the name of a policy ends in .npz or .onnx, got {path}")


def _mlp_of(model: Any, environment: dict[str, Any], normalisation: Any, note: str) -> Mlp:
    """The perceptron of a model."""
    from torch import nn

    policy = model.policy
    if hasattr(policy, "mlp_extractor"):  # PPO, A2C
        layers, last = list(policy.mlp_extractor.policy_net), policy.action_net
        output = "argmax" if isinstance(model.action_space, gymnasium.spaces.Discrete) else "clip"
    elif hasattr(policy, "actor") and hasattr(policy.actor, "latent_pi"):  # SAC
        layers, last, output = list(policy.actor.latent_pi), policy.actor.mu, "tanh"
    elif hasattr(policy, "actor") and hasattr(policy.actor, "mu"):  # TD3: the last two are a layer and tanh
        layers, last, output = list(policy.actor.mu)[:-2], list(policy.actor.mu)[-2], "tanh"
    elif hasattr(policy, "q_net"):  # DQN
        network = list(policy.q_net.q_net)
        layers, last, output = network[:-1], network[-1], "argmax"
    else:
        raise ValueError(f"{type(policy).__name__} is not a perceptron; write it as .onnx")
    space = model.observation_space
    if not (isinstance(space, gymnasium.spaces.Box) and len(space.shape) == 1):
        raise ValueError(
            "a .npz file holds policies of flat observations only; wrap the environment in Flat, or write .onnx"
        )
    activations = {type(layer) for layer in layers if not isinstance(layer, nn.Linear)}
    if activations == {nn.Tanh} or not activations:
        activation = "tanh"
    elif activations == {nn.ReLU}:
        activation = "relu"
    else:
        names = ", ".join(sorted(one.__name__ for one in activations))
        raise ValueError(f"hidden layers of a .npz file have tanh or ReLU, got {names}; write .onnx")
    linear = [layer for layer in (*layers, last) if isinstance(layer, nn.Linear)]
    mean, scale, limit = _normalisation(normalisation, space.shape[0])
    return Mlp(
        weights=[layer.weight.detach().cpu().numpy().T.astype(float) for layer in linear],
        biases=[layer.bias.detach().cpu().numpy().astype(float) for layer in linear],
        activation=activation,
        output=output,
        environment=environment,
        mean=mean,
        scale=scale,
        limit=limit,
        note=note,
    )


def _normalisation(normalisation: Any, width: int) -> tuple[Array, Array, float]:
    """Mean, scale and limit of the inputs."""
    if normalisation is None or not normalisation.norm_obs:
        return np.zeros(width), np.ones(width), LARGEST_VALUE
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
    if isinstance(space, gymnasium.spaces.Dict) and normalisation is not None:
        raise ValueError("an .onnx file with normalised observations needs flat ones; wrap the environment in Flat")
    names = list(space.spaces) if isinstance(space, gymnasium.spaces.Dict) else ["observation"]
    parts = [space[name] for name in names] if isinstance(space, gymnasium.spaces.Dict) else [space]

    class Actor(torch.nn.Module):  # type: ignore[misc]
        def __init__(self) -> None:
            super().__init__()
            self.policy = policy
            if normalisation is not None:
                mean, scale, self.limit = _normalisation(normalisation, space.shape[0])
                self.register_buffer("mean", torch.tensor(mean, dtype=torch.float32))
                self.register_buffer("scale", torch.tensor(scale, dtype=torch.float32))

        def forward(self, *values: Any) -> Any:
            observation: Any = dict(zip(names, values, strict=True)) if len(names) > 1 else values[0]
            if normalisation is not None:
                observation = torch.clip((observation - self.mean) * self.scale, -self.limit, self.limit)
            action = self.policy._predict(observation, deterministic=True)
            return action if action.dtype == torch.int64 else torch.clip(action, -1.0, 1.0)

    actor = Actor().to("cpu").eval()
    example = tuple(torch.as_tensor(np.zeros((1, *(part.shape or ())), dtype=part.dtype)) for part in parts)
    with whole_file(path) as temporary:
        program = torch.onnx.export(actor, example, input_names=names, output_names=["action"], dynamo=True)
        written = program.model_proto
        onnx.helper.set_model_props(written, {METADATA_KEY: json.dumps(environment)})
        Path(temporary).write_bytes(written.SerializeToString())
