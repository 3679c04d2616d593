"""The observations and actions of a wrapped environment without its steps."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import gymnasium
from gymnasium.wrappers import TimeLimit

from ..core.geometry import Twist
from ..core.snapshot import Snapshot
from .env import Env, base_of, wrappers_of
from .parts import Observation
from .wrappers import EpisodeWrapper, has_memory


class Pipeline:
    """The observations and actions of a wrapped environment.

    Args:
        env: `SocialNavEnv` in any number of wrappers. Wrappers of observations and of actions are applied; others, such
            as wrappers of rewards and time limits, change neither.

    Raises:
        TypeError: the environment is not one of sonata2d, or a wrapper of another package is stateful.
    """

    def __init__(self, env: Env) -> None:
        self.base = base_of(env)
        self._wrappers: list[Any] = list(wrappers_of(env))[::-1]  # the innermost first
        for wrapper in self._wrappers:
            if has_memory(wrapper):
                raise TypeError(
                    f"the wrapper {type(wrapper).__name__} cannot be repeated, because it is stateful; use wrappers of "
                    "sonata2d.gym, such as History, or a gymnasium.ObservationWrapper or ActionWrapper without a state"
                )

    def begin(self) -> None:
        """Begin an episode."""
        for wrapper in self._wrappers:
            if isinstance(wrapper, EpisodeWrapper):
                wrapper.begin()

    def observation(self, observation: Observation) -> Any:
        """Apply the wrappers to an observation of the base environment."""
        result: Any = observation
        for wrapper in self._wrappers:
            if isinstance(wrapper, gymnasium.ObservationWrapper):
                result = wrapper.observation(result)
        return result

    def observe(self, snapshot: Snapshot) -> Any:
        """The observation of a snapshot."""
        return self.observation(self.base.observe(snapshot))

    def twist(self, action: Any) -> Twist:
        """The command of an action of the wrapped environment."""
        for wrapper in reversed(self._wrappers):
            if isinstance(wrapper, gymnasium.ActionWrapper):
                action = wrapper.action(action)
        return self.base.twist_of(action)


def restore(env: Env, state: Mapping[str, Any]) -> Any:
    """Return to a state of `SocialNavEnv.get_state`; the wrappers return to their state at that time.

    Args:
        env: in wrappers or not. Wrappers of sonata2d and time limits are restored; statistics of episodes and of
            rewards are not.
        state: `env.unwrapped.get_state()` of an environment with the same scenario.

    Returns:
        The observation of the wrapped environment.

    Raises:
        ValueError: it is not a state of this version, or belongs to another scenario.
        TypeError: a wrapper of another package is stateful.
    """
    pipeline = Pipeline(env)
    observation, _ = env.reset(options={"state": state, "watch": pipeline.observation})
    for wrapper in wrappers_of(env):
        if isinstance(wrapper, TimeLimit):
            wrapper._elapsed_steps = len(state["commands"])  # type: ignore[assignment]
    return observation
