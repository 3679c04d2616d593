"""Directions of the pedestrians' bodies and heads; each pedestrian's glances have their own random stream.

- The body of a walker turns to where it wants to go, and so leads a turn of its path, by 35 degrees at most. The head
  turns to the point on the path 1 s ahead, so that it leads the body, and at times to companions.
- Pedestrians that talk face their partner, or the centre of the group, and look from face to face; pedestrians that
  attend to an object face it.
- People who stand turn a little to a robot that comes close.
- Glances at the robot, when it is near and in view, or follows behind, are short for `avoids`, longer for `stops`,
  long and frequent for `curious` and `scared`; pedestrians that ignore the robot never look at it. A pedestrian that
  stops for the robot, or is curious, looks at nothing else, and turns its body to the robot.

Source: Grasso et al., Neuroscience Letters 253 (1998) 115, for heads that turn before the path does. The times are
ours.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ...core.compiled.kernel import subroutine
from ...core.compiled.packing import Floats2, Ints, zeros
from ...core.compiled.scalar import Vector, choice, turned_towards, unit_or
from ...core.humans import BODY_X, BODY_Y, VX, VY, X, Y
from ...core.philox import Draws, uniform
from ...core.portable_math import Array
from ...core.scene import Scene
from .reactions import AVOIDS, CURIOUS, SCARED, STOPS, Reactions
from .social.company import SITTING, Company

HEAD_LEAD_TIME = 1.0  # s, by which the head leads the path
MINIMUM_HEAD_LEAD = 0.8  # m, minimum distance ahead on the path
_LEAD_COSINE, _LEAD_SINE = 0.8191520442889918, 0.573576436351046  # of 35 degrees, the most a body leads its course by
_TURN_RANGE = 0.7  # m, clearance of a robot within which people who stand turn to it, by the same angle at most
IDLE_SPEED = 0.3  # m/s: slower bodies turn freely

# Columns of the times of glances: shortest and longest look, and shortest and longest pause after it, s; and the
# clearance within which the robot attracts looks, m.
_LOOK, _PAUSE, _RANGE = 0, 2, 4
_NEVER = (0.0, 0.0, 0.0, 0.0, -1.0)
_ROBOT_GLANCES = {
    AVOIDS: (0.4, 0.9, 1.5, 4.0, 4.0),
    STOPS: (0.6, 1.2, 1.0, 3.0, 4.0),
    CURIOUS: (2.0, 4.0, 0.3, 1.0, 6.0),
    SCARED: (1.0, 2.5, 0.3, 0.8, 6.0),
}
_TALK_LOOK = (1.5, 4.0)  # s, from one face to the next, where three or more talk
_WALK_LOOK, _WALK_PAUSE = (0.8, 1.5), (4.0, 10.0)  # s, at companions, where people walk together

GLANCES = 2  # purpose of the random numbers


class Glances(NamedTuple):
    """The state of all glances, for kernels.

    Attributes:
        times: (N, 5), of glances at the robot, see above.
        robot_until, robot_next: (N,) of int, ticks at which the present glance at the robot ends, and at which the next
            one may begin.
        partner: (N,) of int, index of the partner that is looked at, or -1.
        partner_until: (N,) of int, tick.
    """

    times: Floats2
    robot_until: Ints
    robot_next: Ints
    partner: Ints
    partner_until: Ints


def initial_glances(scene: Scene, reactions: Reactions) -> Glances:
    """The glances at the start of an episode."""
    count = len(scene.humans)
    times = [_ROBOT_GLANCES.get(kind, _NEVER) for kind in reactions.kind.tolist()]
    return zeros(Glances, count, times=np.array(times).reshape(-1, 5), partner=np.full(count, -1))


@subroutine
def _draw_ticks(draws: Draws, k: int, low: float, high: float, dt: float) -> int:
    """A duration between two times, s, in ticks."""
    return max(int((low + (high - low) * uniform(draws, k, GLANCES)) / dt + 0.5), 1)


@subroutine
def facing(
    k: int, humans: Array, social: Company, course_x: float, course_y: float, reactions: Reactions, side: float
) -> Vector:
    """The direction that the body of pedestrian k turns to, a unit vector.

    Args:
        k: index of the pedestrian.
        humans: columns of `core.humans`.
        social: what the pedestrians are doing.
        course_x, course_y: desired velocity, m/s.
        reactions: to the robot.
        side: of the rules, +1 or -1: to which a body turns about.
    """
    vx, vy, is_walking = humans[k, VX], humans[k, VY], social.is_walking[k]
    if reactions.faces_robot[k] and not social.has_object[k] and (is_walking or social.partner_count[k] == 0):
        return reactions.robot_direction[k, 0], reactions.robot_direction[k, 1]
    if is_walking:
        ux, uy = unit_or(course_x, course_y, 0.05, humans[k, BODY_X], humans[k, BODY_Y])
        speed = math.sqrt(vx * vx + vy * vy)
        if speed > IDLE_SPEED:
            return turned_towards(vx / speed, vy / speed, ux, uy, _LEAD_COSINE, _LEAD_SINE, side)
        return ux, uy
    x, y = _facing_point(k, humans, social)
    ux, uy = unit_or(x - humans[k, X], y - humans[k, Y], 0.05, humans[k, BODY_X], humans[k, BODY_Y])
    if reactions.notices[k] and reactions.gap[k] < _TURN_RANGE and social.posture[k] != SITTING:
        to_x, to_y = reactions.robot_direction[k, 0], reactions.robot_direction[k, 1]
        return turned_towards(ux, uy, to_x, to_y, _LEAD_COSINE, _LEAD_SINE, side)
    return ux, uy


@subroutine
def _facing_point(k: int, humans: Array, social: Company) -> Vector:
    """The point that a standing pedestrian faces: the partner, the centre of the group, or its facing point; m."""
    count = social.partner_count[k]
    if count == 0 or social.keeps_facing[k]:
        return social.facing_point[k, 0], social.facing_point[k, 1]
    first = social.partners[k, 0]
    if count == 1:
        return humans[first, X], humans[first, Y]
    x, y = humans[k, X], humans[k, Y]
    for n in range(count):
        x, y = x + humans[social.partners[k, n], X], y + humans[social.partners[k, n], Y]
    return x / (count + 1), y / (count + 1)


@subroutine
def gaze(
    k: int, tick: int, humans: Array, social: Company, facing_x: float, facing_y: float,
    ahead_x: float, ahead_y: float, reactions: Reactions, glances: Glances, draws: Draws, dt: float,
) -> Vector:  # fmt: skip
    """The direction that the head of pedestrian k turns to, a unit vector; advances its glances by one tick.

    Args:
        k: index of the pedestrian.
        tick: that begins.
        humans, social, reactions: as for `facing`.
        facing_x, facing_y: direction that the body turns to, unit vector.
        ahead_x, ahead_y: the point ahead on the path of a walker, m.
        glances, draws: updated.
        dt: tick, s.
    """
    x, y = facing_x, facing_y
    if social.is_walking[k]:
        x, y = ahead_x - humans[k, X], ahead_y - humans[k, Y]
    if social.partner_count[k] > 0:
        other = _choose_partner(k, tick, social, glances, draws, dt)
        if other >= 0:
            x, y = humans[other, X] - humans[k, X], humans[other, Y] - humans[k, Y]
    if reactions.faces_robot[k] or _looks_at_robot(k, tick, reactions, glances, draws, dt):
        return reactions.robot_direction[k, 0], reactions.robot_direction[k, 1]
    return unit_or(x, y, 0.3, facing_x, facing_y)


@subroutine
def _choose_partner(k: int, tick: int, social: Company, glances: Glances, draws: Draws, dt: float) -> int:
    """The index of the partner that pedestrian k looks at now, or -1 during a pause."""
    is_walking, count, partner = social.is_walking[k], social.partner_count[k], glances.partner[k]
    if count == 1 and not is_walking:
        return int(social.partners[k, 0])
    is_partner = False
    for n in range(count):
        is_partner = is_partner or social.partners[k, n] == partner
    if tick >= glances.partner_until[k] or (partner >= 0 and not is_partner):
        # Walkers start with a pause, and pause after each look; people who talk look from face to face.
        if is_walking and (partner >= 0 or tick == 0):
            partner = -1
            duration = _draw_ticks(draws, k, _WALK_PAUSE[0], _WALK_PAUSE[1], dt)
        else:
            partner = social.partners[k, choice(uniform(draws, k, GLANCES), count)]
            low, high = _WALK_LOOK if is_walking else _TALK_LOOK
            duration = _draw_ticks(draws, k, low, high, dt)
        glances.partner[k], glances.partner_until[k] = partner, tick + duration
    return int(partner)


@subroutine
def _looks_at_robot(k: int, tick: int, reactions: Reactions, glances: Glances, draws: Draws, dt: float) -> bool:
    """Whether pedestrian k glances at the robot now."""
    if not (reactions.notices[k] or reactions.is_followed[k]) or not reactions.gap[k] < glances.times[k, _RANGE]:
        return False
    if tick >= glances.robot_next[k]:
        times = glances.times
        until = tick + _draw_ticks(draws, k, times[k, _LOOK], times[k, _LOOK + 1], dt)
        glances.robot_until[k] = until
        glances.robot_next[k] = until + _draw_ticks(draws, k, times[k, _PAUSE], times[k, _PAUSE + 1], dt)
    return bool(tick < glances.robot_until[k])
