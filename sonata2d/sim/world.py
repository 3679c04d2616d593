"""The physical world: a scene in pymunk. The only mutable object of the simulation.

Reasons for the design: a tick is one call of a compiled kernel (`kernel.tick.run_tick`), which calls the engine's own C
functions. Pedestrians are moved by forces, never by setting velocities. The robot moves as its drive does, and nothing
pushes it aside: wheels do not slip. Chipmunk moves bodies first and detects contacts afterwards, without a swept test,
so a tick has several substeps, and the kernel itself stops the robot at outlines (`kernel/safety.py`). A space is built
anew for every episode, in a fixed order, before its first step: only then does the same input give the same bits.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from typing import Any, get_args

import numpy as np
import pymunk

from ..agents.drives.base import drive_of, drive_state
from ..agents.pedestrians.crowd import Crowd
from ..agents.pedestrians.models.base import physics_steps
from ..core.compiled.calls import FLOAT, PACKED, address_of
from ..core.compiled.kernel import say_if_slow
from ..core.compiled.packing import Kept, Packed
from ..core.devices import DeviceEvent
from ..core.entities import Robot
from ..core.geometry import Point, Twist
from ..core.humans import BODY_X, BODY_Y, GAZE_X, GAZE_Y, X, Y, activities_of_present, frozen
from ..core.leaves import Doors, door_frames, solids_with_doors
from ..core.portable_math import Array, IntArray
from ..core.scene import Scene, initial_activities
from ..core.snapshot import Contact, ContactKind, CrowdCommands, Snapshot
from ..core.state import HUMAN_SIZE, ROBOT_SIZE, State
from ..core.tasks import next_stage, set_present_goal
from .bodies import Bodies, is_recorded
from .kernel.body import body_of
from .kernel.chipmunk import EngineMemory, address_in_engine
from .kernel.doors import HELD, TARGET, move_doors, place_leaves
from .kernel.presence import attendance_of
from .kernel.rules import maximum_speeds, rules_of, walking_speeds
from .kernel.safety import FASTEST_PERSON, OTHER_AT_FAULT, ROBOT_AT_FAULT, Guard
from .kernel.step import DRIVE_SIZE, Buffers, advance, begin, enter_and_leave, read_state, track
from .kernel.tick import DONE, LONGER_LISTS, may_change, run_tick, tick_calls

# fields of `Buffers` that stay the same
_CONSTANT = frozenset({"solids", "handle", "addresses", "torsos", "outline", "corners", "rules", "robots"})
_CONTACT_ORDER = {kind: k for k, kind in enumerate(get_args(ContactKind))}


class World:
    """A scene in motion: `snapshot()` observes it, `step(...)` moves it by one tick.

    Args:
        scene: initial layout.

    Raises:
        ValueError: a pedestrian starts on an object that is not a seat, or is recorded and has no track.

    Attributes:
        tick: number of ticks since the start.
        row: of the present `State`.
        calls: packed `TickCalls`.
    """

    def __init__(self, scene: Scene) -> None:
        sys.audit("sonata2d.simulate")  # which the benchmark refuses in the process of a controller
        say_if_slow()
        self.scene, self.tick = scene, 0
        count, self._substeps = len(scene.humans), physics_steps(scene)
        self._bodies = Bodies(scene)
        space = self._bodies.new_space()
        size = ROBOT_SIZE + HUMAN_SIZE * count + ROBOT_SIZE * len(scene.robots)
        self.row = np.zeros(size + len(scene.moving_doors))  # as `State.row`
        shoulder = scene.human_table.shoulder.copy()
        self._engine = EngineMemory(space, self._bodies.bodies, self._bodies.torsos, shoulder)
        self._buffers = Buffers(
            humans=self.row[ROBOT_SIZE : ROBOT_SIZE + HUMAN_SIZE * count].reshape(count, HUMAN_SIZE),
            posture=np.zeros((count, 3)),
            robots=np.zeros(1 + len(scene.robots), dtype=np.int64),
            commands=np.zeros((1 + len(scene.robots), 3)),
            solids=solids_with_doors(scene.barriers, scene.moving_doors),
            doors=_doors(scene, self.row[size:], self._bodies),
            acceleration=np.zeros((count, 2)),
            attendance=attendance_of(scene),
            sits_on=np.full(count, -1),
            may_overlap=np.zeros(count, dtype=bool),
            maximum_speed=_speed_limits(scene, self._substeps),
            facing=np.zeros((count, 2)),
            gaze=np.zeros((count, 2)),
            rolling=_rolling(scene),
            **self._of_robot(scene, 0, _guard(scene)),
        )
        guard = self._buffers.guard
        others = [
            self._buffers._replace(**self._of_robot(scene.seen_by(other.id), k, _guard(scene, guard)))
            for k, other in enumerate(scene.robots, 1)
        ]
        self._packed, self._packed_calls = (
            [Packed(each) for each in (self._buffers, *others)],
            Packed(tick_calls(scene)),
        )
        self._buffers.robots[:] = [packed.address for packed in self._packed]
        self.calls = self._packed_calls.argument
        for k, human in enumerate(scene.humans):
            self._face(k, human.pose.direction)
        self._guards = [packed.value.guard for packed in self._packed]
        parts = ((guard.human_contact, guard.barrier_contact, guard.robot_contact) for guard in self._guards)
        self._contact_bits = [part for each in parts for part in each]
        self._no_contacts: tuple[tuple[Contact, ...], ...] = ((),) * (1 + len(scene.robots))
        self._last_contacts: tuple[bytes, tuple[tuple[Contact, ...], ...]] = b"", ()
        self._stage = 0  # places that the robot has reached, see `core.tasks`
        self._activity = initial_activities(scene)
        self._interactions = scene.interactions
        self._may_change = may_change(scene)
        read_state(self.argument)
        self._check_order()
        self._begin()
        self._seats_at_start = _seats_at_start(scene)
        self.set_seats(self._seats_at_start)
        self._kept: list[Kept] = []

    def _of_robot(self, scene: Scene, number: int, guard: Guard) -> dict[str, Any]:
        """Fields of the buffers of one robot.

        Args:
            scene: in its view.
            number: of the robot.
            guard: its own.
        """
        robot, drive = scene.robot, drive_of(scene.robot)
        first = ROBOT_SIZE * number + HUMAN_SIZE * len(scene.humans) if number else 0
        state = self.row[first : first + ROBOT_SIZE]
        state[BODY_X], state[BODY_Y] = robot.pose.direction
        is_shaped = drive.is_coupled or len(robot.outline.core) > 1 or len(scene.robots) > 0
        return {
            "number": number,
            "engine": self._engine.engine_with(self._bodies.outlines[number], self._bodies.corners[number]),
            "guard": guard,
            "robot": state,
            "motion": np.array([*robot.pose.position, 0.0, 0.0]),
            "drive": np.zeros(DRIVE_SIZE),
            "rules": rules_of(scene, self._substeps, FASTEST_PERSON),
            "reach": drive.address(),
            "drive_state": drive_state(drive, robot.limits),
            "body": body_of(robot.outline, len(guard.near) if is_shaped else 0),
            **_guard_calls(robot, is_shaped),
        }

    def snapshot(self, events: tuple[DeviceEvent, ...] = ()) -> Snapshot:
        """The current state of the world, frozen.

        Args:
            events: of input devices since the last snapshot.
        """
        row = self.row.copy()
        row.flags.writeable = False
        activity, interactions, is_present = self._activity, self._interactions, None
        is_absent = self._buffers.attendance.is_absent
        if self._may_change and is_absent.any():
            absent = set(self.scene.human_table.id[is_absent].tolist())
            interactions = tuple(i for i in interactions if i.src not in absent and i.dst not in absent)
            activity = activities_of_present(activity, self.scene.human_table.id, interactions)
            is_present = frozen(~is_absent)
        state, contacts = State(row, activity, is_present, len(self.scene.moving_doors)), self._contacts()
        snapshot = Snapshot.of_state(self.tick, self.scene, state, interactions, contacts[0], events, contacts[1:])
        if self.scene.goal.moves:
            self._stage = next_stage(self.scene.goal, self._stage, snapshot.robot.position)
            set_present_goal(snapshot, self._stage)
        return snapshot

    def step(
        self, twist: Twist, crowd: CrowdCommands, *, is_limited: bool = False, others: Sequence[Twist] = ()
    ) -> None:
        """Move the world by one tick.

        Args:
            twist: of the robot's drive, body frame.
            crowd: commands of the pedestrians.
            is_limited: whether to limit the twists to what the drives can reach within the tick.
            others: twists of the other robots' drives; those that are missing are 0.
        """
        if self.scene.robots:
            self._command(others)
        buffers = self._buffers
        buffers.facing[:], buffers.gaze[:] = crowd.facing, crowd.gaze
        if crowd.seats is not None and not np.array_equal(crowd.seats, buffers.sits_on):
            self.set_seats(crowd.seats)
        if len(buffers.attendance.track):
            track(self.argument, self.tick)
        substeps = self._substeps
        interval = max(substeps // crowd.evaluations, 1) if crowd.refresh else substeps
        for first in range(0, substeps, interval):
            acceleration = crowd.refresh(buffers.engine.bodies) if crowd.refresh and first else crowd.acceleration
            buffers.acceleration[:] = acceleration
            end = min(first + interval, substeps)
            advance(self.argument, float(twist.vx), float(twist.vy), float(twist.omega), is_limited, first, end)
        self._activity, self._interactions = crowd.activity, crowd.interactions
        self.tick += 1
        attendance = buffers.attendance
        attendance.is_changed[0] = False
        if attendance.is_changed[1] or (crowd.leaving is not None and crowd.leaving.any()):
            nobody = np.zeros(len(buffers.sits_on), dtype=bool)
            leaving = nobody if crowd.leaving is None else crowd.leaving
            enter_and_leave(self.argument, self.tick, leaving, nobody)

    def _command(self, others: Sequence[Twist]) -> None:
        """Set the commands of the other robots."""
        self._buffers.commands[1:] = 0.0
        for k, other in enumerate(others, 1):
            self._buffers.commands[k] = other.vx, other.vy, other.omega

    def run_tick(self, twist: Twist, crowd: Crowd, others: Sequence[Twist] = ()) -> None:
        """Let the pedestrians decide, and move the world by one tick.

        The interpreter is not needed in between, unless the pedestrian model is ordinary Python.

        Args:
            twist: of the robot's drive, body frame; limited to what the drive can reach within the tick.
            crowd: of the same scene.
            others: as in `step`.
        """
        if not crowd.is_compiled:
            self.step(twist, crowd.act(self.snapshot()), is_limited=True, others=others)
            return
        if self.scene.robots:
            self._command(others)
        command, is_decided = (float(twist.vx), float(twist.vy), float(twist.omega)), False
        while True:
            need = run_tick(self.argument, crowd.argument, self.calls, self.tick, *command, is_decided)
            if need == DONE:
                break
            if need == LONGER_LISTS:
                crowd.extend_lists()
            else:
                self.set_seats(crowd.state.tasks.sits_on)
                is_decided = True
        self.note(self.tick + 1, crowd)

    def positions(self) -> Array:
        """(N, 2), m, of the pedestrians; NaN where absent."""
        return np.where(self._buffers.attendance.is_absent[:, None], np.nan, self._buffers.humans[:, X : Y + 1])

    def note(self, tick: int, crowd: Crowd) -> None:
        """Take note that kernels have moved the world to a tick."""
        crowd.read_company()
        self.tick, self._activity, self._interactions = tick, crowd.activity, crowd.interactions

    def keep(self) -> None:
        """Keep a copy of the state, at the start, for `restart`."""
        self._kept = [Kept(packed.value, _CONSTANT) for packed in self._packed]

    def restart(self) -> None:
        """Return to the state of `keep`; the next episode has the bits of one in a new world."""
        assert self._kept
        self.set_seats(self._seats_at_start)
        for kept in self._kept:
            kept.restore()
        self._engine.use(self._bodies.new_space())
        self._begin()
        self.tick, self._stage, self._last_contacts = 0, 0, (b"", ())
        self._activity, self._interactions = initial_activities(self.scene), self.scene.interactions

    def _begin(self) -> None:
        begin(self.argument)
        if self.scene.moving_doors:
            place_leaves(self.argument)

    @property
    def argument(self) -> Any:
        """The state as kernels take it, packed `Buffers`."""
        return self._packed[0].argument

    def _contacts(self) -> tuple[tuple[Contact, ...], ...]:
        """For each robot, its contacts of the last tick: humans, objects, walls, robots, each by id."""
        guards = self._guards
        if not guards[0].counts[2] and (len(guards) == 1 or not any(guard.counts[2] for guard in guards)):
            return self._no_contacts
        bits = b"".join([part.tobytes() for part in self._contact_bits])
        if self._last_contacts[0] != bits:  # a robot that stands at a wall has the same contacts in many ticks
            self._last_contacts = bits, tuple(map(self._build_contacts, guards))
        return self._last_contacts[1]

    def _build_contacts(self, guard: Guard) -> tuple[Contact, ...]:
        if not guard.counts[2]:
            return ()
        faults: dict[tuple[ContactKind, int], int] = {}
        for k in np.flatnonzero(guard.human_contact).tolist():
            faults["human", self.scene.humans[k].id] = int(guard.human_contact[k])
        for k in np.flatnonzero(guard.barrier_contact).tolist():
            owner = self.scene.barrier_owner[k]
            faults[owner] = faults.get(owner, 0) | int(guard.barrier_contact[k])
        for k in np.flatnonzero(guard.robot_contact).tolist():
            faults["robot", self.scene.robot_ids[k]] = int(guard.robot_contact[k])
        return tuple(
            Contact(kind, id, bool(faults[kind, id] & ROBOT_AT_FAULT), bool(faults[kind, id] & OTHER_AT_FAULT))
            for kind, id in sorted(faults, key=lambda key: (_CONTACT_ORDER[key[0]], key[1]))
        )

    def set_seats(self, seats: IntArray) -> None:
        """Let pedestrians collide with all seats but their own, which `CrowdCommands.seats` lists."""
        own = self._buffers.sits_on
        for k in np.flatnonzero(seats != own).tolist():
            self._bodies.set_seat(k, int(seats[k]))
        own[:] = seats
        self._buffers.may_overlap[:] = [
            on >= 0 or is_recorded(h) for on, h in zip(seats, self.scene.humans, strict=True)
        ]

    def _face(self, k: int, direction: Point) -> None:
        """Set heading and gaze of pedestrian k."""
        humans = self._buffers.humans
        self._buffers.guard.torso[k] = direction
        humans[k, BODY_X : BODY_Y + 1] = humans[k, GAZE_X : GAZE_Y + 1] = direction

    def _check_order(self) -> None:
        """Check that the engine lists bodies in the order of insertion, which all rows rely on."""
        placed = [h.pose.position for h in self.scene.humans]
        placed += [robot.pose.position for robot, _ in self.scene.tasks]
        positions = [(x, y) for x, y, _, _ in self._buffers.engine.bodies.tolist()]
        if positions != placed:
            raise RuntimeError(f"pymunk {pymunk.version} lists bodies in another order; install another version")


def _guard_calls(robot: Robot, is_shaped: bool) -> dict[str, IntArray]:
    """Addresses of the kernels of a robot that is no disc, turns only as it moves, or is not alone; else zeros."""
    nothing, has_corners = np.zeros(2, dtype=np.int64), len(robot.outline.core) > 1
    if not is_shaped:
        return {"limit_motion": nothing, "gap_at": nothing}
    from .kernel.shaped import gap_at, limit_motion  # compiled for these only

    of_person = (PACKED, FLOAT, FLOAT, FLOAT, FLOAT, FLOAT)
    return {
        "limit_motion": address_of(limit_motion, PACKED, FLOAT, FLOAT, FLOAT, FLOAT),
        "gap_at": address_of(gap_at, *of_person) if has_corners else nothing,
    }


def _guard(scene: Scene, first_robot: Guard | None = None) -> Guard:
    """The safety guard's arrays for the humans, barriers and robots of a scene.

    Args:
        scene: of the robots.
        first_robot: guard of the first robot, with which that of another one shares the outlines of the humans.
    """
    humans, barriers, robots = len(scene.humans), len(scene.barrier_owner), 1 + len(scene.robots)
    near = humans + barriers + (sum(len(robot.outline.core) for robot, _ in scene.tasks) if scene.robots else 0)
    first: dict[tuple[str, int], int] = {}
    own: dict[str, Any] = {
        "human_contact": np.zeros(humans, dtype=np.int64),
        "barrier_contact": np.zeros(barriers, dtype=np.int64),
        "robot_contact": np.zeros(robots, dtype=np.int64),
        "near": np.zeros(near, dtype=np.int64),
        "counts": np.zeros(4, dtype=np.int64),
        "separation": np.zeros((near, 5)),
    }
    if first_robot is not None:
        return first_robot._replace(**own)
    return Guard(
        radius=scene.human_table.radius.copy(),  # kernels take writeable arrays
        shoulder=scene.human_table.shoulder.copy(),
        torso=np.zeros((humans, 2)),
        barrier_owner=np.array(
            [first.setdefault(owner, k) for k, owner in enumerate(scene.barrier_owner)], dtype=np.int64
        ),
        **own,
    )


def _doors(scene: Scene, openings: Array, bodies: Bodies) -> Doors:
    """The doors that move.

    Args:
        scene: initial layout.
        openings: (D,), a part of the row of the state; set to those of the start.
        bodies: of the scene.
    """
    doors = scene.moving_doors
    openings[:] = [door.opening for door in doors]
    shapes = np.array([[*map(address_in_engine, leaf)] for leaf in bodies.leaves], dtype=np.int64)
    memory = np.zeros((len(doors), 4))
    memory[:, TARGET] = np.sign(openings)
    memory[:, HELD] = [door.hold for door in doors]
    move = address_of(move_doors, PACKED) if doors else np.zeros(2, dtype=np.int64)
    return Doors(door_frames(doors, scene.rules.dt), openings, memory, shapes.reshape(-1, 3), np.zeros((1, 8)), move)


def _speed_limits(scene: Scene, steps: int) -> Array:
    """Maximum speed of each pedestrian, (N,), m/s; infinite in scenes with recorded pedestrians.

    Recorded pedestrians may have any speed and pass it on to others. In other scenes, a push moves a pedestrian by at
    most half the depth of its body in a physics step, so that it cannot pass through a wall.
    """
    if any(map(is_recorded, scene.humans)):
        return np.full(len(scene.humans), math.inf)
    largest_step = scene.human_table.radius / (scene.rules.dt / steps)
    limits: Array = np.clip(largest_step, walking_speeds(scene), maximum_speeds(scene))
    return limits


def _rolling(scene: Scene) -> IntArray:
    """Indices of the pedestrians that cannot move sideways, (K,); recorded ones move as they were recorded."""
    rolls = [k for k, h in enumerate(scene.humans) if not h.side_steps and not is_recorded(h)]
    return np.array(rolls, dtype=np.int64)


def _seats_at_start(scene: Scene) -> IntArray:
    """`CrowdCommands.seats` of the pedestrians that sit at the start."""
    index = {piece.id: k for k, piece in enumerate(scene.furniture) if piece.is_seat}
    for human in scene.humans:
        if human.seat is not None and human.seat not in index:
            raise ValueError(
                f"human {human.id} sits on {human.seat}, which is not a seat; set seat=True of the furniture"
            )
    return np.array([-1 if h.seat is None else index[h.seat] for h in scene.humans], dtype=np.int64)
