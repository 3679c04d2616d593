"""What every walking model is told, and what it answers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from ...exact import Array
from ...scene import Scene


@dataclass(frozen=True, slots=True)
class Walkers:
    """All who move, the robot last: M of them, in the scene's order. SI, world frame.

    Attributes:
        position, velocity: (M, 2).
        direction: (M, 2), unit vectors to where each wants to go next; zero for who wants to stay, and for the robot.
        heading: (M, 2), unit vectors of the bodies.
        desired_speed: (M,), m/s.
        radius: (M,), m.
        weight: (M, M), how much column i minds row j, 0..1: nobody minds themselves, or whom a wall hides.
        member: (M, M), 1 where row j walks in column i's group, else 0; None where nobody walks in one.
        bond: (M,), 0..1, how much they keep to their group: less where they have goals of their own.
    """

    position: Array
    velocity: Array
    direction: Array
    heading: Array
    desired_speed: Array
    radius: Array
    weight: Array
    member: Array | None = None
    bond: Array | None = None


def times_a_tick(evaluations: int, dt: float) -> int:
    """In a tick of dt, s, of a law that needs so many evaluations in 0.1 s; of one that is not stiff, one."""
    return 1 if evaluations == 1 else max(int(evaluations * dt / 0.1 + 0.999), 1)


class WalkingModel(Protocol):
    """A law of walking, made for one scene.

    Attributes:
        evaluations: how often within a tick of 0.1 s its forces must be evaluated.
    """

    evaluations: int

    def __init__(self, scene: Scene) -> None: ...

    def acceleration(self, walkers: Walkers) -> Array:
        """(M, 2), m/s2, of everybody."""
