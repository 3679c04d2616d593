"""Maps as images: `map.yaml` of ROS with its image, and plans that were drawn or scanned."""

from __future__ import annotations

import math
from io import BytesIO
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from annotated_types import Ge, Gt, Le
from pydantic import BaseModel, ValidationError

from ...core.portable_math import BoolArray
from ...core.wording import one_line
from ...errors import ConfigError
from ..scenario.parse import parse_settings
from .plan import MapOptions, Picture, Plan, finished_floor, package, polygons_of, read_map, rooms_of, shapely

_LARGEST_OBJECT = 2.5  # m, longest side of an obstacle that counts as furniture
_MOST_PIXELS = 25_000_000
_Coordinate = Annotated[float, Ge(-1e6), Le(1e6)]
_THIN = 0.08  # m, default of `MapOptions.thin` for images


class _Header(BaseModel):
    """The keys of `map.yaml` that are read; others are ignored."""

    image: str
    resolution: Annotated[float, Gt(0), Le(1e3)]
    origin: tuple[_Coordinate, _Coordinate, _Coordinate]
    occupied_thresh: float = 0.65
    free_thresh: float = 0.25
    negate: bool = False
    mode: Literal["trinary", "scale", "raw"] = "trinary"


class RosMap:
    """Occupancy grids of ROS: a `map.yaml`, as of nav2's map server, and the image that it names.

    Cells that are neither occupied nor free are unknown, and no floor. Source of the format:
    https://wiki.ros.org/map_server and the nav2 map server, modes `trinary`, `scale` and `raw`.
    """

    suffixes = (".yaml", ".yml")

    def read(self, path: Path, options: MapOptions) -> Plan:
        """Read a map.

        Raises:
            ConfigError: a file cannot be read, or has no floor.
        """
        values = parse_settings(path, "map of ROS")
        try:
            header = _Header.model_validate(values)
        except ValidationError as error:
            first = error.errors()[0]
            key = ".".join(map(str, first["loc"]))
            raise ConfigError(f"{path.name}: {key} of the map of ROS: {first['msg']}") from error
        grey, alpha = _read_image(path.parent / header.image)
        # darkness of each of the 256 values of a pixel
        steps = np.arange(256) / 255.0
        darkness = np.arange(256) / 100.0 if header.mode == "raw" else steps if header.negate else 1.0 - steps
        is_floor = ((darkness < header.free_thresh) & (darkness < header.occupied_thresh))[grey]
        if header.mode != "trinary":
            is_floor &= alpha == 255
        x, y, theta = header.origin
        picture = Picture(grey, (x, y), theta, options.unit or header.resolution)
        return _traced(is_floor, picture, options, thin=options.thin or 0.0, has_outside=False)


class ImageMap:
    """Drawn or scanned plans: dark walls on a light ground; `unit` is the size of a pixel."""

    suffixes = (".png", ".pgm", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".webp")

    def read(self, path: Path, options: MapOptions) -> Plan:
        """Read a plan.

        Raises:
            ConfigError: the size of a pixel is not given, the file cannot be read, or no floor is enclosed by walls.
        """
        if options.unit is None:
            raise ConfigError(f"{path}: an image does not say how large it is; give the size of a pixel, m (--unit)")
        grey, alpha = _read_image(path, is_photograph=True)
        is_floor = (grey > 255.0 * (1.0 - options.threshold)) | (alpha < 128)
        picture = Picture(grey, (0.0, 0.0), 0.0, options.unit)
        thin = _THIN if options.thin is None else options.thin
        return _traced(is_floor, picture, options, thin=thin, has_outside=True)


def _read_image(path: Path, *, is_photograph: bool = False) -> tuple[Any, Any]:
    """Brightness and opacity of an image, (H, W) of uint8 each.

    Args:
        path: of the file.
        is_photograph: whether it is turned as its camera says (EXIF orientation).

    Raises:
        ConfigError: it cannot be read, or is too large.
    """
    image, data = package("PIL.Image"), BytesIO(read_map(path))
    try:
        with image.open(data) as opened_image:
            if opened_image.width * opened_image.height > _MOST_PIXELS:
                size = f"{opened_image.width} x {opened_image.height}"
                raise ConfigError(f"{path} has {size} pixels, at most {_MOST_PIXELS} are read; make it smaller")
            if opened_image.mode.startswith("I"):
                raise ConfigError(f"{path} has 16 bits a pixel; save it with 8 bits")
            upright = package("PIL.ImageOps").exif_transpose(opened_image) if is_photograph else opened_image
            bands = np.asarray(upright.convert("LA"))
    except (OSError, ValueError, SyntaxError, image.DecompressionBombError) as error:
        raise ConfigError(f"the image {path.name} cannot be read: {one_line(error, 200)}") from error
    return bands[:, :, 0], bands[:, :, 1]


def _traced(is_floor: BoolArray, picture: Picture, options: MapOptions, *, thin: float, has_outside: bool) -> Plan:
    """The plan of an image.

    Args:
        is_floor: (H, W), the first row on top.
        picture: the image.
        options: of the reader.
        thin: lines that are thinner are removed, m.
        has_outside: whether floor that reaches the border of the image is outside of the building.
    """
    notes: list[str] = []
    unit, height, width = picture.size, *is_floor.shape
    frame = shapely().box(0.0, 0.0, width * unit, height * unit)
    floors = _outlines(is_floor[::-1], unit)
    if thin > unit:
        walls = frame.buffer(unit).difference(shapely().union_all(floors)).simplify(0.3 * unit)
        thick = walls.buffer(-thin / 2.0, join_style="mitre").buffer(thin / 2.0, join_style="mitre")
        floors = polygons_of(frame.difference(thick))
    border = frame.exterior.buffer(0.75 * unit)
    inside = [floor for floor in floors if not (has_outside and floor.intersects(border))]
    outside = sum(floor.area for floor in floors) - sum(floor.area for floor in inside)
    if inside and outside > 1.0:
        notes.append(
            f"{outside:.0f} m² that reach the border of the image are taken for the outside; close gaps in outer walls "
            "if a room is missing"
        )
    c, s = math.cos(picture.theta), math.sin(picture.theta)
    matrix = [c, -s, s, c, *picture.origin]
    placed = [shapely().affinity.affine_transform(floor, matrix) for floor in inside or floors]
    floor, pieces = finished_floor(placed, options, tolerance=unit / 2.0, largest_object=_LARGEST_OBJECT, notes=notes)
    return Plan(floor, pieces, rooms_of(floor), [], picture, notes)


def _outlines(is_floor: BoolArray, unit: float) -> list[Any]:
    """The connected parts of a grid as polygons of shapely with holes, m; the first row is at the bottom."""
    padded = np.pad(is_floor.astype(float), 1)
    generator = package("contourpy").contour_generator(z=padded, fill_type="OuterOffset", name="serial")
    found = []
    for points, offsets in zip(*generator.filled(0.5, 2.0), strict=True):
        # the centre of the first cell, after one cell of padding, is at half a cell
        rings = [(points[a:b] - 0.5) * unit for a, b in pairwise(offsets)]
        polygon = shapely().Polygon(rings[0], rings[1:])
        found += polygons_of(polygon if polygon.is_valid else polygon.buffer(0.0))
    return found
