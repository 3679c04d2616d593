"""What the pedestrian models share: their input and interface, driving force, side bias, walls and lines of sight."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from ....core.geometry import Barriers, Point, segments_cross
from ....core.portable_math import Array, exp
from ....core.scene import Scene
from ....registry import PEDESTRIAN_MODELS


@dataclass(frozen=True, slots=True)
class Walkers:
    """All who move, the robot last: M of them, in the scene's order. SI, world frame.

    Attributes:
        position, velocity: (M, 2).
        desired_direction: (M, 2), unit vectors towards the next waypoint; zero for those who stay and for the robot.
        body_direction: (M, 2), unit vectors of the bodies.
        desired_speed: (M,), m/s.
        radius: (M,), m.
        weight: (M, M), how much column i minds row j, 0..1: nobody minds themselves, or whom a wall hides.
        member: (M, M), 1 where row j walks in column i's group, else 0; None where nobody walks in one.
        bond: (M,), 0..1, how much they keep to their group: less where they have goals of their own.
    """

    position: Array
    velocity: Array
    desired_direction: Array
    body_direction: Array
    desired_speed: Array
    radius: Array
    weight: Array
    member: Array | None = None
    bond: Array | None = None


def times_a_tick(evaluations: int, dt: float) -> int:
    """In a tick of dt, s, of a law that needs so many evaluations in 0.1 s; of one that is not stiff, one."""
    return 1 if evaluations == 1 else max(int(evaluations * dt / 0.1 + 0.999), 1)


class PedestrianModel(Protocol):
    """A law of walking, made for one scene.

    Attributes:
        evaluations: how often within a tick of 0.1 s its forces must be evaluated.
        headed: whether pedestrians walk where their bodies face, so that bodies turn towards the next waypoint.
    """

    evaluations: int
    headed: bool

    def __init__(self, scene: Scene) -> None: ...

    def acceleration(self, walkers: Walkers) -> Array:
        """(M, 2), m/s2, of everybody."""


def pedestrian_model(name: str) -> type[PedestrianModel]:
    """The pedestrian model of a name.

    Raises:
        Sonata2dError: there is no such model, or the plug-in that provides it does not load.
    """
    model: type[PedestrianModel] = PEDESTRIAN_MODELS.load(name, _problem)
    return model


def _problem(found: object) -> str | None:
    """Why an object cannot be used as a pedestrian model."""
    missing = [part for part in ("acceleration", "evaluations", "headed") if not hasattr(found, part)]
    if not isinstance(found, type) or missing:
        return f"is no pedestrian model; it must be a class with {', '.join(missing) or 'an initialiser'}"
    return None


BRISK = 1.0  # m/s, from which the starting time counts for nothing
HELD = 0.8  # of the desired speed, below which the following time counts in full
HARDEST = 4.0  # m/s2, at which people start or brake


def desired_acceleration(velocity: Array, direction: Array, desired_speed: Array, *, relaxation_time: float) -> Array:
    """Accelerate each human towards its desired velocity.

    Args:
        velocity: (N, 2), m/s, world frame.
        direction: (N, 2), unit vectors towards each human's next waypoint, or zero to stop.
        desired_speed: (N,), m/s.
        relaxation_time: seconds in which a lag fades; positive.

    Returns:
        (N, 2), m/s2.

    Raises:
        ValueError: relaxation_time is zero or less.

    Source: Helbing & Molnár, Phys. Rev. E 51 (1995) 4282, eq. 2.
    """
    if relaxation_time <= 0.0:
        raise ValueError(f"relaxation_time must be positive, got {relaxation_time}")
    tau = relaxation_time  # τ
    return (direction * desired_speed[:, None] - velocity) / tau


@dataclass(frozen=True, slots=True)
class Gait:
    """In which time a lag fades, s, all positive.

    Attributes:
        relaxation_time: of speed, for one who walks freely.
        following_time: of speed, for one whom others hold to less than `HELD` of the desired speed.
        starting_time: of speed, for one who hardly moves.
        turning_time: of what goes across the way.
    """

    relaxation_time: float
    following_time: float
    starting_time: float
    turning_time: float


def paced_acceleration(velocity: Array, direction: Array, speed: Array, desired_speed: Array, gait: Gait) -> Array:
    """As `desired_acceleration`, for people who start at once, follow others smoothly, and turn quickly.

    Args:
        velocity: (N, 2), m/s.
        direction: (N, 2), unit vectors, or zero to stop.
        speed: (N,), m/s, that the others allow.
        desired_speed: (N,), m/s, without them.
        gait: the times.

    Returns:
        (N, 2), m/s2.

    Source: ours; the times were found on recorded pedestrians.
    """
    ahead = velocity[:, 0] * direction[:, 0] + velocity[:, 1] * direction[:, 1]
    along = direction * ahead[:, None]
    lost = np.where(desired_speed > 1e-3, 1.0 - speed / np.maximum(desired_speed, 1e-3), 0.0)  # who wants to stop, does
    held = np.minimum(np.maximum(lost / (1.0 - HELD), 0.0), 1.0)
    tau = gait.relaxation_time + (gait.following_time - gait.relaxation_time) * held
    tau = gait.starting_time + (tau - gait.starting_time) * np.minimum(np.maximum(ahead / BRISK, 0.0), 1.0)
    wanted = np.minimum(np.maximum((speed - ahead) / tau, -HARDEST), HARDEST)
    return direction * wanted[:, None] - (velocity - along) / gait.turning_time


def standing_acceleration(position: Array, velocity: Array, home: Array, *, rate: float = 2.0) -> Array:
    """Bring back whoever stands and was pushed: a critically damped pull to where they stood.

    Args:
        position: (N, 2), m.
        velocity: (N, 2), m/s.
        home: (N, 2), m, where they stand.
        rate: 1/s; most of the way back takes some 2 / rate seconds.

    Returns:
        (N, 2), m/s2.
    """
    return (home - position) * (rate * rate) - velocity * (2.0 * rate)


LEAN = 0.003  # of the way ahead: 3 mm a metre


def leaning(direction: Array, side: int) -> Array:
    """Ways that lean a little to the side of the rules.

    Laws that know no side leave two who meet head-on face to face. Their papers add chance or begin unevenly; here
    chance has no part in forces, so that a mirrored scene is a mirrored motion.

    Args:
        direction: (M, 2), unit vectors, or zero, which stays zero.
        side: +1 leans to the right, -1 to the left.

    Returns:
        (M, 2), of length 1 within 5e-6.

    Source: ours.
    """
    x, y = direction[:, 0], direction[:, 1]
    return np.stack((x + side * LEAN * y, y - side * LEAN * x), axis=1)


def wall_acceleration(position: Array, radius: Array, barriers: Barriers, *, strength: float, reach: float) -> Array:
    """Push away from walls and furniture.

    Args:
        position: (N, 2), m.
        radius: (N,), m.
        barriers: M thick segments.
        strength: m/s2, at the skin.
        reach: m, in which the push falls to 1/e.

    Returns:
        (N, 2), m/s2, summed in the order of the barriers.

    Source: Moussaïd et al., Proc. R. Soc. B 276 (2009) 2755, wall term a exp(-d/b), with d from outline to wall.
    """
    x, y = barriers.towards(position)
    apart = np.maximum(np.sqrt(x * x + y * y), 1e-6)
    gap = np.maximum(apart - barriers.radius[:, None] - radius, 0.0)
    push = exp(gap * (-1.0 / reach)) * (-strength) / apart
    return np.stack((np.add.reduce(push * x, axis=0), np.add.reduce(push * y, axis=0)), axis=1)


class Sight:
    """Who has whom in the line of sight; forces do not go through walls.

    Args:
        scene: its inner walls, and the edges off its outline's convex hull, can stand between two people in the room.
        count: M, how many look.
    """

    def __init__(self, scene: Scene, count: int) -> None:
        self._walls = Barriers.of(_blocking(scene))
        self._pairs = np.triu_indices(count, 1)
        self._all = np.ones((count, count), dtype=bool)

    def seen(self, position: Array) -> Any:
        """(M, M) of bool, from (M, 2), m."""
        if not len(self._walls):
            return self._all
        first, second = self._pairs
        hidden = segments_cross(position[first], position[second], self._walls).any(axis=0)
        first, second = first[hidden], second[hidden]
        seen = self._all.copy()
        seen[first, second] = seen[second, first] = False
        return seen


def _blocking(scene: Scene) -> Iterator[tuple[Point, Point, float]]:
    for k, wall in enumerate(scene.walls):
        (ax, ay), (bx, by) = wall.start, wall.end
        sides = [(bx - ax) * (y - ay) - (by - ay) * (x - ax) for x, y in scene.polygon]
        if k >= len(scene.polygon) or min(sides) < -1e-9:
            yield wall.start, wall.end, 0.0
