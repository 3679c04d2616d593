"""Metrics of interactions: time to collision with humans, intrusion into groups and interactions."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np

from ..core.geometry import contact_times
from ..core.portable_math import Array, BoolArray
from ..core.proxemics import SOCIAL_DISTANCE
from .definition import BODIES, metric
from .trajectory import Trajectory


@metric("s", "more", needs=BODIES, headline=True)
def time_to_collision_min(trajectory: Trajectory) -> float | None:
    """Min over states and people of the time until the outlines touch if both keep their velocities.

    The person also keeps the heading. 0 if the outlines overlap; not defined if they never would touch. Of a person
    that is a disc: (C·V − √D) / |V|², where C = q − p, V = v_robot − v_person, R = r_robot + r_person, D = (C·V)² −
    |V|²(|C|² − R²), if C·V > 0 and D > 0.

    Source: Francis et al., arXiv 2306.16740, table of metrics (TTC).
    """
    relative_velocity = trajectory.velocity[:, None, :] - trajectory.human_velocity
    radii, body = trajectory.human_radius + trajectory.radius, (trajectory.human_direction, trajectory.human_shoulder)
    smallest = contact_times(trajectory.offset, relative_velocity, radii, *body).min(initial=np.inf)
    return float(smallest) if np.isfinite(smallest) else None


@metric("share", "less", needs={"robot", "robot.radius", "humans.group"}, headline=True)
def group_intrusion(trajectory: Trajectory) -> float | None:
    """Fraction of states in which the circle round the robot meets the convex hull of the centres of a group's members.

    Only members within 3.6 m of each other count; not defined without groups.

    Source: the o-space is A. Kendon's (Conducting Interaction, 1990), the hull sonata2d's.
    """
    column = trajectory.human_column
    groups = [[column[m] for m in group.members] for group in trajectory.scene.groups if len(group.members) > 1]
    if not groups:
        return None
    return float(np.any([_within_group(trajectory, members) for members in groups], axis=0).mean())


@metric("share", "less", needs={"robot", "robot.radius", "frames.interactions"}, headline=True)
def interaction_intrusion(trajectory: Trajectory) -> float | None:
    """Fraction of states in which the circle round the robot meets the line between the centres of an interacting pair.

    The pair interacts in that state: two people, or a person and an object. Not defined without interactions.
    """
    cut, is_defined = np.zeros(len(trajectory), dtype=bool), False
    for indices, start, end in _interaction_lines(trajectory):
        is_defined = True
        cut[indices] |= _segment_distance(trajectory.position[indices], start, end) < trajectory.radius
    return float(cut.mean()) if is_defined else None


def _within_group(trajectory: Trajectory, members: Sequence[int]) -> BoolArray:
    """(L,), whether the circle round the robot meets the convex hull of the members that are near each other.

    A point of the hull lies within a triangle of three members or on the line between two.
    """
    positions = trajectory.human_position[:, members]
    within = np.zeros(len(trajectory), dtype=bool)
    near = {}
    for i, j in combinations(range(len(members)), 2):
        offset = positions[:, i] - positions[:, j]
        near[i, j] = (offset * offset).sum(axis=1) <= SOCIAL_DISTANCE * SOCIAL_DISTANCE  # False for NaN
        distance = _segment_distance(trajectory.position, positions[:, i], positions[:, j])
        within |= near[i, j] & (distance < trajectory.radius)
    for i, j, k in combinations(range(len(members)), 3):
        together = near[i, j] & near[j, k] & near[i, k]
        within |= together & _in_triangle(trajectory.position, positions[:, i], positions[:, j], positions[:, k])
    return within


def _interaction_lines(trajectory: Trajectory) -> Iterator[tuple[list[int], Array, Array]]:
    """For each interacting pair: the K states in which it interacts, and both positions then, (K, 2) each, m."""
    document, column = trajectory.record.document, trajectory.human_column
    objects = {thing.id: thing.pose.position for thing in trajectory.scene.furniture}
    states: dict[tuple[int, int], list[int]] = {}
    for index, state in enumerate([*document["frames"], document["final"]][: len(trajectory)]):
        for source, _, target in state["interactions"]:
            if source in column and (target in column or target in objects):
                states.setdefault((source, target), []).append(index)
    for (source, target), indices in states.items():
        start = trajectory.human_position[indices, column[source]]
        if target in column:
            yield indices, start, trajectory.human_position[indices, column[target]]
        else:  # objects do not move
            yield indices, start, np.tile(objects[target], (len(indices), 1))


def _segment_distance(points: Array, start: Array, end: Array) -> Array:
    """(L,), m, from each point to its segment, all (L, 2); NaN where an end is absent."""
    along, offset = end - start, points - start
    squared_length = (along * along).sum(axis=1)
    t = np.clip((offset * along).sum(axis=1) / np.where(squared_length > 0.0, squared_length, 1.0), 0.0, 1.0)
    away = offset - t[:, None] * along
    distance: Array = np.sqrt((away * away).sum(axis=1))
    return distance


def _in_triangle(points: Array, a: Array, b: Array, c: Array) -> BoolArray:
    """(L,), whether each point lies on the same side of all three edges; all arguments (L, 2)."""

    def side(p: Array, q: Array) -> Array:
        along, offset = q - p, points - p
        side: Array = along[:, 0] * offset[:, 1] - along[:, 1] * offset[:, 0]
        return side

    sides = np.stack((side(a, b), side(b, c), side(c, a)))
    return np.asarray((sides > 0.0).all(axis=0) | (sides < 0.0).all(axis=0))


METRICS = (time_to_collision_min, group_intrusion, interaction_intrusion)
