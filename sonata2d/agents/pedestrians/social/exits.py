"""`Exits`: the doors through which pedestrians leave."""

from __future__ import annotations

from ....core.entities import Door, Human
from ....core.geometry import Point
from ....core.rng import RandomStream
from ....core.scene import Scene
from ..wayfinding import Wayfinding
from .f_formations import distance

_ENTRANCE = 1.0  # m, from a door to where those that came through it appeared, at most, besides half its width
_MARGIN = 0.05  # m, by which the place before a door is farther from the wall than paths are
_REACH = 0.12  # m, beyond that place, in which a pedestrian disappears


class Exits:
    """Chooses doors for pedestrians that leave, and tells when they have reached them.

    Args:
        scene: the doors.
        wayfinding: the free space.
    """

    def __init__(self, scene: Scene, wayfinding: Wayfinding) -> None:
        self._wayfinding = wayfinding
        self._doors = [door for door in scene.doors if door.share > 0.0]
        self._direction = {door.id: door.pose.direction for door in scene.doors}

    def choose(self, rng: RandomStream, human: Human) -> Door | None:
        """A door by share, other than the one through which a pedestrian came, if there is another; None if none."""
        others = [door for door in self._doors if not _came_through(human, door)] or self._doors
        return rng.choice(others, [door.share for door in others]) if others else None

    def place_before(self, door: Door, position: Point) -> Point:
        """Where a pedestrian, which comes from a position, leaves through a door; m."""
        room = door.reach
        _, left = self._relative(door, position)
        return door.pose.to_world((self._depth, min(max(left, -room), room)))

    def has_reached(self, door: Door, position: Point) -> bool:
        """Whether a pedestrian at a position, m, is in the opening."""
        ahead, left = self._relative(door, position)
        return ahead < self._depth + _REACH and abs(left) < door.width / 2

    @property
    def _depth(self) -> float:
        return self._wayfinding.space.clearance + _MARGIN

    def _relative(self, door: Door, point: Point) -> Point:
        """A point relative to a door: into the room, and to the left; m."""
        c, s = self._direction[door.id]
        dx, dy = point[0] - door.pose.x, point[1] - door.pose.y
        return dx * c + dy * s, dy * c - dx * s


def _came_through(human: Human, door: Door) -> bool:
    """Whether a pedestrian has entered through a door."""
    return human.enters > 0 and distance(human.pose.position, door.pose.position) < door.width / 2 + _ENTRANCE
