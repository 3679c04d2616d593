"""Positions given by a scenario: their random offsets and mirroring, and the pedestrians of the section `people`."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import combinations
from typing import Any, TypeVar

import numpy as np

from ..core.entities import DEFAULT_KIND, Furniture, Group, Human
from ..core.files.limits import MAX_TRACK_POINTS
from ..core.geometry import Barriers, Disc, Point, Pose, Stadium, canonical_angle, quantised, segments_cross
from ..core.navigation import FreeSpace
from ..core.outlines import outline_row, shape_gap
from ..core.portable_math import PI, angle_of
from ..core.relations import RELATION, TALKING, WALKING_TOGETHER
from ..core.rng import RandomStream
from ..core.scene import Scene
from ..errors import SceneError
from ..registry import person_kind
from .floor_plans import FloorPlan
from .human_sampling import body_of_kind, draw_kind
from .numbering import NumberedEntities, free_ids, interaction
from .pieces import faces_ahead
from .placement import Layout
from .robot_task import reserved_outlines
from .scenario.base import Jitter, Range, Settings
from .scenario.config import ScenarioConfig
from .scenario.people import PersonSpec, Track
from .scenario.sections import GoalConfig, InteriorDoorConfig, PersonConfig, RobotConfig

S = TypeVar("S", bound=Settings)
_SLOW = 0.1  # m/s, below which a velocity does not determine where a pedestrian faces
_TOLERANCE = 1e-6  # ticks, rounding error of a time divided by the tick
_SQUEEZE = 0.01  # m, that bodies need on both sides to pass a gap
_STARTING = Disc(0.3)  # m, of a person whose start is drawn
_MAX_OVERLAP, _POINT_RADIUS = 0.09, 1e-6  # m, overlap of given outlines at the start, which the physics resolves

# Random offsets and mirroring of given positions


def draw_starts(
    config: ScenarioConfig, plan: FloorPlan, furniture: tuple[Furniture, ...], rng: RandomStream
) -> ScenarioConfig:
    """Draw the starts of those of `people` that start somewhere in an area, and headings that nothing else gives.

    Nothing is drawn if there are no such people.

    Args:
        config: settings of the scenario.
        plan: the room.
        furniture: at fixed positions.
        rng: random stream of the scene.

    Raises:
        SceneError: an area has no free place.
    """
    if all(person.area is None for person in config.people):
        return config
    layout = Layout(plan, config, reserved_outlines(config), [(p.shape, p.pose) for p in furniture if p.on is None])
    layout.occupy([(_STARTING, Pose(*p.start)) for p in config.people if p.area is None and not p.enters])
    gap, people = max(config.person.wall_distance - _STARTING.radius, 0.0), []
    for person in config.people:
        if person.area is not None:
            for _ in range(config.max_attempts):
                place = Pose(*layout.sample_point(rng, person.area)).rounded()
                if layout.is_free(_STARTING, place, 0.0, gap):
                    break
            else:
                raise SceneError(
                    f"no free place for a person in the area {person.area!r} after {config.max_attempts} attempts; "
                    "enlarge the area, or ask for fewer people in it"
                )
            layout.occupy([(_STARTING, place)])
            start = {"x": place.x, "y": place.y, "area": None}
            if person.theta is None and person.velocity is None and not person.goals and person.group is None:
                start["theta"] = rng.uniform(-PI, PI)
            person = person.model_copy(update=start)
        people.append(person)
    return config.model_copy(update={"people": tuple(people)})


def apply_jitter(config: ScenarioConfig, rng: RandomStream) -> ScenarioConfig:
    """Add random offsets to the given start, goal and people; nothing is drawn where all jitters are 0."""
    tasks = [(config.robot, config.goal), *((other, other.goal) for other in config.robots)]
    of_robots = (each.jitter for task in tasks for each in task)
    if not any(map(any, (*(person.jitter for person in config.people), *of_robots))):
        return config
    people = tuple(_jitter_person(person, rng) for person in config.people)
    (robot, goal), *others = (_jitter_task(*task, rng) for task in tasks)
    robots = tuple(other.model_copy(update={"goal": its_goal}) for other, its_goal in others)
    return config.model_copy(update={"people": people, "robot": robot, "goal": goal, "robots": robots})


def _jitter_task(robot: RobotConfig, goal: GoalConfig, rng: RandomStream) -> tuple[RobotConfig, GoalConfig]:
    if robot.pose is not None and any(robot.jitter):
        robot = robot.model_copy(update={"pose": _shifted(robot.pose, _draw_offset(robot.jitter, rng))})
    if goal.position is not None and any(goal.jitter):
        goal = goal.model_copy(update={"position": _shifted(goal.position, _draw_offset((*goal.jitter, 0.0), rng))})
    return robot, goal


def _jitter_person(person: PersonSpec, rng: RandomStream) -> PersonSpec:
    if not any(person.jitter):
        return person
    offset = _draw_offset(person.jitter, rng)
    x, y = _shifted(person.start, offset)
    theta = None if person.theta is None else person.theta + offset[2]
    goals = tuple(_shifted(goal, offset) for goal in person.goals)
    return person.model_copy(update={"x": x, "y": y, "theta": theta, "goals": goals})


def _shifted(place: tuple[float, ...], offset: Jitter) -> tuple[float, ...]:
    """A position or pose with an offset."""
    return tuple(map(operator.add, place, offset))


def _draw_offset(jitter: Jitter, rng: RandomStream) -> Jitter:
    x, y, theta = (rng.uniform(-maximum, maximum) for maximum in jitter)
    return x, y, theta


def mirror_config(config: ScenarioConfig) -> ScenarioConfig:
    """Mirror all given positions: y changes sign."""
    # the front of furniture is its -y side, so that its mirror image is turned by pi - theta, not by -theta as a chair
    furniture = (
        p.model_copy(update={"y": -p.y, "theta": -p.theta if faces_ahead(config, p) else PI - p.theta})
        for p in config.furniture
    )
    sections = {key: _mirrored(getattr(config, key)) for key in ("robot", "goal", "groups")}
    keys = ("doors", "queues", "places", "areas", "people")
    lists = {key: tuple(map(_mirrored, getattr(config, key))) for key in keys}
    lists["interior_doors"] = tuple(map(_mirrored_door, config.interior_doors))
    robots = tuple(_mirrored(other).model_copy(update={"goal": _mirrored(other.goal)}) for other in config.robots)
    return config.model_copy(update={**sections, **lists, "furniture": tuple(furniture), "robots": robots})


def _mirror_point(point: Point) -> Point:
    return point[0], -point[1]


def _mirror_points(points: tuple[Point, ...]) -> tuple[Point, ...]:
    return tuple(map(_mirror_point, points))


# functions that mirror the value of a setting, by key of the sections that are mirrored
_MIRRORS: dict[str, Callable[[Any], Any]] = {
    "y": operator.neg,
    "theta": operator.neg,
    "one_way": operator.neg,
    "pose": lambda pose: (pose[0], -pose[1], -pose[2]),
    "position": _mirror_point,
    "then": _mirror_points,
    "velocity": _mirror_point,
    "goals": _mirror_points,
    "polygon": lambda corners: _mirror_points(corners[::-1]),
    "places": _mirror_points,
    "track": lambda track: tuple((t, x, -y) for t, x, y in track),
}


def _mirrored(section: S) -> S:
    values = {key: getattr(section, key) for key in _MIRRORS if key in type(section).model_fields}
    return section.model_copy(update={k: _MIRRORS[k](value) for k, value in values.items() if value is not None})


def _mirrored_door(door: InteriorDoorConfig) -> InteriorDoorConfig:
    """The mirror image of an interior door, which is open to the other side."""
    opening = -door.opening if door.kind == "hinged" else door.opening
    return _mirrored(door).model_copy(update={"opening": opening})


# Creation of pedestrians


def create_placed_entities(
    people: tuple[PersonSpec, ...], defaults: PersonConfig, dt: float, rng: RandomStream
) -> NumberedEntities:
    """Create the pedestrians of `people`; properties that are not given are drawn.

    Args:
        people: as the scenario lists them.
        defaults: distributions of the properties that are not given.
        dt: s, the tick.
        rng: random stream of the scene.

    Raises:
        SceneError: no tick lies within the time span of a track.
    """
    free = iter(free_ids({person.id for person in people}, len(people)))
    humans = [_create_human(person, person.id or next(free), defaults, dt, rng) for person in people]
    members: dict[int, list[int]] = {}
    for human in humans:
        if human.group is not None:
            members.setdefault(human.group, []).append(human.id)
    groups = {number: ids for number, ids in members.items() if len(ids) > 1}
    humans = [_adapt_to_group(human, person, humans) for human, person in zip(humans, people, strict=True)]
    talking = {human.group for human in humans if human.behaviour == "standing"}
    given = {person.group: person.relation for person in people if person.relation is not None}
    relation_of = {n: RELATION[given.get(n, TALKING if n in talking else WALKING_TOGETHER)] for n in groups}
    pairs = ((number, pair) for number, ids in groups.items() for pair in combinations(ids, 2))
    return NumberedEntities(
        tuple(human if human.group in groups else replace(human, group=None) for human in humans),
        tuple(_create_group(number, ids, number in talking) for number, ids in sorted(groups.items())),
        tuple(interaction(relation_of[n], a, b) for n, (a, b) in pairs),
    )


def _create_group(number: int, ids: list[int], is_talking: bool) -> Group:
    if not is_talking:
        return Group(number, "walking", tuple(ids))
    return Group(number, "talking", tuple(ids), "circle" if len(ids) > 2 else None)


def _adapt_to_group(human: Human, spec: PersonSpec, humans: list[Human]) -> Human:
    """Adapt properties that are not given: walking members get the lowest speed, talking members face the centre."""
    members = [other for other in humans if human.group is not None and other.group == human.group]
    if len(members) < 2:
        return human
    if human.behaviour != "standing":
        lowest = min(other.desired_speed for other in members)
        return human if spec.desired_speed else replace(human, desired_speed=lowest)
    if spec.theta is not None:
        return human
    x, y = (np.add.reduce(np.array([m.pose.position for m in members]), axis=0) / len(members)).tolist()
    theta = angle_of(y - human.pose.y, x - human.pose.x)
    return replace(human, pose=Pose(human.pose.x, human.pose.y, canonical_angle(theta)))


def _create_human(spec: PersonSpec, id: int, defaults: PersonConfig, dt: float, rng: RandomStream) -> Human:
    # drawn even where the property is given: the order of draws is part of what a seed means
    keys = ("desired_speed", "radius", "breadth", "headway", "politeness")
    drawn = {key: getattr(defaults, key).draw(rng) for key in keys}
    ignores = rng.uniform() < defaults.ignores_robot
    is_adult = spec.kind is None and spec.resolved_behaviour == "recorded"
    kind = person_kind(spec.kind or DEFAULT_KIND) if spec.kind or is_adult else draw_kind(defaults, rng)
    properties: Any = body_of_kind(kind, drawn, rng)
    for key in ("radius", "breadth", "desired_speed", "headway", "politeness"):
        value = getattr(spec, key)
        if value is not None:
            properties[key] = quantised(value.draw(rng) if isinstance(value, Range) else value)
    if kind.length is not None:  # the ends of its outline are half discs
        if None not in (spec.radius, spec.breadth) and properties["breadth"] != quantised(2 * properties["radius"]):
            raise SceneError(f"the breadth of a {kind.name} is twice its radius; give one of them for person {id}")
        if spec.radius is not None:
            properties["breadth"] = quantised(2 * properties["radius"])
        properties["radius"] = quantised(properties["breadth"] / 2)
        properties["length"] = max(properties["length"], properties["breadth"])
    reacts = spec.reacts_to_robot
    if reacts is None:
        # a recorded pedestrian follows its track whatever the robot does
        reacts_by_default = spec.resolved_behaviour != "recorded" and not ignores
        reacts = float(spec.reaction != "ignores" if spec.reaction else reacts_by_default)
    enters = int(spec.enters / dt + 1.0 - _TOLERANCE)  # first tick at or after the time
    human = Human(
        id=id,
        pose=Pose(*spec.start).rounded(),
        behaviour=spec.resolved_behaviour,
        model=defaults.model,
        reacts_to_robot=quantised(reacts),
        group=spec.group,
        goals=tuple((quantised(x), quantised(y)) for x, y in spec.goals),
        enters=enters,
        leaves=None if spec.leaves is None else max(int(spec.leaves / dt + 1.0 - _TOLERANCE), enters + 1),
        exits=spec.exits,
        attributes=spec.attributes,
        stays=tuple(quantised(spec.stay.draw(rng)) for _ in spec.goals[1:]) if spec.stay.max > 0.0 else (),
        **properties,
    )
    if spec.track is not None:
        human = _with_track(human, spec.track, dt)
    vx, vy = spec.velocity or human.velocity
    human = replace(human, velocity=(quantised(vx), quantised(vy)))
    theta = _default_heading(human) if spec.theta is None else spec.theta
    return replace(human, pose=Pose(human.pose.x, human.pose.y, canonical_angle(theta)))


def _default_heading(human: Human) -> float:
    """Return the direction of the velocity, else of the first goal, else 0; rad."""
    vx, vy = human.velocity
    if vx * vx + vy * vy > _SLOW * _SLOW:
        return angle_of(vy, vx)
    x, y = human.goals[0] if human.goals else human.pose.position
    return angle_of(y - human.pose.y, x - human.pose.x) if (x, y) != human.pose.position else 0.0


# Tracks


def _with_track(human: Human, track: Track, dt: float) -> Human:
    """Give a pedestrian its position at each tick, and the start, velocity and times that follow from the track.

    Raises:
        SceneError: no tick lies within the time span of the track.
    """
    span = f"{track[0][0]:g} to {track[-1][0]:g} s"
    if (track[-1][0] - track[0][0]) / dt > MAX_TRACK_POINTS:
        raise SceneError(
            f"the track of person {human.id}, {span}, is longer than {MAX_TRACK_POINTS} ticks; check its times"
        )
    first, positions = resample_track(track, dt)
    if not positions:
        raise SceneError(f"the track of person {human.id}, {span}, lies between two ticks; remove this person")
    (x, y), (u, v) = positions[0], positions[min(1, len(positions) - 1)]
    velocity = (u - x) / dt, (v - y) / dt
    leaves = first + len(positions)
    return replace(human, pose=Pose(x, y), velocity=velocity, enters=first, leaves=leaves, track=tuple(positions))


def resample_track(track: Track, dt: float) -> tuple[int, list[Point]]:
    """Interpolate a track at the ticks from its first to its last point.

    Args:
        track: two or more points, each t (s), x, y (m); t rises.
        dt: s, the tick.

    Returns:
        The first tick, and the position at each tick from there on, m, rounded to the precision of files; no position
        if no tick lies within the track's time span.

    Source: cubic Hermite interpolation with the slopes of Catmull & Rom (Computer Aided Geometric Design, Academic
    Press 1974, 317) for uneven steps: the path passes through every point, and its velocity is continuous.
    """
    first, last = int(track[0][0] / dt + 1.0 - _TOLERANCE), int(track[-1][0] / dt + _TOLERANCE)
    slopes = [_slope(track, k) for k in range(len(track))]
    positions, k = [], 0
    for tick in range(first, last + 1):
        t = min(max(tick * dt, track[0][0]), track[-1][0])
        while k < len(track) - 2 and track[k + 1][0] <= t:
            k += 1
        positions.append(_interpolate(track, slopes, k, t))
    return first, positions


def _slope(track: Track, k: int) -> Point:
    """Return the velocity at a track point, m/s.

    The slope of the parabola through the point and its two neighbours; at both ends, the slope of the straight line to
    the only neighbour.
    """
    if k == 0 or k == len(track) - 1:
        return _chord(track[max(k - 1, 0)], track[min(k + 1, len(track) - 1)])
    (vx, vy), (next_vx, next_vy) = _chord(track[k - 1], track[k]), _chord(track[k], track[k + 1])
    before, after = track[k][0] - track[k - 1][0], track[k + 1][0] - track[k][0]
    fraction = before / (before + after)
    return vx + (next_vx - vx) * fraction, vy + (next_vy - vy) * fraction


def _chord(start: tuple[float, float, float], end: tuple[float, float, float]) -> Point:
    """Return the velocity along the straight line between two track points, m/s."""
    step = end[0] - start[0]
    return (end[1] - start[1]) / step, (end[2] - start[2]) / step


def _interpolate(track: Track, slopes: list[Point], k: int, t: float) -> Point:
    """Return the position at time t, s, between the track points k and k + 1."""
    (t0, x0, y0), (t1, x1, y1) = track[k], track[k + 1]
    step = t1 - t0
    s = (t - t0) / step
    # cubic Hermite basis: a weighs the difference of the points, b and c the two slopes
    a, b = s * s * (3.0 - 2.0 * s), s * (1.0 - s) * (1.0 - s) * step
    c = s * s * (s - 1.0) * step
    (u0, v0), (u1, v1) = slopes[k], slopes[k + 1]
    return quantised(x0 + (x1 - x0) * a + u0 * b + u1 * c), quantised(y0 + (y1 - y0) * a + v0 * b + v1 * c)


# Placement


def check_placed_positions(placed: NumberedEntities, plan: FloorPlan, robots: Sequence[RobotConfig]) -> None:
    """Check that positions lie in the room, no wall is inside a standing group, and no robot starts on a pedestrian.

    Args:
        placed: the pedestrians.
        plan: the room.
        robots: all robots.

    Raises:
        SceneError: a start, track or goal is outside the room, or one of the other two is the case.
    """
    if not placed.humans:
        return
    points = [point for human in placed.humans for point in (human.pose.position, *human.track, *human.goals)]
    is_inside = iter(plan.is_on_floor(np.array(points, dtype=float).reshape(-1, 2)).tolist())
    for human in placed.humans:
        for name, places in (("start", [human.pose.position]), ("track", human.track), ("goal", human.goals)):
            for x, y in places:
                if not next(is_inside):
                    raise SceneError(
                        f"the {name} of person {human.id} is outside the room at ({x:g}, {y:g}); move it, or widen the "
                        "room"
                    )
        for robot in robots if human.enters == 0 else ():
            if robot.pose is None:
                continue
            pose, shape = Pose(*robot.pose), robot.outline
            core = human.shape if human.length else Disc(human.radius)  # shoulders turn away
            dx, dy, contact = pose.x - human.pose.x, pose.y - human.pose.y, shape.circumradius + core.circumradius
            is_near = dx * dx + dy * dy < contact * contact
            if is_near and shape_gap(shape, pose, core, human.pose) == 0.0:
                raise SceneError(f"the robot would start on person {human.id}; give it another pose")
    position = {human.id: human.pose.position for human in placed.humans if human.behaviour == "standing"}
    for link in placed.interactions:
        if link.src in position and link.dst in position:
            start, end = np.array([position[link.src]]), np.array([position[link.dst]])
            if segments_cross(start, end, plan.barriers).any():
                raise SceneError(
                    f"a wall is between person {link.src} and person {link.dst}, who stand in one group; move one of "
                    "them, or give one another `group`"
                )


def place_given(
    config: ScenarioConfig, placed: NumberedEntities, layout: Layout, furniture: tuple[Furniture, ...]
) -> None:
    """Occupy the space of the given pedestrians that are present at tick 0.

    Args:
        config: the pedestrians as the scenario lists them, and their clearances.
        placed: the pedestrians.
        layout: the room with the given furniture.
        furniture: the given furniture.

    Raises:
        SceneError: a pedestrian that is not recorded would overlap a wall, furniture or another pedestrian.
    """
    for person, human in zip(config.people, placed.humans, strict=True):
        if human.behaviour != "recorded" and not _fits(person, human, layout):
            x, y = human.pose.position
            piece = _piece_at((x, y), furniture)
            problem = f"person {human.id} does not fit at ({x:g}, {y:g})"
            if piece is not None:
                raise SceneError(f"{problem}, on {_described(piece)}; move it or the {piece.type}")
            raise SceneError(f"{problem}; move it, reduce its jitter, or widen the room")
        if human.enters == 0:
            layout.occupy([(Disc(human.shape.circumradius), human.pose)])


def _fits(person: PersonSpec, human: Human, layout: Layout) -> bool:
    """Return whether there is space at the start.

    A pedestrian with jitter needs all clearances: another offset is drawn where it has none. Without jitter, outlines
    may overlap, as in recorded crowds: only the centre must be outside all other outlines.
    """
    if any(person.jitter):
        gap = layout.config.clearance
        return layout.is_free(Disc(human.shape.circumradius), human.pose, gap, gap)
    radius, centre = human.radius - _MAX_OVERLAP, Disc(_POINT_RADIUS)
    body = Stadium(radius, human.shoulder) if human.length else Disc(radius)  # shoulders turn away
    is_in_room = layout.plan.has_space([outline_row(body, human.pose, _POINT_RADIUS)])
    # the robot's start and goal do not count here, and the walls have been tested
    return is_in_room and (
        human.enters > 0 or layout.is_free(centre, human.pose, _POINT_RADIUS, -math.inf, ignores_robot=True)
    )


def check_goals(scene: Scene, humans: tuple[Human, ...]) -> None:
    """Check that the given pedestrians can reach their goals.

    Paths of people who leave at their last goal are not checked: recorded people leave through doors that their scene
    lacks.

    Args:
        scene: its room and furniture.
        humans: the given pedestrians.

    Raises:
        SceneError: a goal lies in a wall or in a piece of furniture, or every way to it is too narrow.
    """
    walking = [human for human in humans if human.behaviour == "walking"]
    _check_furniture(walking, scene.furniture)
    staying = [human for human in walking if not human.exits]
    if not staying:
        return
    widest = FreeSpace(scene.outline, scene.barriers, max(human.radius for human in staying) + _SQUEEZE)
    for human in staying:
        gaps = scene.barriers.gaps(np.array(human.goals)).min(axis=0)
        narrow = FreeSpace(scene.outline, scene.barriers, human.radius + _SQUEEZE)
        for (x, y), (u, v), gap in zip([human.pose.position, *human.goals], human.goals, gaps.tolist(), strict=False):
            if gap < _POINT_RADIUS:
                raise SceneError(f"the goal ({u:g}, {v:g}) of person {human.id} is in a wall; move it")
            # one space for all is faster where the widest body passes
            if widest.path((x, y), (u, v)) is None and narrow.path((x, y), (u, v)) is None:
                raise SceneError(
                    f"person {human.id} cannot walk from ({x:g}, {y:g}) to its goal ({u:g}, {v:g}): no way is wide "
                    f"enough for its body, which is {2.0 * human.radius:.2g} m deep; widen a gap, or move the goal"
                )


def check_not_enclosed(scene: Scene) -> None:
    """Check that walking pedestrians do not start inside a closed loop of walls, through which no path leads.

    Raises:
        SceneError: one does.
    """
    if len(scene.walls) == len(scene.polygon):  # the outline alone
        return
    walking = [h for h in scene.humans if h.behaviour in ("walking", "wandering")]
    positions = np.array([human.pose.position for human in walking], dtype=float).reshape(-1, 2)
    walls = Barriers.of((wall.start, wall.end, 0.0) for wall in scene.straight_walls.values())
    is_free = FreeSpace(scene.outline, walls, _POINT_RADIUS).is_free(positions)
    for human, is_outside in zip(walking, is_free.tolist(), strict=True):
        if not is_outside:
            x, y = human.pose.position
            raise SceneError(
                f"person {human.id} at ({x:g}, {y:g}) is inside a closed loop of walls, which counts as a solid object "
                "without paths; leave a gap in the loop, give it as room.polygon, or move the person out of it"
            )


def _check_furniture(humans: list[Human], furniture: tuple[Furniture, ...]) -> None:
    for human in humans:
        for name, (x, y) in [("start", human.pose.position), *(("goal", goal) for goal in human.goals)]:
            piece = _piece_at((x, y), furniture)
            if piece is not None:
                raise SceneError(
                    f"the {name} ({x:g}, {y:g}) of person {human.id} is in {_described(piece)}; move one of them"
                )


def _described(piece: Furniture) -> str:
    return f"the {piece.type} at ({piece.pose.x:g}, {piece.pose.y:g})"


def _piece_at(point: Point, furniture: tuple[Furniture, ...]) -> Furniture | None:
    """Return the piece of furniture on the floor that covers a point, m."""
    for piece in furniture:
        if piece.on is None and shape_gap(piece.shape, piece.pose, Disc(_POINT_RADIUS), Pose(*point)) == 0.0:
            return piece
    return None
