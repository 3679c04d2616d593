"""Observations and actions for imitation: of a controller in the environment, and of recorded episodes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import astuple, dataclass
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from ..agents.controllers.base import Controller, Regenerate, Stop, require_controller
from ..core.geometry import Twist
from ..errors import ControllerError
from ..record.record import EpisodeRecord
from .env import Env, wrappers_of
from .pipeline import Pipeline
from .wrappers import DiscreteActions, stacked

_NOISE_TIME = 0.5  # s
_ROUNDING = 1e-4  # m/s and rad/s, by which the command of an action may differ from the controller's


@dataclass(frozen=True, eq=False)
class Demonstration:
    """One episode of T steps.

    Attributes:
        observations: T + 1, of the wrapped environment; the last one has no action.
        actions: (T, ...).
        rewards: (T,).
        terminated, truncated: how it ended; both are False if the controller ended it.
        info: of the last step.
    """

    observations: list[Any]
    actions: NDArray[Any]
    rewards: NDArray[np.float64]
    terminated: bool
    truncated: bool
    info: dict[str, Any]


def demonstrate(
    env: Env, controller: Controller, *, seed: int, episodes: int, noise: float = 0.0
) -> list[Demonstration]:
    """Let a controller drive in an environment.

    Args:
        env: in wrappers or not.
        controller: e.g. `sonata2d.SocialPlanner()`.
        seed: of the first reset; the scenes are the scenes of a data set with this seed.
        episodes: their number.
        noise: standard deviation of the noise in the executed actions, which is constant for half a second each; the
            recorded actions have none. So learners observe how the controller corrects errors.

    Returns:
        The episodes.

    Raises:
        ValueError: there is noise, and the actions are not numbers in a box.
        TypeError: a wrapper of actions is not `DiscreteActions`, or the controller is not an object.
        ControllerError: the controller requests an image, or has sensors.

    Source: noise in demonstrations: M. Laskey et al., CoRL 2017 (DART).
    """
    controller = require_controller(controller)
    if controller.image is not None:
        raise ControllerError(f"{type(controller).__name__} requests a camera image, which demonstrations do not draw")
    if controller.sensors or controller.partial:
        raise ControllerError(f"{type(controller).__name__} has sensors, which demonstrations do not measure")
    if noise and not isinstance(env.action_space, gymnasium.spaces.Box):
        raise ValueError(f"noise is added to actions in a Box only, got {env.action_space}")
    demonstrations, pipeline = [], Pipeline(env)
    for k in range(episodes):
        observation, info = env.reset(seed=seed if k == 0 else None)
        controller.reset(pipeline.base.scene)
        observations: list[Any] = [observation]
        actions: list[Any] = []
        rewards: list[float] = []
        random, added = np.random.default_rng([seed, k]), 0.0
        interval = max(round(_NOISE_TIME / pipeline.base.scene.rules.dt), 1)
        terminated = truncated = False
        while not (terminated or truncated):
            answer = controller.act(pipeline.base.snapshot)
            if isinstance(answer, (Stop, Regenerate)):
                break
            action = _nearest_action(env, pipeline, answer)
            executed_action = action
            if noise:
                if len(actions) % interval == 0:
                    added = noise * random.standard_normal(action.shape)
                executed_action = np.clip(action + added, -1.0, 1.0)
            observation, reward, terminated, truncated, info = env.step(executed_action)
            executed = pipeline.twist(executed_action)
            if not np.allclose(astuple(executed), astuple(answer), rtol=0.0, atol=_ROUNDING):
                controller.command_overridden(executed)
            observations.append(observation)
            actions.append(action)
            rewards.append(float(reward))
        demonstrations.append(
            Demonstration(observations, np.array(actions), np.array(rewards), terminated, truncated, dict(info))
        )
    return demonstrations


def _nearest_action(env: Env, pipeline: Pipeline, twist: Twist) -> Any:
    """The action of an environment that is nearest to a command."""
    action = pipeline.base.action_of(twist)
    for wrapper in wrappers_of(env):
        if isinstance(wrapper, DiscreteActions):
            return wrapper.nearest(action)
        if isinstance(wrapper, gymnasium.ActionWrapper):
            raise TypeError(f"{type(wrapper).__name__} cannot be inverted: the action for a command is not known")
    return action


class EnvSamples:
    """Makes the observation and the action of each frame of an episode, for `Dataset.stream`.

    The observation is an observation of the environment and its wrappers, such as `Flat`; the action is the one that is
    nearest to the recorded command.

    Args:
        env: `SocialNavEnv`, in wrappers or not, with the scenario of the data set; its episodes are not run.

    Raises:
        TypeError: the environment is not one of sonata2d, or a wrapper of another package is stateful.

    Example:
        >>> import gymnasium
        >>> import sonata2d as s2
        >>> from sonata2d.gym import EnvSamples, Flat
        >>> env = Flat(gymnasium.make("sonata2d/SocialNav-v0"))
        >>> observation, action = next(iter(s2.Dataset("demo").stream(EnvSamples(env))))
        >>> action.shape
        (3,)
    """

    def __init__(self, env: Env) -> None:
        self._env, self._pipeline = env, Pipeline(env)

    def __call__(self, record: EpisodeRecord) -> Iterator[tuple[Any, Any]]:
        """The observation and the action of each frame, in order."""
        self._pipeline.begin()
        record = record.until_arrival()
        for tick in range(len(record)):
            twist = Twist(*record.command[tick].tolist())
            yield self._pipeline.observe(record.snapshot(tick)), _nearest_action(self._env, self._pipeline, twist)


def save_minari(name: str, demonstrations: list[Demonstration], env: Env, **about: Any) -> Any:
    """Save demonstrations as a data set of Minari.

    Args:
        name: of the data set, e.g. `sonata2d/lively/expert-v0`.
        demonstrations: of the environment; demonstrations without a step are left out.
        env: in which they were recorded; if `gymnasium.make` made it with plain data as arguments, then
            `MinariDataset.recover_environment` makes it again.
        about: further arguments of `minari.create_dataset_from_buffers`, e.g. `author`, `description`.

    Returns:
        The `minari.MinariDataset`.

    Raises:
        ModuleNotFoundError: Minari or h5py is not installed.
        ValueError: there is no step, or the environment has other observations.
    """
    try:
        import minari

        if about.get("data_format", "hdf5") == "hdf5":
            import h5py  # noqa: F401  without it Minari fails after it has taken the name of the data set
        from minari.data_collector import EpisodeBuffer
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError("save_minari needs Minari; pip install 'minari[hdf5]'", name=error.name) from error
    buffers, demonstrations = [], [item for item in demonstrations if len(item.actions)]
    if not demonstrations:
        raise ValueError("the demonstrations have no step, so there is nothing to save")
    if not env.observation_space.contains(demonstrations[0].observations[0]):
        raise ValueError(
            "the demonstrations have other observations than the environment; give the one of `demonstrate`"
        )
    for k, demonstration in enumerate(demonstrations):
        count = len(demonstration.actions)
        terminations, truncations = np.zeros(count, dtype=bool), np.zeros(count, dtype=bool)
        terminations[-1] = demonstration.terminated
        truncations[-1] = demonstration.truncated or not demonstration.terminated
        buffers.append(
            EpisodeBuffer(
                id=k, observations=stacked(env.observation_space, demonstration.observations),
                actions=demonstration.actions, rewards=list(demonstration.rewards),
                terminations=list(terminations), truncations=list(truncations),
            )
        )  # fmt: skip
    known = {"env": env} if _can_be_made(env) else {}
    return minari.create_dataset_from_buffers(
        name, buffers, observation_space=env.observation_space, action_space=env.action_space, **(known | about)
    )


def _can_be_made(env: Env) -> bool:
    """Whether an environment is one of `gymnasium.make` whose arguments are plain data, which a data set can hold."""
    try:
        return env.spec is not None and bool(env.spec.to_json())
    except (TypeError, ValueError):
        return False
