"""How the members of a group stand to each other, in the group's own frame.

Source: walking: Moussaïd et al., PLoS ONE 5 (2010) e10047; talking: A. Kendon, Conducting Interaction (1990), ch. 7.
"""

from __future__ import annotations

from dataclasses import dataclass

from ..entities import Formation
from ..exact import PI, heading
from ..geometry import Pose

_BESIDE = 0.6  # m, from the middle of the o-space to the line on which two stand side by side
_WIDEST = 1.2  # m, of the o-space of an open formation
_FARTHEST = 1.75  # m, from its middle: nobody is beyond social distance (Hall) from anybody else


@dataclass(frozen=True, slots=True)
class Figure:
    """Where members stand: `space` is the radius of the o-space round the origin, m; 0 of those who walk."""

    formation: Formation
    poses: tuple[Pose, ...]
    space: float = 0.0


def walking(formation: Formation, size: int, spacing: float, angle: float) -> Figure:
    """People who walk along x, from the left one to the right one.

    Args:
        formation: `abreast` or `v`; of two in a V one is behind.
        spacing: m, between neighbours.
        angle: rad, between the way and the line to a neighbour in a V.
    """
    c, s = heading(angle if formation == "v" else PI / 2)
    x = y = 0.0
    places = [(x, y)]
    for k in range(1, size):
        if 2 * k == size and size > 2:  # the two in the middle are level
            y -= spacing
        else:
            x, y = x + (-spacing * c if 2 * k <= size else spacing * c), y - spacing * s
        places.append((x, y))
    middle = y / 2
    return Figure(formation, tuple(Pose(x, y - middle) for x, y in places))


def talking(formation: Formation, size: int, spacing: float) -> Figure:
    """People who face the middle of the space they share, at the origin; neighbours are `spacing` m apart."""
    if formation == "side_by_side":
        half = spacing / 2
        return Figure(formation, (Pose(-_BESIDE, -half), Pose(-_BESIDE, half)), _BESIDE - 0.1)
    whole = formation in ("circle", "face_to_face")
    step = PI / 2 if formation == "l" else 2 * PI / size if whole else PI / (size - 1)
    radius = min(spacing / (2 * heading(step / 2)[1]), _FARTHEST)  # the spacing is a chord of the circle
    poses = tuple(_inward(radius, PI + step * (k - (size - 1) / 2)) for k in range(size))
    return Figure(formation, poses, min(radius, _WIDEST) if formation == "semicircle" else radius)


def _inward(radius: float, angle: float) -> Pose:
    """Someone on a circle round the origin, who faces it."""
    c, s = heading(angle)
    return Pose(radius * c, radius * s, angle + PI)
