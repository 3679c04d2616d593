"""`SocialNavVectorEnv`: several environments in one process, stepped by threads."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from .env import SocialNavEnv

Env = gymnasium.Env[Any, Any]
_Result = tuple[Any, float, bool, bool, dict[str, Any]]


class SocialNavVectorEnv(VectorEnv[Any, Any, NDArray[Any]]):
    """Environments that are stepped together, with the same bits as single ones.

    The worlds run in compiled code, in which threads do not wait for each other; the rest of a step is Python, one
    thread at a time.

    Args:
        num_envs: their number.
        wrappers: are put around each environment, the innermost first.
        autoreset_mode: `NEXT_STEP`: the step after the end of an episode resets it, its action is ignored, and its
            reward is 0. `SAME_STEP`: the step that ends an episode resets it, and the last observation and info are
            `final_obs` and `final_info` of the info. `DISABLED`: `reset(options={"reset_mask": ...})` does.
        threads: their number; 1: none besides the caller's.
        kwargs: arguments of `SocialNavEnv`.

    Raises:
        ValueError: a number is below 1.

    >>> import gymnasium, sonata2d.gym
    >>> envs = gymnasium.make_vec("sonata2d/Empty-v0", num_envs=3, vectorization_mode="vector_entry_point")
    >>> observations, infos = envs.reset(seed=1)
    >>> observations["goal"].shape
    (3, 6)
    """

    def __init__(
        self,
        num_envs: int = 1,
        *,
        wrappers: Sequence[Callable[[Env], Env]] = (),
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        threads: int = 1,
        **kwargs: Any,
    ) -> None:
        for name, number in (("num_envs", num_envs), ("threads", threads)):
            if number < 1:
                raise ValueError(f"{name} must be 1 or more, got {number}")
        self.envs: list[Env] = []
        for _ in range(num_envs):
            env: Env = SocialNavEnv(**kwargs)
            for wrapper in wrappers:
                env = wrapper(env)
            self.envs.append(env)
        first = self.envs[0]
        self.num_envs, self.render_mode = num_envs, first.render_mode
        is_name = isinstance(autoreset_mode, str) and autoreset_mode in AutoresetMode.__members__
        self.autoreset_mode = AutoresetMode[str(autoreset_mode)] if is_name else AutoresetMode(autoreset_mode)
        self.metadata = {**first.metadata, "autoreset_mode": self.autoreset_mode}
        self.single_observation_space, self.single_action_space = first.observation_space, first.action_space
        self.observation_space = batch_space(first.observation_space, num_envs)
        self.action_space = batch_space(first.action_space, num_envs)
        self._is_over, self._last = np.zeros(num_envs, dtype=bool), list[Any]()
        self._executor = ThreadPoolExecutor(threads) if threads > 1 else None
        self._shares = np.array_split(np.arange(num_envs), min(threads, num_envs))

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin an episode in each environment.

        Args:
            seed: of each environment; an integer stands for itself and the following ones.
            options: of each environment; `reset_mask`, (num_envs,) of bool, selects those that are reset.
        """
        seeds = self._seeds(seed)
        options = dict(options or {})
        mask = np.asarray(options.pop("reset_mask", np.ones(self.num_envs, dtype=bool)), dtype=bool)
        if mask.shape != (self.num_envs,) or not (mask.all() or self._last):
            raise ValueError(
                f"reset_mask has the shape ({self.num_envs},), and the first reset is one of all; got {mask.tolist()}"
            )
        infos: dict[str, Any] = {}
        observations: list[Any] = [None] * self.num_envs
        for k, env in enumerate(self.envs):
            if mask[k]:
                observations[k], info = env.reset(seed=seeds[k], options=options)
                infos = self._add_info(infos, info, k)
                self._is_over[k] = False
            else:
                observations[k] = self._last[k]
        return self._batch(observations), infos

    def step(
        self, actions: Any
    ) -> tuple[Any, NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        """Drive all environments for one tick; see `SocialNavEnv.step`."""
        if len(actions) != self.num_envs:
            raise ValueError(f"there are {self.num_envs} environments, got {len(actions)} actions")
        if self._executor is None:
            results = self._step_some(actions, self._shares[0])
        else:
            parts = self._executor.map(partial(self._step_some, actions), self._shares)
            results = [result for part in parts for result in part]
        rewards = np.array([result[1] for result in results], dtype=np.float64)
        terminated, truncated = (np.array([result[i] for result in results], dtype=bool) for i in (2, 3))
        infos: dict[str, Any] = {}
        for k, result in enumerate(results):
            infos = self._add_info(infos, result[4], k)
        over = terminated | truncated
        self._is_over = over if self.autoreset_mode != AutoresetMode.SAME_STEP else np.zeros_like(over)
        return self._batch([result[0] for result in results]), rewards, terminated, truncated, infos

    def close_extras(self, **kwargs: Any) -> None:
        """Close all environments."""
        if self._executor is not None:
            self._executor.shutdown()
        for env in self.envs:
            env.close()

    def render(self) -> tuple[Any, ...] | None:
        """The pictures of all environments."""
        return tuple(env.render() for env in self.envs)

    def _step_some(self, actions: Any, indices: NDArray[np.int64]) -> list[_Result]:
        """Step the environments with some indices."""
        return [self._step_one(actions[k], int(k)) for k in indices]

    def _step_one(self, action: Any, k: int) -> _Result:
        env = self.envs[k]
        if self._is_over[k]:
            if self.autoreset_mode == AutoresetMode.DISABLED:
                raise gymnasium.error.ResetNeeded(f"the episode of environment {k} is over; reset it by reset_mask")
            observation, info = env.reset()
            return observation, 0.0, False, False, info
        observation, reward, terminated, truncated, info = env.step(action)
        if (terminated or truncated) and self.autoreset_mode == AutoresetMode.SAME_STEP:
            last, final_info = observation, info
            observation, info = env.reset()
            info = {**info, "final_obs": last, "final_info": final_info}
        return observation, float(reward), terminated, truncated, info

    def _batch(self, observations: list[Any]) -> Any:
        """The observations as one, in new arrays."""
        self._last = observations
        space = self.single_observation_space
        if isinstance(space, spaces.Dict):
            return {name: np.stack([observation[name] for observation in observations]) for name in space.spaces}
        return np.stack(observations)

    def _seeds(self, seed: int | Sequence[int | None] | None) -> list[int | None]:
        if seed is None:
            return [None] * self.num_envs
        if isinstance(seed, int):
            return [seed + k for k in range(self.num_envs)]
        if len(seed) != self.num_envs:
            raise ValueError(f"there are {self.num_envs} environments, got {len(seed)} seeds")
        return list(seed)
