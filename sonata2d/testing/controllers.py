"""Checks of a controller: valid answers, recordable labels, deterministic runs."""

from __future__ import annotations

import warnings
from collections.abc import Iterable
from dataclasses import replace

from ..agents.controllers.base import Controller, require_controller
from ..agents.controllers.loading import is_built_in
from ..core.scene import Scene
from ..core.snapshot import Outcome
from ..datasets.summaries import commands_warning
from ..errors import ControllerWarning
from ..record.layout import JsonDict
from ..record.recorder import EpisodeRecorder
from ..scenegen.generator import generate
from ..scenegen.scenario.load import load_scenario
from ..scenegen.scenario.people import PersonSpec
from ..sim.driver import renderer_for
from ..sim.episode import Episode

SCENARIOS = ("empty", "sonata-2020", "sonata-2020-crowded")
# Pedestrians that enter and leave at different times, so that the rows of snapshots belong to changing pedestrians.
_PASSING_PEDESTRIANS = tuple(
    PersonSpec(x=-2.5, y=y, goals=((2.5, y),), exits=True, enters=0.3 * k, leaves=0.3 * k + 6.0)
    for k, y in enumerate((-1.0, 1.0, 2.0))
)


def check_controller(
    controller: Controller, *, scenes: Iterable[Scene] | None = None, time_limit: float = 20.0
) -> list[Outcome]:
    """Run a controller on several scenes as data-set generation does, twice on each.

    It prints nothing: a controller that passes raises no error and warns of nothing.

    Args:
        controller: the controller to check.
        scenes: by default one for each of `SCENARIOS`; in one of them pedestrians enter and leave.
        time_limit: of each default scene, s.

    Returns:
        The outcome of each scene.

    Raises:
        TypeError: the controller is a class or a name instead of an object.
        ControllerError: an answer is not a finite `Twist`.
        RecordError: a label cannot be stored in a file.
        AssertionError: the controller declares itself deterministic, but a second run of the same scene differs:
            state is kept from one episode to the next (clear it in `reset`), or an unseeded generator is used.

    Warns:
        ControllerWarning: most commands exceed the limits of the robot's drive, or move a unicycle sideways.
    """
    require_controller(controller)
    outcomes, counts = [], []
    for scene in scenes if scenes is not None else default_scenes(time_limit):
        first, outcome, commands = _recorded_run(scene, controller)
        counts.append({"ticks": outcome.tick, **commands})
        if controller.deterministic:
            second, _, _ = _recorded_run(scene, controller)
            assert first == second, (
                f"two runs of {type(controller).__name__} in {scene.name} differ; clear its state in reset(scene), "
                "seed its random generator, or set deterministic = False"
            )
        outcomes.append(outcome)
    message = None if is_built_in(controller) else commands_warning(counts, type(controller).__name__)
    if message is not None:
        warnings.warn(message, ControllerWarning, stacklevel=2)
    return outcomes


def default_scenes(time_limit: float) -> list[Scene]:
    """A scene for each of `SCENARIOS`; in the scene of sonata-2020, pedestrians enter and leave.

    Args:
        time_limit: of each scene, s.
    """
    scenes = []
    for name in SCENARIOS:
        config = load_scenario(name)
        people = _PASSING_PEDESTRIANS if name == "sonata-2020" else ()
        rules = replace(config.rules, time_limit=time_limit)
        scenes.append(generate(config.model_copy(update={"rules": rules, "people": people}), seed=1))
    return scenes


def _recorded_run(scene: Scene, controller: Controller) -> tuple[bytes, Outcome, JsonDict]:
    """The episode file of a run, its outcome, and its contacts and commands beyond the limits."""
    recorder = EpisodeRecorder()
    outcome = Episode(scene, controller, observers=[recorder], renderer=renderer_for(controller)).run()
    return recorder.document(), outcome, recorder.counts()
