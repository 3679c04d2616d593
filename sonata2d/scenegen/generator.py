"""Generation of a `Scene` from scenario settings and a seed: the same seed gives the same scene on every machine."""

from __future__ import annotations

import re
import sys
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import orjson

from ..core.arguments import whole_number
from ..core.doors import InteriorDoor
from ..core.entities import Furniture, Human
from ..core.geometry import Barriers, Point, Pose, inside_rings
from ..core.rng import RandomStream
from ..core.scene import Scene, standing_throughout
from ..errors import SceneError
from .floor_plans import FloorPlan, draw_floor_plan
from .human_sampling import ReactionSampler
from .interior_doors import check_starts, place_interior_doors, zones_of
from .journeys import Journeys, plan_journeys, with_visitors
from .numbering import number_entities, ordered_entities
from .pieces import fixed_furniture
from .placed import (
    apply_jitter,
    check_goals,
    check_not_enclosed,
    check_placed_positions,
    create_placed_entities,
    draw_starts,
    mirror_config,
    place_given,
)
from .placement import Layout, cluster_radius
from .robot_task import draw_other_robots, draw_robot_task, reserved_outlines, with_target
from .sampling import EntityCluster, TypeStreams, sample_entities, shape_of
from .scenario.attributes import AttributesConfig
from .scenario.config import ScenarioConfig
from .scenario.load import scenario_of


def generate(config: str | Path | ScenarioConfig, seed: int = 0, episode: int = 0) -> Scene:
    """Generate a scene.

    The room, the entities, their relations and the distances within relations are drawn once. Only poses are drawn
    again where something does not fit, so that small rooms are not biased towards few entities and short distances.

    Args:
        config: settings of the scenario, the name of a preset (`sonata2d.scenegen.scenario_names()` lists them), or the
            path of a scenario file.
        seed: of the data set, 0 or more.
        episode: number of the episode in the data set.

    Returns:
        The scene, with its settings, seed and episode number; all numbers are rounded to the precision of files.

    Raises:
        SceneError: no layout of `config.max_layouts` has space for everything, or a given position is not possible.
        ConfigError: there is no such preset or file, or the file is invalid.
        TypeError: the scenario is something else, or a seed or episode is no whole number.
        ValueError: a seed or episode is negative.

    >>> generate(ScenarioConfig(), seed=7) == generate(ScenarioConfig(), seed=7)
    True
    """
    sys.audit("sonata2d.generate")  # which the benchmark refuses in the process of a controller
    config = scenario_of(config)
    seed, episode = whole_number("seed", seed), whole_number("episode", episode)
    rng = RandomStream(seed, episode, "scene")
    plan, scenario = draw_floor_plan(config.room, rng), config
    if config.flip and rng.uniform() < config.flip:
        plan, scenario = plan.mirrored(), mirror_config(config)
    fixed = fixed_furniture(scenario)
    _check_furniture(fixed, plan)
    _check_areas(scenario, plan)
    furniture = [(piece.shape, piece.pose) for piece in fixed if piece.on is None]
    journey_rng = RandomStream(seed, episode, "journeys")  # so that scenes without journeys stay the same
    inner = place_interior_doors(scenario, plan, fixed, RandomStream(seed, episode, "scene", "interior doors"))
    occupied = reserved_outlines(scenario) + furniture + zones_of(inner)
    journeys = plan_journeys(scenario, plan, occupied, journey_rng)
    # each type of furniture has a stream, so that a further type changes nothing else in a scene
    stream_of = cache(partial(RandomStream, seed, episode, "scene"))
    clusters = sample_entities(scenario, rng, stream_of)
    reactions = ReactionSampler(config.person, seed, episode)
    failures: list[SceneError] = []
    while True:
        try:
            scene = _try_layout(scenario, plan, fixed, clusters, journeys, inner, reactions, rng, stream_of)
            break
        except SceneError as error:
            failures.append(error)
            if len(failures) == config.max_layouts:
                raise _most_frequent(failures) from None
    scene = with_visitors(scene, scenario, journeys, reactions, journey_rng)
    if scene.robots:
        last = max([0, *(human.id for human in scene.humans), *(piece.id for piece in scene.furniture)])
        scene = replace(scene, robots=tuple(replace(robot, id=last + k) for k, robot in enumerate(scene.robots, 1)))
    if config.attributes.specs:
        scene = _with_attributes(scene, config.attributes, partial(RandomStream, seed, episode, "attributes"))
    return scene.drawn_as(seed, episode, _settings_of(config))


_last: tuple[ScenarioConfig, bytes] | None = None  # and its settings as JSON


def _settings_of(config: ScenarioConfig) -> dict[str, Any]:
    """`ScenarioConfig.settings`, which the scenes of a data set share; each has a copy."""
    global _last
    last = _last
    if last is None or last[0] is not config:
        last = _last = config, orjson.dumps(config.settings())
    settings: dict[str, Any] = orjson.loads(last[1])
    return settings


def _with_attributes(scene: Scene, config: AttributesConfig, stream: Callable[..., RandomStream]) -> Scene:
    """Draw the attributes that are not given. Each holder has a random stream, so that they change nothing else."""
    episode = config.draw("episode", None, stream()) or {}
    return replace(
        scene,
        humans=tuple(replace(h, attributes=config.draw("people", h.attributes, stream(h.id))) for h in scene.humans),
        furniture=tuple(
            replace(f, attributes=config.draw("objects", f.attributes, stream(f.id))) for f in scene.furniture
        ),
        areas=tuple(replace(a, attributes=config.draw("areas", a.attributes, stream(a.name))) for a in scene.areas),
        attributes=tuple(
            replace(spec, value=episode.get(spec.name) if spec.of == "episode" else None) for spec in config.specs
        ),
    )


def _most_frequent(failures: list[SceneError]) -> SceneError:
    """The last failure of the kind that prevented most layouts; messages of one kind differ in numbers."""
    kinds = [re.sub(r"[\d-]", "", str(failure)) for failure in failures]
    kind = Counter(kinds).most_common(1)[0][0]
    return failures[len(kinds) - 1 - kinds[::-1].index(kind)]


def _check_areas(config: ScenarioConfig, plan: FloorPlan) -> None:
    """Require that each area has some of the floor, as far as points in a grid of 24 by 24 and corners show."""
    for area in config.areas:
        if not _has_floor(area.polygon, plan, 3) and not _has_floor(area.polygon, plan, 24):  # few points mostly do
            x, y = area.polygon[0]
            raise SceneError(f"the area {area.name!r}, from ({x:g}, {y:g}), lies outside the room; move it")


def _has_floor(polygon: tuple[Point, ...], plan: FloorPlan, count: int) -> bool:
    """Whether a corner of a polygon, or one of `count` by `count` points in it, is on the floor; or it is around it."""
    ring = np.array(polygon)
    axes = [
        np.linspace(low, high, count + 2)[1:-1] for low, high in zip(ring.min(axis=0), ring.max(axis=0), strict=True)
    ]
    grid = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)
    points = np.concatenate((grid[inside_rings(grid, polygon, ())], ring))
    is_found = inside_rings(points, plan.polygon, plan.holes).any()
    return bool(is_found or inside_rings(np.array(plan.polygon), polygon, ()).any())


def _check_furniture(fixed: tuple[Furniture, ...], plan: FloorPlan) -> None:
    for piece in fixed:
        if not plan.contains(piece.shape, piece.pose):
            x, y = piece.pose.position
            raise SceneError(f"the {piece.type} at ({x:g}, {y:g}) does not fit between the walls; move it")


def _try_layout(
    config: ScenarioConfig,
    plan: FloorPlan,
    fixed: tuple[Furniture, ...],
    clusters: list[EntityCluster],
    journeys: Journeys,
    inner: tuple[InteriorDoor, ...],
    reactions: ReactionSampler,
    rng: RandomStream,
    stream_of: TypeStreams,
) -> Scene:
    """Draw poses once for everything: given pedestrians, then clusters, then the robot and its goal.

    Clusters at fixed furniture come first, then the others by size, since large ones are the hardest to place.

    Raises:
        SceneError: something has no space.
    """
    config = apply_jitter(draw_starts(config, plan, fixed, rng), rng)
    people = create_placed_entities(config.people, config.person, config.rules.dt, rng)
    check_placed_positions(people, plan, (config.robot, *config.robots))
    furniture_outlines = [(piece.shape, piece.pose) for piece in fixed if piece.on is None]
    layout = Layout(plan, config, reserved_outlines(config), furniture_outlines)
    place_given(config, people, layout, fixed)
    layout.occupy([*journeys.zones, *zones_of(inner)])
    placed: dict[int, list[Pose]] = {}
    for k in sorted(range(len(clusters)), key=lambda k: (clusters[k].fixed is None, -cluster_radius(clusters[k]))):
        # furniture that nobody attends to has the stream of its type
        is_furniture = isinstance(clusters[k].members[0], Furniture)
        poses = layout.place(clusters[k], fixed, stream_of(clusters[k].name) if is_furniture else rng)
        if poses is not None:
            placed[k] = poses
        elif not config.drop:
            raise SceneError(_no_space_message(clusters, k, plan, config.max_attempts))
    drawn = [(clusters[k], placed[k]) for k in sorted(placed)]
    humans, furniture = ordered_entities(drawn, fixed)
    obstacles = _obstacles(plan, humans.values(), furniture.values()).joined(standing_throughout(people.humans))
    obstacles = obstacles.joined(Barriers.of([door.leaf(door.opening) for door in inner if not door.moves]))
    closed = [edge for area in config.areas if area.no_go for edge in area.area().edges()]
    obstacles = obstacles.joined(Barriers.of(closed))  # of robots
    robot, goal = draw_robot_task(config, layout, obstacles, rng, tuple(furniture.values()))
    # the other robots have a stream, so that they change nothing else in a scene
    others = (
        draw_other_robots(config, layout, obstacles, (robot, goal), stream_of("other robots")) if config.robots else ()
    )
    entities = number_entities([cluster for cluster, _ in drawn], humans, furniture, people, reactions)
    persons = zip(people.humans, config.people, strict=True)
    listed = [reactions.assign(human, person) for human, person in persons]
    scene = Scene(
        name=config.name,
        family=f"{config.name}/{plan.kind}",
        polygon=plan.polygon,
        walls=plan.walls,
        holes=plan.holes,
        areas=tuple(area.area() for area in config.areas),
        furniture=entities.furniture,
        humans=(*listed, *entities.humans),
        robot=robot,
        goal=with_target(config, goal, listed, entities.furniture, robot),
        robots=others,
        groups=(*people.groups, *entities.groups),
        interactions=(*people.interactions, *entities.interactions),
        rules=config.rules,
        social=config.social,
        dropped=tuple(_label(clusters, k) for k in range(len(clusters)) if k not in placed),
        doors=journeys.doors,
        interior_doors=inner,
        queues=journeys.queues,
        places=journeys.places,
    )
    check_starts(scene)
    check_not_enclosed(scene)
    check_goals(scene, people.humans)
    return scene


def _obstacles(plan: FloorPlan, humans: Iterable[Human], furniture: Iterable[Furniture]) -> Barriers:
    """Return walls, furniture on the floor and standing pedestrians: what the robot must avoid."""
    edges = [edge for piece in furniture if piece.on is None for edge in piece.shape.edges(piece.pose)]
    edges += [edge for human in humans if human.behaviour == "standing" for edge in shape_of(human).edges(human.pose)]
    return plan.barriers.joined(Barriers.of(edges))


def _label(clusters: list[EntityCluster], k: int) -> str:
    """Return the name and number of a cluster, such as `human 5 of 6`, for messages and `Scene.dropped`."""
    similar = [i for i, cluster in enumerate(clusters) if cluster.name == clusters[k].name]
    if clusters[k].name == "human":  # the members of pairs and groups count as humans too
        similar = [i for i, cluster in enumerate(clusters) for member in cluster.members if isinstance(member, Human)]
    return f"{clusters[k].name} {similar.index(k) + 1} of {len(similar)}"


def _no_space_message(clusters: list[EntityCluster], k: int, plan: FloorPlan, attempts: int) -> str:
    fewer = "fewer humans" if isinstance(clusters[k].members[0], Human) else "less furniture"
    problem = f"no free spot for {_label(clusters, k)} in a {plan.size_text} room after {attempts} attempts"
    if clusters[k].fixed is not None:
        return f"{problem}; turn the furniture (theta) so that its access side (-y) is free, or set attracts: false"
    place = clusters[k].position
    if place is not None:
        x, y = place
        if not plan.is_on_floor(np.array([[x, y]])).all():
            return f"the place ({x:g}, {y:g}) of {_label(clusters, k)} is outside the room; change groups.places"
        return (
            f"{_label(clusters, k)} does not fit at its place ({x:g}, {y:g}) after {attempts} attempts; move it "
            "(groups.places) away from walls and others, or ask for fewer members"
        )
    return f"{problem}; widen the room, ask for {fewer}, or set drop: true"
