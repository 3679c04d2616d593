"""Wayfinding: destinations of walking pedestrians and the paths to them.

Wandering pedestrians choose a random place in the room, or in one of its places of interest, and another one on
arrival, or after a pause; `walking` ones have a list of goals; recorded ones follow their tracks; assigned ones go
where `SocialDynamics` sends them.

`Wayfinding` makes these rare decisions in ordinary Python, and writes their results into `Routes`. The compiled
functions of `routes.py` follow the paths in every tick.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise

import numpy as np

from ...core.compiled.packing import zeros
from ...core.entities import PERSON_RADIUS, Place
from ...core.geometry import Barriers, Point, as_point
from ...core.humans import VX, VY, X, Y
from ...core.navigation import FreeSpace
from ...core.portable_math import Array, BoolArray
from ...core.rng import AgentStreams
from ...core.scene import Scene
from ...core.vectors import length
from .routes import Routes, is_near

_CLEARANCE = 0.05  # m, of shoulders from walls, furniture and standing people, where there is room
_TIGHT_CLEARANCE = 0.03  # m, of a body that passes sideways, where a body cannot pass ahead
_DETOUR = 1.3  # largest ratio of the lengths of a path with room and of a path without, at which the first is preferred
_WALL_TOLERANCE = 0.05  # m, by which a body may overlap a wall before its path counts as blocked
_SPOT_SPACING = 0.7  # m, between the places at which pedestrians stand for a time
_DOORWAY_DEPTH = 0.4  # m, in front of a door, where pedestrians neither stand nor wander to
_BRAKING_TIME = 0.5  # s, in which the velocity of a pedestrian that stops carries it to where it will stand
_STOPPING_DISTANCE = 0.8  # m from the goal, within which a pedestrian that is to stand there has arrived
_TRACK_LOOK_AHEAD = 1.0  # s, how far ahead on its track a recorded pedestrian aims
_MINIMUM_TRIP = 2.0  # m; random destinations nearer than this are rejected
_MEMBER_HALF_WIDTH = 0.4  # m, half the width that each member of a group needs at its destination
_ATTEMPTS = 30
_WAYPOINTS = 8  # initial length of a row of `Routes.path`


class Wayfinding:
    """Chooses destinations and finds paths; members of a wandering group share their leader's path.

    Pedestrians are identified by their index in `scene.humans`.

    Args:
        scene: the room and the pedestrians.

    Attributes:
        routes: targets and paths.
        space: free space of paths.
        tight: free space of bodies that pass sideways.
        passable: free space that is wider by a tolerance: a path that leaves it is blocked.
        choose_task: called with index and position when a wandering pedestrian needs a destination; returns True if
            it has set one with `send_to`. None: always choose at random.
        start_stay: called with index, place (m) and duration (s, or infinite) when a pedestrian is to stand where it
            has arrived. None: it goes on.
    """

    def __init__(self, scene: Scene) -> None:
        humans, count = scene.humans, len(scene.humans)
        self._scene = scene
        walking = [k for k, human in enumerate(humans) if human.behaviour in ("wandering", "walking")]
        self._recorded = [k for k, human in enumerate(humans) if human.behaviour == "recorded"]
        self._track_look_ahead = int(_TRACK_LOOK_AHEAD / scene.rules.dt + 0.5)  # ticks
        self._rng = AgentStreams(scene.seed, scene.episode, "people", scene.human_table.id.tolist())
        self._goals = {k: list(humans[k].goals) for k in walking if humans[k].behaviour == "walking"}
        self._stays = {k: list(humans[k].stays) for k in self._goals}  # at these goals, s
        self._stay = [0.0] * count  # at the present destination, s
        self._place: list[Place | None] = [None] * count  # of interest, of the present destination
        self._spots = np.full((count, 2), math.nan)  # where pedestrians stand for a time, or will, m
        self._position = self._velocity = self._spots  # of all pedestrians, m and m/s
        self._is_present = np.ones(count, dtype=bool)
        self._kept_free = _discs_kept_free(scene)
        self._has_groups = any(group.kind == "walking" for group in scene.groups)
        self._has_exits = any(human.exits for human in humans)
        self._versions = 0
        self.routes = zeros(
            Routes,
            count,
            order=np.array(walking, dtype=np.int64),
            leader=np.full(count, -1),
            first=np.arange(count),
            path=np.zeros((count, _WAYPOINTS, 2)),
            copied=np.full(count, -1),
            goals_left=np.array(
                [len(self._goals[k]) if k in self._goals else -1 for k in range(count)], dtype=np.int64
            ),
            is_exiting=np.array([human.exits for human in humans], dtype=bool),
            checkpoint=np.full((count, 2), math.nan),
            target=scene.human_table.position.copy(),
        )
        self._choose_leaders(walking)
        self.choose_task: Callable[[int, Point], bool] | None = None
        self.start_stay: Callable[[int, Point, float], None] | None = None
        may_walk = range(count) if scene.social.is_lively else walking
        self._depth = max((humans[k].radius for k in may_walk), default=PERSON_RADIUS)
        self._breadth = max((humans[k].shape.circumradius for k in may_walk), default=PERSON_RADIUS)
        self._robot = Barriers.of(())
        outline, barriers = scene.outline, scene.barriers
        self.space = self._places = FreeSpace(outline, barriers, self._breadth + _CLEARANCE)
        self.tight = FreeSpace(outline, barriers, self._depth + _TIGHT_CLEARANCE)
        self.space.find_edges()
        self.tight.find_edges()
        self.passable = FreeSpace(outline, barriers, self._depth - _WALL_TOLERANCE)
        self.set_obstacles(scene.standing_humans, scene.shared_spaces)
        xs, ys = zip(*scene.polygon, strict=True)
        self._bounding_box = min(xs), min(ys), max(xs), max(ys)

    def begin_tick(self, tick: int, humans: Array, is_present: BoolArray) -> None:
        """Prepare the compiled part of a tick: targets of recorded pedestrians, and the first paths.

        Args:
            tick: that begins.
            humans: (N, 9), columns of `core.humans`.
            is_present: (N,).
        """
        self._position, self._velocity, self._is_present = humans[:, X : Y + 1], humans[:, VX : VY + 1], is_present
        for k in self._recorded:
            self.routes.target[k] = self._scene.humans[k].track_position(tick + self._track_look_ahead)
        if tick == 0:
            self._start_straight(humans[:, X : Y + 1], [k for k in self.routes.order.tolist() if is_present[k]])

    def choose_destination(self, k: int, position: Point) -> None:
        """Give pedestrian k, at a position, m, its next destination and the path to it; without a path it stays."""
        if self.routes.is_stopping[k]:
            self.routes.is_stopping[k] = False
            x, y = self._end(k)
            # A pedestrian without progress is somewhere else on its path.
            if self.start_stay is not None and is_near(position[0], position[1], x, y, _STOPPING_DISTANCE):
                self._stay_here(k, position, self._stay[k])
                return
        if self.routes.goals_left[k] == 0:
            self._stay_here(k, position, math.inf)
            return
        if k in self._goals:
            # Goals of the scene are always approached, straight if there is no free path.
            goal = self._pop_goal(k)
            path = self.find_path(position, goal)
            if path is None:  # through a gap that is hardly wider than the body, or between people who talk
                path = self.passable.path(position, goal)
            self._set_path(k, np.array([position, goal]) if path is None else path, 1)
            return
        if self.choose_task is not None and self.choose_task(k, position):
            return
        rng = self._rng[k]
        followers = int(np.count_nonzero(self.routes.leader == k)) if self._has_groups else 1
        group_half_width = _MEMBER_HALF_WIDTH * followers
        for attempt in range(_ATTEMPTS):
            # The first half of the attempts looks for an untaken place of interest with room for all members.
            is_choosy = attempt < _ATTEMPTS // 2
            place = self._choose_place(k) if is_choosy else None
            goal = self._draw_goal(k, place)
            if place is None and is_near(position[0], position[1], goal[0], goal[1], _MINIMUM_TRIP):
                continue
            if not self.space.is_free_at(goal) or (is_choosy and self._is_taken(k, goal)):
                continue
            # A choosy leader goes where the group can walk abreast as it stands, and where all members have room.
            if is_choosy and self._is_in_file(k, position, goal):
                continue
            needs_room = group_half_width > _MEMBER_HALF_WIDTH and is_choosy
            if needs_room and self._scene.barriers.gaps(np.array([goal])).min() < group_half_width:
                continue
            path = self.find_path(position, goal)
            if path is not None:
                self._set_path(k, path)
                self._place[k] = place
                low, high = self._scene.social.pause if place is None else place.stay
                self._plan_stay(k, rng.uniform(low, high) if high > 0.0 else 0.0, goal)
                return
        self._set_path(k, np.array([position]), 0)

    def _is_in_file(self, k: int, position: Point, goal: Point) -> bool:
        """Whether a follower of pedestrian k is more ahead or behind than beside it on the way to a goal, m."""
        ahead, left = goal[0] - position[0], goal[1] - position[1]
        for other in self.followers(k):
            x, y = self._position[other, 0] - position[0], self._position[other, 1] - position[1]
            if abs(x * ahead + y * left) > abs(x * left - y * ahead):
                return True
        return False

    def _stay_here(self, k: int, position: Point, duration: float) -> None:
        """Let pedestrian k stand where it comes to rest: near its destination, not exactly there."""
        place = self.resting_place(k, position)
        self.reserve(k, place)
        if self.start_stay is not None:
            self.start_stay(k, place, duration)

    def resting_place(self, k: int, position: Point) -> Point:
        """Where pedestrian k comes to rest if it brakes now, at a position; m."""
        vx, vy = self._velocity[k].tolist()
        place = position[0] + vx * _BRAKING_TIME, position[1] + vy * _BRAKING_TIME
        return place if self.space.is_free_at(place) else position

    def reserve(self, k: int, place: Point) -> None:
        """Keep other pedestrians from standing where pedestrian k stands, or will stand, m, until it goes on."""
        self._spots[k] = place

    def _choose_place(self, k: int) -> Place | None:
        """A place of interest, by weight, other than the present one; None if the scene has no places."""
        places = self._scene.places
        others = [place for place in places if place is not self._place[k]] or places
        return self._rng[k].choice(others, [place.weight for place in others]) if others else None

    def _draw_goal(self, k: int, place: Place | None) -> Point:
        """A random point in a place of interest, or in the bounding box of the room; m."""
        rng = self._rng[k]
        if place is None:
            x0, y0, x1, y1 = self._bounding_box
            return rng.uniform(x0, x1), rng.uniform(y0, y1)
        while True:
            x, y = rng.uniform(-1.0, 1.0), rng.uniform(-1.0, 1.0)
            if x * x + y * y <= 1.0:
                return place.x + place.radius * x, place.y + place.radius * y

    def _plan_stay(self, k: int, duration: float, goal: Point) -> None:
        """Let pedestrian k stand at its destination, m, for a time, s."""
        self._stay[k] = duration
        self.routes.is_stopping[k] = duration > 0.0
        self._spots[k] = goal if duration > 0.0 else math.nan

    def _is_taken(self, k: int, goal: Point) -> bool:
        """Whether pedestrian k would stand where another one stands for a time, or will, or in front of a door."""
        offset = self._spots - goal
        near = offset[:, 0] * offset[:, 0] + offset[:, 1] * offset[:, 1] < _SPOT_SPACING * _SPOT_SPACING
        near[k] = False
        near &= self._is_present
        return bool(near.any()) or any(is_near(x, y, *goal, radius) for x, y, radius in self._kept_free)

    def last_goal(self, k: int) -> Point | None:
        """The last goal of pedestrian k if it is on its way to it, m."""
        return self._end(k) if self.routes.length[k] > 0 and self.routes.goals_left[k] == 0 else None

    def _end(self, k: int) -> Point:
        """The end of the path of pedestrian k, m."""
        return as_point(self.routes.path[k, self.routes.length[k] - 1])

    def find_new_path(self, k: int, position: Point) -> None:
        """Find a new path to the same destination for a pedestrian that was pushed off its path."""
        path = self.find_path(position, self._end(k))
        if path is not None:
            self._set_path(k, path)

    def set_obstacles(self, standing: Barriers, shared_spaces: Barriers) -> None:
        """Replace the obstacles that paths avoid besides walls and furniture: standing people and their o-spaces."""
        self._standing, self._shared_spaces = standing, shared_spaces
        self._update_spaces()

    def set_robot(self, robot: Barriers) -> None:
        """Replace the outline of the robot that paths avoid: one that stands; empty while it moves."""
        self._robot = robot
        self._update_spaces()

    def _update_spaces(self) -> None:
        solids = self._standing.joined(self._robot)
        obstacles = solids.joined(self._shared_spaces)
        self.space, self.tight = self.space.with_added(obstacles), self.tight.with_added(obstacles)
        self.passable = self.passable.with_added(solids)
        self._places = self.space.with_added(solids)  # also those between people who talk

    def find_path(self, start: Point, goal: Point) -> Array | None:
        """The path to a goal with room for the shoulders, or a shorter one on which they must turn.

        Args:
            start, goal: m.

        Returns:
            (K, 2), m; None if there is no path.
        """
        path = self.space.path(start, goal)
        if path is not None and _length(path) <= _DETOUR * length(goal[0] - start[0], goal[1] - start[1]):
            return path  # no other one is much shorter
        tight = self.tight.path(start, goal)
        if path is None or tight is None:
            return tight if path is None else path
        return tight if _length(path) > _DETOUR * _length(tight) else path

    def is_open(self, start: Point, end: Point) -> bool:
        """Whether a pedestrian can stand at the end, and walk there straight from the start; m."""
        return self._places.is_open(start, end)

    def send_to(self, k: int, position: Point, destination: Point) -> bool:
        """Send pedestrian k from its position to a destination, m, where it stays; False if there is no path."""
        path = self.find_path(position, destination)
        if path is not None:
            self._set_path(k, path)
            self.routes.is_assigned[k], self.routes.is_stopping[k] = True, False
            self._spots[k] = math.nan
        return path is not None

    def stop(self, k: int) -> None:
        """Let pedestrian k stay where it is until `send_to` or `start_wandering`."""
        self.routes.is_assigned[k], self.routes.is_stopping[k] = True, False
        if self.routes.leader[k] >= 0:
            self._set_path(k, np.zeros((0, 2)), 0)

    def start_wandering(self, k: int, position: Point) -> None:
        """Let pedestrian k, which is at a position, m, go on, or wander if it stood from the start."""
        routes = self.routes
        routes.is_assigned[k] = routes.is_stopping[k] = False
        self._spots[k] = math.nan
        routes.checkpoint[k] = math.nan  # it makes progress from now on
        if routes.leader[k] < 0:
            self.routes = routes._replace(order=np.append(routes.order, k))
            routes.leader[k] = k
        # A path that ends where the pedestrian is: it chooses a destination in the next tick.
        self._set_path(k, np.array([position, position]), 1)

    def followers(self, k: int) -> list[int]:
        """The pedestrians that follow pedestrian k."""
        if not self._has_groups:
            return []
        return [int(other) for other in np.flatnonzero(self.routes.leader == k) if other != k]

    def lead_itself(self, k: int) -> None:
        """Let pedestrian k follow no other one any more."""
        self.routes.leader[k] = self.routes.first[k] = k

    @property
    def leaving(self) -> tuple[int, ...]:
        """Walking pedestrians that have reached the goal where they leave the scene."""
        return tuple(np.flatnonzero(self.routes.is_leaving).tolist()) if self._has_exits else ()

    def _choose_leaders(self, walking: list[int]) -> None:
        index = self._scene.human_table.row
        groups = (group for group in self._scene.groups if group.kind == "walking")
        leader_of = {index[m]: index[group.members[0]] for group in groups for m in group.members}
        self.routes.version[walking] = [self._new_version() for _ in walking]
        # Members with goals of their own, or whose leader does not walk, lead themselves.
        followed = [k if k in self._goals else leader_of.get(k, k) for k in walking]
        walks = set(walking)
        for k, leader in leader_of.items():
            self.routes.first[k] = leader if leader in walks else k
        self.routes.leader[walking] = [
            leader if leader in walks else k for k, leader in zip(walking, followed, strict=True)
        ]

    def _pop_goal(self, k: int) -> Point:
        goal = self._goals[k].pop(0)
        self._plan_stay(k, self._stays[k].pop(0) if self._stays[k] else 0.0, goal)
        self.routes.goals_left[k] = len(self._goals[k])
        return goal

    def _new_version(self) -> int:
        self._versions += 1
        return self._versions

    def _set_path(self, k: int, path: Array, following: int | None = None) -> None:
        """Start on a path from its first point, the present position, or aim at another waypoint.

        Args:
            k: index of the pedestrian.
            path: (K, 2), m.
            following: index of the waypoint to aim at.
        """
        routes, count = self.routes, len(path)
        if count > routes.path.shape[1]:
            longer = np.zeros((len(routes.path), 2 * count, 2))
            longer[:, : routes.path.shape[1]] = routes.path
            routes = self.routes = routes._replace(path=longer)
        routes.path[k, :count] = path
        routes.length[k], routes.version[k] = count, self._new_version()
        routes.next[k] = min(1, count - 1) if following is None else following

    def _start_straight(self, position: Array, walking: list[int]) -> None:
        """Send pedestrians that see their first goal straight there.

        One test for all is faster than a path search for each, and a crowd may start together.
        """
        going = [k for k in walking if self._goals.get(k)]
        if not going:
            return
        start, goal = position[going], np.array([self._goals[k][0] for k in going])
        clear = self.space.is_clear(start, goal) | (~self.space.is_free(start) & self.passable.is_clear(start, goal))
        for k in np.array(going)[clear].tolist():
            self._set_path(k, np.array([position[k], self._pop_goal(k)]), 1)


def _discs_kept_free(scene: Scene) -> list[tuple[float, float, float]]:
    """Discs in which no random destination lies, x, y and radius, m: in front of doors, and along queues."""
    discs = [(*door.pose.to_world((_DOORWAY_DEPTH, 0.0)), door.width / 2 + _DOORWAY_DEPTH) for door in scene.doors]
    return discs + [(*q.slot(number), _SPOT_SPACING) for q in scene.queues for number in range(q.capacity)]


def _length(path: Array) -> float:
    """Length of a path (K, 2), m."""
    total = 0.0
    for (x, y), (next_x, next_y) in pairwise(path.tolist()):
        total += length(next_x - x, next_y - y)
    return total
