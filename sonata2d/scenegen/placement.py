"""Placement of clusters of entities: random poses are tried until all outlines keep their clearances."""

from __future__ import annotations

import math
from dataclasses import replace

from ..core.entities import TALKING, Furniture, Human
from ..core.geometry import Disc, Pose, Rectangle, Shape, shape_gap
from ..core.portable_math import PI, angle_of
from ..core.rng import RandomStream
from .floor_plans import FloorPlan
from .sampling import Entity, EntityCluster, shape_of
from .scenario.config import ScenarioConfig

_TALKER_RADIUS = 0.5  # m, around each member of a talking group: space that is kept free of other entities
_SIGHT_LINE_WIDTH = 0.1  # m, between the members of a talking pair: space that is kept free of other entities

PlacedShape = tuple[Shape, Pose]


class Layout:
    """A room that is being filled with entities.

    Args:
        plan: the room.
        config: clearances and number of attempts.
        occupied: outlines in the room, which new entities must keep clear of; extended by every placement.
    """

    def __init__(self, plan: FloorPlan, config: ScenarioConfig, occupied: list[PlacedShape]) -> None:
        self.plan, self.config, self.occupied = plan, config, occupied

    def place(
        self, cluster: EntityCluster, fixed: tuple[Furniture, ...], rng: RandomStream
    ) -> tuple[Entity, ...] | None:
        """Find a pose for a cluster and occupy its space.

        Args:
            cluster: to place.
            fixed: the fixed furniture, which `cluster.fixed` is an index of.
            rng: random stream of the scene.

        Returns:
            The members in the world frame; None if `max_attempts` poses failed.
        """
        target = None if cluster.fixed is None else fixed[cluster.fixed].pose
        for _ in range(self.config.max_attempts):
            pose = target or self._draw_pose(cluster, rng)
            members = _to_world(cluster, pose, rng)
            outlines = self._free_outlines(cluster, members, target)
            if outlines is not None and self._is_o_space_free(cluster, members, pose):
                self.occupied += outlines + _interaction_space(cluster, members, pose)
                return members
        return None

    def is_free(self, shape: Shape, pose: Pose, gap: float, wall_gap: float) -> bool:
        """Return whether an outline keeps `gap` from all occupied outlines, and `wall_gap` from walls; m."""
        return self.plan.contains_with_gap(shape, pose, wall_gap) and has_clearance(shape, pose, gap, self.occupied)

    def _draw_pose(self, cluster: EntityCluster, rng: RandomStream) -> Pose:
        if cluster.position is not None:
            return Pose(*cluster.position, cluster.yaw.draw(rng))
        return Pose(*self.plan.sample_point(rng), cluster.yaw.draw(rng))

    def _free_outlines(
        self, cluster: EntityCluster, members: tuple[Entity, ...], target: Pose | None
    ) -> list[PlacedShape] | None:
        """Return the outlines of the members that stand on the floor.

        Returns:
            None if one of them is not free, or a wall separates the interacting members or the target.
        """
        if cluster.relation and not self.plan.has_line_of_sight(members[0].pose, target or members[-1].pose):
            return None
        outlines: list[PlacedShape] = []
        for member in members:
            shape, gap = shape_of(member), self.config.clearance
            if isinstance(member, Furniture) and member.on is not None:
                continue
            if not self.is_free(shape, member.pose, gap, self._wall_gap(member)):
                return None
            if not has_clearance(shape, member.pose, gap, outlines):
                return None
            outlines.append((shape, member.pose))
        return outlines

    def _is_o_space_free(self, cluster: EntityCluster, members: tuple[Entity, ...], origin: Pose) -> bool:
        """Return whether all members see the centre of their o-space, and nothing stands in it."""
        if not cluster.o_space:
            return True
        o_space = Disc(cluster.o_space - max(shape_of(member).circumradius for member in members))
        is_visible = all(self.plan.has_line_of_sight(member.pose, origin) for member in members)
        return is_visible and self.is_free(o_space, origin, self.config.clearance, self.config.clearance)

    def _wall_gap(self, member: Entity) -> float:
        if isinstance(member, Human):
            return max(self.config.person.wall_distance - member.radius, self.config.clearance)
        return self.config.clearance


def _interaction_space(cluster: EntityCluster, members: tuple[Entity, ...], origin: Pose) -> list[PlacedShape]:
    """Return the space that a talking group or pair shares, as outlines that no other entity may be placed in."""
    if cluster.o_space:
        return [(Disc(cluster.o_space), origin), *((Disc(_TALKER_RADIUS), member.pose) for member in members)]
    return [_sight_line(members[0].pose, members[-1].pose)] if cluster.relation == TALKING else []


def _sight_line(first: Pose, second: Pose) -> PlacedShape:
    """Return the line between two positions as a thin rectangle."""
    dx, dy = second.x - first.x, second.y - first.y
    centre = Pose((first.x + second.x) / 2, (first.y + second.y) / 2, angle_of(dy, dx))
    return Rectangle(math.sqrt(dx * dx + dy * dy), _SIGHT_LINE_WIDTH), centre


def cluster_radius(cluster: EntityCluster) -> float:
    """Return the radius of a cluster around its origin, m; large clusters are hard to place, and placed first."""
    return max(math.sqrt(m.pose.x * m.pose.x + m.pose.y * m.pose.y) + shape_of(m).circumradius for m in cluster.members)


def _to_world(cluster: EntityCluster, pose: Pose, rng: RandomStream) -> tuple[Entity, ...]:
    """Transform the members to the world frame, rounded to the precision of files.

    Args:
        cluster: to transform.
        pose: of the cluster, or of the fixed piece of furniture that its member attends to.
        rng: for the distance from fixed furniture.
    """
    local = [member.pose for member in cluster.members]
    if cluster.distance is not None:  # in front (-y) of fixed furniture, facing it
        local = [Pose(0.0, -cluster.distance.draw(rng), PI / 2)]
    poses = (Pose(*pose.to_world((p.x, p.y)), pose.theta + p.theta).rounded() for p in local)
    return tuple(replace(member, pose=new) for member, new in zip(cluster.members, poses, strict=True))


def has_clearance(shape: Shape, pose: Pose, gap: float, others: list[PlacedShape]) -> bool:
    """Return whether an outline keeps at least `gap`, m, from all others."""
    for other, other_pose in others:
        dx, dy, near = pose.x - other_pose.x, pose.y - other_pose.y, shape.circumradius + other.circumradius + gap
        # the circumscribed circles are a cheap test that excludes most pairs
        if dx * dx + dy * dy < near * near and shape_gap(shape, pose, other, other_pose) < gap:
            return False
    return True
