"""How urgent were meetings, and did the robot come between people who belong together?"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations
from typing import Any

import numpy as np

from ..core.portable_math import Array
from ..core.proxemics import SOCIAL_DISTANCE
from .definition import OURS, Metric
from .trajectory import Trajectory


def times_to_collision(offset: Array, closing: Array, reach: Array | float) -> Array:
    """Seconds until two discs meet if both keep their velocity; 0 if they overlap, inf if they never meet.

    Args:
        offset: (…, 2), m, C, from one centre to the other; NaN gives inf.
        closing: (…, 2), m/s, V, the first one's velocity less the second one's.
        reach: R, m, sum of the radii.

    Source: the smaller root of |C − V t| = R.
    """
    along = (offset * closing).sum(axis=-1)
    square = (closing * closing).sum(axis=-1)
    beyond = (offset * offset).sum(axis=-1) - np.square(reach)
    root = along * along - square * beyond
    meets = (along > 0.0) & (root > 0.0)
    when = (along - np.sqrt(np.where(meets, root, 0.0))) / np.where(meets, square, 1.0)
    return np.where(beyond <= 0.0, 0.0, np.where(meets, when, np.inf))


def time_to_collision_min(run: Trajectory) -> float | None:
    """s, the least over looks and people; None if the robot never was on a way to meet anybody."""
    closing = run.velocity[:, None, :] - run.people[:, :, 3:5]
    least = times_to_collision(run.offset, closing, run.radii + run.radius).min(initial=np.inf)
    return float(least) if np.isfinite(least) else None


def group_intrusion(run: Trajectory) -> float | None:
    """Share of looks at which the robot's outline is within a group; None where there are no groups."""
    column = {human.id: k for k, human in enumerate(run.scene.humans)}
    groups = [[column[m] for m in group.members] for group in run.scene.groups if len(group.members) > 1]
    if not groups:
        return None
    return float(np.any([_within_group(run, members) for members in groups], axis=0).mean())


def interaction_intrusion(run: Trajectory) -> float | None:
    """Share of looks at which the robot's outline cuts the line between any two that interact; None if nobody does."""
    cut, any_tie = np.zeros(len(run), dtype=bool), False
    for looks, start, end in _ties(run):
        any_tie = True
        cut[looks] |= _to_segment(run.position[looks], start, end) < run.radius
    return float(cut.mean()) if any_tie else None


def _within_group(run: Trajectory, members: Sequence[int]) -> Any:
    """(L,) of bool: is the outline less than its radius from the hull of those members who are near one another?

    A point of the hull is in a triangle of members, or on the line between two.
    """
    places = run.people[:, members, :2]
    within = np.zeros(len(run), dtype=bool)
    near = {}
    for i, j in combinations(range(len(members)), 2):
        apart = places[:, i] - places[:, j]
        near[i, j] = (apart * apart).sum(axis=1) <= SOCIAL_DISTANCE * SOCIAL_DISTANCE  # False for NaN
        within |= near[i, j] & (_to_segment(run.position, places[:, i], places[:, j]) < run.radius)
    for i, j, k in combinations(range(len(members)), 3):
        together = near[i, j] & near[j, k] & near[i, k]
        within |= together & _in_triangle(run.position, places[:, i], places[:, j], places[:, k])
    return within


def _ties(run: Trajectory) -> Iterator[tuple[Any, Array, Array]]:
    """Of every two that interact: the looks at which they do, and where both are then, (K, 2) each."""
    document, column = run.record.document, {human.id: k for k, human in enumerate(run.scene.humans)}
    things = {thing.id: thing.pose.position for thing in run.scene.furniture}
    looks: dict[tuple[int, int], list[int]] = {}
    for look, told in enumerate([*document["frames"], document["final"]][: len(run)]):
        for src, _, dst in told["interactions"]:
            if src in column and (dst in column or dst in things):
                looks.setdefault((src, dst), []).append(look)
    for (src, dst), when in looks.items():
        start = run.people[when, column[src], :2]
        is_person = dst in column
        yield when, start, run.people[when, column[dst], :2] if is_person else np.tile(things[dst], (len(when), 1))


def _to_segment(points: Array, start: Array, end: Array) -> Array:
    """(L,), m, from each point to its segment, all (L, 2); NaN where an end is not there."""
    way, off = end - start, points - start
    square = (way * way).sum(axis=1)
    t = np.clip((off * way).sum(axis=1) / np.where(square > 0.0, square, 1.0), 0.0, 1.0)
    away = off - t[:, None] * way
    distance: Array = np.sqrt((away * away).sum(axis=1))
    return distance


def _in_triangle(points: Array, a: Array, b: Array, c: Array) -> Any:
    """(L,) of bool, all (L, 2): is each point on the same side of the three edges?"""

    def side(p: Array, q: Array) -> Any:
        along, off = q - p, points - p
        return along[:, 0] * off[:, 1] - along[:, 1] * off[:, 0]

    sides = np.stack((side(a, b), side(b, c), side(c, a)))
    return (sides > 0.0).all(axis=0) | (sides < 0.0).all(axis=0)


METRICS = (
    Metric(
        "time_to_collision_min", "s", "more",
        "min over looks and people of (C·V − √D) / |V|², where C = q − p, V = v_robot − v_person, R = r_robot +"
        " r_person, D = (C·V)² − |V|²(|C|² − R²), if C·V > 0 and D > 0; 0 if |C| ≤ R; not defined if never",
        "Francis et al., arXiv 2306.16740, table of metrics (TTC)", time_to_collision_min, headline=True,
    ),
    Metric(
        "group_intrusion", "share", "less",
        "share of looks at which the robot's outline meets the convex hull of a group's centres, taken over members"
        " within 3.6 m of one another; not defined without groups",
        f"the o-space is A. Kendon's (Conducting Interaction, 1990), the hull {OURS}'s", group_intrusion, headline=True,
    ),
    Metric(
        "interaction_intrusion", "share", "less",
        "share of looks at which the robot's outline meets the line between the centres of two that interact just then"
        " (person and person, person and object); not defined if nobody does",
        OURS, interaction_intrusion, headline=True,
    ),
)  # fmt: skip
