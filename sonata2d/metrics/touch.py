"""Touches: who or what the robot came against, from when to when, and by whose fault.

A touch is a run of consecutive looks, so that leaning on a table for a second is one collision and not ten. It is told
by the recorded contacts, which feel within the tick, and by the gap between outlines at each look, so that imported
episodes, which record no contacts, are judged alike.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from ..bumper import CLOSING
from .run import Run

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


def touches_of(run: Run) -> list[Touch]:
    """All touches of a run, in the order in which they begin."""
    marks: Marks = {}
    for key, look, faults in (*_near_people(run), *_near_barriers(run), *_recorded(run)):  # what was felt comes last
        marks.setdefault(key, {})[look] = faults
    found = [touch for key, looks in marks.items() for touch in _joined(key, looks)]
    return sorted(found, key=lambda touch: (touch.first, touch.kind, touch.id))


def _recorded(run: Run) -> Iterator[tuple[Key, int, tuple[bool, bool]]]:
    document = run.record.document
    for look, told in enumerate([*document["frames"], document["final"]][: len(run)]):
        for row in told["contacts"]:
            yield (row["kind"], row["id"]), look, (row["robot_at_fault"], row["other_at_fault"])


def _near_people(run: Run) -> Iterator[tuple[Key, int, tuple[bool, bool]]]:
    for look, k in np.argwhere(run.gaps < run.scene.rules.contact_distance).tolist():
        towards = run.offset[look, k] / max(float(run.distance[look, k]), 1e-9)
        own = float(run.velocity[look] @ towards) > CLOSING
        other = float(-run.people[look, k, 3:5] @ towards) > CLOSING
        yield ("human", run.scene.humans[k].id), look, (own, other)


def _near_barriers(run: Run) -> Iterator[tuple[Key, int, tuple[bool, bool]]]:
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
