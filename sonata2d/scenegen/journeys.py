"""Doors, queues and places of interest, and the pedestrians that sit, wait or arrive: where people come and go."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from ..core.entities import Door, Group, Human, Interaction, Place, Queue
from ..core.geometry import Disc, Point, Pose, Rectangle, canonical_angle, quantised
from ..core.navigation import FreeSpace
from ..core.portable_math import PI, angle_of
from ..core.relations import WALKING_TOGETHER
from ..core.rng import RandomStream
from ..core.scene import Scene
from ..core.vectors import length
from ..core.wording import counted
from ..errors import SceneError
from .floor_plans import FloorPlan
from .human_sampling import ReactionSampler, draw_human, largest_radius, who_sits
from .numbering import free_ids
from .placement import Layout, PlacedShape
from .sampling import LARGEST_ADULT
from .scenario.base import Range
from .scenario.config import ScenarioConfig
from .scenario.sections import DoorConfig, QueueConfig

_ENTRY_DEPTH = 0.35  # m, from a door to where pedestrians appear
_PAIR_SPACING = 0.6  # m, between the members of a pair at a door
_WIDE_DOOR = 1.0  # m, width from which a pair enters side by side
_JAMB, _CORNER = 0.1, 0.4  # m, from a door to the end of its wall, at least: of given doors, and of drawn ones
_DOOR_SPACING = 0.2  # m, between doors
_DOOR_ZONE = 0.8  # m, in front of a door, which is kept free of other entities
_SLOT_RADIUS = 0.3  # m, space that a pedestrian in a queue, or in front of a seat, needs
_GAP = 0.001  # m, between outlines that must not overlap
_WALL_GAP = 0.6  # m, from a wall to the first pedestrian of a drawn queue


@dataclass(frozen=True, slots=True)
class Journeys:
    """Doors, queues and places of a scene, and the space that must stay free for them.

    Attributes:
        waiting: number of pedestrians in each queue at the start.
        zones: outlines in which no other entity is placed.
    """

    doors: tuple[Door, ...]
    queues: tuple[Queue, ...]
    places: tuple[Place, ...]
    waiting: tuple[int, ...]
    zones: tuple[PlacedShape, ...]


def plan_journeys(
    config: ScenarioConfig, plan: FloorPlan, occupied: Sequence[PlacedShape], rng: RandomStream
) -> Journeys:
    """Place the doors, queues and places of a scenario; positions that are not given are drawn.

    Args:
        config: its sections `doors`, `queues` and `places`.
        plan: the room.
        occupied: outlines of the fixed furniture, and of given starts and goals of the robot.
        rng: random stream of the journeys.

    Raises:
        SceneError: there is no space.
    """
    planner = _Planner(Layout(plan, config, [], list(occupied)), rng)
    waiting = [queue.waiting.draw(rng) for queue in config.queues]
    for has_position in (True, False):  # given positions come first; drawn ones keep clear of them
        for k, door in enumerate(config.doors):
            if (door.x is not None) == has_position:
                planner.place_door(k, door)
        for k, queue in enumerate(config.queues):
            if (queue.x is not None) == has_position:
                planner.place_queue(k, queue, waiting[k])
    places = []
    for number, p in enumerate(config.places, 1):
        if not plan.is_on_floor(np.array([[p.x, p.y]])).all():
            raise SceneError(f"the place ({p.x:g}, {p.y:g}) is outside the room; move it (places)")
        position, radius = (quantised(p.x), quantised(p.y)), quantised(p.radius)
        places.append(Place(number, *position, radius, quantised(p.weight), _rounded(p.stay)))
    return Journeys(
        tuple(planner.doors[k] for k in range(len(config.doors))),
        tuple(planner.queues[k] for k in range(len(config.queues))),
        tuple(places),
        tuple(waiting),
        tuple(planner.zones),
    )


class _Planner:
    """Placement of doors and queues, one after another.

    Args:
        layout: the room with all that doors and queues keep clear of.
        rng: random stream of the journeys.

    Attributes:
        doors, queues: placed ones, by index in the scenario.
        zones: their outlines.
    """

    def __init__(self, layout: Layout, rng: RandomStream) -> None:
        self._layout, self._plan, self._attempts, self._rng = layout, layout.plan, layout.config.max_attempts, rng
        self.zones: list[PlacedShape] = []
        self.doors: dict[int, Door] = {}
        self.queues: dict[int, Queue] = {}
        self._body = largest_radius(layout.config.person)  # m, of kinds of persons with sizes of their own
        # start, end and length of the edges of the outline, counter-clockwise, m
        corners = (*self._plan.polygon, self._plan.polygon[0])
        self._edges = [(a, b, length(b[0] - a[0], b[1] - a[1])) for a, b in pairwise(corners)]

    def place_door(self, k: int, config: DoorConfig) -> None:
        """Place a door at the nearest place of the outline that is long enough, or draw its place."""
        for pose in [self._nearest_door(config)] if config.x is not None else self._drawn_doors(config):
            door = Door(k + 1, pose, quantised(config.width), quantised(config.share))
            if self._fits(door):
                self.doors[k] = door
                self._keep_free(self._door_zone(door))
                return
        if config.x is not None:
            raise SceneError(
                f"the door at ({door.pose.x:g}, {door.pose.y:g}) is too near to another one, or to furniture, a wall, "
                "or the robot; move it"
            )
        raise SceneError(
            f"no space for a door of {config.width:g} m in a {self._plan.size_text} room after {self._attempts} "
            "attempts; give its place (x, y), or widen the room"
        )

    def _nearest_door(self, config: DoorConfig) -> Pose:
        """The place for the middle of a door that is nearest to its given position.

        Raises:
            SceneError: no wall is long enough.
        """
        assert config.x is not None
        assert config.y is not None
        candidates: list[tuple[float, Pose]] = []
        margin = config.width / 2 + _JAMB
        for start, end, size in self._edges:
            if size >= 2 * margin:
                dx, dy = (end[0] - start[0]) / size, (end[1] - start[1]) / size
                along = (config.x - start[0]) * dx + (config.y - start[1]) * dy
                pose = _pose_on(start, end, min(max(along, margin), size - margin))
                candidates.append((length(pose.x - config.x, pose.y - config.y), pose))
        if not candidates:
            raise SceneError(f"no wall is long enough for a door of {config.width:g} m; make it narrower")
        return min(candidates, key=lambda item: item[0])[1]

    def _drawn_doors(self, config: DoorConfig) -> Iterator[Pose]:
        """Random places for the middle of a door."""
        margin = _CORNER + config.width / 2
        walls = [edge for edge in self._edges if edge[2] > config.width + 2 * _CORNER]
        for _ in range(self._attempts if walls else 0):
            start, end, size = self._rng.choice(walls, [wall[2] - config.width - 2 * _CORNER for wall in walls])
            yield _pose_on(start, end, self._rng.uniform(margin, size - margin))

    def _fits(self, door: Door) -> bool:
        """Whether a door keeps its distance from others, and the space in front of it is free."""
        spacings = (
            length(door.pose.x - other.pose.x, door.pose.y - other.pose.y) - (door.width + other.width) / 2
            for other in self.doors.values()
        )
        return all(spacing > _DOOR_SPACING for spacing in spacings) and self._is_free(self._door_zone(door))

    def _door_zone(self, door: Door) -> PlacedShape:
        """The space in front of a door, in which pedestrians appear."""
        depth, width = _DOOR_ZONE, door.width
        if self._body > LARGEST_ADULT:
            depth = max(depth, _ENTRY_DEPTH - LARGEST_ADULT + 2.0 * self._body)
            width += 2.0 * LARGEST_ADULT
        x, y = door.pose.to_world((0.02 + depth / 2, 0.0))
        return Rectangle(depth, width), Pose(x, y, door.pose.theta)

    def _is_free(self, zone: PlacedShape) -> bool:
        return self._layout.is_free(*zone, _GAP, _GAP)

    def _keep_free(self, zone: PlacedShape) -> None:
        self.zones.append(zone)
        self._layout.occupy([zone])

    def place_queue(self, k: int, config: QueueConfig, waiting: int) -> None:
        """Place a queue at its position, or at a random wall; its capacity is the number of slots with space."""
        best: Queue | None = None
        spacing = max(config.spacing, 2.0 * self._body + _GAP)
        for pose in self._queue_poses(config):
            queue = self._with_space(
                Queue(k + 1, pose.rounded(), quantised(spacing), _rounded(config.service), config.capacity)
            )
            if queue.capacity >= max(waiting, 1) and (best is None or queue.capacity > best.capacity):
                best = queue
            if best is not None and best.capacity == config.capacity:
                break
        if best is not None:
            self.queues[k] = best
            self._keep_free(_queue_zone(best))
            return
        people = counted(max(waiting, 1), "person")
        if config.x is not None:
            raise SceneError(
                f"the queue at ({config.x:g}, {config.y:g}) has no space for {people}; move it, or turn it (theta)"
            )
        raise SceneError(
            f"no space for a queue of {people} in a {self._plan.size_text} room after {self._attempts} attempts; "
            "give its place (x, y, theta), or widen the room"
        )

    def _queue_poses(self, config: QueueConfig) -> Iterator[Pose]:
        """The position of a queue, or random ones."""
        if config.x is not None and config.y is not None:
            yield Pose(config.x, config.y, config.theta)
            return
        for _ in range(self._attempts):
            start, end, size = self._rng.choice(self._edges, [edge[2] for edge in self._edges])
            wall = _pose_on(start, end, self._rng.uniform(0.0, size))
            yield Pose(*wall.to_world((max(_WALL_GAP, self._body + 2.0 * _GAP), 0.0)), wall.theta + PI)

    def _with_space(self, queue: Queue) -> Queue:
        """The queue with the number of its slots that are free as its capacity."""
        free = 0
        slot = Disc(max(_SLOT_RADIUS, self._body))
        while free < queue.capacity and self._is_free((slot, Pose(*queue.slot(free)))):
            free += 1
        return replace(queue, capacity=free)


def _pose_on(start: Point, end: Point, along: float) -> Pose:
    """The pose at a distance from the start of an edge, m, that faces into the room."""
    dx, dy = end[0] - start[0], end[1] - start[1]
    size = length(dx, dy)
    x, y = start[0] + dx * (along / size), start[1] + dy * (along / size)
    return Pose(quantised(x), quantised(y), canonical_angle(angle_of(dx, -dy)))


def _queue_zone(queue: Queue) -> PlacedShape:
    extent = (queue.capacity - 1) * queue.spacing + 2 * _SLOT_RADIUS
    x, y = queue.pose.to_world((_SLOT_RADIUS - extent / 2, 0.0))
    return Rectangle(extent, 2 * _SLOT_RADIUS), Pose(x, y, queue.pose.theta)


def _rounded(duration: Range) -> tuple[float, float]:
    return quantised(duration.min), quantised(duration.max)


# People


def with_visitors(
    scene: Scene, config: ScenarioConfig, journeys: Journeys, reactions: ReactionSampler, rng: RandomStream
) -> Scene:
    """Add the pedestrians that sit or wait at the start, and those that enter through doors.

    Furniture gets the ids after theirs, so that further pieces change no pedestrian's id, by which it draws.

    Args:
        scene: with everything else.
        config: its sections `doors` and `person`, and `seated`.
        journeys: of the scene.
        reactions: to the robot, by id.
        rng: random stream of the journeys.
    """
    visitors = [*_seated(scene, config, rng), *_waiting(config, journeys, rng)]
    parties = [[visitor] for visitor in visitors] + _arrivals(config, journeys.doors, scene.rules.last_tick, rng)
    if not parties:
        return scene
    scene, free = _with_free_ids(scene, len(config.people), sum(len(party) for party in parties))
    ids, group_ids = iter(free), iter(free_ids({group.id for group in scene.groups}, len(parties)))
    humans, groups, interactions = list(scene.humans), list(scene.groups), list(scene.interactions)
    for party in parties:
        members = tuple(next(ids) for _ in party)
        group = next(group_ids) if len(party) > 1 else None
        for human, id in zip(party, members, strict=True):
            seat = None if human.seat is None else scene.furniture[human.seat].id
            humans.append(reactions.assign(human, id=id, group=group, seat=seat))
        if group is not None:
            groups.append(Group(group, "walking", members))
            interactions.append(Interaction(members[0], WALKING_TOGETHER, members[1]))
    return replace(scene, humans=tuple(humans), groups=tuple(groups), interactions=tuple(interactions))


def _with_free_ids(scene: Scene, listed: int, count: int) -> tuple[Scene, list[int]]:
    """Return the scene with `count` free ids between its people and its furniture, and these ids.

    The first `listed` people, of the section `people`, may have any ids.
    """
    taken, drawn = {human.id for human in scene.humans[:listed]}, len(scene.humans) - listed
    ids = free_ids(taken, drawn + count + len(scene.furniture))[drawn:]
    moved: dict[int | None, int] = {piece.id: id for piece, id in zip(scene.furniture, ids[count:], strict=True)}
    furniture = tuple(replace(piece, id=moved[piece.id], on=moved.get(piece.on)) for piece in scene.furniture)
    interactions = tuple(replace(i, dst=moved.get(i.dst, i.dst)) for i in scene.interactions)
    return replace(scene, furniture=furniture, interactions=interactions), ids[:count]


def _seated(scene: Scene, config: ScenarioConfig, rng: RandomStream) -> Iterator[Human]:
    """Pedestrians on random seats with free space beside them; `seat` is an index in the scene's furniture."""
    count = config.seated.draw(rng)
    if not count:
        return
    space = FreeSpace(scene.outline, scene.barriers.joined(scene.standing_humans), _SLOT_RADIUS)
    seats = [
        (k, piece) for k, piece in enumerate(scene.furniture)
        if piece.is_seat and any(space.is_free_at(point) for point in piece.approaches(_SLOT_RADIUS))
    ]  # fmt: skip
    for k, piece in rng.shuffled(seats)[:count]:
        x, y = piece.front
        pose = Pose(*piece.pose.position, canonical_angle(angle_of(y, x)))
        yield replace(draw_human(who_sits(config.person), "wandering", pose, rng), seat=k)


def _waiting(config: ScenarioConfig, journeys: Journeys, rng: RandomStream) -> Iterator[Human]:
    """Pedestrians that stand in the queues, the first one first."""
    for queue, count in zip(journeys.queues, journeys.waiting, strict=True):
        for number in range(count):
            pose = Pose(*queue.slot(number), queue.pose.theta).rounded()
            yield replace(draw_human(config.person, "wandering", pose, rng), queue=queue.id)


def _arrivals(config: ScenarioConfig, doors: Sequence[Door], last_tick: int, rng: RandomStream) -> list[list[Human]]:
    """Pedestrians that enter through the doors, alone or in pairs, in the order of time.

    Source: the arrivals of a Poisson process are, given their number, independent and uniformly distributed.
    """
    parties: list[list[Human]] = []
    for door, settings in zip(doors, config.doors, strict=True):
        minutes = config.rules.time_limit / 60.0
        for _ in range(rng.poisson(settings.inflow * minutes)):
            tick = 1 + int(rng.uniform() * max(last_tick - 1, 0))
            spots = [(_ENTRY_DEPTH, 0.0)]
            if settings.pairs and rng.uniform() < settings.pairs:
                half = _PAIR_SPACING / 2
                side_by_side = [(_ENTRY_DEPTH, half), (_ENTRY_DEPTH, -half)]
                in_line = [(_ENTRY_DEPTH + _PAIR_SPACING, 0.0), (_ENTRY_DEPTH, 0.0)]
                spots = side_by_side if door.width >= _WIDE_DOOR else in_line
            room = max(door.reach - max(y for _, y in spots), 0.0)
            aside = rng.uniform(-room, room)
            parties.append([_entering(config, door, (x, y + aside), tick, rng) for x, y in spots])
    return sorted(parties, key=lambda party: party[0].enters)


def _entering(config: ScenarioConfig, door: Door, spot: Point, tick: int, rng: RandomStream) -> Human:
    """A pedestrian that walks in through a door, at a place relative to the door's pose."""
    human = draw_human(config.person, "wandering", Pose(0.0, 0.0), rng)
    ahead = spot[0] + max(human.shape.circumradius - LARGEST_ADULT, 0.0)  # a long body appears farther inside
    pose = Pose(*door.pose.to_world((ahead, spot[1])), door.pose.theta).rounded()
    human = replace(human, pose=pose)
    x, y = door.pose.direction
    velocity = quantised(human.desired_speed * x), quantised(human.desired_speed * y)
    return replace(human, enters=tick, velocity=velocity)
