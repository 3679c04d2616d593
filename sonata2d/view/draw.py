"""Draws a scene and a snapshot with a brush: on pixels of the picture's size, on larger ones, or on vectors."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import pygame

from ..core.attributes import attribute_text
from ..core.geometry import Point
from ..core.scene import Scene
from ..core.snapshot import Snapshot
from .annotations import SMALL, STRIP, Label, draw_labels, draw_strip, summary
from .brush import Brush
from .canvas import Picture, PixelCanvas
from .figures import draw_way, goal_part, human_parts, robot_part
from .furniture import draw_furniture, half_size
from .landmarks import AREA_WORD, centre_of, draw_landmarks, draw_leaves
from .layers import Layers, draw_gazes, draw_interactions, draw_velocities, draw_zones
from .palette import FAINT, INK, PAPER, WALL, Colour
from .projection import DEFAULT_SIDE, Camera
from .room import draw_room
from .trails import Trails, draw_trails

_FINE, QUICK = 4, 2  # supersampling factors; powers of two, because pygame's smoothscale darkens others slightly
_LABEL, _MIN_LABEL = 0.3, 13  # m and px: font size of ids, and its lower limit
_LARGE = 2_000_000  # px; larger pictures use QUICK


def camera_for(
    scene: Scene,
    *,
    size: tuple[int, int] | None = None,
    scale: float | None = None,
    side: float = DEFAULT_SIDE,
    below: int = 0,
) -> Camera:
    """A camera that sees the whole room.

    Args:
        size, scale: as for `picture`.
        side: longer side of a picture of neither size nor scale, at most, px.
        below: pixels of the height that are left free for caption and legend.
    """
    corners = [*scene.polygon, *(end for wall in scene.walls for end in (wall.start, wall.end))]
    return Camera.fit(corners, size=(size[0], size[1] - below) if size else None, scale=scale, side=side)


def backdrop(
    scene: Scene, camera: Camera, layers: Layers, *, outside: Colour | None = PAPER, fine: int | None = None
) -> pygame.Surface:
    """Draw the room and its furniture at `fine` times the camera's resolution.

    Args:
        outside: colour around the room; None leaves it transparent.
        fine: supersampling factor; by default 4, or 2 for a large picture.
    """
    fine = fine or (_FINE if camera.size[0] * camera.size[1] < _LARGE else QUICK)
    supersampled = camera.supersampled(fine)
    surface = pygame.Surface(supersampled.size, pygame.SRCALPHA if outside is None else 0, 32)
    surface.fill(outside if outside is not None else (*WALL, 0))
    draw_still_parts(Brush(PixelCanvas(surface, fine), supersampled, fine), scene, grid=layers.grid)
    return surface


def draw_still_parts(brush: Brush, scene: Scene, *, grid: bool) -> None:
    """Draw the room, with grid lines if `grid` is set, and the objects in it."""
    draw_room(brush, scene, grid=grid)
    draw_landmarks(brush, scene)
    draw_furniture(brush, scene)


def draw_on_backdrop(
    surface: pygame.Surface, camera: Camera, snapshot: Snapshot, layers: Layers, trails: Trails | None = None
) -> None:
    """Draw everything that moves on a surface of a whole multiple of the camera's resolution."""
    fine = surface.get_width() // camera.size[0]
    draw_moving_parts(Brush(PixelCanvas(surface, fine), camera.supersampled(fine), fine), snapshot, layers, trails)


def draw_moving_parts(
    brush: Brush, snapshot: Snapshot, layers: Layers, trails: Trails | None, *, cut_zones: bool = True
) -> None:
    """Draw everything that moves, and the goal.

    Args:
        trails: past paths, which are above the goal and below everything else.
        cut_zones: whether zones end at the outline of the room.
    """
    scene, unmeasured, humans = snapshot.scene, snapshot.scene.unmeasured, list(snapshot.humans)
    if "headings" in unmeasured:  # and with them the directions of the shoulders
        humans = [replace(human, breadth=2 * human.radius, length=0.0) for human in humans]
    draw_leaves(brush, snapshot.doors)
    if layers.goal and "goal" not in unmeasured:
        for robot, other in zip(snapshot.robots, scene.robots, strict=True):
            draw_way(brush, robot.position, other.goal.position)
            brush.stamp(other.goal.position, goal_part(other.goal, is_other=True))
        brush.stamp(snapshot.goal.position, goal_part(snapshot.goal))
    draw_trails(brush, trails, robot="robot" not in unmeasured)
    if layers.zones:
        draw_zones(brush, humans, scene.polygon if cut_zones else ())
    draw_interactions(brush, snapshot, humans, spaces=layers.zones, links=layers.links)
    if layers.gaze and "heads" not in unmeasured:
        draw_gazes(brush, humans, snapshot)
    ignoring = {human.id for human in scene.humans if human.reacts_to_robot == 0.0}
    for human in humans:
        parts = human_parts(human, snapshot.time, ignores_robot=human.id in ignoring, unmeasured=unmeasured)
        for position, of_human in parts:
            brush.stamp(position, *of_human)
    contacts = snapshot.contacts_of_robots or [()] * len(snapshot.robots)
    for robot, touched in zip(snapshot.robots, contacts, strict=True):
        brush.stamp(robot.position, robot_part(robot, touches=bool(touched), is_other=True))
    if "robot" not in unmeasured:
        brush.stamp(snapshot.robot.position, robot_part(snapshot.robot, touches=bool(snapshot.contacts)))
    if layers.velocities:
        draw_velocities(brush, snapshot, humans)


def draw_words(canvas: Picture, camera: Camera, snapshot: Snapshot, layers: Layers) -> None:
    """Draw ids and attributes on a picture of its final size, as far as the layers have them."""
    scene = snapshot.scene
    given = {}
    if layers.attributes and scene.attributes:
        given = {human.id: attribute_text(human.attributes) for human in scene.humans}
        given |= {piece.id: attribute_text(piece.attributes) for piece in scene.furniture}

    def label(id: int, position: Point, radius: float, colour: Colour = INK) -> Iterator[Label]:
        words = [str(id)] if layers.ids else []
        words += [given[id]] if given.get(id) else []
        if words:
            yield Label("  ".join(words), camera.to_pixels(position), radius * camera.scale, colour)

    labels: list[Label] = []
    for area in scene.areas if layers.attributes else ():
        if words := attribute_text(area.attributes):
            labels.append(Label(words, camera.to_pixels(centre_of(area)[0]), AREA_WORD / 2 * camera.scale, FAINT))
    for human in snapshot.humans:
        labels += label(human.id, human.pose.position, max(human.breadth, human.length) / 2)
    for robot in snapshot.robots:
        labels += label(robot.id, robot.position, robot.radius)
    for item in snapshot.objects:
        labels += label(item.id, item.pose.position, 0.7 * min(half_size(item)), FAINT)
    if labels:
        draw_labels(canvas, labels, min(max(round(_LABEL * camera.scale), _MIN_LABEL), SMALL))


def draw_caption(
    canvas: Picture, camera: Camera, snapshot: Snapshot, trails: Trails | None, caption: str | None, outcome: str | None
) -> None:
    """Draw the strip below a picture; arguments as for `picture`."""
    span = None
    # the colours of a tail, or of a robot that is not drawn, need no explanation
    if trails is not None and len(trails.time) and not trails.is_tail and "robot" not in snapshot.scene.unmeasured:
        span = float(trails.time[0]), float(trails.time[-1])
    text = summary(snapshot, outcome) if caption is None else caption
    draw_strip(canvas, (camera.size[0], camera.size[1] + STRIP), text, camera.scale, span)
