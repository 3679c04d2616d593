"""The occupancy grid that SocNav3 files carry, drawn from the scene."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..entities import Furniture
from ..exact import Array
from ..geometry import Disc, inside_polygon
from ..record.layout import Tree
from ..scene import Scene

CELL = 0.05  # m
_RIM = 5  # unknown cells round the room
_MOST = 4000  # cells a side
UNKNOWN, FREE, OCCUPIED = -1, 0, 1


def grid_of(scene: Scene) -> Tree:
    """Width, height, cell size, origin and rows of cells from the bottom up: -1 unknown, 0 free, 1 occupied.

    A cell is occupied where its centre lies in a thing that has a body, or within half a cell's diagonal of a wall;
    free elsewhere in the room. The room's box and a rim of 0.25 m are covered, with larger cells above 200 m.
    """
    low, high = scene.outline.min(axis=0), scene.outline.max(axis=0)
    cell = CELL * math.ceil(max(float((high - low).max()) / (CELL * (_MOST - 2 * _RIM)), 1.0))
    origin = np.floor(low / cell) * cell - _RIM * cell
    width, height = (math.ceil((high[k] - origin[k]) / cell - 1e-9) + _RIM for k in (0, 1))
    x, y = (origin[k] + (np.arange(count) + 0.5) * cell for k, count in ((0, width), (1, height)))
    centres = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    cells = np.where(inside_polygon(centres, scene.outline), FREE, UNKNOWN)
    cells[_occupied(scene, centres, cell)] = OCCUPIED
    return {
        "width": width,
        "height": height,
        "cell_size": cell,
        "x_orig": round(float(origin[0]), 9) + 0.0,
        "y_orig": round(float(origin[1]), 9) + 0.0,
        "angle_orig": 0,
        "data": cells.reshape(height, width).tolist(),
    }


def _occupied(scene: Scene, points: Array, cell: float) -> Any:
    """(M,) of bool."""
    hit = np.zeros(len(points), dtype=bool)
    for wall in scene.walls:
        hit |= _near(points, np.array(wall.start), np.array(wall.end), cell * math.sqrt(0.5))
    for thing in scene.furniture:
        if thing.on is None:
            hit |= _within(points, thing)
    return hit


def _near(points: Array, start: Array, end: Array, reach: float) -> Any:
    """Whether points are within reach of a segment; one at a time, as all at once would fill the memory."""
    along = end - start
    square = float(along @ along)
    share = np.clip((points - start) @ along / square, 0.0, 1.0) if square else np.zeros(len(points))
    off = points - start - share[:, None] * along
    return np.hypot(off[:, 0], off[:, 1]) <= reach


def _within(points: Array, thing: Furniture) -> Any:
    """Whether points are in a thing's outline."""
    offset, (c, s) = points - np.array(thing.pose.position), thing.pose.heading
    if isinstance(thing.shape, Disc):
        return np.hypot(offset[:, 0], offset[:, 1]) <= thing.shape.radius
    ahead, left = offset[:, 0] * c + offset[:, 1] * s, offset[:, 1] * c - offset[:, 0] * s
    return (np.abs(ahead) <= thing.shape.length / 2) & (np.abs(left) <= thing.shape.width / 2)
