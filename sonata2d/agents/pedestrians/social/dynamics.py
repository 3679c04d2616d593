"""Social life: people go to things and to each other, talk a while and part, and leave what they were about."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ....core.entities import AT_LAPTOP, AT_OBJECT, AT_PLANT, Furniture, Interaction
from ....core.geometry import Disc, Point, Rectangle
from ....core.humans import Humans
from ....core.portable_math import Array
from ....core.rng import RandomStream
from ....core.scene import Scene
from ..wayfinding import Wanderers
from .f_formations import LARGEST, MEETING, apart, free_places, widened
from .state import SocialState

USES = {"laptop": AT_LAPTOP, "plant": AT_PLANT}
DULL = ("table", "chair")  # nobody goes to see these
BEFORE = 0.45  # m, between the outlines of a person and of the thing they attend to
THERE = 0.4  # m, from the place that one goes to, when one is there
ON_THE_WAY = 25.0  # s, after which who has not got there gives up
MEET, APART = 2.2, 3.5  # m: who comes so near may stop to talk; and is asked again when they were so far apart
ELBOW = 0.7  # m, between places that people go to
ALONE = 2.0  # s, that who talked stays when the others are gone


@dataclass(slots=True)
class _Task:
    """What somebody has in mind: a place to go to, for a thing (id) or a person (index); or until when to stay."""

    place: Point
    front: Point
    thing: int | None = None
    person: int | None = None
    until: int = 0  # tick: while on the way, when to give up
    is_there: bool = False


class SocialLife:
    """Changes the company from tick to tick, as `Scene.social` says. Nobody is moved: all walk to their places.

    Each person decides by a stream of chance of their own. Who walks in a group stays with it.

    Args:
        scene: the chances, the things and the people.
        company: is kept up to date.
        wanderers: are sent and let go.
    """

    def __init__(self, scene: Scene, social: SocialState, wanderers: Wanderers) -> None:
        self._scene, self._state, self._wanderers = scene, social, wanderers
        self._settings, self._dt = scene.social, scene.rules.dt
        self._rng = [RandomStream(scene.seed, scene.episode, "company", human.id) for human in scene.humans]
        grouped = {member for group in scene.groups if group.kind == "walking" for member in group.members}
        own_way = ("walking", "recorded")
        self._free = [h.id not in grouped and h.behaviour not in own_way for h in scene.humans]
        self._free = [free and stays for free, stays in zip(self._free, social.stays, strict=True)]
        self._tasks: dict[int, _Task] = {}
        self._rested = set(range(len(scene.humans)))  # who may take up something when they next choose a way
        self._met = np.ones((len(scene.humans), len(scene.humans)), dtype=bool)
        self._tick, self._position = 0, social.home
        if self._settings.is_lively:
            wanderers.errand = self._take_up
            self._plan_to_leave()

    def update(self, tick: int, humans: Humans) -> None:
        """Who has arrived stays, whose time is over goes, who meets may stop; before the wanderers are asked."""
        if not self._settings.is_lively:
            return
        self._tick, self._position = tick, humans.position
        before = self._state.walks.copy()
        for k, task in list(self._tasks.items()):
            self._go_on(k, task)
        if self._settings.meets > 0.0:
            self._meet(humans)
        if (before != self._state.walks).any():
            self._wanderers.go_round(self._state.standing(), self._state.shared())

    def _plan_to_leave(self) -> None:
        """Some of those who attend to somebody or something at the start will go; who comes and goes has no time."""
        for k in np.flatnonzero(~self._state.walks).tolist():
            busy = self._state.has_thing[k] or self._state.partners[k]
            if busy and self._state.stays[k] and self._rng[k].uniform() < self._settings.leaves:
                is_talk = not self._state.has_thing[k]
                home = _point(self._state.home[k])
                self._tasks[k] = _Task(home, home, until=self._time(k, is_talk), is_there=True)

    def _time(self, k: int, is_talk: bool) -> int:
        """The tick until which somebody stays."""
        low, high = self._settings.talk_time if is_talk else self._settings.visit_time
        return self._tick + int(self._rng[k].uniform(low, high) / self._dt)

    def _go_on(self, k: int, task: _Task) -> None:
        """What somebody with something in mind does now."""
        if task.is_there:
            if self._tick >= task.until:
                self._leave(k)
            return
        gone = task.person is not None and self._state.walks[task.person]
        if gone or self._tick >= task.until:
            self._leave(k)
        elif apart(_point(self._position[k]), task.place) < THERE:
            self._arrive(k, task)

    def _leave(self, k: int) -> None:
        """Somebody goes off to wander; who is left alone by that, and came to talk, soon goes as well."""
        left = self._state.partners[k]
        del self._tasks[k]
        self._state.walk(k)
        self._wanderers.let_go(k, _point(self._position[k]))
        for other in left:
            if other in self._tasks and not self._state.partners[other]:
                self._tasks[other].until = min(self._tasks[other].until, self._tick + int(ALONE / self._dt))

    def _arrive(self, k: int, task: _Task) -> None:
        """Somebody is where they wanted to be: with whom or with what, from this moment on."""
        me = self._scene.humans[k].id
        if task.person is None:
            thing = next(thing for thing in self._scene.furniture if thing.id == task.thing)
            ties = [Interaction(me, USES.get(thing.type, AT_OBJECT), thing.id)]
        else:
            others = sorted([task.person, *self._state.partners[task.person]])
            ties = self._state.talk(k, others)
            self._make_room(others, task.front, len(others) + 1)
        self._wanderers.rest(k)
        self._state.stand(k, task.place, task.front, ties)
        task.is_there, task.until = True, self._time(k, task.person is not None)

    def _make_room(self, members: list[int], centre: Point, count: int) -> None:
        """Those in a circle step back where one of that many wants a larger one, as far as there is room."""
        for member in members:
            place = widened(_point(self._state.home[member]), centre, count)
            if self._wanderers.is_open(centre, place):
                self._state.home[member] = place

    def _take_up(self, k: int, place: Point) -> bool:
        """Whether a wanderer who would choose a way goes to a thing, or to somebody, instead."""
        if not self._free[k] or self._tick == 0 or k not in self._rested:
            self._rested.add(k)
            return False
        share = self._rng[k].uniform()
        if share < self._settings.visits:
            found = self._things(k, place)
        elif share < self._settings.visits + self._settings.joins:
            found = self._people(k, place)
        else:
            return False
        tasks = [task for task in found if self._is_free(task.place)]
        if not tasks:
            return False
        task = self._rng[k].choice(tasks)
        task.until = self._tick + int(ON_THE_WAY / self._dt)
        if not self._wanderers.lead(k, place, task.place):
            return False
        self._tasks[k] = task
        self._rested.discard(k)
        return True

    def _things(self, k: int, place: Point) -> Iterator[_Task]:
        """A place before each thing that is worth a look and free."""
        sought = {task.thing for task in self._tasks.values()}
        for thing in self._scene.furniture:
            if thing.type in DULL or thing.id in sought or not self._state.is_free(thing.id):
                continue
            spot = self._before(thing, place, self._scene.humans[k].radius)
            if self._wanderers.is_open(spot, spot):
                yield _Task(spot, thing.pose.position, thing=thing.id)

    def _before(self, thing: Furniture, place: Point, radius: float) -> Point:
        """Where one stands at a thing: at its front, its right side (-y); at a round one on the side one comes from."""
        carrier = next((other for other in self._scene.furniture if other.id == thing.on), thing)
        if isinstance(thing.shape, Disc):
            x, y = thing.pose.position
            share = (thing.shape.radius + BEFORE + radius) / max(apart(place, (x, y)), 1e-6)
            return x + (place[0] - x) * share, y + (place[1] - y) * share
        deep = carrier.shape.width / 2 if isinstance(carrier.shape, Rectangle) else carrier.shape.reach
        dx, dy = carrier.pose.x - thing.pose.x, carrier.pose.y - thing.pose.y
        hx, hy = thing.pose.direction
        out = dx * hy - dy * hx + deep + BEFORE + radius
        return thing.pose.x + hy * out, thing.pose.y - hx * out

    def _people(self, k: int, place: Point) -> Iterator[_Task]:
        """A free place with everybody who stands and attends to nothing, in the best place of each circle."""
        for other in np.flatnonzero(~self._state.walks & ~self._state.has_thing).tolist():
            circle = [other, *self._state.partners[other]]
            coming = sum(task.person in circle and not task.is_there for task in self._tasks.values())
            if not self._state.stays[other] or other != min(circle) or len(circle) + coming >= LARGEST:
                continue
            homes = [_point(self._state.home[member]) for member in circle]
            for centre, spot in free_places(homes, _point(self._state.front[other]), place):
                if self._wanderers.is_open(centre, spot) and self._is_free(spot):
                    yield _Task(spot, centre, person=other)
                    break

    def _is_free(self, place: Point) -> bool:
        """Whether nobody else is on their way to there."""
        return all(apart(place, task.place) > ELBOW for task in self._tasks.values() if not task.is_there)

    def _meet(self, humans: Humans) -> None:
        """Wanderers who have come near each other may stop and talk."""
        idle = [k for k in np.flatnonzero(self._state.walks).tolist() if self._free[k] and k not in self._tasks]
        if len(idle) < 2:
            return
        place = humans.position
        x, y = (place[:, None, axis] - place[None, :, axis] for axis in (0, 1))
        square = x * x + y * y
        self._met &= square < APART * APART
        near = (square < MEET * MEET) & ~self._met
        self._met |= near
        taken: set[int] = set()
        for i in idle:
            for j in np.flatnonzero(near[i, i + 1 :]).tolist():
                j += i + 1
                if j in idle and not {i, j} & taken and self._rng[i].uniform() < self._settings.meets:
                    taken |= {i, j} if self._stop(i, j) else set()

    def _stop(self, i: int, j: int) -> bool:
        """Two stop where they meet and talk, if there is room."""
        (ax, ay), (bx, by) = _point(self._position[i]), _point(self._position[j])
        middle, double = ((ax + bx) / 2, (ay + by) / 2), 2 * max(apart((ax, ay), (bx, by)), 1e-6)
        ux, uy = (ax - bx) * MEETING / double, (ay - by) * MEETING / double
        places = (middle[0] + ux, middle[1] + uy), (middle[0] - ux, middle[1] - uy)
        if not all(self._wanderers.is_open(middle, place) for place in places):
            return False
        until = self._time(i, True)
        for k, place in zip((i, j), places, strict=True):
            self._wanderers.rest(k)
            self._tasks[k] = _Task(place, middle, until=until, is_there=True)
            self._rested.discard(k)
        self._state.stand(i, places[0], middle, [])
        self._state.stand(j, places[1], middle, self._state.talk(j, [i]))
        return True


def _point(row: Array) -> Point:
    return float(row[0]), float(row[1])
