"""Checks for authors of controllers."""

from __future__ import annotations

from collections.abc import Iterable

from ..agents.controllers.base import Controller
from ..core.scene import Scene
from ..core.snapshot import Outcome
from ..record.recorder import EpisodeRecorder
from ..scenegen.generator import generate
from ..scenegen.scenario.load import load_scenario
from ..scenegen.scenario.people import PersonSpec
from ..sim.episode import Episode, renderer_for

SCENARIOS = ("empty", "sonata-2020", "sonata-2020-crowded")
PASSERS = tuple(
    PersonSpec(x=-2.5, y=y, goals=((2.5, y),), exits=True, enters=0.3 * k, leaves=0.3 * k + 6.0)
    for k, y in enumerate((-1.0, 1.0, 2.0))
)  # who come and go, so that snapshots show now these and now those


def check_controller(
    controller: Controller, *, scenes: Iterable[Scene] | None = None, time_limit: float = 20.0
) -> list[Outcome]:
    """Try a controller as a batch would: on several scenes, twice each.

    Args:
        controller: yours.
        scenes: where to try it; by default one of each of `SCENARIOS`, in one of which people come and go.
        time_limit: s, of each default episode.

    Returns:
        How each scene ended.

    Raises:
        ControllerError: an answer is no finite `Twist`.
        RecordError: a label is nothing a file can hold.
        AssertionError: it claims to be deterministic, and a second run of the same scene differs: something is
            kept from one episode to the next (clear it in `reset`), or drawn from an unseeded generator.
    """
    outcomes = []
    for scene in scenes if scenes is not None else default_scenes(time_limit):
        first, outcome = _recorded(scene, controller)
        if controller.deterministic:
            again, _ = _recorded(scene, controller)
            assert first == again, (
                f"{type(controller).__name__} drives {scene.name} differently the second time; clear what it keeps in"
                " reset(scene), draw chance from a seeded generator, or set deterministic = False"
            )
        outcomes.append(outcome)
    return outcomes


def default_scenes(time_limit: float) -> list[Scene]:
    """A small scene of each of `SCENARIOS`; people come and go in the second."""
    scenes = []
    for name in SCENARIOS:
        config = load_scenario(name)
        people = PASSERS if name == "sonata-2020" else ()
        rules = config.rules.model_copy(update={"time_limit": time_limit})
        scenes.append(generate(config.model_copy(update={"rules": rules, "people": people}), seed=1))
    return scenes


def _recorded(scene: Scene, controller: Controller) -> tuple[bytes, Outcome]:
    recorder = EpisodeRecorder()
    outcome = Episode(scene, controller, observers=[recorder], renderer=renderer_for(controller)).run()
    return recorder.document(), outcome
