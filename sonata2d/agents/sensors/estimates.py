"""Sensors that estimate: odometry, and a detector of people."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...core.arguments import finite_number, positive_number
from ...core.geometry import Pose, Twist, canonical_angle
from ...core.humans import Humans
from ...core.portable_math import Array, IntArray, unit_vector, unit_vectors
from ...core.rays import visible
from ...core.scene import Scene
from ...core.snapshot import RobotState, Snapshot
from ...core.wording import shown
from .base import LookAt, Measure, Reading, Sensor, SensorNoise, angle_of_view, is_turn, numbers_of

_MOST_ALARMS = 1000


@dataclass(frozen=True)
class OdometryReading(Reading):
    """The robot's estimate of its own pose.

    Attributes:
        pose: in the world frame, in which the start is known.
        twist: velocity in the body frame, m/s and rad/s.
    """

    pose: Pose
    twist: Twist


@dataclass(frozen=True)
class Odometry(Sensor):
    """Wheel odometry: the pose at the start, and from there on the sum of measured motions, which drifts.

    Attributes:
        translation: standard deviation of the measured distance, m after 1 m; it grows with the root of the distance.
        rotation: standard deviation of the measured turn, rad after 1 rad.
        skid: rad per m, standard deviation of the turn that a distance adds.
        scale: standard deviation of a factor of all distances that is drawn for each episode.
    """

    translation: float = 0.01
    rotation: float = 0.01
    skid: float = 0.005
    scale: float = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("translation", "rotation", "skid", "scale"):
            finite_number(name, getattr(self, name), 0.0)

    @property
    def sees_all_ticks(self) -> bool:
        return True

    def start(self, scene: Scene) -> Measure:
        at, before, factor = scene.robot.pose, scene.robot.pose, 1.0

        def measure(snapshot: Snapshot, noise: SensorNoise) -> OdometryReading:
            nonlocal at, before, factor
            true, errors = snapshot.robot.pose, noise.normals(5)
            if snapshot.tick == 0:
                factor = 1.0 + self.scale * float(errors[4])
            ahead, left = before.to_local(true.position)
            turn = math.remainder(true.theta - before.theta, math.tau)
            distance = math.sqrt(ahead * ahead + left * left)
            spread = self.translation * math.sqrt(distance)
            ahead, left = factor * ahead + spread * float(errors[0]), factor * left + spread * float(errors[1])
            turn += self.rotation * math.sqrt(abs(turn)) * float(errors[2])
            turn += self.skid * math.sqrt(distance) * float(errors[3])
            if snapshot.tick > 0:
                at = Pose(*at.to_world((ahead, left)), math.remainder(at.theta + turn, math.tau))
            before = true
            dt = snapshot.dt
            twist = Twist(ahead / dt, left / dt, turn / dt) if snapshot.tick else Twist()
            return OdometryReading(snapshot.tick, at, twist)

        return measure

    def to_json(self, reading: OdometryReading) -> dict[str, Any]:
        """Tick, pose [x, y, theta] and twist [vx, vy, omega]."""
        at, twist = reading.pose, reading.twist
        pose = [at.x, at.y, canonical_angle(at.theta)]
        return {"tick": reading.tick, "pose": pose, "twist": [twist.vx, twist.vy, twist.omega]}

    def from_json(self, value: Any, look_at: LookAt) -> OdometryReading:
        pose, twist = (numbers_of(value[key], key, 3) for key in ("pose", "twist"))
        return OdometryReading(value["tick"], Pose(*pose), Twist(*twist))

    def mirrored_json(self, value: Any) -> Any:
        (x, y, theta), (vx, vy, omega) = value["pose"], value["twist"]
        pose = [x, 0.0 - y, canonical_angle(-theta)]
        return value | {"pose": pose, "twist": [vx, 0.0 - vy, 0.0 - omega]}


@dataclass(frozen=True)
class PeopleSensor(Sensor):
    """Base class of the sensors that see people in a field of view.

    Attributes:
        angle, distance: of the field of view, rad and m.
        occlusion: whether walls and other people hide a person; people are seen over furniture and robots.
    """

    angle: float = 2.0 * math.pi / 3.0
    distance: float = 10.0
    occlusion: bool = True

    def __post_init__(self) -> None:
        super().__post_init__()
        angle_of_view(self.angle)
        positive_number("distance", self.distance)

    def _view(self, scene: Scene, robots: int = 0) -> Callable[[Snapshot], tuple[IntArray, IntArray]]:
        """A function that returns what is seen: rows of `snapshot.humans`, (K,) of int, and of the first other robots.

        Args:
            scene: of the episode.
            robots: number of other robots that can be seen.
        """
        table, all_robots = scene.human_table, np.arange(robots)
        walls = np.array([(*wall.start, *wall.end) for wall in scene.walls], dtype=float).reshape(-1, 4)
        # no person is too far from straight ahead for a view all around
        cosine = -2.0 if is_turn(self.angle) else float(unit_vector(self.angle / 2.0)[0])
        everybody = np.ones(len(table.id), dtype=np.bool_)
        leaves = [(*start, *end) for start, end, _ in (d.leaf(d.opening) for d in scene.interior_doors)]
        walls = np.concatenate((walls, np.array(leaves, dtype=float).reshape(-1, 4)))

        def rows_in_view(snapshot: Snapshot) -> tuple[IntArray, IntArray]:
            state = snapshot.state
            for k, door in enumerate(snapshot.doors if scene.moving_doors else (), len(scene.walls)):
                walls[k] = *door.leaf[0], *door.leaf[1]
            is_present = everybody if state.is_present is None else state.is_present
            present = np.flatnonzero(is_present)
            is_seen = np.ones(len(present) + robots, dtype=np.bool_)
            centres = np.array([robot.position for robot in snapshot.robots[:robots]], dtype=float).reshape(-1, 2)
            visible(
                state.row, is_present, table.radius, table.shoulder, centres, walls, present, all_robots, cosine,
                float(self.distance), self.occlusion, 0, is_seen,
            )  # fmt: skip
            return np.flatnonzero(is_seen[: len(present)]), np.flatnonzero(is_seen[len(present) :])

        return rows_in_view


@dataclass(frozen=True)
class PeopleReading(Reading):
    """People that a detector reports, in no order, without identities.

    Attributes:
        position: (K, 2), m, in the frame of the robot at `tick`.
        velocity: (K, 2), m/s, relative to the world, in the axes of the robot at `tick`.
    """

    position: Array
    velocity: Array


@dataclass(frozen=True)
class PeopleDetector(PeopleSensor):
    """A detector of people, such as a network on camera images, with misses and false alarms.

    Attributes:
        angle, distance, occlusion: see `PeopleSensor`.
        misses: probability that a person in view is not reported, in each measurement.
        false_alarms: mean number of reports of nobody, in each measurement; anywhere in the field of view.
        noise, velocity_noise: standard deviations of positions (m) and velocities (m/s), in x and y.
    """

    distance: float = 8.0
    misses: float = 0.05
    false_alarms: float = 0.02
    noise: float = 0.05
    velocity_noise: float = 0.1

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("misses", "false_alarms", "noise", "velocity_noise"):
            finite_number(name, getattr(self, name), 0.0)
        if self.misses > 1.0:
            raise ValueError(f"misses is a probability, got {self.misses}")
        if self.false_alarms > _MOST_ALARMS:
            raise ValueError(f"false_alarms must be at most {_MOST_ALARMS}, got {self.false_alarms}")

    def start(self, scene: Scene) -> Measure:
        rows_in_view = self._view(scene)

        def measure(snapshot: Snapshot, noise: SensorNoise) -> PeopleReading:
            humans, robot, (rows, _) = snapshot.humans, snapshot.robot, rows_in_view(snapshot)
            rows = rows[noise.uniforms(len(rows)) >= self.misses]
            c, s = robot.direction
            turn = np.array([[c, -s], [s, c]])
            offset = humans.position[rows] - np.array(robot.position)
            position = _turned(offset, turn) + self.noise * noise.normals(2 * len(rows)).reshape(-1, 2)
            velocity = _turned(humans.velocity[rows], turn)
            velocity = velocity + self.velocity_noise * noise.normals(2 * len(rows)).reshape(-1, 2)
            count = noise.poisson(self.false_alarms)
            angle = self.angle * (noise.uniforms(count) - 0.5)
            nowhere = unit_vectors(angle) * (self.distance * np.sqrt(noise.uniforms(count)))[:, None]
            moving = self.velocity_noise * noise.normals(2 * count).reshape(-1, 2)
            return PeopleReading(snapshot.tick, np.concatenate((position, nowhere)), np.concatenate((velocity, moving)))

        return measure

    def from_json(self, value: Any, look_at: LookAt) -> PeopleReading:
        rows = [[numbers_of(row, f"each {key}", 2) for row in value[key]] for key in ("position", "velocity")]
        if len(rows[0]) != len(rows[1]):
            raise ValueError(f"there are {len(rows[0])} positions and {len(rows[1])} velocities")
        return PeopleReading(value["tick"], *(np.array(each, dtype=float).reshape(-1, 2) for each in rows))

    def mirrored_json(self, value: Any) -> Any:
        return value | {key: [[x, 0.0 - y] for x, y in value[key]] for key in ("position", "velocity")}


def _turned(vectors: Array, turn: Array) -> Array:
    """(K, 2), vectors in the axes of the columns of a rotation matrix."""
    turned: Array = vectors[:, :1] * turn[0] + vectors[:, 1:] * turn[1]
    return turned


@dataclass(frozen=True)
class ViewReading(Reading):
    """Entities in view.

    Attributes:
        humans: the people in view, as `snapshot.humans`: exact, in the world frame.
        robots: the other robots in view, as `snapshot.robots`.
    """

    humans: Humans
    robots: tuple[RobotState, ...] = ()


@dataclass(frozen=True)
class FieldOfView(PeopleSensor):
    """People and other robots in a field of view, measured without errors."""

    def start(self, scene: Scene) -> Measure:
        rows_in_view = self._view(scene, len(scene.robots))

        def measure(snapshot: Snapshot, noise: SensorNoise) -> ViewReading:
            humans, (rows, robots) = snapshot.humans, rows_in_view(snapshot)
            seen = humans.select(rows)
            if humans.row is not None and seen is not humans:
                seen = replace(seen, row=humans.row[rows])
            return ViewReading(snapshot.tick, seen, tuple(snapshot.robots[k] for k in robots))

        return measure

    def to_json(self, reading: ViewReading) -> dict[str, Any]:
        """Tick, and the ids of the people and robots in view."""
        robots = {"robots": [robot.id for robot in reading.robots]} if reading.robots else {}
        return {"tick": reading.tick, "humans": reading.humans.id, **robots}

    def from_json(self, value: Any, look_at: LookAt) -> ViewReading:
        snapshot = look_at(value["tick"])
        rows = {int(id): row for row, id in enumerate(snapshot.humans.id)}
        robots = {robot.id: robot for robot in snapshot.robots}
        for id in (*value["humans"], *value.get("robots", ())):
            if id not in rows and id not in robots:
                raise ValueError(f"there is no person or robot {shown(id)} at tick {value['tick']}")
        seen = np.array([rows[id] for id in value["humans"]], dtype=int)
        return ViewReading(
            value["tick"], snapshot.humans.select(seen), tuple(robots[id] for id in value.get("robots", ()))
        )

    def mirrored_json(self, value: Any) -> Any:
        return value
