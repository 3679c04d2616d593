"""How people behave towards the robot: ignore it, avoid it, stop for it, come to see it, or shy away from it."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...core.portable_math import Array, exp
from ...core.scene import Scene
from ...core.snapshot import Snapshot
from ...core.vectors import lengths
from .velocity_obstacle import course_past, held_by_walls

NOTICED = 8.0  # m, from outline to outline, within which the robot matters
NEAR = 3.0  # m, within which who stops or is scared minds its coming
COMING = 0.1  # m/s, towards the person, from which it comes
SOCIAL = 1.2  # m, at which the curious stay (Hall's social distance begins)
INTEREST = 4.0  # m, from which the curious come
SPENT = {"stops": 6.0, "curious": 8.0, "scared": 6.0}  # s, after which a reaction ends
RECOVERY = {"stops": 2.0, "curious": 0.25, "scared": 2.0}  # times as fast as it was spent, once its cause is gone
SHY = 0.7  # m, that the scared add to their clearance
STEP_BACK, AT_EASE = 0.8, 1.8  # m: how far who stands steps back at most, and from how near
CLOSE = 0.5  # m, that who stops, or is curious, puts up with while they look
ASIDE = 0.8  # of the way ahead of a coming robot, that the scared leave out when they get away
TIGHT = 0.1  # m, which will do for who was kept from their way for long
PATIENT, IMPATIENT = 5.0, 8.0  # s, in which a clearance is kept, and after which it is TIGHT
_PUSH, _REACH = 3.0, 0.1  # m/s2 at the robot's skin, and m in which it falls to 1/e


class Reactions:
    """What the robot makes people do, under any law of walking: the law itself is not told of the robot.

    Who is on their way takes another course, in direction and speed: see `passing.course_past`, with the clearance of
    the person (Vassallo et al. measured 0.83 ± 0.27 m), more for the scared, less for the curious.

    - `avoids`: that is all.
    - `stops`: stands still while the robot is near and comes nearer; goes on once it has passed, or stands, or after
      6 s.
    - `curious`: comes to `SOCIAL` m, unless in a group, stays and faces it; loses interest after 8 s and finds it again
      when it has been left alone four times as long.
    - `scared`: walks away while the robot is near and comes nearer, for 6 s at most. Who stands steps back, as far as
      there is room, and returns.

    Nobody is held for ever: after `PATIENT` s of being kept from their way people put up with less clearance.

    Args:
        scene: who reacts, and how.

    Attributes:
        notices: (N,) of bool, who minds the robot and has it in sight.
        faces_it: (N,) of bool, who is taken up with it.
        gap, towards: from each person to the robot when they were last asked: between outlines, (N,), m, and the unit
            vector, (N, 2).

    Source: Vassallo et al., Gait & Posture 51 (2017) 97, for the clearance and for walkers passing behind a robot; the
        rest are rules of our own.
    """

    def __init__(self, scene: Scene) -> None:
        people = scene.humans
        self._barriers, self._side = scene.barriers, scene.rules.side
        self._reacts = np.array([human.reacts_to_robot for human in people], dtype=float)
        self._is = {kind: np.array([h.reaction == kind for h in people], dtype=bool) for kind in SPENT}
        self._alone = np.array([human.group is None for human in people], dtype=bool)
        self._is_even = not any(whose.any() for whose in self._is.values())
        self._clearance = np.array([human.robot_clearance for human in people], dtype=float)
        self._clearance = np.where(self._is["scared"], self._clearance + SHY, self._clearance)
        self._radius = np.array([human.radius for human in people], dtype=float)
        self._bodies = self._radius + scene.robot.radius
        self._spent, self._kept = np.zeros(len(people)), np.zeros(len(people))  # s
        self._tired = np.zeros(len(people), dtype=bool)
        self._passing = np.zeros(len(people))  # +1 who passes the robot on the left of the way to it, -1 on the right
        self._minds = self._reacts > 0.0
        self.faces_it = self.notices = np.zeros(len(people), dtype=bool)
        self.gap, self.towards = np.zeros(len(people)), np.zeros((len(people), 2))

    def course(self, snapshot: Snapshot, walks: Any, direction: Array, speed: Array, seen: Any) -> tuple[Array, Array]:
        """The way people go, with the robot in mind.

        Args:
            snapshot: where all are.
            walks: (N,) of bool, who is on the way.
            direction: (N, 2), unit vectors, where they would go without the robot.
            speed: (N,), m/s, and how fast.
            seen: (N,) of bool, who has the robot in sight.

        Returns:
            Direction and speed, the same shapes.
        """
        apart, gap, towards = self._to_robot(snapshot)
        self.gap, self.towards = gap, towards
        here = self.notices = self._minds & seen & (gap < NOTICED)
        self._feel(snapshot.dt, here, gap, self._comes(snapshot, towards))
        if not here.any():
            self._kept = np.maximum(self._kept - 0.5 * snapshot.dt, 0.0)
            return direction, speed
        wanted, here = direction * speed[:, None], here & walks
        wish, avoiding = self._wish(snapshot, wanted, speed, gap, towards), here
        if self.faces_it.any():
            avoiding = here & ~(self._is["curious"] & self.faces_it & ~self._comes(snapshot, towards, 0.2))
        new = self._past_it(snapshot, apart, wish, wanted, avoiding)
        if not (here & (new != wanted).any(axis=1)).any():
            return direction, speed
        new = wanted + (new - wanted) * self._reacts[:, None]
        pace = lengths(new)
        turned = np.where((pace > 1e-3)[:, None], new / np.maximum(pace, 1e-3)[:, None], direction)
        return np.where(here[:, None], turned, direction), np.where(here, pace, speed)

    def _past_it(self, snapshot: Snapshot, apart: Array, wish: Array, wanted: Array, avoiding: Any) -> Array:
        """(N, 2), m/s: the wish, or for those who avoid the robot the course past it; not into walls."""
        held = held_by_walls(snapshot.humans.position, self._radius, self._barriers)
        velocity = np.array(snapshot.robot.velocity)
        new, self._passing = course_past(apart, wish, velocity, self._room(), self._passing, self._side, held)
        new = np.where(avoiding[:, None], new, wish)
        self._lose_patience(snapshot.dt, avoiding, new - wish)
        changed = (new != wanted).any(axis=1)
        return np.where(changed[:, None], held(new), new) if changed.any() else new

    def push(self, position: Array) -> Array:
        """Off the robot's skin; (N + 1, 2), m, the robot last, to (N, 2), m/s2."""
        away = position[:-1] - position[-1]
        apart = np.maximum(lengths(away), 1e-6)
        gap = np.maximum(apart - self._bodies, 0.0)
        minds = np.where(self.notices, self._reacts, 0.0)
        push: Array = away * (minds * _PUSH * exp(gap * (-1.0 / _REACH)) / apart)[:, None]
        return push

    def stepped_back(self, snapshot: Snapshot, home: Array) -> Array:
        """Where those who stand keep to while they notice the robot, (N, 2), m: the scared a step from home."""
        scared = np.flatnonzero(self._is["scared"] & self.notices)
        if not len(scared):
            return home
        away = home[scared] - np.array([snapshot.robot.position])
        apart = np.maximum(lengths(away), 1e-6)
        room = self._barriers.gaps(home[scared]).min(axis=0, initial=np.inf) - self._radius[scared] - 0.05
        step = np.minimum(np.maximum(AT_EASE - (apart - self._bodies[scared]), 0.0), STEP_BACK)
        step = np.minimum(step, np.maximum(room, 0.0))
        moved = home.copy()
        moved[scared] += away * (step / apart)[:, None]
        return moved

    def _to_robot(self, snapshot: Snapshot) -> tuple[Array, Array, Array]:
        """From each person to the robot: the vector (N, 2), the gap (N,), both m, and the unit vector (N, 2)."""
        to = np.array([snapshot.robot.position]) - snapshot.humans.position
        apart = np.maximum(lengths(to), 1e-6)
        return to, apart - self._bodies, to / apart[:, None]

    def _comes(self, snapshot: Snapshot, towards: Array, least: float = COMING) -> Any:
        """(N,) of bool, to whom the robot comes nearer by itself."""
        vx, vy = snapshot.robot.velocity
        return towards[:, 0] * vx + towards[:, 1] * vy < -least

    def _feel(self, dt: float, here: Any, gap: Array, comes: Any) -> None:
        """Reactions wear off while they last, and people recover when their cause is gone."""
        if self._is_even:
            return
        cause = here & (((self._is["stops"] | self._is["scared"]) & comes & (gap < NEAR)) | self._is["curious"])
        cause &= ~self._is["curious"] | (gap < INTEREST)
        for kind, whose in self._is.items():
            spent = self._spent + np.where(cause & ~self._tired, dt, np.where(cause, 0.0, -RECOVERY[kind] * dt))
            if kind == "curious":  # who lost interest recovers though it stays
                spent = np.where(self._tired, self._spent - RECOVERY[kind] * dt, spent)
            self._spent = np.where(whose, np.maximum(spent, 0.0), self._spent)
            tired = (self._spent >= SPENT[kind]) | (self._tired & (self._spent > 0.0))
            self._tired = np.where(whose, tired, self._tired)
        self.faces_it = cause & ~self._tired

    def _wish(self, snapshot: Snapshot, wanted: Array, speed: Array, gap: Array, towards: Array) -> Array:
        """(N, 2), m/s: what people would do about the robot if they could not run into it."""
        if not self.faces_it.any():
            return wanted
        struck, away = self.faces_it[:, None], speed[:, None] * _aside(towards, snapshot.robot.velocity)
        near = np.minimum(np.maximum((gap - SOCIAL) / 0.5, -0.4), speed)[:, None] * towards
        wish = np.where(struck & self._is["stops"][:, None], 0.0, wanted)
        wish = np.where(struck & self._is["scared"][:, None], away, wish)
        return np.where(struck & (self._is["curious"] & self._alone)[:, None], near, wish)

    def _room(self) -> Array:
        """(N,), m, from centre to centre, that each wants to pass the robot at now."""
        tolerance = np.minimum(np.maximum((IMPATIENT - self._kept) / (IMPATIENT - PATIENT), 0.0), 1.0)
        put_up = (self._is["curious"] | self._is["stops"]) & self.faces_it
        clearance = np.where(put_up, np.minimum(self._clearance, CLOSE), self._clearance)
        tight = np.minimum(clearance, TIGHT)
        room: Array = self._bodies + tight + (clearance - tight) * tolerance
        return room

    def _lose_patience(self, dt: float, avoiding: Any, change: Array) -> None:
        """Count the time that people are kept from their way."""
        kept = avoiding & (change[:, 0] * change[:, 0] + change[:, 1] * change[:, 1] > 0.01)
        self._kept = np.minimum(np.maximum(self._kept + np.where(kept, dt, -0.5 * dt), 0.0), IMPATIENT)


def _aside(towards: Array, velocity: tuple[float, float]) -> Array:
    """(N, 2), unit vectors away from a robot that moves, rather to the side than along its way."""
    vx, vy = velocity
    pace = max(float(np.sqrt(vx * vx + vy * vy)), 1e-6)
    along = np.maximum(-(towards[:, 0] * vx + towards[:, 1] * vy) / pace, 0.0) * ASIDE / pace
    x, y = -towards[:, 0] - along * vx, -towards[:, 1] - along * vy
    size = np.maximum(np.sqrt(x * x + y * y), 1e-6)
    return np.stack((x / size, y / size), axis=1)
