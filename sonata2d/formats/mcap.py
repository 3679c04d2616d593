"""`mcap`: a file of ROS 2 messages for each episode, which Foxglove, Rerun and rosbags read.

Messages are in CDR, with their definitions in the file (profile `ros2`). The world frame is `map`, that of the robot
`base_link`; times are nanoseconds since the start of the episode. The room is at the start only; the other topics have
the T + 1 states of an episode of T frames, `/cmd_vel` its T commands, and `/goal` the goal where it changes. Metadata
`sonata2d` has the origin and the outcome of the episode; the attachment `episode.json` has the keys of the episode file
besides its frames.

The scan is that of a `Lidar` without noise, whether the robot had one or not. Each array of markers deletes those
before it, so that people who leave disappear.
"""

from __future__ import annotations

import io
from collections.abc import Iterable, Iterator, Sequence
from functools import cache
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import orjson

from ..agents import ros_messages as ros
from ..agents.sensors.base import SensorNoise
from ..agents.sensors.lidar import Lidar, LidarReading
from ..core.files.optional import optional
from ..core.geometry import Disc, Edge, Outline, Point, Pose, Rectangle, Stadium, Twist
from ..core.portable_math import Array
from ..core.relations import ACTIVITIES, ACTIVITY, Colour
from ..core.scene import Scene
from ..core.snapshot import Snapshot
from ..errors import RecordError
from ..record.record import EpisodeRecord
from ..version import __version__
from ..view.palette import BLOCK, INK, OTHER_ROBOT, PURPLE, ROBOT, WALL
from .format import ROBOT_OPTIONS, Format, Options, header_of, require_robot
from .occupancy import OCCUPIED, occupancy_grid

NAME = "mcap"
_WORLD, _BODY = "map", "base_link"
_LIDAR = Lidar(rays=360)
_MARKERS, _COLOUR = "visualization_msgs/msg/MarkerArray", "std_msgs/msg/ColorRGBA"
_CUBE, _CYLINDER, _LINES, _TEXT, _TRIANGLES, _DELETE_ALL = 1, 3, 5, 9, 11, 3  # constants of visualization_msgs/Marker
_FLOAT32 = 7  # constant of sensor_msgs/PointField
_FURNITURE, _PERSON, _ROBOT = 0.75, 1.7, 0.4  # m, heights in the pictures; the episode has none
_LETTERS, _LINE = 0.2, 0.04  # m, height of letters, width of lines


def export(record: EpisodeRecord, options: Options) -> bytes:
    """Return the file of an episode.

    Raises:
        UnsuitableEpisode: the episode has no recorded robot.
        RecordError: mcap or rosbags is not installed.
    """
    require_robot(record, NAME)
    log, scene = _Log(), record.scene()
    log.room(scene)
    measure, goals = _LIDAR.start(scene), record.goals.tolist()
    lacks_commands = "frames.command" in record.document.get("imported", {}).get("lacks", ())
    for t, snapshot in enumerate(record.snapshots()):
        time = ros.Time.of(snapshot.time)
        if "goal" not in scene.unmeasured and (t == 0 or goals[t] != goals[t - 1]):
            log.goal(time, Pose(*goals[t]))
        if t < len(record) and not lacks_commands:
            log.command(time, Twist(*record.command[t].tolist()))
        log.robot(time, snapshot.robot.pose, snapshot.robot.twist)
        log.scan(time, measure(snapshot, SensorNoise(scene, NAME, snapshot.tick)), snapshot.dt)
        log.people(time, snapshot)
        log.markers("/robots", time, _robots(snapshot))
        log.markers("/people", time, _people(snapshot))
        log.markers("/interactions", time, _interactions(snapshot))
        if scene.moving_doors:
            log.markers("/doors", time, [_lines("doors", snapshot.moving_leaves, WALL)])
    return log.content(record)


class _Mark(NamedTuple):
    """A marker: fields of visualization_msgs/Marker; `at` is its place in the world, `points` are in its frame."""

    group: str
    id: int
    kind: int
    at: Pose
    height: float  # m, of its middle above the floor
    scale: tuple[float, float, float]
    colour: Colour
    points: Sequence[Point] = ()
    text: str = ""


def _lines(group: str, edges: Iterable[Edge], colour: Colour) -> _Mark:
    ends = [point for start, end, _ in edges for point in (start, end)]
    return _Mark(group, 0, _LINES, Pose(0.0, 0.0), 0.0, (_LINE, 0.0, 0.0), colour, ends)


def _name(group: str, id: int, at: Point, height: float, text: str) -> _Mark:
    return _Mark(group, id, _TEXT, Pose(at[0], at[1]), height, (0.0, 0.0, _LETTERS), INK, (), text)


def _body(group: str, id: int, shape: Outline, at: Pose, low: float, high: float, colour: Colour) -> _Mark:
    """A body from one height to another, m; of a polygon, its upper side."""
    kind = _CUBE if isinstance(shape, Rectangle) else _CYLINDER if isinstance(shape, Disc | Stadium) else _TRIANGLES
    if kind != _TRIANGLES:
        return _Mark(group, id, kind, at, (low + high) / 2, (*shape.sides, high - low), colour)
    first, *others = shape.core
    fan = [corner for pair in pairwise(others) for corner in (first, *pair)]
    return _Mark(group, id, kind, at, high, (1.0, 1.0, 1.0), colour, fan)


def _room(scene: Scene) -> Iterator[_Mark]:
    """Walls, outline of the room and of areas, and furniture with names."""
    if walls := [(wall.start, wall.end, 0.0) for wall in scene.walls] + scene.fixed_leaves:  # Foxglove reports no lines
        yield _lines("walls", walls, WALL)
    yield _lines("room", [((ax, ay), (bx, by), 0.0) for ax, ay, bx, by in scene.outline_edges.tolist()], WALL)
    for area in scene.areas:
        yield _lines(f"area {area.name}", area.edges(), OTHER_ROBOT)
        yield _name(f"area {area.name}", 1, area.polygon[0], 0.0, area.name)
    for thing in scene.furniture:
        low, high = (0.0, _FURNITURE) if thing.on is None else (_FURNITURE, _FURNITURE + 0.1)
        yield _body("furniture", thing.id, thing.shape, thing.pose, low, high, BLOCK)
        yield _name("furniture names", thing.id, thing.pose.position, high + _LETTERS, f"{thing.type} {thing.id}")


def _robots(snapshot: Snapshot) -> Iterator[_Mark]:
    for robot in (snapshot.robot, *snapshot.robots):
        colour = ROBOT if robot is snapshot.robot else OTHER_ROBOT
        yield _body("robots", robot.id, robot.body.outline, robot.pose, 0.0, _ROBOT, colour)


def _people(snapshot: Snapshot) -> Iterator[_Mark]:
    humans = snapshot.humans
    columns = (humans.id, humans.radius, humans.shoulder, humans.activity_index, humans.position, humans.theta)
    for id, radius, shoulder, activity, at, theta in zip(*(column.tolist() for column in columns), strict=True):
        name = ACTIVITIES[activity]
        yield _body(
            "people", id, Stadium(radius, shoulder), Pose(at[0], at[1], theta), 0, _PERSON, ACTIVITY[name].colour
        )
        yield _name("people names", id, at, _PERSON + _LETTERS, f"{id} {name}")


def _interactions(snapshot: Snapshot) -> Iterator[_Mark]:
    """Lines between those who interact, one marker for each relation."""
    places = {thing.id: thing.pose.position for thing in snapshot.objects}
    places |= dict(zip(snapshot.humans.id.tolist(), map(tuple, snapshot.humans.position.tolist()), strict=True))
    edges: dict[str, list[Edge]] = {}
    for link in snapshot.interactions:
        if link.src in places and link.dst in places:
            edges.setdefault(link.relation, []).append((places[link.src], places[link.dst], 0.0))
    for relation, lines in edges.items():
        yield _lines(relation, lines, PURPLE)


@cache
def _store() -> Any:
    """The message types of ROS 2 Humble, which later releases have as well."""
    typesys = optional("rosbags.typesys", RecordError, extra=NAME)
    return typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)


def _new(kind: str, *values: Any) -> Any:
    """A message from the values of all its fields in order."""
    return _store().types[kind](*values)


class _Log:
    """The file of an episode in memory; messages are written in the order of their times.

    Raises:
        RecordError: mcap or rosbags is not installed.
    """

    def __init__(self) -> None:
        self._data = io.BytesIO()
        self._writer = optional("mcap.writer", RecordError, extra=NAME).Writer(self._data)
        self._writer.start(profile="ros2", library=f"sonata2d {__version__}")
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}

    def content(self, record: EpisodeRecord) -> bytes:
        """The file with the metadata of the episode, after the last message."""
        document, outcome = record.document, record.outcome
        facts = {"id": record.id, **record.scene().origin, "controller": record.controller_info.path}
        if "outcome" not in record.scene().unmeasured:
            facts |= {"outcome": outcome.status, "reason": outcome.reason, "time": outcome.time}
        facts |= {f"software.{name}": version for name, version in document.get("software", {}).items()}
        self._writer.add_metadata("sonata2d", {name: str(value) for name, value in facts.items()})
        self._writer.add_attachment(0, 0, "episode.json", "application/json", orjson.dumps(header_of(document)))
        self._writer.finish()
        return self._data.getvalue()

    def room(self, scene: Scene) -> None:
        """The map and the markers that do not change."""
        grid, time = occupancy_grid(scene), ros.Time()
        cells = np.array(grid["data"], dtype=np.int8).ravel()
        cells[cells == OCCUPIED] = 100
        origin = ros.Pose.of(Pose(grid["x_orig"], grid["y_orig"]))
        size = _new("nav_msgs/msg/MapMetaData", time, grid["cell_size"], grid["width"], grid["height"], origin)
        self._write("/map", time, "nav_msgs/msg/OccupancyGrid", ros.Header(time, _WORLD), size, cells)
        self.markers("/scene", time, _room(scene))

    def goal(self, time: ros.Time, pose: Pose) -> None:
        self._write("/goal", time, "geometry_msgs/msg/PoseStamped", ros.Header(time, _WORLD), ros.Pose.of(pose))

    def command(self, time: ros.Time, twist: Twist) -> None:
        self._write("/cmd_vel", time, "geometry_msgs/msg/TwistStamped", ros.Header(time, _BODY), ros.Twist.of(twist))

    def robot(self, time: ros.Time, pose: Pose, twist: Twist) -> None:
        """The pose in the world, and the velocity in the robot's frame."""
        header, at, exact = ros.Header(time, _WORLD), ros.Pose.of(pose), np.zeros(36)
        transform = _new("geometry_msgs/msg/Transform", at.position, at.orientation)
        transforms = [_new("geometry_msgs/msg/TransformStamped", header, _BODY, transform)]
        self._write("/tf", time, "tf2_msgs/msg/TFMessage", transforms)
        place = _new("geometry_msgs/msg/PoseWithCovariance", at, exact)
        motion = _new("geometry_msgs/msg/TwistWithCovariance", ros.Twist.of(twist), exact)
        self._write("/odom", time, "nav_msgs/msg/Odometry", header, _BODY, place, motion)

    def scan(self, time: ros.Time, reading: LidarReading, dt: float) -> None:
        """The ranges, and the points that they meet."""
        header, angles, nothing = ros.Header(time, _BODY), reading.angles.tolist(), np.zeros(0, dtype=np.float32)
        increment = (angles[-1] - angles[0]) / (len(angles) - 1)
        sizes = (angles[0], angles[-1], increment, 0.0, dt, reading.range_min, reading.range_max)
        ranges = reading.ranges.astype(np.float32)
        self._write("/scan", time, "sensor_msgs/msg/LaserScan", header, *sizes, ranges, nothing)
        self._points("/scan/points", header, reading.points)

    def people(self, time: ros.Time, snapshot: Snapshot) -> None:
        """Poses and positions of the people present, in the order of the scene."""
        header, humans = ros.Header(time, _WORLD), snapshot.humans
        poses = [ros.Pose.of(human.pose) for human in humans]
        self._write("/people/poses", time, "geometry_msgs/msg/PoseArray", header, poses)
        self._points("/people/points", header, humans.position)

    def markers(self, topic: str, time: ros.Time, marks: Iterable[_Mark]) -> None:
        """An array of markers in the place of those before it."""
        header, nothing = ros.Header(time, _WORLD), np.zeros(0, dtype=np.uint8)
        picture = _new("sensor_msgs/msg/CompressedImage", ros.Header(), "", nothing)
        mesh = _new("visualization_msgs/msg/MeshFile", "", nothing)

        def marker(mark: _Mark, action: int = 0) -> Any:
            pose, colour = ros.Pose.of(mark.at), _new(_COLOUR, *(part / 255 for part in mark.colour), 1.0)
            pose.position.z = mark.height
            fields = (header, mark.group, mark.id, mark.kind, action, pose, ros.Vector3(*mark.scale))
            points = [ros.Point(*point) for point in mark.points]
            look: Any = (colour, ros.Time(), False, points, [], "", picture, [], mark.text, "", mesh, False)
            return _new("visualization_msgs/msg/Marker", *fields, *look)

        first = marker(_Mark("", 0, _CUBE, Pose(0.0, 0.0), 0.0, (1.0, 1.0, 1.0), INK), _DELETE_ALL)
        self._write(topic, time, _MARKERS, [first, *map(marker, marks)])

    def _points(self, topic: str, header: ros.Header, points: Array) -> None:
        """A cloud of points on the floor; (P, 2), m."""
        columns = np.zeros((len(points), 3), dtype="<f4")
        columns[:, :2] = points
        fields = [_new("sensor_msgs/msg/PointField", axis, 4 * k, _FLOAT32, 1) for k, axis in enumerate("xyz")]
        data = columns.view(np.uint8).ravel()
        size = (1, len(points), fields, False, 12, len(data), data, True)
        self._write(topic, header.stamp, "sensor_msgs/msg/PointCloud2", header, *size)

    def _write(self, topic: str, time: ros.Time, kind: str, *values: Any) -> None:
        if kind not in self._schemas:
            definition, _ = _store().generate_msgdef(kind, ros_version=2)
            self._schemas[kind] = self._writer.register_schema(kind, "ros2msg", definition.encode())
        if topic not in self._channels:
            self._channels[topic] = self._writer.register_channel(topic, "cdr", self._schemas[kind])
        data, stamp = _store().serialize_cdr(_new(kind, *values), kind), time.sec * 1_000_000_000 + time.nanosec
        self._writer.add_message(self._channels[topic], stamp, data, stamp)


FORMAT = Format(
    "ROS 2 messages for Foxglove, Rerun and rosbags",
    ".mcap",
    export=export,
    options=ROBOT_OPTIONS,
)
