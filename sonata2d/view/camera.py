"""From metres to pixels: the one place where y turns to point down."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from ..errors import RenderError
from ..geometry import Point

LARGEST = 6000  # pixels a side, past which a wrong scale is likelier than a large picture
_USUAL_SCALE, _USUAL_SIDE = 80.0, 1000.0  # px/m, and the side in px that it shall not exceed


@dataclass(frozen=True, slots=True)
class Camera:
    """Looks straight down on a part of the plane.

    Attributes:
        scale: pixels a metre.
        left, top: world coordinates of the picture's upper left corner, m.
        size: width and height of the picture, pixels.
    """

    scale: float
    left: float
    top: float
    size: tuple[int, int]

    @classmethod
    def fit(
        cls,
        points: Iterable[Point],
        *,
        size: tuple[int, int] | None = None,
        scale: float | None = None,
        margin: float = 0.3,
    ) -> Camera:
        """See all the points, centred.

        Args:
            points: m.
            size: of the picture in pixels; without it, as large as the scale asks.
            scale: pixels a metre; without it, as large as the size allows, or a usual one.
            margin: free space round the points, m.

        Raises:
            RenderError: no point is given, or size or scale make no picture.
        """
        x0, x1, y0, y1 = _bounds(points)
        wide, high = x1 - x0 + 2 * margin, y1 - y0 + 2 * margin
        if scale is None:
            room = size or (_USUAL_SIDE, _USUAL_SIDE)
            scale = min(room[0] / wide, room[1] / high, math.inf if size else _USUAL_SCALE)
        width, height = size or (math.ceil(wide * scale), math.ceil(high * scale))
        if not 0.0 < scale < math.inf or not (16 <= width <= LARGEST and 16 <= height <= LARGEST):
            raise RenderError(
                f"cannot draw {width} x {height} pixels at {scale:g} pixels a metre; "
                f"a side may have 16 to {LARGEST}: choose another size or scale"
            )
        return cls(scale, (x0 + x1 - width / scale) / 2, (y0 + y1 + height / scale) / 2, (width, height))

    def to_pixels(self, point: Point) -> Point:
        """Where a world point appears: pixels right and down from the upper left corner."""
        return (point[0] - self.left) * self.scale, (self.top - point[1]) * self.scale

    def to_world(self, pixel: Point) -> Point:
        """The world point under a pixel, m; the inverse of `to_pixels`."""
        return self.left + pixel[0] / self.scale, self.top - pixel[1] / self.scale

    def finer(self, times: int) -> Camera:
        """The same view with so many times the pixels a side."""
        return Camera(self.scale * times, self.left, self.top, (self.size[0] * times, self.size[1] * times))


def _bounds(points: Iterable[Point]) -> tuple[float, float, float, float]:
    """Least and greatest x, then y."""
    xs, ys = zip(*points, strict=True) if (points := list(points)) else ((), ())
    if not xs:
        raise RenderError("there is nothing to draw: the scene has neither outline nor walls")
    return min(xs), max(xs), min(ys), max(ys)
