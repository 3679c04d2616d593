"""The bodies of a scene in the physics engine."""

from __future__ import annotations

import math
import weakref
from collections.abc import Sequence
from typing import Any

import pymunk
from pymunk._chipmunk_cffi import ffi, lib

from ..core.doors import InteriorDoor
from ..core.entities import Furniture, Human
from ..core.geometry import Disc, Edge, Outline, Point
from ..core.scene import Scene
from .kernel.step import MASS, ROBOT_MASS

CObject = Any  # an object of the engine: pymunk's classes check and book each one, which takes most of the time

_ALL = 0xFFFFFFFF  # categories of shapes
OVERLAP_LEFT = 0.0  # fraction of an overlap after a substep; pymunk's 0.94 lets bodies that turn sink in too deep


class Bodies:
    """Bodies and shapes of pedestrians, robots, walls and furniture.

    Only a space built anew, in a fixed order, gives the same bits for the same input. Bodies and shapes are kept, and
    leave the space before: an episode that begins again need not make them again.

    Args:
        scene: initial layout.

    Attributes:
        bodies: of the pedestrians, then of the robots.
        torsos: shapes of the pedestrians; the kernel turns them in every substep.
        outlines: shapes of each robot that is no disc: its sides, then its corners; the kernel turns them too.
        corners: of such robots, in the body frame, m.
        leaves: shapes of each door that moves: a segment and the circles at its ends, which the kernel moves.
    """

    def __init__(self, scene: Scene) -> None:
        self.leaves = [_leaf_of(door) for door in scene.moving_doors]
        self._static = _static_shapes_of(scene) + [shape for leaf in self.leaves for shape in leaf]
        self._start: list[tuple[Point, Point]] = [(human.pose.position, human.velocity) for human in scene.humans]
        robots = [robot for robot, _ in scene.tasks]
        self._start += [(robot.pose.position, (0.0, 0.0)) for robot in robots]
        self.bodies = [_body(is_recorded=is_recorded(human)) for human in scene.humans]
        chassis = [_body(ROBOT_MASS) for _ in robots]
        self.bodies += chassis
        self._cores = [human.shape.core for human in scene.humans]
        self.torsos = [
            _segment(body, core[0], core[1], human.radius)
            for body, core, human in zip(self.bodies, self._cores, scene.humans, strict=False)
        ]
        self._headings = [robot.pose.direction for robot in robots]
        self.corners = [robot.outline.core if len(robot.outline.core) > 1 else () for robot in robots]
        self.outlines = [_sides_of(robot.outline, body) for robot, body in zip(robots, chassis, strict=True)]
        self._moving = [*self.torsos]
        for robot, body, outline in zip(robots, chassis, self.outlines, strict=True):
            shapes = outline or [_circle(body, (0.0, 0.0), robot.radius)]
            if len(robots) > 1:  # robots keep off each other by the kernel alone
                _set_group(shapes, _seat_group(len(scene.furniture)))
            self._moving += shapes
        self._iterations, self._contents = scene.rules.iterations, _Contents(self._static + self._moving, self.bodies)
        weakref.finalize(self, self._contents.leave)

    def new_space(self) -> pymunk.Space:
        """A space with everything where it starts: bodies of the pedestrians, then of the robots."""
        self._contents.leave()
        for body, (position, velocity) in zip(self.bodies, self._start, strict=True):
            lib.cpBodySetPosition(body, position)
            lib.cpBodySetVelocity(body, velocity)
            lib.cpBodySetForce(body, (0.0, 0.0))
        for torso, core in zip(self.torsos, self._cores, strict=True):
            lib.cpSegmentShapeSetEndpoints(torso, core[0], core[1])
        for (c, s), core, outline in zip(self._headings, self.corners, self.outlines, strict=True):
            corners, count = [(x * c - y * s, x * s + y * c) for x, y in core], len(core)
            for k, corner in enumerate(corners):
                lib.cpSegmentShapeSetEndpoints(outline[k], corner, corners[(k + 1) % count])
                lib.cpCircleShapeSetOffset(outline[count + k], corner)
        space = self._contents.space = pymunk.Space()
        space.iterations, space.collision_slop = self._iterations, 0.001  # pymunk's default slop is 0.1 m
        space.collision_bias = OVERLAP_LEFT
        ground = lib.cpSpaceGetStaticBody(space._space)
        for shape in self._static:
            lib.cpShapeSetBody(shape, ground)
            lib.cpSpaceAddShape(space._space, shape)
        for body in self.bodies:
            lib.cpSpaceAddBody(space._space, body)
        for shape in self._moving:
            lib.cpSpaceAddShape(space._space, shape)
        return space

    def set_seat(self, k: int, seat: int) -> None:
        """Let pedestrian k collide with all seats but one, an index of `Scene.furniture`, or with all of them, -1."""
        _set_group([self.torsos[k]], _seat_group(seat) if seat >= 0 else 0)


def _leaf_of(door: InteriorDoor) -> list[CObject]:
    """The leaf of a door: a segment, and a circle at each end."""
    start, end, radius = door.leaf(door.opening)
    return [_segment(ffi.NULL, start, end, radius), _circle(ffi.NULL, start, radius), _circle(ffi.NULL, end, radius)]


class _Contents:
    """Shapes and bodies, and the space that they are in.

    They must have left the space before they or the space are freed. A finalizer of `Bodies` sees to it, and holds this
    object until then: in a cycle of garbage, `__del__` would run after the destructors of the C objects.
    """

    def __init__(self, shapes: list[CObject], bodies: list[CObject]) -> None:
        self._shapes, self._bodies = shapes, bodies
        self.space: pymunk.Space | None = None

    def leave(self) -> None:
        """Take everything out of the space; an interrupted call, or one while the space is filled, can be repeated."""
        if self.space is not None:
            space = self.space._space
            for shape in self._shapes:
                if lib.cpSpaceContainsShape(space, shape):
                    lib.cpSpaceRemoveShape(space, shape)
            for body in self._bodies:
                if lib.cpSpaceContainsBody(space, body):
                    lib.cpSpaceRemoveBody(space, body)
            self.space = None


def _sides_of(outline: Outline, body: CObject) -> list[CObject]:
    """The sides of an outline as segments, then its corners as circles, as of furniture; nothing for a disc."""
    corners = list(outline.core)
    if len(corners) == 1:
        return []
    sides = zip(corners, [*corners[1:], corners[0]], strict=True)
    return [
        *(_segment(body, start, end, outline.rounding) for start, end in sides),
        *(_circle(body, corner, outline.rounding) for corner in corners),
    ]


def is_recorded(human: Human) -> bool:
    """Whether a pedestrian follows a track."""
    return human.behaviour == "recorded"


def _static_shapes_of(scene: Scene) -> list[CObject]:
    """The walls and the furniture of a scene, and the doors that nobody opens."""
    shapes = _static_segments([(w.start, w.end, 0.0) for w in scene.straight_walls.values()])
    shapes += _static_segments(scene.fixed_leaves)
    for k, piece in enumerate(scene.furniture):
        if piece.on is None:
            solid = _static_shapes(piece)
            if piece.is_seat:
                _set_group(solid, _seat_group(k))
            shapes += solid
    return shapes


def _seat_group(index: int) -> int:
    """The group of a seat and of the pedestrian on it: shapes of one group do not collide; 0 is no group.

    Args:
        index: of the seat in the scene's furniture.
    """
    return index + 1


def _set_group(shapes: Sequence[CObject], group: int) -> None:
    """Let shapes collide with all but those of one group; 0 is no group."""
    for shape in shapes:
        lib.cpShapeSetFilter(shape, (group, _ALL, _ALL))


def _static_shapes(furniture: Furniture) -> list[CObject]:
    """The outline of an object.

    A rectangle consists of four segments. A polygon would not do: the engine misses its contacts with torsos, which are
    segments that turn.
    """
    if isinstance(furniture.shape, Disc):
        return [_circle(ffi.NULL, furniture.pose.position, furniture.shape.radius)]
    return _static_segments(furniture.shape.edges(furniture.pose))


def _static_segments(edges: Sequence[Edge]) -> list[CObject]:
    """Segments, and a circle at each of their ends.

    The engine misses contacts between the end of one segment and the side of another, such as a door jamb and a torso.
    """
    ends = dict.fromkeys((point, radius) for start, end, radius in edges for point in (start, end))
    segments = [_segment(ffi.NULL, *edge) for edge in edges]
    return [*segments, *(_circle(ffi.NULL, point, radius) for point, radius in ends)]


def _segment(body: CObject, start: Point, end: Point, radius: float) -> CObject:
    return ffi.gc(lib.cpSegmentShapeNew(body, start, end, radius), lib.cpShapeFree)


def _circle(body: CObject, offset: Point, radius: float) -> CObject:
    return ffi.gc(lib.cpCircleShapeNew(body, radius, offset), lib.cpShapeFree)


def _body(mass: float = MASS, *, is_recorded: bool = False) -> CObject:
    """A body that slides but does not rotate: headings of pedestrians and robot are not kept by the engine.

    The body of a recorded pedestrian is kinematic: only its own velocity moves it.
    """
    return ffi.gc(lib.cpBodyNewKinematic() if is_recorded else lib.cpBodyNew(mass, math.inf), lib.cpBodyFree)
