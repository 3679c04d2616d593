"""`social-planner`, the expert: samples short trajectories, predicts pedestrians and minimises a social cost."""

from __future__ import annotations

import math
from dataclasses import asdict, astuple, dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np

from ...core.at_goal import goal_row, is_at_goal
from ...core.barrier_grid import Solids, find_within
from ...core.compiled.kernel import kernel, subroutine
from ...core.compiled.packing import Floats, Floats2, Floats3, Floats4, Ints2, unpack
from ...core.compiled.scalar import gap, rotation, to_shoulder_line
from ...core.entities import Robot
from ...core.floats import FloatFields
from ...core.geometry import Point, Twist
from ...core.humans import BODY_X, BODY_Y, VX, VY, X, Y
from ...core.leaves import SolidsInMotion, reach_of
from ...core.portable_math import Array, BoolArray, IntArray
from ...core.proxemics import INTIMATE_DISTANCE, PERSONAL_DISTANCE
from ...core.scene import Scene
from ...core.separation import SEPARATION_SIZE, covering_discs, gap_to_barrier
from ...core.state import EXECUTED_OMEGA, EXECUTED_VX, EXECUTED_VY, HUMAN_SIZE
from ...errors import ControllerError
from ...registry import drive_class
from .compiled import KernelController
from .cost_field import CELL, CLEARANCE, HIGHEST, PRICE, VALUE, CostField, grid_coordinate, interpolated
from .heading_field import heading_cost, heading_field

_TURNS = (-1.0, -0.5, -0.15, 0.0, 0.15, 0.5, 1.0)  # turn rates to try, fractions of the limit
_HORIZON, STEP = 2.4, 0.2  # s, duration and time step of the prediction
STEPS = int(_HORIZON / STEP + 0.5)
_OBSTACLE_MARGIN = 0.02  # m to walls and furniture, below which a trajectory counts as blocked
_SLOW_SPEED, _SPEED_PER_METRE = 0.2, 0.6  # m/s at contact and 1/s: proper speed near people grows with the clearance
_CONTACT_MARGIN = 0.06  # m, predicted clearance below which a contact is assumed
_NEAR_CONTACT, _NEAR_CONTACT_PRICE = 0.04, 10.0  # m; below it, each m/s towards a person counts as 10 m
_REACTION_TIME = 0.15  # s before braking takes effect
_TINY = 1e-4  # m, less is no motion
_PARTS = 4  # of a step, in which the outline of a robot that is no disc is compared with barriers
_HASTE = 0.01  # cost of a step of a trajectory of a robot that is no disc
_LONG = 1.5  # ratio of the circles around and within an outline, above which it is long
_FROM_LEAF = 0.1  # m, from a door that is not open, where the robot waits for it
_SLOW_PROGRESS = 0.5  # share of the top speed; a robot that comes nearer to its goal more slowly is held up
_PROGRESS_TIME = 2.0  # s, over which progress is averaged
_IMPATIENCE = 5.0  # s of being held up, after which the costs of disturbing people decrease


def uses_sideways(robot: Robot) -> bool:
    """Whether sideways velocities are worth a try: a long robot passes gaps lengthwise."""
    return robot.moves_sideways and robot.outline.circumradius <= _LONG * robot.outline.inradius


def _candidate_velocities(robot: Robot) -> list[Point]:
    """The velocities to try, m/s, body frame: a grid over the drive's limits."""
    limits = robot.limits
    ahead = [-limits.back * 0.6, 0.0, *(limits.ahead * fraction for fraction in (0.15, 0.3, 0.5, 0.75, 1.0))]
    sideways = [-limits.sideways * 0.8, 0.0, limits.sideways * 0.8] if uses_sideways(robot) else [0.0]
    return [(vx, vy) for vx in ahead for vy in sideways]


@dataclass(frozen=True, slots=True)
class Weights(FloatFields):
    """Cost of each concern, where a metre of open ground still to go costs 1. The names are recorded as settings.

    Attributes:
        ahead: distance ahead of the robot, m, at which the cost of the remaining path is read as well.
        intimate: per second at contact with a person; falls linearly to 0 at 0.45 m.
        personal: per second at contact with a person; falls linearly to 0 at 1.2 m.
        hurry: per second and m/s in excess of the proper speed near people.
        crash: of a predicted contact with a person; less for a later one.
        bump: of a predicted contact with a wall or an object; less for a later one.
        closing: per metre by which the robot could not stop before a person.
        change: per m/s, or per 2 rad/s, of change of the command.
    """

    ahead: float = 0.4
    intimate: float = 2.5
    personal: float = 0.4
    hurry: float = 2.0
    crash: float = 20.0
    bump: float = 20.0
    closing: float = 100.0
    change: float = 0.2


# Columns of the numbers that stay the same in an episode: the weights in their order, then the robot and its task.
_AHEAD, _INTIMATE, _PERSONAL, _HURRY, _CRASH, _BUMP, _CLOSING, _CHANGE = range(8)
_OBSTACLE_PRICE, _OBSTACLE_DISTANCE, HAS_NEGATIVE_WEIGHTS = 8, 9, 10
_LOW_X, _LOW_Y, _GOAL_X, _GOAL_Y, _GOAL_DISTANCE, _DT = range(11, 17)
_ROBOT_RADIUS, _IS_HOLONOMIC, _MAX_SPEED, _ACCELERATION, _TURN_ACCELERATION = range(17, 22)

# Layers of the predicted headings (unit vectors in the middle and at the end of a step) and of the predicted velocities
# in the body frame.
_MIDDLE_X, _MIDDLE_Y, _FINAL_X, _FINAL_Y = range(4)
_FORWARD, _LEFT, _SPEED = range(3)


class _Body(NamedTuple):
    """The robot's outline.

    Attributes:
        discs: (D, 2), centres of discs of the radius `_ROBOT_RADIUS` that cover it, body frame, m; for people.
        core: (K, 2), corners of its core, body frame, m; for walls and furniture. `corners` and `found` are scratch.
        rounding: m.
    """

    discs: Floats2
    core: Floats2
    corners: Floats2
    found: Floats
    rounding: float


class _Memory(NamedTuple):
    """Memory of `SocialPlanner`.

    Attributes:
        numbers, layers, pairs, velocities, turns, positions, progress: see `_cheapest`.
        solids: walls and furniture.
        goal: (5,), see `core.at_goal`.
        last: (3,), the last command.
        outline: (2, N), radius and shoulder of each human of the scene, m; see `Humans`.
        body, headed: see `_cheapest`.
        present, present_outline: (N, 9) and (2, N), of the humans that are present; scratch.
        speed_limits: (NX, NY), see `CostField`.
    """

    numbers: Floats
    layers: Floats3
    solids: Solids
    goal: Floats
    pairs: Ints2
    velocities: Floats2
    turns: Floats
    positions: Floats4
    progress: Floats
    last: Floats
    outline: Floats2
    body: _Body
    headed: Floats3
    present: Floats2
    present_outline: Floats2
    speed_limits: Floats2


@kernel
def _plan(packed_memory: Any, tick: int, robot: Array, humans: Array, is_present: BoolArray, command: Array) -> None:
    """The kernel of `SocialPlanner`; see `KernelController`."""
    memory = unpack(packed_memory, _Memory)
    last = memory.last
    if is_at_goal(memory.goal, robot):  # in an episode that goes on nevertheless
        last[0], last[1], last[2] = 0.0, 0.0, 0.0
    else:
        best = _best(memory, tick, robot, humans, is_present)
        if best < len(memory.pairs) - 1:
            v, t = memory.pairs[best, 0], memory.pairs[best, 1]
            last[0], last[1], last[2] = memory.velocities[v, X], memory.velocities[v, Y], memory.turns[t]
        _keep_speed_limits(memory, robot)
    for axis in range(3):
        command[axis] = last[axis]


@subroutine
def _keep_speed_limits(memory: _Memory, robot: Array) -> None:
    """Reduce the command to the speed limit where the robot is."""
    last, limits, numbers = memory.last, memory.speed_limits, memory.numbers
    if len(limits) == 0:
        return
    i = int(grid_coordinate(robot[X], numbers[_LOW_X], len(limits)) + 0.5)
    j = int(grid_coordinate(robot[Y], numbers[_LOW_Y], limits.shape[1]) + 0.5)
    speed = math.sqrt(last[0] * last[0] + last[1] * last[1])
    if speed > limits[i, j]:
        last[0], last[1] = last[0] * limits[i, j] / speed, last[1] * limits[i, j] / speed


class SocialPlanner(KernelController):
    """Drives to the goal with regard for people's comfort.

    In each tick, some hundred twists are rolled out under the drive's limits and priced against the room and against
    people who keep their velocities; the cheapest is commanded. People's comfort counts less while the robot is held
    up, that is, while it comes nearer to its goal at less than half of its top speed for more than 5 s.

    Args:
        weights: the cost weights; None: the default ones.

    Attributes:
        obstacle_price: for subclasses: additional cost per second at contact with a wall or an object.
        obstacle_distance: m, clearance from walls and objects at which the additional cost has fallen linearly to 0.

    Source: the dynamic window (Fox, Burgard & Thrun, IEEE Robot. Autom. Mag. 4 (1997) 23) with a navigation function
    as its goal term (Brock & Khatib, ICRA 1999).
    """

    version = "2"
    kernel = _plan
    obstacle_price: ClassVar[float] = 0.0
    obstacle_distance: ClassVar[float] = 1.0

    def __init__(self, weights: Weights | None = None) -> None:
        self._weights = weights or Weights()

    def settings(self) -> dict[str, float]:
        return asdict(self._weights)

    def memory(self, scene: Scene) -> _Memory:
        field, robot, weights = CostField(scene), scene.robot, astuple(self._weights)
        goal, limits, table = scene.goal, robot.limits, scene.human_table
        if drive_class(robot.kinematics).is_coupled:
            raise ControllerError(
                f"social-planner cannot drive a {robot.kinematics}, which turns only as it moves; use dwa or mppi"
            )
        (discs, disc_radius), core = covering_discs(robot.outline), np.array(robot.outline.core)
        has_negative_weights = min(*weights[_INTIMATE:], self.obstacle_price) < 0.0
        numbers = (
            *weights, self.obstacle_price * STEP, self.obstacle_distance, has_negative_weights,
            *field.low, goal.x, goal.y, goal.distance, scene.rules.dt,
            disc_radius, robot.moves_sideways, limits.ahead, limits.acceleration, limits.turn_acceleration,
        )  # fmt: skip
        velocities, turns = _candidate_velocities(robot), [robot.limits.turn * fraction for fraction in _TURNS]
        pairs = [(v, t) for v in range(len(velocities)) for t in range(len(turns))]
        self._solids = SolidsInMotion(scene.barriers, scene.moving_doors)
        self._room = self._planned = scene
        self._ways: dict[tuple[float, ...], tuple[Array, Array]] = {}
        # The last row of each array is for the last command.
        return _Memory(
            numbers=np.array(numbers, dtype=float),
            layers=_with_leaves(field, scene),
            solids=self._solids.packed.value,
            goal=goal_row(goal),
            pairs=np.array([*pairs, (len(velocities), len(turns))]),
            velocities=np.array([*velocities, (0.0, 0.0)]),
            turns=np.array([*turns, 0.0]),
            positions=np.empty((2, STEPS + 1, len(turns) + 1, len(velocities) + 1)),
            progress=np.array([math.inf, 0.0]),
            last=np.zeros(3),
            outline=np.stack((table.radius, table.shoulder)),
            body=_Body(discs, core, core.copy(), np.empty(SEPARATION_SIZE), float(robot.outline.rounding)),
            headed=heading_field(scene, field) if len(core) > 1 else np.empty((0, 0, 0)),
            present=np.empty((len(table.id), HUMAN_SIZE)),
            present_outline=np.empty((2, len(table.id))),
            speed_limits=field.speed_limits,
        )

    def move_doors(self, memory: _Memory, openings: Array) -> None:
        self._solids.move(openings, _FROM_LEAF)
        room = self._room.for_paths(openings.tolist())
        if room is self._planned:
            return
        self._planned = room
        key = tuple(door.opening for door in room.interior_doors)
        if key not in self._ways:
            field = CostField(room)
            headed = heading_field(room, field) if len(memory.headed) else memory.headed
            self._ways[key] = _with_leaves(field, self._room), headed
        layers, headed = self._ways[key]
        memory.layers[:], memory.headed[:], memory.progress[0] = layers, headed, math.inf

    def command_overridden(self, twist: Twist) -> None:
        self._memory.value.last[:] = twist.vx, twist.vy, twist.omega


def _with_leaves(field: CostField, scene: Scene) -> Array:
    """The layers of a field in which barriers may be near wherever a leaf of a door can be."""
    if not scene.moving_doors:
        return field.layers
    layers = field.layers.copy()
    _, nx, ny = layers.shape
    cells = field.low + CELL * np.stack(np.meshgrid(np.arange(nx), np.arange(ny), indexing="ij"), axis=-1)
    gaps = reach_of(scene.moving_doors).gaps(cells.reshape(-1, 2)).min(axis=0).reshape(nx, ny)
    layers[CLEARANCE] = np.minimum(layers[CLEARANCE], gaps)
    return layers


@subroutine
def _best(memory: _Memory, tick: int, robot: Array, humans: Array, is_present: BoolArray) -> int:
    """`_cheapest`, with the humans that are present."""
    last, count = memory.last, 0
    for k in range(len(humans)):
        if is_present[k]:
            for column in range(HUMAN_SIZE):
                memory.present[count, column] = humans[k, column]
            for row in range(2):
                memory.present_outline[row, count] = memory.outline[row, k]
            count += 1
    return _cheapest(
        memory.numbers, memory.layers, memory.solids, memory.body, memory.headed, memory.pairs, memory.velocities,
        memory.turns, memory.positions, memory.progress, memory.present[:count], memory.present_outline[0, :count],
        memory.present_outline[1, :count],
        tick, (robot[X], robot[Y]), (robot[BODY_X], robot[BODY_Y]),
        robot[EXECUTED_VX], robot[EXECUTED_VY], robot[EXECUTED_OMEGA], last[0], last[1], last[2],
    )  # fmt: skip


@subroutine
def _cheapest(
    numbers: Array, layers: Array, solids: Solids, body: _Body, headed: Array, pairs: IntArray, velocities: Array,
    turns: Array, positions: Array, progress: Array, state: Array, radius: Array, shoulder: Array, tick: int,
    position: Point, direction: Point, now_vx: float, now_vy: float, now_omega: float, last_vx: float, last_vy: float,
    last_omega: float,
) -> int:  # fmt: skip
    """The first one of the cheapest candidates.

    Args:
        numbers: (22,), weights, robot and task; columns `_AHEAD` to `_TURN_ACCELERATION`.
        layers: (3, NX, NY), of the cost field.
        solids: walls and furniture.
        body: outline of the robot.
        headed: (H, NX, NY), cost of the motion to the goal with each heading, of a robot that is no disc.
        pairs: (K, 2), indices of the velocity and of the turn rate of each candidate; the last one is the last command.
        velocities: (V, 2), m/s, body frame; the last one is overwritten with the last command's.
        turns: (T,), rad/s; the last one is overwritten with the last command's.
        positions: (2, STEPS + 1, T, V), m, world frame; overwritten with the predicted positions of the robot.
        progress: running mean of the cost of the path to the goal, and the last tick without a hold-up; updated.
        state, radius, shoulder: (N, 9), (N,) and (N,), of the people; see `Humans`.
        tick: of the snapshot.
        position, direction: of the robot, world frame.
        now_vx, now_vy, now_omega: the twist that the drive executed.
        last_vx, last_vy, last_omega: the last command.

    Returns:
        Index in `pairs`.
    """
    velocities[-1, X], velocities[-1, Y], turns[-1] = last_vx, last_vy, last_omega
    courtesy = _courtesy(numbers, layers, progress, tick, position)
    headings = _headings(numbers, turns, now_omega, direction)
    motions, speed = _motions(numbers, velocities, now_vx, now_vy)
    _roll_out(positions, headings, motions, position)
    discs, extent = body.discs, _extent(body.discs)
    reach = numbers[_MAX_SPEED] * _HORIZON + numbers[_ROBOT_RADIUS] + extent + 0.1  # m, within the horizon
    near = np.empty(len(solids.table), dtype=np.int64)
    near = near[: find_within(solids, position[0], position[1], reach, near)]
    before = math.inf  # gap to the nearest barrier, m
    for n in range(len(near)):
        here = _gap_to(body, solids.table, near[n], position[0], position[1], direction[0], direction[1])
        before = min(before, here)
    people = _nearby_people(numbers, discs, state, radius, shoulder, position, direction, speed)
    far = max(PERSONAL_DISTANCE, (speed - _SLOW_SPEED) / _SPEED_PER_METRE) + 1e-6  # m, beyond which people cost nothing
    bodies, counts = _predicted_bodies(numbers, state, radius, shoulder, position, speed, far + extent)

    count = len(pairs)
    end_cost, change, bound = np.empty(count), np.empty(count), np.empty(count)
    until = np.full(count, STEPS)  # steps of each trajectory that count
    first = 0
    dx, dy = position[0] - numbers[_GOAL_X], position[1] - numbers[_GOAL_Y]
    reach = numbers[_GOAL_DISTANCE] + speed * _HORIZON
    may_arrive = dx * dx + dy * dy < reach * reach
    for k in range(count):
        v, t = pairs[k, 0], pairs[k, 1]
        end_cost[k], until[k] = _end_cost(numbers, layers, headed, positions, v, t, headings, may_arrive)
        dvx, dvy, domega = velocities[v, X] - last_vx, velocities[v, Y] - last_vy, turns[t] - last_omega
        change[k] = numbers[_CHANGE] * (abs(dvx) + abs(dvy) + 0.5 * abs(domega))
        bound[k] = end_cost[k] - 1e-9 + change[k]  # open ground may cost slightly less than 0 by rounding
        if bound[k] < bound[first]:
            first = k

    # The other terms of the cost are not negative, and floating-point addition is monotone. So the terms computed so
    # far are a lower bound of the cost, and most candidates are ruled out early.
    best, lowest = first, math.inf
    for n in range(-1, count):
        k = first if n < 0 else n
        limit = math.inf if numbers[HAS_NEGATIVE_WEIGHTS] != 0.0 else lowest
        if bound[k] > limit or n == first:
            continue
        v, t = pairs[k, 0], pairs[k, 1]
        covered, contact = _ground_cost(
            numbers, layers, solids.table, near, body, positions, headings, v, t, motions, until[k], before, direction,
            courtesy,
        )  # fmt: skip
        ground = end_cost[k] + covered + contact
        braking = numbers[_CLOSING] * _shortfall(numbers, people, v, t, headings, motions, direction)
        cost = ground + braking + change[k]
        disturbance, crash = 0.0, 0.0
        for step in range(until[k]):
            if cost > limit:
                break
            clearance = _clearance(bodies, counts, discs, positions, headings, step, v, t, far)
            if clearance < far:
                disturbance += _disturbance(numbers, clearance, motions[_SPEED, step, v])
                if crash == 0.0 and clearance < _CONTACT_MARGIN:
                    crash = numbers[_CRASH] * ((STEPS - step) / STEPS)
                cost = ground + (courtesy * disturbance * STEP + (crash + braking)) + change[k]
        if cost < lowest or (cost == lowest and k < best):
            best, lowest = k, cost
    return best


@subroutine
def _path_cost(numbers: Array, layers: Array, x: float, y: float) -> float:
    """Cost of the path from a point to the goal, in metres of open ground."""
    _, nx, ny = layers.shape
    u, v = grid_coordinate(x, numbers[_LOW_X], nx), grid_coordinate(y, numbers[_LOW_Y], ny)
    return interpolated(layers[VALUE], u, v)


@subroutine
def _courtesy(numbers: Array, layers: Array, progress: Array, tick: int, position: Point) -> float:
    """Weight of the comfort of others: less if the robot has been held up for `_IMPATIENCE` seconds."""
    here = _path_cost(numbers, layers, position[0], position[1])
    if progress[0] == math.inf:
        progress[0], progress[1] = here, tick
    # A mean that follows a steady motion lags by speed times time before it is updated, whatever the tick.
    if progress[0] - here > _SLOW_PROGRESS * numbers[_MAX_SPEED] * _PROGRESS_TIME:
        progress[1] = tick
    progress[0] += (here - progress[0]) * min(numbers[_DT] / _PROGRESS_TIME, 1.0)
    overtime = max((tick - progress[1]) * numbers[_DT] - _IMPATIENCE, 0.0)
    return float(1.0 / (1.0 + overtime / _IMPATIENCE))


@subroutine
def _headings(numbers: Array, turns: Array, now: float, direction: Point) -> Array:
    """Unit vectors of the heading for each turn rate, under the drive's limits; (4, STEPS, T), world frame."""
    headings = np.empty((4, STEPS, len(turns)))
    for t in range(len(turns)):
        change = turns[t] - now
        ramp = max(abs(change) / numbers[_TURN_ACCELERATION], 1e-6)  # s to reach the turn rate
        c, s = direction
        for k in range(STEPS):
            # Midpoint rule: turn by half of the step's angle, translate, turn by the other half.
            tc, ts = rotation((now + change * min((k + 0.5) * STEP / ramp, 1.0)) * (STEP / 2))
            c, s = c * tc - s * ts, s * tc + c * ts
            headings[_MIDDLE_X, k, t], headings[_MIDDLE_Y, k, t] = c, s
            c, s = c * tc - s * ts, s * tc + c * ts
            headings[_FINAL_X, k, t], headings[_FINAL_Y, k, t] = c, s
    return headings


@subroutine
def _motions(numbers: Array, velocities: Array, now_vx: float, now_vy: float) -> tuple[Array, float]:
    """Velocities in each step under the drive's limits, (3, STEPS, V), m/s, body frame; and a bound of all speeds."""
    sideways = now_vy if numbers[_IS_HOLONOMIC] != 0.0 else 0.0
    motions, highest = np.empty((3, STEPS, len(velocities))), 0.0
    for v in range(len(velocities)):
        dvx, dvy = velocities[v, X] - now_vx, velocities[v, Y] - sideways
        ramp = max(math.sqrt(dvx * dvx + dvy * dvy) / numbers[_ACCELERATION], 1e-6)  # s to reach the velocity
        for k in range(STEPS):
            fraction = min((k + 0.5) * STEP / ramp, 1.0)
            vx, vy = now_vx + dvx * fraction, sideways + dvy * fraction
            speed = math.sqrt(vx * vx + vy * vy)
            motions[_FORWARD, k, v], motions[_LEFT, k, v], motions[_SPEED, k, v] = vx, vy, speed
            highest = max(highest, speed)
    return motions, highest + 1e-6


@subroutine
def _roll_out(positions: Array, headings: Array, motions: Array, position: Point) -> None:
    """Predict the robot's positions for all pairs of a turn rate and a velocity."""
    _, _, turn_count, count = positions.shape
    for t in range(turn_count):
        for v in range(count):
            positions[X, 0, t, v], positions[Y, 0, t, v] = position
    for k in range(STEPS):
        for t in range(turn_count):
            c, s = headings[_MIDDLE_X, k, t], headings[_MIDDLE_Y, k, t]
            for v in range(count):
                vx, vy = motions[_FORWARD, k, v], motions[_LEFT, k, v]
                positions[X, k + 1, t, v] = positions[X, k, t, v] + (vx * c - vy * s) * STEP
                positions[Y, k + 1, t, v] = positions[Y, k, t, v] + (vx * s + vy * c) * STEP


@subroutine
def _end_cost(
    numbers: Array, layers: Array, headed: Array, positions: Array, v: int, t: int, headings: Array, may_arrive: bool
) -> tuple[float, int]:
    """Cost of the path from the end of a trajectory to the goal, and the number of its steps.

    A trajectory that reaches the goal costs less than nothing: the earlier, the less. Of a robot that is no disc, a
    trajectory ends at its cheapest pose: it may turn by less than it would within the horizon.
    """
    if may_arrive:
        for k in range(STEPS):
            dx, dy = positions[X, k + 1, t, v] - numbers[_GOAL_X], positions[Y, k + 1, t, v] - numbers[_GOAL_Y]
            if dx * dx + dy * dy < numbers[_GOAL_DISTANCE] * numbers[_GOAL_DISTANCE]:
                return (k - STEPS) / STEPS, STEPS
    x, y, distance = positions[X, STEPS, t, v], positions[Y, STEPS, t, v], numbers[_AHEAD]
    if len(headed) > 0:
        best, end = math.inf, STEPS
        for k in range(STEPS):
            u = grid_coordinate(positions[X, k + 1, t, v], numbers[_LOW_X], headed.shape[1])
            w = grid_coordinate(positions[Y, k + 1, t, v], numbers[_LOW_Y], headed.shape[2])
            cost = heading_cost(headed, u, w, headings[_FINAL_X, k, t], headings[_FINAL_Y, k, t]) + _HASTE * (k + 1)
            if cost < best:
                best, end = cost, k + 1
        return best, end
    ahead_x = x + distance * headings[_FINAL_X, STEPS - 1, t]
    ahead_y = y + distance * headings[_FINAL_Y, STEPS - 1, t]
    return 0.5 * _path_cost(numbers, layers, x, y) + 0.5 * _path_cost(numbers, layers, ahead_x, ahead_y), STEPS


@subroutine
def _ground_cost(
    numbers: Array, layers: Array, barriers: Array, nearby: IntArray, body: _Body, positions: Array, headings: Array,
    v: int, t: int, motions: Array, until: int, before: float, direction: Point, courtesy: float,
) -> tuple[float, float]:  # fmt: skip
    """Surcharge of the ground that a trajectory covers, and cost of coming near walls and furniture.

    Courtesy reduces the surcharge of ground where the robot fits, but not of gaps that are too narrow for it.

    A robot may be pushed to a wall, or touch it as it turns: a trajectory that leads it away from there is not blocked.
    """
    _, nx, ny = layers.shape
    covered, earliness, closeness, extent = 0.0, 0.0, 0.0, _extent(body.discs)
    near, has_price = numbers[_ROBOT_RADIUS] + _OBSTACLE_MARGIN, numbers[_OBSTACLE_PRICE] != 0.0
    if has_price:
        near = max(near, numbers[_ROBOT_RADIUS] + numbers[_OBSTACLE_DISTANCE])
    for k in range(until):
        x, y = positions[X, k + 1, t, v], positions[Y, k + 1, t, v]
        i, j = grid_coordinate(x, numbers[_LOW_X], nx), grid_coordinate(y, numbers[_LOW_Y], ny)
        surcharge = interpolated(layers[PRICE], i, j) - 1.0
        surcharge = courtesy * min(surcharge, HIGHEST - 1.0) + max(surcharge - (HIGHEST - 1.0), 0.0)
        covered += surcharge * motions[_SPEED, k, v]
        if earliness > 0.0 and not has_price:
            continue
        # A corner of the grid cell, less than 1.5 cells away, tells whether a barrier can be near.
        is_in_grid = 0.0 < i < nx - 1.001 and 0.0 < j < ny - 1.001
        if is_in_grid and layers[CLEARANCE, int(i), int(j)] > near + extent + 1.5 * CELL:
            continue
        clearance, is_blocked = math.inf, False
        if len(body.core) > 1:
            clearance, is_blocked, before = _tightest(
                body, barriers, nearby, positions, headings, direction, k, v, t, near + extent, _OBSTACLE_MARGIN, before
            )
        else:
            for n in range(len(nearby)):
                clearance = min(clearance, _gap_to(body, barriers, nearby[n], x, y, 1.0, 0.0))
            is_blocked, before = clearance < min(_OBSTACLE_MARGIN, before + _TINY), clearance
        if earliness == 0.0 and is_blocked:
            earliness = (STEPS - k) / STEPS
        if has_price:
            closeness += min(max(1.0 - clearance / numbers[_OBSTACLE_DISTANCE], 0.0), 1.0)
    return covered * STEP, numbers[_BUMP] * earliness + numbers[_OBSTACLE_PRICE] * closeness


@subroutine
def _tightest(
    body: _Body, barriers: Array, nearby: IntArray, positions: Array, headings: Array, direction: Point, k: int, v: int,
    t: int, near: float, margin: float, before: float,
) -> tuple[float, bool, float]:  # fmt: skip
    """Gap between a robot that is no disc and barriers in a step: its corners can pass their ends in between.

    Args:
        body, barriers, nearby, positions, headings, direction: see `_cheapest`.
        k, v, t: step, velocity and turn rate.
        near: distance of its centre from barriers that count, m.
        margin: m, nearer than this the robot is blocked, unless it moves away.
        before: gap before the step, m.

    Returns:
        Least gap, m; whether the robot is blocked; gap after the step, m.
    """
    c, s = direction if k == 0 else (headings[_FINAL_X, k - 1, t], headings[_FINAL_Y, k - 1, t])
    end_c, end_s = headings[_FINAL_X, k, t], headings[_FINAL_Y, k, t]
    least, is_blocked = math.inf, False
    for part in range(1, _PARTS + 1):
        share = part / _PARTS
        x = positions[X, k, t, v] + share * (positions[X, k + 1, t, v] - positions[X, k, t, v])
        y = positions[Y, k, t, v] + share * (positions[Y, k + 1, t, v] - positions[Y, k, t, v])
        at_c, at_s = c + share * (end_c - c), s + share * (end_s - s)
        size, gap_here = math.sqrt(at_c * at_c + at_s * at_s), math.inf
        for n in range(len(nearby)):
            if gap(barriers, nearby[n], x, y) < near:
                gap_here = min(gap_here, _gap_to(body, barriers, nearby[n], x, y, at_c / size, at_s / size))
        is_blocked |= gap_here < min(margin, before - _TINY)
        least, before = min(least, gap_here), gap_here
    return least, is_blocked, before


@subroutine
def _gap_to(body: _Body, barriers: Array, k: int, x: float, y: float, c: float, s: float) -> float:
    """Gap between the robot at a pose, m, cosine and sine, and barrier k; m."""
    if len(body.core) == 1:  # a disc: its heading has no effect
        return float(gap(barriers, k, x, y) - body.rounding)
    return gap_to_barrier(body.core, body.rounding, x, y, c, s, body.corners, body.found, barriers, k)


@subroutine
def _extent(discs: Array) -> float:
    """Largest distance of a disc's centre from the robot's, m."""
    largest = 0.0
    for d in range(len(discs)):
        largest = max(largest, math.sqrt(discs[d, X] * discs[d, X] + discs[d, Y] * discs[d, Y]))
    return largest


@subroutine
def _disc(discs: Array, d: int, x: float, y: float, c: float, s: float) -> Point:
    """Centre of disc d of a robot at a pose: position, m, cosine and sine."""
    ahead, left = discs[d, X], discs[d, Y]
    return x + ahead * c - left * s, y + ahead * s + left * c


@subroutine
def _nearby_people(
    numbers: Array, discs: Array, state: Array, radius: Array, shoulder: Array, position: Point, direction: Point,
    speed: float,
) -> Array:  # fmt: skip
    """The people for which the robot might have to brake.

    Returns:
        (n, 4): unit vector to the nearest point of the person, gap, and the person's speed towards the robot; m, m/s.
    """
    people, count = np.empty((len(state), 4)), 0
    for j in range(len(state)):
        distance, nx, ny = math.inf, 1.0, 0.0
        for d in range(len(discs)):
            x, y = _disc(discs, d, position[0], position[1], direction[0], direction[1])
            dx, dy = state[j, X] - x, state[j, Y] - y
            dx, dy = to_shoulder_line(dx, dy, state[j, BODY_X], state[j, BODY_Y], shoulder[j])
            size = max(math.sqrt(dx * dx + dy * dy), 1e-6)
            if size < distance:
                distance, nx, ny = size, dx / size, dy / size
        space = distance - radius[j] - numbers[_ROBOT_RADIUS]
        approach = max(-(state[j, VX] * nx + state[j, VY] * ny), 0.0)
        needed = _stopping_distance(numbers, speed, approach) + _CONTACT_MARGIN + 1e-6
        if space < max(needed, _NEAR_CONTACT):
            people[count, 0], people[count, 1], people[count, 2], people[count, 3] = nx, ny, space, approach
            count += 1
    return people[:count]


@subroutine
def _stopping_distance(numbers: Array, speed: float, approach: float) -> float:
    """Distance by which robot and person come nearer until the robot has stopped, m."""
    braking_time = speed / numbers[_ACCELERATION] + _REACTION_TIME
    return float(speed * (braking_time + _REACTION_TIME) * 0.5 + approach * braking_time)


@subroutine
def _shortfall(
    numbers: Array, people: Array, v: int, t: int, headings: Array, motions: Array, direction: Point
) -> float:
    """Distance by which the robot would fail to stop before people if it braked after this tick, m.

    Nearer than `_NEAR_CONTACT`, any approach is penalised.
    """
    # Velocities at the start, before the robot has turned, and in the first two steps.
    c, s = direction
    ax, ay = _to_world(motions, 0, v, c, s)
    bx, by = _to_world(motions, 0, v, headings[_MIDDLE_X, 0, t], headings[_MIDDLE_Y, 0, t])
    cx, cy = _to_world(motions, 1, v, headings[_MIDDLE_X, 1, t], headings[_MIDDLE_Y, 1, t])
    total = 0.0
    for j in range(len(people)):
        nx, ny, space, approach = people[j, 0], people[j, 1], people[j, 2], people[j, 3]
        speed = max(nx * ax + ny * ay, nx * bx + ny * by, nx * cx + ny * cy, 0.0)
        shortfall = 0.0
        if speed > 0.01:
            shortfall = max(_stopping_distance(numbers, speed, approach) - space + _CONTACT_MARGIN, 0.0)
        if space < _NEAR_CONTACT:
            shortfall += _NEAR_CONTACT_PRICE * speed
        total += shortfall
    return total


@subroutine
def _to_world(motions: Array, step: int, v: int, c: float, s: float) -> Point:
    """The velocity in a step, turned from the body frame to the world frame, m/s."""
    vx, vy = motions[_FORWARD, step, v], motions[_LEFT, step, v]
    return vx * c - vy * s, vx * s + vy * c


@subroutine
def _predicted_bodies(
    numbers: Array, state: Array, radius: Array, shoulder: Array, position: Point, speed: float, far: float
) -> tuple[Array, IntArray]:
    """The people that a trajectory can come near to, where they are in each step if they keep velocity and heading.

    Returns:
        (STEPS, N, 6): position, m; distance of the robot's centre from the shoulder line at contact, m; heading, unit
        vector; `Humans.shoulder`, m; and (STEPS,), number of rows in use.
    """
    bodies, counts = np.empty((STEPS, len(state), 6)), np.zeros(STEPS, dtype=np.int64)
    for k in range(STEPS):
        time = (k + 1.0) * STEP
        for j in range(len(state)):
            x, y = state[j, X] + state[j, VX] * time, state[j, Y] + state[j, VY] * time
            touching = radius[j] + numbers[_ROBOT_RADIUS]
            dx, dy, reach = x - position[0], y - position[1], speed * time + far + touching + abs(shoulder[j])
            if dx * dx + dy * dy < reach * reach:
                n = counts[k]
                bodies[k, n, 0], bodies[k, n, 1], bodies[k, n, 2] = x, y, touching
                bodies[k, n, 3], bodies[k, n, 4], bodies[k, n, 5] = state[j, BODY_X], state[j, BODY_Y], shoulder[j]
                counts[k] += 1
    return bodies, counts


@subroutine
def _clearance(
    bodies: Array, counts: IntArray, discs: Array, positions: Array, headings: Array, step: int, v: int, t: int,
    far: float,
) -> float:  # fmt: skip
    """Clearance from the nearest person in a step of a trajectory, at most `far`; m."""
    centre_x, centre_y, nearest = positions[X, step + 1, t, v], positions[Y, step + 1, t, v], far
    for d in range(len(discs)):
        c, s = headings[_FINAL_X, step, t], headings[_FINAL_Y, step, t]
        x, y = _disc(discs, d, centre_x, centre_y, c, s)
        for n in range(counts[step]):
            dx, dy, touching = bodies[step, n, 0] - x, bodies[step, n, 1] - y, bodies[step, n, 2]
            dx, dy = to_shoulder_line(dx, dy, bodies[step, n, 3], bodies[step, n, 4], bodies[step, n, 5])
            square, reach = dx * dx + dy * dy, nearest + touching
            if square < reach * reach * (1.0 + 1e-9):  # a root for the nearest ones only
                nearest = min(nearest, math.sqrt(square) - touching)
    return nearest


@subroutine
def _disturbance(numbers: Array, clearance: float, speed: float) -> float:
    """Cost per second of coming near people and of haste near them."""
    clearance = max(clearance, 0.0)
    cost = numbers[_INTIMATE] * max(1.0 - clearance / INTIMATE_DISTANCE, 0.0)
    cost += numbers[_PERSONAL] * max(1.0 - clearance / PERSONAL_DISTANCE, 0.0)
    haste = speed - _SLOW_SPEED - _SPEED_PER_METRE * clearance  # m/s above the proper speed
    return float(cost + numbers[_HURRY] * max(haste, 0.0))
