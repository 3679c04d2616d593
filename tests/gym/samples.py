"""Environments for tests."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np

import sonata2d.gym as s2g

Env = gymnasium.Env[Any, Any]
SHORT = {"rules": {"time_limit": 6.0}}

# Wrappers, alone and combined, that any environment of sonata2d can have.
CHAINS: dict[str, Callable[[Env], Env]] = {
    "none": lambda env: env,
    "flat": s2g.Flat,
    "world": s2g.WorldFrame,
    "noise": s2g.Noise,
    "view": s2g.FieldOfView,
    "lidar": s2g.Lidar,
    "graph": s2g.Graph,
    "history": s2g.History,
    "discrete": s2g.DiscreteActions,
    "history of flat": lambda env: s2g.History(s2g.Flat(env), length=3),
    "flat lidar of a noisy view": lambda env: s2g.Flat(s2g.Lidar(s2g.FieldOfView(s2g.Noise(env)), rays=24)),
    "graph of a view, discrete": lambda env: s2g.DiscreteActions(s2g.Graph(s2g.FieldOfView(env))),
}


def equal(a: Any, b: Any) -> bool:
    """Whether two observations have the same bits."""
    if isinstance(a, dict):
        return a.keys() == b.keys() and all(equal(a[name], b[name]) for name in a)
    return a.dtype == b.dtype and bool(np.array_equal(a, b))


def actions(env: Env, count: int, seed: int = 0) -> list[Any]:
    """Random actions of an environment."""
    env.action_space.seed(seed)
    return [env.action_space.sample() for _ in range(count)]
