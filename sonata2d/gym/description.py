"""The observations and actions of an environment as plain data, for files of policies."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import gymnasium
from gymnasium import spaces
from gymnasium.utils import RecordConstructorArgs

from ..core.wording import one_line
from ..errors import ConfigError
from ..scenegen.scenario.config import ScenarioConfig
from .env import Env, SocialNavEnv, base_of, wrappers_of
from .observation import Sizes
from .parts import STANDARD, DerivedPart
from .wrappers import DiscreteActions, FieldOfView, Flat, Graph, History, Lidar, Noise, WorldFrame, has_memory

_WRAPPERS: dict[str, Any] = {
    wrapper.__name__: wrapper
    for wrapper in (DiscreteActions, FieldOfView, Flat, Graph, History, Lidar, Noise, WorldFrame)
}
_CHANGES = (gymnasium.ObservationWrapper, gymnasium.ActionWrapper)


def describe(env: Env) -> dict[str, Any]:
    """The data that determine the observations and actions of an environment.

    Wrappers that change neither, such as time limits and rewards, are left out.

    Returns:
        Numbers of rows (`sizes`) and their `order`; the largest numbers of entities in its scenes (`entities`); the
        `robot`'s drive and limits; the `wrappers`, the innermost first; and version and columns of the `parts` of the
        observation that a policy reads.

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
                f"the wrapper {type(wrapper).__name__} cannot be described; use wrappers of sonata2d.gym, or "
                "pass the environment itself to PolicyController"
            )
    robot, read = base.config.robot, parts_read(env)
    return {
        "sizes": asdict(base.encoder.sizes),
        "entities": asdict(base.entities),
        "order": base.encoder.order,
        "parts": {part.name: part.record() for part in base.encoder.parts if part.name in read},
        "robot": {"kinematics": robot.kinematics, "limits": asdict(robot.limits)},
        "wrappers": wrappers,
    }


def parts_read(env: Env) -> set[str]:
    """The names of the parts on which the observation of an environment depends.

    A part that `Flat` or `Lidar` leaves out, and that no wrapper reads, does not count.
    """
    base = base_of(env)
    passed, read = set(base.encoder.space), set[str]()
    for wrapper in reversed(list(wrappers_of(env))):
        read |= getattr(wrapper, "reads", set())
        if isinstance(wrapper, Flat):
            passed &= set(wrapper.keys)
        elif isinstance(wrapper.observation_space, spaces.Dict):
            passed &= set(wrapper.observation_space)
    for part in base.encoder.parts:
        if isinstance(part, DerivedPart) and part.name in passed:
            read |= {source.name for source in part.sources()}
    return passed | read


def environment_of(description: Mapping[str, Any], scenario: str | ScenarioConfig = "empty") -> Env:
    """An environment with the observations and actions of a description.

    Args:
        description: of `describe`.
        scenario: may differ from the scenario of the described environment; the robot is as described.

    Raises:
        ValueError: the description is not one of an environment, or this program has other parts.
    """
    try:
        robot = {"robot": description["robot"]}
        sizes = asdict(Sizes(**description["sizes"]))
        further = [name for name in description["parts"] if name not in {part.name for part in STANDARD}]
        base = SocialNavEnv(scenario, settings=robot, sizes=sizes, order=description["order"], parts=further)
        base.entities = Sizes(**description["entities"])  # for the warning of scenes with more
        env: Env = base
        for wrapper in description["wrappers"]:
            env = _WRAPPERS[wrapper["name"]](env, **wrapper["arguments"])
    except ConfigError as error:  # a part that this program does not know, or settings of the robot
        raise ValueError(str(error)) from error
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        raise ValueError(f"not the description of an environment: {error!r}") from error
    require_parts(description, env)
    return env


def require_parts(description: Mapping[str, Any], env: Env) -> None:
    """Require that an environment has the parts of a description, in the same versions.

    Raises:
        ValueError: it lacks a part, or has another version of it.
    """
    parts = {part.name: part.record() for part in base_of(env).encoder.parts}
    for name, trained in description["parts"].items():
        if parts.get(name) != trained:
            raise ValueError(
                f"the policy reads the observation part {name!r} of {_words(trained)}, here it has "
                f"{_words(parts.get(name))}; train it again, or use the sonata2d or plug-in that saved it"
            )


def _words(record: Mapping[str, Any] | None) -> str:
    """A record of a part in words."""
    if record is None:
        return "no version"
    return one_line(f"version {record['version']} with the columns {', '.join(record['columns'])}", 150)
