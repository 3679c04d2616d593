"""Sampling of a scene's pedestrians, groups and furniture as clusters, before anything is placed."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

from ..core.entities import Behaviour, Formation, Furniture, Human
from ..core.furniture_types import LAPTOP, FurnitureType
from ..core.geometry import Disc, Point, Pose, Shape
from ..core.portable_math import PI
from ..core.relations import ORIGINAL_RELATIONS, RELATION, TALKING, WALKING_TOGETHER, Relation
from ..core.rng import RandomStream
from ..core.vectors import length
from ..registry import furniture_type, furniture_types
from .formations import GroupLayout, talking_formation, walking_formation
from .human_sampling import draw_human
from .pieces import create_piece
from .scenario.base import Range
from .scenario.config import ScenarioConfig

Entity = Human | Furniture
TypeStreams = Callable[[str], RandomStream]

_ORIGIN = Pose(0.0, 0.0)
_ANY_YAW = Range(-PI, PI)
LARGEST_ADULT = 0.25  # m, radius of the circle around the largest body by the defaults
_BETWEEN_BODIES = 0.05  # m, between the circles around larger bodies of a group


@dataclass(frozen=True, slots=True)
class EntityCluster:
    """Entities that are placed together because their poses depend on each other, such as a talking pair.

    Attributes:
        name: for messages; recorded in `Scene.dropped`.
        members: their poses are in the cluster's frame; `Furniture.on` is an index into the members.
        yaw: range of the cluster's rotation, rad.
        relation: between the first member and the last, or the fixed piece; in a group, between all members.
        fixed: index of the piece of fixed furniture that the only member attends to.
        distance: m, from the fixed piece; drawn at each attempt to place the cluster.
        formation: of a group.
        o_space: radius of the o-space of a talking group around the cluster's origin, m.
        position: of the cluster's origin, m, world frame; None: drawn.
    """

    name: str
    members: tuple[Entity, ...]
    yaw: Range = _ANY_YAW
    relation: str | None = None
    fixed: int | None = None
    distance: Range | None = None
    formation: Formation | None = None
    o_space: float = 0.0
    position: Point | None = None


def shape_of(entity: Entity) -> Shape:
    """Return the outline of a piece of furniture, or the circle in which a pedestrian can turn."""
    return Disc(entity.shape.circumradius) if isinstance(entity, Human) else entity.shape


def sample_entities(config: ScenarioConfig, rng: RandomStream, stream_of: TypeStreams) -> list[EntityCluster]:
    """Sample pedestrians and drawn furniture, as clusters: relations first, then single entities.

    Args:
        config: the scenario.
        rng: random stream of the scene.
        stream_of: function that returns the random stream of a type of furniture by its name.
    """
    sampler = _Sampler(config, rng, stream_of)
    # the counts are drawn before any cluster is: the order of draws is part of what a seed means
    counts = {name: getattr(config, relation.setting).draw(rng) for name, relation in RELATION.items()}
    for name, count in counts.items():
        for _ in range(count):
            sampler.add_relation(name)
    sampler.add_groups()
    for _ in range(config.relations.draw(rng)):
        first = rng.integer(0, len(ORIGINAL_RELATIONS) - 1)
        sampler.add_first_possible(ORIGINAL_RELATIONS[first:] + ORIGINAL_RELATIONS[:first])
    sampler.add_single_entities()
    return sampler.clusters


class _Sampler:
    """Samples clusters, and keeps count of the pedestrians and furniture that are not in a relation yet.

    Attributes:
        clusters: sampled so far.
        free: number of free entities: standing and wandering pedestrians by behaviour, drawn furniture by type.
        free_fixed: indices of free fixed furniture, by the relation of the pedestrians that attend to it.
        attended: types of drawn furniture, or of laptops on it, by this relation.
    """

    def __init__(self, config: ScenarioConfig, rng: RandomStream, stream_of: TypeStreams) -> None:
        self.config, self.rng = config, rng
        self.clusters: list[EntityCluster] = []
        standing, wandering = _draw_human_counts(config, rng)
        furniture = {name: count.draw(stream_of(name)) for name, count in config.counts.items()}
        self.free = Counter({"standing": standing, "wandering": wandering, **furniture})
        self.free_fixed: dict[str | None, list[int]] = {relation: [] for relation in (None, *RELATION)}
        order = [stream_of(piece.type).uniform() for piece in config.furniture]
        for k in sorted(range(len(order)), key=order.__getitem__):
            if config.furniture[k].attracts:
                self.free_fixed[furniture_type(config.furniture[k].type).relation].append(k)
        drawn = [kind for kind in furniture_types().values() if kind.count or kind == LAPTOP]
        self.attended = {
            name: [kind for kind in drawn if (kind.name == row.at if row.at else kind.relation == name)]
            for name, row in RELATION.items()
        }

    def add_relation(self, name: str) -> None:
        """Add a relation with new pedestrians."""
        relation = RELATION[name]
        distance = getattr(self.config, relation.distance)
        if relation.group == "talking":
            theta = PI + self.config.talking_angle.draw(self.rng) if name == TALKING else PI
            self._add(relation, [_ORIGIN, Pose(distance.draw(self.rng), 0.0, theta)])
        elif relation.in_file:
            self._add(relation, [_ORIGIN, Pose(-distance.draw(self.rng), 0.0)])
        elif relation.group == "walking":
            self._add(relation, [_ORIGIN, Pose(0.0, distance.draw(self.rng))])
        elif (fixed := self._take_fixed(relation)) is not None:
            self._add(relation, [_ORIGIN], fixed=fixed, distance=distance)
        else:
            self._add_at_drawn_furniture(relation)

    def _take_fixed(self, relation: Relation) -> int | None:
        """Take a free piece of fixed furniture to which a pedestrian can attend; its index, None if there is none."""
        for name in [relation.name] if not relation.at else self.free_fixed:
            free = self.free_fixed[name]
            for n in range(len(free) - 1, -1, -1):
                if not relation.at or self.config.furniture[free[n]].type == relation.at:
                    return free.pop(n)
        return None

    def add_groups(self) -> None:
        """Add the walking and talking groups with new pedestrians."""
        config, groups, rng = self.config, self.config.groups, self.rng
        for _ in range(config.walking_groups.draw(rng)):
            name = rng.choice(list(groups.walking_formations), list(groups.walking_formations.values()))
            size, spacing = groups.walking_size.draw(rng), groups.walking_spacing.draw(rng)
            layout = walking_formation(name, size, spacing, groups.v_angle.draw(rng))
            self._add_group("walking group", WALKING_TOGETHER, layout)
        for k in range(config.talking_groups.draw(rng)):
            size, spacing = groups.talking_size.draw(rng), groups.talking_spacing.draw(rng)
            weights = groups.formation_weights(size)
            layout = talking_formation(rng.choice(list(weights), list(weights.values())), size, spacing)
            position = groups.places[k] if k < len(groups.places) else None
            self._add_group("talking group", TALKING, layout, position=position)

    def add_first_possible(self, names: tuple[str, ...]) -> None:
        """Put free pedestrians into the first relation for which enough pedestrians and an object are free."""
        for name in names:
            relation = RELATION[name]
            has_object = relation.humans > 1 or self.free_fixed[name] or any(map(self._is_free, self.attended[name]))
            if self.free[relation.behaviour] >= relation.humans and has_object:
                self.free[relation.behaviour] -= relation.humans
                self.add_relation(name)
                return

    def add_single_entities(self) -> None:
        """Add each pedestrian and piece of furniture that is still free as a cluster of its own."""
        behaviours: tuple[Behaviour, ...] = ("standing", "wandering")
        for behaviour in behaviours:
            for _ in range(self.free[behaviour]):
                human = draw_human(self.config.person, behaviour, _ORIGIN, self.rng)
                self.clusters.append(EntityCluster("human", (human,)))
        for name in self.config.counts:
            for _ in range(self.free[name]):
                self.clusters.append(EntityCluster(name, self._furniture(name, 0), self.config.furniture_yaw))

    def _is_free(self, kind: FurnitureType) -> bool:
        """Return whether a drawn piece of a type, or a drawn table with a laptop on it, is free."""
        return self.free[kind.on or kind.name] > 0 and (kind.on is None or self.config.laptops_on_tables)

    def _add(self, relation: Relation, poses: Iterable[Pose], *furniture: Furniture, **more: Any) -> None:
        """Add a cluster of new pedestrians at poses in its frame, and of furniture; `more` are its other fields."""
        humans = [draw_human(self.config.person, relation.behaviour, pose, self.rng) for pose in poses]
        largest = max(human.shape.circumradius for human in humans)
        if largest > LARGEST_ADULT:  # in a wheelchair, with a cart
            scale, extra = _spread(humans), largest - LARGEST_ADULT
            for k, human in enumerate(humans):
                x, y = human.pose.position
                place = (scale * x, scale * y) if len(humans) > 1 else (x, y - extra if furniture else y)
                humans[k] = replace(human, pose=Pose(*place, human.pose.theta))
            if "o_space" in more:
                more["o_space"] *= scale
            if more.get("distance") is not None:
                more["distance"] = more["distance"].shifted(extra)
        members: tuple[Entity, ...] = (*humans, *furniture)
        self.clusters.append(
            EntityCluster(**{"name": relation.title, "relation": relation.name} | more, members=members)
        )

    def _add_group(self, name: str, relation: str, layout: GroupLayout, **more: Any) -> None:
        fields = {"name": name, "formation": layout.formation, "o_space": layout.o_space}
        self._add(RELATION[relation], layout.poses, **fields, **more)

    def _add_at_drawn_furniture(self, relation: Relation) -> None:
        """Use a free piece of furniture of a suitable type, or add one where none is free."""
        kinds = self.attended[relation.name]
        kind = next((kind for kind in kinds if self.free[kind.on or kind.name]), kinds[0])
        stands = kind.on or kind.name
        self.free[stands] -= min(self.free[stands], 1)
        distance = getattr(self.config, relation.distance).draw(self.rng)
        furniture = self._furniture(stands, 1, with_laptop=kind == LAPTOP)
        self._add(relation, [Pose(0.0, -distance, PI / 2)], *furniture, yaw=self.config.furniture_yaw)

    def _furniture(self, name: str, index: int, with_laptop: bool = False) -> tuple[Furniture, ...]:
        """Create a piece of furniture, which is the member `index` of its cluster, and the laptop on a table."""
        piece = create_piece(self.config, name)
        if name != LAPTOP.on or not (with_laptop or self.config.laptops_on_tables):
            return (piece,)
        return piece, create_piece(self.config, LAPTOP.name, on=index)


def _spread(humans: list[Human]) -> float:
    """Factor by which the members of a cluster must move apart, so that their bodies do not overlap."""
    needed = 1.0
    for first, second in combinations(humans, 2):
        distance = length(first.pose.x - second.pose.x, first.pose.y - second.pose.y)
        radii = first.shape.circumradius + second.shape.circumradius + _BETWEEN_BODIES
        needed = max(needed, radii / max(distance, 1e-3))
    return needed


def _draw_human_counts(config: ScenarioConfig, rng: RandomStream) -> tuple[int, int]:
    """Draw the number of standing and of wandering pedestrians.

    A fractional number of wandering pedestrians is rounded up or down at random, with its value as expectation.
    """
    if config.humans is None:
        assert config.standing is not None
        assert config.wandering is not None
        return config.standing.draw(rng), config.wandering.draw(rng)
    total = config.humans.draw(rng)
    wandering = int(total * config.wandering_share + rng.uniform())
    return total - wandering, wandering
