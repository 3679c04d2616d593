"""People, robot and goal from above, and the links between who attends to what.

An activity shows in colour and in pose: who walks strides, who talks gestures with a hand, who uses a thing reaches for
it with both, who looks stands with the hands behind the back.
"""

from __future__ import annotations

import math

from ..entities import ROBOT_ID, Goal, Interaction
from ..frame import HumanState, RobotState, Snapshot
from ..geometry import Point
from ..proxemics import INTIMATE_DISTANCE, PERSONAL_DISTANCE
from .brush import Brush
from .palette import ACTIVITY, DARK, FAINT, FLOOR, GOAL, HAIR, INK, PAPER, ROBOT, Colour, mixed, shaded
from .things import half_size

_LINE = 0.022  # m, outlines
_STRIDE = 0.75  # s, a step with each foot takes twice this
_MARGIN = 0.05  # m, between a link's end and the outline it belongs to


def draw_human(brush: Brush, human: HumanState, time: float, *, ignores_robot: bool = False) -> None:
    """A person in their solid outline: a disc, dashed if they ignore the robot."""
    here = brush.at(human.pose.position, human.pose.heading)
    r, colour = human.radius, ACTIVITY[human.activity]
    here.disc(mixed(FLOOR, colour, 0.28), (0.0, 0.0), r)
    if ignores_robot:
        here.dashed_ring(shaded(colour), (0.0, 0.0), r, 1.5 * _LINE, 9)
    else:
        here.ring(shaded(colour, 0.25), (0.0, 0.0), r, _LINE)
    _limbs(here, human, time, colour)
    here.ellipse(colour, (0.0, 0.0), (0.46 * r, 0.9 * r), shaded(colour), _LINE)
    _head(brush.at(human.pose.position, (math.cos(human.head), math.sin(human.head))), r)


def _head(brush: Brush, r: float) -> None:
    """A head with its nose where it looks."""
    nose = [(0.3 * r, 0.2 * r), (0.66 * r, 0.0), (0.3 * r, -0.2 * r)]
    brush.polygon(HAIR, nose, HAIR, 0.01)
    brush.disc(HAIR, (0.05 * r, 0.0), 0.4 * r)
    brush.disc(mixed(HAIR, PAPER, 0.18), (0.02 * r, 0.0), 0.24 * r)


def _limbs(brush: Brush, human: HumanState, time: float, colour: Colour) -> None:
    """Feet or arms, by activity."""
    r, sleeve = human.radius, mixed(shaded(colour), colour, 0.5)
    if human.activity.startswith("walking"):
        swing = math.sin(math.pi * time / _STRIDE + human.id)
        for side in (-1, 1):
            brush.ellipse(shaded(colour, 0.6), (side * swing * 0.5 * r, side * 0.38 * r), (0.36 * r, 0.17 * r))
    elif human.activity == "talking":
        brush.stroke(sleeve, [(0.1 * r, -0.78 * r), (0.62 * r, -0.62 * r), (0.8 * r, -0.28 * r)], 0.22 * r)
    elif human.activity == "using":
        for side in (-1, 1):
            arm = [(0.1 * r, side * 0.78 * r), (0.5 * r, side * 0.7 * r), (0.85 * r, side * 0.25 * r)]
            brush.stroke(sleeve, arm, 0.2 * r)
    elif human.activity == "looking":
        brush.stroke(sleeve, [(0.0, 0.75 * r), (-0.6 * r, 0.35 * r), (-0.6 * r, -0.35 * r), (0.0, -0.75 * r)], 0.22 * r)


def draw_gaze(brush: Brush, human: HumanState, *, length: float = 0.75, half_angle: float = 0.38) -> None:
    """A pale fan where a person looks."""
    here = brush.at(human.pose.position)
    turns = [human.head + half_angle * k / 6 for k in range(-6, 7)]
    r = human.radius
    for reach, alpha in ((length, 24), (0.66 * length, 34)):
        rim = [((r + reach) * math.cos(t), (r + reach) * math.sin(t)) for t in turns]
        here.wash(ACTIVITY[human.activity], alpha, [(0.0, 0.0), *rim])


def draw_zones(brush: Brush, human: HumanState) -> None:
    """Where the robot's outline would enter a person's intimate zone, and their personal one (dashed)."""
    here = brush.at(human.pose.position)
    intimate, personal = human.radius + INTIMATE_DISTANCE, human.radius + PERSONAL_DISTANCE
    here.ring(mixed(FLOOR, INK, 0.35), (0.0, 0.0), intimate, 0.012)
    here.dashed_ring(mixed(FLOOR, INK, 0.28), (0.0, 0.0), personal, 0.012, 48)


def draw_velocity(brush: Brush, position: Point, velocity: Point, colour: Colour) -> None:
    """An arrow as long as the way of one second."""
    speed = math.hypot(*velocity)
    if speed < 0.05:
        return
    here = brush.at(position, (velocity[0] / speed, velocity[1] / speed))
    here.stroke(colour, [(0.0, 0.0), (max(speed - 0.1, 0.0), 0.0)], 0.03)
    here.polygon(colour, [(speed, 0.0), (speed - 0.14, 0.07), (speed - 0.14, -0.07)])


def draw_robot(brush: Brush, robot: RobotState, *, touches: bool = False) -> None:
    """A disc with an arrow that points ahead; a thick dark rim while it touches something."""
    here, r = brush.at(robot.position, robot.heading), robot.radius
    here.disc(ROBOT, (0.0, 0.0), r)
    here.ring(DARK if touches else shaded(ROBOT), (0.0, 0.0), r, 0.07 if touches else 0.035)
    for side in (-1, 1):
        here.box(DARK, (-0.35 * r, side * 0.72 * r - 0.09 * r), (0.35 * r, side * 0.72 * r + 0.09 * r))
    here.polygon(PAPER, [(0.78 * r, 0.0), (-0.42 * r, 0.48 * r), (-0.18 * r, 0.0), (-0.42 * r, -0.48 * r)])


def draw_goal(brush: Brush, goal: Goal) -> None:
    """A target; its dashed rim is where the goal counts as reached."""
    here = brush.at(goal.position)
    here.disc(mixed(FLOOR, GOAL, 0.16), (0.0, 0.0), goal.distance)
    here.dashed_ring(GOAL, (0.0, 0.0), goal.distance, 0.025, 16)
    here.ring(GOAL, (0.0, 0.0), 0.6 * goal.distance, 0.03)
    here.disc(GOAL, (0.0, 0.0), 0.22 * goal.distance)


def draw_link(brush: Brush, link: Interaction, ends: dict[int, tuple[Point, float]]) -> None:
    """A dotted line from the one's outline to the other's; nothing if either is not there.

    Args:
        ends: place and reach by id; see `link_ends`.
    """
    if link.src not in ends or link.dst not in ends:
        return
    (a, a_reach), (b, b_reach) = ends[link.src], ends[link.dst]
    apart = math.hypot(b[0] - a[0], b[1] - a[1])
    free = apart - a_reach - b_reach - 2 * _MARGIN
    if free <= 0.0:
        return
    ux, uy = (b[0] - a[0]) / apart, (b[1] - a[1]) / apart
    first, last = a_reach + _MARGIN, a_reach + _MARGIN + free
    brush.dots(FAINT, (a[0] + ux * first, a[1] + uy * first), (a[0] + ux * last, a[1] + uy * last), 0.022, 0.1)


def link_ends(snapshot: Snapshot, people: list[HumanState]) -> dict[int, tuple[Point, float]]:
    """Place of everything a link may join and how near a link comes to it, m, by id."""
    ends = {thing.id: (thing.pose.position, 0.8 * min(half_size(thing))) for thing in snapshot.objects}
    ends |= {human.id: (human.pose.position, human.radius) for human in people}
    return ends | {ROBOT_ID: (snapshot.robot.position, snapshot.robot.radius)}
