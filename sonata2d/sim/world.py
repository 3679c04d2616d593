"""Bodies: a Scene in pymunk. The only thing that changes, and the only place that knows the engine.

Why it is driven as it is: bodies are read and written in bulk through `pymunk.batch`; people and robot are moved by
force, never by setting velocity; Chipmunk moves bodies first and finds contacts after, with no swept test, so a tick
has several substeps and the robot a guard. A Space is built afresh for every episode, in a fixed order, before its
first step: only so does the same input give the same bits.
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
    activities_among,
    activities_of,
    frozen,
    human_ids,
)
from ..core.portable_math import Array, rotation
from ..core.scene import Scene
from ..core.snapshot import CrowdCommands, RobotState, Snapshot
from .posture import Posture
from .presence import Presence
from .safety import SafetyGuard

MASS = 75.0  # kg, of a person and of the robot; only ratios matter

_READ = batch.BodyFields.POSITION | batch.BodyFields.VELOCITY


class _Rows(batch.Buffer):
    """A batch buffer over NumPy memory: one row a body, in the order of insertion.

    `batch.Buffer` allocates memory that it never frees; here NumPy owns it. It is longer than its rows because the
    engine would move a buffer with fewer than two free places.
    """

    def __init__(self, bodies: int, width: int) -> None:
        self._float_arr, self._int_arr = ffi.new("pmFloatArray *"), ffi.new("pmIntArray *")
        memory = np.zeros(bodies * width + 8)
        self.set_float_buf(memory)
        self.rows: Array = memory[: bodies * width].reshape(bodies, width)


class World:
    """A scene come to life.

    Args:
        scene: what to build.

    `snapshot()` looks, `step(...)` moves.
    """

    def __init__(self, scene: Scene) -> None:
        self.scene, self.tick = scene, 0
        self._space = _furnished_space(scene)
        self._people = len(scene.humans)
        bodies = [_add_disc(self._space, h.pose.position, h.radius, h.velocity, _kind(h)) for h in scene.humans]
        _add_disc(self._space, scene.robot.pose.position, scene.robot.radius)
        self._body = _Rows(self._people + 1, 4)  # x, y, vx, vy; the robot comes last
        self._force = _Rows(self._people + 1, 2)
        self._read()
        self._posture = Posture(scene)
        self._heading = scene.robot.pose.direction
        self._guard = SafetyGuard(scene)
        self._twist = self._executed = Twist()
        self._activity = activities_of(scene)
        self._interactions = scene.interactions
        self._ids, self._radius = human_ids(scene), frozen(np.array([h.radius for h in scene.humans], dtype=float))
        self._check_order()
        self._presence = Presence(scene, bodies)
        self._read()

    def snapshot(self, events: tuple[DeviceEvent, ...] = ()) -> Snapshot:
        """One frozen look at everything, now."""
        state = np.empty((self._people, 9))
        state[:, X : VY + 1] = self._body.rows[:-1]
        state[:, BODY_X : BODY_Y + 1] = self._posture.faces
        state[:, GAZE_X : GAZE_Y + 1] = self._posture.looks
        state[:, OMEGA] = self._posture.omega
        x, y, vx, vy = self._body.rows[-1].tolist()
        guard = self._guard
        robot = RobotState(
            (x, y), self._heading, (vx, vy), self._twist.omega, self._executed, guard.stepped_in, self.scene.robot
        )
        ties = self._interactions if self._presence.is_full else self._ties_of_those_present()
        return Snapshot(
            tick=self.tick,
            time=round(self.tick * self.scene.rules.dt, 4),
            scene=self.scene,
            robot=robot,
            humans=self._humans(state, ties),
            interactions=ties,
            contacts=guard.contacts(),
            events=events,
        )

    def step(self, twist: Twist, crowd: CrowdCommands) -> None:
        """Move everything by one tick.

        Args:
            twist: what the robot's drive shall do, body frame, within its limits.
            crowd: what the people want.
        """
        rules = self.scene.rules
        h = rules.dt / rules.substeps
        self._push(crowd.acceleration)
        self._presence.carry(self.tick)
        self._guard.begin_tick(self._body.rows)
        done_x = done_y = 0.0
        turn = rotation(twist.omega * h)
        between = max(rules.substeps // crowd.evaluations, 1)
        for substep in range(rules.substeps):
            if crowd.refresh and substep and substep % between == 0:
                self._push(crowd.refresh(self._body.rows))
            vx, vy = self._drive(twist, h)
            c, s = self._heading
            done_x, done_y = done_x + vx * c + vy * s, done_y + vy * c - vx * s
            batch.set_space_bodies(self._space, batch.BodyFields.FORCE, self._force)
            self._space.step(h)
            self._heading = _unit(c * turn[0] - s * turn[1], s * turn[0] + c * turn[1])
            self._read()
        self._twist = twist
        self._executed = Twist(done_x / rules.substeps, done_y / rules.substeps, twist.omega)
        self._posture.turn(self._body.rows[:-1], crowd.facing, crowd.look)
        self._activity, self._interactions = crowd.activity, crowd.interactions
        self.tick += 1
        self._let_come_and_go(crowd.leaving)

    def _humans(self, state: Array, ties: tuple[Interaction, ...]) -> Humans:
        """Those who are there, of the (N, 9) state of everybody, and with whom."""
        if self._presence.is_full:
            return Humans(frozen(state), self._ids, self._radius, self._activity)
        activity = activities_among(self._activity, self._ids, ties)
        return Humans(frozen(state), self._ids, self._radius, activity).only(self._presence.row)

    def _ties_of_those_present(self) -> tuple[Interaction, ...]:
        absent = self._presence.absent
        return tuple(tie for tie in self._interactions if tie.src not in absent and tie.dst not in absent)

    def _push(self, acceleration: Array) -> None:
        """The people's forces until the next; (N, 2), m/s2."""
        self._force.rows[:-1] = acceleration * MASS
        if not self._presence.is_full:
            self._force.rows[:-1][self._presence.away] = 0.0

    def _let_come_and_go(self, leaving: tuple[int, ...]) -> None:
        """Bring in and take away whoever's tick it is; who comes looks ahead."""
        come, gone = self._presence.turn(self.tick, leaving, self._body.rows)
        for k in come:
            self._posture.begin(k, self.scene.humans[k].pose.direction)
        if come or gone:
            self._read()

    def _drive(self, twist: Twist, h: float) -> tuple[float, float]:
        """Push the robot towards the wanted velocity, less what the guard takes away; that velocity, world frame."""
        c, s = self._heading
        wanted = (twist.vx * c - twist.vy * s, twist.vx * s + twist.vy * c)
        vx, vy = self._guard.limit(wanted, self._body.rows, h)
        _, _, now_x, now_y = self._body.rows[-1].tolist()
        self._force.rows[-1] = ((vx - now_x) * (MASS / h), (vy - now_y) * (MASS / h))
        return vx, vy

    def _read(self) -> None:
        """Fill the rows with where the bodies are and how they move."""
        self._body.clear()
        batch.get_space_bodies(self._space, _READ, self._body)

    def _check_order(self) -> None:
        """The engine must list bodies as they were added: all else here rests on it."""
        placed = [*(h.pose.position for h in self.scene.humans), self.scene.robot.pose.position]
        assert self._body.rows[:, :2].tolist() == [list(p) for p in placed], "pymunk.batch has another order of bodies"


def _furnished_space(scene: Scene) -> pymunk.Space:
    """A Space with the walls and the furniture of a scene."""
    space = pymunk.Space()
    space.iterations, space.collision_slop = scene.rules.iterations, 0.001  # pymunk's default slop is 0.1 m
    shapes: list[pymunk.Shape] = [pymunk.Segment(space.static_body, w.start, w.end, 0.0) for w in scene.walls]
    shapes += [_static_shape(space.static_body, f) for f in scene.furniture if f.on is None]
    space.add(*shapes)
    return space


def _static_shape(ground: pymunk.Body, thing: Furniture) -> pymunk.Shape:
    if isinstance(thing.shape, Disc):
        return pymunk.Circle(ground, thing.shape.radius, thing.pose.position)
    return pymunk.Poly(ground, thing.shape.corners(thing.pose))


def _add_disc(
    space: pymunk.Space,
    position: Point,
    radius: float,
    velocity: Point = (0.0, 0.0),
    kind: int = pymunk.Body.DYNAMIC,
) -> pymunk.Body:
    """A body that slides but does not roll: directions of people and robot are kept beside the engine."""
    body = pymunk.Body(MASS, math.inf, kind)
    body.position, body.velocity = position, velocity
    space.add(body, pymunk.Circle(body, radius))
    return body


def _kind(human: Human) -> int:
    """Who is recorded is moved by their velocity alone, and by nobody."""
    return pymunk.Body.KINEMATIC if human.behaviour == "recorded" else pymunk.Body.DYNAMIC


def _unit(x: float, y: float) -> tuple[float, float]:
    norm = math.sqrt(x * x + y * y)
    return x / norm, y / norm
