"""Reactions of pedestrians to the robot: ignore it, avoid it, stop for it, approach it, or flee from it."""

from __future__ import annotations

import numpy as np

from ...core.portable_math import Array, BoolArray, exp
from ...core.scene import Scene
from ...core.snapshot import Snapshot
from ...core.vectors import lengths
from .velocity_obstacle import evasive_velocity, limit_by_walls

NOTICE_RANGE = 8.0  # m, clearance within which the robot has an effect
CAUSE_RANGE = 3.0  # m, clearance within which the robot's approach causes `stops` and `scared`
APPROACH_SPEED = 0.1  # m/s towards the pedestrian, above which the robot approaches
CURIOUS_CLEARANCE = 1.2  # m, at which curious pedestrians stay (Hall's social distance begins there)
INTEREST_RANGE = 4.0  # m, clearance within which pedestrians become curious
DURATION = {"stops": 6.0, "curious": 8.0, "scared": 6.0}  # s, after which a reaction ends
RECOVERY = {"stops": 2.0, "curious": 0.25, "scared": 2.0}  # s of the duration recovered per s without the cause
SCARED_CLEARANCE = 0.7  # m, added to the clearance of scared pedestrians
MAXIMUM_STEP_BACK, STEP_BACK_RANGE = 0.8, 1.8  # m: largest step back of standing pedestrians, and clearance to restore
CLOSE_CLEARANCE = 0.5  # m, accepted by pedestrians that stop for the robot or are curious, while the reaction lasts
ASIDE_FRACTION = 0.8  # how much of the direction along the robot's path scared pedestrians leave out when they flee
TIGHT_CLEARANCE = 0.1  # m, accepted by pedestrians that were delayed for long
PATIENCE, MAXIMUM_DELAY = 5.0, 8.0  # s of delay from which the clearance shrinks, and at which it is TIGHT_CLEARANCE
_REPULSION, _DECAY_LENGTH = 3.0, 0.1  # m/s^2 at contact with the robot, and m over which it falls to 1/e


class Reactions:
    """How pedestrians react to the robot. Works with every pedestrian model: the model itself ignores the robot.

    Walking pedestrians change direction and speed (`velocity_obstacle.evasive_velocity`) to keep their clearance from
    the robot (Vassallo et al. measured 0.83 ± 0.27 m); scared ones keep more, curious ones less.

    - `avoids`: nothing else.
    - `stops`: stands still while the robot is near and approaches; walks on once the robot has passed or stands, or
      after 6 s.
    - `curious`: approaches to `CURIOUS_CLEARANCE`, unless in a group, stays and faces the robot; loses interest after
      8 s and regains it after four times the duration without the robot.
    - `scared`: walks away while the robot is near and approaches, for 6 s at most. Standing pedestrians step back, as
      far as there is room, and return.

    Delays are limited: pedestrians that are kept from their paths for `PATIENCE` s accept less clearance.

    Args:
        scene: the pedestrians with their reactions, and the robot's radius.

    Attributes:
        notices: (N,) of bool, pedestrians that react to the robot and have it in sight and range.
        faces_robot: (N,) of bool, pedestrians whose reaction is in progress.
        gap: (N,), m, clearance between each pedestrian and the robot at the last tick.
        robot_direction: (N, 2), unit vectors from each pedestrian to the robot at the last tick.

    Source: Vassallo et al., Gait & Posture 51 (2017) 97, for the clearance and for walkers passing behind a robot; the
    other rules are ours.
    """

    def __init__(self, scene: Scene) -> None:
        humans = scene.humans
        self._barriers, self._side = scene.barriers, scene.rules.side
        self._reacts = np.array([human.reacts_to_robot for human in humans], dtype=float)
        self._is = {kind: np.array([h.reaction == kind for h in humans], dtype=bool) for kind in DURATION}
        self._is_alone = np.array([human.group is None for human in humans], dtype=bool)
        self._has_timed_reactions = any(members.any() for members in self._is.values())
        clearance = np.array([human.robot_clearance for human in humans], dtype=float)
        self._clearance = np.where(self._is["scared"], clearance + SCARED_CLEARANCE, clearance)
        self._radius = np.array([human.radius for human in humans], dtype=float)
        self._contact_distance = self._radius + scene.robot.radius
        self._elapsed = np.zeros(len(humans))  # s, time that the present reaction has lasted
        self._is_exhausted = np.zeros(len(humans), dtype=bool)  # the reaction lasted DURATION; recovering
        self._delay = np.zeros(len(humans))  # s, time for which a pedestrian was kept from its path
        self._passing_side = np.zeros(len(humans))  # +1: passes left of the line to the robot, -1: right, 0: neither
        self._can_notice = self._reacts > 0.0
        self.faces_robot = self.notices = np.zeros(len(humans), dtype=bool)
        self.gap, self.robot_direction = np.zeros(len(humans)), np.zeros((len(humans), 2))

    def adjust_course(
        self, snapshot: Snapshot, is_walking: BoolArray, direction: Array, speed: Array, in_sight: BoolArray
    ) -> tuple[Array, Array]:
        """Adjust desired directions and speeds to the robot, and advance the reactions by one tick.

        Args:
            snapshot: the present state.
            is_walking: (N,).
            direction: (N, 2), desired directions without the robot, unit vectors.
            speed: (N,), desired speeds without the robot, m/s.
            in_sight: (N,), pedestrians that have the robot in sight.

        Returns:
            Direction and speed, the same shapes.
        """
        offset, gap, robot_direction = self._robot_geometry(snapshot)
        self.gap, self.robot_direction = gap, robot_direction
        affected = self.notices = self._can_notice & in_sight & (gap < NOTICE_RANGE)
        self._update_reactions(snapshot.dt, affected, gap, self._is_approached(snapshot, robot_direction))
        if not affected.any():
            self._delay = np.maximum(self._delay - 0.5 * snapshot.dt, 0.0)
            return direction, speed
        desired, affected = direction * speed[:, None], affected & is_walking
        preferred = self._preferred_velocity(snapshot, desired, speed, gap, robot_direction)
        avoiding = affected
        if self.faces_robot.any():
            # Curious pedestrians do not evade a robot that they approach, unless it comes towards them fast.
            is_approached = self._is_approached(snapshot, robot_direction, 0.2)
            avoiding = affected & ~(self._is["curious"] & self.faces_robot & ~is_approached)
        new = self._avoid_robot(snapshot, offset, preferred, desired, avoiding)
        if not (affected & (new != desired).any(axis=1)).any():
            return direction, speed
        new = desired + (new - desired) * self._reacts[:, None]
        new_speed = lengths(new)
        turned = np.where((new_speed > 1e-3)[:, None], new / np.maximum(new_speed, 1e-3)[:, None], direction)
        return np.where(affected[:, None], turned, direction), np.where(affected, new_speed, speed)

    def robot_repulsion(self, position: Array) -> Array:
        """Repulsion from the robot's outline; positions (N + 1, 2), m, the robot last, to (N, 2), m/s^2."""
        away = position[:-1] - position[-1]
        distance = np.maximum(lengths(away), 1e-6)
        gap = np.maximum(distance - self._contact_distance, 0.0)
        reacts = np.where(self.notices, self._reacts, 0.0)
        push: Array = away * (reacts * _REPULSION * exp(gap * (-1.0 / _DECAY_LENGTH)) / distance)[:, None]
        return push

    def step_back(self, snapshot: Snapshot, standing_position: Array) -> Array:
        """Where standing pedestrians stand with the robot near: scared ones a step back; (N, 2) to (N, 2), m."""
        scared = np.flatnonzero(self._is["scared"] & self.notices)
        if not len(scared):
            return standing_position
        away = standing_position[scared] - np.array([snapshot.robot.position])
        distance = np.maximum(lengths(away), 1e-6)
        wall_gap = self._barriers.gaps(standing_position[scared]).min(axis=0, initial=np.inf)
        room = wall_gap - self._radius[scared] - 0.05
        step = np.maximum(STEP_BACK_RANGE - (distance - self._contact_distance[scared]), 0.0)
        step = np.minimum(np.minimum(step, MAXIMUM_STEP_BACK), np.maximum(room, 0.0))
        moved = standing_position.copy()
        moved[scared] += away * (step / distance)[:, None]
        return moved

    def _avoid_robot(
        self, snapshot: Snapshot, offset: Array, preferred: Array, desired: Array, avoiding: BoolArray
    ) -> Array:
        """(N, 2), m/s: the preferred velocities; evasive ones for pedestrians that avoid the robot; not into walls."""
        limit = limit_by_walls(snapshot.humans.position, self._radius, self._barriers)
        robot_velocity = np.array(snapshot.robot.velocity)
        new, self._passing_side = evasive_velocity(
            offset, preferred, robot_velocity, self._passing_distance(), self._passing_side, self._side, limit
        )
        new = np.where(avoiding[:, None], new, preferred)
        self._update_delay(snapshot.dt, avoiding, new - preferred)
        changed = (new != desired).any(axis=1)
        return np.where(changed[:, None], limit(new), new) if changed.any() else new

    def _robot_geometry(self, snapshot: Snapshot) -> tuple[Array, Array, Array]:
        """From each pedestrian to the robot: the vector (N, 2), the gap (N,), both m, and the unit vector (N, 2)."""
        offset = np.array([snapshot.robot.position]) - snapshot.humans.position
        distance = np.maximum(lengths(offset), 1e-6)
        return offset, distance - self._contact_distance, offset / distance[:, None]

    def _is_approached(self, snapshot: Snapshot, robot_direction: Array, minimum: float = APPROACH_SPEED) -> BoolArray:
        """(N,): whether the robot's own velocity towards each pedestrian exceeds a minimum, m/s."""
        vx, vy = snapshot.robot.velocity
        approached: BoolArray = robot_direction[:, 0] * vx + robot_direction[:, 1] * vy < -minimum
        return approached

    def _update_reactions(self, dt: float, affected: BoolArray, gap: Array, is_approached: BoolArray) -> None:
        """Start, continue and end reactions: they end after `DURATION` and recover when their cause is gone."""
        if not self._has_timed_reactions:
            return
        startled = (self._is["stops"] | self._is["scared"]) & is_approached & (gap < CAUSE_RANGE)
        cause = affected & (startled | self._is["curious"])
        cause &= ~self._is["curious"] | (gap < INTEREST_RANGE)
        for kind, members in self._is.items():
            change = np.where(cause & ~self._is_exhausted, dt, np.where(cause, 0.0, -RECOVERY[kind] * dt))
            elapsed = self._elapsed + change
            if kind == "curious":  # interest recovers although the robot stays
                elapsed = np.where(self._is_exhausted, self._elapsed - RECOVERY[kind] * dt, elapsed)
            self._elapsed = np.where(members, np.maximum(elapsed, 0.0), self._elapsed)
            is_exhausted = (self._elapsed >= DURATION[kind]) | (self._is_exhausted & (self._elapsed > 0.0))
            self._is_exhausted = np.where(members, is_exhausted, self._is_exhausted)
        self.faces_robot = cause & ~self._is_exhausted

    def _preferred_velocity(
        self, snapshot: Snapshot, desired: Array, speed: Array, gap: Array, robot_direction: Array
    ) -> Array:
        """(N, 2), m/s: the velocities that the reactions ask for, before collisions with the robot are avoided."""
        if not self.faces_robot.any():
            return desired
        reacting = self.faces_robot[:, None]
        flight = speed[:, None] * _flight_direction(robot_direction, snapshot.robot.velocity)
        approach_speed = np.minimum(np.maximum((gap - CURIOUS_CLEARANCE) / 0.5, -0.4), speed)
        approach = approach_speed[:, None] * robot_direction
        preferred = np.where(reacting & self._is["stops"][:, None], 0.0, desired)
        preferred = np.where(reacting & self._is["scared"][:, None], flight, preferred)
        return np.where(reacting & (self._is["curious"] & self._is_alone)[:, None], approach, preferred)

    def _passing_distance(self) -> Array:
        """(N,), m, between centres, at which each pedestrian wants to pass the robot now."""
        patience = np.minimum(np.maximum((MAXIMUM_DELAY - self._delay) / (MAXIMUM_DELAY - PATIENCE), 0.0), 1.0)
        tolerates = (self._is["curious"] | self._is["stops"]) & self.faces_robot
        clearance = np.where(tolerates, np.minimum(self._clearance, CLOSE_CLEARANCE), self._clearance)
        tight = np.minimum(clearance, TIGHT_CLEARANCE)
        distance: Array = self._contact_distance + tight + (clearance - tight) * patience
        return distance

    def _update_delay(self, dt: float, avoiding: BoolArray, change: Array) -> None:
        """Count the time for which avoiding the robot changes velocities by more than 0.1 m/s."""
        is_delayed = avoiding & (change[:, 0] * change[:, 0] + change[:, 1] * change[:, 1] > 0.01)
        self._delay = np.minimum(np.maximum(self._delay + np.where(is_delayed, dt, -0.5 * dt), 0.0), MAXIMUM_DELAY)


def _flight_direction(robot_direction: Array, robot_velocity: tuple[float, float]) -> Array:
    """(N, 2), unit vectors away from a moving robot, to the side rather than along its path."""
    vx, vy = robot_velocity
    speed = max(float(np.sqrt(vx * vx + vy * vy)), 1e-6)
    along = np.maximum(-(robot_direction[:, 0] * vx + robot_direction[:, 1] * vy) / speed, 0.0) * ASIDE_FRACTION / speed
    x, y = -robot_direction[:, 0] - along * vx, -robot_direction[:, 1] - along * vy
    size = np.maximum(np.sqrt(x * x + y * y), 1e-6)
    return np.stack((x / size, y / size), axis=1)
