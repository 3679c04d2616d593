"""`QueueLine`: the pedestrians in a queue, who move up one after the other."""

from __future__ import annotations

from ....core.entities import Queue
from ....core.geometry import Point, as_point
from ....core.portable_math import Array
from ....core.rng import AgentStreams
from .f_formations import distance
from .state import SocialState

_REACTION_TIME = (0.3, 0.9)  # s, after which a pedestrian follows when the place in front of it has become free
_AT_HEAD = 0.3  # m, from the first place, within which the first pedestrian is served
_ROOM_AT_HEAD = 0.6  # m, from the first place, at which the one that was served makes room for the next


class QueueLine:
    """The pedestrians that stand in one queue.

    Each has a slot, counted from the head, and may step forward when the slot in front of it is free; the first one is
    served while it stands at the head. Positions are never set: `standing_position` changes, and pedestrians follow it.

    Args:
        queue: the queue.
        social: the social state, which is updated.
        rng: of the pedestrians: their service and reaction times.
        dt: tick, s.

    Attributes:
        members: indices of the pedestrians, the first one first.
        has_moved: whether one of them has stepped forward in this tick.
    """

    def __init__(self, queue: Queue, social: SocialState, rng: AgentStreams, dt: float) -> None:
        self.queue, self._social, self._rng, self._dt = queue, social, rng, dt
        self.members: list[int] = []
        self.has_moved = False
        self._slot: list[int] = []  # of each member, strictly ascending
        self._move_at: list[int | None] = []  # tick at which each member steps forward
        self._served_at: int | None = None  # tick at which the service of the first member ends
        self._last_served: int | None = None

    @property
    def tail(self) -> int:
        """The first slot behind the last pedestrian."""
        return self._slot[-1] + 1 if self._slot else 0

    def slot(self, number: int) -> tuple[Point, Point]:
        """Where a pedestrian stands in a slot, and the point that it faces; m."""
        x, y = self.queue.slot(number)
        c, s = self.queue.pose.direction
        return (x, y), (x + 3.0 * c, y + 3.0 * s)

    def join(self, k: int) -> None:
        """Pedestrian k takes the first slot behind the last one."""
        self._slot.append(self.tail)
        self.members.append(k)
        self._move_at.append(None)
        self._social.start_standing(k, *self.slot(self._slot[-1]), posture="queueing")

    def advance(self, tick: int, position: Array) -> int | None:
        """Let pedestrians move up.

        Args:
            tick: that begins.
            position: (N, 2), m, of all pedestrians.

        Returns:
            Index of the pedestrian that leaves the queue because its service is over; None in most ticks.
        """
        self._move_up(tick, position)
        if not self.members or self._slot[0] > 0:
            return None
        if self._served_at is None:
            if distance(as_point(position[self.members[0]]), self.queue.slot(0)) < _AT_HEAD:
                self._served_at = tick + self._ticks(self.members[0], self.queue.service)
            return None
        if tick < self._served_at:
            return None
        self._served_at, self._last_served = None, self.members.pop(0)
        del self._slot[0], self._move_at[0]
        return self._last_served

    def _move_up(self, tick: int, position: Array) -> None:
        self.has_moved = False
        ahead = -1  # the slot of the member in front
        for n, k in enumerate(self.members):
            slot = self._slot[n]
            if slot - 1 > ahead and (slot > 1 or self._has_room_at_head(position)):
                move_at = self._move_at[n]
                if move_at is None:
                    self._move_at[n] = tick + self._ticks(k, _REACTION_TIME)
                elif tick >= move_at:
                    self._slot[n], self._move_at[n], self.has_moved = slot - 1, None, True
                    self._social.start_standing(k, *self.slot(slot - 1), posture="queueing")
            ahead = self._slot[n]

    def _has_room_at_head(self, position: Array) -> bool:
        """Whether the pedestrian that was served last has left the head."""
        k = self._last_served
        if k is not None and distance(as_point(position[k]), self.queue.slot(0)) > _ROOM_AT_HEAD:
            self._last_served = None
        return self._last_served is None

    def _ticks(self, k: int, times: tuple[float, float]) -> int:
        """A duration, drawn from the stream of pedestrian k, in ticks."""
        return int(self._rng[k].uniform(*times) / self._dt)
