"""Messages of ROS 2 as plain dataclasses: no ROS is needed to make, read or store them.

Names of fields are those of the message definitions; `to_json` and `from_json` convert to the JSON of rosbridge and of
`rosidl_runtime_py.message_to_ordereddict`.

Source: common_interfaces of ROS 2 (builtin_interfaces, geometry_msgs, nav_msgs, sensor_msgs, std_msgs); people_msgs.
"""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass, field, fields, is_dataclass
from typing import Any, TypeVar, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import ArrayLike

from ..core import geometry
from ..core.portable_math import angle_of, unit_vector
from .sensors.estimates import OdometryReading, PeopleReading
from .sensors.lidar import LidarReading

T = TypeVar("T")
_JSON_NAMES = {float: "a number", int: "a whole number", str: "a string"}


@dataclass
class Time:
    """builtin_interfaces/Time."""

    sec: int = 0
    nanosec: int = 0

    @classmethod
    def of(cls, seconds: float) -> Time:
        """The time of a number of seconds since the start, as `snapshot.time`."""
        nanoseconds = round(seconds * 1e9)
        return cls(nanoseconds // 1_000_000_000, nanoseconds % 1_000_000_000)


@dataclass
class Header:
    """std_msgs/Header."""

    stamp: Time = field(default_factory=Time)
    frame_id: str = ""


@dataclass
class Vector3:
    """geometry_msgs/Vector3."""

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0


@dataclass
class Point:
    """geometry_msgs/Point."""

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0


@dataclass
class Quaternion:
    """geometry_msgs/Quaternion."""

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    w: float = 1.0

    @classmethod
    def of(cls, theta: float) -> Quaternion:
        """A turn about the vertical axis, rad."""
        cosine, sine = unit_vector(theta / 2.0)
        return cls(0.0, 0.0, sine, cosine)

    @property
    def theta(self) -> float:
        """The turn about the vertical axis, rad."""
        sine = 2.0 * (self.w * self.z + self.x * self.y)
        return angle_of(sine, 1.0 - 2.0 * (self.y * self.y + self.z * self.z))


@dataclass
class Pose:
    """geometry_msgs/Pose."""

    position: Point = field(default_factory=Point)
    orientation: Quaternion = field(default_factory=Quaternion)

    @classmethod
    def of(cls, pose: geometry.Pose) -> Pose:
        """A pose in the plane."""
        return cls(Point(pose.x, pose.y), Quaternion.of(pose.theta))

    @property
    def in_plane(self) -> geometry.Pose:
        """The pose in the plane."""
        return geometry.Pose(float(self.position.x), float(self.position.y), self.orientation.theta)


@dataclass
class Twist:
    """geometry_msgs/Twist, in the body frame."""

    linear: Vector3 = field(default_factory=Vector3)
    angular: Vector3 = field(default_factory=Vector3)

    @classmethod
    def of(cls, twist: geometry.Twist) -> Twist:
        """A twist of the robot."""
        return cls(Vector3(twist.vx, twist.vy), Vector3(z=twist.omega))

    @property
    def in_plane(self) -> geometry.Twist:
        """The twist for `Controller.act`."""
        return geometry.Twist(float(self.linear.x), float(self.linear.y), float(self.angular.z))


@dataclass
class PoseStamped:
    """geometry_msgs/PoseStamped."""

    header: Header = field(default_factory=Header)
    pose: Pose = field(default_factory=Pose)


@dataclass
class TwistStamped:
    """geometry_msgs/TwistStamped."""

    header: Header = field(default_factory=Header)
    twist: Twist = field(default_factory=Twist)


def _require_covariance(values: list[float]) -> None:
    """Require the 36 numbers of a 6 x 6 matrix.

    Raises:
        ValueError: there is another number of them.
    """
    if len(values) != 36:
        raise ValueError(f"a covariance has 36 numbers, row by row, got {len(values)}")


@dataclass
class PoseWithCovariance:
    """geometry_msgs/PoseWithCovariance."""

    pose: Pose = field(default_factory=Pose)
    covariance: list[float] = field(default_factory=lambda: [0.0] * 36)

    def __post_init__(self) -> None:
        _require_covariance(self.covariance)


@dataclass
class TwistWithCovariance:
    """geometry_msgs/TwistWithCovariance."""

    twist: Twist = field(default_factory=Twist)
    covariance: list[float] = field(default_factory=lambda: [0.0] * 36)

    def __post_init__(self) -> None:
        _require_covariance(self.covariance)


@dataclass
class Odometry:
    """nav_msgs/Odometry."""

    header: Header = field(default_factory=Header)
    child_frame_id: str = ""
    pose: PoseWithCovariance = field(default_factory=PoseWithCovariance)
    twist: TwistWithCovariance = field(default_factory=TwistWithCovariance)

    @classmethod
    def of(cls, reading: OdometryReading, dt: float, frame_id: str = "odom", child: str = "base_link") -> Odometry:
        """A reading of `sonata2d.agents.Odometry`.

        Args:
            reading: the reading.
            dt: tick, s.
            frame_id, child: names of the frames of pose and of twist.
        """
        pose, twist = PoseWithCovariance(Pose.of(reading.pose)), TwistWithCovariance(Twist.of(reading.twist))
        return cls(Header(Time.of(reading.tick * dt), frame_id), child, pose, twist)


@dataclass
class Path:
    """nav_msgs/Path."""

    header: Header = field(default_factory=Header)
    poses: list[PoseStamped] = field(default_factory=list)

    @classmethod
    def of(cls, points: ArrayLike, seconds: float = 0.0, frame_id: str = "map") -> Path:
        """A path through points, (K, 2), m; each pose faces the next point."""
        header, poses = Header(Time.of(seconds), frame_id), []
        rows = np.asarray(points, dtype=float).reshape(-1, 2).tolist()
        for k, (x, y) in enumerate(rows):
            (ax, ay), (bx, by) = (rows[k], rows[k + 1]) if k + 1 < len(rows) else (rows[max(k - 1, 0)], rows[k])
            poses.append(PoseStamped(header, Pose.of(geometry.Pose(x, y, angle_of(by - ay, bx - ax)))))
        return cls(header, poses)


@dataclass
class LaserScan:
    """sensor_msgs/LaserScan; a ray that meets nothing is infinite, a lost one is NaN, as REP 117 says."""

    header: Header = field(default_factory=Header)
    angle_min: float = 0.0
    angle_max: float = 0.0
    angle_increment: float = 0.0
    time_increment: float = 0.0
    scan_time: float = 0.0
    range_min: float = 0.0
    range_max: float = 0.0
    ranges: list[float] = field(default_factory=list)
    intensities: list[float] = field(default_factory=list)

    @classmethod
    def of(cls, reading: LidarReading, dt: float, frame_id: str = "laser", scan_time: float | None = None) -> LaserScan:
        """A reading of `sonata2d.agents.Lidar`; the frame lies at its mount, with the axes of the robot.

        Args:
            reading: the reading.
            dt: tick, s.
            frame_id: name of the frame.
            scan_time: time between scans, s; of a `Lidar` with a rate, 1 / rate. None: one tick.
        """
        angles, count = reading.angles.tolist(), len(reading.angles)
        increment = (angles[-1] - angles[0]) / (count - 1) if count > 1 else 0.0
        sizes = reading.range_min, reading.range_max
        stamp = Header(Time.of(reading.tick * dt), frame_id)
        return cls(stamp, angles[0], angles[-1], increment, 0.0, scan_time or dt, *sizes, reading.ranges.tolist())


@dataclass
class Person:
    """people_msgs/Person."""

    name: str = ""
    position: Point = field(default_factory=Point)
    velocity: Point = field(default_factory=Point)
    reliability: float = 0.0
    tagnames: list[str] = field(default_factory=list)
    tags: list[str] = field(default_factory=list)


@dataclass
class People:
    """people_msgs/People."""

    header: Header = field(default_factory=Header)
    people: list[Person] = field(default_factory=list)

    @classmethod
    def of(cls, reading: PeopleReading, dt: float, frame_id: str = "base_link") -> People:
        """A reading of `sonata2d.agents.PeopleDetector`, in the frame of the robot.

        Args:
            reading: the reading.
            dt: tick, s.
            frame_id: name of the frame.
        """
        rows = zip(reading.position.tolist(), reading.velocity.tolist(), strict=True)
        people = [Person(str(k), Point(*at), Point(*moving), 1.0) for k, (at, moving) in enumerate(rows)]
        return cls(Header(Time.of(reading.tick * dt), frame_id), people)


def to_json(message: Any) -> str:
    """A message as JSON.

    Infinite numbers and NaN are null, as in rosbridge, and are read as NaN; numbers and arrays of NumPy are allowed.
    """
    return json.dumps(_finite(asdict(message)), separators=(",", ":"))


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, (np.generic, np.ndarray)):
        value = value.tolist()
    if isinstance(value, (list, tuple)):
        return [_finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def from_json(kind: type[T], text: str | bytes) -> T:
    """A message of a class from JSON; keys that are missing have their default.

    Raises:
        ValueError: the text is no JSON object, or it has keys that are no fields of the message, or values of other
            types.
    """
    message: T = _message(kind, json.loads(text), kind.__name__)
    return message


def _message(kind: Any, values: Any, place: str) -> Any:
    if get_origin(kind) is list:
        if not isinstance(values, list):
            raise ValueError(f"{place} must be a JSON array, got {values!r:.60}")
        return [_message(get_args(kind)[0], value, f"{place}[{k}]") for k, value in enumerate(values)]
    if not is_dataclass(kind):
        if kind is float and (values is None or type(values) is int):
            return math.nan if values is None else float(values)
        if type(values) is not kind:
            raise ValueError(f"{place} must be {_JSON_NAMES[kind]}, got {values!r:.60}")
        return values
    if not isinstance(values, dict):
        raise ValueError(f"{place} must be a JSON object, got {values!r:.60}")
    make: Any = kind
    names, hints = {each.name for each in fields(kind)}, get_type_hints(kind)
    unknown = sorted(values.keys() - names)
    if unknown:
        raise ValueError(f"{place} has no field {unknown[0]!r}; fields are {', '.join(sorted(names))}")
    return make(**{key: _message(hints[key], value, f"{place}.{key}") for key, value in values.items()})
