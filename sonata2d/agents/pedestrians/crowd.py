"""`Crowd`: accelerations, body directions and gaze of all pedestrians at each tick."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from ...core.compiled.kernel import kernel, subroutine
from ...core.compiled.packing import Bools, Floats, Floats2, Packed, unpack
from ...core.compiled.scalar import length, rotation, unit_or
from ...core.entities import DEFAULT_MODEL
from ...core.geometry import Barriers, Point, as_point
from ...core.humans import BODY_X, BODY_Y, VX, VY, X, Y
from ...core.portable_math import Array, BoolArray, IntArray
from ...core.scene import Scene
from ...core.snapshot import CrowdCommands, Snapshot
from ...core.turning import critically_damped, turn_limits
from ...registry import PEDESTRIAN_MODELS
from .models.base import (
    Walkers,
    checked_acceleration,
    evaluations_per_tick,
    pedestrian_model,
    standing_acceleration,
)
from .neighbours import find_neighbours, is_hidden
from .orientation import (
    HEAD_LEAD_TIME,
    IDLE_SPEED,
    MINIMUM_HEAD_LEAD,
    Glances,
    GlanceStreams,
    facing,
    gaze,
    has_draws,
    initial_glances,
)
from .passages import Passages, find_passages, give_way
from .reactions import (
    Reactions,
    adjust_course,
    apply_adjustment,
    initial_reactions,
    notice_robot,
    robot_repulsion,
    step_back,
)
from .routes import (
    Routes,
    advance_on_paths,
    corner_speed,
    next_without_destination,
    point_ahead,
    set_targets,
    stopping_speed,
)
from .shoulders import wanted_twist
from .social.dynamics import SocialDynamics
from .social.state import SocialArrays, SocialState
from .wayfinding import Wayfinding

MAXIMUM_SPEED_RATIO = 1.3  # maximum speed over desired speed (Helbing & Molnár 1995)
STANDING_SPEED, STANDING_TIME = 0.05, 1.0  # m/s and s: a robot that is slower for so long counts as an obstacle

# Steps of `plan`, and what it waits for when it returns.
_FOLLOW, _TARGET, _TURN = range(3)
_NEEDS_DESTINATION, _NEEDS_PATHS, _NEEDS_DRAWS, _IS_PLANNED = range(4)


class Surroundings(NamedTuple):
    """What surrounds the pedestrians, for kernels.

    Attributes:
        barriers: rows of `Barriers.table`: walls and furniture.
        view_blocks: rows of the walls that can block a view between two places in the room.
        solids: barriers, and pedestrians that stand.
        obstacles: solids, and the spaces inside groups that talk.
        solid_clearance, obstacle_clearance: of paths, m.
        side: to which pedestrians evade each other: 1 to the right, -1 to the left.
        dt: tick, s.
    """

    barriers: Floats2
    view_blocks: Floats2
    solids: Floats2
    obstacles: Floats2
    solid_clearance: float
    obstacle_clearance: float
    side: float
    dt: float


class Plan(NamedTuple):
    """What pedestrians do in a tick, for kernels.

    Attributes:
        preferred_speed: (N,), m/s; walking groups have that of their slowest member.
        robot_in_sight: (N,) of bool.
        standing_position: (N, 2), m, to which standing pedestrians return if they are pushed.
        facing, gaze: (N, 2), unit vectors of the desired headings and gazes.
        acceleration: (N, 2), m/s^2.
        wanted_twist: (N,), rad, by which the shoulders should be turned from the direction of the feet.
        twist: (N,), rad, by which they are turned.
        twist_rate: (N,), rad/s, at which this angle changes.
    """

    preferred_speed: Floats
    robot_in_sight: Bools
    standing_position: Floats2
    facing: Floats2
    gaze: Floats2
    acceleration: Floats2
    wanted_twist: Floats
    twist: Floats
    twist_rate: Floats


class People(NamedTuple):
    """All that kernels know about the pedestrians."""

    surroundings: Surroundings
    routes: Routes
    passages: Passages
    social: SocialArrays
    reactions: Reactions
    glances: Glances
    plan: Plan
    walkers: Walkers


class Crowd:
    """All pedestrians of a scene: one pedestrian model, wayfinding, social behaviour, reactions and orientation.

    A tick is four calls of compiled code: `observe` (neighbours), `plan` (targets, reactions to the robot,
    orientation), the pedestrian model, and `total_acceleration`. Where `plan` comes upon a decision, it returns to
    ordinary Python, and is called again.

    Args:
        scene: the pedestrians and their initial states; its seed determines where they wander.

    Raises:
        ValueError: a human's model is unknown, or the humans have different models.
    """

    def __init__(self, scene: Scene) -> None:
        humans, count = scene.humans, len(scene.humans)
        names = sorted({human.model for human in humans} or {DEFAULT_MODEL})
        if len(names) > 1:
            raise ValueError(f"all pedestrians must have the same model, got {', '.join(names)}")
        if names[0] not in PEDESTRIAN_MODELS:
            raise ValueError(PEDESTRIAN_MODELS.unknown(names[0]))
        self._model = pedestrian_model(names[0])(scene)
        self._wayfinding = Wayfinding(scene)
        self._social = SocialState(scene)
        self._social_dynamics = SocialDynamics(scene, self._social, self._wayfinding)
        self._passages = find_passages(scene)
        self._reactions = initial_reactions(scene)
        self._glances, self._glance_streams = initial_glances(scene, self._reactions), GlanceStreams(scene)
        self._barriers = scene.barriers.table
        self._view_blocks = Barriers.of(_blocking_walls(scene)).table
        self._side, self._dt = float(scene.rules.side), scene.rules.dt
        self._surroundings = self._look_around()
        self._plan = Plan(
            preferred_speed=_group_speeds(scene),
            robot_in_sight=np.ones(count, dtype=bool),
            standing_position=self._social.standing_position.copy(),
            facing=np.zeros((count, 2)),
            gaze=np.zeros((count, 2)),
            acceleration=np.zeros((count, 2)),
            wanted_twist=np.zeros(count),
            twist=np.zeros(count),
            twist_rate=np.zeros(count),
        )
        self._walkers = _walkers(scene)
        self._is_present, self._all_present = np.ones(count, dtype=bool), True
        self._evaluations = min(evaluations_per_tick(self._model.evaluations, self._dt), scene.rules.substeps)
        self._interval = self._dt / self._evaluations
        self._robot_position: Point = scene.robot.pose.position
        self._robot_radius, self._robot_rests, self._robot_is_obstacle = scene.robot.radius, 0, False
        self._people = Packed(self._gather())

    def act(self, snapshot: Snapshot) -> CrowdCommands:
        """The commands of all pedestrians for the next tick.

        Raises:
            ValueError: the snapshot is of another scene, or the model's answer is not an (N, 2) array.
        """
        state, social, wayfinding = snapshot.state, self._social, self._wayfinding
        tick, humans, robot = snapshot.tick, state.humans, state.robot
        if len(humans) != len(self._is_present):
            raise ValueError(f"a crowd of {len(self._is_present)} got a snapshot of {len(humans)} pedestrians")
        self._set_presence(state.is_present)
        self._find_neighbours(humans)
        self._social_dynamics.update(tick, humans[:, X : Y + 1], self._walkers)
        self._watch_robot(robot)
        wayfinding.begin_tick(tick, humans, self._is_present)
        if self._surroundings.obstacles is not wayfinding.space.barriers.table:
            self._surroundings = self._look_around()
        self._run_plan(tick, robot, humans)
        self._robot_position = as_point(robot)
        return CrowdCommands(
            acceleration=self._acceleration(),
            facing=self._plan.facing,
            gaze=self._plan.gaze,
            activity=social.activity,
            interactions=social.interactions,
            refresh=self._refresh if self._evaluations > 1 else None,
            evaluations=self._evaluations,
            leaving=wayfinding.leaving + self._social_dynamics.leaving,
            seats=self._social_dynamics.seats,
        )

    def turn_shoulders_like(self, other: Crowd) -> None:
        """Assume that the shoulders are turned already as those of another crowd of the same people should be."""
        self._plan.wanted_twist[:] = self._plan.twist[:] = other._plan.wanted_twist

    def _watch_robot(self, robot: Array) -> None:
        """Let paths lead round a robot that stands, as round a piece of furniture, whether it is ignored or not."""
        is_moving = robot[VX] * robot[VX] + robot[VY] * robot[VY] > STANDING_SPEED * STANDING_SPEED
        self._robot_rests = 0 if is_moving else self._robot_rests + 1
        is_obstacle = self._robot_rests * self._dt >= STANDING_TIME
        if is_obstacle != self._robot_is_obstacle:
            self._robot_is_obstacle = is_obstacle
            place = (float(robot[X]), float(robot[Y]))
            self._wayfinding.set_robot(Barriers.of([(place, place, self._robot_radius)] if is_obstacle else ()))

    def _find_neighbours(self, humans: Array) -> None:
        """Fill the neighbour lists; make them longer if necessary."""
        while True:
            self._repack()
            total = observe(self._people.argument, humans, self._is_present)
            if total <= len(self._walkers.neighbour):
                return
            length = 2 * max(total, 8 * len(humans))
            self._walkers = self._walkers._replace(
                neighbour=np.zeros(length, dtype=np.int64), attention=np.zeros(length)
            )

    def _run_plan(self, tick: int, robot: Array, humans: Array) -> None:
        """Run `plan` to its end; make the decisions that it asks for."""
        wayfinding, step, first = self._wayfinding, _FOLLOW, 0
        while True:
            self._repack()
            need, item = plan(
                self._people.argument, step, first, tick, robot, humans, self._is_present, self._model.headed
            )
            if need == _IS_PLANNED:
                return
            if need == _NEEDS_DESTINATION:
                k = int(wayfinding.routes.order[item])
                wayfinding.choose_destination(k, as_point(humans[k]))
                step, first = _FOLLOW, item + 1
            elif need == _NEEDS_PATHS:
                for k in np.flatnonzero(wayfinding.routes.is_blocked).tolist():
                    wayfinding.find_new_path(k, as_point(humans[k]))
                wayfinding.routes.is_blocked[:] = False
                step = _TARGET
            else:
                self._glance_streams.refill(self._glances)
                step = _TURN

    def _refresh(self, rows: Array) -> Array:
        """`CrowdCommands.refresh`: the accelerations in the present state of the bodies."""
        self._walkers.position[:], self._walkers.velocity[:] = rows[:-1, X : Y + 1], rows[:-1, VX : VY + 1]
        self._robot_position = as_point(rows[-1])
        return self._acceleration()

    def _acceleration(self) -> Array:
        """(N, 2), m/s^2: by the model for walking pedestrians, back to their positions for standing ones."""
        walking = checked_acceleration(self._model, self._walkers)
        x, y = self._robot_position
        total_acceleration(self._people.argument, walking, x, y, self._interval)
        return self._plan.acceleration

    def _set_presence(self, is_present: BoolArray | None) -> None:
        """Update what depends on which pedestrians are present."""
        if is_present is None and self._all_present:
            return
        self._all_present = is_present is None
        present = np.ones_like(self._is_present) if is_present is None else is_present
        if (present != self._is_present).any():
            self._is_present = present.copy()
        self._social.set_presence(is_present)

    def _repack(self) -> None:
        """Pack the people anew if one of their parts is another object now."""
        people, routes, social = self._people.value, self._wayfinding.routes, self._social.arrays
        if (
            people.routes is not routes
            or people.social is not social
            or people.walkers is not self._walkers
            or people.surroundings is not self._surroundings
        ):
            self._people = Packed(self._gather())

    def _gather(self) -> People:
        return People(
            self._surroundings,
            self._wayfinding.routes,
            self._passages,
            self._social.arrays,
            self._reactions,
            self._glances,
            self._plan,
            self._walkers,
        )

    def _look_around(self) -> Surroundings:
        space, passable = self._wayfinding.space, self._wayfinding.passable
        return Surroundings(
            self._barriers,
            self._view_blocks,
            passable.barriers.table,
            space.barriers.table,
            passable.clearance,
            space.clearance,
            self._side,
            self._dt,
        )


@kernel
def observe(packed_people: Any, humans: Array, is_present: BoolArray) -> int:
    """Find the neighbours of all pedestrians at the beginning of a tick.

    Args:
        packed_people: packed `People`; the state and the neighbour lists of `walkers` are filled.
        humans: columns of `core.humans`, one row for each pedestrian of the scene.
        is_present: (N,), pedestrians that are in the room.

    Returns:
        Number of neighbours, see `find_neighbours`.
    """
    people = unpack(packed_people, People)
    walkers = people.walkers
    for k in range(len(humans)):
        walkers.position[k, 0], walkers.position[k, 1] = humans[k, X], humans[k, Y]
        walkers.velocity[k, 0], walkers.velocity[k, 1] = humans[k, VX], humans[k, VY]
        c, s = rotation(-people.plan.twist[k])
        walkers.body_direction[k, 0] = humans[k, BODY_X] * c - humans[k, BODY_Y] * s
        walkers.body_direction[k, 1] = humans[k, BODY_X] * s + humans[k, BODY_Y] * c
    return find_neighbours(walkers, is_present, people.surroundings.view_blocks)


@kernel
def plan(
    packed_people: Any,
    step: int,
    first: int,
    tick: int,
    robot: Array,
    humans: Array,
    is_present: BoolArray,
    is_headed: bool,
) -> tuple[int, int]:
    """Decide what all pedestrians do in a tick, or go on where the last call stopped for a decision.

    Args:
        packed_people: packed `People`; `plan` and `walkers` are filled, routes, reactions and glances are updated.
        step: where to begin, `_FOLLOW` in a new tick.
        first: item of `Routes.order` to begin with.
        tick: that begins.
        robot, humans: columns of `core.state` and `core.humans`; one row for each pedestrian of the scene.
        is_present: (N,), pedestrians that are in the room; the others are left out.
        is_headed: whether pedestrians walk where their bodies face.

    Returns:
        What is needed, one of the constants above; and the item of `Routes.order` that needs a destination.
    """
    people = unpack(packed_people, People)
    around, routes, social, reactions = people.surroundings, people.routes, people.social, people.reactions
    glances, result, walkers = people.glances, people.plan, people.walkers
    if step == _FOLLOW:
        item = next_without_destination(routes, first, tick, humans, is_present, social.is_walking, around.barriers)
        if item < len(routes.order):
            return _NEEDS_DESTINATION, item
        if advance_on_paths(
            routes, tick, humans, is_present, around.solids, around.obstacles, around.obstacle_clearance,
            around.solid_clearance,
        ):  # fmt: skip
            return _NEEDS_PATHS, 0
    if step <= _TARGET:
        set_targets(routes, humans, is_present)
        _set_desires(walkers, routes, social, result, humans, is_present)
        give_way(people.passages, routes, walkers, humans, is_present, around.side, around.dt)
        for k in range(len(humans)):
            result.robot_in_sight[k] = is_present[k] and not is_hidden(
                humans[k, X], humans[k, Y], robot[X], robot[Y], around.view_blocks
            )
        _react(walkers, social, reactions, result, robot, humans, is_present, around)
    for k in range(len(humans)):
        if not has_draws(glances, k) and (social.partner_count[k] > 0 or reactions.notices[k]):
            return _NEEDS_DRAWS, 0
    _orient(walkers, routes, social, reactions, glances, result, tick, humans, is_present, around, is_headed)
    return _IS_PLANNED, 0


@subroutine
def _set_desires(
    walkers: Walkers, routes: Routes, social: SocialArrays, result: Plan, humans: Array, is_present: BoolArray
) -> None:
    """Set where the pedestrians want to walk, as far as it does not depend on the robot."""
    for k in range(len(humans)):
        walkers.walks[k] = social.is_walking[k] and is_present[k]
        dx, dy = routes.target[k, 0] - humans[k, X], routes.target[k, 1] - humans[k, Y]
        ux, uy = 0.0, 0.0
        if social.is_walking[k]:
            ux, uy = unit_or(dx, dy, 1e-3, humans[k, BODY_X], humans[k, BODY_Y])
        walkers.desired_direction[k, 0], walkers.desired_direction[k, 1] = ux, uy
        speed = min(result.preferred_speed[k], corner_speed(routes, k, humans[k, X], humans[k, Y]))
        if routes.is_final[k]:
            speed = min(speed, stopping_speed(length(dx, dy)))
        walkers.desired_speed[k] = speed
        walkers.is_abreast[k] = routes.is_abreast[k] or routes.first[k] == k


@subroutine
def _react(
    walkers: Walkers, social: SocialArrays, reactions: Reactions, result: Plan, robot: Array, humans: Array,
    is_present: BoolArray, around: Surroundings,
) -> None:  # fmt: skip
    """Adjust desired directions and speeds, and the positions of standing pedestrians, to the robot."""
    any_notices, any_changed = False, False
    for k in range(len(humans)):
        reactions.notices[k] = False
        if is_present[k] and notice_robot(reactions, k, robot, humans, result.robot_in_sight[k], around.dt):
            any_notices = True
    direction, speed = walkers.desired_direction, walkers.desired_speed
    for k in range(len(humans)):
        if not is_present[k]:
            continue
        if not any_notices:
            reactions.delay[k] = max(reactions.delay[k] - 0.5 * around.dt, 0.0)
        elif adjust_course(
            reactions, k, robot, humans, walkers.radius[k], direction[k, 0] * speed[k], direction[k, 1] * speed[k],
            speed[k], social.is_walking[k], around.barriers, around.side, around.dt,
        ):  # fmt: skip
            any_changed = True
    for k in range(len(humans)):
        if any_changed and reactions.notices[k] and social.is_walking[k]:
            direction[k, 0], direction[k, 1], speed[k] = apply_adjustment(
                reactions, k, direction[k, 0] * speed[k], direction[k, 1] * speed[k], direction[k, 0], direction[k, 1]
            )
        x, y = social.standing_position[k, 0], social.standing_position[k, 1]
        result.standing_position[k, 0], result.standing_position[k, 1] = step_back(
            reactions, k, robot, x, y, walkers.radius[k], around.barriers
        )


@subroutine
def _orient(
    walkers: Walkers, routes: Routes, social: SocialArrays, reactions: Reactions, glances: Glances, result: Plan,
    tick: int, humans: Array, is_present: BoolArray, around: Surroundings, is_headed: bool,
) -> None:  # fmt: skip
    """Choose the desired directions of bodies and heads."""
    dt = around.dt
    for k in range(len(humans)):
        if not is_present[k]:
            result.facing[k, 0] = result.gaze[k, 0] = 1.0
            result.facing[k, 1] = result.gaze[k, 1] = 0.0
            continue
        ux, uy, speed = walkers.desired_direction[k, 0], walkers.desired_direction[k, 1], walkers.desired_speed[k]
        # A slow walker turns to where its model steers.
        to_x, to_y = unit_or(walkers.steering[k, 0], walkers.steering[k, 1], 0.5, ux, uy)
        pace = length(humans[k, VX], humans[k, VY])
        if pace > IDLE_SPEED or ux * to_x + uy * to_y <= 0.0:
            to_x, to_y = ux, uy
        facing_x, facing_y = facing(k, humans, social, to_x * speed, to_y * speed, reactions, around.side)
        if is_headed and social.is_walking[k]:  # motion follows the body, so the body turns to the desired direction
            facing_x, facing_y = ux, uy
        twist = 0.0
        if social.is_walking[k]:
            twist = wanted_twist(walkers, k, around.barriers, result.wanted_twist[k], around.side)
        # The body turns by the dynamics of `critically_damped`, and so does the twist, which is a part of this turn.
        rate, limit = turn_limits(pace)
        change, result.twist_rate[k] = critically_damped(twist - result.twist[k], result.twist_rate[k], rate, limit, dt)
        result.wanted_twist[k], result.twist[k] = twist, result.twist[k] + change
        lead = max(speed * HEAD_LEAD_TIME, MINIMUM_HEAD_LEAD)
        ahead_x, ahead_y = point_ahead(routes, k, humans[k, X], humans[k, Y], lead)
        c, s = rotation(twist)
        result.facing[k, 0], result.facing[k, 1] = facing_x * c - facing_y * s, facing_x * s + facing_y * c
        result.gaze[k, 0], result.gaze[k, 1] = gaze(
            k, tick, humans, social, facing_x, facing_y, ahead_x, ahead_y, reactions, glances, dt
        )


@kernel
def total_acceleration(packed_people: Any, walking: Array, robot_x: float, robot_y: float, interval: float) -> None:
    """Add the repulsion from the robot to the model's accelerations, hold standing pedestrians, and limit speeds.

    Args:
        packed_people: packed `People`; `plan.acceleration` is filled.
        walking: (N, 2), m/s^2, of the pedestrian model.
        robot_x, robot_y: m.
        interval: time to the next evaluation, s.
    """
    people = unpack(packed_people, People)
    result, walkers, reactions = people.plan, people.walkers, people.reactions
    for k in range(len(result.acceleration)):
        x, y, vx, vy = walkers.position[k, 0], walkers.position[k, 1], walkers.velocity[k, 0], walkers.velocity[k, 1]
        if walkers.walks[k]:
            push_x, push_y = robot_repulsion(reactions, k, x, y, robot_x, robot_y)
            ax, ay = walking[k, 0] + push_x, walking[k, 1] + push_y
        else:
            place = result.standing_position
            ax, ay = standing_acceleration(
                x, y, vx, vy, place[k, 0], place[k, 1], walkers.body_direction[k, 0], walkers.body_direction[k, 1]
            )
        # The speed after the interval is limited.
        vx_after, vy_after = vx + ax * interval, vy + ay * interval
        speed, maximum = math.sqrt(vx_after * vx_after + vy_after * vy_after), 0.0
        maximum = MAXIMUM_SPEED_RATIO * result.preferred_speed[k]
        scale = maximum / max(speed, 1e-6) if speed > maximum else 1.0
        result.acceleration[k, 0] = (vx_after * scale - vx) / interval
        result.acceleration[k, 1] = (vy_after * scale - vy) / interval


def _walkers(scene: Scene) -> Walkers:
    """The input of the pedestrian model, filled as far as it stays the same."""
    count = len(scene.humans)
    return Walkers(
        position=np.zeros((count, 2)),
        velocity=np.zeros((count, 2)),
        desired_direction=np.zeros((count, 2)),
        body_direction=np.zeros((count, 2)),
        desired_speed=np.zeros(count),
        radius=np.array([human.radius for human in scene.humans], dtype=float),
        walks=np.zeros(count, dtype=bool),
        neighbour_start=np.zeros(count + 1, dtype=np.int64),
        neighbour=np.zeros(0, dtype=np.int64),
        attention=np.zeros(0),
        group=_walking_groups(scene),
        is_abreast=np.ones(count, dtype=bool),
        shoulder=np.array([human.shoulder for human in scene.humans], dtype=float),
        headway=np.array([human.headway for human in scene.humans], dtype=float),
        politeness=np.array([human.politeness for human in scene.humans], dtype=float),
        steering=np.zeros((count, 2)),
    )


def _group_speeds(scene: Scene) -> Array:
    """Preferred speeds, (N,), m/s: wandering groups walk at the speed of the slowest member."""
    speed = {human.id: human.desired_speed for human in scene.humans}
    wandering = {human.id for human in scene.humans if human.behaviour == "wandering"}
    for group in scene.groups:
        slowest = min(speed[member] for member in group.members)
        speed.update({member: slowest for member in group.members if member in wandering})
    return np.array([speed[human.id] for human in scene.humans], dtype=float)


def _walking_groups(scene: Scene) -> IntArray:
    """`Walkers.group` of a scene."""
    index = {human.id: k for k, human in enumerate(scene.humans)}
    group = np.full(len(index), -1)
    for rows in ([index[m] for m in g.members] for g in scene.groups if g.kind == "walking" and len(g.members) > 1):
        group[rows] = rows[0]
    return group


def _blocking_walls(scene: Scene) -> Iterator[tuple[Point, Point, float]]:
    """Inner walls, and edges of the outline with a corner of the room on their outer side: they can block a view."""
    for k, wall in enumerate(scene.walls):
        (ax, ay), (bx, by) = wall.start, wall.end
        sides = [(bx - ax) * (y - ay) - (by - ay) * (x - ax) for x, y in scene.polygon]
        if k >= len(scene.polygon) or min(sides) < -1e-9:  # the first walls are the edges of the outline
            yield wall.start, wall.end, 0.0
