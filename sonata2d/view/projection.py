"""Transforms between the world (metres, y up) and a picture (pixels, y down)."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from ..core.floats import FloatFields
from ..core.geometry import Point
from ..errors import RenderError

MIN_SIDE, _MAX_SIDE = 16, 6000  # px; a larger picture is probably a mistake in the scale
_DOWN = 0.72  # fraction of the picture's height above an agent that is followed
_DEFAULT_SCALE, DEFAULT_SIDE = 80.0, 1000.0  # px/m; px, the side that the default scale does not exceed


@dataclass(frozen=True, slots=True)
class Camera(FloatFields):
    """A view straight down on a rectangle of the plane.

    Attributes:
        scale: pixels per metre.
        left, top: world coordinates of the picture's upper left corner, m.
        size: width and height of the picture, px.
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
        side: float = DEFAULT_SIDE,
        margin: float = 0.3,
    ) -> Camera:
        """Centre the view on points so that all of them are visible.

        Args:
            points: m, world frame.
            size: of the picture, px; by default as large as the scale requires.
            scale: pixels per metre; by default as large as the size allows, or 80 without a size (less for a picture
                that would exceed `side`).
            side: upper limit of the longer side of a picture without size and scale, px.
            margin: free space around the points, m.

        Raises:
            RenderError: `points` is empty, or a side of the picture is outside 16 to 6000 px.
        """
        x0, x1, y0, y1 = map(float, _bounds(points))
        wide, high = x1 - x0 + 2 * float(margin), y1 - y0 + 2 * float(margin)
        if scale is None:
            available = size or (side, side)
            scale = min(available[0] / wide, available[1] / high, math.inf if size else _DEFAULT_SCALE)
        scale = float(scale)
        width, height = size or (math.ceil(wide * scale), math.ceil(high * scale))
        require_drawable((width, height), scale)
        return cls(scale, (x0 + x1 - width / scale) / 2, (y0 + y1 + height / scale) / 2, (width, height))

    @classmethod
    def behind(cls, place: Point, direction: Point, *, size: tuple[int, int], view_range: float = 5.0) -> Camera:
        """View the area ahead of an agent, whose direction points up in the picture.

        Args:
            place: position of the agent, m.
            direction: unit vector, world frame.
            size: of the picture, px.
            view_range: distance from the agent to the upper edge, m.

        Raises:
            RenderError: a side is outside 16 to 6000 px, or view_range is not a positive number.
        """
        view_range = float(view_range)
        scale = _DOWN * size[1] / view_range if view_range else 0.0
        require_drawable(size, scale)
        (x, y), (ux, uy), half_width = map(float, place), map(float, direction), size[0] / 2 / scale
        left, top = x + view_range * ux - half_width * uy, y + view_range * uy + half_width * ux
        return cls(scale, left, top, size, direction)

    def to_pixels(self, point: Point) -> Point:
        """Transform a point from the world (m) to the picture: pixels right of and below the upper left corner."""
        (ux, uy), x, y = self.up, point[0] - self.left, self.top - point[1]
        return (x * uy + y * ux) * self.scale, (y * uy - x * ux) * self.scale

    def to_world(self, pixel: Point) -> Point:
        """Transform a point from the picture to the world, m; the inverse of `to_pixels`."""
        (ux, uy), right, down = self.up, pixel[0] / self.scale, pixel[1] / self.scale
        return self.left + right * uy - down * ux, self.top - right * ux - down * uy

    def rotated(self, direction: Point) -> Point:
        """Transform a unit vector from the world to the picture: (right, down)."""
        (ux, uy), (x, y) = self.up, direction
        return x * uy - y * ux, -(x * ux + y * uy)

    def zoomed(self, factor: float, centre: Point) -> Camera:
        """Magnify the picture.

        Args:
            factor: above 1, less of the world is visible.
            centre: world point that the view is centred on, as far as the view stays inside the area that was visible
                before; ignored for factors up to 1.
        """
        factor = float(factor)
        width, height = self.size[0] / self.scale, self.size[1] / self.scale
        if factor <= 1.0:  # everything stays visible, in the middle of the picture
            centre = self.left + width / 2, self.top - height / 2
        left, top = centre[0] - width / factor / 2, centre[1] + height / factor / 2
        low, high = sorted((self.left, self.left + width - width / factor))
        bottom, ceiling = sorted((self.top, self.top - height + height / factor))
        place = min(max(left, low), high), min(max(top, bottom), ceiling)
        return Camera(self.scale * factor, *place, self.size)

    def supersampled(self, factor: int) -> Camera:
        """The same view at `factor` times the width and height in pixels."""
        return Camera(self.scale * factor, self.left, self.top, (self.size[0] * factor, self.size[1] * factor), self.up)


def require_drawable(size: tuple[int, int], scale: float) -> None:
    """Check the size of a picture, px, and its scale, px/m.

    Raises:
        RenderError: a side is outside 16 to 6000 px, or the scale is not a positive number.
    """
    if not (0.0 < scale < math.inf and all(MIN_SIDE <= side <= _MAX_SIDE for side in size)):
        raise RenderError(
            f"cannot draw {size[0]} x {size[1]} pixels at {scale:g} pixels per metre; a side must have {MIN_SIDE} to "
            f"{_MAX_SIDE} pixels: choose another size, scale or view range"
        )


def _bounds(points: Iterable[Point]) -> tuple[float, float, float, float]:
    """Smallest and largest x, then y."""
    xs, ys = zip(*points, strict=True) if (points := list(points)) else ((), ())
    if not xs:
        raise RenderError("there is nothing to draw: the scene has neither outline nor walls")
    return min(xs), max(xs), min(ys), max(ys)
