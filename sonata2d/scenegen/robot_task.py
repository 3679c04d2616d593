"""Start and goal of each robot: given or drawn, at a distance from each other, and connected by a free path."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, replace

import numpy as np

from ..core.compiled.scalar import length
from ..core.entities import AT_PERSON, Furniture, Goal, Human, Limits, OtherRobot, Robot
from ..core.geometry import Barriers, Disc, Point, Pose, Shape, inside_polygon, inside_rings, quantised
from ..core.navigation import FreeSpace
from ..core.outlines import shape_gap
from ..core.portable_math import PI, unit_vector
from ..core.rng import RandomStream
from ..errors import SceneError
from ..registry import did_you_mean
from .placement import Layout, PlacedShape
from .scenario.config import ScenarioConfig
from .scenario.people import path_segments

_APART = 1e-3  # m, a gap between outlines that neither touch nor overlap
_PATH_MARGIN = 0.05  # m, minimum gap between the robot and obstacles along a path
_GAP_TO_PATHS = 0.4  # m, of a robot from the paths of people who all ignore it


def reserved_outlines(config: ScenarioConfig) -> list[PlacedShape]:
    """Return the outlines that given starts and goals occupy."""
    outlines: list[PlacedShape] = []
    for robot, goal in ((config.robot, config.goal), *((robot, goal) for robot, goal, _ in config.other_tasks)):
        disc = Disc(robot.outline.inradius + _PATH_MARGIN)
        start = disc if robot.body is None else robot.outline
        places = ((start, robot.pose), (disc, goal.position))
        outlines += [(shape, Pose(*place).rounded()) for shape, place in places if place is not None]
    return outlines


def draw_other_robots(
    config: ScenarioConfig, layout: Layout, barriers: Barriers, first: tuple[Robot, Goal], rng: RandomStream
) -> tuple[OtherRobot, ...]:
    """Create the robots besides the first one; all start apart from each other, and have goals where all can stand.

    Args:
        config: with their settings.
        layout: the room with all other entities; starts and goals are added.
        barriers: outlines of everything that robots must avoid: walls, furniture and standing pedestrians.
        first: the first robot and its goal.
        rng: random stream of the robots.

    Returns:
        The robots; `generate` sets their ids.

    Raises:
        SceneError: as `draw_robot_task`; or given starts overlap.
    """
    drawn, others = [first], list[OtherRobot]()
    tasks = [(config.with_task(robot, goal), controller) for robot, goal, controller in config.other_tasks]
    for k, (each, _) in enumerate(tasks):  # a given start may be the goal of another robot
        _check_given(each, layout, _free_space(each, layout, barriers), f"robot {k + 2}")
    _occupy(layout, *first)
    for each, controller in tasks:
        task = _drawn_task(each, layout, _free_space(each, layout, barriers), rng, f"robot {len(drawn) + 1}")
        pose, outline = task[0].pose, task[0].outline
        for k, (other, _) in enumerate(drawn):
            if shape_gap(outline, pose, other.outline, other.pose) < _APART:
                x, y = pose.position
                raise SceneError(f"robot {len(drawn) + 1} would start at ({x:g}, {y:g}) on robot {k + 1}; move it")
        drawn.append(task)
        _occupy(layout, *task)
        others.append(OtherRobot(0, *task, controller))
    return tuple(others)


def _occupy(layout: Layout, robot: Robot, goal: Goal) -> None:
    """Keep other robots off the start and the goal of a robot."""
    layout.occupy([(robot.outline, robot.pose), (Disc(robot.outline.circumradius), Pose(*goal.position))])


def draw_robot_task(
    config: ScenarioConfig, layout: Layout, barriers: Barriers, rng: RandomStream, furniture: Sequence[Furniture]
) -> tuple[Robot, Goal]:
    """Create the robot at its start, and its goal; start and goal are drawn unless given.

    Args:
        config: sections `robot`, `goal` and `people`.
        layout: the room with all other entities.
        barriers: outlines of everything that the robot must avoid: walls, furniture and standing pedestrians.
        rng: random stream of the scene.
        furniture: of the scene, with poses.

    Raises:
        SceneError: a given start or goal is not free; no path connects a given start and goal; there is no piece of
            furniture of `goal.object`; or `max_attempts` pairs of start and goal failed.
    """
    space = _free_space(config, layout, barriers)
    _check_given(config, layout, space, "the robot")
    pieces = [piece for piece in furniture if piece.type == config.goal.object]
    if config.goal.object is not None and not pieces:
        types = sorted({piece.type for piece in furniture})
        hint = did_you_mean(config.goal.object, types) or f"; it has {', '.join(types) or 'no furniture'}"
        raise SceneError(f"goal.object is {config.goal.object!r}, which is not in the scene{hint}")
    robot, goal = _drawn_task(config, layout, space, rng, "the robot", pieces)
    for x, y in config.goal.then:
        if not space.is_free_at((x, y)) or space.path(goal.position, (x, y)) is None:
            raise SceneError(f"the robot cannot be at the further place ({x:g}, {y:g}) of its goal; move it")
    return robot, replace(goal, then=tuple((quantised(x), quantised(y)) for x, y in config.goal.then))


def _beside(piece: Furniture, config: ScenarioConfig, rng: RandomStream) -> Point:
    """A place for the robot beside a piece of furniture; of what stands on another piece, beside that one."""
    length, width = piece.shape.sides
    reach = 0.6 if piece.on is None else 1.5
    distance = math.sqrt(length * length + width * width) / 2.0 + config.robot.outline.inradius + _PATH_MARGIN
    distance += rng.uniform(0.0, reach)
    c, s = unit_vector(rng.uniform(-PI, PI))
    return piece.pose.x + distance * c, piece.pose.y + distance * s


def with_target(
    config: ScenarioConfig, goal: Goal, humans: Sequence[Human], furniture: Sequence[Furniture], robot: Robot
) -> Goal:
    """The goal with its person or object.

    Args:
        config: section `goal`.
        goal: as drawn; its place is of the tasks `go`, `lead` and `wait`.
        humans: of `people`, in order.
        furniture: of the scene.
        robot: at its start.

    Raises:
        SceneError: the robot starts near a person that it has to meet.
    """
    settings = config.goal
    if settings.object is not None:
        pieces = (piece for piece in furniture if piece.type == settings.object)
        nearest = min(pieces, key=lambda piece: length(piece.pose.x - goal.x, piece.pose.y - goal.y))
        goal = replace(goal, object=nearest.id)
    if settings.person is None:
        return goal
    human = humans[settings.person - 1]
    x, y = human.pose.position if settings.task in AT_PERSON else goal.position
    if settings.task == "meet" and length(human.pose.x - robot.pose.x, human.pose.y - robot.pose.y) <= settings.near:
        raise SceneError(f"the robot starts within {settings.near:g} m of person {settings.person}, whom it is to meet")
    return replace(goal, x=x, y=y, task=settings.task, person=human.id, near=quantised(settings.near))


def _free_space(config: ScenarioConfig, layout: Layout, barriers: Barriers) -> FreeSpace:
    """The places where the robot can be on its path, whose heading the path does not know.

    The robot passes where the largest circle within its outline does, since it can turn along its path. If it cannot
    move sideways, its width must pass too.
    """
    outline, radius = config.robot.outline, config.robot.outline.inradius
    if not config.robot.moves_sideways:
        sides = np.array(outline.core, dtype=float).reshape(-1, 2)[:, 1]
        radius = max(radius, float(sides.max() - sides.min()) / 2.0 + outline.rounding)
    return FreeSpace(layout.plan.outline, barriers, radius + _PATH_MARGIN)


def _drawn_task(
    config: ScenarioConfig,
    layout: Layout,
    space: FreeSpace,
    rng: RandomStream,
    name: str,
    pieces: Sequence[Furniture] = (),
) -> tuple[Robot, Goal]:
    """Draw what is not given of a start and a goal.

    Args:
        config, layout, rng: as of `draw_robot_task`.
        space: see `_free_space`.
        name: of the robot in messages.
        pieces: of furniture, beside one of which a drawn goal is; none: anywhere.
    """
    paths, sample_point = path_segments(config.people), layout.sample_point
    pose, position = config.robot.pose, config.goal.position
    chosen = None
    for attempt in range(config.max_attempts):
        start = Pose(*(pose or (*sample_point(rng, config.robot.area), rng.uniform(-PI, PI)))).rounded()
        drawn = _beside(rng.choice(list(pieces)), config, rng) if pieces else None
        goal = Pose(*(position or drawn or sample_point(rng, config.goal.area))).rounded()
        if _is_feasible(config, layout, space, paths, start, goal):
            is_clear = not _is_in_the_way(config, paths, start)
            if is_clear or chosen is None:
                chosen = start, goal
            if is_clear:
                break
        if chosen is not None and attempt >= config.max_attempts // 2:
            break
    if chosen is not None:
        return _create_robot(config, chosen[0]), _create_goal(config, chosen[1], rng)
    if areas := [area for area in (config.robot.area, config.goal.area) if area is not None]:
        places = " and ".join(map(repr, areas))
        raise SceneError(
            f"no free start and goal for {name} in {places} after {config.max_attempts} attempts; move or enlarge "
            "these areas, or lower goal.min_distance"
        )
    fewer = "fewer humans and robots" if config.robots else "fewer humans"
    last = "set robot.on_ways to null" if config.robot.on_ways is not None else "make the robot smaller"
    remedies = "make the no-go areas smaller, " if any(area.no_go for area in config.areas) else ""
    if any(d.opened_by == "people" or (d.opened_by == "nobody" and d.opening == 0.0) for d in config.interior_doors):
        remedies += "let robots open more doors, "
    raise SceneError(
        f"no free start and goal for {name} in a {layout.plan.size_text} room after {config.max_attempts} attempts; "
        f"{remedies}widen the room, ask for {fewer} and less furniture, or {last}"
    )


def _check_given(config: ScenarioConfig, layout: Layout, space: FreeSpace, robot: str) -> None:
    """Check that a given start and a given goal are free, and connected by a path."""
    places = (("start", config.robot.pose), ("goal", config.goal.position))
    positions = {name: Pose(*place).rounded().position for name, place in places if place is not None}
    for name, (x, y) in positions.items():
        point = np.array([(x, y)], dtype=float)
        if (area := _closed_area(config, (x, y))) is not None:
            raise SceneError(f"{robot}'s {name} ({x:g}, {y:g}) is in the no-go area {area!r}; move it")
        if not space.is_free(point)[0]:
            inside = inside_polygon(point, space.outline)[0]
            reason = "inside or too close to a wall, furniture or a standing person" if inside else "outside the room"
            raise SceneError(f"{robot}'s {name} ({x:g}, {y:g}) is {reason}; move it")
    shape, pose = config.robot.outline, Pose(*config.robot.pose).rounded() if config.robot.pose else None
    if pose and config.robot.body and not layout.is_free(shape, pose, _APART, _APART, ignores_robot=True):
        place = f"({pose.x:g}, {pose.y:g}, {pose.theta:g})"
        raise SceneError(f"{robot}'s body overlaps something at its start {place}; move it, or turn it")
    if len(positions) == 2 and space.path(positions["start"], positions["goal"]) is None:
        (x, y), (u, v) = positions["start"], positions["goal"]
        raise SceneError(
            f"there is no path for {robot} from its start ({x:g}, {y:g}) to its goal ({u:g}, {v:g}); move one of "
            f"them, {'make the no-go areas smaller, ' if any(a.no_go for a in config.areas) else ''}or give the robot "
            "a smaller body"
        )


def _is_feasible(
    config: ScenarioConfig, layout: Layout, space: FreeSpace, paths: Barriers, start: Pose, goal: Pose
) -> bool:
    """Return whether start and goal are far enough from each other, suitable, and connected by a path.

    A goal at a person is not drawn: only the start counts.
    """
    if config.goal.task in AT_PERSON:
        return (
            _closed_area(config, start.position) is None
            and space.is_free_at(start.position)
            and (config.robot.pose is not None or _is_suitable(config, layout, paths, config.robot.outline, start))
        )
    dx, dy = goal.x - start.x, goal.y - start.y
    # `min_distance` is a rule for drawn positions: two given ones must only not coincide
    both_given = config.robot.pose is not None and config.goal.position is not None
    min_distance = config.goal.distance if both_given else max(config.goal.min_distance, config.goal.distance)
    if dx * dx + dy * dy <= min_distance * min_distance:  # the cheapest test comes first
        return False
    if config.robot.pose is None and not _is_suitable(config, layout, paths, config.robot.outline, start):
        return False
    if config.goal.position is None and not _is_suitable(
        config, layout, paths, Disc(config.robot.outline.inradius), goal, 0.0
    ):
        return False
    if any(_closed_area(config, place.position) is not None for place in (start, goal)):
        return False
    is_free = space.is_free_at(start.position) and space.is_free_at(goal.position)
    return is_free and space.path(start.position, goal.position) is not None


def _closed_area(config: ScenarioConfig, point: Point) -> str | None:
    """Name of the no-go area that a point is in; its edges are barriers, but may coincide with those of the room."""
    closed = (area for area in config.areas if area.no_go)
    return next((area.name for area in closed if inside_rings(np.array([point]), area.corners, ())[0]), None)


def _is_in_the_way(config: ScenarioConfig, paths: Barriers, start: Pose) -> bool:
    """Return whether the robot is on the path of one of `people`, who all ignore it and would walk into it."""
    if config.robot.on_ways is None or config.person.ignores_robot < 1.0 or config.robot.pose is not None:
        return False
    gap = config.robot.outline.circumradius + _GAP_TO_PATHS
    return bool((paths.gaps(np.array([start.position])) < gap).any())


def _is_suitable(
    config: ScenarioConfig, layout: Layout, paths: Barriers, shape: Shape, pose: Pose, clearance: float | None = None
) -> bool:
    """Return whether an outline at a drawn pose keeps a clearance, and is near a pedestrian's path, `robot.on_ways`."""
    gap = max(config.robot.clearance if clearance is None else clearance, _PATH_MARGIN)
    max_distance = config.robot.on_ways
    if not layout.is_free(shape, pose, gap, gap):
        return False
    return max_distance is None or bool((paths.gaps(np.array([pose.position])) <= max_distance).any())


def _create_robot(config: ScenarioConfig, start: Pose) -> Robot:
    limits = Limits(**{name: quantised(value) for name, value in asdict(config.robot.limits).items()})
    settings = config.robot
    shape = settings.outline if settings.body else None
    return Robot(start, quantised(settings.radius), settings.kinematics, limits, shape, settings.drive)


def _create_goal(config: ScenarioConfig, position: Pose, rng: RandomStream) -> Goal:
    theta = rng.uniform(-PI, PI) if config.goal.theta is None else config.goal.theta
    pose = Pose(position.x, position.y, theta).rounded()
    return Goal(pose.x, pose.y, pose.theta, quantised(config.goal.distance), quantised(config.goal.angle))
