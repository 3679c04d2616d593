"""`Wayfinding`: destinations of walking pedestrians and the paths to them.

Wandering pedestrians choose a random place in the room, and another one on arrival; `walking` ones have a list of
goals; recorded ones follow their tracks; assigned ones go where `SocialDynamics` sends them.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...core.entities import PERSON_RADIUS
from ...core.geometry import Barriers, Point
from ...core.humans import Humans
from ...core.navigation import FreeSpace
from ...core.portable_math import Array
from ...core.rng import RandomStream
from ...core.scene import Scene
from ...core.vectors import lengths

CLEARANCE = 0.10  # m, of paths from walls, furniture and standing people
WALL_TOLERANCE = 0.05  # m, by which a body may overlap a wall before its path counts as blocked
ARRIVAL_DISTANCE = 0.5  # m from the goal
TRACK_LOOK_AHEAD = 1.0  # s, how far ahead on its track a recorded pedestrian aims
WAYPOINT_DISTANCE = 0.35  # m from a waypoint at which the next one becomes the target
MINIMUM_TRIP = 2.0  # m; random destinations nearer than this are rejected
CHECK_INTERVAL = 5  # ticks between checks whether paths are still free
PROGRESS_INTERVAL = 30  # ticks in which a wandering pedestrian must make progress, else it chooses a new destination
MINIMUM_PROGRESS = 0.4  # m
MEMBER_HALF_WIDTH = 0.4  # m, half the width that each member of a group needs at its destination
ROOM_AHEAD = 1.5  # m, free distance that a follower needs to walk beside its leader
_ATTEMPTS = 30


class Wayfinding:
    """The targets and paths of all walking pedestrians; members of a wandering group share their leader's path.

    Pedestrians are identified by their index in `scene.humans`. A path is a (K, 2) array of waypoints, m; an empty one
    means that the pedestrian stays where it is.

    Args:
        scene: the room and the pedestrians.

    Attributes:
        target: (N, 2), m, the present waypoint of each pedestrian.
        is_final: (N,) of bool, whether the target is where the pedestrian will stay.
        leader: for each walking pedestrian the leader of its group, or the pedestrian itself.
        leaving: pedestrians that have reached the place where they leave the scene.
        assigned: pedestrians whose destination is set from outside; they choose none themselves.
        choose_task: called with index and position when a wandering pedestrian needs a destination; returns True if
            it has set one with `send_to`. None: always choose at random.
    """

    def __init__(self, scene: Scene) -> None:
        humans = scene.humans
        self._scene = scene
        walking = [k for k, human in enumerate(humans) if human.behaviour in ("wandering", "walking")]
        self._recorded = [k for k, human in enumerate(humans) if human.behaviour == "recorded"]
        self._track_look_ahead = int(TRACK_LOOK_AHEAD / scene.rules.dt + 0.5)  # ticks
        self._exiting = {k for k in walking if humans[k].exits}
        self.leaving: tuple[int, ...] = ()
        self._rng = {k: RandomStream(scene.seed, scene.episode, "people", humans[k].id) for k in walking}
        self._goals = {k: list(humans[k].goals) for k in walking if humans[k].behaviour == "walking"}
        index = {human.id: k for k, human in enumerate(humans)}
        leader_of = {m: index[g.members[0]] for g in scene.groups if g.kind == "walking" for m in g.members}
        # Members with goals of their own, or whose leader does not walk, lead themselves.
        leader_of = {m: k for m, k in leader_of.items() if index[m] not in self._goals and k in walking}
        self.leader = {k: leader_of.get(humans[k].id, k) for k in walking}  # in the scene's order
        self._paths: dict[int, Array] = {k: np.zeros((0, 2)) for k in walking}
        self._copied: dict[int, Array] = {}  # the leader's path that a follower copied last
        self._next: dict[int, int] = dict.fromkeys(walking, 0)  # index of the present waypoint
        self._checkpoint: dict[int, Point] = {}  # position at the last progress check
        self.target = np.array([human.pose.position for human in humans], dtype=float).reshape(-1, 2)
        self.is_final = np.zeros(len(humans), dtype=bool)
        self.assigned: set[int] = set()
        self._abreast: set[int] = set()  # followers with room to walk beside their leader
        self.choose_task: Callable[[int, Point], bool] | None = None
        may_walk = range(len(humans)) if scene.social.is_lively else walking
        self._clearance = max((humans[k].radius for k in may_walk), default=PERSON_RADIUS) + CLEARANCE
        self.set_obstacles(scene.standing_humans, scene.shared_spaces)
        low, high = scene.outline.min(axis=0), scene.outline.max(axis=0)
        self._bounding_box = (*low.tolist(), *high.tolist())

    def update(self, tick: int, humans: Humans, presence: Array | None = None) -> Array:
        """Advance by one tick.

        Args:
            tick: that begins.
            humans: one row for each human of the scene.
            presence: (N + 1,), 0 for absent pedestrians; None: all are present.

        Returns:
            (N, 2), m, the next waypoint of each pedestrian; the initial position of standing ones, arbitrary for
            absent ones.
        """
        for k in self._recorded:
            self.target[k] = self._scene.humans[k].track_position(tick + self._track_look_ahead)
        if not self.leader:
            return self.target.copy()
        leaders = self.leader if presence is None else {k: leader for k, leader in self.leader.items() if presence[k]}
        walking = list(leaders)
        positions = humans.position.tolist()
        if tick == 0:
            self._start_straight(humans.position, walking)
        for k, leader in leaders.items():
            leader = leader if leader in leaders else k  # followers of an absent leader lead themselves
            position = (positions[k][0], positions[k][1])
            if leader == k and (self._needs_destination(tick, k, position) or self._is_stuck(tick, k, position)):
                self._choose_destination(k, position)
            if leader != k and self._copied.get(k) is not self._paths[leader]:
                self._copied[k] = self._paths[leader]
                self._set_path(k, self._paths[leader])
        self._advance(tick, humans.position, walking)
        for k in walking:
            if len(self._paths[k]):
                self.target[k] = self._paths[k][self._next[k]]
        # Followers abreast aim at the leader's target, shifted by their present offset from the leader.
        for k in walking:
            if k in self._abreast and leaders[k] in leaders:
                self.target[k] = self.target[leaders[k]] + humans.position[k] - humans.position[leaders[k]]
        for k in walking:
            self.is_final[k] = len(self._paths[k]) > 0 and self._is_at_last_waypoint(k) and k not in self._exiting
        self.leaving = tuple(
            k
            for k in walking
            if k in self._exiting
            and self._is_at_last_waypoint(k)
            and _is_near(positions[k], self.target[k], ARRIVAL_DISTANCE)
        )
        return self.target.copy()

    def set_obstacles(self, standing: Barriers, shared_spaces: Barriers) -> None:
        """Replace the obstacles that paths avoid besides walls and furniture: standing people and their o-spaces."""
        solids = self._scene.barriers.joined(standing)
        self._space = FreeSpace(self._scene.outline, solids.joined(shared_spaces), self._clearance)
        self._passable = FreeSpace(self._scene.outline, solids, self._clearance - CLEARANCE - WALL_TOLERANCE)

    def is_open(self, start: Point, end: Point) -> bool:
        """Whether a pedestrian can stand at the end, and walk there straight from the start; m."""
        starts, ends = np.array([start]), np.array([end])
        return bool(self._space.is_free(ends)[0] and self._space.is_clear(starts, ends)[0])

    def send_to(self, k: int, position: Point, destination: Point) -> bool:
        """Send pedestrian k from its position to a destination, m, where it stays; False if there is no path."""
        path = self._space.path(position, destination)
        if path is not None:
            self._set_path(k, path)
            self.assigned.add(k)
        return path is not None

    def stop(self, k: int) -> None:
        """Let pedestrian k stay where it is until `send_to` or `start_wandering`."""
        self.assigned.add(k)
        if k in self._paths:
            self._paths[k], self._next[k] = np.zeros((0, 2)), 0

    def start_wandering(self, k: int, position: Point) -> None:
        """Let pedestrian k, which is at a position, m, wander from now on, even if it stood from the start."""
        self.assigned.discard(k)
        # A path that ends where the pedestrian is: it chooses a destination in the next update.
        self.leader[k], self._paths[k], self._next[k] = k, np.array([position, position]), 1
        if k not in self._rng:
            self._rng[k] = RandomStream(self._scene.seed, self._scene.episode, "people", self._scene.humans[k].id)

    def points_ahead(self, position: Array, distance: Array) -> Array:
        """The points at a distance ahead on each pedestrian's path, or the end of the path.

        Args:
            position: (N, 2), m.
            distance: (N,), m.

        Returns:
            (N, 2), m; the target of pedestrians that do not walk.
        """
        points = self.target.copy()
        for k in self.leader:
            path, n, remaining = self._paths[k], self._next[k], float(distance[k])
            x, y = position[k].tolist()
            for end_x, end_y in path[n:].tolist():
                dx, dy = end_x - x, end_y - y
                length = float(np.sqrt(dx * dx + dy * dy))
                if length >= remaining:
                    points[k] = x + dx * (remaining / length), y + dy * (remaining / length)
                    break
                points[k], remaining, x, y = (end_x, end_y), remaining - length, end_x, end_y
        return points

    def _set_path(self, k: int, path: Array) -> None:
        """Start on a path from its first point, the present position."""
        self._paths[k], self._next[k] = path, min(1, len(path) - 1)

    def _is_at_last_waypoint(self, k: int) -> bool:
        """Whether a pedestrian that stays where its path ends is on its last segment."""
        stays = k in self.assigned or self._goals.get(k) == []
        return stays and self._next[k] == len(self._paths[k]) - 1

    def _needs_destination(self, tick: int, k: int, position: Point) -> bool:
        """Whether a pedestrian has arrived; without a path it tries again every `CHECK_INTERVAL`."""
        path = self._paths[k]
        if k in self.assigned or (k in self._goals and not self._goals[k]):
            return False
        if len(path) < 2:
            return not len(path) or tick % CHECK_INTERVAL == 0
        return self._next[k] == len(path) - 1 and _is_near(position, path[-1], ARRIVAL_DISTANCE)

    def _is_stuck(self, tick: int, k: int, position: Point) -> bool:
        """Whether a wandering pedestrian made no progress since the last check, `PROGRESS_INTERVAL` ticks ago."""
        if k in self._goals or k in self.assigned or (tick + k) % PROGRESS_INTERVAL:
            return False
        before, self._checkpoint[k] = self._checkpoint.get(k), position
        return before is not None and _is_near(position, before, MINIMUM_PROGRESS)

    def _choose_destination(self, k: int, position: Point) -> None:
        """Give a pedestrian its next destination and the path to it; without a path it stays."""
        if k in self._goals:
            # Goals of the scene are always approached, straight if there is no free path.
            goal = self._goals[k].pop(0)
            path = self._space.path(position, goal)
            self._paths[k], self._next[k] = np.array([position, goal]) if path is None else path, 1
            return
        if self.choose_task is not None and self.choose_task(k, position):
            return
        x0, y0, x1, y1 = self._bounding_box
        rng = self._rng[k]
        group_half_width = MEMBER_HALF_WIDTH * sum(leader == k for leader in self.leader.values())
        for attempt in range(_ATTEMPTS):
            goal = (rng.uniform(x0, x1), rng.uniform(y0, y1))
            point = np.array([goal])
            if _is_near(position, goal, MINIMUM_TRIP) or not self._space.is_free(point)[0]:
                continue
            is_group = group_half_width > MEMBER_HALF_WIDTH
            if is_group and attempt < _ATTEMPTS // 2 and self._scene.barriers.gaps(point).min() < group_half_width:
                continue  # the first half of the attempts looks for a place with room for all members
            path = self._space.path(position, goal)
            if path is not None:
                self._set_path(k, path)
                return
        self._paths[k], self._next[k] = np.array([position]), 0

    def _start_straight(self, position: Array, walking: list[int]) -> None:
        """Send pedestrians that see their first goal straight there.

        One test for all is faster than a path search for each, and a crowd may start together.
        """
        going = [k for k in walking if self._goals.get(k)]
        if not going:
            return
        start, goal = position[going], np.array([self._goals[k][0] for k in going])
        clear = self._space.is_clear(start, goal) | (~self._space.is_free(start) & self._passable.is_clear(start, goal))
        for k in np.array(going)[clear].tolist():
            self._paths[k], self._next[k] = np.array([position[k], self._goals[k].pop(0)]), 1

    def _advance(self, tick: int, position: Array, walking: list[int]) -> None:
        """Aim at the next waypoint when the present one is reached or the next one is in view; repair blocked paths."""
        for k in walking:
            path, n = self._paths[k], self._next[k]
            if n < len(path) - 1 and _is_near(position[k].tolist(), path[n], WAYPOINT_DISTANCE):
                self._next[k] = n + 1
        checked = [k for k in walking if len(self._paths[k])] if tick % CHECK_INTERVAL == 0 else []
        if not checked:
            return
        self._find_room_abreast(position, walking)
        following = [min(self._next[k] + 1, len(self._paths[k]) - 1) for k in checked]
        following_point = np.array([self._paths[k][n] for k, n in zip(checked, following, strict=True)])
        target = np.array([self._paths[k][self._next[k]] for k in checked])
        in_view = self._space.is_clear(position[checked], following_point).tolist()
        passable = self._passable.is_clear(position[checked], target).tolist()
        for k, n, can_skip, can_continue in zip(checked, following, in_view, passable, strict=True):
            if can_skip:
                self._next[k] = n
            elif not can_continue:
                self._replan(k, position[k].tolist())

    def _find_room_abreast(self, position: Array, walking: list[int]) -> None:
        """Find the followers with room to walk beside their leader, in its direction."""
        present = set(walking)
        pairs = [(k, self.leader[k]) for k in walking if self.leader[k] != k and self.leader[k] in present]
        if not pairs:
            self._abreast = set()
            return
        followers, leaders = ([pair[side] for pair in pairs] for side in (0, 1))
        ahead = self.target[leaders] - position[leaders]
        distance = np.maximum(lengths(ahead), 1e-6)
        step = ahead * (np.minimum(distance, ROOM_AHEAD) / distance)[:, None]
        clear = self._space.is_clear(position[followers], position[followers] + step)
        self._abreast = {k for k, has_room in zip(followers, clear.tolist(), strict=True) if has_room}

    def _replan(self, k: int, position: list[float]) -> None:
        """Find a new path to the same destination for a pedestrian that was pushed off its path."""
        goal = self._paths[k][-1]
        path = self._space.path((position[0], position[1]), (float(goal[0]), float(goal[1])))
        if path is not None:
            self._set_path(k, path)


def _is_near(point: list[float] | Point, other: Array | Point, radius: float) -> bool:
    dx, dy = float(other[0]) - point[0], float(other[1]) - point[1]
    return dx * dx + dy * dy < radius * radius
