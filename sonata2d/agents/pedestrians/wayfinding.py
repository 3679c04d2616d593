"""Wayfinding: obstacles that paths avoid, destinations of pedestrians, and the paths to them.

The decisions that need a path are rare; `routes` follows the paths in every tick.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ...core.barrier_grid import Solids, changeable_solids, fill_grid, set_barrier
from ...core.compiled.kernel import subroutine
from ...core.compiled.packing import Bools, Floats, Floats2, Ints, Packed
from ...core.compiled.scalar import angle_of, length
from ...core.doors import HALF_THICKNESS
from ...core.entities import PERSON_RADIUS
from ...core.free_space import Space, is_free
from ...core.geometry import Point
from ...core.humans import BODY_X, BODY_Y
from ...core.leaves import HINGE_X, HINGE_Y, leaf_end, solids_with_doors
from ...core.navigation import FloorPlan, find_edges, floor_plan
from ...core.portable_math import Array, BoolArray, IntArray
from ...core.scene import Scene
from ...core.separation import place_corners
from ...core.visibility import Graph
from .doorways import Doorways
from .robots import Robots, core_of, corners_of
from .routes import Routes
from .social.company import Company, is_in_the_way

_CLEARANCE = 0.05  # m, of shoulders from walls, furniture and standing people, where there is room
_TIGHT_CLEARANCE = 0.03  # m, of a body that passes sideways, where a body cannot pass ahead
_WALL_TOLERANCE = 0.05  # m, by which a body may overlap a wall before its path counts as blocked
BRAKING_TIME = 0.5  # s, in which the velocity of a pedestrian that stops carries it to where it will stand
_LARGEST_CIRCLE = 1.0  # m, from the centre of a conversation to its members, up to which others do not walk through it
LONGEST_PATH = 512  # points of the longest path that is found
_RESTS, _IS_OBSTACLE, _ROBOT_X, _ROBOT_Y, _COS, _SIN = range(6)  # columns of `Obstacles.standing_robots`
_STANDING_SPEED, _STANDING_TIME = 0.05, 1.0  # m/s and s: a robot that is slower for so long counts as an obstacle


class Obstacles(NamedTuple):
    """Obstacles of the pedestrians.

    Attributes:
        solids: walls and furniture, then the leaves of doors that move.
        view_blocks: walls that can block a view between two places in the room, then these leaves.
        space: free space of paths: people and robots that stand, and the spaces inside groups that talk are added to
            walls and furniture.
        passable: free space of bodies: without the spaces inside groups, and wider by a tolerance; a path that leaves
            it is blocked.
        space_graph, tight_graph, passable_graph: visibility graphs.
        for_space, for_space_graph, ...: the same as kernels take it; `tight` is the space of bodies that pass sideways,
            and `places` also contains those between people who talk.
        standing_robots: (R, 6), for each robot the ticks for which it has rested, whether it counts as an obstacle, and
            where it then is, m, and its heading, cosine and sine.
        side: to which pedestrians evade each other: 1 to the right, -1 to the left.
        dt: tick, s.
    """

    solids: Solids
    view_blocks: Solids
    space: Space
    passable: Space
    space_graph: Graph
    tight_graph: Graph
    passable_graph: Graph
    for_space: Ints
    for_space_graph: Ints
    for_tight: Ints
    for_tight_graph: Ints
    for_passable: Ints
    for_passable_graph: Ints
    for_places: Ints
    standing_robots: Floats2
    side: float
    dt: float


class Journeys(NamedTuple):
    """Destinations of pedestrians beyond their present paths.

    Attributes:
        goal_start: (N + 1,) of int, where the goals of each pedestrian begin in `goal`.
        goal: (G, 2), m, of the scene.
        goal_stay: (G,), s, for which the pedestrian stands there.
        track_start: (N + 1,) of int, where the track of each recorded pedestrian begins in `track`.
        track: (T, 2), m, a position for each tick.
        enters: (N,) of int, tick of the first one.
        look_ahead: (1,) of int, ticks, how far ahead on its track a recorded pedestrian aims.
        stay: (N,), s, for which each pedestrian stands at its present destination.
        onward_stay: (N,), s, the same at the destination `Routes.onward`.
        delay: (N,), s, for which each pedestrian still stands before it sets off for the first time.
        wants_stop: (N,) of bool, pedestrians that stop at the next suitable place.
        place: (N,) of int, place of interest of the present destination; -1 for none.
        spot: (N, 2), m, where pedestrians stand for a time, or will; NaN for others.
        paths: (1,) of int, number of paths that were set.
    """

    goal_start: Ints
    goal: Floats2
    goal_stay: Floats
    track_start: Ints
    track: Floats2
    enters: Ints
    look_ahead: Ints
    stay: Floats
    onward_stay: Floats
    delay: Floats
    wants_stop: Bools
    place: Ints
    spot: Floats2
    paths: Ints


class Spaces:
    """The free spaces of a scene's pedestrians, and the memory behind `Obstacles`.

    Args:
        scene: the room and the pedestrians.
        view_blocks: see `Obstacles`.

    Attributes:
        obstacles: of the pedestrians, without added ones.
        clearance: of paths from walls, m.
    """

    def __init__(self, scene: Scene, view_blocks: Solids) -> None:
        humans, robots = scene.humans, scene.robot_ids
        sides = sum(len(robot.outline.core) for robot, _ in scene.tasks)
        may_walk = [h for h in humans if scene.social.is_lively or h.behaviour in ("wandering", "walking")]
        # Half the breadth of the broadest body, and half the depth of the deepest one that can pass sideways.
        breadth = max((human.radius + max(human.shoulder, 0.0) for human in may_walk), default=PERSON_RADIUS)
        depth = max((human.radius for human in may_walk if human.shoulder >= 0.0), default=PERSON_RADIUS)
        self.clearance = breadth + _CLEARANCE
        widths = self.clearance, depth + _TIGHT_CLEARANCE, depth - _WALL_TOLERANCE
        plans = [floor_plan(scene.outline, scene.barriers, width) for width in widths]
        solids, count = solids_with_doors(scene.barriers, scene.moving_doors), len(humans)
        fixed = sides + len(scene.moving_doors)
        bodies, around = changeable_solids(solids, count + fixed), changeable_solids(solids, 3 * count + fixed)
        holes, hole_count = np.zeros((2 * count + 1, 4)), np.zeros(1, dtype=np.int64)
        no_holes = np.zeros((0, 4)), np.zeros(1, dtype=np.int64)
        added = [(around, holes, hole_count), (around, holes, hole_count), (bodies, *no_holes), (bodies, *no_holes)]
        spaces = [
            _space(plan, width, *others)
            for plan, width, others in zip([*plans, plans[0]], [*widths, widths[0]], added, strict=True)
        ]
        graphs = [plan.graph(len(others[0].table)) for plan, others in zip(plans, added, strict=False)]
        self._packed = [*map(Packed, spaces)], [*map(Packed, graphs)]
        for_spaces, for_graphs = ([one.argument for one in packed] for packed in self._packed)
        for k in range(2):
            find_edges(plans[k], for_spaces[k], for_graphs[k])
        for_space, for_tight, for_passable, for_places = for_spaces
        for_space_graph, for_tight_graph, for_passable_graph = for_graphs
        self.obstacles = Obstacles(
            solids, view_blocks, spaces[0], spaces[2], graphs[0], graphs[1], graphs[2], for_space, for_space_graph,
            for_tight, for_tight_graph, for_passable, for_passable_graph, for_places,
            np.zeros((len(robots), 6)), float(scene.rules.side), float(scene.rules.dt),
        )  # fmt: skip


def _space(plan: FloorPlan, clearance: float, added: Solids, holes: Array, hole_count: IntArray) -> Space:
    return Space(plan.solids, added, plan.borders, holes, hole_count, clearance)


@subroutine
def watch_robots(obstacles: Obstacles, robots: Robots) -> bool:
    """Let paths lead round robots that stand, as round pieces of furniture; whether this has changed."""
    is_changed = False
    for r in range(len(robots.state)):
        if _watch_robot(obstacles, r, robots.state[r]):
            is_changed = True
    return is_changed


@subroutine
def _watch_robot(obstacles: Obstacles, r: int, robot: Array) -> bool:
    own = obstacles.standing_robots[r]
    is_moving = robot[2] * robot[2] + robot[3] * robot[3] > _STANDING_SPEED * _STANDING_SPEED
    own[_RESTS] = 0.0 if is_moving else own[_RESTS] + 1.0
    is_obstacle = own[_RESTS] * obstacles.dt >= _STANDING_TIME
    if is_obstacle == (own[_IS_OBSTACLE] != 0.0):
        return False
    own[_IS_OBSTACLE], own[_ROBOT_X], own[_ROBOT_Y] = 1.0 if is_obstacle else 0.0, robot[0], robot[1]
    own[_COS], own[_SIN] = robot[BODY_X], robot[BODY_Y]
    return True


@subroutine
def robot_stands(obstacles: Obstacles) -> bool:
    """Whether a robot counts as an obstacle."""
    for own in obstacles.standing_robots:
        if own[_IS_OBSTACLE] != 0.0:
            return True
    return False


@subroutine
def update_obstacles(
    obstacles: Obstacles, doors: Doorways, robots: Robots, company: Company, is_present: BoolArray, with_robots: bool
) -> None:
    """Replace the added obstacles: people, robots and leaves that stand, and the spaces inside groups that talk."""
    bodies, around = obstacles.passable.added, obstacles.space.added
    place, count = company.standing_position, 0
    is_standing = np.zeros(len(is_present), dtype=np.bool_)
    for k in range(len(is_present)):
        if not company.is_walking[k] and is_in_the_way(company, k, is_present):
            is_standing[k] = True
            set_barrier(bodies.table, count, place[k, 0], place[k, 1], place[k, 0], place[k, 1], company.size[k])
            count += 1
    for r in range(len(robots.state)):
        own, corners = obstacles.standing_robots[r], corners_of(robots, r)
        if own[_IS_OBSTACLE] == 0.0 or not with_robots:
            continue
        place_corners(core_of(robots, r), own[_ROBOT_X], own[_ROBOT_Y], own[_COS], own[_SIN], corners)
        for side in range(len(corners)):
            end = (side + 1) % len(corners)
            ends = corners[side, 0], corners[side, 1], corners[end, 0], corners[end, 1]
            set_barrier(bodies.table, count, *ends, robots.rounding[r])
            count += 1
    for d in range(len(doors.frames)):
        if doors.stands_open[d]:
            end_x, end_y = leaf_end(doors.frames, d, doors.openings[d])
            x, y = doors.frames[d, HINGE_X], doors.frames[d, HINGE_Y]
            set_barrier(bodies.table, count, x, y, end_x, end_y, HALF_THICKNESS)
            count += 1
    bodies.used[0] = around.used[0] = count
    for k in range(count):
        for column in range(8):
            around.table[k, column] = bodies.table[k, column]
    fill_grid(bodies.table, count, bodies.grid)
    obstacles.space.hole_count[0] = 0
    ring = np.empty(len(is_present), dtype=np.int64)
    for f in range(len(company.formation_start) - 1):
        size = 0
        for n in range(company.formation_start[f], company.formation_start[f + 1]):
            if company.is_in_formation[company.member[n]]:
                ring[size] = company.member[n]
                size += 1
        _add_ring(obstacles.space, place, ring[:size])
    for k in range(len(is_present)):
        if is_standing[k]:
            _add_circle(obstacles.space, company, k, is_standing, ring)
    use_added(obstacles, around.used[0])
    _forget_added(obstacles.passable_graph)


@subroutine
def use_added(obstacles: Obstacles, count: int) -> None:
    """Let paths lead round a number of the added obstacles, the first ones."""
    around = obstacles.space.added
    around.used[0] = count
    fill_grid(around.table, count, around.grid)
    _forget_added(obstacles.space_graph)
    _forget_added(obstacles.tight_graph)


@subroutine
def _forget_added(graph: Graph) -> None:
    """Let the next search in a visibility graph look at the added obstacles again."""
    graph.added_count[0] = -1
    graph.is_covered[:] = False


@subroutine
def _add_circle(space: Space, company: Company, k: int, is_standing: BoolArray, ring: IntArray) -> None:
    """Add the circle of a conversation that is no initial formation, if k is its first member."""
    ring[0], size = k, 1
    for n in range(company.partner_count[k]):
        other = company.partners[k, n]
        if is_standing[other]:
            ring[size] = other
            size += 1
    x, y = 0.0, 0.0
    for n in range(size):
        if ring[n] < k or company.is_in_formation[ring[n]]:
            return
        x, y = x + company.standing_position[ring[n], 0] / size, y + company.standing_position[ring[n], 1] / size
    if size < 2:
        return
    angle = np.empty(size)
    for n in range(size):
        dx, dy = company.standing_position[ring[n], 0] - x, company.standing_position[ring[n], 1] - y
        if length(dx, dy) > _LARGEST_CIRCLE:
            return
        angle[n] = angle_of(dy, dx)
    for n in range(1, size):  # in their order round the centre
        m = n
        while m > 0 and angle[m - 1] > angle[m]:
            angle[m - 1], angle[m] = angle[m], angle[m - 1]
            ring[m - 1], ring[m] = ring[m], ring[m - 1]
            m -= 1
    _add_ring(space, company.standing_position, ring[:size])


@subroutine
def _add_ring(space: Space, place: Array, ring: IntArray) -> None:
    """Add the outline of the space between people; for two of them, the line between them."""
    added, size = space.added, len(ring)
    for n in range(size if size > 2 else size - 1):
        a, b = ring[n], ring[(n + 1) % size]
        if added.used[0] == len(added.table):
            return
        set_barrier(added.table, added.used[0], place[a, 0], place[a, 1], place[b, 0], place[b, 1], 0.0)
        added.used[0] += 1
        if size > 2 and space.hole_count[0] < len(space.holes):
            hole = space.holes[space.hole_count[0]]
            hole[0], hole[1], hole[2], hole[3] = place[a, 0], place[a, 1], place[b, 0], place[b, 1]
            space.hole_count[0] += 1


@subroutine
def path_length(path: Array, count: int) -> float:
    """Length of the first points of a path, m."""
    total = 0.0
    for n in range(1, count):
        total += length(path[n, 0] - path[n - 1, 0], path[n, 1] - path[n - 1, 1])
    return total


@subroutine
def set_path(routes: Routes, journeys: Journeys, k: int, path: Array, count: int, following: int) -> None:
    """Start on a path from its first point, the present position, or aim at another waypoint.

    Args:
        routes, journeys: updated.
        k: index of the pedestrian.
        path: (R, 2), m.
        count: of its points. What does not fit into `Routes.path` is found again on the way.
        following: index of the waypoint to aim at.
    """
    kept = min(count, routes.path.shape[1])
    for n in range(kept):
        routes.path[k, n, 0], routes.path[k, n, 1] = path[n, 0], path[n, 1]
    if count > 0:
        routes.destination[k, 0], routes.destination[k, 1] = path[count - 1, 0], path[count - 1, 1]
    journeys.paths[0] += 1
    routes.length[k], routes.is_partial[k], routes.version[k] = kept, count > kept, journeys.paths[0]
    routes.next[k] = min(following, kept - 1)


@subroutine
def set_stop(
    routes: Routes, journeys: Journeys, k: int, x: float, y: float, stop_x: float, stop_y: float, duration: float
) -> None:
    """Let pedestrian k, which is at (x, y), stand at another place, m, for a time, s, before it goes on."""
    interrupt(routes, journeys, k)
    set_straight_path(routes, journeys, k, x, y, stop_x, stop_y)
    plan_stay(routes, journeys, k, duration, stop_x, stop_y)


@subroutine
def interrupt(routes: Routes, journeys: Journeys, k: int) -> None:
    """Let pedestrian k go on to its present destination after what it does next."""
    if routes.length[k] > 0 and math.isnan(routes.onward[k, 0]):  # one that has just entered has no destination yet
        routes.onward[k, 0], routes.onward[k, 1] = routes.destination[k, 0], routes.destination[k, 1]
        journeys.onward_stay[k] = journeys.stay[k] if routes.is_stopping[k] else 0.0


@subroutine
def set_straight_path(
    routes: Routes, journeys: Journeys, k: int, x: float, y: float, end_x: float, end_y: float
) -> None:
    """Start from (x, y) on the straight way to another place, m."""
    ends = np.empty((2, 2))
    ends[0, 0], ends[0, 1], ends[1, 0], ends[1, 1] = x, y, end_x, end_y
    set_path(routes, journeys, k, ends, 2, 1)


@subroutine
def plan_stay(routes: Routes, journeys: Journeys, k: int, duration: float, x: float, y: float) -> None:
    """Let pedestrian k stand at its destination, m, for a time, s."""
    journeys.stay[k], routes.is_stopping[k] = duration, duration > 0.0
    journeys.spot[k, 0] = x if duration > 0.0 else math.nan
    journeys.spot[k, 1] = y if duration > 0.0 else math.nan


@subroutine
def stop(routes: Routes, journeys: Journeys, k: int) -> None:
    """Let pedestrian k stay where it is until `send_to` or `start_wandering`."""
    routes.is_assigned[k], routes.is_stopping[k] = True, False
    if routes.leader[k] >= 0:
        set_path(routes, journeys, k, routes.path[k], 0, 0)


@subroutine
def start_wandering(routes: Routes, journeys: Journeys, k: int, x: float, y: float) -> None:
    """Let pedestrian k, which is at (x, y), m, go on, or wander if it stood from the start."""
    routes.is_assigned[k] = routes.is_stopping[k] = False
    journeys.spot[k, 0] = journeys.spot[k, 1] = math.nan
    routes.checkpoint[k, 0] = routes.checkpoint[k, 1] = math.nan  # it makes progress from now on
    if routes.leader[k] < 0:
        routes.order[routes.walkers[0]] = k
        routes.walkers[0] += 1
        routes.leader[k] = k
    # A path that ends where the pedestrian is: it chooses a destination in the next tick.
    set_straight_path(routes, journeys, k, x, y, x, y)


@subroutine
def resting_place(space: Space, x: float, y: float, vx: float, vy: float) -> Point:
    """Where a pedestrian at (x, y), m, with a velocity, m/s, comes to rest if it brakes now; m."""
    to_x, to_y = x + vx * BRAKING_TIME, y + vy * BRAKING_TIME
    return (to_x, to_y) if is_free(space, to_x, to_y) else (x, y)


@subroutine
def follow_track(journeys: Journeys, routes: Routes, k: int, tick: int) -> None:
    """Let a recorded pedestrian aim at a point ahead on its track."""
    first, last = journeys.track_start[k], journeys.track_start[k + 1] - 1
    n = min(max(first + tick + journeys.look_ahead[0] - journeys.enters[k], first), last)
    routes.target[k, 0], routes.target[k, 1] = journeys.track[n, 0], journeys.track[n, 1]
