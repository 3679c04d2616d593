"""Where walkers go, and the way there.

Who is wandering takes a place in the room, and another on arrival; who is walking has goals of their own; who is
recorded has a track; and who is led goes where they are told.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...core.entities import PERSON_RADIUS
from ...core.geometry import Barriers, Point
from ...core.humans import Humans
from ...core.navigation import FreeSpace
from ...core.portable_math import Array
from ...core.rng import RandomStream
from ...core.scene import Scene
from ...core.vectors import lengths

CLEARANCE = 0.10  # m, that ways keep from walls, furniture and standing people
SQUEEZE = 0.05  # m, by which a body may seem to be in a wall before its way counts as shut
ARRIVED = 0.5  # m from the goal
FORESIGHT = 1.0  # s, how far ahead on their track people look who are recorded
TURNED = 0.35  # m from a waypoint, when the next one is aimed at
NEAREST_GOAL = 2.0  # m, closer places are not worth a walk
LOOK_EVERY = 5  # ticks between looks whether the way is still open
PATIENCE = 30  # ticks in which a walker wants to have got on, else it goes elsewhere
PROGRESS = 0.4  # m
ELBOW_ROOM = 0.4  # m, half of what each of a group takes up where it goes
ROOM_AHEAD = 1.5  # m, that a follower wants to be free to walk beside the leader
_ATTEMPTS = 30


class Wanderers:
    """The ways of all who walk; walkers of one group share the leader's.

    Args:
        scene: the room, and who walks.

    Attributes:
        led: who goes, or stays, where they are told, and chooses nothing.
        errand: asked when a wanderer is about to choose a place: whether it led the one of that index at that place.
    """

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        walking = [k for k, human in enumerate(scene.humans) if human.behaviour in ("wandering", "walking")]
        self._recorded = [k for k, human in enumerate(scene.humans) if human.behaviour == "recorded"]
        self._foresight = int(FORESIGHT / scene.rules.dt + 0.5)  # ticks
        self._exits = {k for k in walking if scene.humans[k].exits}
        self.leaving: tuple[int, ...] = ()  # who has reached where they leave
        self._rng = {k: RandomStream(scene.seed, scene.episode, "people", scene.humans[k].id) for k in walking}
        self._goals = {k: list(scene.humans[k].goals) for k in walking if scene.humans[k].behaviour == "walking"}
        index = {human.id: k for k, human in enumerate(scene.humans)}
        follows = {m: index[g.members[0]] for g in scene.groups if g.kind == "walking" for m in g.members}
        follows = {m: led for m, led in follows.items() if index[m] not in self._goals and led in walking}
        self.leader = {k: follows.get(scene.humans[k].id, k) for k in walking}  # in the scene's order
        self._ways: dict[int, Array] = {k: np.zeros((0, 2)) for k in walking}
        self._followed: dict[int, Array] = {}  # the leader's way that a follower took over
        self._next: dict[int, int] = dict.fromkeys(walking, 0)
        self._anchor: dict[int, tuple[float, float]] = {}
        self.target = np.array([human.pose.position for human in scene.humans], dtype=float).reshape(-1, 2)
        self.is_last = np.zeros(len(scene.humans), dtype=bool)  # whose target is where they will stay
        self.led: set[int] = set()
        self._beside: set[int] = set()  # followers with room beside their leader's way
        self.errand: Callable[[int, Point], bool] | None = None
        may_walk = range(len(scene.humans)) if scene.social.is_lively else walking
        self._reach = max((scene.humans[k].radius for k in may_walk), default=PERSON_RADIUS) + CLEARANCE
        self.go_round(scene.standing, scene.shared)
        low, high = scene.outline.min(axis=0), scene.outline.max(axis=0)
        self._box = (*low.tolist(), *high.tolist())

    def update(self, tick: int, humans: Humans, there: Array | None = None) -> Array:
        """Each human's next waypoint, (N, 2), m; one's own start for who stands, and for who is absent any.

        Args:
            tick: that begins.
            humans: a row for everybody.
            there: (N + 1,), 0 for who is absent; None: nobody is.
        """
        for k in self._recorded:
            self.target[k] = self._scene.humans[k].place_at(tick + self._foresight)
        if not self.leader:
            return self.target.copy()
        walking = self.leader if there is None else {k: led for k, led in self.leader.items() if there[k]}
        places = humans.position.tolist()
        if tick == 0:
            self._set_out_straight(humans.position, list(walking))
        for k, leader in walking.items():
            leader = leader if leader in walking else k  # whose leader is gone goes their own way
            place = (places[k][0], places[k][1])
            if leader == k and (self._needs_a_goal(tick, k, place) or self._is_stuck(tick, k, place)):
                self._set_out(k, place)
            if leader != k and self._followed.get(k) is not self._ways[leader]:
                self._followed[k] = self._ways[k] = self._ways[leader]
                self._next[k] = min(1, len(self._ways[k]) - 1)
        self._advance(tick, humans.position, list(walking))
        for k in walking:
            if len(self._ways[k]):
                self.target[k] = self._ways[k][self._next[k]]
        beside = [k for k in walking if k in self._beside and walking[k] in walking]
        for k in beside:  # they go where their leader goes, side by side
            self.target[k] = self.target[walking[k]] + humans.position[k] - humans.position[walking[k]]
        for k in walking:
            self.is_last[k] = len(self._ways[k]) > 0 and self._is_at_last(k) and k not in self._exits
        self.leaving = tuple(
            k
            for k in walking
            if k in self._exits and self._is_at_last(k) and _within(places[k], self.target[k], ARRIVED)
        )
        return self.target.copy()

    def _is_at_last(self, k: int) -> bool:
        """Whether somebody who will stay where their way ends aims at its end."""
        stays = k in self.led or self._goals.get(k) == []
        return stays and self._next[k] == len(self._ways[k]) - 1

    def go_round(self, standing: Barriers, shared: Barriers) -> None:
        """From now on ways lead round these people who stand, and round what they share as they talk."""
        solids = self._scene.barriers.joined(standing)
        self._space = FreeSpace(self._scene.outline, solids.joined(shared), self._reach)
        self._passable = FreeSpace(self._scene.outline, solids, self._reach - CLEARANCE - SQUEEZE)

    def is_open(self, start: Point, end: Point) -> bool:
        """Whether somebody may stand at the end, with nothing on the straight way there from the start."""
        here, there = np.array([start]), np.array([end])
        return bool(self._space.is_free(there)[0] and self._space.is_clear(here, there)[0])

    def lead(self, k: int, place: Point, goal: Point) -> bool:
        """Send somebody to a goal, where they will stay; False if there is no way."""
        way = self._space.path(place, goal)
        if way is not None:
            self._ways[k], self._next[k] = way, min(1, len(way) - 1)
            self.led.add(k)
        return way is not None

    def rest(self, k: int) -> None:
        """Somebody stays where they are until they are sent or let go."""
        self.led.add(k)
        if k in self._ways:
            self._ways[k], self._next[k] = np.zeros((0, 2)), 0

    def let_go(self, k: int, place: Point) -> None:
        """Somebody wanders from now on, even if they stood before; they choose a way at once."""
        self.led.discard(k)
        self.leader[k], self._ways[k], self._next[k] = k, np.array([place, place]), 1
        if k not in self._rng:
            self._rng[k] = RandomStream(self._scene.seed, self._scene.episode, "people", self._scene.humans[k].id)

    def ahead(self, position: Array, reach: Array) -> Array:
        """Where each walker's way leads, (N, 2), m: the point `reach` (N,) m ahead on it, or its end."""
        points = self.target.copy()
        for k in self.leader:
            way, n, left = self._ways[k], self._next[k], float(reach[k])
            x, y = position[k].tolist()
            for end_x, end_y in way[n:].tolist():
                dx, dy = end_x - x, end_y - y
                length = float(np.sqrt(dx * dx + dy * dy))
                if length >= left:
                    points[k] = x + dx * (left / length), y + dy * (left / length)
                    break
                points[k], left, x, y = (end_x, end_y), left - length, end_x, end_y
        return points

    def _needs_a_goal(self, tick: int, k: int, place: tuple[float, float]) -> bool:
        """Whether a walker is there; who found nowhere to go looks again now and then."""
        way = self._ways[k]
        if k in self.led or (k in self._goals and not self._goals[k]):
            return False
        if len(way) < 2:
            return not len(way) or tick % LOOK_EVERY == 0
        return self._next[k] == len(way) - 1 and _within(place, way[-1], ARRIVED)

    def _is_stuck(self, tick: int, k: int, place: tuple[float, float]) -> bool:
        """Whether a walker hardly moved for as long as its patience lasts."""
        if k in self._goals or k in self.led or (tick + k) % PATIENCE:
            return False
        before, self._anchor[k] = self._anchor.get(k), place
        return before is not None and _within(place, before, PROGRESS)

    def _set_out(self, k: int, place: tuple[float, float]) -> None:
        """Choose a place to go to and the way there; stay if none is found. Own goals are gone to by any means."""
        if k in self._goals:
            goal = self._goals[k].pop(0)
            way = self._space.path(place, goal)
            self._ways[k], self._next[k] = np.array([place, goal]) if way is None else way, 1
            return
        if self.errand is not None and self.errand(k, place):
            return
        x0, y0, x1, y1 = self._box
        rng = self._rng[k]
        wide = ELBOW_ROOM * sum(leader == k for leader in self.leader.values())
        for attempt in range(_ATTEMPTS):
            goal = (rng.uniform(x0, x1), rng.uniform(y0, y1))
            there = np.array([goal])
            if _within(place, goal, NEAREST_GOAL) or not self._space.is_free(there)[0]:
                continue
            if wide > ELBOW_ROOM and attempt < _ATTEMPTS // 2 and self._scene.barriers.gaps(there).min() < wide:
                continue  # a group looks for a place with room for all
            way = self._space.path(place, goal)
            if way is not None:
                self._ways[k], self._next[k] = way, min(1, len(way) - 1)
                return
        self._ways[k], self._next[k] = np.array([place]), 0

    def _set_out_straight(self, position: Array, walking: list[int]) -> None:
        """Who sees their first goal walks there; all at once, since a crowd may start together."""
        going = [k for k in walking if self._goals.get(k)]
        if not going:
            return
        start, goal = position[going], np.array([self._goals[k][0] for k in going])
        clear = self._space.is_clear(start, goal) | (~self._space.is_free(start) & self._passable.is_clear(start, goal))
        for k in np.array(going)[clear].tolist():
            self._ways[k], self._next[k] = np.array([position[k], self._goals[k].pop(0)]), 1

    def _advance(self, tick: int, position: Array, walking: list[int]) -> None:
        """Aim at the next waypoint once this one is reached or the next in view; find a new way where it is shut."""
        looking = [k for k in walking if len(self._ways[k])] if tick % LOOK_EVERY == 0 else []
        for k in walking:
            way, n = self._ways[k], self._next[k]
            if n < len(way) - 1 and _within(position[k].tolist(), way[n], TURNED):
                self._next[k] = n + 1
        if not looking:
            return
        self._look_beside(position, walking)
        after = [min(self._next[k] + 1, len(self._ways[k]) - 1) for k in looking]
        ahead = np.array([self._ways[k][n] for k, n in zip(looking, after, strict=True)])
        aim = np.array([self._ways[k][self._next[k]] for k in looking])
        in_view = self._space.is_clear(position[looking], ahead).tolist()
        passable = self._passable.is_clear(position[looking], aim).tolist()
        for k, n, may_cut, may_go_on in zip(looking, after, in_view, passable, strict=True):
            if may_cut:
                self._next[k] = n
            elif not may_go_on:
                self._find_back(k, position[k].tolist())

    def _look_beside(self, position: Array, walking: list[int]) -> None:
        """Which followers have room to go where their leader goes, beside them."""
        there = set(walking)
        pairs = [(k, self.leader[k]) for k in walking if self.leader[k] != k and self.leader[k] in there]
        if not pairs:
            self._beside = set()
            return
        followers, leaders = ([pair[side] for pair in pairs] for side in (0, 1))
        ahead = self.target[leaders] - position[leaders]
        far = np.maximum(lengths(ahead), 1e-6)
        step = ahead * (np.minimum(far, ROOM_AHEAD) / far)[:, None]
        clear = self._space.is_clear(position[followers], position[followers] + step)
        self._beside = {k for k, has_room in zip(followers, clear.tolist(), strict=True) if has_room}

    def _find_back(self, k: int, place: list[float]) -> None:
        """A new way to the same goal for one who was pushed off the old one."""
        goal = self._ways[k][-1]
        way = self._space.path((place[0], place[1]), (float(goal[0]), float(goal[1])))
        if way is not None:
            self._ways[k], self._next[k] = way, min(1, len(way) - 1)


def _within(place: list[float] | tuple[float, float], other: Array | tuple[float, float], reach: float) -> bool:
    dx, dy = float(other[0]) - place[0], float(other[1]) - place[1]
    return dx * dx + dy * dy < reach * reach
