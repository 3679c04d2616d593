"""Baselines of the benchmark: controllers of sonata2d, and some that show what scores must refuse."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..agents.controllers.base import Answer, Controller
from ..agents.controllers.planner import SocialPlanner
from ..agents.controllers.reactive import StraightToGoal
from ..core.geometry import Twist
from ..core.scene import Scene
from ..core.snapshot import Snapshot
from ..core.vectors import lengths
from .run import RECORDED_PERSON
from .suite import Suite, Track

_NEAR = 3.0  # m, within which `Waiting` waits for people


class StandStill(Controller):
    """Never moves: without any contact by its own fault, and without reaching a goal."""

    def act(self, snapshot: Snapshot) -> Answer:
        return Twist()


class Racing(StraightToGoal):
    """Drives straight to the goal at the top speed of the robot, without regard to people."""

    def reset(self, scene: Scene) -> None:
        self.speed = scene.robot.limits.ahead
        super().reset(scene)


class Waiting(Controller):
    """Drives as `social-planner` while no moving person is within 3 m, and otherwise stands."""

    def __init__(self) -> None:
        self._planner = SocialPlanner()

    def reset(self, scene: Scene) -> None:
        self._planner.reset(scene)

    def act(self, snapshot: Snapshot) -> Answer:
        answer, humans = self._planner.act(snapshot), snapshot.humans
        distance = lengths(humans.position - np.array(snapshot.robot.position))
        if ((distance < _NEAR) & (lengths(humans.velocity) > 0.1)).any():
            self._planner.command_overridden(Twist())
            return Twist()
        return answer

    def command_overridden(self, twist: Twist) -> None:
        self._planner.command_overridden(twist)


@dataclass(frozen=True, slots=True)
class Baseline:
    """A baseline.

    Attributes:
        controller: its name.
        track: what it observes.
        shows: in words.
        is_recorded: whether it drives in suites of recordings only.
    """

    controller: str
    track: Track
    shows: str
    is_recorded: bool = False


_OWN, _HERE = "sonata2d.benchmark.baselines", Path(__file__).parent
BASELINES: Mapping[str, Baseline] = {
    "standing-still": Baseline(f"{_OWN}:StandStill", "state", "the lower bound: no contact, and no task done"),
    "straight-to-goal": Baseline("straight-to-goal", "state", "leaning on others: people and a guard shall avoid it"),
    "racing": Baseline(f"{_OWN}:Racing", "state", "racing past people"),
    "waiting": Baseline(f"{_OWN}:Waiting", "state", "waiting until everybody has left"),
    "social-force": Baseline("social-force", "state", "Helbing & Molnar 1995"),
    "orca": Baseline("orca", "state", "van den Berg et al. 2011"),
    "social-planner": Baseline("social-planner", "state", "the expert of sonata2d"),
    "graph-policy": Baseline("graph-policy", "state", "a graph network that imitates the expert"),
    "ppo": Baseline(str(_HERE / "ppo.npz"), "state", "a perceptron trained by PPO on dev scenes"),
    "attention": Baseline(f"{_HERE / 'attention.py'}:AttentionPolicy", "state", "attention, trained likewise"),
    "r-gcn": Baseline(str(_HERE / "r-gcn.npz"), "state", "the network of the SONATA paper, which imitates the expert"),
    "social-planner-sees": Baseline("social-planner", "sees", "the expert, with a field of view and noise"),
    "orca-sees": Baseline("orca", "sees", "the same with a field of view and noise"),
    "dwa": Baseline("dwa", "lidar", "Fox et al. 1997"),
    "mppi": Baseline("mppi", "lidar", "Williams et al. 2017"),
    RECORDED_PERSON: Baseline(RECORDED_PERSON, "state", "the person whose place the robot takes", is_recorded=True),
}


def baselines_of(suite: Suite) -> dict[str, Baseline]:
    """The baselines that drive in a suite, by name."""
    is_recorded = any(entry.recording is not None for entry in suite.entries)
    return {name: each for name, each in BASELINES.items() if is_recorded or not each.is_recorded}
