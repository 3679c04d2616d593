"""The Scene: all that is in a room at the start, and all that decides what happens in it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from typing import Any, Literal

import numpy as np

from .entities import EndsOn, Furniture, Goal, Group, Human, Interaction, Robot, Wall
from .geometry import Barriers, Disc, Point
from .portable_math import Array

PARKED, PARKED_APART = 200.0, 5.0  # m, of absent people from the room and from one another


@dataclass(frozen=True, slots=True)
class Rules:
    """How an episode is run.

    Attributes:
        dt: the control tick, s.
        substeps: physics steps within a tick.
        iterations: of the contact solver.
        time_limit: s.
        ends_on: besides the time limit, what ends the episode.
        guard: whether the robot's bumper limits its velocity by the gap.
        contact_distance: outlines nearer than this touch, m.
        side: +1 people evade to their right when they meet head-on, -1 to their left.
    """

    dt: float = 0.1
    substeps: int = 10
    iterations: int = 5
    time_limit: float = 60.0
    ends_on: tuple[EndsOn, ...] = ("goal", "time")
    guard: bool = True
    contact_distance: float = 0.01
    side: Literal[-1, 1] = 1

    @property
    def last_tick(self) -> int:
        """The tick at which time is up."""
        return int(self.time_limit / self.dt + 0.5)


@dataclass(frozen=True, slots=True)
class Social:
    """What people take up with each other, and with things, while the episode runs. Each chance is 0..1.

    Attributes:
        visits: that a wanderer, on arrival, goes to a free plant, laptop or other object, and attends to it.
        joins: that a wanderer, on arrival, joins somebody who stands, or a group that talks.
        meets: that two wanderers who come near each other stop and talk.
        leaves: that somebody who attends to a person or a thing at the start goes away, once their time is over.
        visit_time, talk_time: s, from and to.
    """

    visits: float = 0.0
    joins: float = 0.0
    meets: float = 0.0
    leaves: float = 0.0
    visit_time: tuple[float, float] = (5.0, 20.0)
    talk_time: tuple[float, float] = (10.0, 40.0)

    @property
    def is_lively(self) -> bool:
        """Whether anything changes."""
        return max(self.visits, self.joins, self.meets, self.leaves) > 0.0


@dataclass(frozen=True)
class Scene:
    """The layout an episode starts from. Everything that decides what happens in it is here.

    Attributes:
        name: of the scenario.
        family: scenario and kind of room; splits of a data set go by it.
        polygon: the room's outline, counter-clockwise; people and robot stay within.
        walls: all of them, the outline's edges first.
        seed, episode: what it was generated from; they also drive what people choose on their way.
        settings: the resolved settings it was generated from, as JSON would hold them; None if made by hand.
        dropped: what could not be placed although asked for.
    """

    name: str
    family: str
    polygon: tuple[Point, ...]
    walls: tuple[Wall, ...]
    furniture: tuple[Furniture, ...]
    humans: tuple[Human, ...]
    robot: Robot
    goal: Goal
    groups: tuple[Group, ...] = ()
    interactions: tuple[Interaction, ...] = ()
    rules: Rules = field(default_factory=Rules)
    social: Social = field(default_factory=Social)
    seed: int = 0
    episode: int = 0
    settings: dict[str, Any] | None = None
    dropped: tuple[str, ...] = ()

    @cached_property
    def barriers(self) -> Barriers:
        """Walls first, then furniture that has a body, as thick segments; see `barrier_owner`."""
        return Barriers.of([edge for _, edges in self._solids for edge in edges])

    @cached_property
    def barrier_owner(self) -> tuple[tuple[str, int], ...]:
        """What each barrier belongs to: ("wall", index) or ("object", id)."""
        return tuple(owner for owner, edges in self._solids for _ in edges)

    @cached_property
    def _solids(self) -> list[tuple[tuple[str, int], list[tuple[Point, Point, float]]]]:
        walls = [(("wall", k), [(wall.start, wall.end, 0.0)]) for k, wall in enumerate(self.walls)]
        things = [(("object", f.id), f.shape.edges(f.pose)) for f in self.furniture if f.on is None]
        return walls + things

    @cached_property
    def outline(self) -> Array:
        """The room's polygon as (K, 2)."""
        outline = np.array(self.polygon, dtype=float)
        outline.flags.writeable = False
        return outline

    @cached_property
    def standing(self) -> Barriers:
        """People who stand, as discs; those only who are there throughout."""
        return standing_throughout(self.humans)

    @cached_property
    def parking(self) -> Array:
        """(N, 2), m: far from the room a place for each person, where they are while they are absent."""
        x, y = self.outline.max(axis=0).tolist()
        places = [(x + PARKED, y + PARKED + PARKED_APART * k) for k in range(len(self.humans))]
        parking = np.array(places, dtype=float).reshape(-1, 2)
        parking.flags.writeable = False
        return parking

    @cached_property
    def shared(self) -> Barriers:
        """The outlines of what people in formation share as they talk: others walk round it, not through."""
        place = {human.id: human.pose.position for human in self.humans}
        return outlines([place[m] for m in g.members] for g in self.groups if g.kind == "talking" and g.formation)


def standing_throughout(humans: Iterable[Human]) -> Barriers:
    """Those who stand and are there from the start to the end, as discs."""
    return Barriers.of(Disc(h.radius).edges(h.pose)[0] for h in humans if h.stays and h.behaviour == "standing")


def outlines(rings: Iterable[Sequence[Point]]) -> Barriers:
    """The lines from place to place round each ring, m; of two places the one between them."""
    closed = ([*ring, ring[0]] if len(ring) > 2 else ring for ring in rings)
    return Barriers.of((a, b, 0.0) for ring in closed for a, b in pairwise(ring))
