"""Interior doors: the openings between walls that they close, and the space in which their leaves move."""

from __future__ import annotations

import math
from itertools import product

import numpy as np

from ..core.doors import InteriorDoor
from ..core.geometry import Point, Pose, Rectangle, canonical_angle, quantised
from ..core.portable_math import angle_of
from ..core.rng import RandomStream
from ..core.vectors import length, wrap_angle
from ..errors import SceneError
from .floor_plans import FloorPlan
from .placement import PlacedShape
from .scenario.config import ScenarioConfig
from .scenario.sections import InteriorDoorConfig

_NARROWEST, _WIDEST = 0.5, 3.0  # m, of an opening with a door
_OPPOSITE = 0.75  # cosine of the angle between an opening and the vector to its other side, at least
_MARGIN = 0.05  # m, around the space in which a leaf moves
_THRESHOLD = 0.5  # m, before and behind a sliding door, which is kept free at the start


def place_interior_doors(config: ScenarioConfig, plan: FloorPlan, rng: RandomStream) -> tuple[InteriorDoor, ...]:
    """The interior doors of a scene, with ids from 1 on.

    Args:
        config: its section `interior_doors`.
        plan: the room.
        rng: of the ends at which leaves are fixed that have no `theta`.

    Raises:
        SceneError: there is no opening for one.
    """
    return tuple(_door(k, door, plan, rng) for k, door in enumerate(config.interior_doors, 1))


def zones_of(doors: tuple[InteriorDoor, ...]) -> list[PlacedShape]:
    """The space in which leaves move, in which nothing else is placed."""
    return [
        (
            Rectangle(door.width + 2 * _MARGIN, 2 * (door.width + _MARGIN if door.kind == "hinged" else _THRESHOLD)),
            Pose(*door.middle, door.pose.theta),
        )
        for door in doors
        if door.moves
    ]


def _door(id: int, config: InteriorDoorConfig, plan: FloorPlan, rng: RandomStream) -> InteriorDoor:
    ends = _doorway(plan) if config.x is None or config.y is None else opening_at(plan, (config.x, config.y))
    hinge, other = ends if rng.uniform() < 0.5 else ends[::-1]
    if config.theta is not None:
        turn = wrap_angle(angle_of(other[1] - hinge[1], other[0] - hinge[0]) - config.theta)
        if abs(turn) > math.pi / 2:
            hinge, other = other, hinge
    dx, dy = other[0] - hinge[0], other[1] - hinge[1]
    pose = Pose(quantised(hinge[0]), quantised(hinge[1]), canonical_angle(angle_of(dy, dx)))
    return InteriorDoor(
        id, pose, quantised(length(dx, dy)), config.kind, config.opened_by, quantised(config.opening),
        quantised(config.opening_time), quantised(config.hold),
    )  # fmt: skip


def _doorway(plan: FloorPlan) -> tuple[Point, Point]:
    """The ends of the doorway of a room of the kind `doorway`, m: the nearest ends of its two inner walls."""
    first, second = plan.inner_walls
    pairs = product((first.start, first.end), (second.start, second.end))
    return min(pairs, key=lambda pair: length(pair[1][0] - pair[0][0], pair[1][1] - pair[0][1]))


def opening_at(plan: FloorPlan, place: Point) -> tuple[Point, Point]:
    """The two sides of the opening between walls that a place is in, m.

    Raises:
        SceneError: there are no walls on opposite sides of the place, or they are too near or too far apart.
    """
    if not plan.is_on_floor(np.array([place])).all():
        raise SceneError(f"the interior door ({place[0]:g}, {place[1]:g}) is outside the room; move it")
    x, y = (offsets[:, 0] for offsets in plan.barriers.towards(np.array([place])))
    sides = sorted((math.sqrt(dx * dx + dy * dy), dx, dy) for dx, dy in zip(x.tolist(), y.tolist(), strict=True))
    near, dx, dy = sides[0]
    opposite = [
        (far, ox, oy) for far, ox, oy in sides[1:] if near * far > 0.0 and -(dx * ox + dy * oy) > _OPPOSITE * near * far
    ]
    ends = [(place[0] + ux, place[1] + uy) for _, ux, uy in (sides[0], *opposite[:1])]
    width = length(ends[1][0] - ends[0][0], ends[1][1] - ends[0][1]) if opposite else math.inf
    if not _NARROWEST <= width <= _WIDEST:
        found = f"they are {width:.2f} m apart" if opposite else "there are none on two sides of it"
        raise SceneError(
            f"the interior door ({place[0]:g}, {place[1]:g}) needs walls {_NARROWEST:g} to {_WIDEST:g} m apart, "
            f"{found}; move it into an opening"
        )
    return ends[0], ends[1]
