"""`social-planner`, the expert: samples short trajectories, predicts pedestrians and minimises a social cost."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass

import numpy as np

from ...core.entities import TALKING, WALKING_TOGETHER, Goal, Robot
from ...core.geometry import Barriers, Point, Twist, inside_polygon
from ...core.humans import VX, VY, X, Y
from ...core.portable_math import Array, BoolArray, rotation
from ...core.proxemics import INTIMATE_DISTANCE, PERSONAL_DISTANCE
from ...core.scene import Scene
from ...core.snapshot import Snapshot
from .base import Controller

CELL = 0.1  # m
BLOCKED = 40.0  # price per metre where the robot does not fit; 1 is open ground
_MAXIMUM_SWEEPS = 2000


class CostField:
    """The cost of the cheapest path to the goal, on a grid over the room.

    A metre of open ground costs 1. The price per metre is higher near walls and furniture, in the intimate and personal
    space of standing people and between people who interact; it is `BLOCKED` where the robot does not fit.

    Args:
        scene: gives the room, furniture, standing people, interactions, goal and the robot's radius.

    Attributes:
        price: (NX, NY), cost per metre of each cell.
        value: (NX, NY), cost of the cheapest path from each cell to the goal, in metres of open ground.

    Source: eikonal equation |∇D| = price, first-order upwind differences (Sethian, PNAS 93 (1996) 1591), solved by
    Jacobi sweeps until nothing changes.
    """

    def __init__(self, scene: Scene) -> None:
        low, high = scene.outline.min(axis=0) - CELL, scene.outline.max(axis=0) + CELL
        self._low = low
        nx, ny = (int(n) + 1 for n in (high - low) / CELL)
        x, y = low[0] + CELL * np.arange(nx), low[1] + CELL * np.arange(ny)
        points = np.stack((np.repeat(x, ny), np.tile(y, nx)), axis=1)
        self.price = _price(scene, points).reshape(nx, ny)
        self.value = self._solve(scene.goal.position)

    def at(self, x: Array, y: Array) -> Array:
        """Cost of the path from points (m, any shape) to the goal, in metres of open ground."""
        return self._interpolate(self.value, x, y)

    def surcharge(self, x: Array, y: Array) -> Array:
        """Price per metre at points (m, any shape) in excess of open ground."""
        return self._interpolate(self.price, x, y) - 1.0

    def _interpolate(self, values: Array, x: Array, y: Array) -> Array:
        """Bilinear interpolation on the grid."""
        nx, ny = values.shape
        u = np.minimum(np.maximum((x - self._low[0]) / CELL, 0.0), nx - 1.001)
        v = np.minimum(np.maximum((y - self._low[1]) / CELL, 0.0), ny - 1.001)
        i, j = u.astype(np.intp), v.astype(np.intp)
        u, v = u - i, v - j
        flat, base = values.ravel(), i * ny + j
        near = flat[base] * (1.0 - v) + flat[base + 1] * v
        far = flat[base + ny] * (1.0 - v) + flat[base + ny + 1] * v
        interpolated: Array = near * (1.0 - u) + far * u
        return interpolated

    def _solve(self, goal: Point) -> Array:
        nx, ny = self.price.shape
        step = self.price * CELL
        value = np.full((nx + 2, ny + 2), 1e6)  # with a margin, so that each cell has four neighbours
        i, j = (int((goal[k] - self._low[k]) / CELL + 0.5) + 1 for k in (0, 1))
        inner = value[1:-1, 1:-1]
        for _ in range(_MAXIMUM_SWEEPS):
            value[i, j] = 0.0
            a = np.minimum(value[:-2, 1:-1], value[2:, 1:-1])
            b = np.minimum(value[1:-1, :-2], value[1:-1, 2:])
            difference = a - b
            both = (a + b + np.sqrt(np.maximum(2.0 * step * step - difference * difference, 0.0))) * 0.5
            # A front that comes along one axis only takes the one-sided difference.
            updated = np.where(np.abs(difference) >= step, np.minimum(a, b) + step, both)
            updated = np.minimum(updated, inner)
            if np.array_equal(updated, inner):
                break
            inner[:] = updated
        value[i, j] = 0.0
        return inner.copy()


def _price(scene: Scene, points: Array) -> Array:
    """Price per metre at points; (P, 2) to (P,)."""
    radius = scene.robot.radius
    price = np.ones(len(points))
    if len(scene.barriers):
        gap = scene.barriers.gaps(points).min(axis=0) - radius
        price += 2.0 * np.maximum(1.0 - np.maximum(gap, 0.0) / 0.3, 0.0)
        price = np.where(gap < -0.01, BLOCKED, price)
    price = np.where(inside_polygon(points, scene.outline), price, BLOCKED)
    if len(scene.standing_humans):
        gaps = scene.standing_humans.gaps(points) - radius
        price += (4.0 * np.maximum(1.0 - np.maximum(gaps, 0.0) / INTIMATE_DISTANCE, 0.0)).max(axis=0)
        price += (1.0 * np.maximum(1.0 - np.maximum(gaps, 0.0) / PERSONAL_DISTANCE, 0.0)).max(axis=0)
        price = np.where(gaps.min(axis=0) < 0.02, BLOCKED, price)
    between = interaction_spaces(scene)
    if len(between):
        price += np.where(between.gaps(points).min(axis=0) < radius, 4.0, 0.0)
    return np.minimum(price, BLOCKED)


def interaction_spaces(scene: Scene) -> Barriers:
    """Lines of attention between standing people, and between people and objects, that others should not cross."""
    position = {h.id: h.pose.position for h in scene.humans} | {f.id: f.pose.position for f in scene.furniture}
    interactions = [i for i in scene.interactions if i.relation != WALKING_TOGETHER]
    return Barriers.of(
        (position[i.src], position[i.dst], 0.15 if i.relation == TALKING else 0.05) for i in interactions
    )


@dataclass(frozen=True)
class Trajectories:
    """K predicted trajectories of the robot, S steps each.

    Attributes:
        x, y: (S, K), m, world frame.
        ahead: (2, S, K), unit vectors of the robot's direction.
        vx, vy: (S, K), m/s, world frame.
        speed: (S, K), m/s.
        onset: (K,) and (K,), m/s, world frame: velocity of the first step, before the robot has turned.
    """

    x: Array
    y: Array
    ahead: Array
    vx: Array
    vy: Array
    speed: Array
    onset: tuple[Array, Array]


def roll_out(twists: Array, snapshot: Snapshot, *, horizon: float, step: float) -> Trajectories:
    """Predict the robot's trajectory for each commanded twist, under the drive's acceleration limits.

    Args:
        twists: (K, 3), body frame: m/s, m/s, rad/s.
        snapshot: the initial state.
        horizon: duration, s.
        step: time step, s.
    """
    robot = snapshot.robot
    limits, count, steps = robot.body.limits, len(twists), int(horizon / step + 0.5)
    now = robot.executed
    sideways = now.vy if robot.body.kinematics == "holonomic" else 0.0
    dvx, dvy, domega = twists[:, 0] - now.vx, twists[:, 1] - sideways, twists[:, 2] - now.omega
    ramp = np.maximum(np.sqrt(dvx * dvx + dvy * dvy) / limits.acceleration, 1e-6)  # s to reach the velocity
    turn_ramp = np.maximum(np.abs(domega) / limits.turn_acceleration, 1e-6)  # s to reach the turn rate
    rows = np.empty((7, steps, count))
    x, y = np.full(count, robot.position[0]), np.full(count, robot.position[1])
    c, s = np.full(count, robot.direction[0]), np.full(count, robot.direction[1])
    for k in range(steps):
        t = (k + 0.5) * step
        fraction, turn_fraction = np.minimum(t / ramp, 1.0), np.minimum(t / turn_ramp, 1.0)
        vx, vy = now.vx + dvx * fraction, sideways + dvy * fraction
        if k == 0:
            onset = vx * c - vy * s, vx * s + vy * c
        # Midpoint rule: turn by half of the step's angle, translate, turn by the other half.
        tc, ts = rotation((now.omega + domega * turn_fraction) * (step / 2))
        c, s = c * tc - s * ts, s * tc + c * ts
        wx, wy = vx * c - vy * s, vx * s + vy * c
        x, y = x + wx * step, y + wy * step
        c, s = c * tc - s * ts, s * tc + c * ts
        rows[:, k] = x, y, c, s, wx, wy, np.sqrt(vx * vx + vy * vy)
    return Trajectories(rows[0], rows[1], rows[2:4], rows[4], rows[5], rows[6], onset)


def candidate_twists(robot: Robot) -> Array:
    """The twists to try, (K, 3), body frame: a grid over the drive's limits."""
    limits = robot.limits
    ahead = [-limits.back * 0.6, 0.0, *(limits.ahead * fraction for fraction in (0.15, 0.3, 0.5, 0.75, 1.0))]
    sideways = [0.0]
    if robot.kinematics == "holonomic":
        sideways = [-limits.sideways * 0.8, 0.0, limits.sideways * 0.8]
    turns = [limits.turn * fraction for fraction in (-1.0, -0.5, -0.15, 0.0, 0.15, 0.5, 1.0)]
    return np.array([(v, w, o) for v in ahead for w in sideways for o in turns], dtype=float)


HORIZON, STEP = 2.4, 0.2  # s, duration and time step of the prediction
OBSTACLE_MARGIN = 0.02  # m to walls and furniture, below which a trajectory counts as blocked
SLOW_SPEED, SPEED_PER_METRE = 0.2, 0.6  # m/s at contact and 1/s: proper speed near people grows with the clearance
CONTACT_MARGIN = 0.06  # m, predicted clearance below which a contact is assumed
NEAR_CONTACT, NEAR_CONTACT_PRICE = 0.04, 10.0  # m; below this clearance each m/s towards a person counts as 10 m short
REACTION_TIME = 0.15  # s before braking takes effect
IMPATIENCE = 5.0  # s without progress, after which the costs of disturbing people decrease


@dataclass(frozen=True, slots=True)
class Weights:
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


class SocialPlanner(Controller):
    """Drives to the goal with regard for people's comfort.

    In each tick, some hundred twists are rolled out under the drive's limits and priced against the room and against
    people who keep their velocities; the cheapest is commanded.

    Args:
        weights: the cost weights; None: the default ones.

    Source: the dynamic window (Fox, Burgard & Thrun, IEEE Robot. Autom. Mag. 4 (1997) 23) with a navigation function
    as its goal term (Brock & Khatib, ICRA 1999).
    """

    version = "1"

    def __init__(self, weights: Weights | None = None) -> None:
        self._weights = weights or Weights()

    def settings(self) -> dict[str, float]:
        return asdict(self._weights)

    def reset(self, scene: Scene) -> None:
        self._field = CostField(scene)
        self._twists = candidate_twists(scene.robot)
        self._best_cost, self._best_tick = math.inf, 0  # of the path to the goal
        self._last = Twist()

    def act(self, snapshot: Snapshot) -> Twist:
        last = np.array([[self._last.vx, self._last.vy, self._last.omega]])
        twists = np.concatenate((self._twists, last))
        trajectories = roll_out(twists, snapshot, horizon=HORIZON, step=STEP)
        courtesy = 1.0 / (1.0 + self._overtime(snapshot) / IMPATIENCE)
        cost = self._path_cost(trajectories, snapshot.goal, courtesy) + self._obstacle_cost(trajectories, snapshot)
        if len(snapshot.humans):
            cost = cost + self._human_cost(trajectories, snapshot, courtesy)
        change = np.abs(twists - last)
        cost = cost + self._weights.change * (change[:, 0] + change[:, 1] + 0.5 * change[:, 2])
        vx, vy, omega = twists[int(np.argmin(cost))].tolist()
        self._last = Twist(vx, vy, omega)
        return self._last

    def command_overridden(self, twist: Twist) -> None:
        self._last = twist

    def _overtime(self, snapshot: Snapshot) -> float:
        """Time since the robot last came nearer to the goal, in excess of `IMPATIENCE`, s."""
        here = float(self._field.at(*(np.array([v]) for v in snapshot.robot.position))[0])
        if here < self._best_cost - 0.2:
            self._best_cost, self._best_tick = here, snapshot.tick
        return max((snapshot.tick - self._best_tick) * snapshot.dt - IMPATIENCE, 0.0)

    def _path_cost(self, trajectories: Trajectories, goal: Goal, courtesy: float) -> Array:
        """(K,), surcharge of the ground covered by each trajectory, plus the cost of the path from its end."""
        field, distance = self._field, self._weights.ahead
        x, y = trajectories.x[-1], trajectories.y[-1]
        ahead = field.at(x + distance * trajectories.ahead[0, -1], y + distance * trajectories.ahead[1, -1])
        remaining = 0.5 * field.at(x, y) + 0.5 * ahead
        dx, dy = trajectories.x - goal.x, trajectories.y - goal.y
        arrival = _earliness(dx * dx + dy * dy < goal.distance * goal.distance)
        surcharge = field.surcharge(trajectories.x, trajectories.y)
        covered = np.add.reduce(surcharge * trajectories.speed, axis=0) * STEP
        # A trajectory that reaches the goal costs less than nothing: the earlier, the less.
        cost: Array = np.where(arrival > 0.0, -arrival, remaining) + courtesy * covered
        return cost

    def _obstacle_cost(self, trajectories: Trajectories, snapshot: Snapshot) -> Array:
        """(K,), cost of contacts with walls and furniture."""
        distance = self._obstacle_distance(trajectories, snapshot)
        cost: Array = self._weights.bump * _earliness(distance < snapshot.robot.radius + OBSTACLE_MARGIN)
        return cost

    def _obstacle_distance(self, trajectories: Trajectories, snapshot: Snapshot) -> Array:
        """(S, K), m, from the robot's centre on its trajectories to the nearest wall or piece of furniture."""
        points = np.stack((trajectories.x.ravel(), trajectories.y.ravel()), axis=1)
        nearest: Array = np.minimum.reduce(self._nearby_barriers(snapshot).gaps(points), axis=0, initial=np.inf)
        return nearest.reshape(trajectories.x.shape)

    def _nearby_barriers(self, snapshot: Snapshot) -> Barriers:
        """The walls and pieces of furniture that the robot can reach within the horizon."""
        barriers, robot = snapshot.scene.barriers, snapshot.robot
        radius = robot.body.limits.ahead * HORIZON + robot.radius + 0.1
        return barriers.subset(barriers.gaps(np.array([robot.position]))[:, 0] < radius)

    def _human_cost(self, trajectories: Trajectories, snapshot: Snapshot, courtesy: float) -> Array:
        """(K,), cost of coming near predicted people, of haste near them, and of predicted contacts."""
        weights, nearest = self._weights, np.minimum.reduce(self._human_clearance(trajectories, snapshot), axis=0)
        clearance = np.maximum(nearest, 0.0)
        disturbance = weights.intimate * np.maximum(1.0 - clearance / INTIMATE_DISTANCE, 0.0)
        disturbance += weights.personal * np.maximum(1.0 - clearance / PERSONAL_DISTANCE, 0.0)
        haste = trajectories.speed - SLOW_SPEED - SPEED_PER_METRE * clearance  # m/s above the proper speed
        disturbance += weights.hurry * np.maximum(haste, 0.0)
        crash = weights.crash * _earliness(nearest < CONTACT_MARGIN)
        crash = crash + weights.closing * self._stopping_shortfall(trajectories, snapshot)
        cost: Array = courtesy * np.add.reduce(disturbance, axis=0) * STEP + crash
        return cost

    def _human_clearance(self, trajectories: Trajectories, snapshot: Snapshot) -> Array:
        """(N, S, K), m, between the robot on its trajectories and people who keep their velocities."""
        humans = snapshot.humans
        t = (np.arange(len(trajectories.x)) + 1.0) * STEP
        hx, hy = (humans.state[:, x, None] + humans.state[:, v, None] * t for x, v in ((X, VX), (Y, VY)))
        dx, dy = trajectories.x - hx[:, :, None], trajectories.y - hy[:, :, None]
        radii = (humans.radius + snapshot.robot.radius)[:, None, None]
        clearance: Array = np.sqrt(dx * dx + dy * dy) - radii
        return clearance

    def _stopping_shortfall(self, trajectories: Trajectories, snapshot: Snapshot) -> Array:
        """(K,), m by which the robot would fail to stop before people if it braked after this tick.

        Nearer than `NEAR_CONTACT`, any approach is penalised.
        """
        humans, robot = snapshot.humans, snapshot.robot
        dx, dy = humans.state[:, X] - robot.position[0], humans.state[:, Y] - robot.position[1]
        distance = np.maximum(np.sqrt(dx * dx + dy * dy), 1e-6)
        nx, ny = dx / distance, dy / distance
        gap = distance - humans.radius - robot.radius
        human_speed = np.maximum(-(humans.state[:, VX] * nx + humans.state[:, VY] * ny), 0.0)  # towards the robot
        vx, vy = trajectories.vx, trajectories.vy
        velocities = (trajectories.onset, (vx[0], vy[0]), (vx[1], vy[1]))
        robot_speed = np.maximum.reduce([nx[:, None] * vx + ny[:, None] * vy for vx, vy in velocities])  # (N, K)
        robot_speed = np.maximum(robot_speed, 0.0)
        braking_time = robot_speed / robot.body.limits.acceleration + REACTION_TIME
        needed = robot_speed * (braking_time + REACTION_TIME) * 0.5 + human_speed[:, None] * braking_time
        shortfall = np.where(robot_speed > 0.01, np.maximum(needed - gap[:, None] + CONTACT_MARGIN, 0.0), 0.0)
        shortfall += np.where((gap < NEAR_CONTACT)[:, None], NEAR_CONTACT_PRICE * robot_speed, 0.0)
        total: Array = np.add.reduce(shortfall, axis=0)
        return total


def _earliness(hit: BoolArray) -> Array:
    """(S, K) to (K,): 1 if the first True is in the first step, less for later steps, 0 without any True."""
    steps = len(hit)
    weight = ((steps - np.arange(steps)) / steps)[:, None]
    earliest: Array = np.maximum.reduce(np.where(hit, weight, 0.0), axis=0)
    return earliest
