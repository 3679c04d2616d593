"""Drawing of a pedestrian's properties, and of its reaction to the robot."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from ..core.entities import DEFAULT_KIND, Behaviour, Human
from ..core.geometry import Pose, quantised
from ..core.person_kinds import PersonKind
from ..core.rng import RandomStream
from ..registry import person_kind
from .scenario.people import PersonSpec
from .scenario.sections import PersonConfig

_DRAWN = ("radius", "breadth", "desired_speed", "headway", "politeness")  # the order is part of what a seed means


def draw_kind(person: PersonConfig, rng: RandomStream) -> PersonKind:
    """Draw a kind of person by the section `person`; without weights, or with a single one, nothing is drawn."""
    weights = {name: weight for name, weight in (person.kinds or {DEFAULT_KIND: 1.0}).items() if weight > 0.0}
    names = list(weights)
    return person_kind(names[0] if len(names) == 1 else rng.choice(names, list(weights.values())))


def largest_radius(person: PersonConfig) -> float:
    """Largest radius of the circles around the outlines of the kinds of persons that are drawn, m; 0 for adults."""
    return max((person_kind(name).widest for name, weight in (person.kinds or {}).items() if weight > 0.0), default=0.0)


def who_sits(person: PersonConfig) -> PersonConfig:
    """The section `person` with the kinds of persons that sit down on seats; adults if there are no others."""
    sits = {name: weight for name, weight in (person.kinds or {}).items() if person_kind(name).side_steps}
    return person.model_copy(update={"kinds": sits if sum(sits.values()) > 0.0 else None})


def body_of_kind(kind: PersonKind, drawn: Mapping[str, float], rng: RandomStream) -> dict[str, Any]:
    """Replace the drawn properties of a person by those of its kind.

    Args:
        kind: of the person.
        drawn: by the section `person`: radius, breadth, desired_speed, headway, politeness.
        rng: random stream of the sizes and the speed of the kind; adults take no random number.

    Returns:
        Fields of `Human` by name.
    """
    values: dict[str, Any] = dict(drawn)
    if kind.depth is not None:
        values["radius"] = rng.uniform(*kind.depth) / 2
    if kind.breadth is not None:
        values["breadth"] = rng.uniform(*kind.breadth)
    if kind.length is not None:
        values["radius"], values["length"] = values["breadth"] / 2, rng.uniform(*kind.length)
    if kind.desired_speed is not None:
        values["desired_speed"] = rng.normal(*kind.desired_speed)
    values["headway"] *= kind.headway
    return {name: quantised(value) for name, value in values.items()} | {
        "kind": kind.name, "side_steps": kind.side_steps
    }  # fmt: skip


def draw_human(person: PersonConfig, behaviour: Behaviour, pose: Pose, rng: RandomStream) -> Human:
    """Draw a pedestrian by the section `person`; its id is 0, and its reaction is not drawn."""
    kind = draw_kind(person, rng)
    drawn = {key: getattr(person, key).draw(rng) for key in _DRAWN}
    fields = body_of_kind(kind, drawn, rng)
    reacts = 0.0 if rng.uniform() < person.ignores_robot else 1.0
    return Human(id=0, pose=pose, behaviour=behaviour, model=person.model, reacts_to_robot=reacts, **fields)


class ReactionSampler:
    """Draws the times of each pedestrian, its reaction to the robot, and its clearance.

    Each pedestrian has its own random stream, so that these settings change nothing else in a scene.

    Args:
        person: distributions of times, reactions and clearance.
        seed: of the data set.
        episode: number of the episode in the data set.
    """

    def __init__(self, person: PersonConfig, seed: int, episode: int) -> None:
        self._person, self._seed, self._episode = person, seed, episode
        self._reactions, self._weights = list(person.reactions), list(person.reactions.values())

    def assign(self, human: Human, given: PersonSpec | None = None, **changes: Any) -> Human:
        """Return the pedestrian with its times, reaction and clearance; one that ignores the robot keeps that.

        Args:
            human: without them. One that enters later has no pre-movement time unless it is given.
            given: settings of a pedestrian of the section `people`, which replace distributions.
            changes: other fields to replace, by name.
        """
        rng = RandomStream(self._seed, self._episode, "manners", changes.get("id", human.id))
        clearance = quantised(self._person.robot_clearance.draw(rng))
        reaction = None if given is None else given.reaction
        chosen = rng.choice(self._reactions, self._weights) if reaction is None else reaction
        pre_movement = None if given is None else given.pre_movement
        reaction_time = None if given is None else given.reaction_time
        if pre_movement is None and human.enters == 0:
            pre_movement = self._person.pre_movement
        # people who sit or queue at first, or enter later, go when they are ready
        walks = human.behaviour in ("wandering", "walking") and human.queue is None and human.seat is None
        if pre_movement is not None and walks:
            changes["pre_movement"] = quantised(pre_movement.draw(rng))
        changes["reaction_time"] = quantised((reaction_time or self._person.reaction_time).draw(rng))
        return replace(human, reaction=chosen, robot_clearance=clearance, **changes)
