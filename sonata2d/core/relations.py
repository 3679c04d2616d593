"""Activities of pedestrians, and relations of pedestrians to each other and to objects: one row each."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from .entities import Behaviour

Colour = tuple[int, int, int]  # red, green and blue, 0 to 255
Line = tuple[tuple[float, float], ...]  # points


@dataclass(frozen=True, slots=True)
class Activity:
    """An activity of a pedestrian: its name, its meaning, and the body's drawing.

    The drawing is in the body's frame, x ahead and y left, in units of its size: halfway between depth and breadth.

    Attributes:
        name: in files.
        text: meaning in English, for legends.
        colour: of the body.
        alone: activity of a pedestrian whose partners are absent; None: the same.
        foot: x, y, and extents ahead and to the left, of the left foot; the right foot is its mirror image. None:
            hidden.
        stride: from the middle to the foremost position of a foot that walks.
        limbs: lines of arms or thighs.
        width: of these lines.
        gesture: angle by which the limbs swing to both sides of the body, rad.
    """

    name: str
    text: str
    colour: Colour
    alone: str | None = None
    foot: tuple[float, float, float, float] | None = None
    stride: float = 0.0
    limbs: tuple[Line, ...] = ()
    width: float = 0.0
    gesture: float = 0.0


_WALKING_FOOT = (0.0, 0.38, 0.36, 0.17)

# Files list the names in this order: append only. The colours are Okabe and Ito's (Color Universal Design, 2008), which
# colour-blind readers can distinguish, and for sitting and queueing P. Tol's, since they have no more.
ACTIVITY: dict[str, Activity] = {
    activity.name: activity
    for activity in (
        Activity("standing", "standing", (150, 155, 163)),
        Activity("walking", "walking", (0, 114, 178), foot=_WALKING_FOOT, stride=0.5),
        Activity(
            "walking together", "walking together", (86, 180, 233), alone="walking", foot=_WALKING_FOOT, stride=0.5
        ),
        Activity(
            "talking", "talking", (204, 121, 167), alone="standing",
            limbs=(((0.1, -0.78), (0.62, -0.62), (0.8, -0.28)),), width=0.22,
        ),
        Activity(
            "using", "using an object", (230, 159, 0),
            limbs=(((0.1, -0.78), (0.5, -0.7), (0.85, -0.25)), ((0.1, 0.78), (0.5, 0.7), (0.85, 0.25))), width=0.2,
        ),
        Activity(
            "looking", "looking at an object", (240, 228, 66),
            limbs=(((0.0, 0.75), (-0.6, 0.35), (-0.6, -0.35), (0.0, -0.75)),), width=0.22,
        ),
        Activity(
            "sitting", "sitting", (153, 153, 51), foot=(1.75, 0.42, 0.42, 0.2),
            limbs=(((0.2, -0.42), (1.5, -0.42)), ((0.2, 0.42), (1.5, 0.42))), width=0.46,
        ),
        Activity(
            "queueing", "queueing", (136, 34, 85),
            limbs=(((0.0, 0.78), (0.5, 0.4), (0.5, -0.4), (0.0, -0.78)),), width=0.24,
        ),
        Activity(
            "arguing", "arguing", (213, 94, 0), alone="standing",
            limbs=(((0.1, -0.78), (0.6, -0.9), (1.05, -0.5)), ((0.1, 0.78), (0.6, 0.95), (0.9, 1.0))), width=0.22,
            gesture=0.35,
        ),
        Activity(
            "handing over", "handing something over", (68, 170, 153), alone="standing",
            limbs=(((0.1, -0.78), (0.7, -0.55), (1.25, -0.1)), ((0.1, 0.78), (0.7, 0.55), (1.25, 0.1))), width=0.2,
        ),
        Activity(
            "caring", "caring for somebody", (51, 34, 136), alone="standing",
            limbs=(((0.1, -0.78), (0.75, -0.6), (1.2, -0.35)), ((0.1, 0.78), (0.5, 0.7), (0.75, 0.3))), width=0.2,
        ),
    )
}  # fmt: skip
ACTIVITIES = tuple(ACTIVITY)


@dataclass(frozen=True, slots=True)
class Relation:
    """A relation of a pedestrian to another one, or to an object.

    Attributes:
        name: in files.
        title: of the pedestrians in it, for messages and `Scene.dropped`.
        setting: key of `ScenarioConfig` with the number of additional relations.
        distance: key of `ScenarioConfig` with the distance from the pedestrian to the other one or to the object.
        activity: of the pedestrians.
        behaviour: of the pedestrians at the start.
        humans: number of pedestrians, 2 or 1; one attends to an object.
        group: kind of the groups whose members have this relation to each other; None: no group.
        line_radius: half the width of the line of attention, m, which others should not cross; 0: there is none.
        at: type of furniture of the object; an empty text: the types that name this relation.
        in_file: whether the pedestrians walk one behind the other.
        by_follower: whether the one behind has the relation to the one ahead, instead of the one ahead to it.
    """

    name: str
    title: str
    setting: str
    distance: str
    activity: str
    behaviour: Behaviour = "standing"
    humans: int = 1
    group: Literal["talking", "walking"] | None = None
    line_radius: float = 0.05
    at: str = ""
    in_file: bool = False
    by_follower: bool = False


TALKING = "two_static_person_talking"
AT_LAPTOP = "human_laptop_interaction"
AT_PLANT = "human_plant_interaction"
WALKING_TOGETHER = "wandering_human_interacting"
AT_OBJECT = "human_object_interaction"
ARGUING = "arguing"
HANDING_OVER = "handing_over"
CARING = "caring_for"
WATCHING_TV = "watching_tv"
LEADING = "leading"
FOLLOWING = "following"

# Observations have the index of a relation: append only.
RELATION: dict[str, Relation] = {
    relation.name: relation
    for relation in (
        Relation(
            TALKING, "talking pair", "talking_pairs", "talking_distance", "talking",
            humans=2, group="talking", line_radius=0.15,
        ),
        Relation(AT_LAPTOP, "person at a laptop", "at_laptop", "laptop_distance", "using"),
        Relation(AT_PLANT, "person at a plant", "at_plant", "plant_distance", "looking"),
        Relation(
            WALKING_TOGETHER, "walking pair", "walking_pairs", "pair_spacing", "walking together", "wandering",
            humans=2, group="walking", line_radius=0.0,
        ),
        Relation(AT_OBJECT, "person at an object", "at_object", "object_distance", "looking"),
        Relation(
            ARGUING, "arguing pair", "arguing_pairs", "arguing_distance", "arguing",
            humans=2, group="talking", line_radius=0.3,
        ),
        Relation(
            HANDING_OVER, "pair that hands something over", "handing_over_pairs", "handing_over_distance",
            "handing over", humans=2, group="talking", line_radius=0.3,
        ),
        Relation(
            CARING, "person who cares for another", "caring_pairs", "caring_distance", "caring",
            humans=2, group="talking", line_radius=0.3,
        ),
        Relation(WATCHING_TV, "person who watches TV", "watching_tv", "tv_distance", "looking", at="tv"),
        Relation(
            LEADING, "person who leads another", "leading_pairs", "leading_distance", "walking together", "wandering",
            humans=2, group="walking", line_radius=0.0, in_file=True,
        ),
        Relation(
            FOLLOWING, "person who follows another", "following_pairs", "leading_distance", "walking together",
            "wandering", humans=2, group="walking", line_radius=0.0, in_file=True, by_follower=True,
        ),
    )
}  # fmt: skip
RELATIONS = tuple(RELATION)
_FIRST_ACTIVITIES = 8  # which every file lists
ORIGINAL_RELATIONS = RELATIONS[:4]  # of the SONATA toolkit (2020)


def activities_with(relations: Iterable[str]) -> tuple[str, ...]:
    """The activities that a file lists: the first ones, and those up to the last one that its relations need."""
    needed = (ACTIVITIES.index(RELATION[name].activity) + 1 for name in relations)
    return ACTIVITIES[: max([_FIRST_ACTIVITIES, *needed])]
