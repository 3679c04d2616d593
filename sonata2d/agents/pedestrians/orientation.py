"""`Orientation`: which way pedestrians turn their bodies and heads."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...core.portable_math import Array, BoolArray
from ...core.rng import RandomStream
from ...core.scene import Scene
from ...core.snapshot import Snapshot
from ...core.vectors import lengths
from .reactions import Reactions
from .social.state import SocialState

HEAD_LEAD_TIME = 1.0  # s, by which the head leads the path
MINIMUM_HEAD_LEAD = 0.8  # m, minimum distance ahead on the path
DESIRED_SPEED_WEIGHT = 0.4  # m/s, maximum length of the desired velocity that is added to the velocity of the body
IDLE_SPEED, MOVING_SPEED = 0.3, 0.4  # m/s: slower bodies keep their direction; faster scared ones face their path
VIEW_COSINE = -0.35  # cosine of the angle from the body's direction up to which the robot is noticed


class _GlanceTimes(NamedTuple):
    """How long and how often a pedestrian looks at something.

    Attributes:
        look, pause: shortest and longest duration of a look, and of the pause after it, s.
        range: clearance within which the robot attracts looks, m.
    """

    look: tuple[float, float]
    pause: tuple[float, float]
    range: float = 4.0


ROBOT_GLANCES = {
    "avoids": _GlanceTimes((0.4, 0.9), (1.5, 4.0)),
    "stops": _GlanceTimes((0.6, 1.2), (1.0, 3.0)),
    "curious": _GlanceTimes((2.0, 4.0), (0.3, 1.0), 6.0),
    "scared": _GlanceTimes((1.0, 2.5), (0.3, 0.8), 6.0),
}
TALK_GLANCES = _GlanceTimes((1.5, 4.0), (0.0, 0.0))  # from one face to the next, where three or more talk
WALK_GLANCES = _GlanceTimes((0.8, 1.5), (4.0, 10.0))  # at companions, where people walk together


class Orientation:
    """Body directions and gaze of all pedestrians. Each one's glances are drawn from its own random stream.

    - The body of a walker turns to v + w, with its velocity v and its desired velocity w shortened to 0.4 m/s, so that
      slow walkers do not turn hastily. The head turns to the point on the path 1 s ahead, so that it leads a turn, and
      at times to companions.
    - Pedestrians that talk face their partner, or the centre of the group, and look from face to face; pedestrians
      that attend to an object face it.
    - Glances at the robot, when it is in sight, in view and near, are short for `avoids`, longer for `stops`, long and
      frequent for `curious` and `scared`; pedestrians that ignore the robot never look at it. A pedestrian whose
      reaction is in progress looks at nothing else, and turns its body to the robot unless it walks away scared.

    Args:
        scene: the pedestrians.

    Source: Grasso et al., Neuroscience Letters 253 (1998) 115, for heads that turn before the path does. The times are
    ours.
    """

    def __init__(self, scene: Scene) -> None:
        humans = scene.humans
        self._rng = [RandomStream(scene.seed, scene.episode, "glances", human.id) for human in humans]
        self._robot_glances = [ROBOT_GLANCES.get(human.reaction) for human in humans]
        self._robot_range = np.array([glances.range if glances else -1.0 for glances in self._robot_glances])
        self._is_scared = np.array([human.reaction == "scared" for human in humans], dtype=bool)
        # Ticks at which the present glance at the robot ends, and at which the next one may begin.
        self._robot_until, self._robot_next = [0] * len(humans), [0] * len(humans)
        self._partner: list[int] = [-1] * len(humans)  # index of the partner that is looked at, or -1
        self._partner_until = [0] * len(humans)  # tick

    def facing(self, snapshot: Snapshot, social: SocialState, course: Array, reactions: Reactions) -> Array:
        """The directions that bodies turn to.

        Args:
            snapshot: the present state, with one row for each human of the scene.
            social: what the pedestrians are doing.
            course: (N, 2), desired velocities of walkers, m/s.
            reactions: to the robot.

        Returns:
            (N, 2), unit vectors.
        """
        humans, velocity = snapshot.humans, snapshot.humans.velocity
        speed = lengths(course)
        desired = course * (np.minimum(speed, DESIRED_SPEED_WEIGHT) / np.maximum(speed, 1e-6))[:, None]
        walking = unit_directions(velocity + desired, humans.direction, IDLE_SPEED)
        to_facing_point = self._facing_points(social, humans.position) - humans.position
        standing = unit_directions(to_facing_point, humans.direction, 0.05)
        facing = np.where(social.is_walking[:, None], walking, standing)
        does_not_talk = np.array(
            [social.is_walking[k] or not partners for k, partners in enumerate(social.partners)], dtype=bool
        )
        moves = velocity[:, 0] * velocity[:, 0] + velocity[:, 1] * velocity[:, 1] > MOVING_SPEED * MOVING_SPEED
        flees = self._is_scared & social.is_walking & moves
        faces_robot = reactions.faces_robot & does_not_talk & ~social.has_object & ~flees
        return np.where(faces_robot[:, None], reactions.robot_direction, facing)

    def gaze(
        self, snapshot: Snapshot, social: SocialState, facing: Array, points_ahead: Array, reactions: Reactions
    ) -> Array:
        """The directions that heads turn to; advances the glances by one tick.

        Args:
            snapshot, social, reactions: as for `facing`.
            facing: (N, 2), directions that bodies turn to, unit vectors.
            points_ahead: (N, 2), m, points ahead on the paths of walkers.

        Returns:
            (N, 2), unit vectors.
        """
        position = snapshot.humans.position
        direction = np.where(social.is_walking[:, None], points_ahead - position, facing)
        for k, partners in enumerate(social.partners):
            other = self._choose_partner(k, partners, bool(social.is_walking[k]), snapshot) if partners else -1
            if other >= 0:
                direction[k] = position[other] - position[k]
        glances = self._looks_at_robot(snapshot, reactions)
        return np.where(glances[:, None], reactions.robot_direction, unit_directions(direction, facing, 0.3))

    def _facing_points(self, social: SocialState, position: Array) -> Array:
        """(N, 2), m: what standing pedestrians face: the partner, the centre of the group, or their facing point."""
        points = social.facing_point.copy()
        for k, partners in enumerate(social.partners):
            if partners and not social.is_walking[k] and not social.keeps_facing[k]:
                rows = position[partners] if len(partners) == 1 else position[[k, *partners]]
                points[k] = np.add.reduce(rows, axis=0) / len(rows)
        return points

    def _choose_partner(self, k: int, partners: list[int], is_walking: bool, snapshot: Snapshot) -> int:
        """The index of the partner that pedestrian k looks at now, or -1 during a pause."""
        if len(partners) == 1 and not is_walking:
            return partners[0]
        tick, partner = snapshot.tick, self._partner[k]
        if tick >= self._partner_until[k] or (partner >= 0 and partner not in partners):
            # Walkers start with a pause, and pause after each look; people who talk look from face to face.
            times, is_pause = (WALK_GLANCES, partner >= 0 or tick == 0) if is_walking else (TALK_GLANCES, False)
            self._partner[k] = -1 if is_pause else self._rng[k].choice(partners)
            self._partner_until[k] = tick + self._draw_ticks(k, times.pause if is_pause else times.look, snapshot.dt)
        return self._partner[k]

    def _looks_at_robot(self, snapshot: Snapshot, reactions: Reactions) -> BoolArray:
        """(N,): which pedestrians look at the robot now."""
        humans, tick = snapshot.humans, snapshot.tick
        x, y = reactions.robot_direction[:, 0], reactions.robot_direction[:, 1]
        in_view = humans.direction[:, 0] * x + humans.direction[:, 1] * y > VIEW_COSINE
        may_glance = reactions.notices & ~reactions.faces_robot & (reactions.gap < self._robot_range) & in_view
        looks = np.zeros(len(humans), dtype=bool)
        for k in np.flatnonzero(may_glance).tolist():
            times = self._robot_glances[k]
            if times is not None and tick >= self._robot_next[k]:
                self._robot_until[k] = tick + self._draw_ticks(k, times.look, snapshot.dt)
                self._robot_next[k] = self._robot_until[k] + self._draw_ticks(k, times.pause, snapshot.dt)
            looks[k] = tick < self._robot_until[k]
        looks |= reactions.faces_robot
        return looks

    def _draw_ticks(self, k: int, seconds: tuple[float, float], dt: float) -> int:
        return max(int(self._rng[k].uniform(*seconds) / dt + 0.5), 1)


def unit_directions(vectors: Array, default: Array, minimum: float = 1e-3) -> Array:
    """Unit vectors along (N, 2) vectors; the default, (N, 2), for vectors not longer than the minimum."""
    size = lengths(vectors)
    return np.where((size > minimum)[:, None], vectors / np.maximum(size, 1e-6)[:, None], default)
