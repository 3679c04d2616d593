"""What bodies turn to and heads look at: the way ahead, those one is with, a thing, the robot now and then."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ...core.portable_math import Array
from ...core.rng import RandomStream
from ...core.scene import Scene
from ...core.snapshot import Snapshot
from ...core.vectors import lengths
from .reactions import Reactions
from .social.state import SocialState

AHEAD = 1.0  # s, by which the head is ahead of the way
SHORTEST = 0.8  # m, at least that far ahead on the way
STEADY = 0.4  # m/s, that the way one wants to go weighs beside the one one goes
IDLE, MOVING = 0.3, 0.4  # m/s: below the one a body stays as it is; above the other the scared look where they go
IN_VIEW = -0.35  # cosine of the angle from the body's direction, up to which one notices the robot


class _Habit(NamedTuple):
    """How long looks and the pauses between them take, s, and from how near the robot draws them, m."""

    look: tuple[float, float]
    pause: tuple[float, float]
    reach: float = 4.0


GLANCES = {
    "avoids": _Habit((0.4, 0.9), (1.5, 4.0)),
    "stops": _Habit((0.6, 1.2), (1.0, 3.0)),
    "curious": _Habit((2.0, 4.0), (0.3, 1.0), 6.0),
    "scared": _Habit((1.0, 2.5), (0.3, 0.8), 6.0),
}
FACES = _Habit((1.5, 4.0), (0.0, 0.0))  # from one to the next, where three or more talk
COMPANIONS = _Habit((0.8, 1.5), (4.0, 10.0))  # where people walk together


class Attention:
    """Where everybody faces and looks. All of it is drawn from a stream of chance of each person's own.

    - A walker's body turns to v + w, of velocity v and wanted velocity w of 0.4 m/s at most, so that slow ones keep
      calm; the head to the point on the way that is 1 s ahead, so that it leads a turn, and to companions now and then.
    - Who talks faces the partner, or the middle of the circle, and looks from face to face; who attends to a thing
      faces it.
    - Glances at the robot, where it is in sight, in view and near, are short for `avoids`, longer for `stops`, long and
      often for `curious` and `scared`; who ignores it never looks. Who is taken up with the robot looks at nothing
      else, and turns the body to it but while the scared walk away.

    Args:
        scene: who there is.

    Source: Grasso et al., Neuroscience Letters 253 (1998) 115, for heads that turn before the way does. The times are
        ours.
    """

    def __init__(self, scene: Scene) -> None:
        people = scene.humans
        self._rng = [RandomStream(scene.seed, scene.episode, "glances", human.id) for human in people]
        self._habit = [GLANCES.get(human.reaction) for human in people]
        self._reach = np.array([habit.reach if habit else -1.0 for habit in self._habit])
        self._is_scared = np.array([human.reaction == "scared" for human in people], dtype=bool)
        self._robot_until, self._robot_next = [0] * len(people), [0] * len(people)
        self._face: list[int] = [-1] * len(people)  # whom one looks at, or -1
        self._face_until = [0] * len(people)

    def facing(self, snapshot: Snapshot, social: SocialState, course: Array, reactions: Reactions) -> Array:
        """(N, 2), unit vectors to which the bodies turn.

        Args:
            snapshot: where all are.
            company: what they are about.
            course: (N, 2), m/s, how walkers want to go.
            reactions: to the robot.
        """
        humans, velocity = snapshot.humans, snapshot.humans.velocity
        pace = lengths(course)
        way = course * (np.minimum(pace, STEADY) / np.maximum(pace, 1e-6))[:, None]
        walking = directed(velocity + way, humans.direction, IDLE)
        standing = directed(self._fronts(social, humans.position) - humans.position, humans.direction, 0.05)
        facing = np.where(social.walks[:, None], walking, standing)
        alone = np.array([social.walks[k] or not partners for k, partners in enumerate(social.partners)], dtype=bool)
        moves = velocity[:, 0] * velocity[:, 0] + velocity[:, 1] * velocity[:, 1] > MOVING * MOVING
        turns = reactions.faces_it & alone & ~social.has_thing & ~(self._is_scared & social.walks & moves)
        return np.where(turns[:, None], reactions.towards, facing)

    def look(self, snapshot: Snapshot, social: SocialState, facing: Array, ahead: Array, reactions: Reactions) -> Array:
        """(N, 2), unit vectors to which the heads turn.

        Args:
            snapshot, company, reactions: as above.
            facing: (N, 2), unit vectors to which the bodies turn.
            ahead: (N, 2), m, where the way leads.
        """
        position = snapshot.humans.position
        aim = np.where(social.walks[:, None], ahead - position, facing)
        for k, partners in enumerate(social.partners):
            other = self._whom(k, partners, bool(social.walks[k]), snapshot) if partners else -1
            if other >= 0:
                aim[k] = position[other] - position[k]
        glances = self._glances(snapshot, reactions)
        return np.where(glances[:, None], reactions.towards, directed(aim, facing, 0.3))

    def _fronts(self, social: SocialState, position: Array) -> Array:
        """(N, 2), m: what those who stand face: the partner, the middle of the circle, the thing."""
        fronts = social.front.copy()
        for k, partners in enumerate(social.partners):
            if partners and not social.walks[k] and not social.keeps_facing[k]:
                rows = position[partners] if len(partners) == 1 else position[[k, *partners]]
                fronts[k] = np.add.reduce(rows, axis=0) / len(rows)
        return fronts

    def _whom(self, k: int, partners: list[int], walks: bool, snapshot: Snapshot) -> int:
        """The index of the person one looks at now, or -1."""
        if len(partners) == 1 and not walks:
            return partners[0]
        tick, face = snapshot.tick, self._face[k]
        if tick >= self._face_until[k] or (face >= 0 and face not in partners):
            habit, pauses = (COMPANIONS, face >= 0 or tick == 0) if walks else (FACES, False)
            self._face[k] = -1 if pauses else self._rng[k].choice(partners)
            self._face_until[k] = tick + self._ticks(k, habit.pause if pauses else habit.look, snapshot.dt)
        return self._face[k]

    def _glances(self, snapshot: Snapshot, reactions: Reactions) -> Any:
        """(N,) of bool: who looks at the robot now."""
        humans, tick = snapshot.humans, snapshot.tick
        x, y = reactions.towards[:, 0], reactions.towards[:, 1]
        in_view = humans.direction[:, 0] * x + humans.direction[:, 1] * y > IN_VIEW
        looks = np.zeros(len(humans), dtype=bool)
        for k in np.flatnonzero(
            reactions.notices & ~reactions.faces_it & (reactions.gap < self._reach) & in_view
        ).tolist():
            habit = self._habit[k]
            if habit is not None and tick >= self._robot_next[k]:
                self._robot_until[k] = tick + self._ticks(k, habit.look, snapshot.dt)
                self._robot_next[k] = self._robot_until[k] + self._ticks(k, habit.pause, snapshot.dt)
            looks[k] = tick < self._robot_until[k]
        return looks | reactions.faces_it

    def _ticks(self, k: int, seconds: tuple[float, float], dt: float) -> int:
        return max(int(self._rng[k].uniform(*seconds) / dt + 0.5), 1)


def directed(vectors: Array, otherwise: Array, least: float = 1e-3) -> Array:
    """Unit vectors along (N, 2) vectors, or the others where these are shorter than `least`."""
    size = lengths(vectors)
    return np.where((size > least)[:, None], vectors / np.maximum(size, 1e-6)[:, None], otherwise)
