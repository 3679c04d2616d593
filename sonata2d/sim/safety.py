"""The robot's guard and its sense of touch: what is near enough to matter within a tick, and what was touched."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Literal

import numpy as np

from ..core.entities import Human
from ..core.portable_math import Array
from ..core.scene import Scene
from ..core.snapshot import Contact

FASTEST_PERSON = 2.5  # m/s, counted on at least when looking for who may come near within a tick
CLOSING = 0.01  # m/s, from which a velocity towards the other counts as closing the gap
_PASSES = 4

Vector = tuple[float, float]
Key = tuple[Literal["human", "object", "wall"], int]


class SafetyGuard:
    """Limits the robot's velocity by the gaps around it, and notes whom it touches by whose fault.

    The limit along the way to each outline is gap / h, so that a body that moves in steps of h stops at the skin.
    Contacts are told by the gap as well, so the guard hides nothing: who wants to go on into a touched outline is at
    fault even when held back.

    Args:
        scene: walls, furniture, people's radii and the rules.
    """

    def __init__(self, scene: Scene) -> None:
        self._rules, self._robot = scene.rules, scene.robot
        self._barriers, self._owner = scene.barriers, scene.barrier_owner
        self._ids = [human.id for human in scene.humans]
        self._radii = [human.radius for human in scene.humans]
        self._radius = np.array(self._radii, dtype=float)
        fastest = max([FASTEST_PERSON, *(max(2.0 * h.desired_speed, _top_speed(h, scene)) for h in scene.humans)])
        self._reach_of_people = fastest * scene.rules.dt + scene.rules.contact_distance
        self._near_people: list[int] = []
        self._near_barriers: list[tuple[int, Vector, Vector, float]] = []
        self._touched: dict[Key, tuple[bool, bool]] = {}
        self.stepped_in = False

    def contacts(self) -> tuple[Contact, ...]:
        """Whom the robot touched in the last tick, people first, by id."""
        order = {"human": 0, "object": 1, "wall": 2}
        keys = sorted(self._touched, key=lambda key: (order[key[0]], key[1]))
        return tuple(Contact(*key, *self._touched[key]) for key in keys)

    def begin_tick(self, bodies: Array) -> None:
        """Find what may come near within the tick. `bodies`: (N + 1, 4), x, y, vx, vy, the robot last."""
        self._touched, self.stepped_in = {}, False
        robot, limits = bodies[-1], self._robot.limits
        speed = math.sqrt(float(robot[2] * robot[2] + robot[3] * robot[3]))
        own = max(speed, limits.ahead + limits.sideways, limits.back + limits.sideways) * self._rules.dt
        dx, dy = bodies[:-1, 0] - robot[0], bodies[:-1, 1] - robot[1]
        gaps = np.sqrt(dx * dx + dy * dy) - self._radius - self._robot.radius
        self._near_people = np.nonzero(gaps < own + self._reach_of_people)[0].tolist()
        self._near_barriers = []
        if len(self._barriers):
            gaps = self._barriers.gaps(bodies[-1:, :2])[:, 0] - self._robot.radius
            for k in np.nonzero(gaps < own + 0.1)[0].tolist():
                (ax, ay), (bx, by) = self._barriers.start[k].tolist(), self._barriers.end[k].tolist()
                self._near_barriers.append((k, (ax, ay), (bx - ax, by - ay), float(self._barriers.radius[k])))

    def limit(self, wanted: Vector, bodies: Array, h: float) -> Vector:
        """The wanted velocity, cut down so that no gap closes beyond zero within the next substep.

        Args:
            wanted: m/s, world frame.
            bodies: (N + 1, 4), x, y, vx, vy, the robot last.
            h: s, the substep.

        Returns:
            m/s, world frame.
        """
        if not self._near_people and not self._near_barriers:
            return wanted
        x, y, vx, vy = bodies[-1].tolist()
        px, py = x + vx * h, y + vy * h  # where it will be when the new velocity begins to act
        sides = self._towards_people(bodies, px, py, h, wanted) + self._towards_barriers(px, py, wanted)
        if not self._rules.guard:
            return wanted
        vx, vy = wanted
        for _ in range(_PASSES):
            cut = False
            for nx, ny, gap in sides:
                excess = vx * nx + vy * ny - max(gap, 0.0) / h
                if excess > 1e-9:
                    vx, vy, cut = vx - excess * nx, vy - excess * ny, True
            if not cut:
                break
            self.stepped_in = True
        else:
            return 0.0, 0.0  # wedged in: no way satisfies all sides
        return vx, vy

    def _towards_people(
        self, bodies: Array, px: float, py: float, h: float, wanted: Vector
    ) -> list[tuple[float, float, float]]:
        """Unit vector to and gap of each near person at the predicted places; notes touches."""
        sides = []
        for k in self._near_people:
            qx, qy, ux, uy = bodies[k].tolist()
            nx, ny, gap = _side(qx + ux * h - px, qy + uy * h - py, self._radii[k] + self._robot.radius)
            sides.append((nx, ny, gap))
            self._feel(("human", self._ids[k]), gap, wanted[0] * nx + wanted[1] * ny, -(ux * nx + uy * ny))
        return sides

    def _towards_barriers(self, px: float, py: float, wanted: Vector) -> list[tuple[float, float, float]]:
        """The same for walls and furniture."""
        sides = []
        for k, (ax, ay), (dx, dy), radius in self._near_barriers:
            square = dx * dx + dy * dy
            t = ((px - ax) * dx + (py - ay) * dy) / square if square > 0.0 else 0.0
            t = min(max(t, 0.0), 1.0)
            nx, ny, gap = _side(ax + t * dx - px, ay + t * dy - py, radius + self._robot.radius)
            sides.append((nx, ny, gap))
            kind, owner = self._owner[k]
            self._feel(("wall" if kind == "wall" else "object", owner), gap, wanted[0] * nx + wanted[1] * ny, 0.0)
        return sides

    def _feel(self, key: Key, gap: float, own: float, others: float) -> None:
        """Note a touch: how fast either side closes the gap, m/s."""
        if gap < self._rules.contact_distance:
            robot, other = self._touched.get(key, (False, False))
            self._touched[key] = (robot or own > CLOSING, other or others > CLOSING)


def _top_speed(human: Human, scene: Scene) -> float:
    """Of one who is recorded, m/s; 0 for the others."""
    steps = ((u - x, v - y) for (x, y), (u, v) in pairwise(human.track))
    return max((math.sqrt(dx * dx + dy * dy) for dx, dy in steps), default=0.0) / scene.rules.dt


def _side(dx: float, dy: float, reach: float) -> tuple[float, float, float]:
    """Unit vector along (dx, dy) and what is left of it beyond `reach`."""
    apart = math.sqrt(dx * dx + dy * dy)
    return (dx / apart, dy / apart, apart - reach) if apart > 0.0 else (1.0, 0.0, -reach)
