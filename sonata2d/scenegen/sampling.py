"""Sampling of a scene's pedestrians, groups, furniture and interactions, before anything is placed."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

from ..core.entities import Behaviour, Formation, Furniture, Group, Human, Interaction, Reaction
from ..core.geometry import Disc, Point, Pose, Shape, quantised
from ..core.outlines import shape_gap
from ..core.portable_math import PI, unit_vector
from ..core.relations import (
    AT_LAPTOP,
    AT_OBJECT,
    AT_PLANT,
    ORIGINAL_RELATIONS,
    RELATION,
    TALKING,
    WALKING_TOGETHER,
    Relation,
)
from ..core.rng import RandomStream
from .scenario.base import Range
from .scenario.config import ScenarioConfig
from .scenario.sections import PersonConfig, shape_of_size

# Formations of groups

_SIDE_BY_SIDE_OFFSET = 0.6  # m, from the o-space centre to the line on which two members stand side by side
_MAX_OPEN_RADIUS = 1.2  # m, of the o-space of a semicircle
_MAX_RADIUS = 1.75  # m, of a formation: all members are within social distance (Hall) of each other


@dataclass(frozen=True, slots=True)
class GroupLayout:
    """Poses of the members of a group in the group's own frame.

    Attributes:
        formation: name of the formation.
        poses: one for each member.
        o_space: radius of the o-space around the origin, m; 0 for walking groups.
    """

    formation: Formation
    poses: tuple[Pose, ...]
    o_space: float = 0.0


def walking_formation(formation: Formation, size: int, spacing: float, angle: float) -> GroupLayout:
    """Arrange a group that walks along x, from its left to its right member.

    Args:
        formation: `abreast` or `v`; in a V of two, the second member walks behind the first.
        size: number of members.
        spacing: m, between neighbours.
        angle: rad, between the walking direction and the line to a neighbour in a V.
    """
    c, s = unit_vector(angle if formation == "v" else PI / 2)
    x = y = 0.0
    points = [(x, y)]
    for k in range(1, size):
        if 2 * k == size and size > 2:  # the two middle members of an even number walk side by side
            y -= spacing
        else:
            x, y = x + (-spacing * c if 2 * k <= size else spacing * c), y - spacing * s
        points.append((x, y))
    centre = y / 2
    return GroupLayout(formation, tuple(Pose(x, y - centre) for x, y in points))


def talking_formation(formation: Formation, size: int, spacing: float) -> GroupLayout:
    """Arrange a group that talks: its members face the centre of their o-space, which is the origin.

    Args:
        formation: any formation of a talking group; with two members `face_to_face`, `l` or `side_by_side`.
        size: number of members.
        spacing: m, between neighbours; less where the formation would be too large.
    """
    if formation == "side_by_side":
        half = spacing / 2
        pair = Pose(-_SIDE_BY_SIDE_OFFSET, -half), Pose(-_SIDE_BY_SIDE_OFFSET, half)
        return GroupLayout(formation, pair, _SIDE_BY_SIDE_OFFSET - 0.1)
    is_closed = formation in ("circle", "face_to_face")
    step = PI / 2 if formation == "l" else 2 * PI / size if is_closed else PI / (size - 1)
    radius = min(spacing / (2 * unit_vector(step / 2)[1]), _MAX_RADIUS)  # the spacing is a chord of the circle
    poses = tuple(_pose_on_circle(radius, PI + step * (k - (size - 1) / 2)) for k in range(size))
    return GroupLayout(formation, poses, min(radius, _MAX_OPEN_RADIUS) if formation == "semicircle" else radius)


def _pose_on_circle(radius: float, angle: float) -> Pose:
    """Return the pose on a circle around the origin that faces the origin."""
    c, s = unit_vector(angle)
    return Pose(radius * c, radius * s, angle + PI)


# Sampling of clusters

Entity = Human | Furniture

_ORIGIN = Pose(0.0, 0.0)
_ANY_YAW = Range(-PI, PI)
_PAIRS_FIRST = sorted(RELATION.values(), key=lambda relation: -relation.humans)
_OBJECT_TYPES = {AT_LAPTOP: ("table",), AT_PLANT: ("plant",), AT_OBJECT: ("shelf", "tv")}
_COUNT_SETTINGS = {"table": "tables", "plant": "plants", "chair": "chairs", "shelf": "shelves", "tv": "tvs"}
_RELATION_OF_TYPE = {"laptop": AT_LAPTOP, "plant": AT_PLANT, "table": "", "chair": ""}  # other types: AT_OBJECT


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
    yaw: Range
    relation: str | None = None
    fixed: int | None = None
    distance: Range | None = None
    formation: Formation | None = None
    o_space: float = 0.0
    position: Point | None = None


def shape_of(entity: Entity) -> Shape:
    """Return the outline of a piece of furniture, or the circle in which a pedestrian can turn."""
    return Disc(entity.shape.circumradius) if isinstance(entity, Human) else entity.shape


def fixed_furniture(config: ScenarioConfig) -> tuple[Furniture, ...]:
    """Create the furniture at fixed positions, numbered from 0; a laptop that overlaps a table lies on it."""
    pieces = [
        Furniture(
            k, p.type, Pose(p.x, p.y, p.theta).rounded(), shape_of_size(p.size or config.sizes[p.type]), seat=p.seat
        )
        for k, p in enumerate(config.furniture)
    ]
    return tuple(replace(p, on=_supporting_table(p, pieces)) for p in pieces)


def _supporting_table(piece: Furniture, pieces: list[Furniture]) -> int | None:
    """Return the id of the table that a laptop lies on; None for other furniture."""
    tables = (other for other in pieces if other.type == "table" and piece.type == "laptop")
    return next((table.id for table in tables if _overlap(piece, table)), None)


def _overlap(piece: Furniture, table: Furniture) -> bool:
    dx, dy = piece.pose.x - table.pose.x, piece.pose.y - table.pose.y
    is_near = dx * dx + dy * dy < table.shape.circumradius * table.shape.circumradius
    return is_near and shape_gap(piece.shape, piece.pose, table.shape, table.pose) == 0.0


def sample_entities(config: ScenarioConfig, rng: RandomStream) -> list[EntityCluster]:
    """Sample pedestrians and drawn furniture, as clusters: those in relations first, then single entities."""
    sampler = _Sampler(config, rng)
    # the counts are drawn before any cluster is: the order of draws is part of what a seed means
    counts = {relation.name: getattr(config, relation.setting).draw(rng) for relation in _PAIRS_FIRST}
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
        free_fixed: indices of free fixed furniture, by the relation that uses it.
    """

    def __init__(self, config: ScenarioConfig, rng: RandomStream) -> None:
        self.config, self.rng = config, rng
        self.clusters: list[EntityCluster] = []
        standing, wandering = _draw_human_counts(config, rng)
        furniture = {type_: getattr(config, setting).draw(rng) for type_, setting in _COUNT_SETTINGS.items()}
        self.free = Counter({"standing": standing, "wandering": wandering, **furniture})
        self.free_fixed: dict[str, list[int]] = {relation: [] for relation in ("", *RELATION)}
        for k in rng.shuffled(range(len(config.furniture))):
            if config.furniture[k].attracts:
                self.free_fixed[_RELATION_OF_TYPE.get(config.furniture[k].type, AT_OBJECT)].append(k)

    def add_relation(self, relation: str) -> None:
        """Add a relation with new pedestrians."""
        if relation == TALKING:
            theta = PI + self.config.talking_angle.draw(self.rng)
            self._add_pair(relation, Pose(self.config.talking_distance.draw(self.rng), 0.0, theta))
        elif relation == WALKING_TOGETHER:
            self._add_pair(relation, Pose(0.0, self.config.pair_spacing.draw(self.rng)))
        elif self.free_fixed[relation]:
            self._add_at_fixed_furniture(relation, self.free_fixed[relation].pop())
        else:
            self._add_at_drawn_furniture(relation)

    def add_groups(self) -> None:
        """Add the walking and talking groups with new pedestrians.

        Nothing is drawn where the maximum number of groups is 0, so that scenarios without groups keep their scenes.
        """
        config, groups, rng = self.config, self.config.groups, self.rng
        for _ in range(config.walking_groups.draw(rng) if config.walking_groups.max else 0):
            name = rng.choice(list(groups.walking_formations), list(groups.walking_formations.values()))
            size, spacing = groups.walking_size.draw(rng), groups.walking_spacing.draw(rng)
            layout = walking_formation(name, size, spacing, groups.v_angle.draw(rng))
            self._add_group("walking group", WALKING_TOGETHER, layout, None)
        for k in range(config.talking_groups.draw(rng) if config.talking_groups.max else 0):
            size, spacing = groups.talking_size.draw(rng), groups.talking_spacing.draw(rng)
            weights = groups.formation_weights(size)
            layout = talking_formation(rng.choice(list(weights), list(weights.values())), size, spacing)
            self._add_group("talking group", TALKING, layout, groups.places[k] if k < len(groups.places) else None)

    def add_first_possible(self, relations: tuple[str, ...]) -> None:
        """Put free pedestrians into the first relation for which enough pedestrians and an object are free."""
        for name in relations:
            relation = RELATION[name]
            if self.free[relation.behaviour] >= relation.humans and self._is_object_free(name):
                self.free[relation.behaviour] -= relation.humans
                self.add_relation(name)
                return

    def add_single_entities(self) -> None:
        """Add each pedestrian and piece of furniture that is still free as a cluster of its own."""
        for behaviour in ("standing", "wandering"):
            for _ in range(self.free[behaviour]):
                self.clusters.append(EntityCluster("human", (self._draw_human(behaviour, _ORIGIN),), _ANY_YAW))
        for type_ in _COUNT_SETTINGS:
            for _ in range(self.free[type_]):
                self.clusters.append(EntityCluster(type_, self._furniture(type_, 0), self.config.furniture_yaw))

    def _is_object_free(self, relation: str) -> bool:
        """Return whether the relation needs no object, or one is free."""
        types = _OBJECT_TYPES.get(relation, ())
        if not types or self.free_fixed[relation]:
            return True
        return any(self.free[type_] for type_ in types) and (relation != AT_LAPTOP or self.config.laptops_on_tables)

    def _add_pair(self, name: str, second_pose: Pose) -> None:
        relation = RELATION[name]
        members = (self._draw_human(relation.behaviour, _ORIGIN), self._draw_human(relation.behaviour, second_pose))
        self.clusters.append(EntityCluster(relation.title, members, _ANY_YAW, name))

    def _add_group(self, name: str, relation: str, layout: GroupLayout, position: Point | None) -> None:
        members = tuple(self._draw_human(RELATION[relation].behaviour, pose) for pose in layout.poses)
        formation, o_space = layout.formation, layout.o_space
        self.clusters.append(
            EntityCluster(name, members, _ANY_YAW, relation, formation=formation, o_space=o_space, position=position)
        )

    def _add_at_fixed_furniture(self, name: str, fixed: int) -> None:
        relation = RELATION[name]
        members = (self._draw_human(relation.behaviour, _ORIGIN),)
        distance = getattr(self.config, relation.distance)
        self.clusters.append(EntityCluster(relation.title, members, _ANY_YAW, name, fixed, distance))

    def _add_at_drawn_furniture(self, name: str) -> None:
        """Use a free piece of furniture of a suitable type, or add one where none is free."""
        relation = RELATION[name]
        types = _OBJECT_TYPES[name]
        type_ = next((type_ for type_ in types if self.free[type_]), types[0])
        self.free[type_] -= min(self.free[type_], 1)
        distance = getattr(self.config, relation.distance).draw(self.rng)
        human = self._draw_human(relation.behaviour, Pose(0.0, -distance, PI / 2))
        furniture = self._furniture(type_, 1, with_laptop=name == AT_LAPTOP)
        self.clusters.append(EntityCluster(relation.title, (human, *furniture), self.config.furniture_yaw, name))

    def _furniture(self, type_: str, index: int, with_laptop: bool = False) -> tuple[Furniture, ...]:
        """Create a piece of furniture, which is the member `index` of its cluster, and the laptop on a table."""
        piece = Furniture(0, type_, _ORIGIN, shape_of_size(self.config.sizes[type_]))
        if type_ != "table" or not (with_laptop or self.config.laptops_on_tables):
            return (piece,)
        return piece, Furniture(0, "laptop", _ORIGIN, shape_of_size(self.config.sizes["laptop"]), on=index)

    def _draw_human(self, behaviour: Behaviour, pose: Pose) -> Human:
        """Draw a pedestrian by the section `person`; `number_entities` sets its id."""
        return draw_human(self.config.person, behaviour, pose, self.rng)


def draw_human(person: PersonConfig, behaviour: Behaviour, pose: Pose, rng: RandomStream) -> Human:
    """Draw a pedestrian by the section `person`; its id is 0."""
    speed = person.desired_speed
    return Human(
        id=0,
        pose=pose,
        radius=quantised(person.radius.draw(rng)),
        breadth=quantised(person.breadth.draw(rng)),
        desired_speed=quantised(speed.draw(rng)),
        headway=quantised(person.headway.draw(rng)),
        politeness=quantised(person.politeness.draw(rng)),
        behaviour=behaviour,
        model=person.model,
        reacts_to_robot=0.0 if rng.uniform() < person.ignores_robot else 1.0,
    )


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


# Numbering of placed entities

Key = tuple[int, int]  # index of a cluster and of a member in it; for fixed furniture -1 and its index

_FIXED = -1
_TYPE_ORDER = ("table", "laptop", "plant")


@dataclass(frozen=True, slots=True)
class NumberedEntities:
    """Pedestrians and furniture with their ids, and the groups and interactions between these ids."""

    humans: tuple[Human, ...]
    furniture: tuple[Furniture, ...]
    groups: tuple[Group, ...]
    interactions: tuple[Interaction, ...]


def ordered_entities(
    placed: list[tuple[EntityCluster, list[Pose]]], fixed: tuple[Furniture, ...]
) -> tuple[dict[Key, tuple[Human, Pose]], dict[Key, tuple[Furniture, Pose]]]:
    """Order pedestrians, then furniture, with their poses in the world frame, as they will be numbered.

    Standing pedestrians come before wandering ones; tables before laptops, plants and other furniture.

    Args:
        placed: clusters, each with the poses of its members in the world frame.
        fixed: fixed furniture.
    """
    humans: list[tuple[Key, tuple[Human, Pose]]] = []
    furniture: list[tuple[Key, tuple[Furniture, Pose]]] = [
        ((_FIXED, k), (piece, piece.pose)) for k, piece in enumerate(fixed)
    ]
    for k, (cluster, poses) in enumerate(placed):
        for m, (member, pose) in enumerate(zip(cluster.members, poses, strict=True)):
            if isinstance(member, Human):
                humans.append(((k, m), (member, pose)))
            else:
                furniture.append(((k, m), (member, pose)))
    humans.sort(key=lambda item: item[1][0].behaviour != "standing")
    furniture.sort(key=lambda item: _type_rank(item[1][0].type))
    return dict(humans), dict(furniture)


def number_entities(
    placed: list[tuple[EntityCluster, list[Pose]]],
    humans: dict[Key, tuple[Human, Pose]],
    furniture: dict[Key, tuple[Furniture, Pose]],
    taken: Collection[int],
    taken_groups: Collection[int],
    manners: Manners,
) -> NumberedEntities:
    """Give ids to pedestrians, furniture and groups, and to each pedestrian its reaction to the robot.

    Args:
        placed, humans, furniture: as for `ordered_entities`, and as it returns them.
        taken, taken_groups: ids that others have; the lowest free ones are given.
        manners: reactions by id.
    """
    keys = [*humans, *furniture]
    ids = dict(zip(keys, free_ids(taken, len(keys)), strict=True))
    related = [(k, cluster, RELATION[cluster.relation]) for k, (cluster, _) in enumerate(placed) if cluster.relation]
    groups = [(k, cluster, relation.group) for k, cluster, relation in related if relation.group]
    group_ids = dict(zip((k for k, *_ in groups), free_ids(taken_groups, len(groups)), strict=True))
    return NumberedEntities(
        tuple(
            manners.given_to(human, id=ids[key], pose=pose, group=group_ids.get(key[0]))
            for key, (human, pose) in humans.items()
        ),
        tuple(
            replace(piece, id=ids[key], pose=pose, on=_support_id(key, piece, ids))
            for key, (piece, pose) in furniture.items()
        ),
        tuple(
            Group(
                group_ids[k],
                kind,
                tuple(ids[key] for key in _member_keys(k, cluster)),
                cluster.formation,
            )
            for k, cluster, kind in groups
        ),
        tuple(
            Interaction(ids[a], relation.name, ids[b])
            for k, cluster, relation in related
            for a, b in _interacting_keys(k, cluster, relation)
        ),
    )


def free_ids(taken: Collection[int], count: int) -> list[int]:
    """Return the lowest `count` ids from 1 that are not taken."""
    return [number for number in range(1, len(taken) + count + 1) if number not in taken][:count]


def _type_rank(type_: str) -> int:
    return _TYPE_ORDER.index(type_) if type_ in _TYPE_ORDER else len(_TYPE_ORDER)


def _support_id(key: Key, piece: Furniture, ids: dict[Key, int]) -> int | None:
    """Return the id of the piece of furniture that a piece lies on; None if it stands on the floor."""
    return None if piece.on is None else ids[key[0], piece.on]


def _member_keys(k: int, cluster: EntityCluster) -> list[Key]:
    return [(k, m) for m in range(len(cluster.members))]


def _interacting_keys(k: int, cluster: EntityCluster, relation: Relation) -> list[tuple[Key, Key]]:
    """Return the pairs of a relation: all pairs of a group; else the first member with the last or the fixed piece."""
    if relation.group:
        return list(combinations(_member_keys(k, cluster), 2))
    return [((k, 0), (k, len(cluster.members) - 1) if cluster.fixed is None else (_FIXED, cluster.fixed))]


# Reactions to the robot


class Manners:
    """Draws the reaction of each pedestrian to the robot, and its clearance.

    Each pedestrian has its own random stream, so that these settings change nothing else in a scene.

    Args:
        person: distributions of reactions and clearance.
        seed: of the data set.
        episode: number of the episode in the data set.
    """

    def __init__(self, person: PersonConfig, seed: int, episode: int) -> None:
        self._clearance, self._seed, self._episode = person.robot_clearance, seed, episode
        self._reactions, self._weights = list(person.reactions), list(person.reactions.values())

    def given_to(self, human: Human, reaction: Reaction | None = None, **changes: Any) -> Human:
        """Return a pedestrian with its reaction and clearance; one that ignores the robot keeps that.

        Args:
            human: without them.
            reaction: None: drawn.
            changes: other fields to replace, by name.
        """
        rng = RandomStream(self._seed, self._episode, "manners", changes.get("id", human.id))
        robot_clearance = quantised(self._clearance.draw(rng))
        chosen = rng.choice(self._reactions, self._weights) if reaction is None else reaction
        return replace(human, reaction=chosen, robot_clearance=robot_clearance, **changes)
