"""`Task`: what a pedestrian does between two walks to random places, from its choice to its end."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from ....core.entities import Door
from ....core.geometry import Point
from .queue_line import QueueLine

Kind = Literal["visit", "talk", "stay", "sit", "queue", "exit"]


@dataclass(slots=True)
class Task:
    """A visit, a conversation, a pause, a rest on a seat, a time in a queue, or the way out of one pedestrian.

    Attributes:
        kind: what it is.
        position: where to stand, m; for a seat the place beside it; for a door where to leave.
        facing_point: what to face, m.
        object_id: the object to attend to or to sit on, if any.
        partner: index of a pedestrian to join, if any.
        line: the queue to join, if any.
        door: the door to leave through, if any.
        until: tick at which the task ends, or, on the way there, at which it is given up.
        has_arrived: False on the way to the position.
        phase: of a rest on a seat, see `sitting`.
    """

    kind: Kind
    position: Point
    facing_point: Point
    object_id: int | None = None
    partner: int | None = None
    line: QueueLine | None = None
    door: Door | None = None
    until: int = 0
    has_arrived: bool = False
    phase: int = 0
