"""`Worlds`: many worlds that are stepped together, for reinforcement learning."""

from __future__ import annotations

import itertools
import math
import os
from array import array
from collections.abc import Hashable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from ..agents.pedestrians.crowd import Crowd
from ..core.arguments import whole_number
from ..core.compiled.calls import FLAGS, FLOAT, FLOATS, INT, INTS, INTS2, PACKED, address_of
from ..core.compiled.kernel import IS_COMPILED
from ..core.compiled.packing import Packed
from ..core.portable_math import Array, BoolArray, IntArray
from ..core.scene import Scene
from ..core.snapshot import Snapshot
from ..core.wording import counted, shown
from ..errors import ControllerError
from ..sim.episode import Episode
from ..sim.inputs import Inputs
from ..sim.kernel.batch import (
    CLEARANCE,
    CONTACT,
    GOAL,
    GOAL_DISTANCE,
    MEASURED_SIZE,
    RUNNING,
    TIMEOUT,
    WITH_HUMAN,
    WITH_WALL,
    Member,
    observe_member,
    step_member,
    step_members,
)  # fmt: skip
from ..sim.kernel.tick import DONE
from ..sim.member import member_of, provided
from ..sim.world import World
from .observation import Encoder, Order, Sizes
from .parts import Floats32, Observation, Rows
from .recording import FolderRecorder, recording_folder
from .rewards import REWARDS, BuiltIn, Reward, reward_of
from .sight import Arrays, sight_of, write_observation

_KEPT = 512  # worlds that are kept to begin again; one has some 0.3 MB
STATUSES = {RUNNING: None, GOAL: "goal", CONTACT: "contact", TIMEOUT: "timeout"}


class WorldsStep(NamedTuple):
    """Result of `Worlds.step`. Its arrays are written anew by the next step; copy what you keep.

    Args:
        observations: arrays by part, as those of `SocialNavEnv`, with a first axis for the B worlds.
        rewards: (B,).
        outcomes: (B,) of int: 0 while an episode runs; 1 goal, 2 contact, 3 time limit in the step that ends it.
        contacts: (B, 3) of bool, whether the robot touched a human, an object, a wall.
        is_first: (B,) of bool, worlds whose episode began in this step: their action was ignored, their reward is 0.
    """

    observations: Observation
    rewards: Array
    outcomes: IntArray
    contacts: BoolArray
    is_first: BoolArray


class Worlds:
    """Worlds that are stepped together, by one call of compiled code that releases the interpreter's lock.

    A world has the bits of an `Episode` of the same scene and commands. The step after the end of an episode begins the
    next one, with the next of the scenes.

    Args:
        scenes: of the episodes, which are taken in turn, again and again.
        num_worlds: number B of worlds; one for each scene if None.
        reward: name of a reward, or an object of its class; see `sonata2d.gym.rewards`.
        sizes: numbers of rows of the observations, as of `SocialNavEnv`; by default the largest numbers of the scenes.
        order: of the rows, as of `SocialNavEnv`.
        threads: number of threads among which the worlds are divided.
        record: folder in which every episode is recorded when it ends.

    Raises:
        TypeError: a scene, the reward or the pedestrian model is of another kind.
        ValueError: there is no scene, a number is below 1, or the robots have different drives.

    Attributes:
        num_worlds: B.
        action_size: 2 (forward, turn), or 3 for robots that move sideways (forward, left, turn).
        flat: (B, D) of float32, the memory of all parts of floats of the observations, one after another in
            alphabetical order, as of the wrapper `Flat`; `torch.from_numpy(worlds.flat)` shares it.

    >>> from sonata2d import Worlds, generate
    >>> worlds = Worlds([generate("empty", seed) for seed in range(4)])
    >>> worlds.reset()["goal"].shape
    (4, 6)
    >>> step = worlds.step(np.zeros((4, 3)))
    >>> step.rewards.shape, step.outcomes.tolist()
    ((4,), [0, 0, 0, 0])
    """

    def __init__(
        self,
        scenes: Iterable[Scene],
        num_worlds: int | None = None,
        *,
        reward: str | Reward = "distance",
        sizes: Mapping[str, int] | None = None,
        order: Order = "nearest",
        threads: int = 1,
        record: str | Path | None = None,
    ) -> None:
        if isinstance(scenes, str | Scene):
            raise TypeError(f"Worlds needs a list of scenes, such as [generate('lively', seed=1)], got {shown(scenes)}")
        self._scenes = tuple(scenes)
        for scene in self._scenes:
            if not isinstance(scene, Scene):
                raise TypeError(f"Worlds needs scenes, such as generate() returns; got {shown(scene)}")
        if not self._scenes:
            raise ValueError("Worlds needs at least one scene")
        if len({scene.robot.kinematics for scene in self._scenes}) > 1:
            raise ValueError("the robots of all scenes must have the same drive: their actions have the same length")
        count = len(self._scenes) if num_worlds is None else whole_number("num_worlds", num_worlds, 1)
        encoder = Encoder(_sizes_of(self._scenes).changed(dict(sizes or {})), order)
        self._next = 0  # index of the next scene
        size = 3 if self._scenes[0].robot.moves_sideways else 2
        self._set_up(count, encoder, size, reward, threads, record)

    def _set_up(
        self,
        count: int,
        encoder: Encoder,
        action_size: int,
        reward: str | Reward,
        threads: int,
        record: str | Path | None,
    ) -> None:
        """The second half of the constructor, after the origin of the scenes.

        Args:
            count: number of worlds.
            encoder: of the observations.
            action_size: of all robots.
            reward, threads, record: of the constructor.
        """
        self.num_worlds, self.action_size = count, action_size
        self._threads = whole_number("threads", threads, 1)
        function = reward_of(reward)
        if not isinstance(function, BuiltIn):
            raise TypeError(
                f"the reward of many worlds is a name ({', '.join(REWARDS)}) or an object derived from "
                f"rewards.BuiltIn, got {shown(reward)}; SocialNavEnv takes functions of snapshots"
            )
        self._reward = function
        self._folder = None if record is None else recording_folder(record)
        self._encoder = encoder
        self.flat, self._arrays = _batch_arrays(count, encoder.space)
        self._running: list[_Running | None] = [None] * count
        self._addresses = np.zeros(count, dtype=np.int64)
        self._commands, self._needs = np.zeros((count, 3)), np.zeros(count, dtype=np.int64)
        self._outcome, self._measured = np.zeros(count, dtype=np.int64), np.zeros((count, MEASURED_SIZE))
        self._limits = np.zeros((count, 4))  # ahead, back, sideways, turn
        self._dt = [0.0] * count  # s, ticks
        self._idle: dict[Hashable, list[_Running]] = {}  # worlds that can begin again, by episode
        self._idle_count = 0
        self._repeats = True  # whether episodes come again
        self._keeps_commands = record is not None
        self._pool: ThreadPoolExecutor | None = None
        self._process = 0  # to which the threads belong
        self.needs_reset = True

    def reset(self) -> Observation:
        """Begin an episode in each world; those that were running are dropped.

        Returns:
            The observations, see `WorldsStep`.
        """
        self._next = 0
        for w in range(self.num_worlds):
            self._begin(w)
        self.needs_reset = False
        return self._arrays

    def step(self, actions: Any) -> WorldsStep:
        """Drive all robots for one tick.

        Args:
            actions: (B, `action_size`), fractions of the robots' limits in [-1, 1], as of `SocialNavEnv`; numbers
                beyond are clipped.

        Raises:
            ResetNeeded: `reset` was not called, or the last step failed or was interrupted.
            ControllerError: a number is not finite.
            ValueError: the actions have another shape.
        """
        if self.needs_reset:
            raise gymnasium.error.ResetNeeded("call reset() first, and after a step that failed or was interrupted")
        self._set_commands(actions)
        self.needs_reset = True
        is_first = self._outcome != RUNNING
        before = self._measured[:, GOAL_DISTANCE].copy()
        if self._keeps_commands:
            raw, size = self._commands.tobytes(), 3 * self._commands.itemsize
            for w in np.flatnonzero(~is_first).tolist():
                self._at(w).commands.frombytes(raw[w * size : (w + 1) * size])
        self._needs[:] = 0
        self._advance(is_first)
        for w in np.flatnonzero(is_first).tolist():
            self._begin(w)
        rewards = self._rewards(before, is_first)
        if self._folder is not None:
            for w in np.flatnonzero((self._outcome != RUNNING) & ~is_first).tolist():
                if self._at(w).is_recorded:
                    self._save(self._at(w))
        self.needs_reset = False
        contacts = self._measured[:, WITH_HUMAN : WITH_WALL + 1] != 0.0
        return WorldsStep(self._arrays, rewards, self._outcome.copy(), contacts, is_first)

    @property
    def observations(self) -> Observation:
        """The present observations, see `WorldsStep`."""
        return self._arrays

    def scene(self, world: int) -> Scene:
        """The scene of the present episode of a world."""
        return self._at(world).scene

    def snapshot(self, world: int) -> Snapshot:
        """The present state of a world."""
        running = self._at(world)
        running.world.note(int(running.member.value.clock[0]), running.crowd)
        return running.world.snapshot()

    def close(self) -> None:
        """End the threads; a later step starts others."""
        if self._pool is not None:
            self._pool.shutdown()
            self._pool = None

    def _at(self, w: int) -> _Running:
        running = self._running[w]
        if running is None:
            raise gymnasium.error.ResetNeeded("call reset() first")
        return running

    def _set_commands(self, actions: Any) -> None:
        """Write the commands of actions, rounded as files hold them."""
        values, expected = np.asarray(actions), (self.num_worlds, self.action_size)
        if values.shape != expected or values.dtype.kind not in "fiu":
            raise ValueError(f"actions are numbers of the shape {expected}, got {shown(actions)} of {values.shape}")
        values = values.astype(float)
        values[self._outcome != RUNNING] = 0.0  # these are ignored
        if not np.isfinite(values).all():
            w = int(np.flatnonzero(~np.isfinite(values).all(axis=1))[0])
            raise ControllerError(f"actions are finite numbers, got {values[w].tolist()} for world {w}")
        values = np.clip(values, -1.0, 1.0)
        commands, (ahead, back, sideways, turn) = self._commands, self._limits.T
        commands[:, 0] = values[:, 0] * np.where(values[:, 0] > 0.0, ahead, back)
        commands[:, 1] = values[:, 1] * sideways if self.action_size == 3 else 0.0
        commands[:, 2] = values[:, -1] * turn
        np.rint(commands * 10_000.0, out=commands)
        commands /= 10_000.0
        commands += 0.0  # no -0.0

    def _advance(self, is_skipped: BoolArray) -> None:
        """Move the worlds that are not skipped by one tick."""
        count, threads = self.num_worlds, min(self._threads, self.num_worlds)
        if not IS_COMPILED:
            for w in np.flatnonzero(~is_skipped).tolist():
                self._finish(w, self._step(w, DONE))
            return
        arrays = self._addresses, self._commands, is_skipped, self._needs
        if threads == 1:
            waiting = step_members(*arrays, 0, count)
        else:
            bounds = [count * n // threads for n in range(threads + 1)]
            pool = self._threads_of_process()
            parts = [pool.submit(step_members, *arrays, a, b) for a, b in itertools.pairwise(bounds)]
            waiting = sum(part.result() for part in parts)
        if waiting:
            for w in np.flatnonzero(self._needs).tolist():
                self._finish(w, int(self._needs[w]))

    def _threads_of_process(self) -> ThreadPoolExecutor:
        """The threads, which a forked process does not inherit."""
        if self._pool is None or self._process != os.getpid():
            self._pool, self._process = ThreadPoolExecutor(self._threads), os.getpid()
        return self._pool

    def _finish(self, w: int, need: int) -> None:
        """Give a world what it needs until its tick is over."""
        running = self._at(w)
        while need != DONE:
            running.member = provided(running.member, running.world, running.crowd, need)
            self._addresses[w] = running.address
            need = self._step(w, need)

    def _step(self, w: int, need: int) -> int:
        """Move one world by a tick, or go on with it; what it needs."""
        vx, vy, omega = self._commands[w].tolist()
        return step_member(self._at(w).member.argument, vx, vy, omega, need)

    def _draw(self, w: int) -> Hashable:
        """The next episode of a world."""
        self._next += 1
        return (self._next - 1) % len(self._scenes)

    def _scene_of(self, key: Any) -> Scene:
        """The scene of an episode of `_draw`."""
        scene: Scene = self._scenes[key]
        return scene

    def _begin(self, w: int) -> None:
        """Begin the next episode in a world."""
        before, key = self._running[w], self._draw(w)
        self._place(w, self._again(key) or self._new(key))
        if before is not None and self._repeats and self._idle_count < _KEPT:
            self._idle.setdefault(before.key, []).append(before)
            self._idle_count += 1

    def _new(self, key: Hashable) -> _Running:
        return _Running(self._scene_of(key), key, self._encoder)

    def _place(self, w: int, running: _Running) -> None:
        """Let an episode go on in a world."""
        arrays = Arrays(*(array[w] for array in self._arrays.values()))
        running.attach(arrays, self._outcome[w : w + 1], self._measured[w])
        self._running[w], self._addresses[w], limits = running, running.address, running.scene.robot.limits
        self._limits[w] = limits.ahead, limits.back, limits.sideways, limits.turn
        self._dt[w] = running.scene.rules.dt

    def _again(self, key: Hashable) -> _Running | None:
        """A world that ran an episode before, at the start again; None without one."""
        idle = self._idle.get(key)
        if not idle:
            return None
        self._idle_count -= 1
        running = idle.pop()
        return running if running.restart() else None

    def _rewards(self, before: Array, is_first: BoolArray) -> Array:
        """(B,), 0 where an episode begins."""
        measured, reward = self._measured, self._reward
        of = reward._value if type(reward).of is BuiltIn.of else reward.of  # all numbers are floats
        progress, gap = (before - measured[:, GOAL_DISTANCE]).tolist(), measured[:, CLEARANCE].tolist()
        contact = (measured[:, WITH_HUMAN : WITH_WALL + 1] != 0.0).any(axis=1).tolist()
        status = [STATUSES[code] for code in self._outcome.tolist()]
        rewards = [*map(of, progress, gap, contact, status, self._dt)]
        for w in np.flatnonzero(is_first).tolist():
            rewards[w] = 0.0
        return np.array(rewards, dtype=float)

    def _save(self, running: _Running, reason: str | None = None) -> None:
        """Record an episode: it is run again, which gives the same bits.

        Args:
            running: its world.
            reason: of the end of an episode that is not over.
        """
        assert self._folder is not None
        past = Inputs()
        past.extend(np.array(running.commands).reshape(-1, 3))
        episode = Episode(running.scene, observers=[FolderRecorder(self._folder)], past=past).replay_past()
        episode.observe()
        if reason is not None:
            episode.end("stopped", reason)


class _Running:
    """A world, and all that its packed `Member` points to.

    Args:
        scene, key: of the episode.
        encoder: numbers and order of the rows of its observations.

    Raises:
        TypeError: the pedestrian model is ordinary Python.
    """

    member: Packed[Member]

    def __init__(self, scene: Scene, key: Hashable, encoder: Encoder) -> None:
        if scene.robots:
            raise ValueError(
                f"{scene.title} has {counted(1 + len(scene.robots), 'robot')}; vectors and Worlds take scenes with one "
                "robot, SocialNavEnv takes several"
            )
        if not scene.goal.is_plain:
            raise TypeError(
                f"the task of {scene.title} is {scene.goal.task!r} with places or a person; Worlds and vectors take "
                "goals at one position, SocialNavEnv takes all"
            )
        self.scene, self.key, self.world, self.crowd = scene, key, World(scene), Crowd(scene)
        if not self.crowd.is_compiled:
            raise TypeError(
                f"the pedestrian model of {scene.title} is ordinary Python; Worlds needs a KernelModel, "
                "SocialNavVectorEnv takes both"
            )
        self.world.keep()
        self.crowd.keep()
        self.commands = array("d")  # three for each tick
        self.is_recorded = True
        sizes = encoder.sizes
        rows = Rows(*(np.full(n, -1) for n in (sizes.humans, sizes.objects, sizes.walls)))
        self._sight = sight_of(scene, rows, encoder.arrays, encoder.order == "nearest")

    def attach(self, arrays: Arrays, outcome: IntArray, measured: Array) -> None:
        """Write observations, outcome and measurements into some arrays from now on; begins with those of the start."""
        self._packed_sight = Packed(self._sight._replace(arrays=arrays))
        self.member = member_of(
            self.world, self.crowd, outcome, measured, write=_write_address(), sight=self._packed_sight.argument
        )
        observe_member(self.member.argument)

    def restart(self) -> bool:
        """Return to the start; False if this is not possible."""
        self.commands, self.is_recorded = array("d"), True
        self.world.restart()
        return self.crowd.restart()

    @property
    def address(self) -> int:
        """Address of the packed member."""
        return self.member.address


@cache
def _write_address() -> IntArray:
    return address_of(write_observation, PACKED, FLOATS, FLAGS, INTS, INTS2, INT, FLOAT)


def _batch_arrays(count: int, space: spaces.Dict) -> tuple[Floats32, dict[str, NDArray[Any]]]:
    """The observations of B worlds by part, and the memory of all parts of floats, (B, D)."""
    shapes = {name: space[name].shape or () for name in space}
    sizes = {name: math.prod(shape) for name, shape in shapes.items() if space[name].dtype == np.float32}
    flat = np.zeros((count, sum(sizes.values())), dtype=np.float32)
    arrays, start = dict[str, NDArray[Any]](), 0
    for name in space:
        if name in sizes:
            arrays[name] = flat[:, start : start + sizes[name]].reshape(count, *shapes[name])
            start += sizes[name]
        else:
            arrays[name] = np.zeros((count, *shapes[name]), space[name].dtype)
    return flat, {name: arrays[name] for name in Arrays._fields}


def _sizes_of(scenes: Sequence[Scene]) -> Sizes:
    """The largest numbers of entities in scenes."""

    def most(kind: str) -> int:
        return max(1, *(len(getattr(scene, kind)) for scene in scenes))

    humans = most("humans")
    return Sizes(humans, most("furniture"), most("walls"), max(2 * humans, most("interactions")))
