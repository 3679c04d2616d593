"""`SocialDynamics`: activities of pedestrians besides walking: visits, conversations, pauses, seats, queues, exits."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ....core.entities import Furniture, Interaction
from ....core.geometry import Disc, Point, Rectangle, as_point
from ....core.portable_math import Array
from ....core.rng import AgentStreams
from ....core.scene import Scene
from ....core.vectors import length
from ....registry import furniture_type
from ..models.base import Walkers
from ..routes import ARRIVAL_DISTANCE
from ..wayfinding import Wayfinding
from .exits import Exits
from .f_formations import MAXIMUM_MEMBERS, PAIR_DISTANCE, distance, joining_positions, widen
from .queue_line import QueueLine
from .sitting import RISING, Seats
from .state import SocialState
from .tasks import Kind, Task

_PLACE_TOLERANCE = 0.25  # m, from the position of a task
_APPROACH_TIME = 25.0  # s, after which a task whose position was not reached is given up
_MEETING_DISTANCE, _SEPARATION = 2.2, 3.5  # m: within the first, a pair may stop to talk; again after the second
_POSITION_SPACING = 0.7  # m, between the positions of two tasks
_MEMBER_SPACING, _MEMBER_DISTANCE = 0.6, 1.2  # m, in a group that pauses: least between members, most from the leader
_LONG_STAY = 10.0  # s, from which on paths lead round a pedestrian that pauses
_FOREVER = 1e6  # s
_SERVED_TIME = 120.0  # s, for which a pedestrian that was served does not queue again
_LEFT_ALONE_TIME = 2.0  # s, that a pedestrian stays when its partners have left


class SocialDynamics:
    """Changes the social state from tick to tick, with the probabilities of `Scene.social`.

    Positions are never set: pedestrians walk to where they will stand or leave. Each pedestrian's choices are drawn
    from its own random stream. Members of walking groups stay with their group, pause with it, and leave with it.

    Args:
        scene: the probabilities, objects, doors, queues and pedestrians.
        social: the social state, which is updated.
        wayfinding: receives the destinations of pedestrians with a task.

    Attributes:
        leaving: indices of the pedestrians that have reached the door through which they leave, in this tick.
        seats: the seats, and the pedestrians that sit on them.
    """

    def __init__(self, scene: Scene, social: SocialState, wayfinding: Wayfinding) -> None:
        humans = scene.humans
        self._scene, self._social, self._wayfinding = scene, social, wayfinding
        self._settings, self._dt = scene.social, scene.rules.dt
        self._rng = AgentStreams(scene.seed, scene.episode, "company", scene.human_table.id.tolist())
        grouped = {member for group in scene.groups if group.kind == "walking" for member in group.members}
        self._is_grouped = [human.id in grouped for human in humans]
        has_own_path = ("walking", "recorded")
        self._may_take_part = [
            not is_grouped and human.behaviour not in has_own_path and stays
            for human, is_grouped, stays in zip(humans, self._is_grouped, social.stays, strict=True)
        ]
        self._tasks: dict[int, Task] = {}
        self._last: dict[int, Kind] = {}  # kind of the last task
        self._may_queue_from: dict[int, int] = {}  # tick, of those who were served
        self._has_walked = set(range(len(humans)))  # no task since the last walk: may take one on the next arrival
        self._have_met: set[int] | None = None  # pairs i < j as i N + j, since they were last _SEPARATION apart
        self._tick, self._position = 0, social.standing_position
        self._feet = np.zeros((len(humans), 2))  # unit vectors of the directions in which feet point
        self._things = [(thing, furniture_type(thing.type)) for thing in scene.furniture]
        self.seats = Seats(scene, social, wayfinding, self._dt)
        self._lines = [QueueLine(queue, social, self._rng, self._dt) for queue in scene.queues]
        self._exits = Exits(scene, wayfinding)
        self.leaving: tuple[int, ...] = ()
        self._is_changed = True  # whether other people stand than at the last update of the obstacles
        wayfinding.start_stay = self._start_stay
        if self._settings.is_lively:
            wayfinding.choose_task = self._choose_task
            self._plan_initial_departures()
        self._start_seated_and_waiting()

    def update(self, tick: int, position: Array, walkers: Walkers) -> None:
        """Advance by one tick: arrivals, ends of tasks and meetings. Call it before `Wayfinding.update`.

        Args:
            tick: that begins.
            position: (N, 2), m, of all pedestrians of the scene; arbitrary for absent ones.
            walkers: their neighbours.
        """
        self._tick, self._position, self._feet, self.leaving = tick, position, walkers.body_direction, ()
        if self._tasks:
            for k, task in list(self._tasks.items()):
                self._advance_task(k, task)
            for line in self._lines:
                served = line.advance(tick, position)
                self._is_changed = self._is_changed or line.has_moved
                if served is not None:
                    self._may_queue_from[served] = tick + int(_SERVED_TIME / self._dt)
                    self._leave(served)
        if self._settings.meets > 0.0:
            self._start_meetings(walkers)
        if self._is_changed:
            self._is_changed = False
            self._wayfinding.set_obstacles(self._social.standing_humans(), self._social.shared_spaces())

    def _plan_initial_departures(self) -> None:
        """Choose which pedestrians with an interaction at the start will leave it, and when."""
        for k in np.flatnonzero(~self._social.is_walking).tolist():
            has_object = self._social.has_object[k]
            has_interaction = has_object or self._social.partners[k]
            # Pedestrians with a limited presence draw nothing: they arrive and leave by their own schedule.
            if has_interaction and self._social.is_always_present[k] and self._rng[k].uniform() < self._settings.leaves:
                position = as_point(self._social.standing_position[k])
                kind: Kind = "visit" if has_object else "talk"
                self._tasks[k] = Task(kind, position, position, until=self._draw_end(k, kind), has_arrived=True)

    def _start_seated_and_waiting(self) -> None:
        """Begin the tasks of the pedestrians that sit or stand in a queue at the start."""
        humans = self._scene.humans
        for k, human in enumerate(humans):
            if human.seat is not None:
                self._wayfinding.stop(k)
                # It has been sitting for a while: a random part of its time is over.
                until = int(self._draw_end(k, "sit") * self._rng[k].uniform())
                self._tasks[k], self._is_changed = self.seats.initial_task(k, human.seat, until), True
        for line in self._lines:
            waiting = [k for k, human in enumerate(humans) if human.queue == line.queue.id]
            x, y = line.queue.pose.position
            for k in sorted(waiting, key=lambda k: distance(humans[k].pose.position, (x, y))):
                self._wayfinding.stop(k)
                line.join(k)
                self._tasks[k] = Task("queue", (x, y), (x, y), line=line, has_arrived=True)
                self._is_changed = True

    def _draw_end(self, k: int, kind: Kind) -> int:
        """The tick until which pedestrian k stays at a visit, a conversation or on a seat."""
        settings = self._settings
        times = {"visit": settings.visit_time, "talk": settings.talk_time, "sit": settings.sit_time}
        return self._tick + int(self._rng[k].uniform(*times[kind]) / self._dt)

    def _advance_task(self, k: int, task: Task) -> None:
        """End the task of pedestrian k if it is over or has become impossible; start its activity on arrival."""
        if task.kind == "exit":
            self._advance_exit(k, task)
        elif task.kind == "queue" and task.has_arrived:
            pass  # the queue tells when it is over
        elif task.kind == "sit" and task.has_arrived:
            if self.seats.advance(k, task, self._tick):
                task.until = self._draw_end(k, "sit")
            elif task.phase == RISING and self.seats.is_over(task, as_point(self._position[k])):
                self._leave(k)
        elif task.has_arrived:
            if self._tick >= task.until:
                self._leave(k)
        else:
            self._advance_approach(k, task)

    def _advance_approach(self, k: int, task: Task) -> None:
        """Let pedestrian k arrive at the position of its task, or give it up."""
        partner_left = task.partner is not None and self._social.is_walking[task.partner]
        if partner_left or self._tick >= task.until or not self._follow_tail(k, task):
            self._leave(k)
        elif distance(as_point(self._position[k]), task.position) < _PLACE_TOLERANCE:
            self._arrive(k, task)

    def _follow_tail(self, k: int, task: Task) -> bool:
        """Send pedestrian k to the end of its queue if that has moved; False if it cannot join any more."""
        if task.line is None:
            return True
        if task.line.tail >= task.line.queue.capacity:
            return False
        place, facing_point = task.line.slot(task.line.tail)
        if place == task.position:
            return True
        task.position, task.facing_point = place, facing_point
        return self._wayfinding.send_to(k, as_point(self._position[k]), place)

    def _leave(self, k: int) -> None:
        """Pedestrian k goes on; newcomers to a conversation that are left alone by this leave soon after."""
        partners = self._social.partners[k]
        task = self._tasks.pop(k)
        if task.kind != "stay":
            self._last[k] = task.kind
            self._has_walked.discard(k)
        self.seats.release(k)
        if not self._social.is_walking[k]:
            self._is_changed = self._is_changed or self._social.is_in_the_way(k)
            self._social.start_walking(k)
        self._wayfinding.start_wandering(k, as_point(self._position[k]))
        for partner in partners if task.kind == "talk" else ():
            if partner in self._tasks and not self._social.partners[partner]:
                end = self._tick + int(_LEFT_ALONE_TIME / self._dt)
                self._tasks[partner].until = min(self._tasks[partner].until, end)

    def _arrive(self, k: int, task: Task) -> None:
        """Pedestrian k has reached the position of its task: its activity begins."""
        if task.kind == "stay":
            self._stand(k, task.position, task.until)
            return
        self._wayfinding.stop(k)
        if task.kind == "sit":
            self.seats.arrive(k, task, self._tick)
            return
        task.has_arrived = self._is_changed = True
        if task.line is not None:
            task.line.join(k)
            return
        own_id = self._scene.humans[k].id
        if task.partner is None:
            thing, kind = next(item for item in self._things if item[0].id == task.object_id)
            assert kind.relation is not None  # else no pedestrian has the task
            interactions = [Interaction(own_id, kind.relation, thing.id)]
        else:
            members = sorted([task.partner, *self._social.partners[task.partner]])
            interactions = self._social.talking_interactions(k, members)
            self._widen_formation(members, task.facing_point, len(members) + 1)
        self._social.start_standing(k, task.position, task.facing_point, interactions)
        task.until = self._draw_end(k, task.kind)

    # Pauses

    def _start_stay(self, k: int, place: Point, duration: float) -> None:
        """Pedestrian k, which has arrived at a place, m, stands there for a time, s, and its followers beside it."""
        until = self._tick + int(min(duration, _FOREVER) / self._dt)
        self._stand(k, place, until)
        followers = [other for other in self._wayfinding.followers(k) if not self._social.is_absent(other)]
        taken = [place]
        for follower in followers:
            spot = self._spot_beside(follower, k, place, taken)
            taken.append(spot)
            position = as_point(self._position[follower])
            rest = self._wayfinding.resting_place(follower, position)
            is_there = distance(rest, spot) < _PLACE_TOLERANCE and distance(rest, place) < _MEMBER_DISTANCE
            if is_there or not self._wayfinding.send_to(follower, position, spot):
                self._stand(follower, rest, until)
            else:
                self._tasks[follower] = Task("stay", spot, place, until=until)
            self._wayfinding.reserve(follower, spot)

    def _stand(self, k: int, place: Point, until: int) -> None:
        """Pedestrian k stands at a place, m, until a tick.

        It faces where its feet point; at its last goal, if others stand there and it is not behind, it faces that goal.
        """
        (x, y), (dx, dy) = place, self._feet[k].tolist()
        facing_point, goal = (x + 3.0 * dx, y + 3.0 * dy), self._wayfinding.last_goal(k)
        if (
            goal is not None
            and distance(place, goal) > ARRIVAL_DISTANCE
            and (goal[0] - x) * dx + (goal[1] - y) * dy > -0.5 * distance(place, goal)
        ):
            facing_point = goal
        is_brief = (until - self._tick) * self._dt < _LONG_STAY
        self._wayfinding.stop(k)
        self._social.start_standing(k, place, facing_point, is_brief=is_brief)
        self._tasks[k] = Task("stay", place, facing_point, until=until, has_arrived=True)
        self._is_changed = self._is_changed or not is_brief

    def _spot_beside(self, k: int, leader: int, place: Point, taken: list[Point]) -> Point:
        """Where a follower stands beside its leader, m: on its present side of it, or opposite, or where it is."""
        position, (lx, ly) = as_point(self._position[k]), as_point(self._position[leader])
        dx, dy = position[0] - lx, position[1] - ly
        gap = max(length(dx, dy), 1e-6)
        scale = min(max(gap, _POSITION_SPACING), _MEMBER_DISTANCE) / gap
        side = self._scene.rules.side  # so that a mirrored scene gives the mirrored place
        for x, y in ((dx, dy), (dy * side, -dx * side), (-dy * side, dx * side), (-dx, -dy)):
            spot = place[0] + x * scale, place[1] + y * scale
            has_room = all(distance(spot, other) > _MEMBER_SPACING for other in taken)
            if has_room and self._wayfinding.is_open(place, spot):
                return spot
        return position

    # Doors

    def _advance_exit(self, k: int, task: Task) -> None:
        """Let pedestrian k leave if it has reached its door; those that follow it then go there by themselves."""
        assert task.door is not None
        if self._social.is_absent(k):
            del self._tasks[k]
        elif self._exits.has_reached(task.door, as_point(self._position[k])):
            self.leaving += (k,)
            del self._tasks[k]
            for follower in self._wayfinding.followers(k):
                self._wayfinding.lead_itself(follower)
                if follower in self._tasks:
                    position = as_point(self._position[follower])
                    self._wayfinding.send_to(follower, position, self._tasks[follower].position)

    def _start_exit(self, k: int, position: Point) -> bool:
        """Send pedestrian k and its followers to a door; False if they can reach no door."""
        door = self._exits.choose(self._rng[k], self._scene.humans[k])
        if door is None:
            return False
        place = self._exits.place_before(door, position)
        if not self._wayfinding.send_to(k, position, place):
            return False
        for member in [k, *self._wayfinding.followers(k)]:
            if not self._social.is_absent(member):
                self._tasks[member] = Task("exit", place, door.pose.position, door=door)
                self._wayfinding.routes.is_exiting[member] = True
        return True

    def _widen_formation(self, members: list[int], centre: Point, count: int) -> None:
        """Move members outwards to the radius of a formation of `count`, as far as there is room."""
        for member in members:
            position = widen(as_point(self._social.standing_position[member]), centre, count)
            if self._wayfinding.is_open(centre, position):
                self._social.standing_position[member] = position

    def _choose_task(self, k: int, position: Point) -> bool:
        """Called when wandering pedestrian k needs a destination: whether it is sent to a task instead.

        After a visit or a conversation, a pedestrian wanders to another place before it may take the next one; it does
        not sit, queue or try to leave twice in a row either.
        """
        has_walked = k in self._has_walked
        self._has_walked.add(k)
        # At the start everybody walks first; followers of a group have no choice of their own.
        if self._tick == 0 or not (self._may_take_part[k] or self._may_lead_out(k)):
            return False
        kind = self._draw_kind(k)
        if kind is None or (kind == self._last.get(k) and not has_walked):
            return False
        if kind == "exit":  # the only task that a whole group takes
            return self._start_exit(k, position)
        if not self._may_take_part[k] or (kind in ("visit", "talk") and not has_walked):
            return False
        tasks = [task for task in self._tasks_of(kind, k, position) if self._is_unclaimed(task.position, kind)]
        if not tasks:  # without a draw: the pedestrian wanders on
            return False
        task = self._rng[k].choice(tasks)
        task.until = self._tick + int(_APPROACH_TIME / self._dt)
        if not self._wayfinding.send_to(k, position, task.position):
            return False
        self._tasks[k] = task
        return True

    def _may_lead_out(self, k: int) -> bool:
        """Whether pedestrian k leads a walking group that may leave."""
        return self._is_grouped[k] and self._scene.humans[k].behaviour == "wandering" and self._social.stays[k]

    def _draw_kind(self, k: int) -> Kind | None:
        """Draw the kind of the next task of pedestrian k; None: it walks to another place."""
        settings, draw = self._settings, self._rng[k].uniform()
        chances: tuple[tuple[Kind, float], ...] = (
            ("visit", settings.visits), ("talk", settings.joins), ("sit", settings.sits), ("queue", settings.queues),
            ("exit", settings.exits),
        )  # fmt: skip
        for kind, chance in chances:
            if draw < chance:
                return kind
            draw -= chance
        return None

    def _tasks_of(self, kind: Kind, k: int, position: Point) -> Iterator[Task]:
        """The possible tasks of a kind for pedestrian k, which is at a position, m."""
        if kind == "visit":
            yield from self._object_tasks(k, position)
        elif kind == "talk":
            yield from self._joining_tasks(position)
        elif kind == "sit":
            yield from self.seats.tasks({task.object_id for task in self._tasks.values()})
        else:
            for line in self._lines if self._tick >= self._may_queue_from.get(k, 0) else ():
                coming = sum(task.line is line and not task.has_arrived for task in self._tasks.values())
                if line.tail + coming < line.queue.capacity:
                    yield Task("queue", *line.slot(line.tail), line=line)

    def _object_tasks(self, k: int, position: Point) -> Iterator[Task]:
        """A task for each object that is worth a visit and that no other pedestrian attends to or goes to."""
        claimed = {task.object_id for task in self._tasks.values()}
        for thing, kind in self._things:
            is_worth = kind.relation is not None and not thing.is_seat and thing.id not in claimed
            if not is_worth or not self._social.is_unattended(thing.id):
                continue
            target = self._position_at(thing, position, kind.clearance, self._scene.humans[k].radius)
            if self._wayfinding.is_open(target, target):
                yield Task("visit", target, thing.pose.position, object_id=thing.id)

    def _position_at(self, thing: Furniture, position: Point, clearance: float, radius: float) -> Point:
        """Where to stand at an object, m: at its access side (-y), at a disc on the side of the pedestrian.

        Args:
            thing: the object; it may lie on another one.
            position: of the pedestrian, m.
            clearance: between the outlines of the object and the pedestrian, m.
            radius: of the pedestrian, m.
        """
        carrier = next((other for other in self._scene.furniture if other.id == thing.on), thing)
        if isinstance(thing.shape, Disc):
            x, y = thing.pose.position
            scale = (thing.shape.radius + clearance + radius) / max(distance(position, (x, y)), 1e-6)
            return x + (position[0] - x) * scale, y + (position[1] - y) * scale
        depth = carrier.shape.width / 2 if isinstance(carrier.shape, Rectangle) else carrier.shape.circumradius
        dx, dy = carrier.pose.x - thing.pose.x, carrier.pose.y - thing.pose.y
        hx, hy = thing.pose.direction
        offset = dx * hy - dy * hx + depth + clearance + radius
        return thing.pose.x + hy * offset, thing.pose.y - hx * offset

    def _joining_tasks(self, position: Point) -> Iterator[Task]:
        """A task for each formation with room: the best open position beside pedestrians that stand or talk."""
        busy = ("stay", "sit", "queue")
        for k in np.flatnonzero(~self._social.is_walking & ~self._social.has_object).tolist():
            if self._social.is_absent(k) or (k in self._tasks and self._tasks[k].kind in busy):
                continue
            members = [k, *self._social.partners[k]]
            coming = sum(task.partner in members and not task.has_arrived for task in self._tasks.values())
            # Each formation is considered once, by its first member.
            if not self._social.stays[k] or k != min(members) or len(members) + coming >= MAXIMUM_MEMBERS:
                continue
            places = [as_point(self._social.standing_position[member]) for member in members]
            for centre, target in joining_positions(places, as_point(self._social.facing_point[k]), position):
                if self._wayfinding.is_open(centre, target) and self._is_unclaimed(target):
                    yield Task("talk", target, centre, partner=k)
                    break

    def _is_unclaimed(self, position: Point, kind: Kind = "visit") -> bool:
        """Whether no other pedestrian is on its way to a position near this one; several may be to a queue."""
        if kind == "queue":
            return True
        on_the_way = [task for task in self._tasks.values() if not task.has_arrived]
        return all(distance(position, task.position) > _POSITION_SPACING for task in on_the_way)

    def _start_meetings(self, walkers: Walkers) -> None:
        """Let pairs of wandering pedestrians that come near each other stop and talk."""
        walking = np.flatnonzero(self._social.is_walking).tolist()
        candidates = [k for k in walking if self._may_take_part[k] and k not in self._tasks]
        if len(candidates) < 2:
            return
        count = len(walkers.position)
        # All pairs of neighbours, as numbers i N + j.
        first = np.repeat(np.arange(count), np.diff(walkers.neighbour_start))
        second = walkers.neighbour[: len(first)]
        x, y = (walkers.position[second, axis] - walkers.position[first, axis] for axis in (0, 1))
        square, pair = x * x + y * y, first * count + second
        near, meeting = (
            pair[(first < second) & (square < limit * limit)].tolist() for limit in (_SEPARATION, _MEETING_DISTANCE)
        )
        # A pair is asked once per encounter; pairs that are near at the start have met already.
        have_met = set(near) if self._have_met is None else self._have_met.intersection(near)
        self._have_met = have_met.union(meeting)
        able, stopped = set(candidates), set[int]()
        for i, j in (divmod(pair, count) for pair in meeting if pair not in have_met):
            # Nobody stops for two others in the same tick.
            is_possible = {i, j} <= able and not {i, j} & stopped
            if is_possible and self._rng[i].uniform() < self._settings.meets and self._stop_to_talk(i, j):
                stopped |= {i, j}

    def _stop_to_talk(self, i: int, j: int) -> bool:
        """Let two pedestrians stop where they meet and talk; False if there is no room."""
        (ax, ay), (bx, by) = a, b = as_point(self._position[i]), as_point(self._position[j])
        middle, double = ((ax + bx) / 2, (ay + by) / 2), 2 * max(distance(a, b), 1e-6)
        ux, uy = (ax - bx) * PAIR_DISTANCE / double, (ay - by) * PAIR_DISTANCE / double
        positions = (middle[0] + ux, middle[1] + uy), (middle[0] - ux, middle[1] - uy)
        if not all(self._wayfinding.is_open(middle, position) for position in positions):
            return False
        until = self._draw_end(i, "talk")
        for k, position in zip((i, j), positions, strict=True):
            self._wayfinding.stop(k)
            self._tasks[k] = Task("talk", position, middle, until=until, has_arrived=True)
            self._has_walked.discard(k)
        self._is_changed = True
        self._social.start_standing(i, positions[0], middle)
        self._social.start_standing(j, positions[1], middle, self._social.talking_interactions(j, [i]))
        return True
