"""`SocialNavVectorEnv`: several environments that are stepped together, in one process or in several."""

from __future__ import annotations

import os
import pickle
import signal
import sys
import time
import traceback
import weakref
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from multiprocessing import get_context
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from typing import Any

import cloudpickle
import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import CloudpickleWrapper, batch_space
from numpy.typing import NDArray

from ..core.wording import described
from .env import SocialNavEnv
from .pipeline import restore

Env = gymnasium.Env[Any, Any]
_Flags = NDArray[np.bool_]
_Results = tuple[Any, NDArray[np.float64], _Flags, _Flags, list[dict[str, Any]]]  # of `VectorEnv.step`, infos by world
_PATIENCE = 10.0  # s; how long a process may take to end its episodes when it is closed


class SocialNavVectorEnv(VectorEnv[Any, Any, NDArray[Any]]):
    """Environments that are stepped together, with the same bits as single ones.

    Args:
        num_envs: their number.
        wrappers: are put around each environment, the innermost first.
        autoreset_mode: `NEXT_STEP`: the step after the end of an episode resets it, its action is ignored, and its
            reward is 0. `SAME_STEP`: the step that ends an episode resets it, and the last observation and info are
            `final_obs` and `final_info` of the info. `DISABLED`: `reset(options={"reset_mask": ...})` does.
        processes: among which the environments are shared out; 1: none besides the caller's.
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
        processes: int = 1,
        **kwargs: Any,
    ) -> None:
        self._worlds: list[_Local | _Remote] = []
        for name, number in (("num_envs", num_envs), ("processes", processes)):
            if not isinstance(number, int | np.integer) or number < 1:
                raise ValueError(f"{name} must be an integer of 1 or more, got {number!r}")

        def make() -> Env:
            env: Env = SocialNavEnv(**kwargs)
            for wrapper in wrappers:
                env = wrapper(env)
            return env

        is_name = isinstance(autoreset_mode, str) and autoreset_mode in AutoresetMode.__members__
        self.autoreset_mode = AutoresetMode[str(autoreset_mode)] if is_name else AutoresetMode(autoreset_mode)
        first = make()
        self.num_envs, self.render_mode = num_envs, first.render_mode
        self.metadata = {**first.metadata, "autoreset_mode": self.autoreset_mode}
        self.single_observation_space, self.single_action_space = first.observation_space, first.action_space
        self.observation_space = batch_space(first.observation_space, num_envs)
        self.action_space = batch_space(first.action_space, num_envs)
        first.close()
        shares = np.array_split(np.arange(num_envs), min(processes, num_envs))
        self._shares = [slice(int(share[0]), int(share[-1]) + 1) for share in shares]
        start = _Local if len(shares) == 1 else _Remote
        self._worlds = [start(make, len(share), self.autoreset_mode) for share in shares]
        self._needs_reset = True
        self._is_over = np.zeros(num_envs, dtype=bool)

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
        if mask.shape != (self.num_envs,) or (self._needs_reset and not mask.all()):
            raise ValueError(
                f"reset_mask must have the shape ({self.num_envs},), and the first reset, or the one after an error, "
                f"must reset all environments; got {mask.tolist()}"
            )
        self._needs_reset = True
        results = self._ask("reset", [(seeds[share], mask[share], options) for share in self._shares])
        self._is_over &= ~mask
        infos: dict[str, Any] = {}
        for k, info in enumerate(info for _, some in results for info in some):
            if mask[k]:
                infos = self._add_info(infos, info, k)
        self._needs_reset = False
        return _joined([observations for observations, _ in results]), infos

    def step(self, actions: Any) -> tuple[Any, NDArray[np.float64], _Flags, _Flags, dict[str, Any]]:
        """Drive all environments for one tick; see `SocialNavEnv.step`.

        Raises:
            ResetNeeded: `reset` was not called, the last step failed or was interrupted, so that some environments may
                be a tick ahead or gone, or an episode is over and the autoreset mode is `DISABLED`.
        """
        if len(actions) != self.num_envs:
            raise ValueError(f"there are {self.num_envs} environments, got {len(actions)} actions")
        if self._needs_reset:
            raise gymnasium.error.ResetNeeded("call reset() first, and after a step that failed or was interrupted")
        if self.autoreset_mode == AutoresetMode.DISABLED and self._is_over.any():
            over = np.flatnonzero(self._is_over).tolist()
            raise gymnasium.error.ResetNeeded(f"the episodes of the environments {over} are over; use reset_mask")
        self._needs_reset = True
        results: list[_Results] = self._ask("step", [(actions[share],) for share in self._shares])
        observations, rewards, terminated, truncated = (_joined([result[i] for result in results]) for i in range(4))
        self._is_over = terminated | truncated
        infos: dict[str, Any] = {}
        for k, info in enumerate(info for result in results for info in result[4]):
            infos = self._add_info(infos, info, k)
        self._needs_reset = False
        return observations, rewards, terminated, truncated, infos

    def call(self, name: str, *args: Any, **kwargs: Any) -> tuple[Any, ...]:
        """Call a method of all environments, or get an attribute, e.g. `call("get_state")`.

        Methods that begin or continue an episode are refused: the vector has its own `reset`, `step` and `restore`.

        Args:
            name: of a method or attribute of the wrapped environments or those inside.
            args: of the method.
            kwargs: of the method.

        Returns:
            One result of each environment.
        """
        if name in ("reset", "step", "set_state"):
            own = "restore" if name == "set_state" else name
            raise ValueError(
                f"{name} of single environments would not be noticed; call {own} of the vector environment"
            )
        results = self._ask("call", [(name, args, kwargs)] * len(self._shares))
        return tuple(result for some in results for result in some)

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
        results = self._ask("restore", [(states[share],) for share in self._shares])
        self._needs_reset = False
        self._is_over = np.array([state["is_over"] for state in states], dtype=bool)
        return _joined(results)

    def get_attr(self, name: str) -> tuple[Any, ...]:
        """An attribute of each environment."""
        return self.call("get_wrapper_attr", name)

    def set_attr(self, name: str, values: Any) -> None:
        """Set an attribute of the environments.

        Args:
            name: of the attribute.
            values: a list or tuple with one of each environment, or one for all.
        """
        if not isinstance(values, list | tuple):
            values = [values] * self.num_envs
        if len(values) != self.num_envs:
            raise ValueError(f"there are {self.num_envs} environments, got {len(values)} values of {name}")
        self._ask("set_attr", [(name, values[share]) for share in self._shares])

    def render(self) -> tuple[Any, ...] | None:
        """The pictures of all environments."""
        return self.call("render")

    def close_extras(self, **kwargs: Any) -> None:
        """Close all environments."""
        self.closed = True  # even after an error: Gymnasium closes again what was not
        for worlds in self._worlds:
            worlds.begin("close", ())
        deadline = time.monotonic() + _PATIENCE
        answers = [worlds.end(deadline) for worlds in self._worlds]
        _raise_first(answers)

    def _ask(self, method: str, arguments: list[tuple[Any, ...]]) -> list[Any]:
        """Call a method of the worlds of all processes, which work at the same time."""
        if self.closed:
            raise gymnasium.error.ClosedEnvironmentError("the vector environment was closed; make another one")
        try:
            for worlds, some in zip(self._worlds, arguments, strict=True):
                worlds.begin(method, some)
            results = [worlds.result() for worlds in self._worlds]
        except BaseException:  # an interrupt, which leaves messages unread or in parts
            for worlds in self._worlds:
                worlds.abandon()
            raise
        _raise_first(results)
        return results

    def _seeds(self, seed: int | Sequence[int | None] | None) -> list[int | None]:
        if seed is None:
            return [None] * self.num_envs
        if isinstance(seed, int | np.integer):
            return [int(seed) + k for k in range(self.num_envs)]
        if len(seed) != self.num_envs:
            raise ValueError(f"there are {self.num_envs} environments, got {len(seed)} seeds")
        return list(seed)


class _Worlds:
    """The environments that one process steps.

    Args:
        make: makes one.
        count: their number.
        mode: of autoreset.
    """

    def __init__(self, make: Callable[[], Env], count: int, mode: AutoresetMode) -> None:
        self.envs, self._mode = [make() for _ in range(count)], mode
        self._last: list[Any] = [None] * count
        self._is_over = [False] * count

    def reset(self, seeds: list[int | None], mask: _Flags, options: dict[str, Any]) -> tuple[Any, list[dict[str, Any]]]:
        infos: list[dict[str, Any]] = [{} for _ in self.envs]
        for k, env in enumerate(self.envs):
            if mask[k]:
                self._last[k], infos[k] = env.reset(seed=seeds[k], options=options)
                self._is_over[k] = False
        return _batch(self._last), infos

    def step(self, actions: Any) -> _Results:
        results = [self._step_one(k, actions[k]) for k in range(len(self.envs))]
        self._last = [result[0] for result in results]
        rewards = np.array([result[1] for result in results], dtype=np.float64)
        terminated, truncated = (np.array([result[i] for result in results], dtype=bool) for i in (2, 3))
        if self._mode != AutoresetMode.SAME_STEP:
            self._is_over = (terminated | truncated).tolist()
        return _batch(self._last), rewards, terminated, truncated, [result[4] for result in results]

    def restore(self, states: Sequence[Mapping[str, Any]]) -> Any:
        for k, (env, state) in enumerate(zip(self.envs, states, strict=True)):
            self._last[k] = restore(env, state)
            self._is_over[k] = bool(state["is_over"])
        return _batch(self._last)

    def call(self, name: str, args: tuple[Any, ...], kwargs: dict[str, Any]) -> list[Any]:
        found = [env.get_wrapper_attr(name) for env in self.envs]
        return [value(*args, **kwargs) if callable(value) else value for value in found]

    def set_attr(self, name: str, values: Sequence[Any]) -> None:
        for env, value in zip(self.envs, values, strict=True):
            env.set_wrapper_attr(name, value)

    def close(self) -> None:
        for env in self.envs:
            env.close()

    def _step_one(self, k: int, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        env = self.envs[k]
        if self._is_over[k]:
            observation, info = env.reset()
            return observation, 0.0, False, False, info
        observation, reward, terminated, truncated, info = env.step(action)
        if (terminated or truncated) and self._mode == AutoresetMode.SAME_STEP:
            last, final_info = observation, info
            observation, info = env.reset()
            info = {**info, "final_obs": last, "final_info": final_info}
        return observation, float(reward), terminated, truncated, info


class _Local:
    """Worlds in the process of the caller."""

    def __init__(self, make: Callable[[], Env], count: int, mode: AutoresetMode) -> None:
        self.worlds = _Worlds(make, count, mode)

    def begin(self, method: str, arguments: tuple[Any, ...]) -> None:
        self._result = getattr(self.worlds, method)(*arguments)

    def result(self) -> Any:
        return self._result

    def end(self, deadline: float) -> Any:
        return self._result

    def abandon(self) -> None:
        pass


class _Remote:
    """Worlds in a process of their own, which ends with this object, or with the caller's process.

    A process that has died, or was abandoned, is started again by the next `reset` or `restore`.
    """

    def __init__(self, make: Callable[[], Env], count: int, mode: AutoresetMode) -> None:
        self._arguments = CloudpickleWrapper(make), count, mode
        self._start()

    def _start(self) -> None:
        context = get_context()
        self._connection, end = context.Pipe()
        self._process = context.Process(target=_serve, args=(end, self._connection, *self._arguments), daemon=True)
        self._process.start()
        end.close()
        self._stop = weakref.finalize(self, _stop, self._connection, self._process, os.getpid())

    def begin(self, method: str, arguments: tuple[Any, ...]) -> None:
        if not self._stop.alive and method in ("reset", "restore"):
            self._start()
        if self._stop.alive:
            request = cloudpickle.dumps((method, arguments))
            with suppress(ConnectionError):  # the process has died, which `result` says
                self._connection.send_bytes(request)

    def result(self) -> Any:
        """The answer to the last request; an exception if there was one, or if the process has died."""
        if not self._stop.alive:
            return RuntimeError(
                "the processes of the environments were ended by an error or an interrupt; call reset()"
            )
        try:
            return self._connection.recv()
        except (EOFError, OSError):
            self._process.join(1.0)
            if self._process.exitcode is None:  # another error, such as that of a signal
                raise
            self.abandon()
            return RuntimeError(f"a process of environments has died with exit code {self._process.exitcode}")

    def end(self, deadline: float) -> Any:
        """The answer to the last request, after which the process is ended."""
        result = None
        if self._stop.alive and self._process.exitcode is None:
            if self._connection.poll(max(deadline - time.monotonic(), 0.0)):
                result = self.result()
            else:
                result = TimeoutError(f"a process of environments did not close within {_PATIENCE:g} s and was ended")
        self.abandon()
        return result

    def abandon(self) -> None:
        """End the process, with the recordings of its episodes if it has not closed them yet."""
        self._stop()


def _stop(connection: Connection, process: BaseProcess, owner: int) -> None:
    """End a process of environments; it closes them first, unless it takes long."""
    if os.getpid() == owner:  # not in a process that was forked from it
        process.terminate()
        process.join(_PATIENCE)
        process.kill()
        process.join()
        connection.close()


def _serve(
    connection: Connection, end_of_caller: Connection, make: Callable[[], Env], count: int, mode: AutoresetMode
) -> None:
    """Answer the requests of `_Remote`; an exception is an answer."""
    end_of_caller.close()  # an open copy would hide that the caller has ended
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the caller
    is_busy = is_ended = False

    def end(number: int, frame: Any) -> None:
        nonlocal is_ended
        is_ended = True
        if not is_busy:  # an exception within a step would look like an error of the episode
            sys.exit()

    signal.signal(signal.SIGTERM, end)
    worlds = None
    try:
        while not is_ended:
            method, arguments = connection.recv()
            is_busy = True
            try:
                worlds = worlds or _Worlds(make, count, mode)
                answer = getattr(worlds, method)(*arguments)
            except Exception as error:
                answer = _portable(error)
            is_busy = False
            try:
                reply = pickle.dumps(answer)
            except Exception as error:  # whatever the classes of the answer do
                message = f"the result of {method} cannot be sent between processes: {described(error)}"
                reply = pickle.dumps(TypeError(message))
            connection.send_bytes(reply)
    except (EOFError, ConnectionError):  # the caller has ended
        pass
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_IGN)  # the recordings are being written
        if worlds is not None:
            worlds.close()


def _portable(error: Exception) -> Exception:
    """An exception that can be sent to another process, with its traceback as a note."""
    text = "".join(traceback.format_exception(error))
    copy = error
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:  # whatever its class does
        copy = RuntimeError(described(error))
    copy.add_note(f"in a process of environments:\n{text}")
    return copy


def _raise_first(results: list[Any]) -> None:
    """Raise the first exception among results."""
    for result in results:
        if isinstance(result, BaseException):
            raise result


def _batch(observations: list[Any]) -> Any:
    """Observations as one, in new arrays."""
    if isinstance(observations[0], dict):
        return {name: np.stack([observation[name] for observation in observations]) for name in observations[0]}
    return np.stack(observations)


def _joined(batches: list[Any]) -> Any:
    """Batches of observations or numbers as one."""
    if len(batches) == 1:
        return batches[0]
    if isinstance(batches[0], dict):
        return {name: np.concatenate([batch[name] for batch in batches]) for name in batches[0]}
    return np.concatenate(batches)
