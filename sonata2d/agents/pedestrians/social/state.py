"""Who is about what: who walks, where who stands keeps to, who attends to whom or what. It may change in the run."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from ....core.entities import TALKING, Interaction
from ....core.geometry import Barriers, Disc, Point, Pose
from ....core.humans import activities
from ....core.portable_math import Array, unit_vectors
from ....core.scene import Scene, outlines


class SocialState:
    """What each person is about now, in the scene's order.

    Args:
        scene: how it is at the start.

    Attributes:
        walks: (N,) of bool.
        home: (N, 2), m, where those who stand keep to.
        front: (N, 2), m, what those who stand turn their bodies to if it is nobody.
        has_thing: (N,) of bool, who attends to a thing, which is then their front.
        keeps_facing: (N,) of bool, who stands in a formation as it was at the start, and faces what it shares.
        interactions, activity: as they stand now, for the snapshot.
        partners: of each person the indices of those they talk or walk with, and who are there.
        stays: of each person whether they are there from the start to the end.
    """

    def __init__(self, scene: Scene) -> None:
        people = scene.humans
        self._index = {human.id: k for k, human in enumerate(people)}
        self._ids = [human.id for human in people]
        self._radius = [human.radius for human in people]
        self._things = {thing.id: thing.pose.position for thing in scene.furniture}
        self.walks = np.array([human.behaviour != "standing" for human in people], dtype=bool)
        self.home = np.array([human.pose.position for human in people], dtype=float).reshape(-1, 2)
        self.front = self.home + 3.0 * unit_vectors(np.array([human.pose.theta for human in people]))
        self.has_thing = np.zeros(len(people), dtype=bool)
        self._circles = [
            [self._index[m] for m in g.members] for g in scene.groups if g.kind == "talking" and g.formation
        ]
        self.keeps_facing = np.zeros(len(people), dtype=bool)
        self.keeps_facing[[k for circle in self._circles for k in circle]] = True
        self.stays = [human.stays for human in people]
        self._absent: frozenset[int] = frozenset()
        self.interactions = scene.interactions
        self.partners: list[list[int]] = []
        self.activity: Any = None
        self._renew()

    def attend(self, there: Array | None) -> None:
        """Only who is there is company for others; (N + 1,), 0 for who is absent; None: nobody is."""
        away = [] if there is None else np.flatnonzero(there[:-1] == 0.0).tolist()
        if self._absent != frozenset(away):
            self._absent = frozenset(away)
            self._renew()

    def stand(self, k: int, place: Point, front: Point, ties: Iterable[Interaction]) -> None:
        """Somebody stands from now on, and attends to what these say."""
        self.walks[k], self.home[k], self.front[k] = False, place, front
        ties = tuple(ties)
        self.keeps_facing[[self._index[tie.src] for tie in ties]] = False
        self.interactions += ties
        self._renew()

    def walk(self, k: int) -> None:
        """Somebody walks from now on, and is done with whom or what they attended to."""
        me = self._ids[k]
        self.walks[k] = True
        self.keeps_facing[[k, *self.partners[k]]] = False
        self._circles = [[member for member in circle if member != k] for circle in self._circles]
        self.interactions = tuple(tie for tie in self.interactions if me not in (tie.src, tie.dst))
        self._renew()

    def talk(self, k: int, others: Iterable[int]) -> list[Interaction]:
        """The ties of somebody who joins others: one with each."""
        return [Interaction(self._ids[other], TALKING, self._ids[k]) for other in others]

    def is_free(self, thing: int) -> bool:
        """Whether nobody attends to a thing, told by its id."""
        return all(tie.dst != thing for tie in self.interactions)

    def standing(self) -> Barriers:
        """All who stand now and are there to the end, as discs."""
        stand = [k for k in np.flatnonzero(~self.walks).tolist() if self.stays[k]]
        return Barriers.of([Disc(self._radius[k]).edges(Pose(*self.home[k].tolist()))[0] for k in stand])

    def shared(self) -> Barriers:
        """The outlines of what is shared by those who have talked in formation from the start."""
        return outlines([(float(x), float(y)) for x, y in self.home[circle].tolist()] for circle in self._circles)

    def _renew(self) -> None:
        """Work out anew who does what with whom."""
        walks = dict(zip(self._ids, self.walks.tolist(), strict=True))
        self.activity = activities(walks, self.interactions)
        self.partners = [[] for _ in self._ids]
        self.has_thing[:] = False
        for tie in self.interactions:
            src, dst = self._index[tie.src], self._index.get(tie.dst)
            if dst is not None and not {src, dst} & self._absent:
                self.partners[src].append(dst)
                self.partners[dst].append(src)
            elif dst is None:
                self.front[src], self.has_thing[src] = self._things[tie.dst], True
