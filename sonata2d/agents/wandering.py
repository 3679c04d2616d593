"""Where walkers go, and the way there.

Who is wandering takes a place in the room, and another on arrival; who is walking has goals of their own.
"""

from __future__ import annotations

import numpy as np

from ..chance import Chance
from ..entities import Scene
from ..exact import Array
from ..frame import Humans
from ..navigation import FreeSpace

CLEARANCE = 0.10  # m, that ways keep from walls, furniture and standing people
SQUEEZE = 0.05  # m, by which a body may seem to be in a wall before its way counts as shut
ARRIVED = 0.5  # m from the goal
TURNED = 0.35  # m from a waypoint, when the next one is aimed at
NEAREST_GOAL = 2.0  # m, closer places are not worth a walk
LOOK_EVERY = 5  # ticks between looks whether the way is still open
PATIENCE = 30  # ticks in which a walker wants to have got on, else it goes elsewhere
PROGRESS = 0.4  # m
_ATTEMPTS = 30


class Wanderers:
    """The ways of all who walk; walkers of one group share the leader's.

    Args:
        scene: the room, and who walks.
    """

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        walking = [k for k, human in enumerate(scene.humans) if human.behaviour != "standing"]
        self._chance = {k: Chance(scene.seed, scene.episode, "people", scene.humans[k].id) for k in walking}
        self._goals = {k: list(scene.humans[k].goals) for k in walking if scene.humans[k].behaviour == "walking"}
        index = {human.id: k for k, human in enumerate(scene.humans)}
        follows = {m: index[g.members[0]] for g in scene.groups if g.kind == "walking" for m in g.members}
        follows = {m: leader for m, leader in follows.items() if index[m] not in self._goals}
        self.leader = {k: follows.get(scene.humans[k].id, k) for k in walking}  # in the scene's order
        self._ways: dict[int, Array] = {k: np.zeros((0, 2)) for k in walking}
        self._followed: dict[int, Array] = {}  # the leader's way that a follower took over
        self._next: dict[int, int] = dict.fromkeys(walking, 0)
        self._anchor: dict[int, tuple[float, float]] = {}
        self.target = np.array([human.pose.position for human in scene.humans], dtype=float).reshape(-1, 2)
        self.is_last = np.zeros(len(scene.humans), dtype=bool)  # whose target is where they will stay
        reach = max((scene.humans[k].radius for k in walking), default=0.2) + CLEARANCE
        solids = scene.barriers.joined(scene.standing)
        self._space = FreeSpace(scene.outline, solids.joined(scene.shared), reach)
        self._passable = FreeSpace(scene.outline, solids, reach - CLEARANCE - SQUEEZE)
        low, high = scene.outline.min(axis=0), scene.outline.max(axis=0)
        self._box = (*low.tolist(), *high.tolist())

    def update(self, tick: int, humans: Humans) -> Array:
        """Each human's next waypoint, (N, 2), m; one's own start for who stands."""
        if not self.leader:
            return self.target
        places = humans.position.tolist()
        for k, leader in self.leader.items():
            place = (places[k][0], places[k][1])
            if leader == k and (self._needs_a_goal(tick, k, place) or self._is_stuck(tick, k, place)):
                self._set_out(k, place)
            if leader != k and self._followed.get(k) is not self._ways[leader]:
                self._followed[k] = self._ways[k] = self._ways[leader]
                self._next[k] = min(1, len(self._ways[k]) - 1)
        self._advance(tick, humans.position)
        for k in self.leader:
            if len(self._ways[k]):
                self.target[k] = self._ways[k][self._next[k]]
                self.is_last[k] = self._goals.get(k) == [] and self._next[k] == len(self._ways[k]) - 1
        return self.target.copy()

    def _needs_a_goal(self, tick: int, k: int, place: tuple[float, float]) -> bool:
        """Whether a walker is there; who found nowhere to go looks again now and then."""
        way = self._ways[k]
        if k in self._goals and not self._goals[k]:
            return False
        if len(way) < 2:
            return tick % LOOK_EVERY == 0
        return self._next[k] == len(way) - 1 and _within(place, way[-1], ARRIVED)

    def _is_stuck(self, tick: int, k: int, place: tuple[float, float]) -> bool:
        """Whether a walker hardly moved for as long as its patience lasts."""
        if k in self._goals or (tick + k) % PATIENCE:
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
        x0, y0, x1, y1 = self._box
        chance = self._chance[k]
        for _ in range(_ATTEMPTS):
            goal = (chance.uniform(x0, x1), chance.uniform(y0, y1))
            if _within(place, goal, NEAREST_GOAL) or not self._space.is_free(np.array([goal]))[0]:
                continue
            way = self._space.path(place, goal)
            if way is not None:
                self._ways[k], self._next[k] = way, min(1, len(way) - 1)
                return
        self._ways[k], self._next[k] = np.array([place]), 0

    def _advance(self, tick: int, position: Array) -> None:
        """Aim at the next waypoint once this one is reached or the next in view; find a new way where it is shut."""
        looking = [k for k in self.leader if len(self._ways[k])] if tick % LOOK_EVERY == 0 else []
        for k in self.leader:
            way, n = self._ways[k], self._next[k]
            if n < len(way) - 1 and _within(position[k].tolist(), way[n], TURNED):
                self._next[k] = n + 1
        if not looking:
            return
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

    def _find_back(self, k: int, place: list[float]) -> None:
        """A new way to the same goal for one who was pushed off the old one."""
        goal = self._ways[k][-1]
        way = self._space.path((place[0], place[1]), (float(goal[0]), float(goal[1])))
        if way is not None:
            self._ways[k], self._next[k] = way, min(1, len(way) - 1)


def _within(place: list[float] | tuple[float, float], other: Array | tuple[float, float], reach: float) -> bool:
    dx, dy = float(other[0]) - place[0], float(other[1]) - place[1]
    return dx * dx + dy * dy < reach * reach
