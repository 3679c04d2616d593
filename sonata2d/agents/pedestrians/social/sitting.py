"""`Seats`: pedestrians walk to a seat, turn their back to it, sit down, and get up to the same place later."""

from __future__ import annotations

from collections.abc import Iterator

from ....core.entities import Furniture
from ....core.geometry import Point
from ....core.scene import Scene
from ..wayfinding import Wayfinding
from .f_formations import distance
from .state import Posture, SocialState
from .tasks import Task

_TURN_TIME = 1.6  # s, in which a pedestrian turns its back to the seat
_STANDS_AGAIN = 0.12  # m, from the place beside the seat
_MARGIN = 0.05  # m, by which that place is farther from the seat than paths are

TURNING, SITTING, RISING = range(3)  # values of `Task.phase` after arrival at the seat


class Seats:
    """The seats of a scene, and who sits on them.

    A seat is solid for all pedestrians except the one that sits on it, from sitting down until it stands again. Its
    `standing_position` moves onto the seat and back, and the pedestrian follows it.

    Args:
        scene: the furniture.
        social: the social state, which is updated.
        wayfinding: the free space.
        dt: tick, s.

    Attributes:
        pairs: see `CrowdCommands.seats`.
    """

    def __init__(self, scene: Scene, social: SocialState, wayfinding: Wayfinding, dt: float) -> None:
        self._social, self._wayfinding, self._turn_ticks = social, wayfinding, int(_TURN_TIME / dt)
        self._side = scene.rules.side
        self._seats = {piece.id: (k, piece) for k, piece in enumerate(scene.furniture) if piece.is_seat}
        self._sitting: dict[int, int] = {}  # index in the scene's furniture of each pedestrian's seat
        self.pairs: tuple[tuple[int, int], ...] = ()

    def tasks(self, claimed: set[int | None]) -> Iterator[Task]:
        """A task for each free seat that can be reached.

        Args:
            claimed: ids of the seats that a pedestrian sits on or goes to.
        """
        for id, (_, seat) in self._seats.items():
            place = self._place_beside(seat) if id not in claimed else None
            if place is not None:
                yield Task("sit", place, seat.pose.position, object_id=id)

    def initial_task(self, k: int, id: int, until: int) -> Task:
        """The task of pedestrian k, which sits from the start until a tick."""
        seat = self._seats[id][1]
        place = self._place_beside(seat) or seat.approaches(self._clearance)[0]
        task = Task("sit", place, seat.pose.position, object_id=id, until=until, has_arrived=True, phase=SITTING)
        self._sit_down(k, id)
        return task

    def arrive(self, k: int, task: Task, tick: int) -> None:
        """Pedestrian k has reached the place beside its seat."""
        self._stand(k, task.position, self._seat_of(task), "standing")
        task.has_arrived, task.phase, task.until = True, TURNING, tick + self._turn_ticks

    def advance(self, k: int, task: Task, tick: int) -> bool:
        """Go on to the next phase when `task.until` is reached.

        Returns:
            Whether pedestrian k begins to sit: the caller sets the end of the task.
        """
        if task.phase == TURNING and tick >= task.until:
            task.phase = SITTING
            self._sit_down(k, self._seat_of(task).id)
            return True
        if task.phase == SITTING and tick >= task.until:
            place = self._place_beside(self._seat_of(task))
            if place is not None:  # else it waits until there is room to stand
                task.position = place
                self._stand(k, place, self._seat_of(task), "sitting")
                task.phase = RISING
        return False

    def is_over(self, task: Task, position: Point) -> bool:
        """Whether a pedestrian stands beside its seat again."""
        return task.phase == RISING and distance(position, task.position) < _STANDS_AGAIN

    def release(self, k: int) -> None:
        """Pedestrian k does not sit any more."""
        if k in self._sitting:
            del self._sitting[k]
            self.pairs = tuple(sorted(self._sitting.items()))

    def _stand(self, k: int, place: Point, seat: Furniture, posture: Posture) -> None:
        """Pedestrian k stands or sits at a place, m, and faces the direction of its seat."""
        (x, y), (fx, fy) = place, seat.front
        self._social.start_standing(k, place, (x + 3.0 * fx, y + 3.0 * fy), posture=posture)

    def _sit_down(self, k: int, id: int) -> None:
        index, seat = self._seats[id]
        self._stand(k, seat.pose.position, seat, "sitting")
        self._sitting[k] = index
        self.pairs = tuple(sorted(self._sitting.items()))

    def _seat_of(self, task: Task) -> Furniture:
        assert task.object_id is not None
        return self._seats[task.object_id][1]

    @property
    def _clearance(self) -> float:
        return self._wayfinding.space.clearance + _MARGIN

    def _place_beside(self, seat: Furniture) -> Point | None:
        """The first free place of those in front of a seat, at one side and at the other, m; None if none is free."""
        front, left, right = seat.approaches(self._clearance)
        places = (front, right, left) if self._side > 0 else (front, left, right)
        return next((place for place in places if self._wayfinding.is_open(place, place)), None)
