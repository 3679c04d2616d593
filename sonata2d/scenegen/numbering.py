"""Numbering of placed entities, and the groups and interactions between the numbers."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace
from itertools import combinations

from ..core.entities import Furniture, Group, Human, Interaction
from ..core.geometry import Pose
from ..core.relations import RELATION, Relation
from ..registry import FURNITURE_TYPES
from .human_sampling import ReactionSampler
from .sampling import EntityCluster

Key = tuple[int, int]  # index of a cluster and of a member in it; for fixed furniture -1 and its index

_FIXED = -1


@dataclass(frozen=True, slots=True)
class NumberedEntities:
    """Pedestrians and furniture with their ids, and the groups and interactions between these ids."""

    humans: tuple[Human, ...]
    groups: tuple[Group, ...]
    interactions: tuple[Interaction, ...]
    furniture: tuple[Furniture, ...] = ()


def ordered_entities(
    placed: list[tuple[EntityCluster, list[Pose]]], fixed: tuple[Furniture, ...]
) -> tuple[dict[Key, Human], dict[Key, Furniture]]:
    """Order pedestrians, then furniture, with their poses in the world frame, as they will be numbered.

    Standing pedestrians come before wandering ones; furniture is in the order of its registered types, others last.

    Args:
        placed: clusters, each with the poses of its members in the world frame.
        fixed: fixed furniture.
    """
    rank = {name: k for k, name in enumerate(FURNITURE_TYPES)}
    humans: list[tuple[Key, Human]] = []
    furniture = [((_FIXED, k), piece) for k, piece in enumerate(fixed)]
    for k, (cluster, poses) in enumerate(placed):
        for m, (member, pose) in enumerate(zip(cluster.members, poses, strict=True)):
            if isinstance(member, Human):
                humans.append(((k, m), replace(member, pose=pose)))
            else:
                furniture.append(((k, m), replace(member, pose=pose)))
    humans.sort(key=lambda item: item[1].behaviour != "standing")
    furniture.sort(key=lambda item: rank.get(item[1].type, len(rank)))
    return dict(humans), dict(furniture)


def number_entities(
    clusters: list[EntityCluster],
    humans: dict[Key, Human],
    furniture: dict[Key, Furniture],
    people: NumberedEntities,
    reactions: ReactionSampler,
) -> NumberedEntities:
    """Give ids to pedestrians, furniture and groups, and to each pedestrian its reaction to the robot.

    Args:
        clusters: the placed ones.
        humans, furniture: as `ordered_entities` returns them.
        people: pedestrians of the section `people`, whose ids are taken; the lowest free ones are given.
        reactions: by id.
    """
    keys = [*humans, *furniture]
    ids = dict(zip(keys, free_ids({human.id for human in people.humans}, len(keys)), strict=True))
    related = [(k, cluster, RELATION[cluster.relation]) for k, cluster in enumerate(clusters) if cluster.relation]
    groups = [(k, cluster, relation.group) for k, cluster, relation in related if relation.group]
    free_groups = free_ids({group.id for group in people.groups}, len(groups))
    group_ids = dict(zip((k for k, *_ in groups), free_groups, strict=True))
    return NumberedEntities(
        tuple(reactions.assign(human, id=ids[key], group=group_ids.get(key[0])) for key, human in humans.items()),
        tuple(
            Group(group_ids[k], kind, tuple(ids[key] for key in _member_keys(k, cluster)), cluster.formation)
            for k, cluster, kind in groups
        ),
        tuple(
            interaction(relation, ids[a], ids[b])
            for k, cluster, relation in related
            for a, b in _interacting_keys(k, cluster, relation)
        ),
        tuple(
            # a piece lies on a member of its cluster, or on another piece of the fixed furniture
            replace(piece, id=ids[key], on=None if piece.on is None else ids[key[0], piece.on])
            for key, piece in furniture.items()
        ),
    )


def interaction(relation: Relation, first: int, second: int) -> Interaction:
    """The interaction of two members of a pair or group, by their ids; the first one walks ahead."""
    ends = (second, first) if relation.by_follower else (first, second)
    return Interaction(ends[0], relation.name, ends[1])


def free_ids(taken: Collection[int | None], count: int) -> list[int]:
    """Return the lowest `count` ids from 1 that are not taken."""
    return [number for number in range(1, len(taken) + count + 1) if number not in taken][:count]


def _member_keys(k: int, cluster: EntityCluster) -> list[Key]:
    return [(k, m) for m in range(len(cluster.members))]


def _interacting_keys(k: int, cluster: EntityCluster, relation: Relation) -> list[tuple[Key, Key]]:
    """Return the pairs of a relation: all pairs of a group; else the first member with the last or the fixed piece."""
    if relation.group:
        return list(combinations(_member_keys(k, cluster), 2))
    return [((k, 0), (k, len(cluster.members) - 1) if cluster.fixed is None else (_FIXED, cluster.fixed))]
