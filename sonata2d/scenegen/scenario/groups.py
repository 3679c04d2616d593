"""The section `groups` of a scenario: how large walking and talking groups are, and how they stand."""

from __future__ import annotations

from typing import Any, Self

from pydantic import Field, NonNegativeFloat, field_validator, model_validator
from pydantic_core import PydanticCustomError

from ...core.entities import Formation
from ...core.geometry import Point
from .ranges import IntRange, Range, Settings, weighed

WALKING: tuple[Formation, ...] = ("abreast", "v")
PAIRS: tuple[Formation, ...] = ("face_to_face", "l", "side_by_side")
CIRCLES: tuple[Formation, ...] = ("circle", "semicircle")


class GroupConfig(Settings):
    """What the groups of `walking_groups` and `talking_groups` are like at the start.

    People who walk together do so abreast, or in a V with those in the middle behind (Moussaïd et al., PLoS ONE 5
    (2010) e10047). People who talk stand in a formation round a space that they share, the o-space, and face its middle
    (Kendon, Conducting Interaction, 1990): two face to face, in an L or side by side, more in a circle or a semicircle.
    Nobody and nothing else is placed in an o-space.

    Attributes:
        walking_size, talking_size: people in a group.
        walking_formations, formations: weight of each formation; a list of names, or one name, weighs them alike.
            Those that do not go with a group's size are passed over.
        walking_spacing, talking_spacing: m, between the centres of neighbours.
        v_angle: rad, from the way they go to the line between neighbours in a V.
        places: x, y, m, of the o-spaces of the first talking groups, if they are not to be drawn.
    """

    walking_size: IntRange = IntRange(2, 5)
    walking_formations: dict[Formation, NonNegativeFloat] = Field(default=dict.fromkeys(WALKING, 1.0))
    walking_spacing: Range = Range(0.7, 1.1)
    v_angle: Range = Range(1.1, 1.33)
    talking_size: IntRange = IntRange(2, 6)
    formations: dict[Formation, NonNegativeFloat] = Field(default=dict.fromkeys((*PAIRS, *CIRCLES), 1.0))
    talking_spacing: Range = Range(0.9, 1.2)
    places: tuple[Point, ...] = ()

    @field_validator("walking_formations", "formations", mode="before")
    @classmethod
    def _weigh_alike(cls, given: Any) -> Any:
        return weighed(given)

    @field_validator("walking_size", "talking_size", mode="after")
    @classmethod
    def _be_several(cls, size: IntRange) -> IntRange:
        most = 6
        if not 2 <= size.min <= size.max <= most:
            raise PydanticCustomError("size", "a group has 2 to {most} people", {"most": most})
        return size

    @field_validator("walking_spacing", "talking_spacing", mode="after")
    @classmethod
    def _leave_room(cls, spacing: Range) -> Range:
        if not spacing.min >= 0.5:
            raise PydanticCustomError("spacing", "neighbours in a group need 0.5 m or more between their centres")
        return spacing

    @field_validator("v_angle", mode="after")
    @classmethod
    def _be_a_v(cls, angle: Range) -> Range:
        if not 0.5 <= angle.min <= angle.max <= 1.5708:
            raise PydanticCustomError("v_angle", "the angle of a V must be within 0.5..1.5708 rad")
        return angle

    @model_validator(mode="after")
    def _have_a_formation_for_all(self) -> Self:
        """Formations are of their kind, and there is one for every size that may be drawn."""
        for key, known in (("walking_formations", WALKING), ("formations", (*PAIRS, *CIRCLES))):
            strange = [name for name in getattr(self, key) if name not in known]
            if strange:
                said = {"name": strange[0], "known": ", ".join(known), "path": (key,)}
                raise PydanticCustomError("formation", "'{name}' is none of {known}", said)
        sizes = {min(size, 3) for size in range(self.talking_size.min, self.talking_size.max + 1)}
        for size in sizes:
            if not sum(self.weights(size).values()) > 0.0:
                said = {"size": "two" if size == 2 else "three and more", "path": ("formations",)}
                raise PydanticCustomError("formation", "no formation for {size} people has a weight above 0", said)
        if not sum(self.walking_formations.values()) > 0.0:
            said = {"path": ("walking_formations",)}
            raise PydanticCustomError("formation", "at least one formation needs a weight above 0", said)
        return self

    def weights(self, size: int) -> dict[Formation, float]:
        """The talking formations for a group of that size."""
        fitting = PAIRS if size == 2 else CIRCLES
        return {name: weight for name, weight in self.formations.items() if name in fitting}
