"""Areas, doors, queues and places of interest, on the floor and in the walls of a room."""

from __future__ import annotations

import math
from collections.abc import Iterable

from ..core.doors import DoorState
from ..core.entities import Area
from ..core.furniture_types import WOOD, WOOD_EDGE
from ..core.geometry import Point, Pose
from ..core.scene import Scene
from .brush import Brush
from .palette import BLUE, FAINT, FLOOR, INK, WALL, Colour, mixed

_WALL_WIDTH = 0.12  # m, as drawn by `room`: outward only
_LEAF_WIDTH = 0.07  # m
_JAMB, _LINE = 0.05, 0.02  # m, width of the door frame, and of lines
AREA_WORD = 0.22  # m, height of the name of an area, which is in its middle
_SLOT_RADIUS = 0.13  # m, of the mark where a pedestrian in a queue stands
_QUEUE, _PLACE = mixed(FLOOR, FAINT, 0.45), mixed(FLOOR, INK, 0.3)
_NO_GO: Colour = (200, 40, 40)
_SLOW: Colour = (214, 140, 20)
_WAY: Colour = BLUE
_DASH_SPACING = 0.16  # m, around a place
_LARGEST_PLACE = 20.0  # m, radius beyond which dashes get longer


def draw_landmarks(brush: Brush, scene: Scene) -> None:
    """Draw the areas, doors, queues and places of a scene."""
    for area in scene.areas:
        draw_area(brush, area)
    for door in scene.doors:
        draw_door(_at(brush, door.pose), door.width)
    for queue in scene.queues:
        draw_queue(_at(brush, queue.pose), queue.spacing, queue.capacity)
    for place in scene.places:
        draw_place(brush.at(place.position), place.radius)


def draw_area(brush: Brush, area: Area) -> None:
    """Draw an area in the colour of its first rule, with its name and rules as words; without rules only its name."""
    (x, y), size = centre_of(area)
    words = area.name
    rules = ((area.no_go, _NO_GO), (area.speed_limit is not None, _SLOW), (area.one_way is not None, _WAY))
    colour = next((colour for holds, colour in rules if holds), None)
    if colour is not None:
        brush.wash(colour, 26, area.polygon)
        brush.stroke(mixed(FLOOR, colour, 0.6), [*area.polygon, area.polygon[0]], _LINE)
    if area.no_go:
        words += ": no robots"
    if area.speed_limit is not None:
        words += f": {area.speed_limit:g} m/s"
    if area.one_way is not None:
        arrow = brush.at((x, y - 0.28), (math.cos(area.one_way), math.sin(area.one_way)))
        arrow.stroke(mixed(FLOOR, _WAY, 0.6), [(-0.4, 0.0), (0.35, 0.0)], 0.05)
        arrow.polygon(mixed(FLOOR, _WAY, 0.6), [(0.5, 0.0), (0.28, 0.13), (0.28, -0.13)])
    brush.at((x, y)).word(mixed(FLOOR, colour or FAINT, 0.75), words, size, AREA_WORD)


def centre_of(area: Area) -> tuple[Point, float]:
    """The middle of the box around an area, and its width; m."""
    xs, ys = zip(*area.polygon, strict=True)
    return ((min(xs) + max(xs)) / 2, (min(ys) + max(ys)) / 2), 0.9 * (max(xs) - min(xs))


def _at(brush: Brush, pose: Pose) -> Brush:
    return brush.at(pose.position, pose.direction)


def draw_door(brush: Brush, width: float) -> None:
    """Draw an opening of a wall that lies behind the brush, with its frame and two leaves that are slid open.

    Args:
        width: m, across the brush's direction.
    """
    half = width / 2
    brush.box(FLOOR, (-_WALL_WIDTH, -half), (0.01, half))
    brush.box(mixed(FLOOR, WOOD, 0.6), (-_WALL_WIDTH, -half), (-0.3 * _WALL_WIDTH, half))
    for side in (-1, 1):
        low, high = sorted((side * half, side * (half + _JAMB)))
        brush.box(WOOD_EDGE, (-_WALL_WIDTH, low), (0.02, high))
        low, high = sorted((side * half, side * 0.62 * half))
        brush.box(WOOD, (-0.75 * _WALL_WIDTH, low), (-0.45 * _WALL_WIDTH, high), WOOD_EDGE, 0.012)


def draw_leaves(brush: Brush, doors: Iterable[DoorState]) -> None:
    """Draw the leaves of interior doors; a sliding one is beside the doorway as far as it is open."""
    for each in doors:
        start, end = leaf_as_drawn(each)
        brush.stroke(WOOD_EDGE, (start, end), _LEAF_WIDTH)
        brush.stroke(WOOD, (start, end), 0.5 * _LEAF_WIDTH)


def leaf_as_drawn(state: DoorState) -> tuple[Point, Point]:
    """Both ends of the leaf of a door, m, with the part of a sliding one that is in the wall."""
    start, end, _ = state.leaf
    if state.door.kind == "sliding":
        start = state.door.pose.to_world((-state.opening * state.door.width, 0.0))
    return start, end


def draw_leaf(brush: Brush) -> None:
    """Draw a hinged door that is ajar, as a symbol."""
    for at in (-0.45, 0.4):
        brush.stroke(WALL, [(0.0, at), (0.0, at + 0.08)], 0.08)
    brush.stroke(WOOD_EDGE, [(0.0, -0.37), (0.45, 0.15)], _LEAF_WIDTH)
    brush.stroke(WOOD, [(0.0, -0.37), (0.45, 0.15)], 0.5 * _LEAF_WIDTH)


def draw_queue(brush: Brush, spacing: float, capacity: int) -> None:
    """Draw a faint line backwards from the first pedestrian, and a mark where each one stands; spacing in m."""
    for number in range(capacity):
        x, radius = -spacing * number, min(_SLOT_RADIUS, 0.4 * spacing)
        brush.ring(_QUEUE, (x, 0.0), radius, _LINE)
        if number + 1 < capacity:
            brush.stroke(_QUEUE, [(x - radius, 0.0), (x - spacing + radius, 0.0)], _LINE)
    tip = _SLOT_RADIUS + 0.12
    brush.stroke(_QUEUE, [(tip - 0.07, 0.07), (tip, 0.0), (tip - 0.07, -0.07)], _LINE)  # where they look


def draw_place(brush: Brush, radius: float) -> None:
    """Draw a dashed circle; radius in m."""
    dashes = max(round(6.2832 * min(radius, _LARGEST_PLACE) / _DASH_SPACING), 8)
    brush.dashed_body(_PLACE, radius, 0.0, _LINE, dashes)
