"""The expert: samples short twists, predicts people, and keeps the paper's four guidelines.

Guidelines (Baghel et al., SONATA, 2020): keep out of personal space, out of walkers' way, out of interactions, and
drive slowly near people.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from ..entities import Goal
from ..exact import Array
from ..frame import Snapshot
from ..geometry import Barriers, Twist
from ..proxemics import INTIMATE_DISTANCE, PERSONAL_DISTANCE
from ..scene import Scene
from .controller import Controller
from .cost_field import CostField
from .rollout import Ways, candidates, rolled_out, twist_of

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

    def overruled(self, twist: Twist) -> None:
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
