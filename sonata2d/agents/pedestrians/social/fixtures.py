"""Objects, seats, queues, doors and places of a scene, and its social settings, for kernels."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ....core.compiled.packing import Floats, Floats2, Floats3, Ints, Ints2
from ....core.entities import Door, Furniture, Human
from ....core.geometry import Disc, Rectangle
from ....core.portable_math import Array
from ....core.relations import RELATIONS
from ....core.scene import Scene
from ....core.vectors import length
from ....registry import furniture_type

SPOT_SPACING = 0.7  # m, between the places at which pedestrians stand for a time
_DOORWAY_DEPTH = 0.4  # m, in front of a door, where pedestrians neither stand nor wander to
_MARGIN = 0.05  # m, by which places at doors and seats are farther from these than paths are
_ENTRANCE = 1.0  # m, from a door to where those that came through it appeared, at most, besides half its width


class Fixtures(NamedTuple):
    """Objects, seats, queues and doors that a scene offers to pedestrians, in its order.

    Attributes:
        thing: (T, 7), objects that a pedestrian can attend to: x, y, m; of a disc its radius, m, 0, 0, 1; of others the
            unit vector to the place at which a pedestrian stands, the distance of the object's edge on the way there,
            m, and 0; then the clearance, m.
        thing_piece, thing_relation: (T,) of int, index in the scene's furniture, and relation, into `RELATIONS`.
        seat: (S, 10), x, y, m; unit vector to the front; the three places beside it, best first, m.
        seat_piece: (S,) of int, index in the scene's furniture.
        slot: (Q, C, 2), where pedestrians stand in each queue, m.
        queue: (Q, 4), unit vector that they face; shortest and longest service time, s.
        capacity: (Q,) of int.
        door: (D, 7), x, y, m; unit vector into the room; width, largest distance from the middle at which a pedestrian
            passes, m; share.
        came_through: (D, N) of int, 1 for the pedestrians that have entered through a door.
        place: (L, 6), places of interest: x, y, radius, m; weight; shortest and longest stay, s.
        kept_free: (F, 3), discs in which no random destination lies, x, y and radius, m: doors and queues.
        box: (4,), bounding box of the room, m.
    """

    thing: Floats2
    thing_piece: Ints
    thing_relation: Ints
    seat: Floats2
    seat_piece: Ints
    slot: Floats3
    queue: Floats2
    capacity: Ints
    door: Floats2
    came_through: Ints2
    place: Floats2
    kept_free: Floats2
    box: Floats


class Habits(NamedTuple):
    """Social settings of a scene, see `Social`; probabilities, times in s, distances in m, and stops per minute."""

    visits: float
    joins: float
    meets: float
    leaves: float
    sits: float
    queues: float
    exits: float
    visit_low: float
    visit_high: float
    talk_low: float
    talk_high: float
    sit_low: float
    sit_high: float
    pause_low: float
    pause_high: float
    stops: float
    stop_low: float
    stop_high: float
    detours: float
    door_depth: float
    is_lively: bool


def habits_of(scene: Scene, clearance: float) -> Habits:
    """The settings of a scene whose paths keep a clearance from walls, m."""
    s = scene.social
    return Habits(
        s.visits, s.joins, s.meets, s.leaves, s.sits, s.queues, s.exits, *s.visit_time, *s.talk_time, *s.sit_time,
        *s.pause, s.stops, *s.stop_time, s.detours, clearance + _MARGIN, s.is_lively,
    )  # fmt: skip


def fixtures_of(scene: Scene, clearance: float) -> Fixtures:
    """The fixtures of a scene whose paths keep a clearance from walls, m."""
    kinds = [furniture_type(piece.type) for piece in scene.furniture]
    things = [
        (k, piece, kind)
        for k, (piece, kind) in enumerate(zip(scene.furniture, kinds, strict=True))
        if kind.relation is not None and not piece.is_seat
    ]
    seats = [(k, piece) for k, piece in enumerate(scene.furniture) if piece.is_seat]
    doors = [door for door in scene.doors if door.share > 0.0]
    longest = max((queue.capacity for queue in scene.queues), default=1)
    discs = [(*door.pose.to_world((_DOORWAY_DEPTH, 0.0)), door.width / 2 + _DOORWAY_DEPTH) for door in scene.doors]
    discs += [(*queue.slot(n), SPOT_SPACING) for queue in scene.queues for n in range(queue.capacity)]
    slots = [[queue.slot(n) for n in range(longest)] for queue in scene.queues]
    xs, ys = zip(*scene.polygon, strict=True)
    return Fixtures(
        thing=_table([(*_access(scene, piece), kind.clearance) for _, piece, kind in things], 7),
        thing_piece=np.array([k for k, _, _ in things], dtype=np.int64),
        thing_relation=np.array([RELATIONS.index(kind.relation or "") for _, _, kind in things], dtype=np.int64),
        seat=_table([_seat(piece, clearance + _MARGIN, scene.rules.side) for _, piece in seats], 10),
        seat_piece=np.array([k for k, _ in seats], dtype=np.int64),
        slot=np.array(slots, dtype=float).reshape(-1, longest, 2),
        queue=_table([(*queue.pose.direction, *queue.service) for queue in scene.queues], 4),
        capacity=np.array([queue.capacity for queue in scene.queues], dtype=np.int64),
        door=_table([(d.pose.x, d.pose.y, *d.pose.direction, d.width, d.reach, d.share) for d in doors], 7),
        came_through=np.array([[_came_through(h, d) for h in scene.humans] for d in doors], dtype=np.int64).reshape(
            len(doors), len(scene.humans)
        ),
        place=_table([(p.x, p.y, p.radius, p.weight, *p.stay) for p in scene.places], 6),
        kept_free=_table(discs, 3),
        box=np.array([min(xs), min(ys), max(xs), max(ys)], dtype=float),
    )


def _table(rows: Sequence[tuple[float, ...]], columns: int) -> Array:
    return np.array(rows, dtype=float).reshape(-1, columns)


def _access(scene: Scene, thing: Furniture) -> tuple[float, ...]:
    """Columns of `Fixtures.thing` before the clearance: the access side (-y) of an object, or of what it lies on."""
    carrier = next((other for other in scene.furniture if other.id == thing.on), thing)
    if isinstance(thing.shape, Disc):
        return thing.pose.x, thing.pose.y, thing.shape.radius, 0.0, 0.0, 1.0
    depth = carrier.shape.width / 2 if isinstance(carrier.shape, Rectangle) else carrier.shape.circumradius
    dx, dy = carrier.pose.x - thing.pose.x, carrier.pose.y - thing.pose.y
    hx, hy = thing.pose.direction
    return thing.pose.x, thing.pose.y, hy, -hx, dx * hy - dy * hx + depth, 0.0


def _seat(seat: Furniture, clearance: float, side: int) -> tuple[float, ...]:
    """A row of `Fixtures.seat`: first the place in front of the seat, then the one at the side of the rules."""
    front, left, right = seat.approaches(clearance)
    places = (front, right, left) if side > 0 else (front, left, right)
    return *seat.pose.position, *seat.front, *(value for place in places for value in place)


def _came_through(human: Human, door: Door) -> bool:
    """Whether a pedestrian has entered through a door."""
    (x, y), (door_x, door_y) = human.pose.position, door.pose.position
    return human.enters > 0 and length(x - door_x, y - door_y) < door.width / 2 + _ENTRANCE
