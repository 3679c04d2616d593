"""The occupancy grid of a scene, as SocNav3 files hold it."""

from __future__ import annotations

import math

import numpy as np

from ..core.entities import Furniture
from ..core.files.limits import MAX_GRID_CELLS
from ..core.geometry import Barriers, Disc
from ..core.portable_math import Array, BoolArray
from ..core.scene import Scene
from ..record.layout import JsonDict

_CELL_SIZE = 0.05  # m
UNKNOWN, FREE, OCCUPIED = -1, 0, 1  # values of cells
_RIM_CELLS = 5  # number of unknown cells on each side of the room


def occupancy_grid(scene: Scene) -> JsonDict:
    """Return the occupancy grid of a scene: -1 unknown, 0 free, 1 occupied.

    A cell is occupied if its centre lies in a piece of furniture with a body, or within half a cell's diagonal of a
    wall; other cells in the room are free. The grid covers the room's bounding box and a rim of 0.25 m. Cells are
    0.05 m, or larger for rooms above 200 m.

    Returns:
        Keys width and height (cells), cell_size, x_orig, y_orig (lower left corner, m), angle_orig, and data: rows of
        cells from the bottom up.
    """
    low, high = scene.outline.min(axis=0), scene.outline.max(axis=0)
    cell = _CELL_SIZE * math.ceil(
        max(float((high - low).max()) / (_CELL_SIZE * (MAX_GRID_CELLS - 2 * _RIM_CELLS)), 1.0)
    )
    origin = np.floor(low / cell) * cell - _RIM_CELLS * cell
    width, height = (math.ceil((high[k] - origin[k]) / cell - 1e-9) + _RIM_CELLS for k in (0, 1))
    x, y = (origin[k] + (np.arange(count) + 0.5) * cell for k, count in ((0, width), (1, height)))
    centres = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    cells = np.where(scene.is_on_floor(centres), FREE, UNKNOWN)
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


def _occupied(scene: Scene, points: Array, cell: float) -> BoolArray:
    """(M,), whether points (M, 2) are occupied."""
    occupied = np.zeros(len(points), dtype=bool)
    lines = [(wall.start, wall.end, 0.0) for wall in scene.walls]
    for line in (*lines, *scene.fixed_leaves):  # one at a time, to limit the memory
        occupied |= Barriers.of([line]).gaps(points)[0] <= cell * math.sqrt(0.5)
    for thing in scene.furniture:
        if thing.on is None:  # a thing on another one adds no footprint
            occupied |= _inside(points, thing)
    return occupied


def _inside(points: Array, thing: Furniture) -> BoolArray:
    """Whether points are inside the outline of a piece of furniture."""
    offset, (c, s) = points - np.array(thing.pose.position), thing.pose.direction
    if isinstance(thing.shape, Disc):
        in_disc: BoolArray = np.hypot(offset[:, 0], offset[:, 1]) <= thing.shape.radius
        return in_disc
    ahead, left = offset[:, 0] * c + offset[:, 1] * s, offset[:, 1] * c - offset[:, 0] * s
    core = np.array(thing.shape.core)
    along = np.roll(core, -1, axis=0) - core
    to_left = along[:, 0] * (left[:, None] - core[:, 1]) - along[:, 1] * (ahead[:, None] - core[:, 0])
    in_polygon: BoolArray = (to_left >= 0.0).all(axis=1)
    return in_polygon
