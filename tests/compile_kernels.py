"""Compiles the kernels of the package into the user's cache folder: `python -m tests.compile_kernels`.

A test run with several processes does this first: with an empty cache, each process would compile all kernels itself.
"""

from __future__ import annotations

import os
import sys
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import sonata2d as s2
from sonata2d.core.compiled import kernel as compiled
from sonata2d.registry import CONTROLLERS, PEDESTRIAN_MODELS

_TICKS = 3
_DRIVEN_BY_A_PERSON = "teleoperation"


def run(model: str | None = None, controller: str = "straight-to-goal") -> None:
    """Run a few ticks with a pedestrian model, by default the scenario's, and a controller."""
    config = s2.load_scenario("lively")
    config = config if model is None else config.changed(person={"model": model})
    episode = s2.Episode(s2.generate(config, seed=1), s2.load_controller(controller))
    for _ in range(_TICKS):
        episode.step()


def observe() -> None:
    """Step an environment whose wrappers have kernels."""
    from sonata2d.gym.env import SocialNavEnv
    from sonata2d.gym.wrappers import FieldOfView, Lidar

    for wrapper in (FieldOfView, Lidar):
        env = wrapper(SocialNavEnv("lively"))
        env.reset(seed=1)
        env.step(env.action_space.sample())


def main() -> None:
    """Compile the kernels of a tick, then the others with all processors."""
    if not compiled.IS_COMPILED:
        return
    run()
    controllers = [name for name in CONTROLLERS.built_in if name != _DRIVEN_BY_A_PERSON]
    with ProcessPoolExecutor(os.cpu_count(), mp_context=get_context("spawn")) as pool:
        tasks = [pool.submit(run, controller=name) for name in controllers]
        tasks += [pool.submit(run, model=name) for name in PEDESTRIAN_MODELS.built_in]
        tasks.append(pool.submit(observe))
        for task in tasks:
            task.result()


if __name__ == "__main__":
    sys.exit(main())
