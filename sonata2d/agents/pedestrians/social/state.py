"""`SocialState`: which pedestrians walk, where the others stand, and which pedestrians and objects they attend to."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Literal, NamedTuple

import numpy as np

from ....core.compiled.packing import Bools, Floats2, Ints, Ints2
from ....core.entities import Interaction
from ....core.geometry import Barriers, Disc, Point, Pose
from ....core.humans import activity_indices, frozen
from ....core.portable_math import BoolArray, IntArray, angle_of
from ....core.relations import ACTIVITIES, TALKING, WALKING_TOGETHER
from ....core.scene import Scene, closed_outlines
from ....core.vectors import lengths

_LARGEST_CIRCLE = 1.0  # m, from the centre of a conversation to its members, up to which others do not walk through it

Posture = Literal["standing", "sitting", "queueing"]  # activity of a pedestrian that neither walks nor interacts


class SocialArrays(NamedTuple):
    """The social state for kernels; the attributes of `SocialState`, and the partners in a table.

    Attributes:
        partners: (N, P) of int, the first `partner_count[k]` items of row k are valid.
        partner_count: (N,) of int.
    """

    is_walking: Bools
    standing_position: Floats2
    facing_point: Floats2
    has_object: Bools
    keeps_facing: Bools
    partners: Ints2
    partner_count: Ints


class SocialState:
    """Present activity of each pedestrian, which changes during an episode. Rows are in the scene's order.

    Args:
        scene: the initial state.

    Attributes:
        is_walking: (N,) of bool.
        standing_position: (N, 2), m, where each pedestrian stands; meaningless for walking ones.
        facing_point: (N, 2), m, the point that a standing pedestrian without a partner faces.
        has_object: (N,) of bool, pedestrians that attend to an object, which is then their facing point.
        keeps_facing: (N,) of bool, members of an unchanged initial formation: they keep their initial facing point.
        interactions: the present ones, including interactions of absent pedestrians.
        activity: (N,) of int, into `relations.ACTIVITIES`.
        partners: for each pedestrian, the indices of the present pedestrians that it talks or walks with.
        arrays: the state for kernels.
        is_always_present: for each pedestrian, whether it is present from the start to the end, unless it exits.
        stays: for each pedestrian, whether it is present from the start, or from entering as a wandering one, to the
            end, unless it exits.
    """

    def __init__(self, scene: Scene) -> None:
        humans = scene.humans
        self._index, self._ids = scene.human_table.row, scene.human_table.id.tolist()
        self._radius = [human.shape.circumradius for human in humans]  # standing people turn
        self._object_positions = {thing.id: thing.pose.position for thing in scene.furniture}
        self.is_walking = np.array([human.walks_at_start for human in humans], dtype=bool)
        self._posture = [
            "standing" if h.seat is None and h.queue is None else "queueing" if h.seat is None else "sitting"
            for h in humans
        ]
        self._is_brief = [False] * len(humans)
        self.standing_position = scene.human_table.position.copy()
        direction = np.array([human.pose.direction for human in humans], dtype=float).reshape(-1, 2)
        self.facing_point = self.standing_position + 3.0 * direction
        self.has_object = np.zeros(len(humans), dtype=bool)
        self._formations = [
            [self._index[m] for m in g.members] for g in scene.groups if g.kind == "talking" and g.formation
        ]
        self.keeps_facing = np.zeros(len(humans), dtype=bool)
        self.keeps_facing[[k for formation in self._formations for k in formation]] = True
        self.is_always_present = [human.is_always_present for human in humans]
        self.stays = [h.is_always_present or (h.leaves is None and h.behaviour == "wandering") for h in humans]
        self._absent: frozenset[int] = frozenset()
        self.interactions = scene.interactions
        self.partners: list[list[int]] = []
        self.activity: IntArray
        self._update()

    def set_presence(self, is_present: BoolArray | None) -> None:
        """Exclude absent pedestrians from `partners`.

        Args:
            is_present: (N,); None: all are present.
        """
        if is_present is None and not self._absent:
            return
        absent = frozenset() if is_present is None else frozenset(np.flatnonzero(~is_present).tolist())
        if self._absent != absent:
            self._absent = absent
            self._update()

    def is_absent(self, k: int) -> bool:
        """Whether pedestrian k is not present now."""
        return k in self._absent

    def start_standing(
        self,
        k: int,
        position: Point,
        facing_point: Point,
        interactions: Iterable[Interaction] = (),
        posture: Posture = "standing",
        is_brief: bool = False,
    ) -> None:
        """Pedestrian k stands, or sits, at a position from now on, m.

        Args:
            k: index of the pedestrian.
            position, facing_point: where it stands, and what it faces, m.
            interactions: additional ones.
            posture: what it does if it has no interaction.
            is_brief: whether it goes on so soon that paths need not lead round it.
        """
        self.is_walking[k], self.standing_position[k], self.facing_point[k] = False, position, facing_point
        self._posture[k], self._is_brief[k] = posture, is_brief
        interactions = tuple(interactions)
        self.keeps_facing[[self._index[interaction.src] for interaction in interactions]] = False
        self.interactions += interactions
        if interactions:
            self._update()
        else:
            self._update_activity(k)

    def start_walking(self, k: int) -> None:
        """Pedestrian k walks from now on; its interactions end, except with those that it walks with."""
        own_id = self._ids[k]
        self.is_walking[k] = True
        self.keeps_facing[[k, *self.partners[k]]] = False
        self._formations = [[member for member in formation if member != k] for formation in self._formations]
        if self._interacts(k):
            self.interactions = tuple(
                i for i in self.interactions if own_id not in (i.src, i.dst) or i.relation == WALKING_TOGETHER
            )
            self._update()
        else:
            self._update_activity(k)

    def talking_interactions(self, k: int, others: Iterable[int]) -> list[Interaction]:
        """The interactions of pedestrian k when it joins others: one with each of them."""
        return [Interaction(self._ids[other], TALKING, self._ids[k]) for other in others]

    def is_unattended(self, object_id: int) -> bool:
        """Whether no pedestrian attends to an object."""
        return all(interaction.dst != object_id for interaction in self.interactions)

    def standing_humans(self) -> Barriers:
        """Discs of the pedestrians that stand now and for some time; without those that leave by a schedule."""
        standing = [k for k in np.flatnonzero(~self.is_walking).tolist() if self.is_in_the_way(k)]
        return Barriers.of(
            [Disc(self._radius[k]).edges(Pose(*self.standing_position[k].tolist()))[0] for k in standing]
        )

    def is_in_the_way(self, k: int) -> bool:
        """Whether paths must lead round pedestrian k, which does not walk; one that sits is covered by its seat."""
        is_here = self.stays[k] and k not in self._absent
        return is_here and not self._is_brief[k] and self._posture[k] != "sitting"

    def shared_spaces(self) -> Barriers:
        """The outlines of the spaces between people who talk: initial formations, and circles that form later."""
        rings = (self.standing_position[ring].tolist() for ring in (*self._formations, *self._circles()))
        return closed_outlines([(x, y) for x, y in ring] for ring in rings)

    def _circles(self) -> Iterator[list[int]]:
        """The members of each conversation that is no initial formation, in their order round its centre."""
        known = {k for formation in self._formations for k in formation}
        standing = [k for k in np.flatnonzero(~self.is_walking).tolist() if self.is_in_the_way(k)]
        for k in standing:
            members = [k, *(other for other in self.partners[k] if other in standing)]
            if len(members) < 2 or k != min(members) or known.intersection(members):
                continue
            places = self.standing_position[members].tolist()
            centre = np.array([sum(xs) for xs in zip(*places, strict=True)]) / len(places)
            offset = np.array(places) - centre
            if lengths(offset).max() <= _LARGEST_CIRCLE:
                angle = [angle_of(y, x) for x, y in offset.tolist()]
                yield [member for _, member in sorted(zip(angle, members, strict=True))]

    def _interacts(self, k: int) -> bool:
        """Whether pedestrian k attends to anything, or is attended to."""
        own_id = self._ids[k]
        return any(own_id in (interaction.src, interaction.dst) for interaction in self.interactions)

    def _alone(self, k: int) -> str:
        """The activity of pedestrian k if it had no interactions."""
        return "walking" if self.is_walking[k] else self._posture[k]

    def _update_activity(self, k: int) -> None:
        """Derive the activity of pedestrian k, whose interactions are the same as before."""
        if self._interacts(k):
            self._update()
            return
        activity = self.activity.copy()
        activity[k] = ACTIVITIES.index(self._alone(k))
        self.activity = frozen(activity)

    def _update(self) -> None:
        """Derive activities, partners and attended objects from the interactions."""
        alone = {id: self._alone(k) for k, id in enumerate(self._ids)}
        self.activity = activity_indices(alone, self.interactions)
        self.partners = [[] for _ in self._ids]
        self.has_object[:] = False
        for interaction in self.interactions:
            src, dst = self._index[interaction.src], self._index.get(interaction.dst)
            if dst is None:  # not a pedestrian: an object
                self.facing_point[src], self.has_object[src] = self._object_positions[interaction.dst], True
            elif not {src, dst} & self._absent:
                self.partners[src].append(dst)
                self.partners[dst].append(src)
        counts = [len(partners) for partners in self.partners]
        table = np.zeros((len(counts), max(counts, default=0)), dtype=np.int64)
        for k, partners in enumerate(self.partners):
            table[k, : len(partners)] = partners
        self.arrays = SocialArrays(
            self.is_walking, self.standing_position, self.facing_point, self.has_object, self.keeps_facing, table,
            np.array(counts, dtype=np.int64),
        )  # fmt: skip
