"""A policy with attention over people, objects and walls: a baseline of the benchmark.

`examples/train/ppo.py --network attention` trains it, and writes its weights, `attention.npz`, and a copy of this file:

    sonata2d evaluate --controller runs/attention/attention.py:AttentionPolicy

Robot and goal give a query; each person, object and wall gives a key and a value. The softmax of the scaled products of
query and keys weighs the values (Vaswani et al., NeurIPS 2017, eq. 1), as in the attention over people of Chen et al.,
ICRA 2019 (Crowd-Robot Interaction).
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import orjson

import sonata2d as s2
import sonata2d.gym as s2g
from sonata2d.core.portable_math import Array

OWN, TABLES = ("goal", "robot"), ("humans", "objects", "walls")
WIDTH = 64


def columns(space: Any) -> dict[str, tuple[int, tuple[int, ...]]]:
    """Offset and shape of each part in a flat observation of the parts of an environment."""
    found: dict[str, tuple[int, tuple[int, ...]]] = {}
    offset = 0
    for name, part in space.spaces.items():
        if part.dtype == np.float32:
            found[name] = offset, part.shape
            offset += int(np.prod(part.shape))
    return found


class AttentionPolicy(s2g.PolicyController):
    """Drives with the weights beside this file, without a deep-learning library."""

    def __init__(self) -> None:
        with np.load(Path(__file__).with_name("attention.npz")) as file:
            self._weights = {name: file[name].astype(np.float64) for name in file.files if name != "scenario"}
            config = s2.ScenarioConfig(**orjson.loads(str(file["scenario"])))
        env = s2g.Flat(s2g.SocialNavEnv(config))
        self._columns = columns(env.unwrapped.observation_space)
        super().__init__(self._action, env)

    def _action(self, observation: Array) -> Array:
        inputs = np.clip((observation - self._weights["mean"]) / self._weights["deviation"], -10.0, 10.0)
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
        action: Array = hidden @ self._weights["action.weight"].T + self._weights["action.bias"]
        return action.clip(-1.0, 1.0)

    def _part(self, flat: Array, name: str) -> Array:
        offset, shape = self._columns[name]
        return flat[offset : offset + int(np.prod(shape))].reshape(shape)

    def _layer(self, name: str, inputs: Array) -> Array:
        layer: Array = np.tanh(inputs @ self._weights[f"{name}.weight"].T + self._weights[f"{name}.bias"])
        return layer
