"""Formations of groups: poses of the members in the group's own frame."""

from __future__ import annotations

from dataclasses import dataclass

from ..core.entities import Formation
from ..core.geometry import Pose
from ..core.portable_math import PI, unit_vector

_SIDE_BY_SIDE_OFFSET = 0.6  # m, from the o-space centre to the line on which two members stand side by side
_MAX_OPEN_RADIUS = 1.2  # m, of the o-space of a semicircle
_MAX_RADIUS = 1.75  # m, of a formation: all members are within social distance (Hall) of each other


@dataclass(frozen=True, slots=True)
class GroupLayout:
    """Poses of the members of a group in the group's own frame.

    Attributes:
        formation: name of the formation.
        poses: one for each member.
        o_space: radius of the o-space around the origin, m; 0 for walking groups.
    """

    formation: Formation
    poses: tuple[Pose, ...]
    o_space: float = 0.0


def walking_formation(formation: Formation, size: int, spacing: float, angle: float) -> GroupLayout:
    """Arrange a group that walks along x, from its left to its right member.

    Args:
        formation: `abreast` or `v`; in a V of two, the second member walks behind the first.
        size: number of members.
        spacing: m, between neighbours.
        angle: rad, between the walking direction and the line to a neighbour in a V.
    """
    c, s = unit_vector(angle if formation == "v" else PI / 2)
    x = y = 0.0
    points = [(x, y)]
    for k in range(1, size):
        if 2 * k == size and size > 2:  # the two middle members of an even number walk side by side
            y -= spacing
        else:
            x, y = x + (-spacing * c if 2 * k <= size else spacing * c), y - spacing * s
        points.append((x, y))
    centre = y / 2
    return GroupLayout(formation, tuple(Pose(x, y - centre) for x, y in points))


def talking_formation(formation: Formation, size: int, spacing: float) -> GroupLayout:
    """Arrange a group that talks: its members face the centre of their o-space, which is the origin.

    Args:
        formation: any formation of a talking group; with two members `face_to_face`, `l` or `side_by_side`.
        size: number of members.
        spacing: m, between neighbours; less where the formation would be too large.
    """
    if formation == "side_by_side":
        half = spacing / 2
        pair = Pose(-_SIDE_BY_SIDE_OFFSET, -half), Pose(-_SIDE_BY_SIDE_OFFSET, half)
        return GroupLayout(formation, pair, _SIDE_BY_SIDE_OFFSET - 0.1)
    is_closed = formation in ("circle", "face_to_face")
    step = PI / 2 if formation == "l" else 2 * PI / size if is_closed else PI / (size - 1)
    radius = min(spacing / (2 * unit_vector(step / 2)[1]), _MAX_RADIUS)  # the spacing is a chord of the circle
    poses = tuple(_pose_on_circle(radius, PI + step * (k - (size - 1) / 2)) for k in range(size))
    return GroupLayout(formation, poses, min(radius, _MAX_OPEN_RADIUS) if formation == "semicircle" else radius)


def _pose_on_circle(radius: float, angle: float) -> Pose:
    """Return the pose on a circle around the origin that faces the origin."""
    c, s = unit_vector(angle)
    return Pose(radius * c, radius * s, angle + PI)
