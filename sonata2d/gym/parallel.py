"""`SocialNavParallelEnv`: an environment of PettingZoo, in which every robot of a scene is an agent."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import partial
from pathlib import Path
from typing import Any, Literal

import gymnasium
from gymnasium import spaces
from numpy.typing import NDArray

from ..agents.controllers.base import External
from ..core.devices import ImageRequest
from ..core.geometry import Twist
from ..core.snapshot import Outcome, Snapshot
from ..core.wording import shown
from ..scenegen.generator import generate
from ..scenegen.scenario.config import ScenarioConfig
from ..scenegen.scenario.load import scenario_of
from ..sim.episode import Episode
from .env import DEFAULT_SIZE, RenderMode, action_space_of, action_twist, check_numbers, first_scene, picture_request
from .observation import Encoder, Order, Sizes
from .parts import Observation
from .recording import FolderRecorder, recording_folder
from .rewards import Reward, checked_reward, reward_of

try:
    from pettingzoo import ParallelEnv
except ModuleNotFoundError as error:
    raise ModuleNotFoundError(
        "SocialNavParallelEnv needs PettingZoo; pip install 'sonata2d[pettingzoo]'", name="pettingzoo"
    ) from error

Action = NDArray[Any]


class SocialNavParallelEnv(ParallelEnv[str, Observation, Action]):  # type: ignore[misc]  # it has no types
    """Several robots drive to their goals among pedestrians; each one is an agent, `robot_0`, `robot_1` and so on.

    Actions and observations of an agent are those of `SocialNavEnv`, in the frame of its robot; it observes the other
    robots as people that walk. An agent terminates when its robot has reached its goal: the robot stands there until
    the episode ends for all, when the last one has arrived, at the time limit, or at a contact if `rules.ends_on` of
    the scenario contains it.

    Args:
        scenario: name of a preset, path of a scenario file, or settings; all its robots are agents.
        settings, reward, sizes, order, parts, record, render_size, view: as for `SocialNavEnv`; each agent gets a
            reward object of its own if the reward is a name.
        render_mode: `rgb_array`, or `human`, which shows a window.

    Raises:
        ConfigError: there is no such scenario, or its settings are invalid.
        RecordError: the folder of the recordings is a data set.
        TypeError, ValueError: another argument is invalid.

    Attributes:
        possible_agents: names of all agents, in the order of `Scene.robot_ids`.
        agents: names of those that have not terminated.
        config: settings of the scenario.

    >>> from sonata2d.gym import SocialNavParallelEnv
    >>> env = SocialNavParallelEnv("sonata-2020", settings={"robots": 3})
    >>> observations, infos = env.reset(seed=1)
    >>> actions = {agent: env.action_space(agent).sample() for agent in env.agents}
    >>> observations, rewards, terminations, truncations, infos = env.step(actions)
    >>> sorted(rewards)
    ['robot_0', 'robot_1', 'robot_2']
    """

    metadata: dict[str, Any] = {  # noqa: RUF012  PettingZoo declares it so
        "name": "sonata2d",
        "render_modes": ["human", "rgb_array"],
        "is_parallelizable": True,
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
        record: str | Path | None = None,
        render_mode: RenderMode | None = None,
        render_size: tuple[int, int] = DEFAULT_SIZE,
        view: Literal["top", "follow"] = "top",
    ) -> None:
        config = scenario_of(scenario)
        self.config = config.changed(**settings) if settings else config
        self.metadata = {**self.metadata, "render_fps": max(round(1.0 / self.config.rules.dt), 1)}
        self._robots = [self.config.robot, *(robot for robot, _, _ in self.config.other_tasks)]
        self.possible_agents = [f"robot_{k}" for k in range(len(self._robots))]
        self.agents: list[str] = []
        numbers = Sizes.of(self.config).changed(dict(sizes or {}))
        parts = (parts,) if isinstance(parts, str) else tuple(parts)
        self._encoders = {agent: Encoder(numbers, order, parts) for agent in self.possible_agents}
        robots = zip(self.possible_agents, self._robots, strict=True)
        self.action_spaces: dict[str, spaces.Space[Any]] = {agent: action_space_of(robot) for agent, robot in robots}
        self.observation_spaces = {agent: encoder.space for agent, encoder in self._encoders.items()}
        self._rewards = {agent: reward_of(reward) for agent in self.possible_agents}
        self.render_mode = render_mode
        self._request: ImageRequest = picture_request(self.metadata["render_modes"], render_mode, render_size, view)
        self._folder = None if record is None else recording_folder(record)
        self._random = gymnasium.utils.seeding.np_random(None)[0]
        self._seed, self._number = -1, -1
        self._episode: Episode | None = None
        self._current: Snapshot | None = None
        self._renderer: Any = None

    def observation_space(self, agent: str) -> spaces.Space[Any]:
        """The space of the observations of an agent."""
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> spaces.Space[Any]:
        """The space of the actions of an agent."""
        return self.action_spaces[agent]

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Observation], dict[str, dict[str, Any]]]:
        """Begin the next episode.

        Args:
            seed: of a data set, whose first episode begins. None: the next episode of the present seed, or the first
                episode of a random seed if no seed was given before.
            options: `{"episode": k}` selects the k-th episode of the seed instead.

        Returns:
            Observations and infos by agent; the infos have `seed` and `episode_number`.

        Raises:
            ValueError: a number is out of range.
            SceneError: a hundred scenes in a row have no layout.
        """
        options = options or {}
        if unknown := sorted(set(options) - {"episode"}):  # no error: PettingZoo's API test gives one
            gymnasium.logger.warn(f"reset knows the option 'episode' only; {unknown[0]!r} is ignored")
        check_numbers(seed, options.get("episode"))
        self._finish("the environment was reset")
        if seed is not None or self._seed < 0:
            self._seed, self._number = int(self._random.integers(2**31)) if seed is None else int(seed), -1
        number = int(options.get("episode", self._number + 1))
        scene = first_scene(partial(generate, self.config, self._seed), number)
        self._number, self.agents = scene.episode, [*self.possible_agents]
        observers = () if self._folder is None else (FolderRecorder(self._folder),)
        self._episode = Episode(scene, others=[External() for _ in scene.robots], observers=observers)
        self._current = self._episode.observe()
        for agent, robot_id in zip(self.agents, scene.robot_ids, strict=True):
            self._encoders[agent].reset(scene.seen_by(robot_id))
        if self.render_mode == "human":
            self.render()
        info = {"seed": self._seed, "episode_number": self._number}
        return self._observations(), {agent: dict(info) for agent in self.agents}

    def step(
        self, actions: dict[str, Action]
    ) -> tuple[dict[str, Observation], dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]]:
        """Drive for one tick.

        Args:
            actions: by agent, of all `agents`; see `SocialNavEnv`.

        Returns:
            Observations, rewards, terminations, truncations and infos of the agents that had not terminated before. The
            last info of an agent has `outcome`, `reason` and `is_success`.

        Raises:
            ResetNeeded: all agents have terminated, or `reset` was not called.
            KeyError: an agent has no action, or there is no such agent.
            ControllerError, TypeError, ValueError: an action is invalid, or a reward is not a finite number.
        """
        episode, before = self._episode, self._current
        if episode is None or before is None or not self.agents:
            raise gymnasium.error.ResetNeeded("the episode is over, or has not begun; call reset()")
        if not isinstance(actions, Mapping) or not actions.keys() <= {*self.possible_agents}:
            names = ", ".join(self.possible_agents)
            raise KeyError(f"step takes actions by the names of agents, {names}; got {shown([*actions])}")
        if missing := [agent for agent in self.agents if agent not in actions]:
            raise KeyError(f"step needs an action of each agent, {missing[0]} has none; got {shown(sorted(actions))}")
        first, *others = (self._twist(k, actions) for k in range(len(self.possible_agents)))
        episode.apply(first, others=others)
        self._current = after = episode.observe()
        rewards, terminations, truncations = dict[str, float](), dict[str, bool](), dict[str, bool]()
        infos: dict[str, dict[str, Any]] = {}
        for agent in self.agents:
            k = self.possible_agents.index(agent)
            outcome = self._outcome_of(k, after)
            id = after.scene.robot_ids[k]
            earlier, later = (snapshot.seen_by(id).with_robots_as_people() for snapshot in (before, after))
            rewards[agent] = checked_reward(self._rewards[agent](earlier, later, outcome))
            status = None if outcome is None else outcome.status
            terminations[agent], truncations[agent] = status in ("goal", "contact"), status == "timeout"
            infos[agent] = {}
            if outcome is not None:
                infos[agent] = {"outcome": status, "reason": outcome.reason, "is_success": status == "goal"}
        observations = self._observations()
        self.agents = [agent for agent in self.agents if not terminations[agent] and not truncations[agent]]
        if self.render_mode == "human":
            self.render()
        return observations, rewards, terminations, truncations, infos

    def _outcome_of(self, k: int, after: Snapshot) -> Outcome | None:
        """The outcome of agent k: its own goal, or the end of the episode."""
        assert self._episode is not None
        if self._episode.arrivals[k] is not None:
            return Outcome("goal", "the robot has reached its goal", after.tick, after.time)
        return self._episode.outcome

    def _twist(self, k: int, actions: dict[str, Action]) -> Twist:
        """The command of agent k; 0 if it has terminated."""
        agent = self.possible_agents[k]
        if agent not in self.agents:
            return Twist()
        return action_twist(actions[agent], self._robots[k].limits, self.action_spaces[agent].shape)

    def _observations(self) -> dict[str, Observation]:
        assert self._current is not None
        ids = dict(zip(self.possible_agents, self._current.scene.robot_ids, strict=True))
        return {agent: self._encoders[agent].encode(self._current.seen_by(ids[agent])) for agent in self.agents}

    def render(self) -> Any:
        """Draw the present state: (height, width, 3) of uint8, or None in a window."""
        if self.render_mode is None or self._current is None:
            gymnasium.logger.warn("render() was called without a render_mode or before reset()")
            return None
        if self._renderer is None:
            from .rendering import Renderer

            self._renderer = Renderer(self.render_mode, self._request, self.config.rules.dt)
        return self._renderer.render(self._current)

    def close(self) -> None:
        """Close the window; an episode that was not over is recorded as stopped."""
        self._finish("the environment was closed")
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None

    def _finish(self, reason: str) -> None:
        """End the present episode if it is not over, so that its recording is kept."""
        if self._episode is not None and not self._episode.is_over and self._episode.past:
            self._episode.end("stopped", reason)
        self._episode = self._current = None
        self.agents = []
