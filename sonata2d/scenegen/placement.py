"""Placement of clusters of entities: random poses are tried until all outlines keep their clearances."""

from __future__ import annotations

import math

import numpy as np

from ..core.entities import TALKING, Furniture, Human
from ..core.geometry import Disc, Pose, Rectangle, Shape
from ..core.outlines import COLUMNS, outline_row
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
        reserved: outlines of the given start and goal of the robot, which new entities must keep clear of.
        furniture: outlines of the fixed furniture.
    """

    def __init__(
        self, plan: FloorPlan, config: ScenarioConfig, reserved: list[PlacedShape], furniture: list[PlacedShape]
    ) -> None:
        self.plan, self.config = plan, config
        self._rows, self._count = np.empty((64, COLUMNS)), 0  # occupied outlines
        self._reserved = len(reserved)
        self.occupy(reserved + furniture)

    def occupy(self, outlines: list[PlacedShape]) -> None:
        """Add outlines that new entities must keep clear of."""
        for shape, pose in outlines:
            if self._count == len(self._rows):
                self._rows = np.concatenate((self._rows, np.empty_like(self._rows)))
            self._rows[self._count] = outline_row(shape, pose)
            self._count += 1

    def place(self, cluster: EntityCluster, fixed: tuple[Furniture, ...], rng: RandomStream) -> list[Pose] | None:
        """Find a pose for a cluster and occupy its space.

        Args:
            cluster: to place.
            fixed: the fixed furniture, which `cluster.fixed` is an index of.
            rng: random stream of the scene.

        Returns:
            The poses of the members in the world frame; None if `max_attempts` poses failed.
        """
        gap, target = self.config.clearance, None if cluster.fixed is None else fixed[cluster.fixed].pose
        members = cluster.members
        bodies = [
            (k, shape_of(member), self._wall_gap(member)) for k, member in enumerate(members) if _has_body(member)
        ]
        for _ in range(self.config.max_attempts):
            pose = target or self._draw_pose(cluster, rng)
            poses = _poses_in_world(cluster, pose, rng)
            outlines = [outline_row(shape, poses[k], wall_gap) for k, shape, wall_gap in bodies]
            # no wall may separate interacting members, or a member from its target
            sight_lines = [(*poses[0].position, *(target or poses[-1]).position)] if cluster.relation else []
            if not self.plan.has_space(outlines, self._rows[: self._count], gap, sight_lines):
                continue
            if self._is_o_space_free(cluster, poses, pose):
                self.occupy([(shape, poses[k]) for k, shape, _ in bodies] + _interaction_space(cluster, poses, pose))
                return poses
        return None

    def is_free(self, shape: Shape, pose: Pose, gap: float, wall_gap: float, ignores_robot: bool = False) -> bool:
        """Return whether an outline lies in the room, and keeps its distance.

        Args:
            shape, pose: of the outline.
            gap: to all occupied outlines, m.
            wall_gap: to walls, m.
            ignores_robot: whether the given start and goal of the robot do not count.
        """
        others = self._rows[self._reserved if ignores_robot else 0 : self._count]
        return self.plan.has_space([outline_row(shape, pose, wall_gap)], others, gap)

    def _draw_pose(self, cluster: EntityCluster, rng: RandomStream) -> Pose:
        if cluster.position is not None:
            return Pose(*cluster.position, cluster.yaw.draw(rng))
        return Pose(*self.plan.sample_point(rng), cluster.yaw.draw(rng))

    def _is_o_space_free(self, cluster: EntityCluster, poses: list[Pose], origin: Pose) -> bool:
        """Return whether all members see the centre of their o-space, and nothing stands in it."""
        if not cluster.o_space:
            return True
        gap = self.config.clearance
        o_space = Disc(cluster.o_space - max(shape_of(member).circumradius for member in cluster.members))
        sight_lines = [(*pose.position, *origin.position) for pose in poses]
        return self.plan.has_space([outline_row(o_space, origin, gap)], self._rows[: self._count], gap, sight_lines)

    def _wall_gap(self, member: Entity) -> float:
        if isinstance(member, Human):
            return max(self.config.person.wall_distance - member.radius, self.config.clearance)
        return self.config.clearance


def _has_body(member: Entity) -> bool:
    """Return whether an entity stands on the floor; a laptop on a table does not."""
    return isinstance(member, Human) or member.on is None


def _interaction_space(cluster: EntityCluster, poses: list[Pose], origin: Pose) -> list[PlacedShape]:
    """Return the space that a talking group or pair shares, as outlines that no other entity may be placed in."""
    if cluster.o_space:
        return [(Disc(cluster.o_space), origin), *((Disc(_TALKER_RADIUS), pose) for pose in poses)]
    return [_sight_line(poses[0], poses[-1])] if cluster.relation == TALKING else []


def _sight_line(first: Pose, second: Pose) -> PlacedShape:
    """Return the line between two positions as a thin rectangle."""
    dx, dy = second.x - first.x, second.y - first.y
    centre = Pose((first.x + second.x) / 2, (first.y + second.y) / 2, angle_of(dy, dx))
    return Rectangle(math.sqrt(dx * dx + dy * dy), _SIGHT_LINE_WIDTH), centre


def cluster_radius(cluster: EntityCluster) -> float:
    """Return the radius of a cluster around its origin, m; large clusters are hard to place, and placed first."""
    return max(math.sqrt(m.pose.x * m.pose.x + m.pose.y * m.pose.y) + shape_of(m).circumradius for m in cluster.members)


def _poses_in_world(cluster: EntityCluster, pose: Pose, rng: RandomStream) -> list[Pose]:
    """Return the poses of the members in the world frame, rounded to the precision of files.

    Args:
        cluster: the members.
        pose: of the cluster, or of the fixed piece of furniture that its member attends to.
        rng: for the distance from fixed furniture.
    """
    local = [member.pose for member in cluster.members]
    if cluster.distance is not None:  # in front (-y) of fixed furniture, facing it
        local = [Pose(0.0, -cluster.distance.draw(rng), PI / 2)]
    return [Pose(*pose.to_world((p.x, p.y)), pose.theta + p.theta).rounded() for p in local]
