"""Reactive controllers: straight to the goal, a pedestrian model applied to the robot, and ORCA."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple, Self

import numpy as np

from ...core.arguments import finite_number
from ...core.at_goal import goal_row
from ...core.barrier_grid import rows_within
from ...core.compiled import scalar
from ...core.compiled.kernel import kernel
from ...core.compiled.packing import Floats, unpack, zeros
from ...core.geometry import Point, Twist
from ...core.humans import BODY_X, BODY_Y, X, Y
from ...core.leaves import SolidsInMotion
from ...core.navigation import FreeSpace
from ...core.portable_math import Array, BoolArray, angle_of
from ...core.scene import Scene
from ...core.snapshot import Snapshot
from ...registry import PEDESTRIAN_MODELS
from ..pedestrians.models.base import Walkers, checked_acceleration, evaluations_per_tick, pedestrian_model, use_leaves
from ..pedestrians.neighbours import FADING_DISTANCE, INTERACTION_RANGE, WALL_RANGE, range_of
from .base import Controller
from .compiled import KernelController

_REPLANNING_INTERVAL = 5  # ticks
_FROM_LEAF = 0.1  # m, from a door that is not open
_FAR = 1e4  # m, coordinates of humans that are absent


class _Straight(NamedTuple):
    """Memory of `StraightToGoal`.

    Attributes:
        goal: (5,), see `core.at_goal`.
        speed, gain: of the controller.
    """

    goal: Floats
    speed: float
    gain: float


@kernel
def _drive_straight(
    packed_memory: Any, tick: int, robot: Array, humans: Array, is_present: BoolArray, command: Array
) -> None:
    """The kernel of `StraightToGoal`; see `KernelController`."""
    memory = unpack(packed_memory, _Straight)
    dx, dy = memory.goal[X] - robot[X], memory.goal[Y] - robot[Y]
    c, s = scalar.unit_vector(scalar.angle_of(robot[BODY_Y], robot[BODY_X]))  # rounds like `Pose.to_local`
    angle = scalar.angle_of(dy * c - dx * s, dx * c + dy * s)
    facing = max(1.0 - abs(angle), 0.0)  # slow down while turning towards the goal
    command[0], command[1], command[2] = memory.speed * facing, 0.0, memory.gain * angle


class StraightToGoal(KernelController):
    """Turns towards the goal and drives straight there; ignores pedestrians and obstacles.

    Args:
        speed: m/s.
        gain: turn rate per angle to the goal, 1/s.
    """

    version = "1"
    kernel = _drive_straight

    def __init__(self, speed: float = 0.8, gain: float = 2.0) -> None:
        self.speed, self.gain = finite_number("speed", speed), finite_number("gain", gain)

    def memory(self, scene: Scene) -> _Straight:
        return _Straight(goal_row(scene.goal), float(self.speed), float(self.gain))


class SocialForce(Controller):
    """Follows the shortest path to the goal under a pedestrian model, like a pedestrian that reacts to all others.

    Args:
        speed: desired speed, m/s.
        gain: turn rate per angle to the direction of motion, 1/s.
        model: name of the pedestrian model (`docs/models.md`).

    Raises:
        ValueError: the model is unknown.
    """

    version = "1"
    robots_as_people = True

    def __init__(self, speed: float = 0.9, gain: float = 2.0, model: str = "moussaid2009") -> None:
        if model not in PEDESTRIAN_MODELS:
            raise ValueError(PEDESTRIAN_MODELS.unknown(model))
        self.speed, self.gain, self.model = finite_number("speed", speed), finite_number("gain", gain), model

    @classmethod
    def from_settings(cls, settings: Mapping[str, Any]) -> Self:
        """Reconstruct a recorded controller; settings that are missing keep their defaults."""
        controller = cls()
        vars(controller).update({name: settings[name] for name in vars(controller) if name in settings})
        return controller

    def reset(self, scene: Scene) -> None:
        self._room, self._spaces = scene, dict[tuple[float, ...], FreeSpace]()
        self._space = self._space_of(scene)
        self._waypoint = scene.goal.position
        self._model = pedestrian_model(self.model)(scene)
        count = len(scene.humans)
        self._walkers = _robot_among(count, scene.robot.radius, self.speed, len(scene.barrier_owner))
        self._solids = SolidsInMotion(scene.barriers, scene.moving_doors)
        if scene.moving_doors:
            use_leaves(self._model, self.model, self._solids.packed.value.table)
        self._far = np.stack((_FAR + np.arange(count + 1.0), np.full(count + 1, _FAR)), axis=1)  # m, of absent humans

    def act(self, snapshot: Snapshot) -> Twist:
        robot, goal = snapshot.robot, snapshot.goal
        if snapshot.tick % _REPLANNING_INTERVAL == 0:
            if self._room.moving_doors:
                self._space = self._space_of(self._room.for_paths(snapshot.state.doors.tolist()))
            path = self._space.path(robot.position, goal.position)
            self._waypoint = goal.position if path is None or len(path) < 2 else (float(path[1][0]), float(path[1][1]))
        dx, dy = self._waypoint[0] - robot.position[0], self._waypoint[1] - robot.position[1]
        distance = max(math.sqrt(dx * dx + dy * dy), 1e-6)
        direction = (dx / distance, dy / distance)
        vx, vy = self._next_velocity(snapshot, direction)
        c, s = robot.direction
        ahead, left = vx * c + vy * s, vy * c - vx * s
        is_slow = math.sqrt(vx * vx + vy * vy) <= 0.1
        if self._model.headed or is_slow:  # models whose motion follows the body need it to face the waypoint
            turn = angle_of(direction[1] * c - direction[0] * s, direction[0] * c + direction[1] * s)
        else:
            turn = angle_of(left, ahead)
        return Twist(ahead, left, self.gain * turn)

    def _space_of(self, room: Scene) -> FreeSpace:
        """The free space of a room, made once; see `Scene.for_paths`."""
        key = tuple(door.opening for door in room.interior_doors)
        if key not in self._spaces:
            barriers = room.robot_barriers.joined(room.standing_humans)
            self._spaces[key] = FreeSpace(room.outline, barriers, room.robot.outline.inradius + 0.05)
        return self._spaces[key]

    def _next_velocity(self, snapshot: Snapshot, direction: Point) -> Point:
        """The robot's velocity one tick later under the model, m/s, world frame; humans keep their velocities."""
        self._observe(snapshot, direction)
        position, velocity = self._walkers.position, self._walkers.velocity
        evaluations = evaluations_per_tick(self._model.evaluations, snapshot.dt)
        h = snapshot.dt / evaluations
        for k in range(evaluations):
            if k > 0:
                position += velocity * h
            velocity[-1] += checked_acceleration(self._model, self._walkers)[-1] * h
        return float(velocity[-1, 0]), float(velocity[-1, 1])

    def _observe(self, snapshot: Snapshot, direction: Point) -> None:
        """Set the model's input: the humans of the scene, then the robot with its desired direction.

        Absent humans keep their rows, at far places, so that the robot keeps its row and what the model remembers of
        it.
        """
        humans, robot, walkers = snapshot.humans, snapshot.robot, self._walkers
        rows = slice(0, len(walkers.position) - 1) if humans.row is None else humans.row
        walkers.position[:] = self._far
        walkers.position[rows], walkers.position[-1] = humans.position, robot.position
        walkers.velocity[rows], walkers.velocity[-1] = humans.velocity, robot.velocity
        walkers.body_direction[rows], walkers.body_direction[-1] = humans.direction, robot.direction
        walkers.radius[rows], walkers.shoulder[rows] = humans.radius, humans.shoulder
        walkers.desired_direction[-1] = direction
        offset = walkers.position[:-1] - walkers.position[-1]
        distance = np.sqrt(offset[:, 0] * offset[:, 0] + offset[:, 1] * offset[:, 1])
        reach = range_of(int(np.count_nonzero(distance < INTERACTION_RANGE)))
        near = np.flatnonzero(distance < reach)
        walkers.neighbour_start[-1], walkers.neighbour[: len(near)] = len(near), near
        walkers.attention[: len(near)] = np.minimum((reach - distance[near]) / FADING_DISTANCE, 1.0)
        self._solids.move(snapshot.state.doors, _FROM_LEAF)
        walls = rows_within(self._solids.packed, robot.position, WALL_RANGE)
        walkers.wall_start[-1], walkers.wall[: len(walls)] = len(walls), walls


def _robot_among(count: int, radius: float, speed: float, barriers: int) -> Walkers:
    """The model's input for a robot, the last row, that walks among humans and attends to those within the range.

    Args:
        count: number of humans.
        radius: of the robot, m.
        speed: desired speed of the robot, m/s.
        barriers: number of walls and edges of furniture.
    """
    is_robot = np.arange(count + 1) == count
    return zeros(
        Walkers,
        count + 1,
        body_direction=np.tile((1.0, 0.0), (count + 1, 1)),
        desired_speed=np.where(is_robot, speed, 0.0),
        radius=np.full(count + 1, float(radius)),
        walks=is_robot,
        neighbour_start=np.zeros(count + 2, dtype=np.int64),
        neighbour=np.zeros(count, dtype=np.int64),
        attention=np.zeros(count),
        wall_start=np.zeros(count + 2, dtype=np.int64),
        wall=np.zeros(barriers, dtype=np.int64),
        group=np.full(count + 1, -1),
        is_abreast=np.ones(count + 1, dtype=bool),
        headway=np.ones(count + 1),
        politeness=np.ones(count + 1),
    )


class Orca(SocialForce):
    """Drives to the goal by optimal reciprocal collision avoidance; the robot does the whole evasion itself.

    Args:
        speed: desired speed, m/s.
        gain: turn rate per angle to the direction of motion, 1/s.
    """

    def __init__(self, speed: float = 0.9, gain: float = 2.0) -> None:
        super().__init__(speed, gain, "orca2011")
