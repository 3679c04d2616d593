"""`SocialNavEnv`: an episode as a Gymnasium environment."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any, Literal, SupportsFloat

import gymnasium
import numpy as np
import orjson
from gymnasium import spaces
from gymnasium.utils import EzPickle
from numpy.typing import NDArray

from ..core.devices import ImageRequest
from ..core.entities import Limits
from ..core.geometry import Twist
from ..core.scene import Scene
from ..core.snapshot import Outcome, Snapshot
from ..core.wording import shown
from ..errors import ControllerError, SceneError
from ..metrics.catalogue import NEEDING_RERUN, select_metrics
from ..metrics.definition import Metric
from ..metrics.measurement import measure
from ..record.record import record_from_document
from ..record.recorder import EpisodeRecorder
from ..scenegen.generator import generate
from ..scenegen.scenario.config import ScenarioConfig
from ..scenegen.scenario.load import scenario_of
from ..scenegen.scenario.sections import RobotConfig
from ..sim.episode import Episode
from .observation import Encoder, Order, Sizes
from .parts import Observation
from .recording import FolderRecorder, recording_folder
from .rewards import Reward, checked_reward, reward_of
from .state import MAX_SEED, EnvState, checked_state

Env = gymnasium.Env[Any, Any]
RenderMode = Literal["human", "rgb_array", "rgb_array_list"]
_LAYOUTS = 100  # episodes that `reset` tries if their scenes have no layout
DEFAULT_SIZE, _MAXIMUM_SIDE = (640, 640), 8192  # px


class SocialNavEnv(gymnasium.Env[Observation, NDArray[np.float32]], EzPickle):
    """A robot drives to its goal among pedestrians.

    **Action**: fractions of the limits of the robot's drive, in [-1, 1]: forward (backward if negative), left, and turn
    (counter-clockwise); a robot that does not move sideways has no second one.

    **Observation**: a dictionary of arrays in the robot's frame, x ahead and y left, see `docs/gym.md`. Rows of absent
    entities are 0, and so is their mask.

    **End**: `terminated` at the goal, and at a contact if `rules.ends_on` of the scenario contains it; `truncated` at
    `rules.time_limit`. The last `info` has `outcome`, `reason` and `is_success`.

    **Seeds**: after `reset(seed=s)` the scenes are the scenes of a data set with the seed s, in order.
    `reset(options={"episode": k})` starts with its k-th scene.

    Args:
        scenario: name of a preset, path of a scenario file, or settings.
        settings: settings of the scenario to change, e.g. `{"wandering": 3, "rules": {"time_limit": 20}}`; the other
            settings of a section stay.
        reward: `sparse`, `distance`, `crowdnav`, `dsrnn`, `socnavgym`, or a function of the snapshots before and after
            the step and of the outcome; see `rewards`.
        sizes: numbers of rows of the observation by name (`humans`, `objects`, `walls`, `interactions`), instead of the
            largest numbers of the scenario.
        order: of the rows: `nearest` first, or as in the `scene`, in which an entity keeps its row.
        parts: names of further parts of the observation; see `sonata2d.gym.ObservationPart`.
        metrics: names of metrics of `sonata2d.metrics` that the last `info` contains; True: all but those that need a
            second run of the episode, without a robot.
        record: folder in which every episode is recorded when it ends; existing files stay.
        render_mode: `human` shows a window, `rgb_array` and `rgb_array_list` return pictures.
        render_size: width and height of pictures, px.
        view: of pictures: `top`, the whole room, or `follow`, behind the robot.

    Raises:
        ConfigError: there is no such scenario, or its settings are invalid.
        RecordError: the folder of the recordings is a data set.
        TypeError, ValueError: another argument is invalid.

    Attributes:
        config: settings of the scenario.
        entities: the largest numbers of entities in its scenes.
        encoder: writes the observations.

    >>> import gymnasium, sonata2d.gym
    >>> env = gymnasium.make("sonata2d/SocialNav-v0", scenario="sonata-2020")
    >>> observation, info = env.reset(seed=1)
    >>> observation, reward, terminated, truncated, info = env.step(env.action_space.sample())
    >>> terminated, truncated
    (False, False)
    """

    metadata: dict[str, Any] = {  # noqa: RUF012  Gymnasium declares it so
        "render_modes": ["human", "rgb_array", "rgb_array_list"],
        "render_fps": 10,
    }

    def __init__(
        self,
        scenario: str | Path | ScenarioConfig = "sonata-2020",
        *,
        settings: Mapping[str, Any] | None = None,
        reward: str | Reward = "distance",
        sizes: Mapping[str, int] | None = None,
        order: Order = "nearest",
        parts: Iterable[str] = (),
        metrics: Iterable[str] | str | bool = False,
        record: str | Path | None = None,
        render_mode: RenderMode | None = None,
        render_size: tuple[int, int] = DEFAULT_SIZE,
        view: Literal["top", "follow"] = "top",
    ) -> None:
        parts = (parts,) if isinstance(parts, str) else tuple(parts)
        EzPickle.__init__(
            self, scenario, settings=settings, reward=reward, sizes=sizes, order=order, parts=parts, metrics=metrics,
            record=record, render_mode=render_mode, render_size=render_size, view=view,
        )  # fmt: skip
        request = picture_request(self.metadata["render_modes"], render_mode, render_size, view)
        for name, value, example in (("settings", settings, "wandering"), ("sizes", sizes, "humans")):
            if not isinstance(value, Mapping | None):
                raise TypeError(f"{name} must be a dictionary, e.g. {{{example!r}: 3}}, got {value!r}")
        config = scenario_of(scenario)
        self.config = config.changed(**settings) if settings else config
        self.metadata = {**self.metadata, "render_fps": max(round(1.0 / self.config.rules.dt), 1)}
        self.entities = Sizes.of(self.config)
        self.encoder = Encoder(self.entities.changed(dict(sizes or {})), order, parts)
        self.observation_space: spaces.Space[Any] = self.encoder.space
        self.action_space: spaces.Space[Any] = action_space_of(self.config.robot)
        self.render_mode, self._request = render_mode, request
        self._reward = reward_of(reward)
        self._metrics = _metrics_of(metrics)
        self._folder = None if record is None else recording_folder(record)
        self._seed: int | None = None
        self._number = -1  # of the episode
        self._scene: Scene | None = None  # that was generated last
        self._episode: Episode | None = None
        self._recorder: EpisodeRecorder | None = None
        self._current: Snapshot | None = None
        self._pictured: Snapshot | None = None  # the same with its other robots
        self._renderer: Any = None

    @property
    def snapshot(self) -> Snapshot:
        """The state that was observed last, with the other robots of a scene as people.

        Raises:
            ResetNeeded: `reset` was not called.
        """
        if self._current is None:
            raise gymnasium.error.ResetNeeded("call reset() first, or again after close()")
        return self._current

    @property
    def scene(self) -> Scene:
        """The scene of the present episode."""
        return self.snapshot.scene

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin the next episode.

        Args:
            seed: of a data set, whose first episode begins. None: the next episode of the present seed, or the first
                episode of a random seed if no seed was given before.
            options: `{"episode": k}` selects the k-th episode of the seed instead. `{"state": ...}` returns to a state,
                see `set_state`; in wrappers with a memory, use `sonata2d.gym.restore`.

        Returns:
            Observation and info, which has `seed` and `episode_number`.

        Raises:
            ValueError: an option is unknown, a number is out of range, or a state does not fit.
            SceneError: a hundred scenes in a row have no layout.
        """
        options = options or {}
        if unknown := sorted(set(options) - {"episode", "state", "watch"}):
            raise ValueError(f"reset knows the options 'episode' and 'state', got {unknown[0]!r}")
        if "state" in options:  # so that Gymnasium's wrappers notice a restored state as the beginning of an episode
            if seed is not None or "episode" in options:
                raise ValueError("a state contains seed and episode; give reset either a state, or these")
            observation = self.set_state(options["state"], options.get("watch"))
            return observation, {"seed": self._seed, "episode_number": self._number}
        number = options.get("episode")
        check_numbers(seed, number)
        super().reset(seed=None if seed is None else int(seed))
        self._finish("the environment was reset")
        if seed is not None:
            self._seed, self._number = int(seed), -1
        elif self._seed is None:  # the first reset without a seed; later ones continue the seed's episodes
            self._seed = int(self.np_random.integers(2**31))
        self._number = self._number + 1 if number is None else int(number)
        try:
            scene = first_scene(partial(self._generate, self._seed), self._number)
        except SceneError:
            self._number += _LAYOUTS - 1  # the next reset tries others
            raise
        self._number = scene.episode
        self._start(scene)
        self._draw(is_first=True)
        return self.encoder.encode(self.snapshot), {"seed": self._seed, "episode_number": self._number}

    def step(self, action: NDArray[np.floating[Any]]) -> tuple[Observation, SupportsFloat, bool, bool, dict[str, Any]]:
        """Drive for one tick.

        Args:
            action: in [-1, 1], see the class; numbers beyond are clipped.

        Raises:
            ResetNeeded: the episode is over, or `reset` was not called.
            ControllerError: a number of the action is not finite.
            TypeError: the action holds something else than real numbers.
            ValueError: the action has another shape, or the reward is not a finite number.
        """
        before, episode = self.snapshot, self._episode
        assert episode is not None
        if episode.is_over:
            raise gymnasium.error.ResetNeeded("the episode is over; call reset()")
        episode.apply(self.twist_of(action))
        after = self._look()
        outcome = episode.outcome
        if episode.arrivals[0] is not None and (outcome is None or outcome.status == "timeout"):  # of several robots
            outcome = Outcome("goal", "the robot has reached its goal", after.tick, after.time)
            episode.end("stopped", outcome.reason)  # unless it is over
        reward = checked_reward(self._reward(before, after, outcome))
        info: dict[str, Any] = {}
        if outcome is not None:
            info = {"outcome": outcome.status, "reason": outcome.reason, "is_success": outcome.status == "goal"}
            if self._metrics:
                info["metrics"] = self._measure()
        self._draw()
        status = None if outcome is None else outcome.status
        return self.encoder.encode(after), reward, status in ("goal", "contact"), status == "timeout", info

    def twist_of(self, action: NDArray[np.floating[Any]]) -> Twist:
        """The command of an action; see `step` for its errors."""
        # A policy was trained with the limits of the environment, and drives with them in scenes with other limits too.
        return action_twist(action, self.config.robot.limits, self.action_space.shape)

    def action_of(self, twist: Twist) -> NDArray[np.float32]:
        """The action of a command, e.g. of an expert; clipped to [-1, 1]."""
        limits = self.config.robot.limits
        fractions = [twist.vx / (limits.ahead if twist.vx > 0.0 else limits.back), twist.omega / limits.turn]
        if self.action_space.shape == (3,):
            fractions.insert(1, twist.vy / limits.sideways)
        return np.clip(np.array(fractions, dtype=np.float32), -1.0, 1.0)

    def get_state(self) -> dict[str, Any]:
        """The state of the environment in the middle of an episode, as plain data for JSON.

        It contains the seed and all commands of the episode; `set_state` runs them again.
        """
        episode = self._episode
        if episode is None:
            raise gymnasium.error.ResetNeeded("there is no episode; call reset() first")
        state = EnvState(
            settings=self.config.settings(),
            seed=episode.scene.seed,
            episode=episode.scene.episode,
            commands=[(twist.vx, twist.vy, twist.omega) for twist in (tick.command for tick in episode.past)],
            is_over=episode.is_over,
            np_random=json.dumps(self.np_random.bit_generator.state),
        )
        return state.model_dump()

    def __getstate__(self) -> dict[str, Any]:
        """Arguments and present state, for `copy` and `pickle`; a copy continues the episode without recording it."""
        names = ("_seed", "_number", "_np_random", "_np_random_seed", "action_space", "spec")
        state = None if self._episode is None else self.get_state()
        return {**super().__getstate__(), "attributes": {name: getattr(self, name) for name in names}, "state": state}

    def __setstate__(self, state: dict[str, Any]) -> None:
        super().__setstate__(state)
        vars(self).update(state["attributes"])
        if state["state"] is not None:
            self._restore(checked_state(state["state"], self.config), is_recorded=False)

    def set_state(self, state: Mapping[str, Any], watch: Callable[[Observation], object] | None = None) -> Observation:
        """Return to a state; the following steps give the same bits as they would have given then.

        The present episode is not recorded; the recording of the restored episode contains their common commands.
        `sonata2d.gym.restore` restores an environment in wrappers of observations.

        Args:
            state: of `get_state`, of an environment with the same scenario.
            watch: called with each observation of the episode before the last one.

        Returns:
            The observation.

        Raises:
            ValueError: it is not a state of this version, or belongs to another scenario.
        """
        checked = checked_state(state, self.config)
        # an episode that is over was recorded when it ended
        self._restore(checked, is_recorded=not checked.is_over, watch=watch)
        self._draw(is_first=True)
        return self.encoder.encode(self.snapshot)

    def _restore(
        self, state: EnvState, *, is_recorded: bool, watch: Callable[[Observation], object] | None = None
    ) -> None:
        """Run the commands of a state again."""
        scene = self._generate(state.seed, state.episode)
        self.abandon()
        self._seed, self._number = state.seed, state.episode
        self.np_random.bit_generator.state = json.loads(state.np_random)
        self._start(scene, is_recorded=is_recorded)
        episode = self._episode
        assert episode is not None
        for command in state.commands:
            if watch is not None:
                watch(self.encoder.encode(self.snapshot))
            episode.apply(Twist(*command))
            self._look()

    def observe(self, snapshot: Snapshot) -> Observation:
        """The observation of a snapshot, which becomes the present one; for wrappers and policies."""
        if self._current is None or not self._current.scene.differs_in_goal_only(snapshot.scene):
            self.encoder.reset(snapshot.scene)
        self._current = self._pictured = snapshot
        return self.encoder.encode(snapshot)

    def render(self) -> Any:
        """Draw the present state.

        Returns:
            `rgb_array`: (height, width, 3) of uint8; `rgb_array_list`: the pictures since the last call; else None.
        """
        if self.render_mode is None:
            gymnasium.logger.warn("render() was called without a render_mode; give one to gymnasium.make")
            return None
        return self._get_renderer().render(self._pictured or self.snapshot)

    def close(self) -> None:
        """Close the window; an episode that was not over is recorded as stopped."""
        self._finish("the environment was closed")
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None

    def _generate(self, seed: int, number: int) -> Scene:
        """The scene of an episode; the last one is kept, because search returns to it many times."""
        scene = self._scene
        if scene is None or (scene.seed, scene.episode) != (seed, number):
            scene = self._scene = generate(self.config, seed, number)
        return scene

    def abandon(self) -> None:
        """Leave the present episode without recording it."""
        self._episode = self._current = self._pictured = None

    def _start(self, scene: Scene, *, is_recorded: bool = True) -> None:
        """Begin an episode."""
        self._recorder = None
        if self._folder is not None and is_recorded:
            self._recorder = FolderRecorder(self._folder)
        elif self._metrics:
            self._recorder = EpisodeRecorder()
        observers = () if self._recorder is None else (self._recorder,)
        self._episode = Episode(scene, observers=observers)
        self.encoder.reset(self._look().scene)

    def _look(self) -> Snapshot:
        """Observe the present state of the episode."""
        assert self._episode is not None
        self._pictured = self._episode.observe()
        self._current = self._pictured.with_robots_as_people()
        return self._current

    def _draw(self, *, is_first: bool = False) -> None:
        """Show or keep a picture of the present state, if the render mode asks for one of every step."""
        if self.render_mode in ("human", "rgb_array_list"):
            renderer = self._get_renderer()
            if is_first:
                renderer.begin()
            renderer.step(self._pictured or self.snapshot)

    def _finish(self, reason: str) -> None:
        """End the present episode if it is not over, so that its recording is kept."""
        episode = self._episode
        if episode is not None and not episode.is_over and episode.past:
            episode.end("stopped", reason)
        self.abandon()

    def _measure(self) -> dict[str, float | None]:
        """The metrics of the episode that has just ended."""
        assert self._recorder is not None
        record = record_from_document(orjson.loads(self._recorder.document()), Path("episode.json"))
        return measure(record, self._metrics, rerun=False)

    def _get_renderer(self) -> Any:
        """The renderer; pygame is imported only where something is drawn."""
        if self._renderer is None:
            from .rendering import Renderer

            self._renderer = Renderer(self.render_mode, self._request, self.config.rules.dt)
        return self._renderer


def check_numbers(seed: Any, episode: Any) -> None:
    """Check the seed and the option `episode` of `reset`; None is not given.

    Raises:
        ValueError: one is no integer, or out of range.
    """
    for name, value in (("seed", seed), ("the option 'episode'", episode)):
        if value is not None and not (isinstance(value, int | np.integer) and 0 <= value <= MAX_SEED):
            raise ValueError(f"{name} must be an integer from 0 to 2^63 - 1, got {value!r}")


def action_space_of(robot: RobotConfig) -> spaces.Box:
    """The space of the actions of a robot."""
    return spaces.Box(np.float32(-1.0), np.float32(1.0), (3 if robot.moves_sideways else 2,), np.float32)


def action_twist(action: Any, limits: Limits, shape: tuple[int, ...] | None) -> Twist:
    """The command of an action, fractions of the limits; numbers beyond [-1, 1] are clipped.

    Raises:
        ControllerError: a number of the action is not finite.
        TypeError: the action holds something else than real numbers.
        ValueError: the action has another shape.
    """
    if np.shape(action) != shape:
        raise ValueError(f"an action has the shape {shape}, got {shown(action)} of the shape {np.shape(action)}")
    numbers = np.asarray(action)
    if numbers.dtype.kind not in "fiu":
        raise TypeError(f"an action holds real numbers, got {shown(action)}")
    values = [float(value) for value in numbers.tolist()]
    if not all(map(math.isfinite, values)):
        raise ControllerError(f"an action holds finite numbers, got {shown(action)}")
    forward, *sideways, turn = (min(max(value, -1.0), 1.0) for value in values)
    vx = forward * (limits.ahead if forward > 0.0 else limits.back)
    return Twist(vx, sideways[0] * limits.sideways if sideways else 0.0, turn * limits.turn)


def picture_request(
    modes: Sequence[str], mode: str | None, size: tuple[int, int], view: Literal["top", "follow"]
) -> ImageRequest:
    """The pictures that the arguments `render_mode`, `render_size` and `view` ask for.

    Raises:
        ValueError: one of them is invalid.
    """
    if mode is not None and mode not in modes:
        raise ValueError(f"render_mode must be one of {', '.join(modes)}, or None, got {mode!r}")
    if view not in ("top", "follow"):
        raise ValueError(f"view must be 'top' or 'follow', got {view!r}")
    sides = tuple(size) if isinstance(size, Iterable) else ()
    if len(sides) != 2 or not all(isinstance(side, int) and 1 <= side <= _MAXIMUM_SIDE for side in sides):
        raise ValueError(f"render_size must be two integers from 1 to {_MAXIMUM_SIDE}, got {size!r}")
    return ImageRequest(*sides, view=view)


def first_scene(scene_of: Callable[[int], Scene], number: int) -> Scene:
    """The scene of an episode, or of the next one if no layout is found for it.

    Args:
        scene_of: gives the scene of an episode by its number.
        number: of the first episode to try.

    Raises:
        SceneError: a hundred scenes in a row have no layout.
    """
    for tried in range(number, number + _LAYOUTS - 1):
        with suppress(SceneError):
            return scene_of(tried)
    return scene_of(number + _LAYOUTS - 1)


def _metrics_of(chosen: Iterable[str] | str | bool) -> tuple[Metric, ...]:
    """The metrics of the argument `metrics`; a group such as `all` stands for its metrics that need no second run.

    Raises:
        TypeError: it is not a name, several names or a bool.
        ValueError: a metric needs a second run.
    """
    if isinstance(chosen, bool):
        names = ["all"] if chosen else []
    elif isinstance(chosen, Iterable):
        names = [chosen] if isinstance(chosen, str) else list(chosen)
    else:
        raise TypeError(f"metrics must be names of metrics, or True for all of them, got {chosen!r}")
    for name in names:
        if name in NEEDING_RERUN:
            raise ValueError(
                f"{name} needs a second run, without a robot; record episodes and call sonata2d.metrics.measure"
            )
    return tuple(metric for metric in select_metrics(names) if metric.name not in NEEDING_RERUN) if names else ()


def wrappers_of(env: Env) -> Iterator[gymnasium.Wrapper[Any, Any, Any, Any]]:
    """The wrappers of an environment, the outermost first."""
    while isinstance(env, gymnasium.Wrapper):
        yield env
        env = env.env


def base_of(env: Env) -> SocialNavEnv:
    """The environment inside its wrappers.

    Raises:
        TypeError: it is not a `SocialNavEnv`.
    """
    base = env.unwrapped if isinstance(env, gymnasium.Env) else None
    if not isinstance(base, SocialNavEnv):
        raise TypeError(f"the environment must be a SocialNavEnv, in wrappers or not, got {shown(env)}")
    return base
