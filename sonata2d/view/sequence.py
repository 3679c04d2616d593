"""Draws pictures of one scene one after the other, and of each only the parts that differ from the empty room.

The pictures equal those of `picture` to the bit. Making a picture smaller is exact for each square of pixels by
itself, so that tiles of a picture can be made smaller one by one.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from functools import partial

import pygame

from ..core.scene import Scene
from ..core.snapshot import Snapshot
from .brush import Brush
from .canvas import PixelCanvas, TrackingCanvas
from .draw import QUICK, annotate, backdrop, camera_for, draw_moving, height_below, shrunk
from .layers import Layers
from .legend import Legend
from .projection import DEFAULT_SIDE
from .sprites import ShapeCache
from .trails import Trails, draw_trails

_TILE = 16  # px of the picture


class PictureSequence:
    """Pictures of one scene from the same camera.

    Args:
        scene: of all snapshots.
        size, scale, layers: as for `picture`.
        side: longer side of pictures of neither size nor scale, at most, px.
        legend: of all pictures.
    """

    def __init__(
        self,
        scene: Scene,
        *,
        size: tuple[int, int] | None = None,
        scale: float | None = None,
        side: float = DEFAULT_SIDE,
        layers: Layers | None = None,
        legend: Legend = Legend(),  # noqa: B008  frozen
    ) -> None:
        self._layers, legend = layers or Layers(), legend.fitting(size)
        below = height_below(self._layers, legend, size[0]) if size else 0
        self._camera = camera_for(scene, size=size, scale=scale, side=side, below=below)
        width, height = self._camera.size
        self._room = backdrop(scene, self._camera, self._layers, fine=QUICK)
        self._large = self._room.copy()
        self._empty = shrunk(self._room, self._camera.size, height_below(self._layers, legend, width))
        legend.draw(PixelCanvas(self._empty), height + height_below(self._layers), width)
        self._picture = self._empty.copy()
        self._tiles = tiles_of((), self._camera.size, QUICK)  # that are not empty
        self._notes: list[pygame.Rect] = []  # parts of the picture that hold text
        self._shapes = ShapeCache()

    def draw(
        self,
        snapshot: Snapshot,
        *,
        trails: Trails | None = None,
        caption: str | None = None,
        outcome: str | None = None,
    ) -> pygame.Surface:
        """Draw a snapshot.

        Args:
            trails, caption, outcome: as for `picture`.

        Returns:
            The picture, which the next call changes.
        """
        canvas = TrackingCanvas(self._large, QUICK)
        brush = Brush(canvas, self._camera.supersampled(QUICK), QUICK, cache=partial(self._shapes.put, canvas))
        draw_moving(brush, snapshot, self._layers, partial(draw_trails, trails=trails))
        tiles, size = tiles_of(canvas.boxes, self._camera.size, QUICK), self._camera.size
        emptied = [before & ~now for before, now in zip(self._tiles, tiles, strict=True)]
        for box in [*self._notes, *boxes_of(emptied, size)]:
            self._picture.blit(self._empty, box, box)
        for box in boxes_of(tiles, size):
            x, y, width, height = box
            large = pygame.Rect(x * QUICK, y * QUICK, width * QUICK, height * QUICK)
            source = self._large.subsurface(large)
            pygame.transform.smoothscale(source, box.size, self._picture.subsurface(box))
            source.blit(self._room, (0, 0), large)
        notes = TrackingCanvas(self._picture)
        annotate(notes, self._camera, snapshot, self._layers, trails, caption, outcome)
        self._tiles, self._notes = tiles, notes.boxes
        return self._picture


def tiles_of(boxes: Iterable[pygame.Rect], size: tuple[int, int], scale: int) -> list[int]:
    """The tiles of a picture that boxes touch.

    Args:
        boxes: on a surface `scale` times larger than the picture.
        size: of the picture, px.
        scale: see `boxes`.

    Returns:
        For each row of tiles a number whose bit k is set if the k-th tile is touched.
    """
    side = _TILE * scale
    rows = [0] * (-(-size[1] // _TILE))
    for x, y, width, height in boxes:
        if width and height:
            bits = (1 << ((x + width - 1) // side + 1)) - (1 << (x // side))
            for row in range(y // side, (y + height - 1) // side + 1):
                rows[row] |= bits
    return rows


def boxes_of(tiles: Sequence[int], size: tuple[int, int]) -> list[pygame.Rect]:
    """Disjoint boxes that cover the tiles that `tiles_of` returned, within a picture of a size."""
    found: list[pygame.Rect] = []
    above: dict[tuple[int, int], pygame.Rect] = {}  # boxes that end in the row above
    for row, bits in enumerate(tiles):
        current = {}
        for first, last in _runs(bits):
            box = above.get((first, last))
            if box is None:
                box = pygame.Rect(first * _TILE, row * _TILE, (last - first) * _TILE, 0)
                found.append(box)
            box.height += _TILE
            current[first, last] = box
        above = current
    area = pygame.Rect(0, 0, *size)
    return [box.clip(area) for box in found]


def _runs(bits: int) -> Iterator[tuple[int, int]]:
    """First and next to last index of each run of set bits."""
    start = 0
    while bits:
        zeros = (bits & -bits).bit_length() - 1
        bits >>= zeros
        ones = (~bits & (bits + 1)).bit_length() - 1
        bits >>= ones
        yield start + zeros, start + zeros + ones
        start += zeros + ones
