"""Draws a snapshot as a picture, which is a function of snapshot, camera and layers and needs no display.

Everything is drawn at `fine` times the picture's resolution and then made smaller, which smooths all edges. The static
part (`backdrop`) is drawn once and can be passed to each `picture` of the same scene.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import pygame

from ..core.scene import Scene
from ..core.snapshot import Snapshot
from .annotations import SMALL, STRIP, Label, draw_labels, draw_strip, summary
from .brush import Brush
from .canvas import Canvas, PixelCanvas
from .figures import goal_part, human_parts, robot_part
from .furniture import draw_furniture, half_size
from .landmarks import draw_landmarks
from .layers import Layers, draw_gazes, draw_interactions, draw_velocities, draw_zones, thin_walls
from .legend import Legend
from .palette import FAINT, PAPER, WALL, Colour
from .projection import DEFAULT_SIDE, Camera
from .room import FloorPlan, draw_room
from .trails import Trails, draw_trails

FINE, QUICK = 4, 2  # supersampling factors; powers of two, because pygame's smoothscale darkens others slightly
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
    fine = fine or (FINE if camera.size[0] * camera.size[1] < _LARGE else QUICK)
    supersampled = camera.supersampled(fine)
    surface = pygame.Surface(supersampled.size, pygame.SRCALPHA if outside is None else 0, 32)
    surface.fill(outside if outside is not None else (*WALL, 0))
    brush = Brush(PixelCanvas(surface, fine), supersampled, fine)
    draw_room(brush, FloorPlan.of(scene), grid=layers.grid)
    draw_landmarks(brush, scene)
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
        size: width and height, caption and legend included, px.
        scale: pixels per metre, if no size is given; by default 80, less for a large room.
        layers: what to show; by default `Layers()`. A legend that would take more than a quarter of a given size is
            left out.
        trails: past paths of robot and pedestrians.
        caption: text below the picture; by default scenario, seed, episode and time.
        outcome: how the episode ended; added to the default caption.
        camera: replaces the one that fits size and scale.
        room: `backdrop` of the same scene, camera and layers, which is then not drawn again; it is not modified.

    Raises:
        RenderError: a side of the picture would be outside 16 to 6000 px.
    """
    layers = layers or Layers()
    marks = trails is not None and trails.has_marks
    legend = Legend.of([snapshot], layers, paths=trails is not None, time_marks=marks).fitting(size)
    if camera is None:
        below = height_below(layers, legend, size[0]) if size else 0
        camera = camera_for(snapshot.scene, size=size, scale=scale, below=below)
    surface = room.copy() if room is not None else backdrop(snapshot.scene, camera, layers)
    draw_on_backdrop(surface, camera, snapshot, layers, trails)
    finished = shrunk(surface, camera.size, height_below(layers, legend, camera.size[0]))
    canvas = PixelCanvas(finished)
    annotate(canvas, camera, snapshot, layers, trails, caption, outcome)
    legend.draw(canvas, camera.size[1] + height_below(layers), camera.size[0])
    return finished


def height_below(layers: Layers, legend: Legend = Legend(), width: int = 0) -> int:  # noqa: B008  frozen
    """Height in pixels of the caption, if the layers have one, and of the legend of a picture of a width."""
    return (STRIP if layers.caption else 0) + legend.height(width)


def shrunk(surface: pygame.Surface, size: tuple[int, int], below: int) -> pygame.Surface:
    """Make a surface smaller, which smooths all edges; below it, that many pixels are left free."""
    finished = pygame.Surface((size[0], size[1] + below), 0, 32)
    finished.fill(PAPER)
    pygame.transform.smoothscale(surface, size, finished.subsurface((0, 0, *size)))
    return finished


def annotate(
    canvas: Canvas,
    camera: Camera,
    snapshot: Snapshot,
    layers: Layers,
    trails: Trails | None,
    caption: str | None,
    outcome: str | None,
) -> None:
    """Draw the text of a picture of its final size, apart from the legend; arguments as for `picture`."""
    draw_annotations(Brush(canvas, camera), snapshot, layers)
    if layers.caption:
        text = summary(snapshot, outcome) if caption is None else caption
        has_span = trails is not None and not trails.is_tail and "robot" not in snapshot.scene.unmeasured
        span = trails.span if trails is not None and has_span else None
        draw_strip(canvas, (camera.size[0], camera.size[1] + STRIP), text, camera.scale, span)


def draw_on_backdrop(
    surface: pygame.Surface, camera: Camera, snapshot: Snapshot, layers: Layers, trails: Trails | None = None
) -> None:
    """Draw everything that moves on a surface of a whole multiple of the camera's resolution."""
    fine = surface.get_width() // camera.size[0]
    brush = Brush(PixelCanvas(surface, fine), camera.supersampled(fine), fine)
    draw_moving(brush, snapshot, layers, partial(draw_trails, trails=trails))


def draw_moving(
    brush: Brush, snapshot: Snapshot, layers: Layers, draw_paths: Callable[..., None], *, cut_zones: bool = True
) -> None:
    """Draw everything that moves, and the goal.

    Args:
        draw_paths: draws the past paths, which are above the goal and below everything else; it takes the brush, and
            whether to draw the robot's path as `robot`.
        cut_zones: whether zones end at the outline of the room.
    """
    humans, unmeasured = list(snapshot.humans), snapshot.scene.unmeasured
    if "headings" in unmeasured:  # and with them the directions of the shoulders
        humans = [replace(human, breadth=2 * human.radius) for human in humans]
    if layers.goal and "goal" not in unmeasured:
        brush.stamp(snapshot.goal.position, goal_part(snapshot.goal))
    draw_paths(brush, robot="robot" not in unmeasured)
    if layers.zones:
        draw_zones(brush, humans, snapshot.scene.outline if cut_zones else None)
    draw_interactions(brush, snapshot, humans, spaces=layers.zones, links=layers.links)
    if layers.gaze and "heads" not in unmeasured:
        draw_gazes(brush, humans, thin_walls(snapshot.scene))
    ignoring = {human.id for human in snapshot.scene.humans if human.reacts_to_robot == 0.0}
    for human in humans:
        parts = human_parts(human, snapshot.time, ignores_robot=human.id in ignoring, unmeasured=unmeasured)
        brush.stamp(human.pose.position, *parts)
    if "robot" not in unmeasured:
        brush.stamp(snapshot.robot.position, robot_part(snapshot.robot, touches=bool(snapshot.contacts)))
    if layers.velocities:
        draw_velocities(brush, snapshot, humans)


def draw_annotations(brush: Brush, snapshot: Snapshot, layers: Layers) -> None:
    """Draw the ids on a picture of its final size."""
    if not layers.ids:
        return
    camera = brush.camera
    labels = [
        Label(str(human.id), camera.to_pixels(human.pose.position), human.breadth / 2 * camera.scale)
        for human in snapshot.humans
    ]
    labels += [
        Label(str(item.id), camera.to_pixels(item.pose.position), 0.7 * min(half_size(item)) * camera.scale, FAINT)
        for item in snapshot.objects
    ]
    draw_labels(brush.canvas, labels, min(max(round(_LABEL * camera.scale), _MIN_LABEL), SMALL))
