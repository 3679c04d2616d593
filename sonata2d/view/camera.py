"""From metres to pixels: the one place where y turns to point down, and where the world turns round the robot."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from ..core.geometry import Point
from ..errors import RenderError

LARGEST = 6000  # pixels a side, past which a wrong scale is likelier than a large picture
_USUAL_SCALE, _USUAL_SIDE = 80.0, 1000.0  # px/m, and the side in px that it shall not exceed


@dataclass(frozen=True, slots=True)
class Camera:
    """Looks straight down on a part of the plane.

    Attributes:
        scale: pixels a metre.
        left, top: world coordinates of the picture's upper left corner, m.
        size: width and height of the picture, pixels.
        up: unit vector of the world that points up in the picture.
    """

    scale: float
    left: float
    top: float
    size: tuple[int, int]
    up: Point = (0.0, 1.0)

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

    @classmethod
    def behind(
        cls, place: Point, direction: Point, *, size: tuple[int, int], reach: float = 5.0, down: float = 0.72
    ) -> Camera:
        """See what lies before someone, who looks up in the picture.

        Args:
            place, direction: where they are, m, and the unit vector along which they look.
            size: of the picture, pixels.
            reach: m from them to the upper edge.
            down: share of the picture's height that lies above them.

        Raises:
            RenderError: size or reach make no picture.
        """
        if not (0.0 < reach < math.inf and all(16 <= side <= LARGEST for side in size)):
            raise RenderError(
                f"cannot draw {size[0]} x {size[1]} pixels with a reach of {reach:g} m; a side may have 16 to {LARGEST}"
                " and the reach is above 0: choose another size or reach"
            )
        scale = down * size[1] / reach
        (hx, hy), aside = direction, size[0] / 2 / scale
        return cls(scale, place[0] + reach * hx - aside * hy, place[1] + reach * hy + aside * hx, size, direction)

    def to_pixels(self, point: Point) -> Point:
        """Where a world point appears: pixels right and down from the upper left corner."""
        (ux, uy), x, y = self.up, point[0] - self.left, self.top - point[1]
        return (x * uy + y * ux) * self.scale, (y * uy - x * ux) * self.scale

    def to_world(self, pixel: Point) -> Point:
        """The world point under a pixel, m; the inverse of `to_pixels`."""
        (ux, uy), right, down = self.up, pixel[0] / self.scale, pixel[1] / self.scale
        return self.left + right * uy - down * ux, self.top - right * ux - down * uy

    def turned(self, direction: Point) -> Point:
        """A direction of the world as it appears: pixels right and down."""
        (ux, uy), (x, y) = self.up, direction
        return x * uy - y * ux, -(x * ux + y * uy)

    def nearer(self, times: float, place: Point) -> Camera:
        """The same picture filled by so much less of the world, as near to a place as what it saw allows."""
        width, height = self.size[0] / self.scale, self.size[1] / self.scale
        scale = self.scale * times
        left, top = place[0] - width / times / 2, place[1] + height / times / 2
        if times <= 1.0:  # then there is more than all, with that in the middle
            left, top = self.left + (width - width / times) / 2, self.top - (height - height / times) / 2
            return Camera(scale, left, top, self.size)
        low, high = sorted((self.left, self.left + width - width / times))
        deep, tall = sorted((self.top, self.top - height + height / times))
        return Camera(scale, min(max(left, low), high), min(max(top, deep), tall), self.size)

    def finer(self, times: int) -> Camera:
        """The same view with so many times the pixels a side."""
        return Camera(self.scale * times, self.left, self.top, (self.size[0] * times, self.size[1] * times), self.up)


def _bounds(points: Iterable[Point]) -> tuple[float, float, float, float]:
    """Least and greatest x, then y."""
    xs, ys = zip(*points, strict=True) if (points := list(points)) else ((), ())
    if not xs:
        raise RenderError("there is nothing to draw: the scene has neither outline nor walls")
    return min(xs), max(xs), min(ys), max(ys)
