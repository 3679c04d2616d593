"""`social-planner`, the expert: samples short twists, predicts pedestrians and minimises a social cost."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from ...core.entities import TALKING, WALKING_TOGETHER, Goal, Robot
from ...core.geometry import Barriers, Twist, inside_polygon
from ...core.portable_math import Array, rotation
from ...core.proxemics import INTIMATE_DISTANCE, PERSONAL_DISTANCE
from ...core.scene import Scene
from ...core.snapshot import Snapshot
from .base import Controller

CELL = 0.1  # m
BLOCKED = 40.0  # times the price of open ground
_SWEEPS = 2000


class CostField:
    """The price of the cheapest way to the goal, on a grid over the room.

    The price of ground is 1 a metre; more close to walls and furniture, in standing people's personal space and
    between those who interact; and out of reach where the robot does not fit.

    Args:
        scene: room, furniture, standing people, interactions, goal, robot's radius.

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
        self.value = self._solved(scene.goal.position)

    def at(self, x: Array, y: Array) -> Array:
        """Price of the way to the goal from points, m of open ground; any shape."""
        return self._between_cells(self.value, x, y)

    def surcharge(self, x: Array, y: Array) -> Array:
        """What a metre costs at points beyond a metre of open ground; any shape."""
        return self._between_cells(self.price, x, y) - 1.0

    def _between_cells(self, values: Array, x: Array, y: Array) -> Array:
        """Bilinear interpolation on the grid."""
        nx, ny = values.shape
        u = np.minimum(np.maximum((x - self._low[0]) / CELL, 0.0), nx - 1.001)
        v = np.minimum(np.maximum((y - self._low[1]) / CELL, 0.0), ny - 1.001)
        i, j = u.astype(np.intp), v.astype(np.intp)
        u, v = u - i, v - j
        flat, base = values.ravel(), i * ny + j
        near = flat[base] * (1.0 - v) + flat[base + 1] * v
        far = flat[base + ny] * (1.0 - v) + flat[base + ny + 1] * v
        values_there: Array = near * (1.0 - u) + far * u
        return values_there

    def _solved(self, goal: tuple[float, float]) -> Array:
        nx, ny = self.price.shape
        step = self.price * CELL
        value = np.full((nx + 2, ny + 2), 1e6)  # with a rim, so that each cell has four neighbours
        i, j = (int((goal[k] - self._low[k]) / CELL + 0.5) + 1 for k in (0, 1))
        inner = value[1:-1, 1:-1]
        for _ in range(_SWEEPS):
            value[i, j] = 0.0
            a = np.minimum(value[:-2, 1:-1], value[2:, 1:-1])
            b = np.minimum(value[1:-1, :-2], value[1:-1, 2:])
            apart = a - b
            both = (a + b + np.sqrt(np.maximum(2.0 * step * step - apart * apart, 0.0))) * 0.5
            fresh = np.where(np.abs(apart) >= step, np.minimum(a, b) + step, both)
            fresh = np.minimum(fresh, inner)
            if np.array_equal(fresh, inner):
                break
            inner[:] = fresh
        value[i, j] = 0.0
        return inner.copy()


def _price(scene: Scene, points: Array) -> Array:
    """(P,), price of a metre at each point."""
    radius = scene.robot.radius
    price = np.ones(len(points))
    if len(scene.barriers):
        gap = scene.barriers.gaps(points).min(axis=0) - radius
        price += 2.0 * np.maximum(1.0 - np.maximum(gap, 0.0) / 0.3, 0.0)
        price = np.where(gap < -0.01, BLOCKED, price)
    price = np.where(inside_polygon(points, scene.outline), price, BLOCKED)
    if len(scene.standing):
        gaps = scene.standing.gaps(points) - radius
        price += (4.0 * np.maximum(1.0 - np.maximum(gaps, 0.0) / INTIMATE_DISTANCE, 0.0)).max(axis=0)
        price += (1.0 * np.maximum(1.0 - np.maximum(gaps, 0.0) / PERSONAL_DISTANCE, 0.0)).max(axis=0)
        price = np.where(gaps.min(axis=0) < 0.02, BLOCKED, price)
    between = interaction_spaces(scene)
    if len(between):
        price += np.where(between.gaps(points).min(axis=0) < radius, 4.0, 0.0)
    return np.minimum(price, BLOCKED)


def interaction_spaces(scene: Scene) -> Barriers:
    """The lines of attention between standing people, and between people and things, that nobody should cut."""
    place = {h.id: h.pose.position for h in scene.humans} | {f.id: f.pose.position for f in scene.furniture}
    ties = [tie for tie in scene.interactions if tie.relation != WALKING_TOGETHER]
    return Barriers.of((place[t.src], place[t.dst], 0.15 if t.relation == TALKING else 0.05) for t in ties)


@dataclass(frozen=True)
class Ways:
    """K ways of S steps.

    Attributes:
        x, y: (S, K), m, world frame.
        ahead: (2, S, K), unit vectors of the robot's heading.
        vx, vy: (S, K), m/s, world frame.
        speed: (S, K), m/s.
        onset: (K,) and (K,), m/s, world frame: the first step's velocity while the robot still has its present heading.
    """

    x: Array
    y: Array
    ahead: Array
    vx: Array
    vy: Array
    speed: Array
    onset: tuple[Array, Array]


def rolled_out(twists: Array, snapshot: Snapshot, *, horizon: float, step: float) -> Ways:
    """Follow each twist from where the robot is and what its drive does.

    Args:
        twists: (K, 3), body frame: m/s, m/s, rad/s.
        snapshot: now.
        horizon: s.
        step: s.
    """
    robot = snapshot.robot
    limits, count, steps = robot.body.limits, len(twists), int(horizon / step + 0.5)
    now = robot.executed
    sideways = now.vy if robot.body.kinematics == "holonomic" else 0.0
    dvx, dvy, domega = twists[:, 0] - now.vx, twists[:, 1] - sideways, twists[:, 2] - now.omega
    ramp = np.maximum(np.sqrt(dvx * dvx + dvy * dvy) / limits.acceleration, 1e-6)  # s to get there
    turn_ramp = np.maximum(np.abs(domega) / limits.turn_acceleration, 1e-6)
    rows = np.empty((7, steps, count))
    x, y = np.full(count, robot.position[0]), np.full(count, robot.position[1])
    c, s = np.full(count, robot.direction[0]), np.full(count, robot.direction[1])
    for k in range(steps):
        t = (k + 0.5) * step
        part, turned = np.minimum(t / ramp, 1.0), np.minimum(t / turn_ramp, 1.0)
        vx, vy = now.vx + dvx * part, sideways + dvy * part
        if k == 0:
            onset = vx * c - vy * s, vx * s + vy * c
        tc, ts = rotation((now.omega + domega * turned) * (step / 2))
        c, s = c * tc - s * ts, s * tc + c * ts
        wx, wy = vx * c - vy * s, vx * s + vy * c
        x, y = x + wx * step, y + wy * step
        c, s = c * tc - s * ts, s * tc + c * ts
        rows[:, k] = x, y, c, s, wx, wy, np.sqrt(vx * vx + vy * vy)
    return Ways(rows[0], rows[1], rows[2:4], rows[4], rows[5], rows[6], onset)


def candidates(robot: Robot) -> Array:
    """Twists worth trying, (K, 3): a grid over what the drive can do."""
    limits = robot.limits
    ahead = [-limits.back * 0.6, 0.0, *(limits.ahead * part for part in (0.15, 0.3, 0.5, 0.75, 1.0))]
    sideways = [0.0]
    if robot.kinematics == "holonomic":
        sideways = [-limits.sideways * 0.8, 0.0, limits.sideways * 0.8]
    turns = [limits.turn * part for part in (-1.0, -0.5, -0.15, 0.0, 0.15, 0.5, 1.0)]
    return np.array([(v, w, o) for v in ahead for w in sideways for o in turns], dtype=float)


def twist_of(row: Array) -> Twist:
    """A row of candidates as a twist."""
    vx, vy, omega = row.tolist()
    return Twist(vx, vy, omega)


HORIZON, STEP = 2.4, 0.2  # s, how far and how fine the prediction is
SKIN = 0.02  # m to walls and furniture, below which a way counts as blocked
SLOW, SLOWER_BY_THE_METRE = 0.2, 0.6  # m/s and 1/s: proper speed near people, at the skin and by the gap
MARGIN = 0.06  # m below which a predicted gap counts as a contact
TOUCH, TOUCHING = 0.04, 10.0  # m, gap below which any m/s towards someone counts as so many metres too far
REACTION = 0.15  # s before a brake takes hold
IMPATIENCE = 5.0  # s without getting nearer after which manners begin to yield


@dataclass(frozen=True, slots=True)
class Weights:
    """What each concern costs, beside 1 for a metre of open ground still to go."""

    ahead: float = 0.4  # m, how far before the robot the price of the way is read as well
    intimate: float = 2.5  # a second at the skin of someone; none at 0.45 m
    personal: float = 0.4  # the same, none at 1.2 m
    hurry: float = 2.0  # a second, for each m/s beyond what is proper near people
    crash: float = 20.0  # a predicted contact with a person, the more the sooner
    bump: float = 20.0  # the same with a wall or a thing
    closing: float = 100.0  # a metre by which the robot could not stop before a person
    change: float = 0.2  # a m/s or half a rad/s of change of the command


class SocialPlanner(Controller):
    """Drives to the goal as people would like it to.

    Each tick some hundred twists are rolled out under the drive's limits, compared with walls and with people who go
    on as they go, and priced; the cheapest is asked for.

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
        self._twists = candidates(scene.robot)
        self._nearest, self._since = math.inf, 0
        self._last = Twist()

    def act(self, snapshot: Snapshot) -> Twist:
        last = np.array([[self._last.vx, self._last.vy, self._last.omega]])
        twists = np.concatenate((self._twists, last))
        ways = rolled_out(twists, snapshot, horizon=HORIZON, step=STEP)
        manners = 1.0 / (1.0 + self._waiting(snapshot) / IMPATIENCE)
        cost = self._way_to_go(ways, snapshot.goal, manners) + self._bumps(ways, snapshot)
        if len(snapshot.humans):
            cost = cost + self._people(ways, snapshot, manners)
        change = np.abs(twists - last)
        cost = cost + self._weights.change * (change[:, 0] + change[:, 1] + 0.5 * change[:, 2])
        self._last = twist_of(twists[int(np.argmin(cost))])
        return self._last

    def command_overridden(self, twist: Twist) -> None:
        self._last = twist

    def _waiting(self, snapshot: Snapshot) -> float:
        """Seconds beyond what is usual since the robot last got nearer to the goal."""
        here = float(self._field.at(*(np.array([v]) for v in snapshot.robot.position))[0])
        if here < self._nearest - 0.2:
            self._nearest, self._since = here, snapshot.tick
        return max((snapshot.tick - self._since) * snapshot.dt - IMPATIENCE, 0.0)

    def _way_to_go(self, ways: Ways, goal: Goal, manners: float) -> Array:
        """(K,), the price of the ground each way covers beyond open ground, and of the way still to go from its end."""
        field, reach = self._field, self._weights.ahead
        x, y = ways.x[-1], ways.y[-1]
        ahead = field.at(x + reach * ways.ahead[0, -1], y + reach * ways.ahead[1, -1])
        left = 0.5 * field.at(x, y) + 0.5 * ahead
        dx, dy = ways.x - goal.x, ways.y - goal.y
        there = _soonest(dx * dx + dy * dy < goal.distance * goal.distance)
        covered = np.add.reduce(field.surcharge(ways.x, ways.y) * ways.speed, axis=0) * STEP
        cost: Array = np.where(there > 0.0, -there, left) + manners * covered
        return cost

    def _bumps(self, ways: Ways, snapshot: Snapshot) -> Array:
        """(K,), the price of hitting walls and furniture."""
        gap = self._gaps_to_things(ways, snapshot)
        cost: Array = self._weights.bump * _soonest(gap < snapshot.robot.radius + SKIN)
        return cost

    def _gaps_to_things(self, ways: Ways, snapshot: Snapshot) -> Array:
        """(S, K), m, from the robot's centre on its ways to the nearest wall or piece of furniture."""
        points = np.stack((ways.x.ravel(), ways.y.ravel()), axis=1)
        nearest: Array = np.minimum.reduce(self._near(snapshot).gaps(points), axis=0, initial=np.inf)
        return nearest.reshape(ways.x.shape)

    def _near(self, snapshot: Snapshot) -> Barriers:
        """The walls and pieces of furniture that the robot can come to within the horizon."""
        barriers, robot = snapshot.scene.barriers, snapshot.robot
        reach = robot.body.limits.ahead * HORIZON + robot.radius + 0.1
        return barriers.subset(barriers.gaps(np.array([robot.position]))[:, 0] < reach)

    def _people(self, ways: Ways, snapshot: Snapshot, manners: float) -> Array:
        """(K,), the price of coming near people where they will be, and of haste there."""
        w, nearest = self._weights, np.minimum.reduce(self._gaps(ways, snapshot), axis=0)
        free = np.maximum(nearest, 0.0)
        rude = w.intimate * np.maximum(1.0 - free / INTIMATE_DISTANCE, 0.0)
        rude += w.personal * np.maximum(1.0 - free / PERSONAL_DISTANCE, 0.0)
        rude += w.hurry * np.maximum(ways.speed - SLOW - SLOWER_BY_THE_METRE * free, 0.0)
        crash = w.crash * _soonest(nearest < MARGIN) + w.closing * self._unstoppable(ways, snapshot)
        cost: Array = manners * np.add.reduce(rude, axis=0) * STEP + crash
        return cost

    def _gaps(self, ways: Ways, snapshot: Snapshot) -> Array:
        """(N, S, K), m, between the robot on its ways and people who keep their velocity."""
        humans = snapshot.humans
        t = (np.arange(len(ways.x)) + 1.0) * STEP
        hx, hy = (humans.state[:, k, None] + humans.state[:, k + 2, None] * t for k in (0, 1))
        dx, dy = ways.x - hx[:, :, None], ways.y - hy[:, :, None]
        gaps: Array = np.sqrt(dx * dx + dy * dy) - (humans.radius + snapshot.robot.radius)[:, None, None]
        return gaps

    def _unstoppable(self, ways: Ways, snapshot: Snapshot) -> Array:
        """(K,), m by which the robot would fail to stop before someone if it had to brake after this tick.

        Whoever is all but touched must not be neared at all.
        """
        humans, robot = snapshot.humans, snapshot.robot
        dx, dy = humans.state[:, 0] - robot.position[0], humans.state[:, 1] - robot.position[1]
        apart = np.maximum(np.sqrt(dx * dx + dy * dy), 1e-6)
        nx, ny = dx / apart, dy / apart
        gap = apart - humans.radius - robot.radius
        theirs = np.maximum(-(humans.state[:, 2] * nx + humans.state[:, 3] * ny), 0.0)
        soon = (ways.onset, (ways.vx[0], ways.vy[0]), (ways.vx[1], ways.vy[1]))
        own = np.maximum.reduce([nx[:, None] * vx + ny[:, None] * vy for vx, vy in soon])  # (N, K)
        own = np.maximum(own, 0.0)
        brake = own / robot.body.limits.acceleration + REACTION
        needed = own * (brake + REACTION) * 0.5 + theirs[:, None] * brake
        over = np.where(own > 0.01, np.maximum(needed - gap[:, None] + MARGIN, 0.0), 0.0)
        over += np.where((gap < TOUCH)[:, None], TOUCHING * own, 0.0)
        short: Array = np.add.reduce(over, axis=0)
        return short


def _soonest(hit: Any) -> Array:
    """(S, K) of bool to (K,): 1 for a hit in the first step, less the later, 0 for none."""
    steps = len(hit)
    weight = ((steps - np.arange(steps)) / steps)[:, None]
    soonest: Array = np.maximum.reduce(np.where(hit, weight, 0.0), axis=0)
    return soonest
