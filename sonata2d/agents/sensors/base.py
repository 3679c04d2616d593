"""Sensors of the robot: what they have in common, and the readings that a controller gets."""

from __future__ import annotations

import math
import re
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass, replace
from functools import cached_property
from typing import Any, NoReturn

import numpy as np

from ...core.arguments import finite_number, positive_number
from ...core.devices import ImageRequest
from ...core.entities import ROBOT_ID
from ...core.floats import FloatFields
from ...core.portable_math import Array
from ...core.rng import RandomStream
from ...core.scene import Scene
from ...core.snapshot import RobotState, Snapshot
from ...core.wording import shown
from ...errors import ControllerError, RecordError
from ...registry import SENSORS, did_you_mean


class SensorNoise:
    """Random numbers of one sensor at one tick: they do not depend on other ticks or sensors.

    Args:
        scene: of the episode, whose seed and index the numbers depend on.
        sensor: its name.
        tick: of the measurement.
    """

    def __init__(self, scene: Scene, sensor: str, tick: int) -> None:
        self._scene, self._name = scene, f"{sensor}/{tick}"
        if scene.robot_id != ROBOT_ID:
            self._name = f"{scene.robot_id}/{self._name}"

    @cached_property
    def _stream(self) -> RandomStream:  # many sensors need none, and its start costs more than a scan
        return RandomStream(self._scene.seed, self._scene.episode, "sensors", self._name)

    def uniforms(self, count: int) -> Array:
        """(count,), in [0, 1)."""
        return self._stream.uniforms(count)

    def normals(self, count: int) -> Array:
        """(count,), with mean 0 and standard deviation 1, within ±6."""
        return self._stream.normals(count)

    def poisson(self, mean: float) -> int:
        """A count from the Poisson distribution."""
        return self._stream.poisson(mean)


@dataclass(frozen=True)
class Reading:
    """Base class of the measurements of sensors.

    Attributes:
        tick: at which it was measured; earlier than the tick of the snapshot by latency and rate of the sensor.
    """

    tick: int


_SLOWEST = 1e-6  # measurements per second
LookAt = Callable[[int], Snapshot]
Renderer = Callable[[Snapshot, ImageRequest], Any]  # returns (H, W, 3) of uint8
Measure = Callable[[Snapshot, SensorNoise], Any]


@dataclass(frozen=True)
class Sensor(FloatFields, ABC):
    """Base class of sensors. A subclass is a frozen dataclass with settings as fields, and defines `start`.

    A sensor sees the world, not an observation: all walls, furniture and people, and scanners other robots.

    Attributes:
        name: of the reading in `snapshot.sensors`; by default that of the class, such as `lidar` or `people_detector`.
        rate: measurements per second; None: one in each tick. The time between them is rounded to whole ticks.
        latency: time from a measurement until the controller gets it, s; rounded to ticks.
        record: whether episode files hold the readings, each in the frame in which the controller gets it.
    """

    name: str = ""
    rate: float | None = field(default=None, kw_only=True)
    latency: float = field(default=0.0, kw_only=True)
    record: bool = field(default=False, kw_only=True)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.name:
            object.__setattr__(self, "name", re.sub(r"(?<=[a-z])(?=[A-Z])", "_", type(self).__name__).lower())
        if not isinstance(self.name, str) or not self.name.isidentifier() or hasattr(Readings, self.name):
            raise ValueError(f"the name of a sensor is an attribute of snapshot.sensors, got {self.name!r}")
        if self.rate is not None and not self.rate >= _SLOWEST:
            raise ValueError(f"rate must be positive, and at least {_SLOWEST:g} 1/s, got {self.rate}")
        if finite_number("latency", self.latency, 0.0) > 1.0 / _SLOWEST:
            raise ValueError(f"latency must be at most {1.0 / _SLOWEST:g} s, got {self.latency}")
        for name in (each.name for each in fields(self) if each.type in (bool, "bool")):
            if not isinstance(getattr(self, name), bool):
                raise ValueError(f"{name} must be True or False, got {getattr(self, name)!r}")

    @abstractmethod
    def start(self, scene: Scene) -> Measure:
        """Begin an episode.

        Returns:
            A function of the snapshot and of the noise of its tick, which returns a `Reading`. It is called whenever a
            measurement is due; of a sensor with `sees_all_ticks`, in every tick.
        """

    @property
    def request(self) -> ImageRequest | None:
        """The picture that a camera takes; None for other sensors."""
        return None

    @property
    def sees_all_ticks(self) -> bool:
        """Whether the sensor must follow the robot in every tick, as odometry does."""
        return False

    def to_json(self, reading: Any) -> Any:
        """A reading as files hold it: JSON values, of which numbers are rounded; in arrays NaN becomes null.

        By default the fields of a `Reading`, and any other reading itself.
        """
        return vars(reading) if isinstance(reading, Reading) else reading

    def from_json(self, value: Any, look_at: LookAt) -> Any:
        """The reading that a file holds; by default the JSON value.

        Args:
            value: as `to_json` returned it, rounded.
            look_at: the snapshot of a tick, without readings.

        Raises:
            ValueError, KeyError, TypeError: the value is no reading of this sensor.
        """
        return value

    def mirrored(self) -> Sensor:
        """The sensor in the mirror image of the world, y becoming -y; by default the same."""
        return self

    def mirrored_json(self, value: Any) -> Any:
        """The reading in the mirror image of the world, as files hold it.

        Raises:
            RecordError: readings of the sensor have no image, as by default.
        """
        name = type(self).__name__
        raise RecordError(f"readings of {name} cannot be mirrored; define {name}.mirrored_json, or set record=False")


_OF_ALL = ("name", "record")  # fields that are no settings in a file


def definition_of(sensor: Sensor) -> dict[str, Any]:
    """Name, type and settings of a sensor, as files hold them; the type is a registered name, or `module:Class`."""
    kind = type(sensor)
    path = f"{kind.__module__}:{kind.__qualname__}"
    known = {
        **{place: name for name, place in SENSORS.built_in.items()},
        **{point.value: name for name, point in SENSORS.plugins.items()},
        **{f"{item.__module__}:{item.__qualname__}": name for name, item in SENSORS.registered.items()},
    }
    settings = {each.name: getattr(sensor, each.name) for each in fields(sensor) if each.name not in _OF_ALL}
    return {"name": sensor.name, "type": known.get(path, path), "settings": settings}


def sensor_class(name: str) -> type[Sensor]:
    """Load the class of a sensor by its registered name.

    Raises:
        ControllerError: the name is unknown, or the plug-in does not load or is no such class.
    """

    def check(item: object) -> str | None:
        is_sensor = isinstance(item, type) and issubclass(item, Sensor) and is_dataclass(item)
        return None if is_sensor else "is not a dataclass derived from sonata2d.agents.Sensor"

    kind: type[Sensor] = SENSORS.load(name, check)
    return kind


def sensor_from(definition: Mapping[str, Any]) -> Sensor | None:
    """The recorded sensor that a file defines, without settings that this version does not know.

    Args:
        definition: as `definition_of` returns it.

    Returns:
        None if its type is not registered: code that only the file names is not loaded.

    Raises:
        ControllerError: a plug-in does not load, or is no sensor.
        ValueError, TypeError: it does not have such settings.
    """
    if definition["type"] not in SENSORS:
        return None
    kind = sensor_class(definition["type"])
    names = {each.name for each in fields(kind)}.difference(_OF_ALL)
    settings = {name: value for name, value in definition["settings"].items() if name in names}
    sensor: Sensor = kind(name=definition["name"], record=True, **settings)
    return sensor


class Readings(Mapping[str, Any]):
    """The readings of a controller's sensors, as attributes: `snapshot.sensors.lidar`.

    A reading is None until the first one has arrived.
    """

    def __init__(self, readings: dict[str, Any]) -> None:
        self._readings = readings

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        try:
            return self._readings[name]
        except KeyError:
            hint = did_you_mean(name, self._readings) or f"; it has {', '.join(self._readings) or 'none'}"
            raise AttributeError(f"the controller has no sensor named {name!r}{hint}") from None

    def __getitem__(self, name: str) -> Any:
        return self._readings[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._readings)

    def __len__(self) -> int:
        return len(self._readings)

    def __repr__(self) -> str:
        return f"Readings({', '.join(self._readings)})"


def numbers_of(values: Any, name: str, count: int) -> list[float]:
    """Numbers in a reading that a file holds.

    Raises:
        ValueError: `values` is not a list of `count` numbers.
    """
    if not isinstance(values, list) or len(values) != count or not {*map(type, values)} <= {int, float}:
        raise ValueError(f"{name} must be {count} numbers, got {shown(values)}")
    return values


class SensorSuite:
    """The sensors of a controller in an episode.

    Args:
        sensors: with different names.
        scene: of the episode.
        renderer: takes the pictures of cameras.

    Attributes:
        arrived: readings of recorded sensors that arrived at the last tick, by name, as files hold them.

    Raises:
        ControllerError: an object is no sensor, two have the same name, or a camera has no renderer.
    """

    def __init__(self, sensors: Sequence[Sensor], scene: Scene, renderer: Renderer | None = None) -> None:
        if not isinstance(sensors, Sequence):
            raise ControllerError(
                f"sensors of a controller are several, got {sensors!r:.60}; write sensors = (Lidar(),)"
            )
        self._sensors, self._scene, self._tick = tuple(sensors), scene, -1
        names: set[str] = set()
        for sensor in self._sensors:
            if not isinstance(sensor, Sensor):
                raise ControllerError(f"sensors of a controller are objects such as Lidar(), got {sensor!r:.80}")
            if sensor.name in names:
                raise ControllerError(f"two sensors are named {sensor.name!r}; set name= of one of them")
            names.add(sensor.name)
        dt = scene.rules.dt
        self._every = [1 if s.rate is None else max(int(1.0 / (s.rate * dt) + 0.5), 1) for s in self._sensors]
        self._late = [int(sensor.latency / dt + 0.5) for sensor in self._sensors]
        self._measure = [
            picture_taker(renderer, sensor.request) if renderer and sensor.request else sensor.start(scene)
            for sensor in self._sensors
        ]
        self._waiting: list[deque[Any]] = [deque() for _ in self._sensors]
        self._newest: dict[str, Any] = {sensor.name: None for sensor in self._sensors}
        self.arrived: dict[str, Any] = {}

    def __len__(self) -> int:
        return len(self._sensors)

    def observe(self, snapshot: Snapshot) -> Readings:
        """Measure what is due at the tick of a snapshot, once; the readings that have arrived by then."""
        if snapshot.tick > self._tick:
            self._tick, self.arrived = snapshot.tick, {}
            for k, sensor in enumerate(self._sensors):
                is_due = snapshot.tick % self._every[k] == 0
                if is_due or sensor.sees_all_ticks:
                    reading = self._measure[k](snapshot, SensorNoise(self._scene, sensor.name, snapshot.tick))
                    if is_due:
                        self._waiting[k].append((snapshot.tick + self._late[k], reading))
                while self._waiting[k] and self._waiting[k][0][0] <= snapshot.tick:
                    reading = self._newest[sensor.name] = self._waiting[k].popleft()[1]
                    if sensor.record and reading is not None:
                        self.arrived[sensor.name] = sensor.to_json(reading)
        return Readings(dict(self._newest))


@dataclass(frozen=True)
class CameraReading(Reading):
    """A picture.

    Attributes:
        image: (H, W, 3) of uint8.
    """

    image: Any


def picture_taker(renderer: Renderer, request: ImageRequest) -> Measure:
    """The measurement of a camera."""
    return lambda snapshot, noise: CameraReading(snapshot.tick, renderer(snapshot, request))


def angle_of_view(value: object) -> float:
    """An angle that the argument `angle` must be, rad; 2 pi may be of single precision.

    Raises:
        ValueError: it is not within (0, 2 pi].
    """
    if (angle := positive_number("angle", value)) > 2.0 * math.pi + 1e-6:
        raise ValueError(f"angle must be at most 2 pi, in rad, got {value!r}")
    return angle


def is_turn(angle: float) -> bool:
    """Whether a field of view is a whole turn."""
    return angle >= 2.0 * math.pi - 1e-9


def angles_of(count: int, angle: float) -> Array:
    """Angles of rays over a field of view, (count,), rad: from right to left; over a whole turn without a double."""
    if count == 1:
        return np.zeros(1)
    step = angle / count if is_turn(angle) else angle / (count - 1)
    angles: Array = np.arange(count, dtype=float) * step - angle / 2
    return angles


class PartialRobot:
    """The robot as it knows itself: its body, and the twist that its drive executed.

    Attributes:
        body: outline, drive and limits.
        executed: body-frame twist that the drive executed in the last tick, after the safety guard.
    """

    def __init__(self, robot: RobotState) -> None:
        self.body, self.executed = robot.body, robot.executed

    def __getattr__(self, name: str) -> NoReturn:
        if name.startswith("__"):
            raise AttributeError(name)
        raise ControllerError(f"robot.{name} is hidden from a controller with partial = True; read snapshot.sensors")


_SHOWN = frozenset({"tick", "time", "dt", "goal", "robot", "sensors", "events", "image"})


class PartialSnapshot:
    """Snapshot for a controller with `partial = True`.

    It has `sensors`, `goal`, `robot.body`, `robot.executed`, `tick`, `time`, `dt`, `events` and `image`. Reading
    anything else raises a ControllerError.

    Args:
        snapshot: with the readings of the sensors.
    """

    def __init__(self, snapshot: Snapshot) -> None:
        self._values: dict[str, Any] = {name: getattr(snapshot, name) for name in _SHOWN - {"robot"}}
        self._values["robot"] = PartialRobot(snapshot.robot)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        if name in _SHOWN:
            return self._values[name]
        if not hasattr(Snapshot, name) and name not in Snapshot.__dataclass_fields__:
            raise AttributeError(f"a snapshot has no attribute {name!r}")
        raise ControllerError(f"snapshot.{name} is hidden from a controller with partial = True; read snapshot.sensors")

    def __repr__(self) -> str:
        return f"<PartialSnapshot: tick {self.tick}, {self.time:g} s, sensors {', '.join(self.sensors) or 'none'}>"


def shown_to(controller: Any, snapshot: Snapshot) -> Any:
    """The snapshot as a controller gets it in `act`."""
    if controller.partial:
        return PartialSnapshot(snapshot)
    return snapshot.with_robots_as_people() if snapshot.scene.robots and controller.robots_as_people else snapshot


def known_to(controller: Any, scene: Scene) -> Scene:
    """The scene as a controller gets it in `reset`: of a partial one, robot, goal and rules only.

    Room, walls, furniture, people and settings are left out.
    """
    if not controller.partial:
        return scene.with_robots_as_people if controller.robots_as_people else scene
    return replace(
        scene, polygon=(), holes=(), walls=(), furniture=(), humans=(), groups=(), interactions=(), doors=(),
        interior_doors=(), areas=(), queues=(), places=(), settings=None, dropped=(), robots=(),
    )  # fmt: skip
