"""A room of a given size and the time of the physics engine's own steps, for benchmarks of frames."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any
from unittest.mock import patch

from pymunk._chipmunk_cffi import lib

import sonata2d as s2
from sonata2d.agents.pedestrians.crowd import Crowd
from sonata2d.sim import world
from sonata2d.sim.kernel import chipmunk, step

FRAMES = 200  # of an episode
_KERNELS = ("advance", "read_state", "begin", "track", "enter_and_leave")


def crowded_room(people: int, model: str = "sonata2026") -> s2.ScenarioConfig:
    """An L-shaped room with two inner walls that grows with the number of people: 4 m2 or more for each."""
    a = math.sqrt(max(4.0 * people, 60.0) / 3.0)
    polygon = [[-a, -a], [a, -a], [a, 0], [0, 0], [0, a], [-a, a]]
    return s2.ScenarioConfig(
        name="throughput",
        room={"polygon": polygon, "walls": [[-a, 0, -a + 1, 0], [0, -a, 0, -a + 1]]},
        standing=0, wandering=people, tables=4, plants=4, relations=0, laptops_on_tables=False,
        person={"model": model},
        rules={"time_limit": FRAMES / 10, "ends_on": ["time"]},
    )  # fmt: skip


def run_episode(config: s2.ScenarioConfig, controller: s2.Controller, path: Path) -> tuple[float, float]:
    """CPU seconds of one episode, from its settings to its file, and from its first tick to its file."""
    start = time.process_time()
    scene = s2.generate(config, seed=1)
    with s2.JsonRecorder(path) as recorder:
        episode = s2.Episode(scene, controller, observers=[recorder])
        first_tick = time.process_time()
        episode.run()
    end = time.process_time()
    return end - start, end - first_tick


def engine_steps(work: Callable[[], Any], *, through_pymunk: bool = False) -> list[float]:
    """Duration of each physics step during `work`, s.

    The interpreter runs the loop over the substeps, which gives the same bits and can be timed step by step.

    Args:
        work: runs episodes.
        through_pymunk: time pymunk's method `Space.step` in place of the engine's C function, which it calls.
    """
    seconds: list[float] = []
    spaces: list[Any] = []

    class Memory(chipmunk.EngineMemory):
        def __init__(self, space: Any, *arguments: Any) -> None:
            super().__init__(space, *arguments)
            spaces.append((space, space._space))

    robots: list[Any] = []

    class Unpacked:
        def __init__(self, value: Any) -> None:
            self.value = self.argument = value

        @property
        def address(self) -> int:
            robots.append(self.argument)
            return len(robots) - 1

    def call(function: int, numbers: tuple[Any, ...]) -> None:
        if function != step_address:
            chipmunk._interpreted_call(function, numbers)
            return
        space, c_space = spaces[-1]
        h, step_once = float(numbers[1]), space.step if through_pymunk else lib.cpSpaceStep
        arguments = (h,) if through_pymunk else (c_space, h)
        start = time.perf_counter()
        step_once(*arguments)
        seconds.append(time.perf_counter() - start)

    interpreted = {name: getattr(getattr(step, name), "py_func", getattr(step, name)) for name in _KERNELS}
    step_address = next(iter(chipmunk._KINDS))  # of the first function of the handle
    with (
        patch.object(Crowd, "is_compiled", False),  # physics apart from the decisions
        patch.object(world, "EngineMemory", Memory),
        patch.multiple(world, Packed=Unpacked, **interpreted),
        patch.multiple(
            step,
            unpack=lambda value, kind: value,
            packed_at=lambda address: robots[address],
            call=lambda address, arguments: address.origin[0](*arguments),
        ),
        patch.object(chipmunk, "_call", call),
    ):
        work()
    return seconds


def shortest(runs: Sequence[Sequence[float]]) -> float:
    """The sum over the steps of the shortest duration in any run, s."""
    return float(sum(min(each) for each in zip(*runs, strict=True)))
