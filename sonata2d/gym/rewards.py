"""Rewards of the environment: functions of two successive snapshots and the outcome."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from inspect import signature
from typing import Any, Protocol

from ..core.compiled.kernel import kernel
from ..core.compiled.scalar import length
from ..core.entities import Goal
from ..core.floats import FloatFields
from ..core.humans import X, Y
from ..core.portable_math import Array
from ..core.proxemics import clearance
from ..core.snapshot import Outcome, Snapshot
from ..core.wording import shown
from ..registry import did_you_mean
from ..sim.kernel.batch import gap_to_person


class Reward(Protocol):
    """A function of the snapshots before and after a step, and of the outcome if the step ends the episode.

    Goals, contacts and distances are read from the later snapshot; a contact counts in every tick that it lasts.
    """

    def __call__(self, before: Snapshot, after: Snapshot, outcome: Outcome | None, /) -> float: ...


def goal_distance(snapshot: Snapshot, goal: Goal | None = None) -> float:
    """Distance between the robot's centre and a goal, by default that of the tick, m."""
    row, goal = snapshot.state.row, goal or snapshot.goal
    return length(goal.x - float(row[X]), goal.y - float(row[Y]))


class BuiltIn(FloatFields):
    """Base class of the rewards that are functions of a few numbers, which `Worlds` computes without snapshots."""

    def of(self, progress: float, gap: float, has_contact: bool, status: str | None, dt: float) -> float:
        """The reward of a step.

        Args:
            progress: by which the distance to the goal has fallen, m.
            gap: to the nearest pedestrian, m; infinite without any.
            has_contact: whether the robot touches something.
            status: of the outcome, if the step ends the episode.
            dt: s.
        """
        return self._value(float(progress), float(gap), has_contact, status, float(dt))

    def _value(self, progress: float, gap: float, has_contact: bool, status: str | None, dt: float) -> float:
        """`of`, for floats."""
        raise NotImplementedError

    def __call__(self, before: Snapshot, after: Snapshot, outcome: Outcome | None) -> float:
        progress = goal_distance(before) - goal_distance(after, before.goal)  # to the goal before the step
        status = None if outcome is None else outcome.status
        return self.of(progress, human_clearance(after), bool(after.contacts), status, after.dt)


def human_clearance(snapshot: Snapshot) -> float:
    """`sonata2d.clearance`, compiled: gap between the robot and the nearest pedestrian, m; infinite without any."""
    if len(snapshot.scene.robot.outline.core) > 1:
        return clearance(snapshot)
    humans = snapshot.humans
    gap: float = _clearance(humans.state, humans.radius, humans.shoulder, snapshot.state.robot)
    return gap - snapshot.scene.robot.radius


@dataclass(frozen=True)
class Sparse(BuiltIn):
    """A reward at the goal, a penalty at each contact, nothing else."""

    goal: float = 1.0
    contact: float = -1.0

    def _value(self, progress: float, gap: float, has_contact: bool, status: str | None, dt: float) -> float:
        return (self.goal if status == "goal" else 0.0) + (self.contact if has_contact else 0.0)


@dataclass(frozen=True)
class Distance(BuiltIn):
    """Progress towards the goal, a reward there, and penalties for contacts, closeness to people and time.

    Attributes:
        progress: per metre by which the straight distance to the goal falls.
        goal: on reaching it.
        contact: per second of contact.
        closeness: per second at contact with a pedestrian; it falls linearly to 0 at the gap `comfort`, m.
        time: per second.

    Source: ours. Progress is a potential difference, which does not change the optimal policy (A. Ng, D. Harada &
    S. Russell, ICML 1999) of a learner that discounts little.
    """

    progress: float = 1.0
    goal: float = 5.0
    contact: float = -1.0
    closeness: float = -2.0
    comfort: float = 0.45
    time: float = -0.1

    def _value(self, progress: float, gap: float, has_contact: bool, status: str | None, dt: float) -> float:
        nearness = max(1.0 - max(gap, 0.0) / self.comfort, 0.0)
        reward = self.progress * progress + (self.goal if status == "goal" else 0.0)
        contact = self.contact if has_contact else 0.0
        return reward + (contact + self.closeness * nearness + self.time) * dt


@dataclass(frozen=True)
class CrowdNav(BuiltIn):
    """The reward of CADRL and CrowdNav: at the goal, at contacts, and for gaps to people below 0.2 m.

    Source: Y. Chen et al., ICRA 2017 (CADRL), eq. 3; C. Chen et al., ICRA 2019 (Crowd-Robot Interaction), eq. 2.
    """

    goal: float = 1.0
    contact: float = -0.25
    comfort: float = 0.2

    def _value(self, progress: float, gap: float, has_contact: bool, status: str | None, dt: float) -> float:
        if has_contact:
            return self.contact
        if gap < self.comfort:
            return 0.5 * (max(gap, 0.0) - self.comfort)
        return self.goal if status == "goal" else 0.0


@dataclass(frozen=True)
class Dsrnn(BuiltIn):
    """The reward of DSRNN: at the goal, at contacts, for gaps to people below 0.25 m, and else for progress.

    Source: S. Liu et al., ICRA 2021 (Decentralized Structural-RNN), eq. 1.
    """

    goal: float = 10.0
    contact: float = -20.0
    comfort: float = 0.25
    closeness: float = 2.5
    progress: float = 2.0

    def _value(self, progress: float, gap: float, has_contact: bool, status: str | None, dt: float) -> float:
        if status == "goal":
            return self.goal
        if has_contact:
            return self.contact
        if gap < self.comfort:
            return self.closeness * (max(gap, 0.0) - self.comfort)
        return self.progress * progress


@dataclass(frozen=True)
class SocNavGym(BuiltIn):
    """The DSRNN-like reward of SocNavGym, whose closeness counts below 0.6 m and per second.

    Its penalty outside the map is missing: the robot cannot leave the room.

    Source: A. Kapoor et al., RO-MAN 2023 (SocNavGym), and the values of its version 0.2.0.
    """

    goal: float = 10.0
    contact: float = -10.0
    timeout: float = -5.0
    comfort: float = 0.6
    closeness: float = 0.5
    progress: float = 0.1
    alive: float = -1e-6

    def _value(self, progress: float, gap: float, has_contact: bool, status: str | None, dt: float) -> float:
        if status == "goal":
            return self.goal
        if has_contact:
            return self.contact
        if status == "timeout":
            return self.timeout
        gap = max(gap, 0.0)
        reward = self.closeness * (gap - self.comfort) * dt if gap < self.comfort else 0.0
        return self.alive + reward + self.progress * progress


REWARDS: dict[str, Callable[[], Reward]] = {
    "sparse": Sparse,
    "distance": Distance,
    "crowdnav": CrowdNav,
    "dsrnn": Dsrnn,
    "socnavgym": SocNavGym,
}


def reward_of(value: str | Reward) -> Reward:
    """A reward by name, or the callable itself.

    Raises:
        ValueError: the name is unknown.
        TypeError: the value is neither a name nor callable.
    """
    if isinstance(value, str):
        if value not in REWARDS:
            hint = did_you_mean(value, REWARDS) or f"; known are {', '.join(REWARDS)}"
            raise ValueError(f"no reward is named {value!r}{hint}")
        return REWARDS[value]()
    if isinstance(value, type):
        raise TypeError(f"a reward is an object, got the class {value.__name__}; pass {value.__name__}()")
    try:
        signature(value).bind(None, None, None)
    except TypeError as error:
        raise TypeError(
            f"a reward is a name ({', '.join(REWARDS)}) or a function (before, after, outcome) -> float, got "
            f"{value!r:.100}: {error}"
        ) from None
    except ValueError:  # a function of C, whose arguments are not known
        pass
    return value


def checked_reward(value: Any) -> float:
    """Validate the result of a reward.

    Raises:
        ValueError: it is not a finite number.
    """
    try:
        reward = float(value)
    except (TypeError, ValueError):
        reward = math.nan
    if not math.isfinite(reward):
        raise ValueError(f"the function given as `reward` must return a finite number, it returned {shown(value)}")
    return reward


@kernel
def _clearance(humans: Array, radius: Array, shoulder: Array, robot: Array) -> float:
    """Gap between the centre of the robot and the nearest of the pedestrians, whose columns are `core.humans`; m."""
    nearest = math.inf
    for k in range(len(humans)):
        nearest = min(nearest, gap_to_person(robot, humans, k, radius[k], shoulder[k]))
    return nearest
