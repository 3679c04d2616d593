"""Finding places: clusters of people and things, tried at random poses until their outlines keep clear."""

from __future__ import annotations

import math
from dataclasses import replace

from ..core.entities import TALKING, Furniture, Human
from ..core.geometry import Disc, Pose, Rectangle, Shape, shape_gap
from ..core.portable_math import PI, angle_of
from ..core.rng import RandomStream
from .floor_plans import FloorPlan
from .sampling import Cluster, Entity, shape_of
from .scenario.config import ScenarioConfig

_BEHIND = 0.5  # m, round each member of a talking group, that others keep off

Spot = tuple[Shape, Pose]


class Layout:
    """A room that fills up.

    Args:
        plan: the room.
        config: clearances and how often to try.
        taken: outlines that stand in it already.
    """

    def __init__(self, plan: FloorPlan, config: ScenarioConfig, taken: list[Spot]) -> None:
        self.plan, self.config, self.taken = plan, config, taken

    def place(self, cluster: Cluster, fixed: tuple[Furniture, ...], rng: RandomStream) -> tuple[Entity, ...] | None:
        """Find a pose for a cluster and put it there.

        Returns:
            Its members, in world coordinates; None if no pose was found in `max_attempts`.
        """
        target = None if cluster.fixed is None else fixed[cluster.fixed].pose
        for _ in range(self.config.max_attempts):
            pose = target or self._draw_pose(cluster, rng)
            members = _posed(cluster, pose, rng)
            spots = self._spots(cluster, members, target)
            if spots is not None and self._can_be_shared(cluster, members, pose):
                self.taken += spots + _shared(cluster, members, pose)
                return members
        return None

    def is_free(self, shape: Shape, pose: Pose, gap: float, wall_gap: float) -> bool:
        """Whether an outline keeps `gap` from all that stands, and `wall_gap` from walls."""
        return self.plan.holds(shape, pose, wall_gap) and keeps_clear(shape, pose, gap, self.taken)

    def _draw_pose(self, cluster: Cluster, rng: RandomStream) -> Pose:
        if cluster.place is not None:
            return Pose(*cluster.place, cluster.yaw.draw(rng))
        return Pose(*self.plan.sample(rng), cluster.yaw.draw(rng))

    def _spots(self, cluster: Cluster, members: tuple[Entity, ...], target: Pose | None) -> list[Spot] | None:
        """The outlines of the members that touch the floor, if all of them are free and see what they attend to."""
        if cluster.relation and not self.plan.is_in_sight(members[0].pose, target or members[-1].pose):
            return None
        spots: list[Spot] = []
        for member in members:
            shape, gap = shape_of(member), self.config.clearance
            if isinstance(member, Furniture) and member.on is not None:
                continue
            if not self.is_free(shape, member.pose, gap, self._wall_gap(member)):
                return None
            if not keeps_clear(shape, member.pose, gap, spots):
                return None
            spots.append((shape, member.pose))
        return spots

    def _can_be_shared(self, cluster: Cluster, members: tuple[Entity, ...], origin: Pose) -> bool:
        """Whether all members see the middle of their o-space, and nothing stands in it."""
        if not cluster.space:
            return True
        o_space = Disc(cluster.space - max(shape_of(member).reach for member in members))
        in_sight = all(self.plan.is_in_sight(member.pose, origin) for member in members)
        return in_sight and self.is_free(o_space, origin, self.config.clearance, self.config.clearance)

    def _wall_gap(self, member: Entity) -> float:
        if isinstance(member, Human):
            return max(self.config.person.wall_distance - member.radius, self.config.clearance)
        return self.config.clearance


def _shared(cluster: Cluster, members: tuple[Entity, ...], origin: Pose) -> list[Spot]:
    """What people who talk share, as outlines, so that nobody stands there."""
    if cluster.space:
        return [(Disc(cluster.space), origin), *((Disc(_BEHIND), member.pose) for member in members)]
    return [_between(members[0].pose, members[-1].pose)] if cluster.relation == TALKING else []


def _between(one: Pose, other: Pose) -> Spot:
    """The line on which two who talk see each other, as an outline, so that nobody stands there."""
    dx, dy = other.x - one.x, other.y - one.y
    middle = Pose((one.x + other.x) / 2, (one.y + other.y) / 2, angle_of(dy, dx))
    return Rectangle(math.sqrt(dx * dx + dy * dy), 0.1), middle


def extent(cluster: Cluster) -> float:
    """How far a cluster reaches from its origin, m: the further, the harder it is to place."""
    return max(math.sqrt(m.pose.x * m.pose.x + m.pose.y * m.pose.y) + shape_of(m).reach for m in cluster.members)


def _posed(cluster: Cluster, pose: Pose, rng: RandomStream) -> tuple[Entity, ...]:
    """The members in world coordinates, at a file's precision; `pose` is the cluster's or that of its fixed piece."""
    local = [member.pose for member in cluster.members]
    if cluster.distance is not None:
        local = [Pose(0.0, -cluster.distance.draw(rng), PI / 2)]
    poses = (Pose(*pose.to_world((p.x, p.y)), pose.theta + p.theta).rounded() for p in local)
    return tuple(replace(member, pose=place) for member, place in zip(cluster.members, poses, strict=True))


def keeps_clear(shape: Shape, pose: Pose, gap: float, others: list[Spot]) -> bool:
    """Whether an outline is at least `gap` from all the others; those far off are told by their reach."""
    for other, place in others:
        dx, dy, near = pose.x - place.x, pose.y - place.y, shape.reach + other.reach + gap
        if dx * dx + dy * dy < near * near and shape_gap(shape, pose, other, place) < gap:
            return False
    return True
