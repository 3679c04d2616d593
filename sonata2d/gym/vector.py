"""`SocialNavVectorEnv`: many environments that are stepped in one call."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from ..core.arguments import whole_number
from ..core.scene import Scene
from ..core.wording import shown
from ..registry import did_you_mean
from ..scenegen.generator import generate
from ..scenegen.scenario.config import ScenarioConfig
from ..sim.kernel.batch import CONTACT, GOAL, RUNNING, TIMEOUT
from ..sim.outcomes import outcome_at
from .env import SocialNavEnv, first_scene
from .observation import Order
from .rewards import Reward
from .state import MAX_SEED, EnvState, checked_state
from .worlds import Worlds
from .wrappers import flat_space

_Key = tuple[int, int]  # seed and number of an episode
_OF_SINGLE = {"wrappers", "parts", "metrics", "render_mode", "render_size", "view"}  # arguments of single environments


class SocialNavVectorEnv(VectorEnv[Any, Any, Any]):
    """Environments that are stepped together by compiled code, with the same bits as single ones.

    It has the standard parts of the observation and the built-in rewards. Environments in wrappers, with further parts,
    metrics, pictures or rewards in Python are stepped one after another by `gymnasium.make_vec(...,
    vectorization_mode="sync")`, or in processes by `"async"`.

    Args:
        num_envs: their number.
        scenario, settings, reward, sizes, order, record: as for `SocialNavEnv`.
        flat: whether an observation is one array of all parts of floats, as in the wrapper `Flat`.
        episodes: number of episodes of each seed, which come again and again; their worlds are kept, so that a reset
            takes little time. None: always new ones.
        threads: number of threads among which the environments are divided.
        autoreset_mode: `NEXT_STEP`: the step after the end of an episode resets it, its action is ignored, and its
            reward is 0. `SAME_STEP`: the step that ends an episode resets it, and the last observation and info are
            `final_obs` and `final_info` of the info. `DISABLED`: `reset(options={"reset_mask": ...})` does.

    Raises:
        TypeError: a number is no whole number, or an argument is only for single environments.
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
        scenario: str | Path | ScenarioConfig = "sonata-2020",
        *,
        settings: Mapping[str, Any] | None = None,
        reward: str | Reward = "distance",
        sizes: Mapping[str, int] | None = None,
        order: Order = "nearest",
        flat: bool = False,
        episodes: int | None = None,
        threads: int = 1,
        record: str | Path | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        **others: Any,
    ) -> None:
        self._arguments = {
            "num_envs": num_envs, "scenario": scenario, "settings": settings, "reward": reward, "sizes": sizes,
            "order": order, "flat": flat, "episodes": episodes, "threads": threads, "record": record,
            "autoreset_mode": autoreset_mode,
        }  # fmt: skip
        for name, value in others.items():
            if name not in _OF_SINGLE:
                known = [*self._arguments]
                hint = did_you_mean(name, known) or f"; it has {', '.join(known)}"
                raise TypeError(f"SocialNavVectorEnv has no argument {name!r}{hint}")
            if value is not None:
                raise TypeError(
                    f"SocialNavVectorEnv has no {name}; gymnasium.make_vec(..., vectorization_mode='sync') steps "
                    "environments with all arguments and wrappers one after another"
                )
        self.num_envs = whole_number("num_envs", num_envs, 1)
        is_name = isinstance(autoreset_mode, str) and autoreset_mode in AutoresetMode.__members__
        modes = ", ".join(AutoresetMode.__members__)
        try:
            self._mode = AutoresetMode[str(autoreset_mode)] if is_name else AutoresetMode(autoreset_mode)
        except ValueError:
            raise ValueError(f"autoreset_mode must be one of {modes}, got {autoreset_mode!r}") from None
        single = SocialNavEnv(scenario, settings=settings, sizes=sizes, order=order)
        self.config, self.metadata = single.config, {**single.metadata, "autoreset_mode": self._mode}
        number = None if episodes is None else whole_number("episodes", episodes, 1)
        self._worlds = _Episodes(self.num_envs, single, reward, threads, record, number)
        self._is_flat = bool(flat)
        self.single_observation_space = flat_space(single.encoder.space) if flat else single.encoder.space
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.single_action_space = single.action_space
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self._is_over = np.zeros(self.num_envs, dtype=bool)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin an episode in each environment.

        Args:
            seed: of each environment; an integer stands for itself and the following ones. None: the next episodes.
            options: `reset_mask`, (num_envs,) of bool, selects the environments that are reset; `episode`: the number
                of the episode of each seed.

        Raises:
            ValueError: an option is unknown, or a number is out of range.
            SceneError: a hundred scenes in a row have no layout.
        """
        self._require_open()
        options, worlds = dict(options or {}), self._worlds
        mask, number = options.pop("reset_mask", None), options.pop("episode", None)
        if options:
            raise ValueError(f"reset knows the options 'reset_mask' and 'episode', got {min(options)!r}")
        if number is not None:
            number = _in_range("the option 'episode'", number)
            if self._worlds.episodes is not None and number >= self._worlds.episodes:
                raise ValueError(f"the option 'episode' is below {self._worlds.episodes}, the argument episodes")
        seeds = self._seeds_of(seed)
        super().reset(seed=None)
        if mask is None:
            selected = np.ones(self.num_envs, dtype=bool)
        else:
            selected = np.asarray(mask, dtype=bool)
            if selected.shape != (self.num_envs,):
                raise ValueError(f"reset_mask has the shape ({self.num_envs},), got {selected.shape}")
            if worlds.needs_reset and not selected.all():
                raise ValueError(
                    "the first reset, or the one after an error, must reset all environments; got the reset_mask "
                    f"{selected.tolist()}"
                )
        worlds.needs_reset = True  # until all of it has succeeded
        for w in np.flatnonzero(selected).tolist():
            given = seeds[w]
            if given is None and worlds.seeds[w] is None:
                given = int(self.np_random.integers(2**31))
            worlds.begin(w, given, number)
        if seed is not None:
            worlds.forget_other_seeds()
        worlds.needs_reset = False
        self._is_over[selected] = False
        infos: dict[str, Any] = {}
        for w in np.flatnonzero(selected).tolist():
            infos = self._add_info(infos, worlds.info(w), w)
        return self._observations(), infos

    def step(
        self, actions: Any
    ) -> tuple[Any, NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        """Drive all environments for one tick; see `SocialNavEnv.step`.

        Raises:
            ResetNeeded: `reset` was not called, the last step failed or was interrupted, or an episode is over and the
                autoreset mode is `DISABLED`.
            ControllerError: a number of an action is not finite.
            ValueError: the actions have another shape.
        """
        self._require_open()
        worlds = self._worlds
        if self._mode == AutoresetMode.DISABLED and self._is_over.any() and not worlds.needs_reset:
            over = np.flatnonzero(self._is_over).tolist()
            raise gymnasium.error.ResetNeeded(f"the episodes of the environments {over} are over; use reset_mask")
        result = worlds.step(actions)
        outcomes, infos = result.outcomes, dict[str, Any]()
        outcomes[result.is_first] = RUNNING
        for w in np.flatnonzero(result.is_first).tolist():
            infos = self._add_info(infos, worlds.info(w), w)
        self._is_over = outcomes != RUNNING
        for w in np.flatnonzero(self._is_over).tolist():
            outcome = outcome_at(worlds.snapshot(w))
            assert outcome is not None
            info = {"outcome": outcome.status, "reason": outcome.reason, "is_success": outcome.status == "goal"}
            if self._mode == AutoresetMode.SAME_STEP:
                infos = self._add_info(infos, {"final_obs": self._observation(w), "final_info": info}, w)
                worlds.needs_reset = True
                worlds.begin(w)
                worlds.needs_reset = False
                info, self._is_over[w] = worlds.info(w), False
            infos = self._add_info(infos, info, w)
        is_terminated = (outcomes == GOAL) | (outcomes == CONTACT)
        return self._observations(), result.rewards, is_terminated, outcomes == TIMEOUT, infos

    def snapshot(self, index: int) -> Any:
        """The present `Snapshot` of an environment."""
        return self._worlds.snapshot(index)

    def get_states(self) -> list[dict[str, Any]]:
        """The states of all environments, as `SocialNavEnv.get_state` gives them."""
        worlds, settings = self._worlds, self.config.settings()
        generator = json.dumps(self.np_random.bit_generator.state)
        states = []
        for w in range(self.num_envs):
            scene = worlds.scene(w)
            state = EnvState(
                settings=settings, seed=scene.seed, episode=scene.episode, commands=worlds.commands(w),
                is_over=worlds.is_over(w), np_random=generator,
            )  # fmt: skip
            states.append(state.model_dump())
        return states

    def restore(self, states: Sequence[Mapping[str, Any]]) -> Any:
        """Return to states; the following steps give the same bits as they would have given then.

        Args:
            states: one of each environment, of `get_states` or of `SocialNavEnv.get_state`.

        Returns:
            The observations.

        Raises:
            ValueError: there is another number of states, or one is not a state of this version and scenario.
        """
        self._require_open()
        if not isinstance(states, list | tuple):
            raise TypeError(f"states are a list of those of get_states(), got {shown(states)}")
        if len(states) != self.num_envs:
            raise ValueError(f"there are {self.num_envs} environments, got {len(states)} states")
        return self._restore(states, is_recorded=True)

    def _restore(self, states: Sequence[Mapping[str, Any]], *, is_recorded: bool) -> Any:
        """`restore`; episodes that are restored may be left out of the recordings."""
        checked = [checked_state(state, self.config) for state in states]
        worlds, worlds.needs_reset = self._worlds, True
        for w, state in enumerate(checked):
            worlds.restore(w, state, is_recorded=is_recorded)
            self._is_over[w] = state.is_over
        self.np_random.bit_generator.state = json.loads(checked[0].np_random)
        worlds.needs_reset = False
        return self._observations()

    def close_extras(self, **kwargs: Any) -> None:
        """Record the episodes that are not over as stopped, and end the threads.

        Raises:
            RecordError: an episode cannot be recorded.
        """
        self.closed = True  # even after an error, or Gymnasium would close again
        self._worlds.close()

    def __reduce__(self) -> tuple[Any, ...]:
        states = None if self._worlds.needs_reset else self.get_states()
        attributes = {name: getattr(self, name) for name in ("spec", "closed", "action_space", "single_action_space")}
        return _rebuilt, (self._arguments, states, attributes)

    def _require_open(self) -> None:
        if self.closed:
            raise gymnasium.error.ResetNeeded("the environments are closed; make new ones")

    def _seeds_of(self, seed: int | Sequence[int | None] | None) -> list[int | None]:
        """A seed for each environment."""
        if seed is None:
            return [None] * self.num_envs
        if isinstance(seed, int | np.integer):
            return [_in_range("seed", int(seed) + k) for k in range(self.num_envs)]
        if len(seed) != self.num_envs:
            raise ValueError(f"there are {self.num_envs} environments, got {len(seed)} seeds")
        return [None if each is None else _in_range("seed", each) for each in seed]

    def _observations(self) -> Any:
        """A copy of the present observations."""
        if self._is_flat:
            return self._worlds.flat.copy()
        return {name: array.copy() for name, array in self._worlds.observations.items()}

    def _observation(self, w: int) -> Any:
        """A copy of the present observation of one environment."""
        if self._is_flat:
            return self._worlds.flat[w].copy()
        return {name: array[w].copy() for name, array in self._worlds.observations.items()}


class _Episodes(Worlds):
    """Worlds that run the episodes of seeds, as `SocialNavEnv` does.

    Args:
        count: number of worlds.
        single: an environment with the same settings.
        reward, threads, record: as of `Worlds`.
        episodes: number of episodes of a seed; None: any.

    Attributes:
        episodes: of the constructor.
        seeds: of each world; None before its first episode.
    """

    def __init__(
        self, count: int, single: SocialNavEnv, reward: str | Reward, threads: int, record: str | Path | None,
        episodes: int | None,
    ) -> None:  # fmt: skip
        self._config, self.episodes = single.config, episodes
        self.seeds: list[int | None] = [None] * count
        self._numbers = [-1] * count
        shape = single.action_space.shape
        assert shape is not None
        self._set_up(count, single.encoder, shape[0], reward, threads, record)
        self._repeats, self._keeps_commands = episodes is not None, True

    def begin(self, w: int, seed: int | None = None, number: int | None = None) -> None:
        """Begin an episode of a world; one that is not over is recorded as stopped.

        Args:
            w: index of the world.
            seed: another seed, of which the first episode begins.
            number: of the episode; None: the next one.
        """
        self._stop(w, "the environment was reset")
        if seed is not None:
            self.seeds[w], self._numbers[w] = seed, -1
        if number is not None:
            self._numbers[w] = number - 1
        self._begin(w)

    def forget_other_seeds(self) -> None:
        """Drop the worlds that are kept of earlier seeds."""
        kept = set(self.seeds)
        self._idle = {key: worlds for key, worlds in self._idle.items() if _seed_of(key) in kept}
        self._idle_count = sum(map(len, self._idle.values()))

    def restore(self, w: int, state: EnvState, *, is_recorded: bool = True) -> None:
        """Run the commands of a state again."""
        self.seeds[w], self._numbers[w] = state.seed, state.episode
        running = self._new((state.seed, state.episode))
        running.is_recorded = is_recorded and not state.is_over
        self._place(w, running)
        for command in state.commands:
            running.commands.extend(command)
            self._commands[w] = command
            self._finish(w, self._step(w, 0))

    def info(self, w: int) -> dict[str, Any]:
        """The info of a reset."""
        return {"seed": self.seeds[w], "episode_number": self._numbers[w]}

    def commands(self, w: int) -> list[tuple[float, float, float]]:
        """The commands of the present episode of a world."""
        rows = np.array(self._at(w).commands).reshape(-1, 3)
        return [(vx, vy, omega) for vx, vy, omega in rows.tolist()]

    def is_over(self, w: int) -> bool:
        """Whether the episode of a world is over."""
        return bool(self._outcome[w] != RUNNING)

    def close(self) -> None:
        try:
            for w in range(self.num_worlds):
                self._stop(w, "the environment was closed")
        finally:
            super().close()

    def _stop(self, w: int, reason: str) -> None:
        running = self._running[w]
        is_running = running is not None and running.commands and running.is_recorded and not self.is_over(w)
        if running is not None and is_running and self._folder is not None:
            self._save(running, reason)

    def _draw(self, w: int) -> _Key:
        seed, number = self.seeds[w], self._numbers[w] + 1
        assert seed is not None
        return seed, number if self.episodes is None else number % self.episodes

    def _scene_of(self, key: Any) -> Scene:
        seed, number = key
        return first_scene(partial(generate, self._config, seed), number)

    def _place(self, w: int, running: Any) -> None:
        super()._place(w, running)
        self._numbers[w] = running.scene.episode


def _seed_of(key: Any) -> int:
    seed: int = key[0]
    return seed


def _in_range(name: str, value: Any) -> int:
    """A seed or number of an episode.

    Raises:
        ValueError: it is no integer, or is out of range.
    """
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or not 0 <= value <= MAX_SEED:
        raise ValueError(f"{name} must be an integer from 0 to 2^63 - 1, got {shown(value)}")
    return int(value)


def _rebuilt(
    arguments: dict[str, Any], states: list[dict[str, Any]] | None, attributes: dict[str, Any]
) -> SocialNavVectorEnv:
    """A copy of environments, which continues the episodes without recording them."""
    envs = SocialNavVectorEnv(**arguments)
    if states is not None:
        envs._restore(states, is_recorded=False)
    vars(envs).update(attributes)
    return envs
