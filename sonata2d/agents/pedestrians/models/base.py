"""What the pedestrian models share: input, interface, driving force, side bias, walls and lines of sight.

Pair matrices inside the models have the shape (M, M), with row j for the neighbour and column i for the agent that the
force acts on. Forces are summed over axis 0, which adds the neighbours one by one in the scene's order: the order of a
floating-point sum decides its last bits. NumPy sums only arrays of a single column in another order (pairwise); as the
robot is one of the M rows, M is at least 2 wherever there is a pedestrian.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ....core.geometry import Barriers, Point, segments_cross
from ....core.portable_math import Array, BoolArray, exp
from ....core.scene import Scene
from ....registry import PEDESTRIAN_MODELS


@dataclass(frozen=True, slots=True)
class Walkers:
    """Input of a pedestrian model: the M - 1 pedestrians in the scene's order, then the robot. World frame.

    Attributes:
        position: (M, 2), m.
        velocity: (M, 2), m/s.
        desired_direction: (M, 2), unit vectors towards the next waypoint; zero for standing pedestrians and the robot.
        body_direction: (M, 2), unit vectors.
        desired_speed: (M,), m/s.
        radius: (M,), m.
        attention: (M, M), how much agent i attends to agent j, in [0, 1]: `attention[i, j]`, ego first. Zero on the
            diagonal, for absent agents and where a wall blocks the line of sight.
        member: (M, M), symmetric: 1 where two agents walk in one group, else 0 (0 on the diagonal); None if there is
            no walking group.
        bond: (M,), in [0, 1], how closely each agent keeps to its group: less for members with goals of their own.
    """

    position: Array
    velocity: Array
    desired_direction: Array
    body_direction: Array
    desired_speed: Array
    radius: Array
    attention: Array
    member: Array | None = None
    bond: Array | None = None


def pair_weights(walkers: Walkers) -> Array:
    """The attention in the layout of pair matrices: (M, M), row j, column i, how much i attends to j.

    The copy is C-contiguous: NumPy's order of summation, and with it the last bits of a force, depends on the memory
    layout.
    """
    return np.ascontiguousarray(walkers.attention.T)


def evaluations_per_tick(evaluations: int, dt: float) -> int:
    """How often to evaluate the forces in a tick.

    Args:
        evaluations: in 0.1 s, see `PedestrianModel`; 1 for a model that is not stiff.
        dt: tick, s.

    Returns:
        At least 1; always 1 for a model that is not stiff.
    """
    return 1 if evaluations == 1 else max(int(evaluations * dt / 0.1 + 0.999), 1)


class PedestrianModel(Protocol):
    """A pedestrian model, created for one scene.

    Attributes:
        evaluations: how often the forces must be evaluated in 0.1 s; more than 1 for stiff models.
        headed: True if pedestrians walk where their bodies face; bodies then turn towards the next waypoint.
    """

    evaluations: int
    headed: bool

    def __init__(self, scene: Scene) -> None: ...

    def acceleration(self, walkers: Walkers) -> Array:
        """Acceleration of all agents, (M, 2), m/s^2, world frame; the robot's row is not used by the crowd."""


def pedestrian_model(name: str) -> type[PedestrianModel]:
    """The class of a pedestrian model.

    Raises:
        Sonata2dError: the name is unknown, or the plug-in that provides the model does not load.
    """
    model: type[PedestrianModel] = PEDESTRIAN_MODELS.load(name, _problem)
    return model


def _problem(found: object) -> str | None:
    """Why an object cannot be used as a pedestrian model, or None."""
    missing = [name for name in ("acceleration", "evaluations", "headed") if not hasattr(found, name)]
    if not isinstance(found, type):
        return "is not a pedestrian model; it must be a class"
    return f"is not a pedestrian model; it lacks {', '.join(missing)}" if missing else None


def desired_acceleration(velocity: Array, direction: Array, desired_speed: Array, *, relaxation_time: float) -> Array:
    """Accelerate each pedestrian towards its desired velocity.

    Args:
        velocity: (N, 2), m/s, world frame.
        direction: (N, 2), unit vectors towards the next waypoint; zero to stop.
        desired_speed: (N,), m/s.
        relaxation_time: time constant of the velocity error, s; positive.

    Returns:
        (N, 2), m/s^2.

    Raises:
        ValueError: relaxation_time is zero or negative.

    Source: Helbing & Molnár, Phys. Rev. E 51 (1995) 4282, eq. 2.
    """
    if relaxation_time <= 0.0:
        raise ValueError(f"relaxation_time must be positive, got {relaxation_time}")
    tau = relaxation_time  # τ
    return (direction * desired_speed[:, None] - velocity) / tau


FAST_WALK = 1.0  # m/s, from which the starting time has no effect
FOLLOWING_FRACTION = 0.8  # of the desired speed; at lower permitted speeds the following time applies in full
MAXIMUM_SPEED_CHANGE = 4.0  # m/s^2, limit of acceleration and braking along the path


@dataclass(frozen=True, slots=True)
class TimeConstants:
    """Time constants of the velocity error, s, all positive.

    Attributes:
        relaxation_time: of the speed of a pedestrian that walks freely.
        following_time: of the speed of a pedestrian that others slow down to `FOLLOWING_FRACTION` of its desired
            speed or less.
        starting_time: of the speed of a pedestrian that hardly moves.
        turning_time: of the velocity component across the path.
    """

    relaxation_time: float
    following_time: float
    starting_time: float
    turning_time: float


def adaptive_acceleration(
    velocity: Array, direction: Array, speed: Array, desired_speed: Array, times: TimeConstants
) -> Array:
    """Like `desired_acceleration`, for pedestrians that start at once, follow others smoothly and turn quickly.

    Args:
        velocity: (N, 2), m/s.
        direction: (N, 2), unit vectors; zero to stop.
        speed: (N,), m/s, the speed that the others permit.
        desired_speed: (N,), m/s, the speed without the others.
        times: the time constants.

    Returns:
        (N, 2), m/s^2.

    Source: ours; the time constants were fitted to recorded pedestrians.
    """
    ahead = velocity[:, 0] * direction[:, 0] + velocity[:, 1] * direction[:, 1]
    along = direction * ahead[:, None]
    # A pedestrian that wants to stop (desired speed 0) is not held back by others.
    reduction = np.where(desired_speed > 1e-3, 1.0 - speed / np.maximum(desired_speed, 1e-3), 0.0)
    held = np.minimum(np.maximum(reduction / (1.0 - FOLLOWING_FRACTION), 0.0), 1.0)
    tau = times.relaxation_time + (times.following_time - times.relaxation_time) * held
    tau = times.starting_time + (tau - times.starting_time) * np.minimum(np.maximum(ahead / FAST_WALK, 0.0), 1.0)
    change = np.minimum(np.maximum((speed - ahead) / tau, -MAXIMUM_SPEED_CHANGE), MAXIMUM_SPEED_CHANGE)
    return direction * change[:, None] - (velocity - along) / times.turning_time


def standing_acceleration(position: Array, velocity: Array, standing_position: Array, *, rate: float = 2.0) -> Array:
    """Return standing pedestrians that were pushed to their places: a critically damped spring.

    Args:
        position: (N, 2), m.
        velocity: (N, 2), m/s.
        standing_position: (N, 2), m.
        rate: 1/s; most of the way back takes about 2 / rate seconds.

    Returns:
        (N, 2), m/s^2.
    """
    return (standing_position - position) * (rate * rate) - velocity * (2.0 * rate)


SIDE_BIAS = 0.003  # sideways component of a biased direction: 3 mm per metre


def biased_directions(direction: Array, side: int) -> Array:
    """Lean directions slightly to the side of the rules.

    Models without a side leave two pedestrians that meet head-on face to face. Their papers add noise or start
    asymmetrically; here forces contain no random numbers, so that a mirrored scene gives mirrored motion.

    Args:
        direction: (M, 2), unit vectors, or zero, which stays zero.
        side: +1 leans to the right, -1 to the left.

    Returns:
        (M, 2), of length 1 within 5e-6.

    Source: ours.
    """
    x, y = direction[:, 0], direction[:, 1]
    return np.stack((x + side * SIDE_BIAS * y, y - side * SIDE_BIAS * x), axis=1)


def wall_acceleration(
    position: Array, radius: Array, barriers: Barriers, *, strength: float, decay_length: float
) -> Array:
    """Repulsion from walls and furniture.

    Args:
        position: (N, 2), m.
        radius: (N,), m.
        barriers: thick segments.
        strength: m/s^2, at contact.
        decay_length: distance over which the repulsion falls to 1/e, m.

    Returns:
        (N, 2), m/s^2, summed in the order of the barriers.

    Source: Moussaïd et al., Proc. R. Soc. B 276 (2009) 2755, wall term a exp(-d/b), with d from outline to wall.
    """
    x, y = barriers.towards(position)
    distance = np.maximum(np.sqrt(x * x + y * y), 1e-6)
    gap = np.maximum(distance - barriers.radius[:, None] - radius, 0.0)
    push = exp(gap * (-1.0 / decay_length)) * (-strength) / distance
    return np.stack((np.add.reduce(push * x, axis=0), np.add.reduce(push * y, axis=0)), axis=1)


class LineOfSight:
    """Which agents see each other; social forces do not act through walls.

    Args:
        scene: its inner walls, and the edges of its outline that are not on the convex hull, can block the view.
        count: M, the number of agents.
    """

    def __init__(self, scene: Scene, count: int) -> None:
        self._walls = Barriers.of(_blocking_walls(scene))
        self._pairs = np.triu_indices(count, 1)
        self._all = np.ones((count, count), dtype=bool)

    def visible(self, position: Array) -> BoolArray:
        """Symmetric (M, M) from positions (M, 2), m: whether each pair has a free line of sight."""
        if not len(self._walls):
            return self._all
        first, second = self._pairs
        hidden = segments_cross(position[first], position[second], self._walls).any(axis=0)
        first, second = first[hidden], second[hidden]
        visible = self._all.copy()
        visible[first, second] = visible[second, first] = False
        return visible


def _blocking_walls(scene: Scene) -> Iterator[tuple[Point, Point, float]]:
    """Inner walls, and edges of the outline with a corner of the room on their outer side."""
    for k, wall in enumerate(scene.walls):
        (ax, ay), (bx, by) = wall.start, wall.end
        sides = [(bx - ax) * (y - ay) - (by - ay) * (x - ax) for x, y in scene.polygon]
        if k >= len(scene.polygon) or min(sides) < -1e-9:  # the first walls are the edges of the outline
            yield wall.start, wall.end, 0.0
