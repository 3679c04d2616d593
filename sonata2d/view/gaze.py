"""How far people see: rays of a look as far as the next wall."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..core.geometry import Barriers
from ..core.humans import HumanState
from ..core.portable_math import Array
from ..core.scene import Scene
from .people import FAN, FAN_REACH

Reaches = dict[int, list[float]]  # by id: how far each ray goes, m


def walls_of(scene: Scene) -> Barriers:
    """All walls as thin segments."""
    return Barriers.of([(wall.start, wall.end, 0.0) for wall in scene.walls])


def cut_short(people: Sequence[HumanState], walls: Barriers) -> Reaches:
    """The looks that a wall cuts short, (rays,) each; others are left out."""
    if not people or not len(walls):
        return {}
    places = np.array([human.pose.position for human in people], dtype=float)
    reach = np.array([human.radius + FAN_REACH for human in people])
    near = np.flatnonzero(walls.gaps(places).min(axis=0) < reach)
    return {people[int(k)].id: _ways(places[k], people[int(k)].head, walls).tolist() for k in near}


def _ways(place: Array, head: float, walls: Barriers) -> Array:
    """How far each ray goes before a wall, (rays,), m; infinite where there is none."""
    c, s = np.cos(head), np.sin(head)
    rays = np.array([(x * c - y * s, x * s + y * c) for x, y in FAN])[:, None, :]
    along, offset = walls.end - walls.start, walls.start - place
    slope = rays[..., 0] * along[:, 1] - rays[..., 1] * along[:, 0]
    slope = np.where(slope == 0.0, 1e-12, slope)
    way = (offset[:, 0] * along[:, 1] - offset[:, 1] * along[:, 0]) / slope
    share = (offset[:, 0] * rays[..., 1] - offset[:, 1] * rays[..., 0]) / slope
    met = (way > 0.0) & (share >= 0.0) & (share <= 1.0)
    shortest: Array = np.where(met, way, np.inf).min(axis=1)
    return shortest
