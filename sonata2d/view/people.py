"""People, robot and goal from above, and the links between who attends to what.

An activity shows in colour and in pose: who walks strides, who talks gestures with a hand, who uses a thing reaches for
it with both, who looks stands with the hands behind the back.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from ..core.entities import ROBOT_ID, Goal, Interaction
from ..core.geometry import Point
from ..core.humans import HumanState
from ..core.proxemics import INTIMATE_DISTANCE, PERSONAL_DISTANCE
from ..core.snapshot import RobotState, Snapshot
from .brush import Brush
from .palette import ACTIVITY, BLUE, DARK, FAINT, FLOOR, GOAL, HAIR, INK, PAPER, PURPLE, ROBOT, Colour, mixed, shaded
from .things import half_size

_LINE = 0.022  # m, outlines
_STRIDE = 0.75  # s, a step with each foot takes twice this
FAN = tuple((math.cos(0.38 * k / 3), math.sin(0.38 * k / 3)) for k in range(-3, 4))  # rays of a look
FAN_REACH = 0.75  # m beyond the person's outline
_CIRCLE = tuple((math.cos(k * math.pi / 32), math.sin(k * math.pi / 32)) for k in range(65))  # closed
_MARGIN = 0.05  # m, between a link's end and the outline it belongs to


def draw_human(brush: Brush, human: HumanState, time: float, *, ignores_robot: bool = False) -> None:
    """A person in their solid outline: a disc, dashed if they ignore the robot."""
    with brush.group("person"):
        here = brush.at(human.pose.position, human.pose.direction)
        draw_body(here, human.activity, human.radius, swing_of(human, time), ignores_robot=ignores_robot)
        draw_head(brush.at(human.pose.position, (math.cos(human.head), math.sin(human.head))), human.radius)


def swing_of(human: HumanState, time: float) -> float:
    """How far a walker's left foot is behind (-1) or ahead (1); 0 for who stands."""
    return math.sin(math.pi * time / _STRIDE + human.id) if human.activity.startswith("walking") else 0.0


def draw_body(brush: Brush, activity: str, r: float, swing: float, *, ignores_robot: bool = False) -> None:
    """A person without their head, r metres round the brush's place."""
    colour = ACTIVITY[activity]
    brush.disc(mixed(FLOOR, colour, 0.28), (0.0, 0.0), r)
    if ignores_robot:
        brush.dashed_ring(shaded(colour), (0.0, 0.0), r, 1.5 * _LINE, 9)
    else:
        brush.ring(shaded(colour, 0.25), (0.0, 0.0), r, _LINE)
    _limbs(brush, activity, r, swing)
    brush.ellipse(colour, (0.0, 0.0), (0.46 * r, 0.9 * r), shaded(colour), _LINE)


def draw_head(brush: Brush, r: float) -> None:
    """A head with its nose where it looks."""
    nose = [(0.3 * r, 0.2 * r), (0.66 * r, 0.0), (0.3 * r, -0.2 * r)]
    brush.polygon(HAIR, nose, HAIR, 0.01)
    brush.disc(HAIR, (0.05 * r, 0.0), 0.4 * r)
    brush.disc(mixed(HAIR, PAPER, 0.18), (0.02 * r, 0.0), 0.24 * r)


def _limbs(brush: Brush, activity: str, r: float, swing: float) -> None:
    """Feet or arms, by activity."""
    colour = ACTIVITY[activity]
    sleeve = mixed(shaded(colour), colour, 0.5)
    if activity.startswith("walking"):
        for side in (-1, 1):
            brush.ellipse(shaded(colour, 0.6), (side * swing * 0.5 * r, side * 0.38 * r), (0.36 * r, 0.17 * r))
    elif activity == "talking":
        brush.stroke(sleeve, [(0.1 * r, -0.78 * r), (0.62 * r, -0.62 * r), (0.8 * r, -0.28 * r)], 0.22 * r)
    elif activity == "using":
        for side in (-1, 1):
            arm = [(0.1 * r, side * 0.78 * r), (0.5 * r, side * 0.7 * r), (0.85 * r, side * 0.25 * r)]
            brush.stroke(sleeve, arm, 0.2 * r)
    elif activity == "looking":
        brush.stroke(sleeve, [(0.0, 0.75 * r), (-0.6 * r, 0.35 * r), (-0.6 * r, -0.35 * r), (0.0, -0.75 * r)], 0.22 * r)


def draw_gaze(brush: Brush, human: HumanState, reaches: Sequence[float] | None = None) -> None:
    """A pale fan where a person looks; see `draw_fan`."""
    direction = math.cos(human.head), math.sin(human.head)
    draw_fan(brush.at(human.pose.position, direction), human.activity, human.radius, reaches)


def draw_fan(brush: Brush, activity: str, r: float, reaches: Sequence[float] | None = None) -> None:
    """A fan ahead, paler farther out.

    Args:
        reaches: how far each of its `FAN` rays may go, m from the brush's place; all the way unless given.
    """
    far = [r + FAN_REACH] * len(FAN) if reaches is None else [min(reach, r + FAN_REACH) for reach in reaches]
    near = [min(reach, r + 0.66 * FAN_REACH) for reach in far]
    rim, middle = ([(d * c, d * s) for d, (c, s) in zip(ends, FAN, strict=True)] for ends in (far, near))
    colour = ACTIVITY[activity]
    brush.wash(colour, 24, [*rim, *middle[::-1]])
    brush.wash(colour, 55, [(0.0, 0.0), *middle])


def draw_zones(brush: Brush, r: float) -> None:
    """Where the robot's outline would enter the intimate zone of whoever stands here, and the personal one (dashed)."""
    intimate, personal = r + INTIMATE_DISTANCE, r + PERSONAL_DISTANCE
    inner, outer = ([(reach * c, reach * s) for c, s in _CIRCLE] for reach in (intimate, personal))
    brush.wash(BLUE, 13, [*outer, *inner[::-1]])
    brush.wash(BLUE, 30, inner)
    brush.ring(mixed(FLOOR, INK, 0.35), (0.0, 0.0), intimate, 0.012)
    brush.dashed_ring(mixed(FLOOR, INK, 0.28), (0.0, 0.0), personal, 0.012, 48)


def draw_shared(brush: Brush, link: Interaction, ends: dict[int, tuple[Point, float]]) -> None:
    """The space between two who talk, or between a person and what they attend to; nobody else should walk there.

    Source: A. Kendon's o-space (Conducting Interaction, 1990), as an ellipse from the one to the other.
    """
    if link.src not in ends or link.dst not in ends:
        return
    (a, _), (b, _) = ends[link.src], ends[link.dst]
    apart = math.hypot(b[0] - a[0], b[1] - a[1])
    if apart > 0.0:
        here = brush.at(((a[0] + b[0]) / 2, (a[1] + b[1]) / 2), ((b[0] - a[0]) / apart, (b[1] - a[1]) / apart))
        across = min(max(0.35 * apart, 0.3), 0.7)
        for share, alpha in ((1.0, 26), (0.72, 26)):
            here.wash(PURPLE, alpha, [(share * apart / 2 * c, share * across * s) for c, s in _CIRCLE])


def draw_velocity(brush: Brush, position: Point, velocity: Point, colour: Colour) -> None:
    """An arrow as long as the way of one second."""
    speed = math.hypot(*velocity)
    if speed < 0.05:
        return
    here = brush.at(position, (velocity[0] / speed, velocity[1] / speed))
    here.stroke(colour, [(0.0, 0.0), (max(speed - 0.1, 0.0), 0.0)], 0.03)
    here.polygon(colour, [(speed, 0.0), (speed - 0.14, 0.07), (speed - 0.14, -0.07)])


def draw_robot(brush: Brush, robot: RobotState, *, touches: bool = False) -> None:
    """A robot where it is; see `draw_chassis`."""
    with brush.group("robot"):
        draw_chassis(brush.at(robot.position, robot.direction), robot.radius, touches=touches)


def draw_chassis(brush: Brush, r: float, *, touches: bool = False) -> None:
    """A disc with an arrow that points ahead; a thick dark rim while it touches something."""
    brush.disc(ROBOT, (0.0, 0.0), r)
    brush.ring(DARK if touches else shaded(ROBOT), (0.0, 0.0), r, 0.07 if touches else 0.035)
    for side in (-1, 1):
        brush.box(DARK, (-0.35 * r, side * 0.72 * r - 0.09 * r), (0.35 * r, side * 0.72 * r + 0.09 * r))
    brush.polygon(PAPER, [(0.78 * r, 0.0), (-0.42 * r, 0.48 * r), (-0.18 * r, 0.0), (-0.42 * r, -0.48 * r)])


def draw_goal(brush: Brush, goal: Goal) -> None:
    """A goal where it is; see `draw_target`."""
    with brush.group("goal"):
        draw_target(brush.at(goal.position), goal.distance)


def draw_target(brush: Brush, reach: float) -> None:
    """A target; its dashed rim is where the goal counts as reached."""
    brush.disc(mixed(FLOOR, GOAL, 0.16), (0.0, 0.0), reach)
    brush.dashed_ring(GOAL, (0.0, 0.0), reach, 0.025, 16)
    brush.ring(GOAL, (0.0, 0.0), 0.6 * reach, 0.03)
    brush.disc(GOAL, (0.0, 0.0), 0.22 * reach)


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
