"""Interior doors: the openings between walls that they close, and the space in which their leaves move."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import product

import numpy as np

from ..core.doors import HALF_THICKNESS, InteriorDoor, leaf_lines
from ..core.entities import Furniture
from ..core.geometry import Barriers, Outline, Point, Pose, Rectangle, canonical_angle, quantised
from ..core.portable_math import angle_of, unit_vector
from ..core.rng import RandomStream
from ..core.scene import Scene
from ..core.separation import outline_gaps
from ..core.vectors import length, wrap_angle
from ..errors import SceneError
from .floor_plans import FloorPlan
from .placement import PlacedShape
from .scenario.config import ScenarioConfig
from .scenario.sections import InteriorDoorConfig

_NARROWEST, _WIDEST = 0.5, 3.0  # m, of an opening with a door
_OPPOSITE = 0.75  # cosine of the angle between an opening and the vector to its other side, at least
_ALONG = 0.7  # cosine of the angle between an opening and the given direction of its door, at least
_JAMB = 0.35  # m, of a leaf from its fixed end, which may pass the corner of a thick wall
_TURNS, _SPACING = 129, 0.03  # positions of a leaf, and m along it, at which its room is checked
_MAX_OVERLAP = 0.01  # m, of a body with a leaf at the start
_MARGIN = 0.05  # m, around the space in which a leaf moves
_THRESHOLD = 0.5  # m, before and behind a sliding door, which is kept free at the start


def place_interior_doors(
    config: ScenarioConfig, plan: FloorPlan, fixed: Sequence[Furniture], rng: RandomStream
) -> tuple[InteriorDoor, ...]:
    """The interior doors of a scene, with ids from 1 on.

    Args:
        config: its section `interior_doors`.
        plan: the room.
        fixed: the fixed furniture.
        rng: of the ends at which leaves are fixed that have no `theta`.

    Raises:
        SceneError: there is no opening for one, or something is in the way of its leaf.
    """
    doors = tuple(_door(k, door, plan, rng) for k, door in enumerate(config.interior_doors, 1))
    for k, door in enumerate(doors):
        _check_way(door, plan, fixed, doors[:k])
    return doors


def check_starts(scene: Scene) -> None:
    """Check that nobody starts in the leaf of a door.

    Raises:
        SceneError: somebody does.
    """
    if not scene.interior_doors:
        return
    leaves = np.array(
        [[(*start, *end, size) for start, end, size in (d.leaf(d.opening) for d in scene.interior_doors)]]
    )
    bodies: list[tuple[str, Outline, Pose]]
    bodies = [(f"person {h.id}", h.shape, h.pose) for h in scene.humans if h.enters == 0]
    bodies += [("the robot", robot.outline, robot.pose) for robot, _ in scene.tasks]
    for name, shape, pose in bodies:
        gaps = outline_gaps(shape, np.array([pose.position]), np.array([pose.direction]), leaves)[0]
        if gaps.min() < -_MAX_OVERLAP:
            door = scene.interior_doors[int(np.argmin(gaps))]
            raise SceneError(f"{name} would start in the leaf of interior door {door.id}; move one of them")


def _check_way(door: InteriorDoor, plan: FloorPlan, fixed: Sequence[Furniture], others: Sequence[InteriorDoor]) -> None:
    """Check that the leaf of a door has room.

    Raises:
        SceneError: a wall, a piece of fixed furniture or another door is in its way.
    """
    edges = [edge for piece in fixed if piece.on is None for edge in piece.shape.edges(piece.pose)]
    solids = plan.barriers.joined(Barriers.of(edges + [other.leaf(0.0) for other in others]))
    openings = np.linspace(-1.0, 1.0, _TURNS) if door.kind == "hinged" and door.moves else np.array([0.0])
    if not door.moves:
        openings[0] = door.opening
    places = np.arange(_JAMB, door.width - _MARGIN, _SPACING)
    lines = leaf_lines([door], openings[:, None])[:, 0]
    start, along = lines[:, None, :2], (lines[:, None, 2:4] - lines[:, None, :2]) / door.width
    points = (start + places[:, None] * along).reshape(-1, 2)
    if len(points) and solids.gaps(points).min() < HALF_THICKNESS:
        raise SceneError(
            f"the leaf of the interior door at ({door.middle[0]:.2f}, {door.middle[1]:.2f}) meets a wall, furniture or "
            "another door; move it, or make it sliding"
        )


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
    if config.x is None or config.y is None:
        ends = _doorway(plan)
    else:
        ends = opening_at(plan, (config.x, config.y), config.theta)
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


def opening_at(plan: FloorPlan, place: Point, theta: float | None = None) -> tuple[Point, Point]:
    """The two sides of the opening between walls that a place is in, m; with `theta`, along this direction, rad.

    Raises:
        SceneError: there are no walls on opposite sides of the place, or they are too near or too far apart.
    """
    if not plan.is_on_floor(np.array([place])).all():
        raise SceneError(f"the interior door ({place[0]:g}, {place[1]:g}) is outside the room; move it")
    x, y = (offsets[:, 0] for offsets in plan.barriers.towards(np.array([place])))
    sides = sorted((math.sqrt(dx * dx + dy * dy), dx, dy) for dx, dy in zip(x.tolist(), y.tolist(), strict=True))
    if theta is not None:
        c, s = unit_vector(theta)
        sides = [side for side in sides if abs(side[1] * c + side[2] * s) >= _ALONG * side[0]]
    near, dx, dy = sides[0] if sides else (0.0, 0.0, 0.0)
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
