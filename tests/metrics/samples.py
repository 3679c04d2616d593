"""Runs made by hand: where everybody is at each look, and nothing else."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from sonata2d.core.portable_math import Array
from sonata2d.core.scene import Scene
from sonata2d.core.snapshot import Outcome, Status
from sonata2d.metrics.catalogue import ALL
from sonata2d.metrics.trajectory import Trajectory
from sonata2d.record.layout import layout_of
from sonata2d.record.record import EpisodeRecord, Looks

Places = Sequence[Sequence[float]]
NOTHING: Mapping[int, list[Any]] = {}


def record(
    scene: Scene,
    robot: Places,
    people: Sequence[Places] = (),
    *,
    status: Status = "stopped",
    contacts: Mapping[int, list[Any]] = NOTHING,
    ties: Mapping[int, list[Any]] = NOTHING,
) -> EpisodeRecord:
    """An episode of a scene.

    Args:
        scene: as many people as `people`.
        robot: x, y, theta at each look; velocities are the differences to the look before, at the first to the next.
        people: the same of each person.
        status: how it ended.
        contacts: rows as files have them, by look.
        ties: interactions, likewise.
    """
    dt, count = scene.rules.dt, len(robot)
    looks = [{"contacts": contacts.get(k, []), "interactions": ties.get(k, [])} for k in range(count)]
    document = {
        **layout_of(scene), "name": scene.name, "family": scene.family, "seed": scene.seed, "episode": scene.episode,
        "physics": 0, "frames": looks[:-1], "final": looks[-1],
    }  # fmt: skip
    rows = np.stack([_rows(places, dt) for places in (robot, *people)], axis=1)
    humans = np.concatenate((rows[:, 1:], rows[:, 1:, 2:3]), axis=2)
    there = np.isfinite(humans[:, :, 0])
    time = dt * np.arange(count)
    looked = Looks(np.arange(count), time, rows[:, 0], humans, there, np.where(there, 0, -1))
    body = _in_body(rows[1:, 0])
    outcome = Outcome(status, "by hand", count - 1, float(time[-1]))
    return EpisodeRecord(Path("by-hand.json"), document, looked, body, body, np.zeros(count - 1, bool), outcome)


def value(name: str, *args: Any, alone: Array | None = None, **more: Any) -> float | None:
    """A metric of the episode that `record` makes of the rest."""
    return ALL[name].of(Trajectory(record(*args, **more), alone))


def line(start: tuple[float, float], step: tuple[float, float], count: int, theta: float = 0.0) -> list[list[float]]:
    """Looks along a straight way."""
    return [[start[0] + k * step[0], start[1] + k * step[1], theta] for k in range(count)]


def stay(x: float, y: float, count: int, theta: float = 0.0) -> list[list[float]]:
    """Looks at one who stands."""
    return line((x, y), (0.0, 0.0), count, theta)


def _rows(places: Places, dt: float) -> Array:
    """(count, 6): x, y, theta, vx, vy, omega."""
    at = np.array(places, dtype=float)
    moved = np.diff(at, axis=0, prepend=2 * at[:1] - at[1:2]) / dt if len(at) > 1 else np.zeros_like(at)
    return np.concatenate((at, moved), axis=1)


def _in_body(rows: Array) -> Array:
    c, s = np.cos(rows[:, 2]), np.sin(rows[:, 2])
    return np.stack((rows[:, 3] * c + rows[:, 4] * s, rows[:, 4] * c - rows[:, 3] * s, rows[:, 5]), axis=1)
