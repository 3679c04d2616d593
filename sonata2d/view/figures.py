"""Pedestrians, the robot and the goal, seen from above.

An activity shows in colour and in pose: a walking pedestrian strides, a talking one gestures with a hand, one that uses
an object reaches for it with both hands, one that looks at something holds its hands behind its back, and one that
queues folds its arms. Of a sitting pedestrian the thighs and feet are visible.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from functools import partial

from ..core.entities import Goal
from ..core.geometry import Disc, Point, Polygon, Shape
from ..core.humans import HumanState
from ..core.person_kinds import ADULT, PersonKind
from ..core.relations import ACTIVITY
from ..core.scene import Unmeasured
from ..core.snapshot import RobotState
from ..registry import person_kind
from .brush import Brush, Part
from .palette import DARK, FLOOR, GOAL, HAIR, OTHER_ROBOT, PAPER, ROBOT, mixed, shaded

_LINE = 0.022  # m, outlines
_DASH = 0.2  # m, a dash and the gap after it, of the line to a goal
_STRIDE = 0.75  # s per step, half of a gait cycle
_SWINGS = 24  # poses per half swing of the feet that are distinguished, so that they can be cached


def human_parts(
    human: HumanState, time: float, *, ignores_robot: bool = False, unmeasured: Collection[Unmeasured] = ()
) -> list[tuple[Point, tuple[Part, ...]]]:
    """Body and head of a pedestrian inside its solid outline, which is dashed if the pedestrian ignores the robot.

    What a kind of person sits in, pushes or carries is below its body.

    Args:
        unmeasured: as in the scene; without a measured heading a pedestrian is a plain disc, without a measured
            direction of the head its head has no nose.

    Returns:
        Parts with the positions at which they are stamped, world frame, m.
    """
    r, shoulder, activity, swing = human.radius, human.shoulder, human.activity, 0.0
    if "headings" in unmeasured:
        plain = partial(draw_plain_body, activity=activity, r=r, ignores_robot=ignores_robot)
        return [(human.pose.position, ((("person", activity, r, None, ignores_robot), plain, (1.0, 0.0)),))]
    kind = person_kind(human.kind)
    shown = ACTIVITY[kind.limbs or activity]
    if shown.stride or shown.gesture:
        swing = round(math.sin(math.pi * time / _STRIDE + human.id) * _SWINGS) / _SWINGS
    body = partial(
        draw_body, activity=activity, r=r, shoulder=shoulder, swing=swing, ignores_robot=ignores_robot, kind=kind
    )
    own_r, own_shoulder = kind.figure or (r, max(shoulder, 0.0))
    size = own_r + own_shoulder / 2
    if "heads" in unmeasured:
        head: Part = ("head", size, "round"), partial(draw_head, r=size, nose=False), human.pose.direction
    else:
        head = ("head", size), partial(draw_head, r=size), (math.cos(human.head), math.sin(human.head))
    figure: Part = ("person", activity, r, shoulder, swing, ignores_robot, human.kind), body, human.pose.direction
    if kind.place == 0.0:
        return [(human.pose.position, (figure, head))]
    return [(human.pose.position, (figure,)), (human.pose.to_world((kind.place, 0.0)), (head,))]


def draw_body(
    brush: Brush, activity: str, r: float, shoulder: float, swing: float, *, ignores_robot: bool = False,
    kind: PersonKind = ADULT,
) -> None:  # fmt: skip
    """Draw a pedestrian without its head.

    Args:
        r: half the depth of the outline, m; of a long one, half its breadth.
        shoulder: half the length of the shoulder line, m; see `Humans.shoulder`.
        swing: position of a walking pedestrian's left foot, from -1 (behind) to 1 (ahead).
        kind: of the person.
    """
    colour = ACTIVITY[activity].colour
    _draw_outline(brush, activity, 0.28, r, shoulder, ignores_robot=ignores_robot)
    if kind.draw is not None:
        kind.draw(brush, r + max(-shoulder, 0.0), r + max(shoulder, 0.0))
    if kind.place != 0.0:
        c, s = brush.direction
        brush = brush.at((brush.x + kind.place * c, brush.y + kind.place * s), brush.direction)
    r, shoulder = kind.figure or (r, max(shoulder, 0.0))
    size = r + shoulder / 2  # halfway between depth and breadth
    draw_limbs(brush, kind.limbs or activity, size, swing)
    brush.ellipse(colour, (0.0, 0.0), (0.46 * size, 0.9 * (r + shoulder)), shaded(colour), _LINE)


def draw_plain_body(brush: Brush, activity: str, r: float, *, ignores_robot: bool = False) -> None:
    """Draw a pedestrian of unknown heading as a disc of radius r, m."""
    _draw_outline(brush, activity, 0.7, r, 0.0, ignores_robot=ignores_robot)


def _draw_outline(brush: Brush, activity: str, tone: float, r: float, shoulder: float, *, ignores_robot: bool) -> None:
    """Draw the solid outline in a tone between the floor's (0) and the activity's (1)."""
    colour = ACTIVITY[activity].colour
    if ignores_robot:
        brush.body(mixed(FLOOR, colour, tone), r, shoulder)
        brush.dashed_body(shaded(colour), r, shoulder, 1.5 * _LINE, 9)
    else:
        brush.body(shaded(colour, 0.25), r, shoulder)
        brush.body(mixed(FLOOR, colour, tone), r - _LINE, shoulder)


def draw_head(brush: Brush, r: float, *, nose: bool = True) -> None:
    """Draw a head; its nose points ahead. r is the size of the body, m."""
    if nose:
        brush.polygon(HAIR, [(0.3 * r, 0.2 * r), (0.66 * r, 0.0), (0.3 * r, -0.2 * r)], HAIR, 0.01)
    brush.disc(HAIR, (0.05 * r, 0.0), 0.4 * r)
    brush.disc(mixed(HAIR, PAPER, 0.18), (0.02 * r, 0.0), 0.24 * r)


def draw_limbs(brush: Brush, activity: str, r: float, swing: float = 0.0) -> None:
    """Draw the feet and limbs of an activity; r is the size of the body, m, and `swing` as for `draw_body`."""
    row = ACTIVITY[activity]
    if row.foot is not None:
        x, y = row.foot[:2]
        for side in (-1, 1):
            draw_foot(brush, activity, r, ((x + side * swing * row.stride) * r, side * y * r))
    sleeve = mixed(shaded(row.colour), row.colour, 0.5)
    for line in row.limbs:
        angle = swing * row.gesture * (1.0 if line[0][1] > 0.0 else -1.0)  # arms swing apart and together
        c, s = math.cos(angle), math.sin(angle)
        points = [(x * c - y * s, x * s + y * c) for x, y in line]
        brush.stroke(sleeve, [(x * r, y * r) for x, y in points], row.width * r)


def draw_foot(brush: Brush, activity: str, r: float, place: Point = (0.0, 0.0)) -> None:
    """Draw a foot of a pedestrian whose body has the size r, m, at a place of its frame."""
    row = ACTIVITY[activity]
    assert row.foot is not None  # other activities hide the feet
    brush.ellipse(shaded(row.colour, 0.6), place, (row.foot[2] * r, row.foot[3] * r))


def robot_part(robot: RobotState, *, touches: bool = False, is_other: bool = False) -> Part:
    """A robot at its pose; see `draw_chassis`."""
    shape = robot.body.outline
    draw = partial(draw_chassis, shape=shape, touches=touches, is_other=is_other)
    return ("robot", shape, touches, is_other), draw, robot.direction


def draw_chassis(brush: Brush, shape: Shape, *, touches: bool = False, is_other: bool = False) -> None:
    """Draw an outline with wheels, and an arrow that points ahead.

    Args:
        shape: of the outline.
        touches: whether its rim is thick and dark, as during a contact.
        is_other: whether it is in the lighter colour of the robots besides the first one.
    """
    colour = OTHER_ROBOT if is_other else ROBOT
    rim, width = DARK if touches else shaded(colour), 0.07 if touches else 0.035
    middle, r = (0.0, 0.0), shape.inradius
    if not isinstance(shape, Disc):  # the origin may lie at its edge
        middle, r = _middle_of(shape)
    if isinstance(shape, Disc):
        brush.disc(colour, (0.0, 0.0), r)
        brush.ring(rim, (0.0, 0.0), r, width)
    else:
        scale = max(1.0 - 0.5 * width / r, 0.5)  # the rim lies within the outline
        inner = [(middle[0] + scale * (x - middle[0]), middle[1] + scale * (y - middle[1])) for x, y in shape.core]
        brush.polygon(colour, inner, rim, width)
    mx, my = middle
    for side in (-1, 1):
        y = my + side * 0.72 * r
        brush.box(DARK, (mx - 0.35 * r, y - 0.09 * r), (mx + 0.35 * r, y + 0.09 * r))
    arrow = [(0.78 * r, 0.0), (-0.42 * r, 0.48 * r), (-0.18 * r, 0.0), (-0.42 * r, -0.48 * r)]
    brush.polygon(PAPER, [(mx + x, my + y) for x, y in arrow])


def _middle_of(shape: Shape) -> tuple[Point, float]:
    """The mean of the corners of an outline, m, and the radius of the circle around it within the outline, m."""
    corners = shape.core
    x, y = sum(corner[0] for corner in corners) / len(corners), sum(corner[1] for corner in corners) / len(corners)
    around = Polygon(tuple((a - x, b - y) for a, b in corners))
    return (x, y), around.inradius


def goal_part(goal: Goal, *, is_other: bool = False) -> Part:
    """A goal; see `draw_target`."""
    draw = partial(draw_target, radius=goal.distance, is_other=is_other)
    return ("goal", goal.distance, is_other), draw, (1.0, 0.0)


def draw_target(brush: Brush, radius: float, *, is_other: bool = False) -> None:
    """Draw a target; its dashed rim is the distance (m) at which the goal counts as reached.

    Args:
        radius: of the rim, m.
        is_other: whether it is in the lighter colour of the goals of robots besides the first one.
    """
    colour = mixed(FLOOR, GOAL, 0.45) if is_other else GOAL
    brush.disc(mixed(FLOOR, GOAL, 0.08 if is_other else 0.16), (0.0, 0.0), radius)
    brush.dashed_body(colour, radius, 0.0, 0.025, 16)
    brush.ring(colour, (0.0, 0.0), 0.6 * radius, 0.03)
    brush.disc(colour, (0.0, 0.0), 0.22 * radius)


def draw_way(brush: Brush, start: Point, goal: Point) -> None:
    """Draw the dashed line from a robot besides the first one to its goal, world frame, m."""
    dx, dy = goal[0] - start[0], goal[1] - start[1]
    dashes = max(int(math.hypot(dx, dy) / _DASH), 1)
    for k in range(dashes):
        ends = ((k + part) / dashes for part in (0.0, 0.5))
        brush.stroke(mixed(FLOOR, GOAL, 0.35), [(start[0] + s * dx, start[1] + s * dy) for s in ends], 0.02)
