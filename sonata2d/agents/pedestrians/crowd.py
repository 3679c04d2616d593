"""`Crowd`: accelerations, body directions and gaze of all pedestrians at each tick."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from ...core.barrier_grid import Solids, is_crossed, solids_of
from ...core.compiled.kernel import kernel, subroutine
from ...core.compiled.packing import Bools, Floats, Floats2, Packed, unpack, zeros
from ...core.compiled.scalar import length, rotation, unit_or
from ...core.entities import DEFAULT_MODEL
from ...core.free_space import Space
from ...core.geometry import Barriers, Point, as_point
from ...core.humans import BODY_X, BODY_Y, MAXIMUM_SPEED_RATIO, VX, VY, X, Y
from ...core.portable_math import Array, BoolArray, IntArray
from ...core.rng import AgentStreams
from ...core.scene import Scene
from ...core.snapshot import CrowdCommands, Snapshot
from ...core.turning import critically_damped, turn_limits
from ...registry import PEDESTRIAN_MODELS
from .models.base import Walkers, checked_acceleration, evaluations_per_tick, pedestrian_model, standing_acceleration
from .neighbours import find_neighbours, find_walls, with_longer_lists
from .orientation import (
    HEAD_LEAD_TIME,
    IDLE_SPEED,
    MINIMUM_HEAD_LEAD,
    Glances,
    facing,
    gaze,
    has_draws,
    initial_glances,
    refill,
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

_STANDING_SPEED, _STANDING_TIME = 0.05, 1.0  # m/s and s: a robot that is slower for so long counts as an obstacle

# Steps of `decide`, and its answers: the decision that it needs, or that it is complete.
_FOLLOW, _TARGET, _TURN = range(3)
_NEEDS_DESTINATION, _NEEDS_PATHS, _NEEDS_DRAWS, _IS_DECIDED = range(4)


class Obstacles(NamedTuple):
    """Obstacles of the pedestrians, for kernels.

    Attributes:
        solids: walls and furniture.
        view_blocks: walls that can block a view between two places in the room.
        space: free space of paths, see `Wayfinding`.
        passable: free space of bodies.
        side: to which pedestrians evade each other: 1 to the right, -1 to the left.
        dt: tick, s.
    """

    solids: Solids
    view_blocks: Solids
    space: Space
    passable: Space
    side: float
    dt: float


class Intentions(NamedTuple):
    """Intentions of the pedestrians in a tick, for kernels.

    Attributes:
        preferred_speed: (N,), m/s; walking groups have the speed of their slowest member.
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


class CrowdState(NamedTuple):
    """State of a crowd, for kernels."""

    obstacles: Obstacles
    routes: Routes
    passages: Passages
    social: SocialArrays
    reactions: Reactions
    glances: Glances
    intentions: Intentions
    walkers: Walkers


class Crowd:
    """All pedestrians of a scene: one pedestrian model, wayfinding, social behaviour, reactions and orientation.

    A tick is four calls of compiled code: `observe` (neighbours), `decide` (targets, reactions to the robot,
    orientation), the pedestrian model, and `total_acceleration`. Where `decide` comes upon a decision, it returns to
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
        self._glances = initial_glances(scene, self._reactions)
        self._glance_streams = AgentStreams(scene.seed, scene.episode, "glances", scene.human_table.id.tolist())
        self._solids = solids_of(scene.barriers)
        self._view_blocks = solids_of(Barriers.of(_blocking_walls(scene)))
        self._side, self._dt = float(scene.rules.side), scene.rules.dt
        self._obstacles = self._pack_obstacles()
        self._intentions = zeros(
            Intentions, count, preferred_speed=_group_speeds(scene), robot_in_sight=np.ones(count, dtype=bool),
            standing_position=self._social.standing_position.copy(),
        )  # fmt: skip
        self._walkers = _walkers(scene)
        self._is_present, self._all_present = np.ones(count, dtype=bool), True
        self._evaluations = min(evaluations_per_tick(self._model.evaluations, self._dt), scene.rules.substeps)
        self._interval = self._dt / self._evaluations
        self._robot_position: Point = scene.robot.pose.position
        self._robot_radius, self._robot_rests, self._robot_is_obstacle = scene.robot.radius, 0, False
        self._state = Packed(self._gather_state())

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
        if self._obstacles.space is not wayfinding.space.for_kernels:
            self._obstacles = self._pack_obstacles()
        self._decide(tick, robot, humans)
        self._robot_position = as_point(robot)
        return CrowdCommands(
            acceleration=self._acceleration(),
            facing=self._intentions.facing,
            gaze=self._intentions.gaze,
            activity=social.activity,
            interactions=social.interactions,
            refresh=self._refresh if self._evaluations > 1 else None,
            evaluations=self._evaluations,
            leaving=wayfinding.leaving + self._social_dynamics.leaving,
            seats=self._social_dynamics.seats.pairs,
        )

    def turn_shoulders_like(self, other: Crowd) -> None:
        """Copy the shoulder twist from another crowd of the same people, as it is wanted there."""
        self._intentions.wanted_twist[:] = self._intentions.twist[:] = other._intentions.wanted_twist

    def _watch_robot(self, robot: Array) -> None:
        """Let paths lead round a robot that stands, as round a piece of furniture, whether it is ignored or not."""
        is_moving = robot[VX] * robot[VX] + robot[VY] * robot[VY] > _STANDING_SPEED * _STANDING_SPEED
        self._robot_rests = 0 if is_moving else self._robot_rests + 1
        is_obstacle = self._robot_rests * self._dt >= _STANDING_TIME
        if is_obstacle != self._robot_is_obstacle:
            self._robot_is_obstacle = is_obstacle
            place = (float(robot[X]), float(robot[Y]))
            self._wayfinding.set_robot(Barriers.of([(place, place, self._robot_radius)] if is_obstacle else ()))

    def _find_neighbours(self, humans: Array) -> None:
        """Fill the neighbour lists; make them longer if necessary."""
        while True:
            self._repack()
            total, walls = observe(self._state.argument, humans, self._is_present)
            if total <= len(self._walkers.neighbour) and walls <= len(self._walkers.wall):
                return
            self._walkers = with_longer_lists(self._walkers, total, walls)

    def _decide(self, tick: int, robot: Array, humans: Array) -> None:
        """Run `decide` to its end; make the decisions that it asks for."""
        wayfinding, step, first = self._wayfinding, _FOLLOW, 0
        while True:
            self._repack()
            need, item = decide(
                self._state.argument, step, first, tick, robot, humans, self._is_present, self._model.headed
            )
            if need == _IS_DECIDED:
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
                refill(self._glances, self._glance_streams)
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
        total_acceleration(self._state.argument, walking, x, y, self._interval)
        return self._intentions.acceleration

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
        """Pack the state anew if one of its parts is another object now."""
        state = self._gather_state()
        if any(part is not packed for part, packed in zip(state, self._state.value, strict=True)):
            self._state = Packed(state)

    def _gather_state(self) -> CrowdState:
        return CrowdState(
            self._obstacles, self._wayfinding.routes, self._passages, self._social.arrays, self._reactions,
            self._glances, self._intentions, self._walkers,
        )  # fmt: skip

    def _pack_obstacles(self) -> Obstacles:
        space, passable = self._wayfinding.space.for_kernels, self._wayfinding.passable.for_kernels
        return Obstacles(self._solids, self._view_blocks, space, passable, self._side, self._dt)


@kernel
def observe(packed_state: Any, humans: Array, is_present: BoolArray) -> tuple[int, int]:
    """Find the neighbours of all pedestrians, and the walls near them, at the beginning of a tick.

    Args:
        packed_state: packed `CrowdState`; the state and the neighbour lists of `walkers` are filled.
        humans: columns of `core.humans`, one row for each pedestrian of the scene.
        is_present: (N,), pedestrians that are in the room.

    Returns:
        Number of neighbours, see `find_neighbours`, and of walls, see `find_walls`.
    """
    state = unpack(packed_state, CrowdState)
    walkers = state.walkers
    for k in range(len(humans)):
        walkers.position[k, 0], walkers.position[k, 1] = humans[k, X], humans[k, Y]
        walkers.velocity[k, 0], walkers.velocity[k, 1] = humans[k, VX], humans[k, VY]
        c, s = rotation(-state.intentions.twist[k])
        walkers.body_direction[k, 0] = humans[k, BODY_X] * c - humans[k, BODY_Y] * s
        walkers.body_direction[k, 1] = humans[k, BODY_X] * s + humans[k, BODY_Y] * c
    total = find_neighbours(walkers, is_present, state.obstacles.view_blocks)
    return total, find_walls(walkers, is_present, state.obstacles.solids)


@kernel
def decide(
    packed_state: Any, step: int, first: int, tick: int, robot: Array, humans: Array, is_present: BoolArray,
    is_headed: bool,
) -> tuple[int, int]:  # fmt: skip
    """Decide what all pedestrians do in a tick, or go on where the last call stopped for a decision.

    Args:
        packed_state: packed `CrowdState`; intentions and walkers are filled; routes, reactions and glances are updated.
        step: where to begin, `_FOLLOW` in a new tick.
        first: item of `Routes.order` to begin with.
        tick: that begins.
        robot, humans: columns of `core.state` and `core.humans`; one row for each pedestrian of the scene.
        is_present: (N,), pedestrians that are in the room; the others are left out.
        is_headed: whether pedestrians walk where their bodies face.

    Returns:
        What is needed, one of the constants above; and the item of `Routes.order` that needs a destination.
    """
    state = unpack(packed_state, CrowdState)
    obstacles, routes, social = state.obstacles, state.routes, state.social
    if step == _FOLLOW:
        item = next_without_destination(routes, first, tick, humans, is_present, social.is_walking, obstacles.solids)
        if item < len(routes.order):
            return _NEEDS_DESTINATION, item
        if advance_on_paths(routes, tick, humans, is_present, obstacles.space, obstacles.passable):
            return _NEEDS_PATHS, 0
    if step <= _TARGET:
        set_targets(routes, humans, is_present)
        _set_desires(state, humans, is_present)
        give_way(state.passages, routes, state.walkers, humans, is_present, obstacles.side, obstacles.dt)
        for k in range(len(humans)):
            state.intentions.robot_in_sight[k] = is_present[k] and not is_crossed(
                obstacles.view_blocks, humans[k, X], humans[k, Y], robot[X], robot[Y]
            )
        _react(state, robot, humans, is_present)
    for k in range(len(humans)):
        if not has_draws(state.glances, k) and (social.partner_count[k] > 0 or state.reactions.notices[k]):
            return _NEEDS_DRAWS, 0
    _orient(state, tick, humans, is_present, is_headed)
    return _IS_DECIDED, 0


@subroutine
def _set_desires(state: CrowdState, humans: Array, is_present: BoolArray) -> None:
    """Set where the pedestrians want to walk, as far as it does not depend on the robot."""
    walkers, routes, social, intentions = state.walkers, state.routes, state.social, state.intentions
    for k in range(len(humans)):
        walkers.walks[k] = social.is_walking[k] and is_present[k]
        dx, dy = routes.target[k, 0] - humans[k, X], routes.target[k, 1] - humans[k, Y]
        ux, uy = 0.0, 0.0
        if social.is_walking[k]:
            ux, uy = unit_or(dx, dy, 1e-3, humans[k, BODY_X], humans[k, BODY_Y])
        walkers.desired_direction[k, 0], walkers.desired_direction[k, 1] = ux, uy
        speed = min(intentions.preferred_speed[k], corner_speed(routes, k, humans[k, X], humans[k, Y]))
        if routes.is_final[k]:
            speed = min(speed, stopping_speed(length(dx, dy)))
        walkers.desired_speed[k] = speed
        walkers.is_abreast[k] = routes.is_abreast[k] or routes.first[k] == k


@subroutine
def _react(state: CrowdState, robot: Array, humans: Array, is_present: BoolArray) -> None:
    """Adjust desired directions and speeds, and the positions of standing pedestrians, to the robot."""
    walkers, social, reactions = state.walkers, state.social, state.reactions
    intentions, obstacles = state.intentions, state.obstacles
    any_notices, any_changed = False, False
    for k in range(len(humans)):
        reactions.notices[k] = False
        if is_present[k] and notice_robot(reactions, k, robot, humans, intentions.robot_in_sight[k], obstacles.dt):
            any_notices = True
    direction, speed = walkers.desired_direction, walkers.desired_speed
    for k in range(len(humans)):
        if not is_present[k]:
            continue
        if not any_notices:
            reactions.delay[k] = max(reactions.delay[k] - 0.5 * obstacles.dt, 0.0)
        elif adjust_course(
            reactions, k, robot, walkers, direction[k, 0] * speed[k], direction[k, 1] * speed[k], speed[k],
            social.is_walking[k], obstacles.solids.table, obstacles.side, obstacles.dt,
        ):  # fmt: skip
            any_changed = True
    for k in range(len(humans)):
        if any_changed and reactions.notices[k] and social.is_walking[k]:
            direction[k, 0], direction[k, 1], speed[k] = apply_adjustment(
                reactions, k, direction[k, 0] * speed[k], direction[k, 1] * speed[k], direction[k, 0], direction[k, 1]
            )
        x, y = social.standing_position[k, 0], social.standing_position[k, 1]
        intentions.standing_position[k, 0], intentions.standing_position[k, 1] = step_back(
            reactions, k, robot, x, y, walkers.radius[k], obstacles.solids
        )


@subroutine
def _orient(state: CrowdState, tick: int, humans: Array, is_present: BoolArray, is_headed: bool) -> None:
    """Choose the desired directions of bodies and heads."""
    walkers, routes, social, reactions = state.walkers, state.routes, state.social, state.reactions
    intentions, obstacles, dt = state.intentions, state.obstacles, state.obstacles.dt
    for k in range(len(humans)):
        if not is_present[k]:
            intentions.facing[k, 0] = intentions.gaze[k, 0] = 1.0
            intentions.facing[k, 1] = intentions.gaze[k, 1] = 0.0
            continue
        ux, uy, speed = walkers.desired_direction[k, 0], walkers.desired_direction[k, 1], walkers.desired_speed[k]
        # A slow walker turns to where its model steers.
        to_x, to_y = unit_or(walkers.steering[k, 0], walkers.steering[k, 1], 0.5, ux, uy)
        pace = length(humans[k, VX], humans[k, VY])
        if pace > IDLE_SPEED or ux * to_x + uy * to_y <= 0.0:
            to_x, to_y = ux, uy
        facing_x, facing_y = facing(k, humans, social, to_x * speed, to_y * speed, reactions, obstacles.side)
        if is_headed and social.is_walking[k]:  # motion follows the body, so the body turns to the desired direction
            facing_x, facing_y = ux, uy
        twist = 0.0
        if social.is_walking[k]:
            twist = wanted_twist(walkers, k, obstacles.solids.table, intentions.wanted_twist[k], obstacles.side)
        # The body turns by the dynamics of `critically_damped`, and so does the twist, which is a part of this turn.
        rate, limit = turn_limits(pace)
        lag = twist - intentions.twist[k]
        change, intentions.twist_rate[k] = critically_damped(lag, intentions.twist_rate[k], rate, limit, dt)
        intentions.wanted_twist[k], intentions.twist[k] = twist, intentions.twist[k] + change
        lead = max(speed * HEAD_LEAD_TIME, MINIMUM_HEAD_LEAD)
        ahead_x, ahead_y = point_ahead(routes, k, humans[k, X], humans[k, Y], lead)
        c, s = rotation(twist)
        intentions.facing[k, 0], intentions.facing[k, 1] = facing_x * c - facing_y * s, facing_x * s + facing_y * c
        intentions.gaze[k, 0], intentions.gaze[k, 1] = gaze(
            k, tick, humans, social, facing_x, facing_y, ahead_x, ahead_y, reactions, state.glances, dt
        )


@kernel
def total_acceleration(packed_state: Any, walking: Array, robot_x: float, robot_y: float, interval: float) -> None:
    """Add the repulsion from the robot to the model's accelerations, hold standing pedestrians, and limit speeds.

    Args:
        packed_state: packed `CrowdState`; `intentions.acceleration` is filled.
        walking: (N, 2), m/s^2, of the pedestrian model.
        robot_x, robot_y: m.
        interval: time to the next evaluation, s.
    """
    state = unpack(packed_state, CrowdState)
    intentions, walkers, reactions = state.intentions, state.walkers, state.reactions
    for k in range(len(intentions.acceleration)):
        x, y, vx, vy = walkers.position[k, 0], walkers.position[k, 1], walkers.velocity[k, 0], walkers.velocity[k, 1]
        if walkers.walks[k]:
            push_x, push_y = robot_repulsion(reactions, k, x, y, robot_x, robot_y)
            ax, ay = walking[k, 0] + push_x, walking[k, 1] + push_y
        else:
            place = intentions.standing_position
            ax, ay = standing_acceleration(
                x, y, vx, vy, place[k, 0], place[k, 1], walkers.body_direction[k, 0], walkers.body_direction[k, 1]
            )
        # The speed after the interval is limited.
        vx_after, vy_after = vx + ax * interval, vy + ay * interval
        speed, maximum = math.sqrt(vx_after * vx_after + vy_after * vy_after), 0.0
        maximum = MAXIMUM_SPEED_RATIO * intentions.preferred_speed[k]
        scale = maximum / max(speed, 1e-6) if speed > maximum else 1.0
        intentions.acceleration[k, 0] = (vx_after * scale - vx) / interval
        intentions.acceleration[k, 1] = (vy_after * scale - vy) / interval


def _walkers(scene: Scene) -> Walkers:
    """The input of the pedestrian model, filled as far as it stays the same."""
    count = len(scene.humans)
    return zeros(
        Walkers,
        count,
        radius=scene.human_table.radius.copy(),
        neighbour_start=np.zeros(count + 1, dtype=np.int64),
        neighbour=np.zeros(0, dtype=np.int64),
        attention=np.zeros(0),
        wall_start=np.zeros(count + 1, dtype=np.int64),
        wall=np.zeros(0, dtype=np.int64),
        group=_walking_groups(scene),
        is_abreast=np.ones(count, dtype=bool),
        shoulder=scene.human_table.shoulder.copy(),
        headway=np.array([human.headway for human in scene.humans], dtype=float),
        politeness=np.array([human.politeness for human in scene.humans], dtype=float),
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
    index = scene.human_table.row
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
