"""What wrappers do to observations and actions, apart from an environment's own steps."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import gymnasium
from gymnasium.wrappers import TimeLimit

from ..core.geometry import Twist
from ..core.snapshot import Snapshot
from .env import base_of, wrappers_of
from .observation import Observation
from .wrappers import EpisodeWrapper, has_memory

Env = gymnasium.Env[Any, Any]


class Pipeline:
    """The observations and actions of a wrapped environment.

    Args:
        env: `SocialNavEnv` in any number of wrappers. Wrappers of observations and of actions are applied; others, such
            as those of rewards and time limits, do not change either.

    Raises:
        TypeError: the environment is not one of sonata2d, or a wrapper changes observations or actions otherwise than
            by a function of the present ones, in a `gymnasium.ObservationWrapper` or `ActionWrapper`.
    """

    def __init__(self, env: Env) -> None:
        self.base = base_of(env)
        self._wrappers: list[Any] = list(wrappers_of(env))[::-1]  # the innermost first
        for wrapper in self._wrappers:
            if has_memory(wrapper):
                raise TypeError(
                    f"what {type(wrapper).__name__} does to observations or actions cannot be repeated, because it "
                    "depends on more than the present ones; use those of sonata2d.gym, such as History, or a "
                    "gymnasium.ObservationWrapper or ActionWrapper without a memory"
                )

    def begin(self) -> None:
        """Begin an episode."""
        for wrapper in self._wrappers:
            if isinstance(wrapper, EpisodeWrapper):
                wrapper.begin()

    def observation(self, observation: Observation) -> Any:
        """What the wrappers make of an observation of the base environment."""
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
    """Return to a state of `SocialNavEnv.get_state`, in which the wrappers are as they were then.

    Args:
        env: in wrappers or not. Those of sonata2d and time limits go back; statistics of episodes and of rewards do
            not.
        state: `env.unwrapped.get_state()` of an environment with the same scenario.

    Returns:
        The observation of the wrapped environment.

    Raises:
        ValueError: it is not a state of this version, or one of another scenario.
        TypeError: a wrapper of observations or actions has a memory and is not one of sonata2d.
    """
    pipeline = Pipeline(env)
    observation, _ = env.reset(options={"state": state, "watch": pipeline.observation})
    for wrapper in wrappers_of(env):
        if isinstance(wrapper, TimeLimit):
            wrapper._elapsed_steps = len(state["commands"])  # type: ignore[assignment]
    return observation
