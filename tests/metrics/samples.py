"""Episodes constructed by hand from positions, to compute metrics on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from sonata2d.core.portable_math import Array
from sonata2d.core.scene import Scene
from sonata2d.core.snapshot import Outcome, Status
from sonata2d.metrics.catalogue import ALL
from sonata2d.metrics.evaluation import Evaluation, Measured
from sonata2d.metrics.trajectory import Trajectory
from sonata2d.record.layout import scene_to_json
from sonata2d.record.record import EpisodeRecord, States

Poses = Sequence[Sequence[float]]
NONE: Mapping[int, list[Any]] = {}


def record(
    scene: Scene,
    robot: Poses,
    people: Sequence[Poses] = (),
    *,
    status: Status = "stopped",
    contacts: Mapping[int, list[Any]] = NONE,
    interactions: Mapping[int, list[Any]] = NONE,
) -> EpisodeRecord:
    """An episode of a scene.

    Args:
        scene: has as many humans as `people`.
        robot: x, y, theta in each state; velocities are the differences from the state before, in the first state to
            the next.
        people: the same for each human.
        status: of the outcome.
        contacts, interactions: rows as in files, by state.
    """
    dt, count = scene.rules.dt, len(robot)
    states = [{"contacts": contacts.get(k, []), "interactions": interactions.get(k, [])} for k in range(count)]
    document = {
        **scene_to_json(scene), "name": scene.name, "family": scene.family, "seed": scene.seed,
        "episode": scene.episode, "physics": 0, "frames": states[:-1], "final": states[-1],
    }  # fmt: skip
    rows = np.stack([_rows(poses, dt) for poses in (robot, *people)], axis=1)
    humans = np.concatenate((rows[:, 1:], rows[:, 1:, 2:3]), axis=2)
    present = np.isfinite(humans[:, :, 0])
    time = dt * np.arange(count)
    others, activity = np.zeros((count, 0, 6)), np.where(present, 0, -1)
    arrays = States(np.arange(count), time, rows[:, 0], others, humans, present, activity, np.zeros((count, 0)))
    twists = _twists(rows[1:, 0])
    outcome = Outcome(status, "by hand", count - 1, float(time[-1]))
    return EpisodeRecord(Path("by-hand.json"), document, arrays, twists, twists, np.zeros(count - 1, bool), outcome)


def value(name: str, *args: Any, undisturbed: Array | None = None, **kwargs: Any) -> float | None:
    """A metric of the episode that `record` constructs from the other arguments."""
    return ALL[name].of(Trajectory(record(*args, **kwargs), undisturbed))


def line(start: tuple[float, float], step: tuple[float, float], count: int, theta: float = 0.0) -> list[list[float]]:
    """Poses along a straight line."""
    return [[start[0] + k * step[0], start[1] + k * step[1], theta] for k in range(count)]


def stay(x: float, y: float, count: int, theta: float = 0.0) -> list[list[float]]:
    """The same pose `count` times."""
    return line((x, y), (0.0, 0.0), count, theta)


def measured(scene: int, values: Mapping[str, float | None], *, outcome: str = "goal") -> Measured:
    """Metrics of an episode whose number and scene are `scene`."""
    return Measured(f"{scene}.json", "0" * 64, "s", "s/l", 1, scene, str(scene), outcome, dict(values))


def evaluation(label: str, *values: float | None, name: str = "spl", outcome: str = "goal") -> Evaluation:
    """Episodes in scenes 0, 1, ... with one metric each."""
    return Evaluation(label, [measured(k, {name: value}, outcome=outcome) for k, value in enumerate(values)])


def _rows(poses: Poses, dt: float) -> Array:
    """(count, 6): x, y, theta, vx, vy, omega."""
    at = np.array(poses, dtype=float)
    velocity = np.diff(at, axis=0, prepend=2 * at[:1] - at[1:2]) / dt if len(at) > 1 else np.zeros_like(at)
    return np.concatenate((at, velocity), axis=1)


def _twists(rows: Array) -> Array:
    """(count, 3): the velocities of rows in the body frame."""
    c, s = np.cos(rows[:, 2]), np.sin(rows[:, 2])
    return np.stack((rows[:, 3] * c + rows[:, 4] * s, rows[:, 4] * c - rows[:, 3] * s, rows[:, 5]), axis=1)
