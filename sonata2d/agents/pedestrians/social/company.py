"""Social state: the pedestrians that walk, the places of the others, and what each of them attends to."""

from __future__ import annotations

from itertools import accumulate
from typing import NamedTuple

import numpy as np

from ....core.compiled.kernel import subroutine
from ....core.compiled.packing import Bools, Floats, Floats2, Ints, Ints2
from ....core.portable_math import BoolArray
from ....core.relations import ACTIVITIES, RELATION, RELATIONS, TALKING
from ....core.scene import Scene

STANDING, SITTING, QUEUEING, WALKING = map(ACTIVITIES.index, ("standing", "sitting", "queueing", "walking"))
ARGUES = ACTIVITIES.index("arguing")
TALKS = RELATIONS.index(TALKING)
_WALKS = np.array([RELATION[name].group == "walking" for name in RELATIONS])
_ACTIVITY_OF = np.array([ACTIVITIES.index(RELATION[name].activity) for name in RELATIONS])
_MOST_PARTNERS = 8  # that a pedestrian gets besides those at the start


class Company(NamedTuple):
    """The social state of N pedestrians, in the scene's order.

    Attributes:
        is_walking: (N,) of bool.
        standing_position: (N, 2), m, where each pedestrian stands; meaningless for walking ones.
        facing_point: (N, 2), m, the point that a standing pedestrian without a partner faces.
        has_object: (N,) of bool, pedestrians that attend to an object, which is then their facing point.
        keeps_facing: (N,) of bool, members of an unchanged initial formation: they keep their initial facing point.
        posture: (N,) of int, activity of each pedestrian that neither walks nor interacts, into `ACTIVITIES`.
        is_brief: (N,) of bool, pedestrians that go on so soon that paths need not lead round them.
        activity: (N,) of int, into `ACTIVITIES`, as if all were present.
        partners: (N, P) of int, present pedestrians that each one talks or walks with; as many as `partner_count`.
        partner_count: (N,) of int.
        links: (L, 3) of int, interactions: index of the pedestrian, index of the other one, or N and the index of the
            object, and relation, into `RELATIONS`; as many as `link_count`.
        link_count: (1,) of int.
        version: (1,) of int, grows when activities or interactions change.
        object_position: (O, 2), m, of the scene's furniture.
        formation_start: (F + 1,) of int, where the members of each initial talking formation begin in `member`.
        member: of int.
        is_in_formation: (N,) of bool, members that have stayed in their initial formation.
        is_always_present: (N,) of bool, pedestrians that are present from start to end, unless they exit.
        stays: (N,) of bool, pedestrians that are present from the start, or from entering as a wandering one, to the
            end, unless they exit.
        size: (N,), m, radius of the circle around each body.
    """

    is_walking: Bools
    standing_position: Floats2
    facing_point: Floats2
    has_object: Bools
    keeps_facing: Bools
    posture: Ints
    is_brief: Bools
    activity: Ints
    partners: Ints2
    partner_count: Ints
    links: Ints2
    link_count: Ints
    version: Ints
    object_position: Floats2
    formation_start: Ints
    member: Ints
    is_in_formation: Bools
    is_always_present: Bools
    stays: Bools
    size: Floats


def company_of(scene: Scene) -> Company:
    """The social state at the start of an episode, with all pedestrians present."""
    humans, index = scene.humans, scene.human_table.row
    count = len(humans)
    objects = {piece.id: count + k for k, piece in enumerate(scene.furniture)}
    links = [(index[i.src], (index | objects)[i.dst], RELATIONS.index(i.relation)) for i in scene.interactions]
    partners = max((sum(k in link[:2] for link in links) for k in range(count)), default=0)
    formations = [[index[m] for m in g.members] for g in scene.groups if g.kind == "talking" and g.formation]
    in_formation = [k for formation in formations for k in formation]
    position = scene.human_table.position.copy()
    direction = np.array([human.pose.direction for human in humans], dtype=float).reshape(-1, 2)
    walking = np.array([human.walks_at_start for human in humans], dtype=bool)
    is_member = np.isin(np.arange(count), in_formation)
    company = Company(
        is_walking=walking,
        standing_position=position,
        facing_point=position + 3.0 * direction,
        has_object=np.zeros(count, dtype=bool),
        keeps_facing=is_member,
        posture=np.array(
            [SITTING if h.seat is not None else QUEUEING if h.queue is not None else STANDING for h in humans],
            dtype=np.int64,
        ),
        is_brief=np.zeros(count, dtype=bool),
        activity=np.zeros(count, dtype=np.int64),
        partners=np.zeros((count, partners + _MOST_PARTNERS), dtype=np.int64),
        partner_count=np.zeros(count, dtype=np.int64),
        links=np.array(links + [(0, 0, 0)] * (_MOST_PARTNERS * count), dtype=np.int64).reshape(-1, 3),
        link_count=np.array([len(links)]),
        version=np.zeros(1, dtype=np.int64),
        object_position=np.array([piece.pose.position for piece in scene.furniture], dtype=float).reshape(-1, 2),
        formation_start=np.array([*accumulate(map(len, formations), initial=0)], dtype=np.int64),
        member=np.array(in_formation, dtype=np.int64),
        is_in_formation=is_member.copy(),
        is_always_present=np.array([human.is_always_present for human in humans], dtype=bool),
        stays=np.array(
            [h.is_always_present or (h.leaves is None and h.behaviour == "wandering") for h in humans], dtype=bool
        ),
        size=scene.human_table.circumradius.copy(),
    )
    update_links(company, np.ones(count, dtype=bool))
    return company


@subroutine
def update_links(company: Company, is_present: BoolArray) -> None:
    """Derive activities, partners and attended objects from the interactions; absent pedestrians are no partners."""
    count = len(company.is_walking)
    for k in range(count):
        company.activity[k] = WALKING if company.is_walking[k] else company.posture[k]
        company.partner_count[k], company.has_object[k] = 0, False
    for n in range(company.link_count[0]):
        src, dst, relation = company.links[n, 0], company.links[n, 1], company.links[n, 2]
        for end in (src, dst):
            # an object has no activity, and a group that pauses does not walk
            if end < count and (not _WALKS[relation] or company.is_walking[end]):
                company.activity[end] = _ACTIVITY_OF[relation]
        if dst >= count:
            company.facing_point[src, 0] = company.object_position[dst - count, 0]
            company.facing_point[src, 1] = company.object_position[dst - count, 1]
            company.has_object[src] = True
        elif is_present[src] and is_present[dst]:
            _add_partner(company, src, dst)
            _add_partner(company, dst, src)
    company.version[0] += 1


@subroutine
def _add_partner(company: Company, k: int, other: int) -> None:
    if company.partner_count[k] < company.partners.shape[1]:
        company.partners[k, company.partner_count[k]] = other
        company.partner_count[k] += 1


@subroutine
def start_standing(
    company: Company, k: int, x: float, y: float, facing_x: float, facing_y: float, posture: int, is_brief: bool,
    is_present: BoolArray,
) -> None:  # fmt: skip
    """Pedestrian k stands, or sits, at a position from now on.

    Args:
        company: updated.
        k: index of the pedestrian.
        x, y, facing_x, facing_y: where it stands, and the point that it faces, m.
        posture: its activity if it has no interaction.
        is_brief: whether it goes on so soon that paths need not lead round it.
        is_present: (N,).
    """
    company.is_walking[k] = False
    company.standing_position[k, 0], company.standing_position[k, 1] = x, y
    company.facing_point[k, 0], company.facing_point[k, 1] = facing_x, facing_y
    company.posture[k], company.is_brief[k] = posture, is_brief
    update_links(company, is_present)


@subroutine
def add_link(company: Company, src: int, dst: int, relation: int) -> None:
    """Add an interaction; call `update_links` after the last one."""
    n = company.link_count[0]
    if n < len(company.links):
        company.links[n, 0], company.links[n, 1], company.links[n, 2] = src, dst, relation
        company.link_count[0] += 1
        company.keeps_facing[src] = False


@subroutine
def start_walking(company: Company, k: int, is_present: BoolArray) -> None:
    """Pedestrian k walks from now on; its interactions end, except with those that it walks with."""
    company.is_walking[k], company.keeps_facing[k], company.is_in_formation[k] = True, False, False
    for n in range(company.partner_count[k]):
        company.keeps_facing[company.partners[k, n]] = False
    kept = 0
    for n in range(company.link_count[0]):
        src, dst, relation = company.links[n, 0], company.links[n, 1], company.links[n, 2]
        if _WALKS[relation] or k not in (src, dst):
            company.links[kept, 0], company.links[kept, 1], company.links[kept, 2] = src, dst, relation
            kept += 1
    company.link_count[0] = kept
    update_links(company, is_present)


@subroutine
def is_unattended(company: Company, piece: int) -> bool:
    """Whether no pedestrian attends to a piece of furniture."""
    for n in range(company.link_count[0]):
        if company.links[n, 1] == len(company.is_walking) + piece:
            return False
    return True


@subroutine
def is_in_the_way(company: Company, k: int, is_present: BoolArray) -> bool:
    """Whether paths must lead round pedestrian k, which does not walk; one that sits is covered by its seat."""
    return bool(company.stays[k] and is_present[k] and not company.is_brief[k] and company.posture[k] != SITTING)
