"""Ids: people 1..P, those who stand first, then things P+1..: tables, laptops, plants, all others. The robot is 0."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations
from typing import Literal

from ..entities import TALKING, WALKING_TOGETHER, Furniture, Group, Human, Interaction
from .cast import Cluster, Entity

Key = tuple[int, int]  # a cluster's index and a member's in it; -1 and an index: a fixed piece

_FIXED = -1
_TYPES = ("table", "laptop", "plant")
_GROUPS: dict[str | None, Literal["talking", "walking"]] = {TALKING: "talking", WALKING_TOGETHER: "walking"}


@dataclass(frozen=True, slots=True)
class Company:
    """Everybody and everything in a room, with their ids, and who belongs with whom."""

    humans: tuple[Human, ...]
    furniture: tuple[Furniture, ...]
    groups: tuple[Group, ...]
    interactions: tuple[Interaction, ...]


def numbered(placed: list[tuple[Cluster, tuple[Entity, ...]]], fixed: tuple[Furniture, ...]) -> Company:
    """Give ids to fixed pieces and to the members of placed clusters."""
    entries: dict[Key, Entity] = {(_FIXED, k): piece for k, piece in enumerate(fixed)}
    entries |= {(k, m): member for k, (_, members) in enumerate(placed) for m, member in enumerate(members)}
    humans = {key: entity for key, entity in entries.items() if isinstance(entity, Human)}
    things = {key: entity for key, entity in entries.items() if isinstance(entity, Furniture)}
    people = sorted(humans, key=lambda key: humans[key].behaviour != "standing")
    pieces = sorted(things, key=lambda key: _rank(things[key].type))
    ids = {key: k for k, key in enumerate(people + pieces, start=1)}

    relations = [(k, cluster) for k, (cluster, _) in enumerate(placed) if cluster.relation]
    groups = [(k, cluster) for k, cluster in relations if cluster.relation in _GROUPS]
    group = {k: number for number, (k, _) in enumerate(groups, start=1)}
    return Company(
        tuple(replace(humans[key], id=ids[key], group=group.get(key[0])) for key in people),
        tuple(replace(things[key], id=ids[key], on=_carrier(key, things[key], ids)) for key in pieces),
        tuple(
            Group(group[k], _GROUPS[one.relation], tuple(ids[key] for key in _members(k, one)), one.formation)
            for k, one in groups
        ),
        tuple(
            Interaction(ids[a], cluster.relation or "", ids[b])
            for k, cluster in relations
            for a, b in _ties(k, cluster)
        ),
    )


def _rank(type_: str) -> int:
    return _TYPES.index(type_) if type_ in _TYPES else len(_TYPES)


def _carrier(key: Key, piece: Furniture, ids: dict[Key, int]) -> int | None:
    return None if piece.on is None else ids[key[0], piece.on]


def _members(k: int, cluster: Cluster) -> list[Key]:
    return [(k, m) for m in range(len(cluster.members))]


def _ties(k: int, cluster: Cluster) -> list[tuple[Key, Key]]:
    """Who attends to whom or what: in a group each to each, else the first member to the last or to the fixed piece."""
    if cluster.relation in _GROUPS:
        return list(combinations(_members(k, cluster), 2))
    return [((k, 0), (k, len(cluster.members) - 1) if cluster.fixed is None else (_FIXED, cluster.fixed))]
