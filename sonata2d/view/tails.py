"""Ways as a window shows them: bands in a few tones each, whose points are worked out all at once."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import pairwise

import numpy as np
import pygame

from ..core.portable_math import Array
from .camera import Camera
from .palette import Colour, time_colour
from .trails import LEAP, ROBOT_WIDTH, WAY_WIDTH, Trails, way_colour

_TONES = 12  # of a way from its beginning to its end


def draw_tails(surface: pygame.Surface, camera: Camera, trails: Trails) -> None:
    """Draw the people's ways, then the robot's over them, onto a surface at its own pixels."""
    share = trails.share
    for way in np.swapaxes(trails.humans, 0, 1):
        _draw_way(surface, camera, way, share, way_colour, WAY_WIDTH)
    _draw_way(surface, camera, trails.robot, share, time_colour, ROBOT_WIDTH)


def _draw_way(
    surface: pygame.Surface,
    camera: Camera,
    way: Array,
    share: Array,
    colour: Callable[[float], Colour],
    width: float,
) -> None:
    for run in _runs(way):
        points, moments = _seen(way[run], share[run], camera)
        if len(points) < 2:
            continue
        along = np.gradient(points, axis=0)
        along /= np.maximum(np.sqrt((along * along).sum(axis=1, keepdims=True)), 1e-9)
        aside = np.stack((-along[:, 1], along[:, 0]), axis=1) * max(width * camera.scale / 2, 1.0)
        left, right = (points + aside).tolist(), (points - aside).tolist()
        tones = np.round(moments[1:] * (_TONES - 1))
        cuts = [0, *(np.flatnonzero(np.diff(tones)) + 1).tolist(), len(points) - 1]
        for first, last in pairwise(cuts):
            band = left[first : last + 1] + right[first : last + 1][::-1]
            tone = colour(float(tones[first]) / (_TONES - 1))
            pygame.draw.polygon(surface, tone, band)
            pygame.draw.aalines(surface, tone, False, left[first : last + 1])
            pygame.draw.aalines(surface, tone, False, right[first : last + 1])


def _runs(way: Array) -> Iterator[slice]:
    """Stretches without a gap: where nobody was away or leapt."""
    steps = np.abs(np.diff(way, axis=0)).sum(axis=1)
    walked = np.concatenate(([False], steps < LEAP, [False])).astype(int)  # a step that is not finite is none
    starts, ends = np.flatnonzero(np.diff(walked) > 0), np.flatnonzero(np.diff(walked) < 0)
    for start, end in zip(starts, ends, strict=True):
        yield slice(int(start), int(end) + 1)


def _seen(way: Array, share: Array, camera: Camera) -> tuple[Array, Array]:
    """Points in pixels, those left out that lie where the one before did; and their shares of the time."""
    x, y = camera.to_pixels((way[:, 0], way[:, 1]))  # type: ignore[arg-type]  # arrays go the same way as numbers
    points = np.stack((x, y), axis=1)
    moved = np.concatenate(([True], np.abs(np.diff(points, axis=0)).sum(axis=1) > 0.5))
    return points[moved], share[moved]
