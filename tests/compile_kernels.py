"""Compiles the kernels of the package into the user's cache folder: `python -m tests.compile_kernels`.

A test run with several processes does this first: with an empty cache, each process would compile all kernels itself.
"""

from __future__ import annotations

import sys

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
    """Compile the kernels of all controllers, pedestrian models and wrappers."""
    if not compiled.IS_COMPILED:
        return
    for controller in CONTROLLERS.built_in:
        if controller != _DRIVEN_BY_A_PERSON:
            run(controller=controller)
    for model in PEDESTRIAN_MODELS.built_in:
        run(model=model)
    observe()


if __name__ == "__main__":
    sys.exit(main())
