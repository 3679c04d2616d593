"""A policy with attention over people, objects and walls, and the controller that drives with its weights.

`ppo.py --network attention` trains it and writes the weights, `attention.npz`, and a copy of this file beside them:

    sonata2d evaluate --controller runs/attention/attention.py:AttentionPolicy

Robot and goal give a query; each person, object and wall gives a key and a value. The softmax of the scaled products of
query and keys weighs the values (Vaswani et al., NeurIPS 2017, eq. 1), as in the attention over people of Chen et al.,
ICRA 2019 (Crowd-Robot Interaction).
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

import sonata2d.gym as s2g

OWN, TABLES = ("goal", "robot"), ("humans", "objects", "walls")
WIDTH = 64


def columns(space: Any) -> dict[str, tuple[int, tuple[int, ...]]]:
    """Offset and shape of each part in a flat observation of the parts of an environment."""
    found, offset = {}, 0
    for name, part in space.spaces.items():
        if part.dtype == np.float32:
            found[name] = offset, part.shape
            offset += int(np.prod(part.shape))
    return found


class AttentionPolicy(s2g.PolicyController):
    """Drives with the weights beside this file; needs NumPy alone."""

    deterministic = True

    def __init__(self) -> None:
        with np.load(Path(__file__).with_name("attention.npz")) as file:
            self._w = {name: file[name].astype(np.float64) for name in file.files if name != "scenario"}
            env = s2g.Flat(s2g.SocialNavEnv(settings=None, scenario=_scenario(str(file["scenario"]))))
        self._columns = columns(env.unwrapped.observation_space)
        super().__init__(self._action, env)

    def _action(self, observation: Any) -> Any:
        inputs = np.clip((observation - self._w["mean"]) / self._w["deviation"], -10.0, 10.0)
        query = self._layer("own", np.concatenate([self._part(inputs, name) for name in OWN]))
        keys, values = [], []
        for name in TABLES:
            is_there = self._part(observation, f"{name}_mask") > 0.5
            rows = self._part(inputs, name)[is_there]
            keys.append(self._layer(f"{name}_key", rows))
            values.append(self._layer(f"{name}_value", rows))
        key, value = np.concatenate(keys), np.concatenate(values)
        context = np.zeros(WIDTH)
        if len(key):
            score = key @ query / np.sqrt(WIDTH)
            weight = np.exp(score - score.max())
            context = weight @ value / weight.sum()
        hidden = self._layer("hidden", np.concatenate((query, context)))
        action = hidden @ self._w["action.weight"].T + self._w["action.bias"]
        return np.clip(action, -1.0, 1.0)

    def _part(self, flat: Any, name: str) -> Any:
        offset, shape = self._columns[name]
        return flat[offset : offset + int(np.prod(shape))].reshape(shape)

    def _layer(self, name: str, inputs: Any) -> Any:
        return np.tanh(inputs @ self._w[f"{name}.weight"].T + self._w[f"{name}.bias"])


def _scenario(settings: str) -> Any:
    import json

    import sonata2d as s2

    return s2.ScenarioConfig(**json.loads(settings))
