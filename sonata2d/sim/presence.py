"""Who is there: people come and go in a Space to which no body is added, and from which none is taken, once it runs.

Whoever is absent is parked far outside, each in a place of their own, feels no force, and is in no snapshot.

Who is recorded has a kinematic body: it has no mass that anything could push, takes no forces, passes through walls
and others who are recorded, and shoves aside whoever else is in the way, the robot too. Its velocity is set once a
tick, so that it is on its track at every tick to the bit, but for rounding in the last place.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pymunk

from ..core.portable_math import Array
from ..core.scene import Scene

ENTRY_OVERLAP = 0.04  # m, by which outlines may overlap when somebody comes in; who would overlap more waits


class Presence:
    """Brings people in, takes them away, and carries along those who are recorded.

    Args:
        scene: who comes and goes, and when.
        bodies: of the people, in the scene's order, where they start.

    Attributes:
        is_full: whether everybody is there.
        row: (n,) of int, of those who are there.
        away: (N,) of bool.
        absent: ids of those who are not there.
    """

    def __init__(self, scene: Scene, bodies: list[pymunk.Body]) -> None:
        self._people, self._bodies, self._parking = scene.humans, bodies, scene.parking.tolist()
        self._dt, self._radius = scene.rules.dt, np.array([*(h.radius for h in scene.humans), scene.robot.radius])
        self._recorded = _recorded(scene)
        self._to_come = [k for k, human in enumerate(scene.humans) if human.enters > 0]
        self._to_go = [k for k, human in enumerate(scene.humans) if human.leaves is not None]
        self.away: Any = np.zeros(len(bodies), dtype=bool)
        for k in self._recorded:
            self._put(k, self._people[k].enters)
        for k in self._to_come:
            self._park(k)
        self._count()

    def carry(self, tick: int) -> None:
        """Set those who are recorded going to where they are at the next tick."""
        for k in self._recorded:
            if not self.away[k]:
                (x, y), (u, v) = self._bodies[k].position, self._people[k].place_at(tick + 1)
                self._bodies[k].velocity = (u - x) / self._dt, (v - y) / self._dt

    def turn(self, tick: int, leaving: tuple[int, ...], rows: Array) -> tuple[list[int], list[int]]:
        """Let people come and go.

        Args:
            tick: that begins.
            leaving: who has reached where they leave.
            rows: (N + 1, 4), x, y, vx, vy of all bodies, the robot last.

        Returns:
            Who has come, and who has gone.
        """
        if not (leaving or self._to_go or self._to_come):
            return [], []
        gone = [k for k in leaving if not self.away[k]]
        gone += [k for k in self._to_go if not self.away[k] and tick >= (self._people[k].leaves or 0)]
        for k in gone:
            self._park(k)
        self._to_go = [k for k in self._to_go if k not in gone]
        come = [k for k in self._to_come if self._comes(k, tick, rows)]
        self._to_come = [k for k in self._to_come if k not in come]
        if gone or come:
            self._count()
        return come, gone

    def _comes(self, k: int, tick: int, rows: Array) -> bool:
        """Bring somebody in if it is time and there is room."""
        human = self._people[k]
        is_late = human.leaves is not None and tick >= human.leaves
        if tick < human.enters or is_late or (human.behaviour != "recorded" and not self._has_room(k, rows)):
            return False
        self._put(k, tick)
        rows[k] = (*self._bodies[k].position, *self._bodies[k].velocity)  # whoever comes at the same tick heeds them
        return True

    def _has_room(self, k: int, rows: Array) -> bool:
        x, y = self._people[k].pose.position
        dx, dy = rows[:, 0] - x, rows[:, 1] - y
        gaps = np.sqrt(dx * dx + dy * dy) - self._radius - self._people[k].radius
        gaps[:-1][self.away] = np.inf
        return bool((gaps > -ENTRY_OVERLAP).all())

    def _put(self, k: int, tick: int) -> None:
        """Put somebody into the room: at their start, or where their track has them."""
        human, body = self._people[k], self._bodies[k]
        self.away[k] = False
        body.position, body.velocity = human.pose.position, human.velocity
        if human.behaviour == "recorded":
            (x, y), (u, v) = human.place_at(tick), human.place_at(tick + 1)
            body.position, body.velocity = (x, y), ((u - x) / self._dt, (v - y) / self._dt)

    def _park(self, k: int) -> None:
        self.away[k] = True
        self._bodies[k].position, self._bodies[k].velocity = tuple(self._parking[k]), (0.0, 0.0)

    def _count(self) -> None:
        self.is_full = not self.away.any()
        self.row = np.flatnonzero(~self.away)
        self.row.flags.writeable = False
        self.absent = frozenset(human.id for human, away in zip(self._people, self.away, strict=True) if away)


def _recorded(scene: Scene) -> list[int]:
    """Rows of those who are recorded.

    Raises:
        ValueError: one of them has no track.
    """
    for human in scene.humans:
        if human.behaviour == "recorded" and not human.track:
            raise ValueError(f"human {human.id} is recorded, but has no track; give a place for each tick")
    return [k for k, human in enumerate(scene.humans) if human.behaviour == "recorded"]
