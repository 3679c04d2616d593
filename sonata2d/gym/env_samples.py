"""Observations and actions of recorded episodes as samples of a stream."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import gymnasium

from ..core.geometry import Twist
from ..record.record import EpisodeRecord
from .demonstrations import nearest_action
from .pipeline import Pipeline


class EnvSamples:
    """Makes the observation and the action of each frame of an episode, for `Dataset.stream`.

    Observations are those of the environment and its wrappers, such as `Flat`, whichever controller drove; the action
    is that of the recorded command.

    Args:
        env: `SocialNavEnv`, in wrappers or not, with the scenario of the data set; its episodes are not run.

    Raises:
        TypeError: the environment is not one of sonata2d, or a wrapper changes observations or actions otherwise than
            by a function of the present ones.

    Example:
        >>> import gymnasium
        >>> import sonata2d as s2
        >>> from sonata2d.gym import EnvSamples, Flat
        >>> env = Flat(gymnasium.make("sonata2d/SocialNav-v0"))
        >>> observation, action = next(iter(s2.Dataset("demo").stream(EnvSamples(env))))
        >>> action.shape
        (3,)
    """

    def __init__(self, env: gymnasium.Env[Any, Any]) -> None:
        self._env, self._pipeline = env, Pipeline(env)

    def __call__(self, record: EpisodeRecord) -> Iterator[tuple[Any, Any]]:
        """The observation and the action of each frame, in order."""
        self._pipeline.begin()
        for tick in range(len(record)):
            twist = Twist(*record.command[tick].tolist())
            yield self._pipeline.observe(record.snapshot(tick)), nearest_action(self._env, self._pipeline, twist)
