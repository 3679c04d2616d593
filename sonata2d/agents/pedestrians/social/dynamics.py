"""`SocialDynamics`: pedestrians visit objects, join groups, stop to talk, and leave again."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ....core.entities import AT_LAPTOP, AT_OBJECT, AT_PLANT, Furniture, Interaction
from ....core.geometry import Disc, Point, Rectangle
from ....core.portable_math import Array
from ....core.rng import AgentStreams
from ....core.scene import Scene
from ..models.base import Walkers
from ..wayfinding import Wayfinding
from .f_formations import MAXIMUM_MEMBERS, PAIR_DISTANCE, distance, joining_positions, widen
from .state import SocialState

OBJECT_RELATIONS = {"laptop": AT_LAPTOP, "plant": AT_PLANT}  # AT_OBJECT for all other types
NOT_VISITED = ("table", "chair")
OBJECT_CLEARANCE = 0.45  # m, between the outlines of a pedestrian and the object that it attends to
ARRIVAL_DISTANCE = 0.4  # m, from the position of a task
APPROACH_TIME = 25.0  # s, after which a task whose position was not reached is given up
MEETING_DISTANCE, SEPARATION = 2.2, 3.5  # m: within the first, a pair may stop to talk; again after the second
POSITION_SPACING = 0.7  # m, between the positions of two tasks
LEFT_ALONE_TIME = 2.0  # s, that a pedestrian stays when its partners have left


@dataclass(slots=True)
class _Task:
    """An object visit or a conversation of one pedestrian, from its choice to its end.

    Attributes:
        position: where to stand, m.
        facing_point: what to face, m.
        object_id: the object to attend to, if any.
        partner: index of a pedestrian to join, if any.
        until: tick at which the task ends, or, on the way there, at which it is given up.
        has_arrived: False on the way to the position.
    """

    position: Point
    facing_point: Point
    object_id: int | None = None
    partner: int | None = None
    until: int = 0
    has_arrived: bool = False


class SocialDynamics:
    """Changes the social state from tick to tick, with the probabilities of `Scene.social`.

    Positions are never set: pedestrians walk to where they will stand. Each pedestrian's choices are drawn from its own
    random stream. Members of walking groups stay with their group.

    Args:
        scene: the probabilities, objects and pedestrians.
        social: the social state, which is updated.
        wayfinding: receives the destinations of pedestrians with a task.
    """

    def __init__(self, scene: Scene, social: SocialState, wayfinding: Wayfinding) -> None:
        humans = scene.humans
        self._scene, self._social, self._wayfinding = scene, social, wayfinding
        self._settings, self._dt = scene.social, scene.rules.dt
        self._rng = AgentStreams(scene.seed, scene.episode, "company", [human.id for human in humans])
        grouped = {member for group in scene.groups if group.kind == "walking" for member in group.members}
        has_own_path = ("walking", "recorded")
        self._may_take_part = [
            h.id not in grouped and h.behaviour not in has_own_path and is_always_present
            for h, is_always_present in zip(humans, social.is_always_present, strict=True)
        ]
        self._tasks: dict[int, _Task] = {}
        self._has_walked = set(range(len(humans)))  # no task since the last walk: may take one on the next arrival
        self._have_met: set[int] | None = None  # pairs i < j as i N + j, since they were last SEPARATION apart
        self._tick, self._position = 0, social.standing_position
        if self._settings.is_lively:
            wayfinding.choose_task = self._choose_task
            self._plan_initial_departures()

    def update(self, tick: int, position: Array, walkers: Walkers) -> None:
        """Advance by one tick: arrivals, ends of tasks and meetings. Call it before `Wayfinding.update`.

        Args:
            tick: that begins.
            position: (N, 2), m, of all pedestrians of the scene; arbitrary for absent ones.
            walkers: their neighbours.
        """
        if not self._settings.is_lively:
            return
        self._tick, self._position = tick, position
        was_walking = self._social.is_walking.copy()
        for k, task in list(self._tasks.items()):
            self._advance_task(k, task)
        if self._settings.meets > 0.0:
            self._start_meetings(walkers)
        if (was_walking != self._social.is_walking).any():
            self._wayfinding.set_obstacles(self._social.standing_humans(), self._social.shared_spaces())

    def _plan_initial_departures(self) -> None:
        """Choose which pedestrians with an interaction at the start will leave it, and when."""
        for k in np.flatnonzero(~self._social.is_walking).tolist():
            has_object = self._social.has_object[k]
            has_interaction = has_object or self._social.partners[k]
            # Pedestrians with a limited presence draw nothing: they arrive and leave by their own schedule.
            if has_interaction and self._social.is_always_present[k] and self._rng[k].uniform() < self._settings.leaves:
                position = _point(self._social.standing_position[k])
                until = self._draw_end(k, is_talk=not has_object)
                self._tasks[k] = _Task(position, position, until=until, has_arrived=True)

    def _draw_end(self, k: int, *, is_talk: bool) -> int:
        """The tick until which pedestrian k stays."""
        low, high = self._settings.talk_time if is_talk else self._settings.visit_time
        return self._tick + int(self._rng[k].uniform(low, high) / self._dt)

    def _advance_task(self, k: int, task: _Task) -> None:
        """End the task of pedestrian k if it is over or has become impossible; start its activity on arrival."""
        if task.has_arrived:
            if self._tick >= task.until:
                self._leave(k)
            return
        partner_left = task.partner is not None and self._social.is_walking[task.partner]
        if partner_left or self._tick >= task.until:
            self._leave(k)
        elif distance(_point(self._position[k]), task.position) < ARRIVAL_DISTANCE:
            self._arrive(k, task)

    def _leave(self, k: int) -> None:
        """Pedestrian k wanders off; newcomers that are left alone by this leave soon after."""
        partners = self._social.partners[k]
        del self._tasks[k]
        self._social.start_walking(k)
        self._wayfinding.start_wandering(k, _point(self._position[k]))
        for partner in partners:
            if partner in self._tasks and not self._social.partners[partner]:
                end = self._tick + int(LEFT_ALONE_TIME / self._dt)
                self._tasks[partner].until = min(self._tasks[partner].until, end)

    def _arrive(self, k: int, task: _Task) -> None:
        """Pedestrian k has reached the position of its task: its interactions begin."""
        own_id = self._scene.humans[k].id
        if task.partner is None:
            thing = next(thing for thing in self._scene.furniture if thing.id == task.object_id)
            interactions = [Interaction(own_id, OBJECT_RELATIONS.get(thing.type, AT_OBJECT), thing.id)]
        else:
            members = sorted([task.partner, *self._social.partners[task.partner]])
            interactions = self._social.talking_interactions(k, members)
            self._widen_formation(members, task.facing_point, len(members) + 1)
        self._wayfinding.stop(k)
        self._social.start_standing(k, task.position, task.facing_point, interactions)
        task.has_arrived, task.until = True, self._draw_end(k, is_talk=task.partner is not None)

    def _widen_formation(self, members: list[int], centre: Point, count: int) -> None:
        """Move members outwards to the radius of a formation of `count`, as far as there is room."""
        for member in members:
            position = widen(_point(self._social.standing_position[member]), centre, count)
            if self._wayfinding.is_open(centre, position):
                self._social.standing_position[member] = position

    def _choose_task(self, k: int, position: Point) -> bool:
        """Called when wandering pedestrian k needs a destination: whether it is sent to a task instead.

        After a task a pedestrian wanders to another place before it may take the next one.
        """
        if not self._may_take_part[k] or self._tick == 0 or k not in self._has_walked:
            self._has_walked.add(k)
            return False
        draw = self._rng[k].uniform()
        if draw < self._settings.visits:
            found = self._object_tasks(k, position)
        elif draw < self._settings.visits + self._settings.joins:
            found = self._joining_tasks(position)
        else:
            return False
        tasks = [task for task in found if self._is_unclaimed(task.position)]
        if not tasks:
            return False
        task = self._rng[k].choice(tasks)
        task.until = self._tick + int(APPROACH_TIME / self._dt)
        if not self._wayfinding.send_to(k, position, task.position):
            return False
        self._tasks[k] = task
        self._has_walked.discard(k)
        return True

    def _object_tasks(self, k: int, position: Point) -> Iterator[_Task]:
        """A task for each object that is worth a visit and that no other pedestrian attends to or goes to."""
        claimed = {task.object_id for task in self._tasks.values()}
        for thing in self._scene.furniture:
            if thing.type in NOT_VISITED or thing.id in claimed or not self._social.is_unattended(thing.id):
                continue
            target = self._position_at(thing, position, self._scene.humans[k].radius)
            if self._wayfinding.is_open(target, target):
                yield _Task(target, thing.pose.position, object_id=thing.id)

    def _position_at(self, thing: Furniture, position: Point, radius: float) -> Point:
        """Where to stand at an object, m: in front of its right side (-y), at a disc on the side of the pedestrian.

        Args:
            thing: the object; it may lie on another one.
            position: of the pedestrian, m.
            radius: of the pedestrian, m.
        """
        carrier = next((other for other in self._scene.furniture if other.id == thing.on), thing)
        if isinstance(thing.shape, Disc):
            x, y = thing.pose.position
            gap = thing.shape.radius + OBJECT_CLEARANCE + radius
            scale = gap / max(distance(position, (x, y)), 1e-6)
            return x + (position[0] - x) * scale, y + (position[1] - y) * scale
        depth = carrier.shape.width / 2 if isinstance(carrier.shape, Rectangle) else carrier.shape.circumradius
        dx, dy = carrier.pose.x - thing.pose.x, carrier.pose.y - thing.pose.y
        hx, hy = thing.pose.direction
        offset = dx * hy - dy * hx + depth + OBJECT_CLEARANCE + radius
        return thing.pose.x + hy * offset, thing.pose.y - hx * offset

    def _joining_tasks(self, position: Point) -> Iterator[_Task]:
        """A task for each formation with room: the best open position beside pedestrians that stand or talk."""
        for k in np.flatnonzero(~self._social.is_walking & ~self._social.has_object).tolist():
            members = [k, *self._social.partners[k]]
            coming = sum(task.partner in members and not task.has_arrived for task in self._tasks.values())
            # Each formation is considered once, by its first member.
            if not self._social.is_always_present[k] or k != min(members) or len(members) + coming >= MAXIMUM_MEMBERS:
                continue
            places = [_point(self._social.standing_position[member]) for member in members]
            for centre, target in joining_positions(places, _point(self._social.facing_point[k]), position):
                if self._wayfinding.is_open(centre, target) and self._is_unclaimed(target):
                    yield _Task(target, centre, partner=k)
                    break

    def _is_unclaimed(self, position: Point) -> bool:
        """Whether no other pedestrian is on its way to a position near this one."""
        on_the_way = [task for task in self._tasks.values() if not task.has_arrived]
        return all(distance(position, task.position) > POSITION_SPACING for task in on_the_way)

    def _start_meetings(self, walkers: Walkers) -> None:
        """Let pairs of wandering pedestrians that come near each other stop and talk."""
        walking = np.flatnonzero(self._social.is_walking).tolist()
        candidates = [k for k in walking if self._may_take_part[k] and k not in self._tasks]
        if len(candidates) < 2:
            return
        count = len(walkers.position)
        first = np.repeat(np.arange(count), np.diff(walkers.neighbour_start))
        second = walkers.neighbour[: len(first)]
        x, y = (walkers.position[second, axis] - walkers.position[first, axis] for axis in (0, 1))
        square, pair = x * x + y * y, first * count + second
        near, meeting = (
            pair[(first < second) & (square < limit * limit)].tolist() for limit in (SEPARATION, MEETING_DISTANCE)
        )
        have_met = set(near) if self._have_met is None else self._have_met.intersection(near)
        self._have_met = have_met.union(meeting)
        able, stopped = set(candidates), set[int]()
        for i, j in (divmod(pair, count) for pair in meeting if pair not in have_met):
            is_possible = {i, j} <= able and not {i, j} & stopped
            if is_possible and self._rng[i].uniform() < self._settings.meets and self._stop_to_talk(i, j):
                stopped |= {i, j}

    def _stop_to_talk(self, i: int, j: int) -> bool:
        """Let two pedestrians stop where they meet and talk; False if there is no room."""
        (ax, ay), (bx, by) = a, b = _point(self._position[i]), _point(self._position[j])
        middle, double = ((ax + bx) / 2, (ay + by) / 2), 2 * max(distance(a, b), 1e-6)
        ux, uy = (ax - bx) * PAIR_DISTANCE / double, (ay - by) * PAIR_DISTANCE / double
        positions = (middle[0] + ux, middle[1] + uy), (middle[0] - ux, middle[1] - uy)
        if not all(self._wayfinding.is_open(middle, position) for position in positions):
            return False
        until = self._draw_end(i, is_talk=True)
        for k, position in zip((i, j), positions, strict=True):
            self._wayfinding.stop(k)
            self._tasks[k] = _Task(position, middle, until=until, has_arrived=True)
            self._has_walked.discard(k)
        self._social.start_standing(i, positions[0], middle, [])
        self._social.start_standing(j, positions[1], middle, self._social.talking_interactions(j, [i]))
        return True


def _point(row: Array) -> Point:
    return float(row[0]), float(row[1])
