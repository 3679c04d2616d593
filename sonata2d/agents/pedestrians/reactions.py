"""Reactions of pedestrians to the robot: ignore it, avoid it, stop for it, approach it, or flee from it.

They work with every pedestrian model: the model itself ignores the robot. Walking pedestrians change direction and
speed (`velocity_obstacle.evasive_velocity`) to keep their clearance from the robot (Vassallo et al. measured
0.83 ± 0.27 m); scared ones keep more, curious ones less.

- `avoids`: nothing else.
- `stops`: stands still while the robot is near and approaches; walks on once the robot has passed or stands, or after
  6 s.
- `curious`: approaches to `_CURIOUS_CLEARANCE`, unless in a group, stays and faces the robot; loses interest after 8 s
  and regains it after four times the duration without the robot.
- `scared`: walks away while the robot is near and approaches, for 6 s at most. Standing pedestrians step back, as far
  as there is room, and return.

A pedestrian heeds one robot at a time, the nearest of those that it sees. Delays are limited: pedestrians that are kept
from their paths for `_PATIENCE` s accept less clearance.

Source: Vassallo et al., Gait & Posture 51 (2017) 97, for the clearance and for walkers passing behind a robot; the
other rules are ours.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ...core.barrier_grid import Solids, is_crossed, nearest_within
from ...core.compiled.kernel import subroutine
from ...core.compiled.packing import Bools, Floats, Floats2, Ints, zeros
from ...core.compiled.scalar import Vector, exp, length
from ...core.humans import BODY_X, BODY_Y, VX, VY, X, Y
from ...core.portable_math import Array
from ...core.scene import Scene
from ...core.separation import gap_to_line
from .models.base import Walkers, fill_walls
from .robots import Robots, core_of, corners_of
from .velocity_obstacle import WALL_TIME, evasive_velocity, in_conflict, limited_by_walls

_NOTICE_RANGE = 8.0  # m, clearance within which the robot has an effect
_CAUSE_RANGE = 3.0  # m, clearance within which the robot's approach causes `stops` and `scared`
_APPROACH_SPEED = 0.1  # m/s towards the pedestrian, above which the robot approaches
_FAST_APPROACH_SPEED = 0.2  # m/s, above which curious pedestrians evade the robot
_CURIOUS_CLEARANCE = 1.2  # m, at which curious pedestrians stay (Hall's social distance begins there)
_INTEREST_RANGE = 4.0  # m, clearance within which pedestrians become curious
_SCARED_CLEARANCE = 0.7  # m, added to the clearance of scared pedestrians
_MAXIMUM_STEP_BACK, _STEP_BACK_RANGE = 0.8, 1.8  # m: largest step back while standing, and clearance to restore
_CLOSE_CLEARANCE = 0.5  # m, accepted by pedestrians that stop for the robot or are curious, while the reaction lasts
_ASIDE_FRACTION = 0.8  # how much of the direction along the robot's path scared pedestrians leave out when they flee
_TIGHT_CLEARANCE = 0.1  # m, accepted by pedestrians that were delayed for long
_PATIENCE, _MAXIMUM_DELAY = 5.0, 8.0  # s of delay from which the clearance shrinks, and at which it is _TIGHT_CLEARANCE
_REPULSION, _DECAY_LENGTH = 3.0, 0.1  # m/s^2 at contact with the robot, and m over which it falls to 1/e

IGNORES, AVOIDS, STOPS, CURIOUS, SCARED = range(5)
KINDS = {"ignores": IGNORES, "avoids": AVOIDS, "stops": STOPS, "curious": CURIOUS, "scared": SCARED}
# By kind: s after which a reaction ends, and s of it that are recovered per s without the cause.
_DURATION = (0.0, 0.0, 6.0, 8.0, 6.0)
_RECOVERY = (0.0, 0.0, 2.0, 0.25, 2.0)


class Reactions(NamedTuple):
    """The state of all reactions, for kernels.

    Attributes:
        kind: (N,) of int, the reaction of each pedestrian, see above.
        weight: (N,), in [0, 1], how much the robot changes the motion; 0: not at all.
        is_alone: (N,) of bool, not in a group.
        clearance: (N,), m, preferred gap to the robot.
        robot: (N,) of int, the robot that each pedestrian heeds: of those in sight, the nearest one.
        contact_distance: (N,), m, between the centres of pedestrian and robot at which a shoulder may touch the
            robot: half the breadth, whatever the heading, and the extent of the robot towards the pedestrian.
        size: (N,), m, half the breadth.
        elapsed: (N,), s, time that the present reaction has lasted.
        is_exhausted: (N,) of bool, the reaction lasted its full duration and is recovering.
        delay: (N,), s, time for which a pedestrian was kept from its path.
        passing_side: (N,), +1: passes left of the line to the robot, -1: right, 0: neither.
        notices: (N,) of bool, pedestrians that react to the robot and have it in sight and range.
        faces_robot: (N,) of bool, pedestrians whose reaction is in progress.
        gap: (N,), m, between each pedestrian and the robot.
        robot_direction: (N, 2), unit vectors from each pedestrian to the robot.
        velocity: (N, 2), m/s, scratch: adjusted velocities.
        walls: (B, 3), scratch of `fill_walls`.
    """

    kind: Ints
    weight: Floats
    is_alone: Bools
    clearance: Floats
    robot: Ints
    contact_distance: Floats
    size: Floats
    elapsed: Floats
    is_exhausted: Bools
    delay: Floats
    passing_side: Floats
    notices: Bools
    faces_robot: Bools
    gap: Floats
    robot_direction: Floats2
    velocity: Floats2
    walls: Floats2


def initial_reactions(scene: Scene) -> Reactions:
    """The reactions at the start of an episode."""
    humans = scene.humans
    count = len(humans)
    kind = np.array([KINDS[human.reaction] for human in humans], dtype=np.int64)
    clearance = np.array([human.robot_clearance for human in humans], dtype=float)
    return zeros(
        Reactions,
        count,
        kind=kind,
        weight=np.array([human.reacts_to_robot for human in humans], dtype=float),
        is_alone=np.array([human.group is None for human in humans], dtype=bool),
        clearance=np.where(kind == SCARED, clearance + _SCARED_CLEARANCE, clearance),
        size=scene.human_table.circumradius.copy(),
        walls=np.zeros((len(scene.barriers), 3)),
    )


@subroutine
def choose_robot(reactions: Reactions, k: int, robots: Robots, view_blocks: Solids, x: float, y: float) -> bool:
    """Choose the robot that pedestrian k at (x, y), m, heeds; whether it has it in sight.

    Of several robots in sight it is the nearest one; if there is none, the one before.
    """
    if len(robots.state) == 1:
        return not is_crossed(view_blocks, x, y, robots.state[0, X], robots.state[0, Y])
    chosen, least = -1, math.inf
    for r in range(len(robots.state)):
        robot_x, robot_y = robots.state[r, X], robots.state[r, Y]
        distance = length(robot_x - x, robot_y - y) - robots.radius[r]
        if distance < least and not is_crossed(view_blocks, x, y, robot_x, robot_y):
            chosen, least = r, distance
    if chosen >= 0 and chosen != reactions.robot[k]:
        reactions.robot[k], reactions.passing_side[k] = chosen, 0.0
    return chosen >= 0


@subroutine
def notice_robot(reactions: Reactions, k: int, robots: Robots, humans: Array, in_sight: bool, dt: float) -> bool:
    """Observe the robot, and advance the reaction of pedestrian k by one tick; whether the robot has an effect on it.

    Args:
        reactions: after `choose_robot`; updated.
        k: index of a pedestrian that is present.
        robots: of the scene.
        humans: columns of `core.humans`.
        in_sight: whether the pedestrian has the robot in sight.
        dt: tick, s.
    """
    r = reactions.robot[k]
    robot, core = robots.state[r], core_of(robots, r)
    x, y = robot[X] - humans[k, X], robot[Y] - humans[k, Y]
    distance = max(math.sqrt(x * x + y * y), 1e-6)
    reactions.contact_distance[k] = reactions.size[k] + robots.radius[r]
    if len(core) > 1:
        pose, line = (robot[X], robot[Y], robot[BODY_X], robot[BODY_Y]), (humans[k, X], humans[k, Y])
        gap = gap_to_line(core, robots.rounding[r], *pose, corners_of(robots, r), robots.found, (*line, *line, 0.0))
        reactions.contact_distance[k] = reactions.size[k] + distance - gap
    reactions.gap[k] = distance - reactions.contact_distance[k]
    reactions.robot_direction[k, 0], reactions.robot_direction[k, 1] = x / distance, y / distance
    notices = reactions.weight[k] > 0.0 and in_sight and reactions.gap[k] < _NOTICE_RANGE
    reactions.notices[k] = notices
    kind = reactions.kind[k]
    if kind == CURIOUS:
        cause = notices and reactions.gap[k] < _INTEREST_RANGE
    elif kind in (STOPS, SCARED):
        cause = notices and _is_approached(reactions, k, robot, _APPROACH_SPEED) and reactions.gap[k] < _CAUSE_RANGE
    else:
        return notices
    elapsed, is_exhausted = reactions.elapsed[k], reactions.is_exhausted[k]
    if not cause or (kind == CURIOUS and is_exhausted):  # interest recovers although the robot stays
        elapsed -= _RECOVERY[kind] * dt
    elif not is_exhausted:
        elapsed += dt
    elapsed = max(elapsed, 0.0)
    reactions.elapsed[k] = elapsed
    is_exhausted = elapsed >= _DURATION[kind] or (is_exhausted and elapsed > 0.0)
    reactions.is_exhausted[k] = is_exhausted
    reactions.faces_robot[k] = cause and not is_exhausted
    return notices


@subroutine
def _is_approached(reactions: Reactions, k: int, robot: Array, minimum: float) -> bool:
    """Whether the robot's own velocity towards pedestrian k exceeds a minimum, m/s."""
    towards = reactions.robot_direction[k, 0] * robot[VX] + reactions.robot_direction[k, 1] * robot[VY]
    return bool(towards < -minimum)


@subroutine
def adjust_course(
    reactions: Reactions, k: int, robot: Array, walkers: Walkers, desired_x: float, desired_y: float, speed: float,
    is_walking: bool, barriers: Array, side: float, dt: float,
) -> bool:  # fmt: skip
    """Adjust the desired velocity of pedestrian k to the robot; whether it changed.

    Args:
        reactions: after `notice_robot`; `velocity` receives the result, delay and passing side are updated.
        k: index of a pedestrian that is present.
        robot: columns of `core.state`.
        walkers: all pedestrians.
        desired_x, desired_y: desired velocity without the robot, m/s.
        speed: desired speed without the robot, m/s.
        is_walking: whether the pedestrian walks.
        barriers: rows of `Barriers.table`.
        side: +1 passes on the right, -1 on the left, where both cost the same.
        dt: tick, s.
    """
    x, y = robot[X] - walkers.position[k, 0], robot[Y] - walkers.position[k, 1]
    px, py = _preferred_velocity(reactions, k, robot, desired_x, desired_y, speed)
    outline = (walkers.radius[k], 0.0, 1.0, 0.0)  # a disc
    distance = _passing_distance(reactions, k)
    vx, vy, passing_side, walls = px, py, 0.0, -1  # number of rows of `reactions.walls`
    if in_conflict(x, y, px - robot[VX], py - robot[VY], distance):
        walls = fill_walls(reactions.walls, walkers, k, barriers, outline, WALL_TIME, math.inf)
        vx, vy, passing_side = evasive_velocity(
            x, y, px, py, robot[VX], robot[VY], distance, reactions.passing_side[k], side, reactions.walls[:walls]
        )
    reactions.passing_side[k] = passing_side
    avoiding = reactions.notices[k] and is_walking
    if avoiding and reactions.kind[k] == CURIOUS and reactions.faces_robot[k]:
        # Curious pedestrians do not evade a robot that they approach, unless it comes towards them fast.
        avoiding = _is_approached(reactions, k, robot, _FAST_APPROACH_SPEED)
    if not avoiding:
        vx, vy = px, py
    dx, dy = vx - px, vy - py
    is_delayed = avoiding and dx * dx + dy * dy > 0.01
    delay = reactions.delay[k] + (dt if is_delayed else -0.5 * dt)
    reactions.delay[k] = min(max(delay, 0.0), _MAXIMUM_DELAY)
    if not (reactions.notices[k] and is_walking):
        return False
    if vx != desired_x or vy != desired_y:
        if walls < 0:
            walls = fill_walls(reactions.walls, walkers, k, barriers, outline, WALL_TIME, math.inf)
        vx, vy = limited_by_walls(reactions.walls[:walls], vx, vy)
    reactions.velocity[k, 0], reactions.velocity[k, 1] = vx, vy
    return bool(vx != desired_x or vy != desired_y)


@subroutine
def _preferred_velocity(
    reactions: Reactions, k: int, robot: Array, desired_x: float, desired_y: float, speed: float
) -> Vector:
    """The velocity that the reaction asks for, m/s, before a collision with the robot is avoided."""
    if not reactions.faces_robot[k]:
        return desired_x, desired_y
    kind, ux, uy = reactions.kind[k], reactions.robot_direction[k, 0], reactions.robot_direction[k, 1]
    if kind == STOPS:
        return 0.0, 0.0
    if kind == SCARED:
        fx, fy = _flight_direction(ux, uy, robot[VX], robot[VY])
        return speed * fx, speed * fy
    if kind == CURIOUS and reactions.is_alone[k]:
        approach = min(max((reactions.gap[k] - _CURIOUS_CLEARANCE) / 0.5, -0.4), speed)
        return approach * ux, approach * uy
    return desired_x, desired_y


@subroutine
def _flight_direction(ux: float, uy: float, vx: float, vy: float) -> Vector:
    """The unit vector away from a moving robot, to the side rather than along its path.

    Args:
        ux, uy: unit vector to the robot.
        vx, vy: of the robot, m/s.
    """
    speed = max(math.sqrt(vx * vx + vy * vy), 1e-6)
    along = max(-(ux * vx + uy * vy) / speed, 0.0) * _ASIDE_FRACTION / speed
    x, y = -ux - along * vx, -uy - along * vy
    size = max(math.sqrt(x * x + y * y), 1e-6)
    return x / size, y / size


@subroutine
def _passing_distance(reactions: Reactions, k: int) -> float:
    """The distance of centres at which pedestrian k wants to pass the robot now, m."""
    patience = min(max((_MAXIMUM_DELAY - reactions.delay[k]) / (_MAXIMUM_DELAY - _PATIENCE), 0.0), 1.0)
    clearance = reactions.clearance[k]
    if reactions.faces_robot[k] and reactions.kind[k] in (CURIOUS, STOPS):
        clearance = min(clearance, _CLOSE_CLEARANCE)
    tight = min(clearance, _TIGHT_CLEARANCE)
    return float(reactions.contact_distance[k] + tight + (clearance - tight) * patience)


@subroutine
def apply_adjustment(
    reactions: Reactions, k: int, desired_x: float, desired_y: float, ux: float, uy: float
) -> tuple[float, float, float]:
    """The adjusted direction and speed of pedestrian k, from `Reactions.velocity`.

    Args:
        reactions: after `adjust_course`.
        k: index of a walking pedestrian on which the robot has an effect.
        desired_x, desired_y: desired velocity without the robot, m/s.
        ux, uy: desired direction without the robot, which is kept by a pedestrian that stops.

    Returns:
        Direction x, y, and speed, m/s.
    """
    weight = reactions.weight[k]
    vx = desired_x + (reactions.velocity[k, 0] - desired_x) * weight
    vy = desired_y + (reactions.velocity[k, 1] - desired_y) * weight
    speed = math.sqrt(vx * vx + vy * vy)
    if speed > 1e-3:
        ux, uy = vx / speed, vy / speed
    return ux, uy, speed


@subroutine
def robot_repulsion(reactions: Reactions, k: int, x: float, y: float, robot_x: float, robot_y: float) -> Vector:
    """Repulsion of pedestrian k at (x, y) from the robot's outline, m/s^2."""
    if not reactions.notices[k]:
        return 0.0, 0.0
    dx, dy = x - robot_x, y - robot_y
    distance = max(math.sqrt(dx * dx + dy * dy), 1e-6)
    free = max(distance - reactions.contact_distance[k], 0.0)
    push = reactions.weight[k] * _REPULSION * exp(free * (-1.0 / _DECAY_LENGTH)) / distance
    return dx * push, dy * push


@subroutine
def step_back(reactions: Reactions, k: int, robot: Array, x: float, y: float, radius: float, solids: Solids) -> Vector:
    """Where a standing pedestrian stands with the robot near: a scared one a step back from (x, y), m."""
    if reactions.kind[k] != SCARED or not reactions.notices[k]:
        return x, y
    dx, dy = x - robot[X], y - robot[Y]
    distance = max(math.sqrt(dx * dx + dy * dy), 1e-6)
    _, room = nearest_within(solids, x, y, radius + 0.05 + _MAXIMUM_STEP_BACK)
    room = room - radius - 0.05
    step = max(_STEP_BACK_RANGE - (distance - reactions.contact_distance[k]), 0.0)
    step = min(min(step, _MAXIMUM_STEP_BACK), max(room, 0.0))
    return x + dx * (step / distance), y + dy * (step / distance)
