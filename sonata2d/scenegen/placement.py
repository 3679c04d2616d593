"""Placement of clusters of entities: random poses are tried until all outlines keep their clearances."""

from __future__ import annotations

import math

import numpy as np

from ..core.entities import Furniture, Human
from ..core.geometry import Disc, Point, Pose, Rectangle, Shape, canonical_angle, quantised
from ..core.outlines import COLUMNS, THETA, outline_row
from ..core.portable_math import PI, angle_of
from ..core.relations import TALKING
from ..core.rng import RandomStream
from ..core.vectors import X, Y, length
from .floor_plans import FloorPlan
from .sampling import Entity, EntityCluster, shape_of
from .scenario.config import ScenarioConfig

_SMALLEST_O_SPACE = 0.05  # m, radius that is kept free where large bodies leave less
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
        self._corners = {area.name: area.corners for area in config.areas}
        self._shares = {area.name: area.share for area in config.areas if area.share}
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
            rng: random stream of the poses.

        Returns:
            The poses of the members in the world frame; None if `max_attempts` poses failed.
        """
        gap, target = self.config.clearance, None if cluster.fixed is None else fixed[cluster.fixed].pose
        members = cluster.members
        others, local = self._rows[: self._count], [member.pose for member in members]
        # a laptop on a table has no outline of its own
        bodies = [(k, shape_of(member)) for k, member in enumerate(members) if getattr(member, "on", None) is None]
        rows = np.array([outline_row(shape, local[k], self._wall_gap(members[k])) for k, shape in bodies])
        for _ in range(self.config.max_attempts):
            x, y = target.position if target else cluster.position or self._sample_point(rng)
            theta = target.theta if target else cluster.yaw.draw(rng)
            if cluster.distance is not None:  # at the access side (-y) of fixed furniture, facing it
                local = [Pose(0.0, -cluster.distance.draw(rng), PI / 2)]
                rows[0, X], rows[0, Y], rows[0, THETA] = local[0].x, local[0].y, local[0].theta
            if not self.plan.has_space_at(x, y, theta, rows, others, gap):
                continue
            pose = Pose(x, y, theta)
            poses = [_pose_in_world(pose, member) for member in local]
            # no wall may separate interacting members, or a member from its target
            if cluster.relation and not self.plan.sees(poses[0].position, (target or poses[-1]).position):
                continue
            if self._is_o_space_free(cluster, poses, pose):
                self.occupy([(shape, poses[k]) for k, shape in bodies] + _interaction_space(cluster, poses, pose))
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

    def sample_point(self, rng: RandomStream, area: str | None = None) -> Point:
        """Draw a point from one of the areas, by its name, or from the bounding box of the room, m."""
        return self.plan.sample_point(rng, None if area is None else self._corners[area])

    def _sample_point(self, rng: RandomStream) -> Point:
        """Draw a point where drawn entities may be placed, m."""
        shares = self._shares
        return self.sample_point(rng, rng.choice(list(shares), list(shares.values())) if shares else None)

    def _is_o_space_free(self, cluster: EntityCluster, poses: list[Pose], origin: Pose) -> bool:
        """Return whether all members see the centre of their o-space, and nothing stands in it."""
        if not cluster.o_space:
            return True
        gap = self.config.clearance
        largest = max(shape_of(member).circumradius for member in cluster.members)
        o_space = Disc(max(cluster.o_space - largest, _SMALLEST_O_SPACE))
        sight_lines = [(*pose.position, *origin.position) for pose in poses]
        return self.plan.has_space([outline_row(o_space, origin, gap)], self._rows[: self._count], gap, sight_lines)

    def _wall_gap(self, member: Entity) -> float:
        if isinstance(member, Human):
            return max(self.config.person.wall_distance - member.shape.circumradius, self.config.clearance)
        return self.config.clearance


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
    return max(length(m.pose.x, m.pose.y) + m.shape.circumradius for m in cluster.members)


def _pose_in_world(origin: Pose, pose: Pose) -> Pose:
    """Return a pose that is relative to another one in the world frame, rounded to the precision of files."""
    x, y = origin.to_world(pose.position)
    return Pose(quantised(x), quantised(y), canonical_angle(origin.theta + pose.theta))
