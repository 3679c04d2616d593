"""The bodies of a scene in the physics engine."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress

import pymunk
from pymunk._chipmunk_cffi import lib

from ..core.entities import Furniture, Human
from ..core.geometry import Disc, Edge, Outline, Point
from ..core.scene import Scene
from .kernel.step import MASS, ROBOT_MASS

OVERLAP_LEFT = 0.0  # fraction of an overlap after a substep; pymunk's 0.94 lets bodies that turn sink in too deep


class Bodies:
    """Bodies and shapes of pedestrians, robots, walls and furniture.

    Only a space built anew, in a fixed order, gives the same bits for the same input. Bodies and shapes are kept, and
    leave the space before: an episode that begins again need not make them again.

    Args:
        scene: initial layout.

    Attributes:
        torsos: shapes of the pedestrians; the kernel turns them in every substep.
        outlines: shapes of each robot that is no disc: its sides, then its corners; the kernel turns them too.
        corners: of such robots, in the body frame, m.
    """

    def __init__(self, scene: Scene) -> None:
        self._ground = pymunk.Body(body_type=pymunk.Body.STATIC)
        self._static = _static_shapes_of(scene, self._ground)
        self._start: list[tuple[Point, Point]] = [(human.pose.position, human.velocity) for human in scene.humans]
        robots = [robot for robot, _ in scene.tasks]
        self._start += [(robot.pose.position, (0.0, 0.0)) for robot in robots]
        self._bodies = [_body(is_recorded=is_recorded(human)) for human in scene.humans]
        chassis = [_body(ROBOT_MASS) for _ in robots]
        self._bodies += chassis
        self._shoulders = [human.shoulder for human in scene.humans]
        self.torsos = [
            pymunk.Segment(body, (0.0, human.shoulder), (0.0, -human.shoulder), human.radius)
            for body, human in zip(self._bodies, scene.humans, strict=False)
        ]
        self._headings = [robot.pose.direction for robot in robots]
        self.corners = [robot.outline.core if len(robot.outline.core) > 1 else () for robot in robots]
        self.outlines = [_sides_of(robot.outline, body) for robot, body in zip(robots, chassis, strict=True)]
        self._moving: list[pymunk.Shape] = [*self.torsos]
        for robot, body, outline in zip(robots, chassis, self.outlines, strict=True):
            shapes = outline or [pymunk.Circle(body, robot.radius)]
            if len(robots) > 1:  # robots keep off each other by the kernel alone
                for shape in shapes:
                    shape.filter = pymunk.ShapeFilter(group=_seat_group(len(scene.furniture)))
            self._moving += shapes
        self._iterations, self._space = scene.rules.iterations, pymunk.Space()

    def new_space(self) -> tuple[pymunk.Space, list[pymunk.Body]]:
        """A space with everything where it starts; and its bodies, those of the pedestrians, then of the robots."""
        self._leave_space()
        for body, (position, velocity) in zip(self._bodies, self._start, strict=True):
            body.position, body.velocity, body.force = position, velocity, (0.0, 0.0)
        for torso, shoulder in zip(self.torsos, self._shoulders, strict=True):
            torso.unsafe_set_endpoints((0.0, shoulder), (0.0, -shoulder))
        for (c, s), core, outline in zip(self._headings, self.corners, self.outlines, strict=True):
            corners, count = [(x * c - y * s, x * s + y * c) for x, y in core], len(core)
            for k, corner in enumerate(corners):
                lib.cpSegmentShapeSetEndpoints(outline[k]._shape, corner, corners[(k + 1) % count])
                lib.cpCircleShapeSetOffset(outline[count + k]._shape, corner)
        space = self._space = pymunk.Space()
        space.iterations, space.collision_slop = self._iterations, 0.001  # pymunk's default slop is 0.1 m
        space.collision_bias = OVERLAP_LEFT
        # By the engine's own functions: pymunk's `add` checks and books each object, which takes most of the time.
        ground = lib.cpSpaceGetStaticBody(space._space)
        for shape in self._static:
            lib.cpShapeSetBody(shape._shape, ground)
            lib.cpSpaceAddShape(space._space, shape._shape)
        for body in self._bodies:
            lib.cpSpaceAddBody(space._space, body._body)
        for shape in self._moving:
            lib.cpSpaceAddShape(space._space, shape._shape)
        return space, self._bodies

    def _leave_space(self) -> None:
        """Take everything out of the space."""
        space, shapes = self._space._space, [*self._static, *self._moving]
        if lib.cpShapeGetSpace(shapes[-1]._shape) == space:
            for shape in shapes:
                lib.cpSpaceRemoveShape(space, shape._shape)
            for body in self._bodies:
                lib.cpSpaceRemoveBody(space, body._body)

    def __del__(self) -> None:
        # pymunk frees a space in the thread that drops it, and shapes where the collector of garbage runs, which may be
        # another thread at the same time: both would take the shapes out of the space.
        with suppress(Exception):  # of a constructor that failed, or at the end of the interpreter
            self._leave_space()

    def set_seat(self, k: int, seat: int) -> None:
        """Let pedestrian k collide with all seats but one, an index of `Scene.furniture`, or with all of them, -1."""
        self.torsos[k].filter = pymunk.ShapeFilter(group=_seat_group(seat) if seat >= 0 else 0)


def _sides_of(outline: Outline, body: pymunk.Body) -> list[pymunk.Shape]:
    """The sides of an outline as segments, then its corners as circles, as of furniture; nothing for a disc."""
    corners = list(outline.core)
    if len(corners) == 1:
        return []
    sides = zip(corners, [*corners[1:], corners[0]], strict=True)
    return [
        *(pymunk.Segment(body, start, end, outline.rounding) for start, end in sides),
        *(pymunk.Circle(body, outline.rounding, corner) for corner in corners),
    ]


def is_recorded(human: Human) -> bool:
    """Whether a pedestrian follows a track."""
    return human.behaviour == "recorded"


def _static_shapes_of(scene: Scene, ground: pymunk.Body) -> list[pymunk.Shape]:
    """The walls and the furniture of a scene."""
    shapes = _static_segments(ground, [(w.start, w.end, 0.0) for w in scene.straight_walls.values()])
    for k, piece in enumerate(scene.furniture):
        if piece.on is None:
            solid = _static_shapes(ground, piece)
            if piece.is_seat:
                for shape in solid:
                    shape.filter = pymunk.ShapeFilter(group=_seat_group(k))
            shapes += solid
    return shapes


def _seat_group(index: int) -> int:
    """The group of a seat and of the pedestrian on it: shapes of one group do not collide; 0 is no group.

    Args:
        index: of the seat in the scene's furniture.
    """
    return index + 1


def _static_shapes(ground: pymunk.Body, furniture: Furniture) -> list[pymunk.Shape]:
    """The outline of an object.

    A rectangle consists of four segments. A polygon would not do: the engine misses its contacts with torsos, which are
    segments that turn.
    """
    if isinstance(furniture.shape, Disc):
        return [pymunk.Circle(ground, furniture.shape.radius, furniture.pose.position)]
    return _static_segments(ground, furniture.shape.edges(furniture.pose))


def _static_segments(ground: pymunk.Body, edges: Sequence[Edge]) -> list[pymunk.Shape]:
    """Segments, and a circle at each of their ends.

    The engine misses contacts between the end of one segment and the side of another, such as a door jamb and a torso.
    """
    ends = dict.fromkeys((point, radius) for start, end, radius in edges for point in (start, end))
    segments = [pymunk.Segment(ground, start, end, radius) for start, end, radius in edges]
    return [*segments, *(pymunk.Circle(ground, radius, point) for point, radius in ends)]


def _body(mass: float = MASS, *, is_recorded: bool = False) -> pymunk.Body:
    """A body that slides but does not rotate: headings of pedestrians and robot are not kept by the engine.

    The body of a recorded pedestrian is kinematic: only its own velocity moves it.
    """
    return pymunk.Body(mass, math.inf, pymunk.Body.KINEMATIC if is_recorded else pymunk.Body.DYNAMIC)
