"""Reactions of pedestrians to the robot: ignore it, avoid it, stop for it, approach it, or keep far away from it.

They work with every pedestrian model: the model itself ignores the robot. A pedestrian reacts to what it sees: a robot
in the field of view of its body or of its head. Walking pedestrians change speed and direction
(`velocity_obstacle.evasive_velocity`) to keep their clearance from the robot. Standing ones step aside, as far as there
is room, from a robot that would come nearer, and return.

- `avoids`: nothing else.
- `stops`: comes to a stand while the robot is near and approaches; walks on once the robot has passed or stands, or
  after 6 s.
- `curious`: approaches to the social distance, unless in a group, stays and faces the robot; loses interest after 8 s
  and regains it after four times the duration without the robot.
- `scared`: keeps the social distance.

A pedestrian heeds one robot at a time, the nearest of those that it sees. Delays are limited: pedestrians that are kept
from their paths for `_PATIENCE` s accept less clearance.

Source: the clearance, the field of view and the course past the robot are fitted to recorded encounters (Day &
Karamouzas, A Study in Zucker, IEEE RA-L 2024); social distances are from Hall, The Hidden Dimension (1966); the times
are ours.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ...core.barrier_grid import Solids, is_blocked, is_crossed, nearest_within
from ...core.compiled.kernel import subroutine
from ...core.compiled.packing import Bools, Floats, Floats2, Ints, zeros
from ...core.compiled.scalar import Vector, exp, length
from ...core.humans import BODY_X, BODY_Y, GAZE_X, GAZE_Y, VX, VY, X, Y
from ...core.portable_math import Array
from ...core.scene import Scene
from ...core.separation import gap_to_line
from .models.base import Walkers, fill_walls
from .robots import Robots, core_of, corners_of
from .velocity_obstacle import WALL_TIME, evasive_velocity, in_conflict, limited_by_walls

_FAR = 1e6  # m
_NOTICE_RANGE = 8.0  # m, clearance within which the robot has an effect
# Hall's social distance, m: its near phase begins at the first and ends at the second. Curious and scared pedestrians
# keep the first as their clearance; a robot that approaches within the second one stops those that stop.
_SOCIAL_DISTANCE, _FAR_SOCIAL_DISTANCE = 1.2, 2.1
_VIEW_COSINE = -0.35  # of 110 degrees, the angle from the direction of body or head up to which the robot is seen
_APPROACH_SPEED = 0.1  # m/s towards the pedestrian, above which the robot approaches
_FAST_APPROACH_SPEED = 0.2  # m/s, above which curious pedestrians evade the robot
HEED_RANGE = 3.0  # m, clearance within which pedestrians deviate less from their course
_INTEREST_RANGE = 4.0  # m, clearance within which pedestrians become curious
_HURRY, _EVASION_SPEED = 1.15, 0.8  # largest speed past a robot, as a factor of the own one, and if that is small, m/s
# s, over which a walker comes to a stand before a robot that blocks its way, and m, what it keeps beyond its clearance
_WAITING_TIME, _WAITING_GAP = 1.0, 0.3
_BRAKING = 1.0  # m/s^2, of pedestrians that stop or become curious
_STEP_ASIDE, _WARNING = 0.8, 2.5  # m and s: largest step of standing pedestrians, and the time before a robot passes
_CLOSE_CLEARANCE = 0.5  # m, accepted by pedestrians that stop for the robot or are curious, while the reaction lasts
_TIGHT_CLEARANCE = 0.1  # m, accepted by pedestrians that were delayed for long
_PATIENCE, _MAXIMUM_DELAY = 5.0, 8.0  # s of delay from which the clearance shrinks, and at which it is _TIGHT_CLEARANCE
_REPULSION, _DECAY_LENGTH = 3.0, 0.1  # m/s^2 at contact with the robot, and m over which it falls to 1/e

IGNORES, AVOIDS, STOPS, CURIOUS, SCARED = range(5)
KINDS = {"ignores": IGNORES, "avoids": AVOIDS, "stops": STOPS, "curious": CURIOUS, "scared": SCARED}
# By kind: s after which a reaction ends, and s of it that are recovered per s without the cause.
_DURATION = (0.0, 0.0, 6.0, 8.0, 0.0)
_RECOVERY = (0.0, 0.0, 2.0, 0.25, 0.0)


class Reactions(NamedTuple):
    """The state of all reactions, for kernels.

    Attributes:
        kind: (N,) of int, the reaction of each pedestrian, see above.
        weight: (N,), in [0, 1], how much the robot changes the motion; 0: not at all.
        is_alone: (N,) of bool, not in a group.
        reaction_time: (N,) of int, ticks.
        seen: (N,) of int, ticks for which each pedestrian has had the robot that it heeds in view and range.
        clearance: (N,), m, preferred gap to the robot.
        robot: (N,) of int, the robot that each pedestrian heeds: of those in sight, the nearest one.
        contact_distance: (N,), m, between the centres of pedestrian and robot at which a shoulder may touch the
            robot: half the breadth, whatever the heading, and the extent of the robot towards the pedestrian.
        size: (N,), m, half the breadth.
        length: (N,), m, half the length of the middle line of a long body; 0 for others.
        reach: (N,), m, extent of this line towards the robot.
        elapsed: (N,), s, time that the present reaction has lasted.
        is_exhausted: (N,) of bool, the reaction lasted its full duration and is recovering.
        delay: (N,), s, time for which a pedestrian was kept from its path.
        passing_side: (N,), +1: passes left of the line to the robot, -1: right, 0: neither; of one that stands, the
            side of the robot's way to which it steps.
        wanted: (N, 2), m/s, desired velocities of pedestrians that stop for the robot, or are curious; they change as
            fast as people brake.
        notices: (N,) of bool, pedestrians that react to the robot and have it in view and range.
        is_followed: (N,) of bool, pedestrians that a robot approaches without being in view.
        faces_robot: (N,) of bool, pedestrians whose reaction is in progress.
        gap: (N,), m, between each pedestrian and the robot.
        robot_direction: (N, 2), unit vectors from each pedestrian to the robot.
        velocity: (N, 2), m/s, scratch: adjusted velocities.
        walls: (B, 3), scratch of `fill_walls`.
    """

    kind: Ints
    weight: Floats
    is_alone: Bools
    reaction_time: Ints
    seen: Ints
    clearance: Floats
    robot: Ints
    contact_distance: Floats
    size: Floats
    length: Floats
    reach: Floats
    elapsed: Floats
    is_exhausted: Bools
    delay: Floats
    passing_side: Floats
    wanted: Floats2
    notices: Bools
    is_followed: Bools
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
        reaction_time=np.array([int(h.reaction_time / scene.rules.dt + 0.5) for h in humans], dtype=np.int64),
        is_alone=np.array([human.group is None for human in humans], dtype=bool),
        gap=np.full(count, math.inf),
        clearance=np.where(kind == SCARED, np.maximum(clearance, _SOCIAL_DISTANCE), clearance),
        size=np.array([human.radius + max(human.shoulder, 0.0) for human in humans], dtype=float),
        length=np.array([max(-human.shoulder, 0.0) for human in humans], dtype=float),
        walls=np.zeros((len(scene.barrier_owner), 3)),
    )


@subroutine
def is_in_view(humans: Array, k: int, ux: float, uy: float) -> bool:
    """Whether the unit vector (ux, uy) is in the field of view of the body or of the head of pedestrian k."""
    body = humans[k, BODY_X] * ux + humans[k, BODY_Y] * uy
    return bool(max(body, humans[k, GAZE_X] * ux + humans[k, GAZE_Y] * uy) > _VIEW_COSINE)


@subroutine
def choose_robot(reactions: Reactions, k: int, robots: Robots, view_blocks: Solids, humans: Array) -> bool:
    """Choose the robot that pedestrian k heeds; whether nothing is between the two.

    Of several robots it is the nearest one in view, or else the nearest one that no wall hides; if there is none, the
    one before.
    """
    x, y = humans[k, X], humans[k, Y]
    if len(robots.state) == 1:
        return not is_crossed(view_blocks, x, y, robots.state[0, X], robots.state[0, Y])
    chosen, least = -1, math.inf
    for r in range(len(robots.state)):
        dx, dy = robots.state[r, X] - x, robots.state[r, Y] - y
        size = max(length(dx, dy), 1e-6)
        distance = size - robots.radius[r]
        if not is_in_view(humans, k, dx / size, dy / size):
            distance += _FAR  # after all that are in view
        if distance < least and not is_crossed(view_blocks, x, y, x + dx, y + dy):
            chosen, least = r, distance
    if chosen >= 0 and chosen != reactions.robot[k]:
        reactions.robot[k], reactions.passing_side[k] = chosen, 0.0
    return chosen >= 0


@subroutine
def notice_robot(
    reactions: Reactions, k: int, robots: Robots, humans: Array, is_walking: bool, in_sight: bool, dt: float
) -> bool:
    """Observe the robot, and advance the reaction of pedestrian k by one tick; whether the robot has an effect on it.

    Args:
        reactions: after `choose_robot`; updated.
        k: index of a pedestrian that is present.
        robots: of the scene.
        humans: columns of `core.humans`.
        is_walking: whether the pedestrian walks; one that stands also hears a robot near by.
        in_sight: whether nothing is between the pedestrian and the robot.
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
    reactions.reach[k] = reactions.length[k] * abs(x * humans[k, BODY_X] + y * humans[k, BODY_Y]) / distance
    reactions.gap[k] = distance - reactions.contact_distance[k] - reactions.reach[k]
    reactions.robot_direction[k, 0], reactions.robot_direction[k, 1] = x / distance, y / distance
    is_near = reactions.weight[k] > 0.0 and in_sight and reactions.gap[k] < _NOTICE_RANGE
    is_approached = _is_approached(reactions, k, robot, _APPROACH_SPEED)
    is_heard = not is_walking and is_approached and reactions.gap[k] < _FAR_SOCIAL_DISTANCE
    is_seen = is_near and (is_heard or is_in_view(humans, k, x / distance, y / distance))
    reactions.seen[k] = reactions.seen[k] + 1 if is_seen else 0
    notices = is_seen and reactions.seen[k] > reactions.reaction_time[k]
    reactions.notices[k], reactions.is_followed[k] = notices, is_near and is_approached and not is_seen
    kind = reactions.kind[k]
    if kind == CURIOUS:
        cause = notices and reactions.gap[k] < _INTEREST_RANGE
    elif kind == STOPS:
        cause = notices and is_approached and reactions.gap[k] < _FAR_SOCIAL_DISTANCE
        cause = cause and _would_stand_clear(reactions, k, robot, humans)
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
def _would_stand_clear(reactions: Reactions, k: int, robot: Array, humans: Array) -> bool:
    """Whether pedestrian k, if it brakes now, comes to a stand beside the robot's way."""
    vx, vy, speed = humans[k, VX], humans[k, VY], max(length(robot[VX], robot[VY]), 1e-6)
    time = length(vx, vy) / (2.0 * _BRAKING)
    dx, dy = humans[k, X] + vx * time - robot[X], humans[k, Y] + vy * time - robot[Y]
    aside = abs(robot[VX] * dy - robot[VY] * dx) / speed
    return bool(aside > reactions.contact_distance[k] + min(reactions.clearance[k], _CLOSE_CLEARANCE))


@subroutine
def _is_approached(reactions: Reactions, k: int, robot: Array, minimum: float) -> bool:
    """Whether the robot's own velocity towards pedestrian k exceeds a minimum, m/s."""
    towards = reactions.robot_direction[k, 0] * robot[VX] + reactions.robot_direction[k, 1] * robot[VY]
    return bool(towards < -minimum)


@subroutine
def adjust_course(
    reactions: Reactions, k: int, robot: Array, walkers: Walkers, desired_x: float, desired_y: float, speed: float,
    is_walking: bool, solids: Solids, side: float, dt: float,
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
        solids: walls and furniture.
        side: +1 passes on the right, -1 on the left, where both cost the same.
        dt: tick, s.
    """
    x, y = robot[X] - walkers.position[k, 0], robot[Y] - walkers.position[k, 1]
    px, py = _preferred_velocity(reactions, k, walkers, desired_x, desired_y, speed, dt)
    outline = (walkers.radius[k], 0.0, 1.0, 0.0)  # a disc
    distance = _passing_distance(reactions, k)
    vx, vy, passing_side, walls = px, py, 0.0, -1  # number of rows of `reactions.walls`
    if in_conflict(x, y, px - robot[VX], py - robot[VY], distance):
        walls = fill_walls(reactions.walls, walkers, k, solids.table, outline, WALL_TIME, math.inf)
        narrow, pace = reactions.contact_distance[k] - reactions.size[k] + walkers.radius[k], max(length(px, py), 1e-6)
        if _is_approached(reactions, k, robot, _APPROACH_SPEED) or _has_room(
            solids, robot, px / pace, py / pace, narrow, walkers.radius[k]
        ):
            vx, vy, passing_side = evasive_velocity(
                x, y, px, py, robot[VX], robot[VY], distance, reactions.passing_side[k], side, reactions.walls[:walls]
            )
        else:  # in a door: it waits before the robot
            scale = min(max(length(x, y) - distance - _WAITING_GAP, 0.0) / (_WAITING_TIME * pace), 1.0)
            vx, vy = px * scale, py * scale
    if is_walking:
        reactions.passing_side[k] = passing_side
    avoiding = reactions.notices[k] and is_walking
    if avoiding and reactions.kind[k] == CURIOUS and reactions.faces_robot[k]:
        # Curious pedestrians do not evade a robot that they approach, unless it comes towards them fast.
        avoiding = _is_approached(reactions, k, robot, _FAST_APPROACH_SPEED)
    if not avoiding:
        vx, vy = px, py
    dx, dy = vx - px, vy - py
    is_delayed = avoiding and dx * dx + dy * dy > 0.01
    if is_delayed:  # the reaction then continues from the present velocity
        reactions.wanted[k, 0], reactions.wanted[k, 1] = walkers.velocity[k, 0], walkers.velocity[k, 1]
    delay = reactions.delay[k] + (dt if is_delayed else -0.5 * dt)
    reactions.delay[k] = min(max(delay, 0.0), _MAXIMUM_DELAY)
    if not (reactions.notices[k] and is_walking):
        return False
    if vx != desired_x or vy != desired_y:
        if walls < 0:
            walls = fill_walls(reactions.walls, walkers, k, solids.table, outline, WALL_TIME, math.inf)
        limit = max(_HURRY * speed, _EVASION_SPEED) / max(length(vx, vy), 1e-6)
        if limit < 1.0:
            vx, vy = vx * limit, vy * limit
        vx, vy = limited_by_walls(reactions.walls[:walls], vx, vy)
    reactions.velocity[k, 0], reactions.velocity[k, 1] = vx, vy
    return bool(vx != desired_x or vy != desired_y)


@subroutine
def _has_room(solids: Solids, robot: Array, ux: float, uy: float, distance: float, radius: float) -> bool:
    """Whether a body of a radius, m, could pass a robot at a distance of centres, m, on one side of it.

    Args:
        solids: walls and furniture.
        robot: columns of `core.state`.
        ux, uy: unit vector of the course.
        distance, radius: of a body that passes sideways.
    """
    for n in range(2):
        side = 1.0 - 2.0 * n
        x, y = robot[X] - uy * side * distance, robot[Y] + ux * side * distance
        if not is_blocked(solids, radius, 0.0, x - ux * radius, y - uy * radius, x + ux * radius, y + uy * radius):
            return True
    return False


@subroutine
def _preferred_velocity(
    reactions: Reactions, k: int, walkers: Walkers, desired_x: float, desired_y: float, speed: float, dt: float
) -> Vector:
    """The velocity that the reaction asks for, m/s, before a collision with the robot is avoided."""
    kind, wanted = reactions.kind[k], reactions.wanted[k]
    is_interested = kind == CURIOUS and reactions.is_alone[k]
    if not reactions.faces_robot[k] or (kind == CURIOUS and not is_interested):
        # One that has lost interest turns away from the robot by the same acceleration.
        if not (is_interested and reactions.is_exhausted[k]):
            wanted[0], wanted[1] = walkers.velocity[k, 0], walkers.velocity[k, 1]
            return desired_x, desired_y
    else:
        approach = 0.0
        if kind == CURIOUS:
            excess = reactions.gap[k] - _SOCIAL_DISTANCE
            approach = min(math.sqrt(_BRAKING * excess), speed) if excess > 0.0 else max(2.0 * excess, -0.4)
        desired_x = approach * reactions.robot_direction[k, 0]
        desired_y = approach * reactions.robot_direction[k, 1]
    dx, dy = desired_x - wanted[0], desired_y - wanted[1]
    scale = min(_BRAKING * dt / max(length(dx, dy), 1e-6), 1.0)
    wanted[0], wanted[1] = wanted[0] + dx * scale, wanted[1] + dy * scale
    return float(wanted[0]), float(wanted[1])


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
    is_pushed = reactions.weight[k] > 0.0 and reactions.gap[k] < _DECAY_LENGTH  # perhaps from behind
    if not (reactions.notices[k] or is_pushed):
        return 0.0, 0.0
    dx, dy = x - robot_x, y - robot_y
    distance = max(math.sqrt(dx * dx + dy * dy), 1e-6)
    free = max(distance - reactions.contact_distance[k] - reactions.reach[k], 0.0)
    push = reactions.weight[k] * _REPULSION * exp(free * (-1.0 / _DECAY_LENGTH)) / distance
    return dx * push, dy * push


@subroutine
def step_aside(
    reactions: Reactions, k: int, robot: Array, x: float, y: float, radius: float, side: float, solids: Solids
) -> Vector:
    """Where a standing pedestrian stands with the robot near: beside (x, y), m, if the robot would come too near.

    Args:
        reactions: after `notice_robot`; `passing_side` keeps the side of the robot's way to which it steps.
        k: index of the pedestrian.
        robot: columns of `core.state`.
        x, y: its place without the robot, m.
        radius: half the depth of its body, m.
        side: of the rules, +1 or -1: to the robot's left or right, where both are equal.
        solids: walls and furniture.
    """
    speed = length(robot[VX], robot[VY])
    ux, uy, dx, dy = robot[VX] / max(speed, 1e-6), robot[VY] / max(speed, 1e-6), x - robot[X], y - robot[Y]
    ahead, aside = dx * ux + dy * uy, ux * dy - uy * dx  # of the robot, and to the left of its way
    distance = reactions.contact_distance[k] + reactions.clearance[k]
    is_far = ahead < -distance or ahead > distance + speed * _WARNING or abs(aside) >= distance
    if not reactions.notices[k] or speed < _APPROACH_SPEED or is_far:
        reactions.passing_side[k] = 0.0
        return x, y
    if reactions.passing_side[k] == 0.0:
        reactions.passing_side[k] = side if abs(aside) < 1e-3 else math.copysign(1.0, aside)
    to = reactions.passing_side[k]
    _, room = nearest_within(solids, x, y, radius + 0.05 + _STEP_ASIDE)
    step = to * reactions.weight[k] * min(distance - to * aside, _STEP_ASIDE, max(room - radius - 0.05, 0.0))
    return x - uy * step, y + ux * step
