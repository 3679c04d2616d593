"""Metrics of the robot's effect on humans: comparison with the same seed run without a robot."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..agents.pedestrians.crowd import Crowd
from ..core.entities import ROBOT_ID, Human, Robot
from ..core.geometry import Pose, Twist
from ..core.humans import X, Y
from ..core.portable_math import Array, BoolArray
from ..core.scene import Scene
from ..core.snapshot import Frames
from ..core.state import HUMAN_SIZE, ROBOT_SIZE
from ..core.vectors import lengths
from ..datasets.transforms.mirror import mirrored
from ..record.canonical import rounded
from ..record.record import EpisodeRecord
from ..sim.member import CompiledRun
from ..sim.world import World
from ..version import PHYSICS_VERSION
from .definition import metric
from .trajectory import Trajectory

_DISTANCE_FROM_ROOM = 100.0  # m, where the robot stands, ignored, in the run without a robot


class RunWithoutRobot:
    """A scene run without a robot, as far as it is needed.

    Args:
        scene: with its robot far away and ignored.
    """

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self._world, self._crowd, self._states = World(scene), Crowd(scene), list[Array]()
        self._run: CompiledRun | None = None
        if self._crowd.is_compiled:
            self._run = CompiledRun.of_commands(self._world, self._crowd, np.zeros((0, 3)))

    def positions(self, count: int) -> Array:
        """(count, N, 2), m, positions of the humans at the first states, rounded as in files, NaN where absent."""
        while self._world.tick + 1 < count:
            if self._run is None:
                self._states.append(self._world.positions())
                self._world.run_tick(Twist(), self._crowd)
            else:
                frames = self._run.frames(self._world.snapshot(), count - 1 - self._world.tick)
                self._states += _positions_in(frames)
        return rounded(np.stack([*self._states, self._world.positions()][:count]))


def _positions_in(frames: Frames) -> list[Array]:
    """Positions of the humans in each frame, (N, 2), m, NaN where absent."""
    people = frames.rows[:, ROBOT_SIZE : ROBOT_SIZE + HUMAN_SIZE * len(frames.first.scene.humans)]
    positions = people.reshape(len(people), -1, HUMAN_SIZE)[..., X : Y + 1].copy()
    if (is_present := frames.first.state.is_present) is not None:
        positions[:, ~is_present] = np.nan
    return [*positions]


def without_robot(record: EpisodeRecord, runs: list[RunWithoutRobot] | None = None) -> Array | None:
    """Run the seed of an episode again without a robot.

    Args:
        record: the episode.
        runs: earlier runs, which are continued for an episode of an equal scene, whatever its controller; a new run is
            appended.

    Returns:
        (T + 1, N, 2), m, positions of the humans at all states, rounded as in files, NaN where absent; None for an
        episode made by another version of the physics, or in which no human walks.
    """
    if record.document.get("mirrored_from"):  # the seed gives the original, not its mirror image
        positions = without_robot(mirrored(record), runs)
        return None if positions is None else positions * (1.0, -1.0) + 0.0
    scene = record.scene()
    is_ours = record.document["physics"] == PHYSICS_VERSION
    if not is_ours or not any(_walks(human) for human in scene.humans):
        return None
    scene, runs = _scene_without_robot(scene), [] if runs is None else runs
    if all(run.scene != scene for run in runs):
        runs.append(RunWithoutRobot(scene))
    return next(run for run in runs if run.scene == scene).positions(len(record) + 1)


def _walks(human: Human) -> bool:
    """Whether a human walks to goals; a recorded human follows its track and never reacts to a robot."""
    return human.behaviour in ("wandering", "walking")


def _scene_without_robot(scene: Scene) -> Scene:
    """The scene with its robot far away and ignored, so that random streams are drawn as with the robot; alone."""
    scene = scene.seen_by(ROBOT_ID)
    x, y = scene.outline.max(axis=0).tolist()
    robot: Robot = replace(scene.robot, pose=Pose(x + _DISTANCE_FROM_ROOM, y + _DISTANCE_FROM_ROOM))
    humans = tuple(replace(human, reacts_to_robot=0.0) for human in scene.humans)
    return replace(scene, robot=robot, robots=(), humans=humans, rules=replace(scene.rules, ends_on=()))


@metric("share", "more", needs={"robot", "humans.desired_speed"})
def human_speed_ratio(trajectory: Trajectory) -> float | None:
    """Mean of |v_person| / desired speed over states and walking people; not defined without walking people.

    Source: HuNavSim, avg_pedestrian_velocity, over the desired speed.
    """
    present = trajectory.present & _walkers(trajectory)
    if not present.any():
        return None
    desired_speed = trajectory.scene.human_table.desired_speed
    return float((lengths(trajectory.human_velocity) / desired_speed)[present].mean())


@metric("m", "less", needs={"robot", "seed"})
def human_deviation_mean(trajectory: Trajectory) -> float | None:
    """Mean over states and walking people of |q − q₀|, q₀ = position in a rerun of the seed without a robot.

    A person delayed by the robot may choose another destination, and so may others after them: read together with
    human_slowing. Not defined without the rerun.

    Source: the comparison is SACSoN's (Hirose et al., arXiv 2306.01874).
    """
    deviation = _deviation(trajectory)
    return None if deviation is None else float(np.nanmean(deviation))


@metric("m", "less", needs={"robot", "seed"})
def human_deviation_max(trajectory: Trajectory) -> float | None:
    """Max over states and walking people of |q − q₀|.

    Source: as human_deviation_mean.
    """
    deviation = _deviation(trajectory)
    return None if deviation is None else float(np.nanmax(deviation))


@metric("m/s", "less", needs={"robot", "seed"}, headline=True)
def human_slowing(trajectory: Trajectory) -> float | None:
    """Mean over walking people of (path length in the rerun without a robot − path length) / T.

    Negative if people walk farther than without the robot; not defined without the rerun.
    """
    if trajectory.undisturbed is None or trajectory.total_time == 0.0:
        return None
    walkers = _walkers(trajectory)
    runs = trajectory.undisturbed[: len(trajectory), walkers], trajectory.human_position[:, walkers]
    undisturbed, disturbed = (lengths(positions[1:] - positions[:-1]) for positions in runs)
    both = ~np.isnan(undisturbed + disturbed)  # steps during which the human is present in both runs
    if not both.any():
        return None
    lost = np.where(both, undisturbed - disturbed, 0.0).sum()
    return float(lost) / float(np.where(both, trajectory.durations[:, None], 0.0).sum())


def _deviation(trajectory: Trajectory) -> Array | None:
    """(L, W), m, from the W walking humans to their positions without the robot, NaN where absent; None if unknown."""
    if trajectory.undisturbed is None:
        return None
    walkers = _walkers(trajectory)
    undisturbed = trajectory.undisturbed[: len(trajectory), walkers]
    deviation = lengths(trajectory.human_position[:, walkers] - undisturbed)
    return None if np.isnan(deviation).all() else deviation


def _walkers(trajectory: Trajectory) -> BoolArray:
    """(N,), which humans walk."""
    return np.array([_walks(human) for human in trajectory.scene.humans], dtype=bool)


METRICS = (human_speed_ratio, human_deviation_mean, human_deviation_max, human_slowing)
