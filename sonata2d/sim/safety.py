"""The robot's safety guard: limits its velocity near outlines, and detects contacts."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Literal

import numpy as np

from ..core.entities import Human
from ..core.humans import VX, VY, X, Y
from ..core.portable_math import Array
from ..core.scene import Scene
from ..core.snapshot import Contact

FASTEST_PERSON = 2.5  # m/s, minimum of the speed that decides which pedestrians can come near within a tick
BARRIER_RANGE = 0.1  # m, added to the robot's own motion for the barriers that can come near within a tick
CLOSING_SPEED = 0.01  # m/s; a side that approaches the other faster than this closes the gap
_EXCESS = 1e-9  # m/s, by which a velocity limit may be exceeded
_PASSES = 4  # over all limits, since keeping one can break another

Vector = tuple[float, float]
Separation = tuple[float, float, float]  # unit vector from the robot to an outline (x, y), and the gap, m
Key = tuple[Literal["human", "object", "wall"], int]
_CONTACT_ORDER = {"human": 0, "object": 1, "wall": 2}


class SafetyGuard:
    """Limits the robot's velocity by the gaps around it, and records contacts and their faults.

    The velocity towards each outline is limited to gap / h, so that a body that moves in steps of h stops at the
    surface. Contacts are detected from gaps as well, and faults from wanted velocities: a robot that wants to move
    into an outline that it touches is at fault even if the guard holds it back.

    Args:
        scene: walls, furniture, radii of the pedestrians, and rules.

    Attributes:
        intervened: whether the velocity was reduced in the current tick.
    """

    def __init__(self, scene: Scene) -> None:
        self._rules, self._robot = scene.rules, scene.robot
        self._barriers, self._owner = scene.barriers, scene.barrier_owner
        self._ids = [human.id for human in scene.humans]
        self._radii = [human.radius for human in scene.humans]
        self._radius = np.array(self._radii, dtype=float)
        speeds = (max(2.0 * human.desired_speed, _track_speed(human, scene)) for human in scene.humans)
        self._human_range = max([FASTEST_PERSON, *speeds]) * scene.rules.dt + scene.rules.contact_distance
        self._near_humans: list[int] = []
        self._near_barriers: list[tuple[int, Vector, Vector, float]] = []  # index, start, start to end, radius
        self._faults: dict[Key, tuple[bool, bool]] = {}  # by outline in contact: of the robot, of the other side
        self.intervened = False

    def contacts(self) -> tuple[Contact, ...]:
        """Contacts of the last tick: humans, objects, walls, each by id."""
        keys = sorted(self._faults, key=lambda key: (_CONTACT_ORDER[key[0]], key[1]))
        return tuple(Contact(*key, *self._faults[key]) for key in keys)

    def begin_tick(self, bodies: Array) -> None:
        """Clear the contacts, and find the outlines that can come near within the tick.

        Args:
            bodies: (N + 1, 4), x, y, vx, vy with the robot last; m and m/s, world frame.
        """
        self._faults, self.intervened = {}, False
        robot, limits = bodies[-1], self._robot.limits
        speed = math.sqrt(float(robot[VX] * robot[VX] + robot[VY] * robot[VY]))
        own = max(speed, limits.ahead + limits.sideways, limits.back + limits.sideways) * self._rules.dt
        dx, dy = bodies[:-1, X] - robot[X], bodies[:-1, Y] - robot[Y]
        gaps = np.sqrt(dx * dx + dy * dy) - self._radius - self._robot.radius
        self._near_humans = np.nonzero(gaps < own + self._human_range)[0].tolist()
        self._near_barriers = []
        if len(self._barriers):
            gaps = self._barriers.gaps(bodies[-1:, X : Y + 1])[:, 0] - self._robot.radius
            for k in np.nonzero(gaps < own + BARRIER_RANGE)[0].tolist():
                (ax, ay), (bx, by) = self._barriers.start[k].tolist(), self._barriers.end[k].tolist()
                self._near_barriers.append((k, (ax, ay), (bx - ax, by - ay), float(self._barriers.radius[k])))

    def limit(self, wanted: Vector, bodies: Array, h: float) -> Vector:
        """Reduce the robot's velocity so that no gap becomes negative within the next substep; record contacts.

        Args:
            wanted: velocity that the drive would set, m/s, world frame.
            bodies: (N + 1, 4), x, y, vx, vy with the robot last; m and m/s, world frame.
            h: duration of the substep, s.

        Returns:
            m/s, world frame.
        """
        if not self._near_humans and not self._near_barriers:
            return wanted
        x, y, vx, vy = bodies[-1].tolist()
        px, py = x + vx * h, y + vy * h  # position from which on the new velocity acts
        separations = self._human_separations(bodies, px, py, h, wanted)
        separations += self._barrier_separations(px, py, wanted)
        if not self._rules.guard:  # contacts are recorded all the same
            return wanted
        vx, vy = wanted
        for _ in range(_PASSES):
            is_reduced = False
            for nx, ny, gap in separations:
                excess = vx * nx + vy * ny - max(gap, 0.0) / h
                if excess > _EXCESS:
                    vx, vy, is_reduced = vx - excess * nx, vy - excess * ny, True
            if not is_reduced:
                break
            self.intervened = True
        else:
            return 0.0, 0.0  # wedged in: no velocity was found that keeps all limits
        return vx, vy

    def _human_separations(self, bodies: Array, px: float, py: float, h: float, wanted: Vector) -> list[Separation]:
        """Separations from the near pedestrians at their predicted positions; records contacts."""
        separations = []
        for k in self._near_humans:
            x, y, vx, vy = bodies[k].tolist()
            nx, ny, gap = _separation(x + vx * h - px, y + vy * h - py, self._radii[k] + self._robot.radius)
            separations.append((nx, ny, gap))
            self._record_contact(("human", self._ids[k]), gap, wanted[0] * nx + wanted[1] * ny, -(vx * nx + vy * ny))
        return separations

    def _barrier_separations(self, px: float, py: float, wanted: Vector) -> list[Separation]:
        """Separations from the near walls and furniture; records contacts."""
        separations = []
        for k, (ax, ay), (dx, dy), radius in self._near_barriers:
            square = dx * dx + dy * dy
            t = ((px - ax) * dx + (py - ay) * dy) / square if square > 0.0 else 0.0
            t = min(max(t, 0.0), 1.0)
            nx, ny, gap = _separation(ax + t * dx - px, ay + t * dy - py, radius + self._robot.radius)
            separations.append((nx, ny, gap))
            kind, owner = self._owner[k]
            key: Key = ("wall" if kind == "wall" else "object", owner)
            self._record_contact(key, gap, wanted[0] * nx + wanted[1] * ny, 0.0)
        return separations

    def _record_contact(self, key: Key, gap: float, own_speed: float, other_speed: float) -> None:
        """Record a contact if the gap is small enough; the speeds are those at which each side closes it, m/s."""
        if gap < self._rules.contact_distance:
            robot, other = self._faults.get(key, (False, False))
            self._faults[key] = (robot or own_speed > CLOSING_SPEED, other or other_speed > CLOSING_SPEED)


def _track_speed(human: Human, scene: Scene) -> float:
    """Maximum speed along the track of a recorded pedestrian, m/s; 0 for other pedestrians."""
    steps = ((x1 - x0, y1 - y0) for (x0, y0), (x1, y1) in pairwise(human.track))
    return max((math.sqrt(dx * dx + dy * dy) for dx, dy in steps), default=0.0) / scene.rules.dt


def _separation(dx: float, dy: float, radii: float) -> Separation:
    """Unit vector along (dx, dy), and its length less `radii`; along x for the null vector."""
    distance = math.sqrt(dx * dx + dy * dy)
    return (dx / distance, dy / distance, distance - radii) if distance > 0.0 else (1.0, 0.0, -radii)
