"""A laser scanner, and an occupancy grid of its ranges."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from types import NoneType
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.arguments import finite_number, positive_number, whole_number
from ...core.barrier_grid import packed_solids
from ...core.compiled.kernel import kernel
from ...core.humans import BODY_X, BODY_Y, VX, VY, X, Y
from ...core.outlines import side_lines
from ...core.portable_math import PI, Array, IntArray, exp, unit_vector, unit_vectors
from ...core.rays import fill_bodies, measure_ranges
from ...core.scene import Scene
from ...core.snapshot import Snapshot
from ...core.state import State
from ...core.vectors import lengths
from ...core.wording import shown
from .base import LookAt, Measure, Reading, Sensor, SensorNoise, angle_of_view, angles_of, is_turn

_MOST_RAYS = 100_000
_LEG, _STANCE = 0.06, 0.1  # m, radius of a leg, and half the distance between the legs
_STRIDE, _CADENCE = 0.2, 1.8  # m at 1 m/s, half the distance between the feet; steps per s


@dataclass(frozen=True)
class LidarReading(Reading):
    """Ranges of a scan.

    Attributes:
        ranges: (R,), m, from the mount; infinite where a ray meets nothing, NaN where it was lost.
        angles: (R,), rad, in the frame of the robot, counter-clockwise from straight ahead.
        range_min, range_max: shortest and longest range, m.
        mount: position of the scanner in the frame of the robot, m.
    """

    ranges: Array
    angles: Array
    range_min: float
    range_max: float
    mount: tuple[float, float]

    @property
    def points(self) -> Array:
        """(P, 2), where rays have met something, in the frame of the robot, m."""
        is_hit = np.isfinite(self.ranges)
        points: Array = unit_vectors(self.angles[is_hit]) * self.ranges[is_hit, None] + np.array(self.mount)
        return points


@dataclass(frozen=True)
class Lidar(Sensor):
    """A laser scanner in the plane: distances along rays to walls, furniture on the floor, people and other robots.

    Attributes:
        rays: their number.
        angle: of the field of view, rad, its middle at `heading`; 2 pi: all around.
        distance: longest range, m.
        nearest: shortest range, m; nearer outlines are measured at this range.
        mount: position of the scanner in the frame of the robot, m.
        heading: of the middle ray in the frame of the robot, rad.
        noise: standard deviation of ranges, m.
        dropout: probability that a ray is lost.
        sees: of people, their bodies at the height of the shoulders, or two legs, which swing as they walk.

    >>> Lidar(rays=360, distance=8.0, noise=0.01).name
    'lidar'
    """

    rays: int = 360
    angle: float = 2.0 * math.pi
    distance: float = 10.0
    nearest: float = 0.05
    mount: tuple[float, float] = (0.0, 0.0)
    heading: float = 0.0
    noise: float = 0.0
    dropout: float = 0.0
    sees: Literal["bodies", "legs"] = "bodies"

    def __post_init__(self) -> None:
        super().__post_init__()
        whole_number("rays", self.rays, 1, _MOST_RAYS)
        positive_number("distance", self.distance)
        for name in ("nearest", "noise", "dropout"):
            finite_number(name, getattr(self, name), 0.0)
        if abs(finite_number("heading", self.heading)) > 2.0 * math.pi:
            raise ValueError(f"heading must be within -2 pi and 2 pi, in rad, got {self.heading!r}")
        if not isinstance(self.mount, tuple) or len(self.mount) != 2 or {*map(type, self.mount)} != {float}:
            raise ValueError(f"mount is a position (x, y) in the frame of the robot, got {self.mount!r}")
        angle_of_view(self.angle)
        if self.nearest >= self.distance:
            raise ValueError(f"nearest must be below distance, got {self.nearest} and {self.distance}")
        if self.dropout > 1.0:
            raise ValueError(f"dropout is a probability, got {self.dropout}")
        if self.sees not in ("bodies", "legs"):
            raise ValueError(f"sees must be bodies or legs, got {self.sees!r}")

    def start(self, scene: Scene) -> Measure:
        angles = angles_of(self.rays, self.angle) + self.heading
        directions, solids = np.ascontiguousarray(unit_vectors(angles)), packed_solids(scene.barriers)
        sides = sum(len(other.robot.outline.core) for other in scene.robots)
        lines = np.empty((2 * len(scene.humans) + sides + len(scene.moving_doors), 5))

        def measure(snapshot: Snapshot, noise: SensorNoise) -> LidarReading:
            row, ranges = snapshot.state.row, np.full(self.rays, self.distance)
            x, y, c, s = (float(row[column]) for column in (X, Y, BODY_X, BODY_Y))
            x, y = x + self.mount[0] * c - self.mount[1] * s, y + self.mount[0] * s + self.mount[1] * c
            count = self._fill(scene, snapshot, lines)
            for robot in snapshot.robots:
                shown = side_lines(robot.body.outline, np.array([robot.position]), np.array([robot.direction]))[0]
                lines[count : count + len(shown)] = shown
                count += len(shown)
            for start, end, radius in snapshot.moving_leaves if scene.moving_doors else ():
                lines[count], count = (*start, *end, radius), count + 1
            measure_ranges(x, y, c, s, solids.argument, lines[:count], directions, ranges)
            is_hit = ranges < self.distance
            if self.noise > 0.0:
                ranges = ranges + self.noise * noise.normals(self.rays)
            ranges = np.minimum(np.maximum(ranges, self.nearest), self.distance)  # np.clip takes three times as long
            ranges[~is_hit] = np.inf
            if self.dropout > 0.0:
                ranges[noise.uniforms(self.rays) < self.dropout] = np.nan
            ranges.flags.writeable = False
            return LidarReading(snapshot.tick, ranges, angles, self.nearest, self.distance, self.mount)

        return measure

    def to_json(self, reading: LidarReading) -> dict[str, Any]:
        """Tick and ranges, of which infinite ones become null, and lost ones -1."""
        ranges = np.where(np.isnan(reading.ranges), -1.0, reading.ranges)
        return {"tick": reading.tick, "ranges": np.where(np.isinf(ranges), np.nan, ranges)}

    def from_json(self, value: Any, look_at: LookAt) -> LidarReading:
        given = value["ranges"]
        if not isinstance(given, list) or len(given) != self.rays or not {*map(type, given)} <= {int, float, NoneType}:
            raise ValueError(f"ranges must be {self.rays} numbers, null or -1, got {shown(given)}")
        ranges = np.array(given, dtype=float)
        is_wrong = ((ranges < 0.0) & (ranges != -1.0)) | (ranges > self.distance + 1e-4)
        if is_wrong.any():
            raise ValueError(f"a range must be 0 to {self.distance:g}, null or -1, got {ranges[is_wrong][0]:g}")
        ranges[np.isnan(ranges)] = np.inf
        ranges[ranges == -1.0] = np.nan
        ranges.flags.writeable = False
        angles = angles_of(self.rays, self.angle) + self.heading
        return LidarReading(value["tick"], ranges, angles, self.nearest, self.distance, self.mount)

    def mirrored(self) -> Lidar:
        return replace(self, mount=(self.mount[0], 0.0 - self.mount[1]), heading=0.0 - self.heading)

    def mirrored_json(self, value: Any) -> Any:
        ranges = value["ranges"]
        kept = 1 if is_turn(self.angle) else 0  # the ray of a whole turn that points backwards
        return value | {"ranges": [*ranges[:kept], *ranges[kept:][::-1]]}

    def _fill(self, scene: Scene, snapshot: Snapshot, lines: Array) -> int:
        """Fill the outlines that people show, (2 N, 5); their number."""
        state, table = snapshot.state, scene.human_table
        if self.sees == "legs":
            return _fill_legs(state, snapshot.time, lines)
        is_present = np.ones(len(table.id), dtype=bool) if state.is_present is None else state.is_present
        return int(fill_bodies(state.row, is_present, table.radius, table.shoulder, lines))


def _fill_legs(state: State, time: float, lines: Array) -> int:
    """Fill the legs of the people in the room, (2 N, 5); their number."""
    humans, count = state.humans, 0
    for k in range(len(humans)):
        if state.is_present is not None and not state.is_present[k]:
            continue
        row = humans[k]
        speed = math.sqrt(row[VX] * row[VX] + row[VY] * row[VY])
        _, swing = unit_vector(PI * _CADENCE * time + k)
        for side in (-1.0, 1.0):
            ahead, left = side * swing * _STRIDE * speed, side * _STANCE
            x, y = row[X] + ahead * row[BODY_X] - left * row[BODY_Y], row[Y] + ahead * row[BODY_Y] + left * row[BODY_X]
            lines[count] = x, y, x, y, _LEG
            count += 1
    return count


@dataclass(frozen=True)
class Costmap:
    """An occupancy grid around the robot, in its frame.

    Attributes:
        cost: (N, N) of uint8; 0 free, 254 occupied, 253 nearer to something than the robot's inner radius, and in
            between a cost that falls with the distance, as in costmap_2d of ROS. The first index is x, ahead; the
            second y, left.
        resolution: side of a cell, m.
    """

    cost: NDArray[np.uint8]
    resolution: float

    @property
    def origin(self) -> float:
        """x and y of the outer corner of the cell (0, 0), m."""
        return -0.5 * self.resolution * len(self.cost)

    def at(self, points: ArrayLike) -> NDArray[np.uint8]:
        """Cost at points in the frame of the robot, (P, 2), m; 0 outside of the grid."""
        places = np.asarray(points, dtype=float)
        if places.ndim != 2 or places.shape[1] != 2 or not np.isfinite(places).all():
            raise ValueError(f"points must be finite positions in rows, (P, 2), got {points!r:.80}")
        cells = np.floor((places - self.origin) / self.resolution).astype(int)
        is_inside = ((cells >= 0) & (cells < len(self.cost))).all(axis=1)
        cost = np.zeros(len(cells), dtype=np.uint8)
        cost[is_inside] = self.cost[tuple(cells[is_inside].T)]
        return cost


def costmap(
    reading: LidarReading, size: float = 6.0, resolution: float = 0.05, radius: float = 0.3, inflation: float = 0.6,
    decay: float = 5.0,
) -> Costmap:  # fmt: skip
    """An occupancy grid with inflation from a scan.

    Args:
        reading: the scan.
        size, resolution: sides of the grid and of a cell, m.
        radius: inner radius of the robot, m; nearer cells cost 253.
        inflation: distance from obstacles beyond which cells cost nothing, m; at least `radius`.
        decay: 1/m, of the cost between `radius` and `inflation`: 252 exp(-decay (distance - radius)).
    """
    resolution, radius = positive_number("resolution", resolution), finite_number("radius", radius, 0.0)
    inflation, decay = finite_number("inflation", inflation, 0.0), finite_number("decay", decay, 0.0)
    count = max(round(positive_number("size", size) / resolution), 1)
    cost, reach = np.zeros((count, count), dtype=np.uint8), math.ceil(max(inflation, radius) / resolution)
    distance = resolution * lengths(np.moveaxis(np.mgrid[-reach : reach + 1, -reach : reach + 1], 0, -1).astype(float))
    prices = np.where(distance <= radius, 253.0, 252.0 * exp(-decay * np.maximum(distance - radius, 0.0)))
    prices = np.where(distance <= max(inflation, radius), prices, 0.0).astype(np.uint8)
    prices[reach, reach] = 254
    cells = np.unique(np.floor(reading.points / resolution + 0.5 * count).astype(np.int64), axis=0)
    _inflate(cells, prices, cost)
    return Costmap(cost, resolution)


@kernel
def _inflate(cells: IntArray, prices: NDArray[np.uint8], cost: NDArray[np.uint8]) -> None:
    """Raise the cost of cells around occupied cells.

    Args:
        cells: (C, 2), indices of the occupied ones, which may be outside of the grid.
        prices: (2 K + 1, 2 K + 1), cost of the cells around an occupied one, which is in the middle.
        cost: (N, N), of all cells; it is raised to the highest price.
    """
    count, reach = len(cost), len(prices) // 2
    for k in range(len(cells)):
        for i in range(max(cells[k, 0] - reach, 0), min(cells[k, 0] + reach + 1, count)):
            for j in range(max(cells[k, 1] - reach, 0), min(cells[k, 1] + reach + 1, count)):
                cost[i, j] = max(cost[i, j], prices[i - cells[k, 0] + reach, j - cells[k, 1] + reach])
