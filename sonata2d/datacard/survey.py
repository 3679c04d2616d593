"""How a data set looks: where robot and people were, how fast, how near to each other; episode by episode."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..exact import Array
from ..proxemics import INTIMATE_DISTANCE, PERSONAL_DISTANCE
from ..record import EpisodeRecord

REACH, CELL = 12.0, 0.2  # m: the maps go from -REACH to REACH
FASTEST, FARTHEST = 2.5, 5.0  # m/s and m: the ends of the distributions
_EDGES = np.linspace(-REACH, REACH, round(2 * REACH / CELL) + 1)
SPEEDS, CLEARANCES = np.linspace(0.0, FASTEST, 51), np.linspace(0.0, FARTHEST, 101)


@dataclass(slots=True)
class Survey:
    """Counts over all frames; memory does not grow with the number of episodes.

    Attributes:
        robot, people: (120, 120), frames in each cell of 0.2 m, world frame; the first axis is x.
        robot_speed, people_speed: (50,), frames in each class of `SPEEDS`; the last one holds all that is faster.
        clearance: (100,), frames in each class of `CLEARANCES` by the gap from robot to nearest person, m; the last one
            holds all that is farther.
        outcomes: episodes by outcome.
        frames, alone: how many; those without a person.
        robot_sum, people_sum: m/s, of all speeds.
        intimate, personal: frames in which the robot was within that distance of a person.
    """

    robot: Any = field(default_factory=lambda: np.zeros((len(_EDGES) - 1,) * 2, dtype=np.int64))
    people: Any = field(default_factory=lambda: np.zeros((len(_EDGES) - 1,) * 2, dtype=np.int64))
    robot_speed: Any = field(default_factory=lambda: np.zeros(len(SPEEDS) - 1, dtype=np.int64))
    people_speed: Any = field(default_factory=lambda: np.zeros(len(SPEEDS) - 1, dtype=np.int64))
    clearance: Any = field(default_factory=lambda: np.zeros(len(CLEARANCES) - 1, dtype=np.int64))
    outcomes: dict[str, int] = field(default_factory=dict)
    frames: int = 0
    alone: int = 0
    robot_sum: float = 0.0
    people_sum: float = 0.0
    intimate: int = 0
    personal: int = 0

    def add(self, record: EpisodeRecord) -> None:
        """Count an episode in."""
        there = record.present
        self.robot += _map(record.robot[:, :2])
        self.people += _map(record.humans[there][:, :2])
        robot, people = (np.hypot(rows[:, 3], rows[:, 4]) for rows in (record.robot, record.humans[there]))
        self.robot_speed += _classes(robot, SPEEDS)
        self.people_speed += _classes(people, SPEEDS)
        self.robot_sum, self.people_sum = self.robot_sum + float(robot.sum()), self.people_sum + float(people.sum())
        gaps = clearances(record)
        self.intimate += int((gaps < INTIMATE_DISTANCE).sum())
        self.personal += int((gaps < PERSONAL_DISTANCE).sum())
        self.clearance += _classes(gaps[np.isfinite(gaps)], CLEARANCES)
        self.outcomes[record.outcome.status] = self.outcomes.get(record.outcome.status, 0) + 1
        self.frames += len(record)
        self.alone += int(np.isinf(gaps).sum())


def surveyed(records: Iterable[EpisodeRecord]) -> Survey:
    """The survey of some episodes, read one at a time."""
    survey = Survey()
    for record in records:
        survey.add(record)
    return survey


def clearances(record: EpisodeRecord) -> Array:
    """(T,), m, from the robot's outline to the nearest person's; infinite where nobody is."""
    scene = record.scene()
    if not scene.humans:
        return np.full(len(record), np.inf)
    radii = np.array([human.radius for human in scene.humans])
    apart = record.humans[..., :2] - record.robot[:, None, :2]
    gaps = np.hypot(apart[..., 0], apart[..., 1]) - radii - scene.robot.radius
    nearest: Array = np.maximum(np.where(record.present, gaps, np.inf).min(axis=1), 0.0)
    return nearest


def _map(places: Array) -> Any:
    counts, _, _ = np.histogram2d(places[:, 0], places[:, 1], bins=(_EDGES, _EDGES))
    return counts.astype(np.int64)


def _classes(values: Array, edges: Array) -> Any:
    """How many values are in each class; what lies beyond the last one is counted in it."""
    return np.histogram(np.minimum(values, np.nextafter(edges[-1], 0.0)), bins=edges)[0]
