"""What the robot cost the people: their ways and paces against those of the same seed without a robot."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ..agents.controllers.base import Controller
from ..core.entities import Human, Robot
from ..core.geometry import Pose, Twist
from ..core.portable_math import Array
from ..core.scene import Scene
from ..core.snapshot import Snapshot
from ..datasets.mirror import mirrored
from ..record.canonical import rounded
from ..record.record import EpisodeRecord
from ..sim.episode import Episode
from ..version import PHYSICS_VERSION
from .definition import OURS, Metric
from .trajectory import Trajectory, distances

FAR = 100.0  # m beyond the room: where the robot waits, minded by nobody, while the people walk alone


class _Still(Controller):
    """Stands."""

    def act(self, snapshot: Snapshot) -> Twist:
        return Twist()


def without_robot(record: EpisodeRecord) -> Array | None:
    """Where the people of an episode are, look by look, when the same seed runs without a robot.

    Returns:
        (T + 1, N, 2), m, at the precision of files, NaN where absent; None for an episode that the physics of this
        version did not make, or in which nobody walks.
    """
    if record.document.get("mirrored_from"):  # the seed made the original
        alone = without_robot(mirrored(record))
        return None if alone is None else alone * (1.0, -1.0) + 0.0
    scene = record.scene()
    is_ours = record.document["physics"] == PHYSICS_VERSION
    if not is_ours or not any(_walks(human) for human in scene.humans):
        return None
    episode = Episode(_emptied(scene), _Still())
    places = [_places(episode.look())]
    for _ in range(len(record)):
        episode.step()
        places.append(_places(episode.look()))
    return rounded(np.stack(places))


def _places(look: Snapshot) -> Array:
    """(N, 2), m; NaN where absent."""
    return np.asarray(look.humans.among_all(look.humans.position, len(look.scene.humans), np.nan))


def _walks(human: Human) -> bool:
    """Whether somebody goes where they want to: those who are recorded take no notice of a robot."""
    return human.behaviour in ("wandering", "walking")


def _emptied(scene: Scene) -> Scene:
    """The same scene with its robot far away, and ignored."""
    x, y = scene.outline.max(axis=0).tolist()
    robot: Robot = replace(scene.robot, pose=Pose(x + FAR, y + FAR))
    people = tuple(replace(human, reacts_to_robot=0.0) for human in scene.humans)
    return replace(scene, robot=robot, humans=people, rules=replace(scene.rules, ends_on=()))


def human_speed_ratio(run: Trajectory) -> float | None:
    """Mean over looks and walkers of speed over desired speed; None where nobody walks."""
    there = run.present & _walkers(run)
    if not there.any():
        return None
    wanted = np.array([human.desired_speed for human in run.scene.humans])
    return float((distances(run.people[:, :, 3:5], (0.0, 0.0)) / wanted)[there].mean())


def human_deviation_mean(run: Trajectory) -> float | None:
    """m, mean over looks and walkers, from where they would have been without the robot; None if that is unknown."""
    away = _deviation(run)
    return None if away is None or np.isnan(away).all() else float(np.nanmean(away))


def human_deviation_max(run: Trajectory) -> float | None:
    """m, the largest of any walker at any look."""
    away = _deviation(run)
    return None if away is None or np.isnan(away).all() else float(np.nanmax(away))


def human_slowing(run: Trajectory) -> float | None:
    """m/s, by which walkers got on more slowly than without the robot; negative if faster; None if unknown."""
    took = float(run.time[-1] - run.time[0])
    if run.alone is None or took == 0.0:
        return None
    walks = _walkers(run)
    alone, here = run.alone[: len(run), walks], run.people[:, walks, :2]
    steps = [distances(places[1:], places[:-1]) for places in (alone, here)]
    both = ~np.isnan(steps[0] + steps[1])  # of the steps at which they are there in both runs
    if not both.any():
        return None
    each = np.where(both, steps[0] - steps[1], 0.0).sum()
    return float(each) / (float(np.where(both, run.lasted[:, None], 0.0).sum()))


def _walkers(run: Trajectory) -> Any:
    """(N,) of bool."""
    return np.array([_walks(human) for human in run.scene.humans], dtype=bool)


def _deviation(run: Trajectory) -> Array | None:
    """(L, W), m, of W walkers."""
    if run.alone is None:
        return None
    walks = _walkers(run)
    return distances(run.people[:, walks, :2], run.alone[: len(run), walks])


METRICS = (
    Metric(
        "human_speed_ratio", "share", "more", "mean over looks and walkers of |v_person| / desired speed",
        "HuNavSim, avg_pedestrian_velocity, over the desired speed", human_speed_ratio,
    ),
    Metric(
        "human_deviation_mean", "m", "less",
        "mean over looks and walkers of |q − q₀|, q₀ = the person's place in a rerun of the seed without a robot. Who"
        " is held up may then choose another place to go to, as may those after them: read it beside human_slowing",
        "the comparison is SACSoN's (Hirose et al., arXiv 2306.01874)", human_deviation_mean,
    ),
    Metric("human_deviation_max", "m", "less", "max over looks and walkers of |q − q₀|", "as human_deviation_mean",
           human_deviation_max),
    Metric(
        "human_slowing", "m/s", "less",
        "mean over walkers of (way gone in the rerun without a robot − way gone) / T", OURS, human_slowing,
        headline=True,
    ),
)  # fmt: skip
