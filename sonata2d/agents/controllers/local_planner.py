"""`dwa` and `mppi`: planners of a robot that has a laser scanner and odometry, and knows nothing else."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from inspect import signature
from typing import Any, NamedTuple, Self

import numpy as np

from ...core.arguments import finite_number, whole_number
from ...core.compiled.calls import call
from ...core.compiled.kernel import kernel, subroutine
from ...core.compiled.packing import Floats, Floats2, Ints, Packed, unpack
from ...core.compiled.scalar import exp, rotation
from ...core.entities import ANY_HEADING
from ...core.geometry import Pose, Twist
from ...core.portable_math import Array, unit_vector, unit_vectors
from ...core.rng import RandomStream
from ...core.scene import Scene
from ...core.vectors import X, Y, length
from ...errors import ControllerError
from ..drives.base import drive_of, drive_state
from ..sensors.base import Sensor
from ..sensors.estimates import Odometry, OdometryReading
from ..sensors.lidar import Lidar, LidarReading
from .base import Controller
from .local_map import add_scan, find_way, local_map, value_at
from .planner import uses_sideways

_TURNING = 3  # steps after which some trials of `Dwa` go straight
_SPREAD = np.array([0.2, 0.2, 0.2])  # standard deviation of the samples of `Mppi`, fractions of the limits
_AHEAD = 0.4  # m ahead of the end of a rollout, where the cost of the way is read as well
_ARRIVAL = 0.6  # of the distance at which the goal is reached
_SPIRAL, _GOLDEN, _MOST_PLACES = 0.15, 2.399963229728653, 40  # m and rad between places near the goal, and their number
STEP, STEPS = 0.2, 10  # s, and number of steps of a rollout
_REPLANNING_INTERVAL = 3  # ticks
_MARGIN, _SLOWING = 0.06, 0.5  # m: gap below which a rollout is blocked, and below which the robot drives more slowly
_SLOW, _SPEED_PER_METRE = 0.15, 1.2  # m/s at contact and 1/s: speed near obstacles
_HURRY, _BLOCKED, _CHANGE, _TOUCH = 1.5, 25.0, 0.08, 60.0  # prices of haste, of blocked rollouts, of changed commands


class Rollouts(NamedTuple):
    """Robot, goal, map and scan for rollouts, for kernels.

    Attributes:
        low, value: of the map.
        points: (P, 2), what the scan met, in the frame of the map, m; as many as `number`.
        number: (1,) of int.
        core: (K, 2), corners of the robot's core in the body frame, counter-clockwise, m; one for a disc.
        numbers: (5,): rounding of the outline, x, y of the goal, distance at which it is reached, and radius of the
            circle around the outline, m.
        reach: address of `Drive.kernel`.
        parameters, limits, memory: of the drive, see `DriveState`.
        state: (7,): x, y (m), cosine and sine of the heading, and the twist that the drive executed last.
        last: (3,), the last command.
    """

    low: Floats
    value: Floats2
    points: Floats2
    number: Ints
    core: Floats2
    numbers: Floats
    reach: Ints
    parameters: Floats
    limits: Floats
    memory: Floats
    state: Floats
    last: Floats


@kernel
def price_rollouts(packed_rollouts: Any, commands: Array, prices: Array) -> None:
    """Price sequences of commands by what happens under the limits of the drive.

    Args:
        packed_rollouts: packed `Rollouts`.
        commands: (K, T, 3), twists; T steps of `STEP` each.
        prices: (K,), output.
    """
    r = unpack(packed_rollouts, Rollouts)
    memory, now, command = np.empty(len(r.memory)), np.empty(3), np.empty(3)
    for k in range(len(commands)):
        memory[:] = r.memory
        for axis in range(3):
            now[axis] = r.state[4 + axis]
        x, y, c, s = r.state[0], r.state[1], r.state[2], r.state[3]
        price, is_over, before = 0.0, False, _gap(r, x, y, c, s)
        for t in range(commands.shape[1]):
            for axis in range(3):
                command[axis] = commands[k, t, axis]
            call(r.reach, (r.parameters, r.limits, memory, now, command, STEP))
            turn_x, turn_y = rotation(command[2] * STEP * 0.5)
            c, s = c * turn_x - s * turn_y, s * turn_x + c * turn_y
            x += (command[0] * c - command[1] * s) * STEP
            y += (command[0] * s + command[1] * c) * STEP
            c, s = c * turn_x - s * turn_y, s * turn_x + c * turn_y
            for axis in range(3):
                now[axis] = command[axis]
            gap = _gap(r, x, y, c, s)
            remaining = (commands.shape[1] - t) / commands.shape[1]
            speed = math.sqrt(command[0] * command[0] + command[1] * command[1])
            if gap < _MARGIN and gap < before - 1e-4:
                price += _BLOCKED * remaining + _TOUCH * max(-gap, 0.0)
                is_over = True
            elif gap < _SLOWING:
                price += _HURRY * max(speed - _SLOW - _SPEED_PER_METRE * gap, 0.0) * STEP
            before = gap
            dx, dy = r.numbers[1] - x, r.numbers[2] - y
            if dx * dx + dy * dy < r.numbers[3] * r.numbers[3]:
                price -= remaining
                is_over = True
            if is_over:
                break
        dx, dy = r.numbers[1] - x, r.numbers[2] - y
        ahead = min(_AHEAD, math.sqrt(dx * dx + dy * dy))  # beyond the goal there is nothing to look for
        price += 0.6 * value_at(r.low, r.value, x, y) + 0.4 * value_at(r.low, r.value, x + ahead * c, y + ahead * s)
        for axis in range(3):
            price += _CHANGE * abs(commands[k, 0, axis] - r.last[axis])
        prices[k] = price


@kernel
def advance_drive(packed_rollouts: Any, command: Array, dt: float) -> None:
    """Update what the drive keeps from tick to tick, such as a steering angle, by a command that is executed.

    Args:
        packed_rollouts: packed `Rollouts`.
        command: (3,), twist; is overwritten.
        dt: s.
    """
    r = unpack(packed_rollouts, Rollouts)
    call(r.reach, (r.parameters, r.limits, r.memory, r.state[4:7], command, dt))


@subroutine
def _gap(r: Rollouts, x: float, y: float, c: float, s: float) -> float:
    """Gap between the robot at a pose and what the scan met, at most 1 m."""
    nearest = 1.0
    for n in range(r.number[0]):
        dx, dy = r.points[n, X] - x, r.points[n, Y] - y
        reach = nearest + r.numbers[4]
        square = dx * dx + dy * dy
        if square < reach * reach:
            if len(r.core) == 1:
                nearest = min(nearest, math.sqrt(square) - r.numbers[0])
            else:
                nearest = min(nearest, _distance(r.core, dx * c + dy * s, dy * c - dx * s) - r.numbers[0])
    return nearest


@subroutine
def _distance(corners: Array, ahead: float, left: float) -> float:
    """Distance of a point from a convex polygon in the same frame, m; negative inside."""
    inside, square = -math.inf, math.inf
    for k in range(len(corners)):
        following = (k + 1) % len(corners)
        ax, ay = corners[k, X], corners[k, Y]
        side_x, side_y = corners[following, X] - ax, corners[following, Y] - ay
        px, py = ahead - ax, left - ay
        size = side_x * side_x + side_y * side_y
        part = min(max((px * side_x + py * side_y) / size, 0.0), 1.0)
        dx, dy = px - part * side_x, py - part * side_y
        square = min(square, dx * dx + dy * dy)
        inside = max(inside, (px * side_y - py * side_x) / math.sqrt(size))
    return inside if inside < 0.0 else math.sqrt(square)


@kernel
def weighted_mean(commands: Array, prices: Array, temperature: float, mean: Array) -> None:
    """Mean of sequences with weights that fall exponentially with their price.

    Args:
        commands: (K, T, 3).
        prices: (K,).
        temperature: difference of prices at which the weight falls to 1/e.
        mean: (T, 3), output.
    """
    lowest, total = prices.min(), 0.0
    mean[:] = 0.0
    for k in range(len(prices)):
        weight = exp(-min((prices[k] - lowest) / temperature, 50.0))
        total += weight
        for t in range(commands.shape[1]):
            for axis in range(3):
                mean[t, axis] += weight * commands[k, t, axis]
    for t in range(commands.shape[1]):
        for axis in range(3):
            mean[t, axis] /= total


class LocalPlanner(Controller):
    """Base class of planners that see by laser scanner and odometry alone, and price rollouts of commands.

    A grid in the frame of the odometry collects the scans, and says which way leads to the goal where it is free or
    unknown. Rollouts follow the limits of the robot's drive, whichever it is, and are compared with the last scan at
    the robot's outline.

    Args:
        sensors: a lidar and an odometry.
    """

    partial = True

    def __init__(self, sensors: Sequence[Sensor] | None = None) -> None:
        standard = (Lidar(rays=180, distance=8.0, noise=0.01), Odometry())
        self.sensors = tuple(standard if sensors is None else () if isinstance(sensors, Sensor) else sensors)
        names = [[each.name for each in self.sensors if isinstance(each, kind)] for kind in (Lidar, Odometry)]
        if [len(each) for each in names] != [1, 1] or len(self.sensors) != 2:
            raise ValueError(f"sensors of {type(self).__name__} are one Lidar and one Odometry, got {sensors!r:.100}")
        self._lidar, self._odometry = names[0][0], names[1][0]

    def reset(self, scene: Scene) -> None:
        robot, goal = scene.robot, scene.goal
        if goal.moves:
            raise ControllerError(
                f"{type(self).__name__} drives to one position, and the goal of this scene moves ({goal.task}); use "
                "social-planner, orca or social-force"
            )
        self._map = local_map(robot.pose.position, goal.position)
        self._goal, self._tick, self._places = goal, -1, 0
        self._past: dict[int, OdometryReading] = {}  # by tick
        self._executed: dict[int, Twist] = {}  # in the tick that ends with that number
        self._radius = float(robot.outline.inradius)
        outline = robot.outline
        drive = self._drive = drive_of(robot)
        state, lidar = drive_state(drive, robot.limits), self._sensor(Lidar)
        sizes = outline.rounding, outline.circumradius
        numbers = np.array([sizes[0], goal.x, goal.y, 0.5 * _ARRIVAL * goal.distance, sizes[1]])
        self._rollouts = Packed(
            Rollouts(
                self._map.low, self._map.value, np.zeros((lidar.rays, 2)), np.zeros(1, dtype=np.int64),
                np.array(outline.core), numbers,
                drive.address(), state.parameters, state.limits, state.memory, np.zeros(7), np.zeros(3),
            )
        )  # fmt: skip
        name = f"local-planner/{scene.robot_id}" if scene.robot_id else "local-planner"
        self._noise = RandomStream(scene.seed, scene.episode, "controller", name)

    def settings(self) -> Mapping[str, Any]:
        return {**super().settings(), "sensors": [{"sensor": type(s).__name__, **asdict(s)} for s in self.sensors]}

    @classmethod
    def from_settings(cls, settings: Mapping[str, Any]) -> Self:
        """Reconstruct a recorded controller."""
        kinds: dict[str, Any] = {"Lidar": Lidar, "Odometry": Odometry}
        rows = [dict(row) for row in settings.get("sensors", ())]
        sensors = [kinds[row.pop("sensor")](**row) for row in rows if row["sensor"] in kinds]
        names = signature(cls).parameters
        others = {name: value for name, value in settings.items() if name in names and name != "sensors"}
        return cls(**others, sensors=sensors or None)

    def _sensor(self, kind: type) -> Any:
        return next(sensor for sensor in self.sensors if isinstance(sensor, kind))

    def act(self, snapshot: Any) -> Twist:
        scan, odometry = (getattr(snapshot.sensors, name) for name in (self._lidar, self._odometry))
        r, executed = self._rollouts.value, snapshot.robot.executed
        self._executed[snapshot.tick] = executed
        if scan is None or odometry is None:
            return Twist()
        self._look(scan, odometry, snapshot)
        pose = self._pose_at(snapshot.tick, snapshot.dt)
        r.state[:] = pose.x, pose.y, *pose.direction, executed.vx, executed.vy, executed.omega
        memory = self._drive.memory_of(r.parameters, r.state[4:7])
        if memory is not None:  # the steering angle of the executed twist, also after another controller has driven
            r.memory[:] = memory
        if length(r.numbers[1] - pose.x, r.numbers[2] - pose.y) < _ARRIVAL * self._goal.distance:
            turn = math.remainder(self._goal.theta - pose.theta, math.tau) if self._goal.angle < ANY_HEADING else 0.0
            if abs(turn) > 0.5 * self._goal.angle and not self._drive.is_coupled:
                return Twist(0.0, 0.0, turn)
            self._search()
        command = self._plan()
        r.last[:] = command
        advance_drive(self._rollouts.argument, command.copy(), float(snapshot.dt))
        return Twist(*command.tolist())

    def _search(self) -> None:
        """Aim at another place near the goal: the robot is there by its odometry, but the episode goes on."""
        self._places += 1
        offset = _SPIRAL * math.sqrt(self._places % _MOST_PLACES)
        c, s = unit_vector(math.remainder(_GOLDEN * self._places, math.tau))
        numbers = self._rollouts.value.numbers
        numbers[1], numbers[2] = self._goal.x + offset * c, self._goal.y + offset * s

    def command_overridden(self, twist: Twist) -> None:
        self._rollouts.value.last[:] = twist.vx, twist.vy, twist.omega

    @abstractmethod
    def _plan(self) -> Array:
        """The next command, (3,)."""

    def _look(self, scan: LidarReading, odometry: OdometryReading, snapshot: Any) -> None:
        """Add a scan to the map, and find the way anew from time to time."""
        r = self._rollouts.value
        self._past[odometry.tick] = odometry
        if scan.tick > self._tick:
            self._add(scan, snapshot.dt)
        if snapshot.tick % _REPLANNING_INTERVAL == 0:
            goal = float(r.numbers[1]), float(r.numbers[2])
            find_way(self._map.low, self._map.evidence, self._map.price, self._map.value, self._radius, *goal)

    def _pose_at(self, tick: int, dt: float) -> Pose:
        """Estimated pose at a tick: the last odometry of that time, continued by the twists executed since then."""
        before = max((k for k in self._past if k <= tick), default=min(self._past))
        reading = self._past[before]
        pose = reading.pose
        for k in range(before + 1, tick + 1):
            twist = self._executed.get(k, reading.twist)  # ticks in which another controller drove have none
            middle = Pose(pose.x, pose.y, pose.theta + twist.omega * dt / 2.0)
            pose = Pose(*middle.to_world((twist.vx * dt, twist.vy * dt)), pose.theta + twist.omega * dt)
        return pose

    def _add(self, scan: LidarReading, dt: float) -> None:
        """Add a scan to the map, from where the robot was when it was taken."""
        r, pose = self._rollouts.value, self._pose_at(scan.tick, dt)
        self._tick = scan.tick
        oldest = max((k for k in self._past if k <= scan.tick), default=0)  # later scans need no more
        self._past = {k: reading for k, reading in self._past.items() if k >= oldest}
        self._executed = {k: twist for k, twist in self._executed.items() if k > oldest}
        is_hit, known = np.isfinite(scan.ranges), ~np.isnan(scan.ranges)
        ranges = np.where(is_hit, scan.ranges, scan.range_max)
        origin = pose.to_world(scan.mount)
        directions = unit_vectors(scan.angles + pose.theta)
        ends = np.ascontiguousarray(np.array(origin) + directions * ranges[:, None])
        points = ends[is_hit]
        r.points[: len(points)], r.number[0] = points, len(points)
        x, y = float(origin[0]), float(origin[1])
        add_scan(self._map.low, self._map.evidence, x, y, ends[known], is_hit[known])

    def _prices(self, commands: Array) -> Array:
        prices = np.empty(len(commands))
        price_rollouts(self._rollouts.argument, commands, prices)
        return prices


class Dwa(LocalPlanner):
    """Dynamic window approach: tries twists, of which some end with a straight part, and takes the cheapest.

    Args:
        sensors: a lidar and an odometry.

    Source: Fox, Burgard & Thrun, IEEE Robot. Autom. Mag. 4 (1997) 23, with the cost of the way to the goal on a grid as
    its heading term.
    """

    version = "1"

    def reset(self, scene: Scene) -> None:
        super().reset(scene)
        limits = scene.robot.limits
        ahead = [-0.5 * limits.back, 0.0, *(limits.ahead * part for part in (0.1, 0.2, 0.35, 0.55, 0.75, 1.0))]
        turns = [limits.turn * part for part in (-1.0, -0.6, -0.35, -0.18, -0.08, 0.0, 0.08, 0.18, 0.35, 0.6, 1.0)]
        aside = [-0.6, 0.0, 0.6] if uses_sideways(scene.robot) else [0.0]
        twists = [(vx, limits.sideways * vy, omega) for vx in ahead for vy in aside for omega in turns]
        constant = np.repeat(np.array(twists)[:, None], STEPS, axis=1)
        straight = constant[constant[:, 0, 2] != 0.0].copy()
        straight[:, _TURNING:, 2] = 0.0
        last = np.zeros((1, STEPS, 3))
        self._candidates = np.ascontiguousarray(np.concatenate((last, constant, straight)))

    def _plan(self) -> Array:
        self._candidates[0] = self._rollouts.value.last
        best: Array = self._candidates[np.argmin(self._prices(self._candidates)), 0]
        return best.copy()


class Mppi(LocalPlanner):
    """Model predictive path integral control: the mean of random sequences of commands, weighted by their price.

    Args:
        samples: number of sequences in a tick.
        temperature: difference of prices at which the weight of a sequence falls to 1/e.
        sensors: a lidar and an odometry.

    Source: Williams, Aldrich & Theodorou, J. Guid. Control Dyn. 40 (2017) 344.
    """

    version = "1"

    def __init__(self, samples: int = 256, temperature: float = 0.3, sensors: Sequence[Sensor] | None = None) -> None:
        super().__init__(sensors)
        self.samples = whole_number("samples", samples, 2, 100_000)
        self.temperature = finite_number("temperature", temperature, 1e-6)

    def reset(self, scene: Scene) -> None:
        super().reset(scene)
        limits = scene.robot.limits
        sideways = scene.robot.sideways_limit
        self._low = np.array([-limits.back, -sideways, -limits.turn])
        self._high = np.array([limits.ahead, sideways, limits.turn])
        self._nominal, self._count, self._ticks_of_step = np.zeros((STEPS, 3)), 0, STEP / scene.rules.dt

    def _plan(self) -> Array:
        past, self._count = self._count, self._count + 1
        begun = [int(max(count, 0) / self._ticks_of_step + 0.5 + 1e-9) for count in (past - 1, past)]
        for _ in range(min(begun[1] - begun[0], STEPS)):  # the plan moves on by the steps that have begun
            self._nominal = np.concatenate((self._nominal[1:], self._nominal[-1:]))
        noise = self._noise.normals(self.samples * STEPS * 3).reshape(self.samples, STEPS, 3)
        for t in range(1, STEPS):  # slowly changing
            noise[:, t] = 0.8 * noise[:, t - 1] + 0.6 * noise[:, t]
        commands = self._nominal + noise * (_SPREAD * (self._high - self._low))
        commands[0], commands[1] = self._nominal, 0.0
        commands = np.ascontiguousarray(np.clip(commands, self._low, self._high))
        weighted_mean(commands, self._prices(commands), float(self.temperature), self._nominal)
        command: Array = self._nominal[0].copy()
        return command
