"""Draws a snapshot as a picture, which is a function of snapshot, camera and layers and needs no display.

Everything is drawn at `fine` times the picture's resolution and then made smaller, which smooths all edges. The static
part (`backdrop`) is drawn once and can be passed to each `picture` of the same scene.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import pygame

from ..core.geometry import Point
from ..core.scene import Scene
from ..core.snapshot import Snapshot
from .annotations import STRIP, draw_label, draw_legend, draw_strip, summary
from .brush import Brush
from .camera import Camera
from .canvas import PixelCanvas
from .figures import goal_part, human_parts, robot_part
from .furniture import draw_furniture, half_size
from .layers import draw_gazes, draw_interactions, draw_velocities, draw_zones, thin_walls
from .palette import PAPER, WALL, Colour
from .room import FloorPlan, draw_room
from .trails import Trails, draw_trails

FINE, QUICK = 4, 2  # supersampling factors; powers of two, because pygame's smoothscale darkens others slightly
_LARGE = 2_000_000  # px; larger pictures use QUICK


@dataclass(frozen=True, slots=True)
class Layers:
    """What a picture shows besides the room, the pedestrians and the robot."""

    gaze: bool = True
    links: bool = True
    goal: bool = True
    grid: bool = True  # faint lines, 1 m apart
    zones: bool = False  # intimate and personal zones, and the space shared by interacting pedestrians
    velocities: bool = False
    ids: bool = False
    caption: bool = True  # the strip below, with the scale bar
    legend: bool = False  # meaning of the colours


def camera_for(
    scene: Scene, *, size: tuple[int, int] | None = None, scale: float | None = None, strip: int = 0
) -> Camera:
    """A camera that sees the whole room; `strip` pixels of the height are left free for the caption."""
    corners = [*scene.polygon, *(end for wall in scene.walls for end in (wall.start, wall.end))]
    return Camera.fit(corners, size=(size[0], size[1] - strip) if size else None, scale=scale)


def backdrop(
    scene: Scene, camera: Camera, layers: Layers, *, outside: Colour | None = PAPER, fine: int | None = None
) -> pygame.Surface:
    """Draw the room and its furniture at `fine` times the camera's resolution.

    Args:
        outside: colour around the room; None leaves it transparent.
        fine: supersampling factor; by default 4, or 2 for a large picture.
    """
    fine = fine or (FINE if camera.size[0] * camera.size[1] < _LARGE else QUICK)
    supersampled = camera.supersampled(fine)
    surface = pygame.Surface(supersampled.size, pygame.SRCALPHA if outside is None else 0, 32)
    surface.fill(outside if outside is not None else (*WALL, 0))
    brush = Brush(PixelCanvas(surface, fine), supersampled, fine)
    draw_room(brush, FloorPlan.of(scene), grid=layers.grid)
    draw_furniture(brush, scene)
    return surface


def picture(
    snapshot: Snapshot,
    *,
    size: tuple[int, int] | None = None,
    scale: float | None = None,
    layers: Layers | None = None,
    trails: Trails | None = None,
    caption: str | None = None,
    outcome: str | None = None,
    camera: Camera | None = None,
    room: pygame.Surface | None = None,
) -> pygame.Surface:
    """Draw a snapshot.

    Args:
        size: width and height, caption included, px.
        scale: pixels per metre, if no size is given; by default 80, less for a large room.
        layers: what to show; by default `Layers()`.
        trails: past paths of robot and pedestrians.
        caption: text below the picture; by default scenario, seed, episode and time.
        outcome: how the episode ended; added to the default caption.
        camera: replaces the one that fits size and scale.
        room: `backdrop` of the same scene, camera and layers, which is then not drawn again; it is not modified.

    Raises:
        RenderError: a side of the picture would be outside 16 to 6000 px.
    """
    layers = layers or Layers()
    strip = STRIP if layers.caption else 0
    camera = camera or camera_for(snapshot.scene, size=size, scale=scale, strip=strip)
    surface = room.copy() if room is not None else backdrop(snapshot.scene, camera, layers)
    draw_on_backdrop(surface, camera, snapshot, layers, trails)
    finished = shrunk(surface, camera.size, strip)
    annotate(PixelCanvas(finished), camera, snapshot, layers, trails, caption, outcome)
    return finished


def shrunk(surface: pygame.Surface, size: tuple[int, int], strip: int) -> pygame.Surface:
    """Make a surface smaller, which smooths all edges; below it, `strip` pixels are left free for the caption."""
    finished = pygame.Surface((size[0], size[1] + strip), 0, 32)
    finished.fill(PAPER)
    pygame.transform.smoothscale(surface, size, finished.subsurface((0, 0, *size)))
    return finished


def annotate(
    canvas: PixelCanvas,
    camera: Camera,
    snapshot: Snapshot,
    layers: Layers,
    trails: Trails | None,
    caption: str | None,
    outcome: str | None,
) -> None:
    """Draw all text on a picture of its final size; arguments as for `picture`."""
    draw_annotations(Brush(canvas, camera), snapshot, layers)
    if layers.caption:
        text = summary(snapshot, outcome) if caption is None else caption
        span = trails.span if trails and not trails.is_tail else None
        draw_strip(canvas, canvas.surface.get_size(), text, camera.scale, span)


def draw_on_backdrop(
    surface: pygame.Surface, camera: Camera, snapshot: Snapshot, layers: Layers, trails: Trails | None = None
) -> None:
    """Draw everything that moves on a surface of a whole multiple of the camera's resolution."""
    fine = surface.get_width() // camera.size[0]
    brush = Brush(PixelCanvas(surface, fine), camera.supersampled(fine), fine)
    draw_moving(brush, snapshot, layers, partial(draw_trails, trails=trails))


def draw_moving(brush: Brush, snapshot: Snapshot, layers: Layers, draw_paths: Callable[[Brush], None]) -> None:
    """Draw everything that moves, and the goal.

    Args:
        draw_paths: draws the past paths, which are above the goal and below everything else.
    """
    humans = list(snapshot.humans)
    if layers.goal:
        brush.stamp(snapshot.goal.position, goal_part(snapshot.goal))
    draw_paths(brush)
    if layers.zones:
        draw_zones(brush, humans)
    draw_interactions(brush, snapshot, humans, spaces=layers.zones, links=layers.links)
    if layers.gaze:
        draw_gazes(brush, humans, thin_walls(snapshot.scene))
    ignoring = {human.id for human in snapshot.scene.humans if human.reacts_to_robot == 0.0}
    for human in humans:
        brush.stamp(human.pose.position, *human_parts(human, snapshot.time, ignores_robot=human.id in ignoring))
    brush.stamp(snapshot.robot.position, robot_part(snapshot.robot, touches=bool(snapshot.contacts)))
    if layers.velocities:
        draw_velocities(brush, snapshot, humans)


def draw_annotations(brush: Brush, snapshot: Snapshot, layers: Layers) -> None:
    """Draw ids and legend on a picture of its final size."""
    canvas, camera = brush.canvas, brush.camera
    if layers.ids:
        for human in snapshot.humans:
            draw_label(canvas, str(human.id), camera.to_pixels(_above(camera, human.pose.position, human.radius)))
        for item in snapshot.objects:
            place = _above(camera, item.pose.position, 0.7 * min(half_size(item)))
            draw_label(canvas, str(item.id), camera.to_pixels(place))
    if layers.legend:
        draw_legend(canvas, camera.size, [human.activity for human in snapshot.humans])


def _above(camera: Camera, place: Point, distance: float) -> Point:
    """The world point at a distance (m) above another one in the picture."""
    return place[0] + distance * camera.up[0], place[1] + distance * camera.up[1]
