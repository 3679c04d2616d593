"""From settings and a seed to a Scene: a value, the same for ever."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

from ..core.entities import Furniture, Human
from ..core.geometry import Barriers, Pose
from ..core.rng import RandomStream
from ..core.scene import Rules, Scene, standing_throughout
from ..errors import SceneError
from .floor_plans import FloorPlan, draw_plan
from .placed import flipped, given_people, joined, put, refuse_outside, settled
from .placement import Layout, extent
from .robot_task import draw_journey, reserved
from .sampling import Cluster, Entity, NumberedEntities, draw_cast, fixed_furniture, numbered, shape_of
from .scenario.config import ScenarioConfig
from .scenario.social import with_manners


def generate(config: ScenarioConfig, seed: int, episode: int = 0) -> Scene:
    """Lay out a scene.

    Room, people, things, relations and their distances are drawn once. Only places are drawn again where they do not
    fit, so that a small room does not favour small numbers and short distances.

    Args:
        config: what the scene may look like.
        seed: of the data set, 0 or more.
        episode: number of the episode within the data set.

    Raises:
        SceneError: something found no place in any of `config.max_layouts` layouts.

    >>> generate(ScenarioConfig(), seed=7) == generate(ScenarioConfig(), seed=7)
    True
    """
    rng = RandomStream(seed, episode, "scene")
    plan, given = draw_plan(config.room, rng), config
    if config.flip and rng.uniform() < config.flip:
        plan, given = plan.flipped(), flipped(config)
    fixed = _checked(fixed_furniture(given), plan)
    cast = draw_cast(given, rng)
    for _ in range(config.max_layouts - 1):
        with suppress(SceneError):
            return _completed(_lay_out(given, plan, fixed, cast, rng), config, seed, episode)
    return _completed(_lay_out(given, plan, fixed, cast, rng), config, seed, episode)


def _completed(scene: Scene, config: ScenarioConfig, seed: int, episode: int) -> Scene:
    """The scene with what it was drawn from, and people's manners towards the robot."""
    chosen = [person.reaction for person in config.people]  # who is given comes first
    humans = with_manners(scene.humans, chosen, config.person.reactions, config.person.robot_clearance, seed, episode)
    return replace(scene, humans=humans, seed=seed, episode=episode, settings=config.settings())


def _checked(fixed: tuple[Furniture, ...], plan: FloorPlan) -> tuple[Furniture, ...]:
    for piece in fixed:
        if not plan.contains(piece.shape, piece.pose):
            raise SceneError(f"the {piece.type} at ({piece.pose.x:g}, {piece.pose.y:g}) does not fit between the walls")
    return fixed


def _lay_out(
    config: ScenarioConfig,
    plan: FloorPlan,
    fixed: tuple[Furniture, ...],
    cast: list[Cluster],
    rng: RandomStream,
) -> Scene:
    """One try to find a place for all: people who are given one, clusters, the most demanding first, robot and goal."""
    config = settled(config, rng)
    given = given_people(config.people, config.person, config.rules.dt, rng)
    refuse_outside(given, plan.outline, config.robot.pose and Pose(*config.robot.pose), config.robot.radius)
    layout = Layout(plan, config, reserved(config) + [(piece.shape, piece.pose) for piece in fixed if piece.on is None])
    put(config, given, layout)
    found: dict[int, tuple[Entity, ...]] = {}
    for k in sorted(range(len(cast)), key=lambda k: (cast[k].fixed is None, -extent(cast[k]))):
        members = layout.place(cast[k], fixed, rng)
        if members is not None:
            found[k] = members
        elif not config.drop:
            raise SceneError(_no_spot(cast, k, plan, config.max_attempts))
    numbered_entities = numbered([(cast[k], found[k]) for k in sorted(found)], fixed)
    robot, goal = draw_journey(
        config, layout, _obstacles(plan, numbered_entities).joined(standing_throughout(given.humans)), rng
    )
    scene = Scene(
        name=config.name,
        family=f"{config.name}/{plan.kind}",
        polygon=plan.polygon,
        walls=plan.walls,
        furniture=numbered_entities.furniture,
        humans=numbered_entities.humans,
        robot=robot,
        goal=goal,
        groups=numbered_entities.groups,
        interactions=numbered_entities.interactions,
        rules=Rules(**config.rules.model_dump()),
        social=config.social.social(),
        dropped=tuple(_label(cast, k) for k in range(len(cast)) if k not in found),
    )
    return joined(scene, given)


def _obstacles(plan: FloorPlan, numbered_entities: NumberedEntities) -> Barriers:
    """Walls, furniture and people who stand: what the robot must go round."""
    solid: list[Entity] = [piece for piece in numbered_entities.furniture if piece.on is None]
    solid += [human for human in numbered_entities.humans if human.behaviour == "standing"]
    edges = (edge for entity in solid for edge in shape_of(entity).edges(entity.pose))
    return plan.barriers.joined(Barriers.of(edges))


def _label(cast: list[Cluster], k: int) -> str:
    """Which one of its kind: `human 5 of 6`."""
    alike = [i for i, cluster in enumerate(cast) if cluster.name == cast[k].name]
    if cast[k].name == "human":  # those in pairs are humans too
        alike = [i for i, cluster in enumerate(cast) for member in cluster.members if isinstance(member, Human)]
    return f"{cast[k].name} {alike.index(k) + 1} of {len(alike)}"


def _no_spot(cast: list[Cluster], k: int, plan: FloorPlan, attempts: int) -> str:
    fewer = "fewer humans" if isinstance(cast[k].members[0], Human) else "less furniture"
    spot = f"no free spot for {_label(cast, k)} in a {plan.size} room after {attempts} attempts"
    if cast[k].fixed is not None:
        return f"{spot}; turn the thing (theta) so that its front (-y) is free, or set attracts: false"
    return f"{spot}; widen the room, ask for {fewer}, or set drop: true"
