"""Starts that simulated people can have: recordings are some centimetres off, and people in them squeeze together."""

from __future__ import annotations

import numpy as np

from ..entities import Human
from ..exact import Array
from ..geometry import Barriers, Pose, quantised
from ..record.layout import Tree

BODY = Human(1, Pose(0.0, 0.0)).radius  # m
OVERLAP = 0.03  # m, by which outlines may overlap at the start; the physics soon has them apart
_ROUNDS = 200


def with_room(rows: list[Tree], edges: Array) -> list[Tree]:
    """People of a scenario, those who are simulated moved apart and away from walls just as far as bodies need.

    Who comes in later waits until there is room, and is moved away from walls only.

    Args:
        rows: as `people` of a scenario lists them.
        edges: (W, 4), walls, m.
    """
    walls = Barriers.of([((x1, y1), (x2, y2), 0.0) for x1, y1, x2, y2 in edges.tolist()])
    placed = [k for k, row in enumerate(rows) if "x" in row]
    at_once = np.array(["enters" not in rows[k] for k in placed], dtype=bool)
    places = np.array([(rows[k]["x"], rows[k]["y"]) for k in placed], dtype=float).reshape(-1, 2)
    for _ in range(_ROUNDS):
        push = _from_walls(places, walls)
        push[at_once] += _from_one_another(places[at_once])
        if np.abs(push).max(initial=0.0) < 1e-4:
            break
        places += push
    moved = dict(zip(placed, places.tolist(), strict=True))
    return [
        row | {"x": quantised(moved[k][0]), "y": quantised(moved[k][1])} if k in moved else row
        for k, row in enumerate(rows)
    ]


def _from_one_another(places: Array) -> Array:
    """(n, 2), m, half of what pairs are too near."""
    away = places[:, None] - places[None]
    apart = np.hypot(away[..., 0], away[..., 1])
    same = np.triu(apart < 1e-9, 1)
    away[same], away[same.T] = (0.0, 1.0), (0.0, -1.0)  # two on one spot go to either side
    lacks = np.maximum(2 * BODY - OVERLAP - apart, 0.0)
    np.fill_diagonal(lacks, 0.0)
    unit = away / np.maximum(np.hypot(away[..., 0], away[..., 1]), 1e-9)[..., None]
    return np.asarray((unit * lacks[..., None] / 2).sum(axis=1))


def _from_walls(places: Array, walls: Barriers) -> Array:
    """(n, 2), m, what they are too near to the nearest wall."""
    if not len(walls) or not len(places):
        return np.zeros_like(places)
    x, y = walls.towards(places)
    nearest = np.hypot(x, y).argmin(axis=0), np.arange(len(places))
    towards = np.stack((x[nearest], y[nearest]), axis=1)
    apart = np.maximum(np.hypot(towards[:, 0], towards[:, 1]), 1e-9)
    return np.asarray(-towards / apart[:, None] * np.maximum(BODY - OVERLAP - apart, 0.0)[:, None])
