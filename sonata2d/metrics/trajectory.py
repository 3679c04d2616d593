"""A recorded episode as the metrics see it: arrays up to the goal, and the robot's contacts."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np

from ..core.geometry import Point
from ..core.navigation import FreeSpace
from ..core.portable_math import Array
from ..core.scene import Scene
from ..core.vectors import wrap_angles
from ..record.record import EpisodeRecord
from ..sim.safety import CLOSING

Kind = Literal["human", "object", "wall"]
Key = tuple[Kind, int]
Marks = dict[Key, dict[int, tuple[bool, bool]]]  # of each outline: look -> the robot's fault, the other's


@dataclass(frozen=True, slots=True)
class Touch:
    """One outline touched without a break: at which looks, first and last, and who ever closed the gap meanwhile."""

    kind: Kind
    id: int
    first: int
    last: int
    robot_at_fault: bool
    other_at_fault: bool


def touches_of(run: Trajectory) -> list[Touch]:
    """All touches of a run, in the order in which they begin."""
    marks: Marks = {}
    for key, look, faults in (*_near_people(run), *_near_barriers(run), *_recorded(run)):  # what was felt comes last
        marks.setdefault(key, {})[look] = faults
    found = [touch for key, looks in marks.items() for touch in _joined(key, looks)]
    return sorted(found, key=lambda touch: (touch.first, touch.kind, touch.id))


def _recorded(run: Trajectory) -> Iterator[tuple[Key, int, tuple[bool, bool]]]:
    document = run.record.document
    for look, told in enumerate([*document["frames"], document["final"]][: len(run)]):
        for row in told["contacts"]:
            yield (row["kind"], row["id"]), look, (row["robot_at_fault"], row["other_at_fault"])


def _near_people(run: Trajectory) -> Iterator[tuple[Key, int, tuple[bool, bool]]]:
    for look, k in np.argwhere(run.gaps < run.scene.rules.contact_distance).tolist():
        towards = run.offset[look, k] / max(float(run.distance[look, k]), 1e-9)
        own = float(run.velocity[look] @ towards) > CLOSING
        other = float(-run.people[look, k, 3:5] @ towards) > CLOSING
        yield ("human", run.scene.humans[k].id), look, (own, other)


def _near_barriers(run: Trajectory) -> Iterator[tuple[Key, int, tuple[bool, bool]]]:
    owners: Any = run.scene.barrier_owner
    near = np.argwhere(run.barrier_gaps < run.scene.rules.contact_distance).tolist()
    for m, look in near:
        x, y = run.scene.barriers.subset([m]).towards(run.position[look : look + 1])
        vx, vy = run.velocity[look].tolist()
        closing = (vx * float(x[0, 0]) + vy * float(y[0, 0])) / max(float(np.hypot(x, y)[0, 0]), 1e-9)
        yield owners[m], look, (closing > CLOSING, False)


def _joined(key: Key, looks: dict[int, tuple[bool, bool]]) -> Iterator[Touch]:
    """Consecutive looks as one touch each."""
    order = np.array(sorted(looks))
    for part in np.split(order, np.flatnonzero(np.diff(order) > 1) + 1):
        own, other = zip(*(looks[look] for look in part.tolist()), strict=True)
        yield Touch(*key, int(part[0]), int(part[-1]), any(own), any(other))


ANY_HEADING = 3.14  # rad; a goal with a wider angle takes every heading, as in `episode.ending`


@dataclass(frozen=True, eq=False)
class Trajectory:
    """L looks at a robot among N people: all of an episode up to the look at which the goal is first reached.

    Args:
        record: the episode.
        alone: (T + 1, N, 2), m, where people are at the record's looks when the same seed runs without a robot; None
            if that is not known. See `disturbance.without_robot`.
    """

    record: EpisodeRecord
    alone: Array | None = None

    @cached_property
    def scene(self) -> Scene:
        return self.record.scene()

    @cached_property
    def reached(self) -> int | None:
        """The look at which the robot first is at the goal, by place and heading; None if it never is."""
        robot, goal = self.record.looks.robot, self.scene.goal
        if self.record.outcome.status == "goal":
            return len(robot) - 1
        there = distances(robot[:, :2], goal.position) <= goal.distance
        if goal.angle < ANY_HEADING:
            there &= np.abs(wrap_angles(robot[:, 2] - goal.theta)) <= goal.angle
        return int(np.argmax(there)) if there.any() else None

    def __len__(self) -> int:
        """L, one or more."""
        return len(self.record.looks.robot) if self.reached is None else self.reached + 1

    @cached_property
    def time(self) -> Array:
        """(L,), s."""
        return self.record.looks.time[: len(self)]

    @cached_property
    def lasted(self) -> Array:
        """(L - 1,), s, from each look to the next."""
        return np.diff(self.time)

    @cached_property
    def position(self) -> Array:
        """(L, 2), m, of the robot's centre."""
        return self.record.looks.robot[: len(self), :2]

    @cached_property
    def heading(self) -> Array:
        """(L,), rad, of the robot."""
        return self.record.looks.robot[: len(self), 2]

    @cached_property
    def velocity(self) -> Array:
        """(L, 2), m/s, of the robot, world frame."""
        return self.record.looks.robot[: len(self), 3:5]

    @cached_property
    def people(self) -> Array:
        """(L, N, 7), as `EpisodeRecord.humans`; NaN where not present."""
        return self.record.looks.humans[: len(self)]

    @cached_property
    def present(self) -> Any:
        """(L, N) of bool."""
        return self.record.looks.present[: len(self)]

    @cached_property
    def has_people(self) -> bool:
        """Whether anyone is ever there."""
        return bool(self.present.any())

    @cached_property
    def radii(self) -> Array:
        """(N,), m, of the people's outlines."""
        return np.array([human.radius for human in self.scene.humans], dtype=float)

    @cached_property
    def radius(self) -> float:
        """Of the robot's outline, m."""
        return self.scene.robot.radius

    @cached_property
    def offset(self) -> Array:
        """(L, N, 2), m, from the robot's centre to each person's; NaN where not present."""
        offset: Array = self.people[:, :, :2] - self.position[:, None, :]
        return offset

    @cached_property
    def distance(self) -> Array:
        """(L, N), m, between centres; inf where not present."""
        x, y = self.offset[:, :, 0], self.offset[:, :, 1]
        return np.where(self.present, np.sqrt(x * x + y * y), np.inf)

    @cached_property
    def gaps(self) -> Array:
        """(L, N), m, between outlines, negative where they overlap; inf where not present."""
        return self.distance - self.radii - self.radius

    @cached_property
    def nearest(self) -> Array:
        """(L,), m, from the robot's outline to the nearest person's, 0 where they overlap; inf where nobody is."""
        least: Array = np.maximum(self.gaps.min(axis=1, initial=np.inf), 0.0)
        return least

    @cached_property
    def barrier_gaps(self) -> Array:
        """(M, L), m, from the robot's outline to each of the scene's barriers, negative where they overlap."""
        return self.scene.barriers.gaps(self.position) - self.radius

    @cached_property
    def touches(self) -> list[Touch]:
        """Whom or what the robot touched, in the order in which it began; see `touch`."""
        return touches_of(self)

    @cached_property
    def shortest(self) -> float | None:
        """m, of the shortest way of the robot's outline from its start to the rim of the goal, round walls and
        furniture, people left out; None if there is none.
        """
        goal, scene = self.scene.goal, self.scene
        if not self.radius > 0.0:
            return None
        x, y = self.position[0].tolist()
        way = FreeSpace(scene.outline, scene.barriers, self.radius).distance((x, y), goal.position)
        return max(way - goal.distance, 0.0) if np.isfinite(way) else None


def distances(points: Array, place: Point | Array) -> Array:
    """m, from (…, 2) points to a place or to as many places."""
    away = points - np.asarray(place)
    lengths: Array = np.sqrt(away[..., 0] * away[..., 0] + away[..., 1] * away[..., 1])
    return lengths
