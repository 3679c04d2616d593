"""Drawing of a pedestrian's properties, and of its reaction to the robot."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from ..core.entities import Behaviour, Human
from ..core.geometry import Pose, quantised
from ..core.rng import RandomStream
from .scenario.people import PersonSpec
from .scenario.sections import PersonConfig


def draw_human(person: PersonConfig, behaviour: Behaviour, pose: Pose, rng: RandomStream) -> Human:
    """Draw a pedestrian by the section `person`; its id is 0, and its reaction is not drawn."""
    return Human(
        id=0,
        pose=pose,
        radius=quantised(person.radius.draw(rng)),
        breadth=quantised(person.breadth.draw(rng)),
        desired_speed=quantised(person.desired_speed.draw(rng)),
        headway=quantised(person.headway.draw(rng)),
        politeness=quantised(person.politeness.draw(rng)),
        behaviour=behaviour,
        model=person.model,
        reacts_to_robot=0.0 if rng.uniform() < person.ignores_robot else 1.0,
    )


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
