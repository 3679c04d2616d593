"""`SocialNavVectorEnv`: several environments that are stepped together."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from functools import partial
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from numpy.typing import NDArray

from ..core.arguments import whole_number
from .env import Env, SocialNavEnv
from .pipeline import restore
from .wrappers import stacked

_Flags = NDArray[np.bool_]


def _made(wrappers: Sequence[Callable[[Env], Env]], arguments: Mapping[str, Any]) -> Env:
    """One environment; a function of the module, so that the vector environment can be pickled."""
    env: Env = SocialNavEnv(**arguments)
    for wrapper in wrappers:
        env = wrapper(env)
    return env


class SocialNavVectorEnv(SyncVectorEnv):
    """Environments that are stepped one after another in one process, with the same bits as single ones.

    It is Gymnasium's `SyncVectorEnv` with `restore`, and refuses steps after an error. Gymnasium's `AsyncVectorEnv`
    runs each environment in a process of its own.

    Args:
        num_envs: their number.
        wrappers: are put around each environment, the innermost first.
        autoreset_mode: `NEXT_STEP`: the step after the end of an episode resets it, its action is ignored, and its
            reward is 0. `SAME_STEP`: the step that ends an episode resets it, and the last observation and info are
            `final_obs` and `final_info` of the info. `DISABLED`: `reset(options={"reset_mask": ...})` does.
        kwargs: arguments of `SocialNavEnv`.

    Raises:
        TypeError: the number is no whole number.
        ValueError: the number is below 1.

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
        **kwargs: Any,
    ) -> None:
        num_envs = whole_number("num_envs", num_envs, 1)
        is_name = isinstance(autoreset_mode, str) and autoreset_mode in AutoresetMode.__members__
        mode = AutoresetMode[str(autoreset_mode)] if is_name else AutoresetMode(autoreset_mode)
        super().__init__([partial(_made, tuple(wrappers), kwargs)] * num_envs, autoreset_mode=mode)
        self._needs_reset = True

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin an episode in each environment.

        Args:
            seed: of each environment; an integer stands for itself and the following ones.
            options: of each environment; `reset_mask`, (num_envs,) of bool, selects the environments that are reset.
        """
        options = dict(options or {})
        if "reset_mask" in options:
            options["reset_mask"] = mask = np.asarray(options["reset_mask"], dtype=bool)
            if self._needs_reset and not mask.all():
                raise ValueError(
                    "the first reset, or the one after an error, must reset all environments; got the reset_mask "
                    f"{mask.tolist()}"
                )
        self._needs_reset = True
        seeds = int(seed) if isinstance(seed, np.integer) else seed
        result = super().reset(seed=seeds, options=options)  # type: ignore[arg-type]
        self._needs_reset = False
        return result

    def step(self, actions: Any) -> tuple[Any, NDArray[np.float64], _Flags, _Flags, dict[str, Any]]:
        """Drive all environments for one tick; see `SocialNavEnv.step`.

        Raises:
            ResetNeeded: `reset` was not called, the last step failed or was interrupted, so that some environments may
                be a tick ahead, or an episode is over and the autoreset mode is `DISABLED`.
        """
        if len(actions) != self.num_envs:
            raise ValueError(f"there are {self.num_envs} environments, got {len(actions)} actions")
        if self._needs_reset:
            raise gymnasium.error.ResetNeeded("call reset() first, and after a step that failed or was interrupted")
        if self.autoreset_mode == AutoresetMode.DISABLED and self._autoreset_envs.any():
            over = np.flatnonzero(self._autoreset_envs).tolist()
            raise gymnasium.error.ResetNeeded(f"the episodes of the environments {over} are over; use reset_mask")
        self._needs_reset = True
        result = super().step(actions)
        self._needs_reset = False
        return result

    def restore(self, states: Sequence[Mapping[str, Any]]) -> Any:
        """Return to states, see `sonata2d.gym.restore`.

        Args:
            states: one of each environment, e.g. of `call("get_state")`.

        Returns:
            The observations.
        """
        if len(states) != self.num_envs:
            raise ValueError(f"there are {self.num_envs} environments, got {len(states)} states")
        self._needs_reset = True
        for k, (env, state) in enumerate(zip(self.envs, states, strict=True)):
            self._env_obs[k] = restore(env, state)
        self._autoreset_envs = np.array([state["is_over"] for state in states], dtype=bool)
        self._needs_reset = False
        return stacked(self.single_observation_space, self._env_obs)

    def close_extras(self, **kwargs: Any) -> None:
        """Close all environments."""
        self.closed = True  # even after an error, or Gymnasium would close again
        with ExitStack() as stack:
            for env in self.envs:
                stack.callback(env.close)
