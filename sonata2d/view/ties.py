"""Which interactions are drawn: of a group of more than two those of neighbours only, or nobody could tell them."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

from ..core.entities import Group, Interaction
from ..core.geometry import Point
from ..core.snapshot import Snapshot
from .brush import Brush
from .palette import PURPLE


def drawn_ties(snapshot: Snapshot) -> list[Interaction]:
    """The interactions of a look without those across a group of more than two."""
    rings = circles(snapshot)
    across = {pair for ring, closed in rings for pair in _across(ring, closed=closed)}
    return [tie for tie in snapshot.interactions if frozenset((tie.src, tie.dst)) not in across]


def circles(snapshot: Snapshot, kind: str | None = None) -> list[tuple[list[int], bool]]:
    """Members who interact now, in their order, and whether the last stands beside the first; groups of three and more.

    Args:
        kind: of the groups; any unless given.
    """
    pairs = {frozenset((tie.src, tie.dst)) for tie in snapshot.interactions}
    groups = [group for group in snapshot.scene.groups if kind in (None, group.kind)]
    rings = [([m for m in g.members if _is_with(m, g.members, pairs)], _is_closed(g)) for g in groups]
    return [(ring, closed) for ring, closed in rings if len(ring) > 2]


def draw_circle(brush: Brush, places: Sequence[Point]) -> None:
    """The space that a talking group shares, its o-space (A. Kendon, Conducting Interaction, 1990)."""
    if len(places) < 3:
        return
    x, y = (sum(place[k] for place in places) / len(places) for k in (0, 1))
    for share in (1.0, 0.72):
        brush.wash(PURPLE, 26, [(x + share * (px - x), y + share * (py - y)) for px, py in places])


def _is_with(member: int, members: Sequence[int], pairs: set[frozenset[int]]) -> bool:
    """Whether somebody interacts with others of their group, and not with a thing or somebody else alone."""
    return any(frozenset((member, other)) in pairs for other in members if other != member)


def _is_closed(group: Group) -> bool:
    return group.formation == "circle"


def _across(ring: Sequence[int], *, closed: bool) -> set[frozenset[int]]:
    """The pairs of a group that do not stand beside each other."""
    beside = {frozenset(pair) for pair in pairwise([*ring, ring[0]] if closed else ring)}
    return {pair for a in ring for b in ring if a != b and (pair := frozenset((a, b))) not in beside}
