"""Sampling of a scene's humans, groups, furniture and interactions, before anything is placed."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Literal

from ..core.entities import (
    AT_LAPTOP,
    AT_OBJECT,
    AT_PLANT,
    TALKING,
    WALKING_TOGETHER,
    Behaviour,
    Formation,
    Furniture,
    Group,
    Human,
    Interaction,
)
from ..core.geometry import Disc, Point, Pose, Shape, quantised, shape_gap
from ..core.portable_math import PI, unit_vector
from ..core.rng import RandomStream
from .scenario.config import ScenarioConfig
from .scenario.ranges import Range
from .scenario.sections import outline_of

_BESIDE = 0.6  # m, from the middle of the o-space to the line on which two stand side by side
_WIDEST = 1.2  # m, of the o-space of an open formation
_FARTHEST = 1.75  # m, from its middle: nobody is beyond social distance (Hall) from anybody else


@dataclass(frozen=True, slots=True)
class Figure:
    """Where members stand: `space` is the radius of the o-space round the origin, m; 0 of those who walk."""

    formation: Formation
    poses: tuple[Pose, ...]
    space: float = 0.0


def walking(formation: Formation, size: int, spacing: float, angle: float) -> Figure:
    """People who walk along x, from the left one to the right one.

    Args:
        formation: `abreast` or `v`; of two in a V one is behind.
        spacing: m, between neighbours.
        angle: rad, between the way and the line to a neighbour in a V.
    """
    c, s = unit_vector(angle if formation == "v" else PI / 2)
    x = y = 0.0
    places = [(x, y)]
    for k in range(1, size):
        if 2 * k == size and size > 2:  # the two in the middle are level
            y -= spacing
        else:
            x, y = x + (-spacing * c if 2 * k <= size else spacing * c), y - spacing * s
        places.append((x, y))
    middle = y / 2
    return Figure(formation, tuple(Pose(x, y - middle) for x, y in places))


def talking(formation: Formation, size: int, spacing: float) -> Figure:
    """People who face the middle of the space they share, at the origin; neighbours are `spacing` m apart."""
    if formation == "side_by_side":
        half = spacing / 2
        return Figure(formation, (Pose(-_BESIDE, -half), Pose(-_BESIDE, half)), _BESIDE - 0.1)
    whole = formation in ("circle", "face_to_face")
    step = PI / 2 if formation == "l" else 2 * PI / size if whole else PI / (size - 1)
    radius = min(spacing / (2 * unit_vector(step / 2)[1]), _FARTHEST)  # the spacing is a chord of the circle
    poses = tuple(_inward(radius, PI + step * (k - (size - 1) / 2)) for k in range(size))
    return Figure(formation, poses, min(radius, _WIDEST) if formation == "semicircle" else radius)


def _inward(radius: float, angle: float) -> Pose:
    """Someone on a circle round the origin, who faces it."""
    c, s = unit_vector(angle)
    return Pose(radius * c, radius * s, angle + PI)


Entity = Human | Furniture

_ORIGIN = Pose(0.0, 0.0)
_ANY_YAW = Range(-PI, PI)
_CYCLE = (TALKING, AT_LAPTOP, AT_PLANT, WALKING_TOGETHER)  # the order in which the original tries them
_COUNTED = {"table": "tables", "plant": "plants", "chair": "chairs", "shelf": "shelves", "tv": "tvs"}
_USES = {"laptop": AT_LAPTOP, "plant": AT_PLANT, "table": "", "chair": ""}  # of a fixed piece; of others: AT_OBJECT


@dataclass(frozen=True, slots=True)
class _Kind:
    """What a relation needs: its name in messages, its own setting, its people, and the things that will do."""

    name: str
    setting: str
    behaviour: Behaviour
    people: int
    things: tuple[str, ...] = ()
    distance: str = ""


_KINDS = {
    TALKING: _Kind("talking pair", "talking_pairs", "standing", 2),
    WALKING_TOGETHER: _Kind("walking pair", "walking_pairs", "wandering", 2),
    AT_LAPTOP: _Kind("person at a laptop", "at_laptop", "standing", 1, ("table",), "laptop_distance"),
    AT_PLANT: _Kind("person at a plant", "at_plant", "standing", 1, ("plant",), "plant_distance"),
    AT_OBJECT: _Kind("person at an object", "at_object", "standing", 1, ("shelf", "tv"), "object_distance"),
}


@dataclass(frozen=True, slots=True)
class Cluster:
    """Things that are placed as one, since their places depend on each other.

    Attributes:
        name: for messages.
        members: poses are in the cluster's frame; `Furniture.on` is an index into the members.
        yaw: how the whole may be turned.
        relation: of the first member with the last, or with the fixed piece; in a group of each with each.
        fixed: index of the fixed piece that the only member attends to, from a `distance` drawn with each attempt.
        formation: of a group; `space`: radius of what its members share, round the cluster's origin, m.
        place: of the origin, m, if it is given.
    """

    name: str
    members: tuple[Entity, ...]
    yaw: Range
    relation: str | None = None
    fixed: int | None = None
    distance: Range | None = None
    formation: Formation | None = None
    space: float = 0.0
    place: Point | None = None


def shape_of(entity: Entity) -> Shape:
    """The outline of a person or a thing."""
    return Disc(entity.radius) if isinstance(entity, Human) else entity.shape


def fixed_furniture(config: ScenarioConfig) -> tuple[Furniture, ...]:
    """The pieces at fixed places, numbered from 0; a laptop over a table lies on it."""
    pieces = [
        Furniture(k, p.type, Pose(p.x, p.y, p.theta).rounded(), outline_of(p.size or config.sizes[p.type]))
        for k, p in enumerate(config.furniture)
    ]
    return tuple(Furniture(p.id, p.type, p.pose, p.shape, _carrier(p, pieces)) for p in pieces)


def _carrier(piece: Furniture, pieces: list[Furniture]) -> int | None:
    """The table that a laptop lies on."""
    tables = (other for other in pieces if other.type == "table" and piece.type == "laptop")
    return next((table.id for table in tables if _is_over(piece, table)), None)


def _is_over(piece: Furniture, table: Furniture) -> bool:
    dx, dy = piece.pose.x - table.pose.x, piece.pose.y - table.pose.y
    is_near = dx * dx + dy * dy < table.shape.reach * table.shape.reach
    return is_near and shape_gap(piece.shape, piece.pose, table.shape, table.pose) == 0.0


def draw_cast(config: ScenarioConfig, rng: RandomStream) -> list[Cluster]:
    """People and things in their clusters: those in relations first, then the others."""
    casting = _Casting(config, rng)
    counts = {relation: getattr(config, kind.setting).draw(rng) for relation, kind in _KINDS.items()}
    for relation, count in counts.items():
        for _ in range(count):
            casting.add(relation)
    casting.add_groups()
    for _ in range(config.relations.draw(rng)):
        first = rng.integer(0, len(_CYCLE) - 1)
        casting.add_first_possible(_CYCLE[first:] + _CYCLE[:first])
    casting.add_the_others()
    return casting.clusters


class _Casting:
    """The clusters so far, and who and what is still free for a relation."""

    def __init__(self, config: ScenarioConfig, rng: RandomStream) -> None:
        self.config, self.rng = config, rng
        self.clusters: list[Cluster] = []
        standing, wandering = _draw_people(config, rng)
        things = {type_: getattr(config, setting).draw(rng) for type_, setting in _COUNTED.items()}
        self.free = Counter({"standing": standing, "wandering": wandering, **things})
        self.spots: dict[str, list[int]] = {relation: [] for relation in ("", *_KINDS)}
        for k in rng.shuffled(range(len(config.furniture))):
            if config.furniture[k].attracts:
                self.spots[_USES.get(config.furniture[k].type, AT_OBJECT)].append(k)

    def add(self, relation: str) -> None:
        """A relation of people who come along with it."""
        if relation == TALKING:
            facing = PI + self.config.talking_angle.draw(self.rng)
            self._add_pair(relation, Pose(self.config.talking_distance.draw(self.rng), 0.0, facing))
        elif relation == WALKING_TOGETHER:
            self._add_pair(relation, Pose(0.0, self.config.pair_spacing.draw(self.rng)))
        elif self.spots[relation]:
            self._add_at_fixed(relation, self.spots[relation].pop())
        else:
            self._add_at_thing(relation)

    def add_groups(self) -> None:
        """Groups of two and more, who come along with them. Where none may be, chance is left as it is."""
        config, groups, rng = self.config, self.config.groups, self.rng
        for _ in range(config.walking_groups.draw(rng) if config.walking_groups.max else 0):
            name = rng.choice(list(groups.walking_formations), list(groups.walking_formations.values()))
            size, spacing = groups.walking_size.draw(rng), groups.walking_spacing.draw(rng)
            figure = walking(name, size, spacing, groups.v_angle.draw(rng))
            self._add_group("walking group", WALKING_TOGETHER, figure, None)
        for k in range(config.talking_groups.draw(rng) if config.talking_groups.max else 0):
            size, spacing = groups.talking_size.draw(rng), groups.talking_spacing.draw(rng)
            weights = groups.weights(size)
            figure = talking(rng.choice(list(weights), list(weights.values())), size, spacing)
            self._add_group("talking group", TALKING, figure, groups.places[k] if k < len(groups.places) else None)

    def add_first_possible(self, relations: tuple[str, ...]) -> None:
        """The first relation that there are free people and things for, of these people."""
        for relation in relations:
            kind = _KINDS[relation]
            if self.free[kind.behaviour] >= kind.people and self._is_thing_free(relation):
                self.free[kind.behaviour] -= kind.people
                self.add(relation)
                return

    def add_the_others(self) -> None:
        """Everybody and everything that is still free, alone."""
        for behaviour in ("standing", "wandering"):
            for _ in range(self.free[behaviour]):
                self.clusters.append(Cluster("human", (self._human(behaviour, _ORIGIN),), _ANY_YAW))
        for type_ in _COUNTED:
            for _ in range(self.free[type_]):
                self.clusters.append(Cluster(type_, self._things(type_, 0), self.config.furniture_yaw))

    def _is_thing_free(self, relation: str) -> bool:
        things = _KINDS[relation].things
        if not things or self.spots[relation]:
            return True
        return any(self.free[type_] for type_ in things) and (relation != AT_LAPTOP or self.config.laptops_on_tables)

    def _add_pair(self, relation: str, other: Pose) -> None:
        kind = _KINDS[relation]
        members = (self._human(kind.behaviour, _ORIGIN), self._human(kind.behaviour, other))
        self.clusters.append(Cluster(kind.name, members, _ANY_YAW, relation))

    def _add_group(self, name: str, relation: str, figure: Figure, place: Point | None) -> None:
        members = tuple(self._human(_KINDS[relation].behaviour, pose) for pose in figure.poses)
        self.clusters.append(
            Cluster(name, members, _ANY_YAW, relation, formation=figure.formation, space=figure.space, place=place)
        )

    def _add_at_fixed(self, relation: str, fixed: int) -> None:
        kind = _KINDS[relation]
        members = (self._human(kind.behaviour, _ORIGIN),)
        distance = getattr(self.config, kind.distance)
        self.clusters.append(Cluster(kind.name, members, _ANY_YAW, relation, fixed, distance))

    def _add_at_thing(self, relation: str) -> None:
        kind = _KINDS[relation]
        type_ = next((type_ for type_ in kind.things if self.free[type_]), kind.things[0])
        self.free[type_] -= min(self.free[type_], 1)
        distance = getattr(self.config, kind.distance).draw(self.rng)
        human = self._human(kind.behaviour, Pose(0.0, -distance, PI / 2))
        things = self._things(type_, 1, with_laptop=relation == AT_LAPTOP)
        self.clusters.append(Cluster(kind.name, (human, *things), self.config.furniture_yaw, relation))

    def _things(self, type_: str, index: int, with_laptop: bool = False) -> tuple[Furniture, ...]:
        """A piece of furniture, the member of that index, and the laptop on it."""
        piece = Furniture(0, type_, _ORIGIN, outline_of(self.config.sizes[type_]))
        if type_ != "table" or not (with_laptop or self.config.laptops_on_tables):
            return (piece,)
        return piece, Furniture(0, "laptop", _ORIGIN, outline_of(self.config.sizes["laptop"]), on=index)

    def _human(self, behaviour: Behaviour, pose: Pose) -> Human:
        """Somebody like everybody; their id comes with the numbering."""
        usual, rng = self.config.person, self.rng
        speed = usual.desired_speed
        return Human(
            id=0,
            pose=pose,
            radius=quantised(usual.radius.draw(rng)),
            desired_speed=quantised(speed.draw(rng)),
            behaviour=behaviour,
            model=usual.model,
            reacts_to_robot=0.0 if rng.uniform() < usual.ignores_robot else 1.0,
        )


def _draw_people(config: ScenarioConfig, rng: RandomStream) -> tuple[int, int]:
    """How many stand alone, and how many wander; a fraction of a person by chance."""
    if config.humans is None:
        assert config.standing is not None
        assert config.wandering is not None
        return config.standing.draw(rng), config.wandering.draw(rng)
    everybody = config.humans.draw(rng)
    wandering = int(everybody * config.wandering_share + rng.uniform())
    return everybody - wandering, wandering


Key = tuple[int, int]  # a cluster's index and a member's in it; -1 and an index: a fixed piece

_FIXED = -1
_TYPES = ("table", "laptop", "plant")
_GROUPS: dict[str | None, Literal["talking", "walking"]] = {TALKING: "talking", WALKING_TOGETHER: "walking"}


@dataclass(frozen=True, slots=True)
class NumberedEntities:
    """Everybody and everything in a room, with their ids, and who belongs with whom."""

    humans: tuple[Human, ...]
    furniture: tuple[Furniture, ...]
    groups: tuple[Group, ...]
    interactions: tuple[Interaction, ...]


def numbered(placed: list[tuple[Cluster, tuple[Entity, ...]]], fixed: tuple[Furniture, ...]) -> NumberedEntities:
    """Give ids to fixed pieces and to the members of placed clusters."""
    entries: dict[Key, Entity] = {(_FIXED, k): piece for k, piece in enumerate(fixed)}
    entries |= {(k, m): member for k, (_, members) in enumerate(placed) for m, member in enumerate(members)}
    humans = {key: entity for key, entity in entries.items() if isinstance(entity, Human)}
    things = {key: entity for key, entity in entries.items() if isinstance(entity, Furniture)}
    people = sorted(humans, key=lambda key: humans[key].behaviour != "standing")
    pieces = sorted(things, key=lambda key: _rank(things[key].type))
    ids = {key: k for k, key in enumerate(people + pieces, start=1)}

    relations = [(k, cluster) for k, (cluster, _) in enumerate(placed) if cluster.relation]
    groups = [(k, cluster) for k, cluster in relations if cluster.relation in _GROUPS]
    group = {k: number for number, (k, _) in enumerate(groups, start=1)}
    return NumberedEntities(
        tuple(replace(humans[key], id=ids[key], group=group.get(key[0])) for key in people),
        tuple(replace(things[key], id=ids[key], on=_carrier_id(key, things[key], ids)) for key in pieces),
        tuple(
            Group(group[k], _GROUPS[one.relation], tuple(ids[key] for key in _members(k, one)), one.formation)
            for k, one in groups
        ),
        tuple(
            Interaction(ids[a], cluster.relation or "", ids[b])
            for k, cluster in relations
            for a, b in _ties(k, cluster)
        ),
    )


def _rank(type_: str) -> int:
    return _TYPES.index(type_) if type_ in _TYPES else len(_TYPES)


def _carrier_id(key: Key, piece: Furniture, ids: dict[Key, int]) -> int | None:
    return None if piece.on is None else ids[key[0], piece.on]


def _members(k: int, cluster: Cluster) -> list[Key]:
    return [(k, m) for m in range(len(cluster.members))]


def _ties(k: int, cluster: Cluster) -> list[tuple[Key, Key]]:
    """Who attends to whom or what: in a group each to each, else the first member to the last or to the fixed piece."""
    if cluster.relation in _GROUPS:
        return list(combinations(_members(k, cluster), 2))
    return [((k, 0), (k, len(cluster.members) - 1) if cluster.fixed is None else (_FIXED, cluster.fixed))]
