"""The physical world: a scene in pymunk. The only mutable object of the simulation, and the only module of the engine.

Reasons for the design: bodies are read and written in bulk through `pymunk.batch`; pedestrians and robot are moved by
forces, never by setting velocities. Chipmunk moves bodies first and detects contacts afterwards, without a swept test,
so a tick has several substeps and the robot has a safety guard. A space is built anew for every episode, in a fixed
order, before its first step: only then does the same input give the same bits.
"""

from __future__ import annotations

import math

import numpy as np
import pymunk
from pymunk import batch
from pymunk._chipmunk_cffi import ffi

from ..core.devices import DeviceEvent
from ..core.entities import Furniture, Human, Interaction
from ..core.geometry import Disc, Point, Twist
from ..core.humans import (
    BODY_X,
    BODY_Y,
    GAZE_X,
    GAZE_Y,
    OMEGA,
    VY,
    Humans,
    X,
    Y,
    activities_of_present,
    frozen,
    human_ids,
    initial_activities,
)
from ..core.portable_math import Array, rotation
from ..core.scene import Scene
from ..core.snapshot import CrowdCommands, RobotState, Snapshot
from .posture import Posture
from .presence import Presence
from .safety import SafetyGuard

MASS = 75.0  # kg, of a pedestrian and of the robot; only mass ratios matter

_POSITION_AND_VELOCITY = batch.BodyFields.POSITION | batch.BodyFields.VELOCITY


class _Rows(batch.Buffer):
    """A batch buffer over NumPy memory: one row per body, in the order of insertion.

    `batch.Buffer` allocates memory that it never frees; here NumPy owns the memory. It is longer than its rows because
    the engine would move a buffer with fewer than two free places.
    """

    def __init__(self, bodies: int, width: int) -> None:
        self._float_arr, self._int_arr = ffi.new("pmFloatArray *"), ffi.new("pmIntArray *")
        memory = np.zeros(bodies * width + 8)
        self.set_float_buf(memory)
        self.rows: Array = memory[: bodies * width].reshape(bodies, width)


class World:
    """A scene in motion: `snapshot()` observes it, `step(...)` moves it by one tick.

    Args:
        scene: initial layout.

    Attributes:
        tick: number of ticks since the start.
    """

    def __init__(self, scene: Scene) -> None:
        self.scene, self.tick = scene, 0
        self._space = _space_with_obstacles(scene)
        self._count = len(scene.humans)
        bodies = [_add_disc(self._space, h.pose.position, h.radius, h.velocity, _body_type(h)) for h in scene.humans]
        _add_disc(self._space, scene.robot.pose.position, scene.robot.radius)
        self._bodies = _Rows(self._count + 1, 4)  # x, y, vx, vy; the robot comes last
        self._forces = _Rows(self._count + 1, 2)
        self._read_bodies()
        self._posture = Posture(scene)
        self._direction = scene.robot.pose.direction  # of the robot
        self._guard = SafetyGuard(scene)
        self._twist = self._executed = Twist()
        self._activity = initial_activities(scene)
        self._interactions = scene.interactions
        self._ids, self._radius = human_ids(scene), frozen(np.array([h.radius for h in scene.humans], dtype=float))
        self._check_order()
        self._presence = Presence(scene, bodies)
        self._read_bodies()

    def snapshot(self, events: tuple[DeviceEvent, ...] = ()) -> Snapshot:
        """The current state of the world, frozen.

        Args:
            events: of input devices since the last snapshot.
        """
        state = np.empty((self._count, OMEGA + 1))
        state[:, X : VY + 1] = self._bodies.rows[:-1]
        state[:, BODY_X : BODY_Y + 1] = self._posture.direction
        state[:, GAZE_X : GAZE_Y + 1] = self._posture.gaze
        state[:, OMEGA] = self._posture.omega
        x, y, vx, vy = self._bodies.rows[-1].tolist()
        robot = RobotState(
            position=(x, y),
            direction=self._direction,
            velocity=(vx, vy),
            omega=self._twist.omega,
            executed=self._executed,
            guarded=self._guard.intervened,
            body=self.scene.robot,
        )
        interactions = self._present_interactions()
        return Snapshot(
            tick=self.tick,
            time=round(self.tick * self.scene.rules.dt, 4),
            scene=self.scene,
            robot=robot,
            humans=self._humans(state, interactions),
            interactions=interactions,
            contacts=self._guard.contacts(),
            events=events,
        )

    def step(self, twist: Twist, crowd: CrowdCommands) -> None:
        """Move the world by one tick.

        Args:
            twist: of the robot's drive, body frame, within its limits.
            crowd: commands of the pedestrians.
        """
        rules = self.scene.rules
        h = rules.dt / rules.substeps
        self._set_human_forces(crowd.acceleration)
        self._presence.follow_tracks(self.tick)
        self._guard.begin_tick(self._bodies.rows)
        sum_x = sum_y = 0.0  # of the executed velocities, body frame
        turn_c, turn_s = rotation(twist.omega * h)
        refresh_interval = max(rules.substeps // crowd.evaluations, 1)
        for substep in range(rules.substeps):
            if crowd.refresh and substep and substep % refresh_interval == 0:
                self._set_human_forces(crowd.refresh(self._bodies.rows))
            vx, vy = self._set_robot_force(twist, h)
            c, s = self._direction
            sum_x, sum_y = sum_x + vx * c + vy * s, sum_y + vy * c - vx * s
            batch.set_space_bodies(self._space, batch.BodyFields.FORCE, self._forces)
            self._space.step(h)
            self._direction = _unit(c * turn_c - s * turn_s, s * turn_c + c * turn_s)
            self._read_bodies()
        self._twist = twist
        self._executed = Twist(sum_x / rules.substeps, sum_y / rules.substeps, twist.omega)
        self._posture.turn(self._bodies.rows[:-1], crowd.facing, crowd.gaze)
        self._activity, self._interactions = crowd.activity, crowd.interactions
        self.tick += 1
        self._update_presence(crowd.leaving)

    def _humans(self, state: Array, interactions: tuple[Interaction, ...]) -> Humans:
        """The pedestrians that are present, from the (N, 9) state of all."""
        if self._presence.all_present:
            return Humans(frozen(state), self._ids, self._radius, self._activity)
        activity = activities_of_present(self._activity, self._ids, interactions)
        return Humans(frozen(state), self._ids, self._radius, activity).select(self._presence.row)

    def _present_interactions(self) -> tuple[Interaction, ...]:
        """The interactions without an absent pedestrian."""
        if self._presence.all_present:
            return self._interactions
        absent = self._presence.absent_ids
        return tuple(i for i in self._interactions if i.src not in absent and i.dst not in absent)

    def _set_human_forces(self, acceleration: Array) -> None:
        """Set the forces of the pedestrians from their accelerations (N, 2), m/s^2; absent ones have none."""
        self._forces.rows[:-1] = acceleration * MASS
        if not self._presence.all_present:
            self._forces.rows[:-1][self._presence.is_absent] = 0.0

    def _set_robot_force(self, twist: Twist, h: float) -> tuple[float, float]:
        """Set the force that gives the robot a twist within a substep, as far as the safety guard permits.

        Returns:
            The permitted velocity, m/s, world frame.
        """
        c, s = self._direction
        wanted = (twist.vx * c - twist.vy * s, twist.vx * s + twist.vy * c)
        vx, vy = self._guard.limit(wanted, self._bodies.rows, h)
        _, _, now_x, now_y = self._bodies.rows[-1].tolist()
        self._forces.rows[-1] = ((vx - now_x) * (MASS / h), (vy - now_y) * (MASS / h))
        return vx, vy

    def _update_presence(self, leaving: tuple[int, ...]) -> None:
        """Let pedestrians enter, at their initial headings, and leave."""
        entered, left = self._presence.update(self.tick, leaving, self._bodies.rows)
        for k in entered:
            self._posture.reset(k, self.scene.humans[k].pose.direction)
        if entered or left:
            self._read_bodies()

    def _read_bodies(self) -> None:
        """Copy positions and velocities from the engine to the rows."""
        self._bodies.clear()
        batch.get_space_bodies(self._space, _POSITION_AND_VELOCITY, self._bodies)

    def _check_order(self) -> None:
        """Assert that the engine lists bodies in the order of insertion, which all rows rely on."""
        placed = [*(h.pose.position for h in self.scene.humans), self.scene.robot.pose.position]
        positions = self._bodies.rows[:, X : Y + 1].tolist()
        assert positions == [list(position) for position in placed], "pymunk.batch has another order of bodies"


def _space_with_obstacles(scene: Scene) -> pymunk.Space:
    """A physics space with the walls and the furniture of a scene."""
    space = pymunk.Space()
    space.iterations, space.collision_slop = scene.rules.iterations, 0.001  # pymunk's default slop is 0.1 m
    shapes: list[pymunk.Shape] = [pymunk.Segment(space.static_body, w.start, w.end, 0.0) for w in scene.walls]
    shapes += [_static_shape(space.static_body, f) for f in scene.furniture if f.on is None]
    space.add(*shapes)
    return space


def _static_shape(ground: pymunk.Body, furniture: Furniture) -> pymunk.Shape:
    if isinstance(furniture.shape, Disc):
        return pymunk.Circle(ground, furniture.shape.radius, furniture.pose.position)
    return pymunk.Poly(ground, furniture.shape.corners(furniture.pose))


def _add_disc(
    space: pymunk.Space,
    position: Point,
    radius: float,
    velocity: Point = (0.0, 0.0),
    body_type: int = pymunk.Body.DYNAMIC,
) -> pymunk.Body:
    """Add a disc that slides but does not rotate: headings of pedestrians and robot are not kept by the engine."""
    body = pymunk.Body(MASS, math.inf, body_type)
    body.position, body.velocity = position, velocity
    space.add(body, pymunk.Circle(body, radius))
    return body


def _body_type(human: Human) -> int:
    """Kinematic for a recorded pedestrian, which only its own velocity moves."""
    return pymunk.Body.KINEMATIC if human.behaviour == "recorded" else pymunk.Body.DYNAMIC


def _unit(x: float, y: float) -> tuple[float, float]:
    """The vector (x, y) scaled to unit length."""
    norm = math.sqrt(x * x + y * y)
    return x / norm, y / norm
