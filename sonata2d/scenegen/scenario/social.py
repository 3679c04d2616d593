"""Social life and manners towards the robot: their settings, and who gets which manners."""

from __future__ import annotations

from dataclasses import replace

from pydantic import NonNegativeFloat, PositiveFloat, field_validator, model_validator
from pydantic_core import PydanticCustomError

from ...core.entities import Human, Reaction
from ...core.geometry import quantised
from ...core.rng import RandomStream
from ...core.scene import Social
from .ranges import Normal, Range, Settings, Share


class ClearanceConfig(Normal):
    """A normal distribution cut off at both ends, m, from outline to outline.

    The default is what walkers kept from a robot that crossed their way (Vassallo et al., Gait & Posture 51 (2017) 97),
    within two standard deviations.
    """

    mean: PositiveFloat = 0.83
    sd: PositiveFloat = 0.27
    min: NonNegativeFloat = 0.29
    max: PositiveFloat = 1.37


class SocialConfig(Settings):
    """What people take up while the episode runs; nothing unless set. `visits` and `joins` together are 1 at most.

    Attributes:
        visits: the chance that a wanderer, on arrival, goes to a free plant, laptop, shelf, TV or other object, and
            attends to it for `visit_time`.
        joins: the chance that a wanderer, on arrival, joins who stands, or a group that talks, for `talk_time`.
        meets: the chance that two wanderers who come near each other stop and talk for `talk_time`.
        leaves: the chance that somebody who attends to a person or a thing at the start goes away after that time.
        visit_time, talk_time: s.
    """

    visits: Share = 0.0
    joins: Share = 0.0
    meets: Share = 0.0
    leaves: Share = 0.0
    visit_time: Range = Range(5, 20)
    talk_time: Range = Range(10, 40)

    @model_validator(mode="after")
    def _share_arrivals(self) -> SocialConfig:
        if self.visits + self.joins > 1.0:
            both = {"both": round(self.visits + self.joins, 4)}
            raise PydanticCustomError("social", "visits and joins are {both} together; they may be 1 at most", both)
        return self

    @field_validator("visit_time", "talk_time", mode="after")
    @classmethod
    def _take_time(cls, time: Range) -> Range:
        if not time.min > 0.0:
            raise PydanticCustomError("time", "a time must be above 0")
        return time

    def social(self) -> Social:
        """As the rest of sonata2d knows it."""
        times = {key: (getattr(self, key).min, getattr(self, key).max) for key in ("visit_time", "talk_time")}
        return Social(self.visits, self.joins, self.meets, self.leaves, **times)


def with_manners(
    humans: tuple[Human, ...],
    chosen: list[Reaction | None],
    reactions: dict[Reaction, float],
    clearance: ClearanceConfig,
    seed: int,
    episode: int,
) -> tuple[Human, ...]:
    """The people with a reaction to the robot, and a clearance; who ignores it goes on doing so.

    Each draws from a stream of their own, so that the rest of the scene does not depend on it.

    Args:
        humans: in the scene's order.
        chosen: reactions of the first of them; None: drawn, as those of the others.
        reactions: by weight.
        clearance: to be drawn.
        seed, episode: of the streams.
    """
    told = [*chosen, *[None] * (len(humans) - len(chosen))]
    return tuple(
        _mannered(human, own, reactions, clearance, RandomStream(seed, episode, "manners", human.id))
        for human, own in zip(humans, told, strict=True)
    )


def _mannered(
    human: Human, own: Reaction | None, reactions: dict[Reaction, float], clearance: ClearanceConfig, rng: RandomStream
) -> Human:
    room = quantised(clearance.draw(rng))
    reaction = rng.choice(list(reactions), list(reactions.values())) if own is None else own
    return replace(human, reaction=reaction, robot_clearance=room)
