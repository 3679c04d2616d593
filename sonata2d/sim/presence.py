"""Pedestrians that enter and leave, and recorded ones that follow their tracks.

The physics space keeps the same bodies from start to end. An absent pedestrian is parked far outside the room, at a
place of its own; it feels no force and is in no snapshot.

A recorded pedestrian has a kinematic body: forces do not move it, it passes through walls, the robot and other recorded
pedestrians, and it pushes aside all other pedestrians. Its velocity is set once per tick such that it
is on its track at every tick, up to rounding in the last digit.
"""

from __future__ import annotations

import numpy as np
import pymunk

from ..core.humans import X, Y
from ..core.portable_math import Array, BoolArray
from ..core.scene import Scene

ENTRY_OVERLAP = 0.04  # m, of the circles around two bodies: with a larger one, the pedestrian that enters waits
ENTRY_GAP = 0.05  # m, gap that a wandering pedestrian, as those that come through doors, waits for


class Presence:
    """Lets pedestrians enter and leave, and moves the recorded ones.

    Args:
        scene: pedestrians with their ticks of entering and leaving.
        bodies: of the pedestrians, in the scene's order, at their initial positions.
        is_absent: (N,), all False; is updated.

    Attributes:
        all_present: whether no pedestrian is absent.
        is_absent: (N,) of bool.
        absent_ids: ids of the absent pedestrians.
        has_recorded: whether some pedestrians follow tracks.

    Raises:
        ValueError: a recorded pedestrian has no track.
    """

    all_present: bool
    absent_ids: frozenset[int]

    def __init__(self, scene: Scene, bodies: list[pymunk.Body], is_absent: BoolArray) -> None:
        self._humans, self._bodies, self._scene = scene.humans, bodies, scene
        self._dt = scene.rules.dt
        self._radius = np.array([*scene.human_table.circumradius, scene.robot.radius])
        self._recorded = _recorded_rows(scene)
        self.has_recorded = bool(self._recorded)
        self._to_enter = [k for k, human in enumerate(scene.humans) if human.enters > 0]
        self._to_leave = [k for k, human in enumerate(scene.humans) if human.leaves is not None]
        self._parties = _parties(scene)
        self.is_absent = is_absent
        for k in self._recorded:
            self._place(k, self._humans[k].enters)
        for k in self._to_enter:
            self._park(k)
        self._update_attributes()

    @property
    def can_change(self) -> bool:
        """Whether some pedestrians enter or leave by schedule."""
        return bool(self._to_leave or self._to_enter)

    def follow_tracks(self, tick: int) -> None:
        """Set the velocities of recorded pedestrians that lead to their track positions at the next tick."""
        for k in self._recorded:
            if not self.is_absent[k]:
                (x, y), (next_x, next_y) = self._bodies[k].position, self._humans[k].track_position(tick + 1)
                self._bodies[k].velocity = (next_x - x) / self._dt, (next_y - y) / self._dt

    def update(self, tick: int, leaving: tuple[int, ...], rows: Array) -> tuple[list[int], list[int]]:
        """Let pedestrians enter and leave at the start of a tick.

        Args:
            tick: the tick that starts.
            leaving: indices of pedestrians that have reached the goal at which they leave.
            rows: (N + 1, 4), x, y, vx, vy of all bodies with the robot last; the rows of pedestrians that enter are
                updated.

        Returns:
            Indices of the pedestrians that have entered, and of the pedestrians that have left.
        """
        left = [k for k in leaving if not self.is_absent[k]]
        left += [k for k in self._to_leave if not self.is_absent[k] and tick >= (self._humans[k].leaves or 0)]
        # Pedestrians leave first, because they may make room for others that enter at the same place.
        for k in left:
            self._park(k)
        self._to_leave = [k for k in self._to_leave if k not in left]
        entered = [k for k in self._to_enter if self._try_to_enter(k, tick, rows)]
        self._to_enter = [k for k in self._to_enter if k not in entered]
        if left or entered:
            self._update_attributes()
        return entered, left

    def _try_to_enter(self, k: int, tick: int, rows: Array) -> bool:
        """Place a pedestrian in the room if it is due and there is room; whether it was placed."""
        human = self._humans[k]
        # A pedestrian that finds no room until it should have left never appears; tracks are followed in any case.
        is_late = human.leaves is not None and tick >= human.leaves
        if tick < human.enters or is_late or (human.behaviour != "recorded" and not self._party_has_room(k, rows)):
            return False
        self._place(k, tick)
        # Pedestrians that enter later in the same tick keep off this one.
        rows[k] = (*self._bodies[k].position, *self._bodies[k].velocity)
        return True

    def _party_has_room(self, k: int, rows: Array) -> bool:
        """Whether a pedestrian, and those that enter together with it, can enter."""
        waiting = (other for other in self._parties.get(k, ()) if self.is_absent[other])
        return self._has_room(k, rows) and all(self._has_room(other, rows) for other in waiting)

    def _has_room(self, k: int, rows: Array) -> bool:
        """Whether there is space for a pedestrian that enters, however it and the others turn."""
        x, y = self._humans[k].pose.position
        dx, dy = rows[:, X] - x, rows[:, Y] - y
        gaps = np.sqrt(dx * dx + dy * dy) - self._radius - self._radius[k]
        gaps[:-1][self.is_absent] = np.inf
        minimum = ENTRY_GAP if self._humans[k].behaviour == "wandering" else -ENTRY_OVERLAP
        return bool((gaps > minimum).all())

    def _place(self, k: int, tick: int) -> None:
        """Place a pedestrian in the room: at its initial pose, or on its track."""
        human, body = self._humans[k], self._bodies[k]
        self.is_absent[k] = False
        body.position, body.velocity = human.pose.position, human.velocity
        if human.behaviour == "recorded":
            (x, y), (next_x, next_y) = human.track_position(tick), human.track_position(tick + 1)
            body.position, body.velocity = (x, y), ((next_x - x) / self._dt, (next_y - y) / self._dt)

    def _park(self, k: int) -> None:
        self.is_absent[k] = True
        self._bodies[k].position, self._bodies[k].velocity = tuple(self._scene.parking[k].tolist()), (0.0, 0.0)

    def _update_attributes(self) -> None:
        is_absent = self.is_absent.tolist()
        self.all_present = True not in is_absent
        self.absent_ids = frozenset(human.id for human, away in zip(self._humans, is_absent, strict=True) if away)


def _parties(scene: Scene) -> dict[int, list[int]]:
    """Rows of the pedestrians that enter together with each one: the wandering members of a group."""
    entering = [k for k, human in enumerate(scene.humans) if human.enters > 0 and human.behaviour == "wandering"]
    by_group: dict[tuple[int, int], list[int]] = {}
    for k in entering:
        human = scene.humans[k]
        if human.group is not None:
            by_group.setdefault((human.group, human.enters), []).append(k)
    return {k: party for party in by_group.values() for k in party}


def _recorded_rows(scene: Scene) -> list[int]:
    """Indices of the recorded pedestrians.

    Raises:
        ValueError: a recorded pedestrian has no track.
    """
    for human in scene.humans:
        if human.behaviour == "recorded" and not human.track:
            raise ValueError(f"human {human.id} is recorded, but has no track; give a position for each tick")
    return [k for k, human in enumerate(scene.humans) if human.behaviour == "recorded"]
