"""The observations and actions of an environment as plain data, for files of policies."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import gymnasium
from gymnasium.utils import RecordConstructorArgs

from ..errors import ConfigError
from ..scenegen.scenario.config import ScenarioConfig
from .env import SocialNavEnv, base_of, wrappers_of
from .observation import Sizes
from .wrappers import DiscreteActions, FieldOfView, Flat, Graph, History, Lidar, Noise, WorldFrame, has_memory

Env = gymnasium.Env[Any, Any]
_WRAPPERS: dict[str, Any] = {
    one.__name__: one for one in (DiscreteActions, FieldOfView, Flat, Graph, History, Lidar, Noise, WorldFrame)
}
_CHANGES = (gymnasium.ObservationWrapper, gymnasium.ActionWrapper)


def describe(env: Env) -> dict[str, Any]:
    """What determines the observations and actions of an environment: sizes, order, drive and its limits, wrappers;
    and the largest numbers of entities in its scenes.

    Wrappers that change neither, such as those of time limits and rewards, are left out.

    Raises:
        TypeError: a wrapper of observations or actions is not one of `sonata2d.gym`.
    """
    base = base_of(env)
    wrappers: list[dict[str, Any]] = []
    for wrapper in wrappers_of(env):
        if isinstance(wrapper, RecordConstructorArgs) and type(wrapper) in _WRAPPERS.values():
            wrappers.insert(0, {"name": type(wrapper).__name__, "arguments": dict(wrapper._saved_kwargs)})
        elif isinstance(wrapper, _CHANGES) or has_memory(wrapper):
            raise TypeError(
                f"the wrapper {type(wrapper).__name__} cannot be described; use those of sonata2d.gym.wrappers, or "
                "pass the environment itself to PolicyController"
            )
    robot = base.config.robot
    return {
        "sizes": asdict(base.encoder.sizes),
        "entities": asdict(base.entities),
        "order": base.encoder.order,
        "robot": {"kinematics": robot.kinematics, "limits": asdict(robot.limits)},
        "wrappers": wrappers,
    }


def environment_of(description: Mapping[str, Any], scenario: str | ScenarioConfig = "empty") -> Env:
    """An environment with the observations and actions of a description.

    Args:
        description: of `describe`.
        scenario: which need not be that of the described environment; the robot is as described.

    Raises:
        ValueError: the description is not that of an environment.
    """
    try:
        robot = {"robot": description["robot"]}
        sizes = asdict(Sizes(**description["sizes"]))
        base = SocialNavEnv(scenario, settings=robot, sizes=sizes, order=description["order"])
        base.entities = Sizes(**description["entities"])  # which the wrappers require rows for
        env: Env = base
        for wrapper in description["wrappers"]:
            env = _WRAPPERS[wrapper["name"]](env, **wrapper["arguments"])
    except (AttributeError, ConfigError, KeyError, TypeError, ValueError) as error:
        raise ValueError(f"not the description of an environment: {error!r}") from error
    return env
