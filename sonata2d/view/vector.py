"""One look as a picture for a page: PNG, or SVG whose shapes stay shapes."""

from __future__ import annotations

from pathlib import Path

import pygame

from ..core.devices import View
from ..core.snapshot import Snapshot
from ..errors import RenderError
from .brush import Brush
from .camera import Camera
from .caption import STRIP, draw_strip, summary
from .draw import Layers, camera_for, draw_all, draw_over, picture, present
from .palette import PAPER
from .room import FloorPlan, draw_furniture, draw_room
from .still import save_surface
from .svg import Svg
from .trails import Trails


def save_moment(
    path: str | Path,
    snapshot: Snapshot,
    *,
    view: View = "top",
    size: tuple[int, int] | None = (1280, 800),
    scale: float | None = None,
    layers: Layers | None = None,
    trails: Trails | None = None,
    caption: str | None = None,
    outcome: str | None = None,
) -> None:
    """Write one look as `.png` or `.svg`, told by the name.

    Args:
        view: `top`, the whole room; or `follow`, from behind the robot, which looks up in the picture.
        size: width and height, pixels, caption included; without it, what the scale asks (not for `follow`).
        scale: pixels a metre of the whole room, if no size is given.
        layers, trails, caption, outcome: as for `picture`.

    Raises:
        RenderError: the name ends otherwise, the size makes no picture, or the file cannot be written.
    """
    suffix, layers = Path(path).suffix.lower(), layers or Layers()
    if suffix not in (".png", ".svg"):
        raise RenderError(f"{path}: one look is written as PNG or SVG; end the name in .png or .svg")
    camera = _camera(snapshot, view, size, scale, STRIP if layers.caption else 0)
    if suffix == ".png":
        drawn = picture(snapshot, layers=layers, trails=trails, caption=caption, outcome=outcome, camera=camera)
        save_surface(drawn, path)
    else:
        vectors(snapshot, camera, layers, trails, caption=caption, outcome=outcome).write(path)


def vectors(
    snapshot: Snapshot,
    camera: Camera,
    layers: Layers,
    trails: Trails | None = None,
    *,
    caption: str | None = None,
    outcome: str | None = None,
) -> Svg:
    """The same as `picture`, in vectors."""
    (width, height), strip = camera.size, STRIP if layers.caption else 0
    canvas = Svg((width, height + strip))
    canvas.rectangle(PAPER, pygame.Rect(0, 0, width, height + strip))
    brush = Brush(canvas, camera)
    with canvas.window(camera.size):
        draw_room(brush, FloorPlan.of(snapshot.scene), grid=layers.grid)
        draw_furniture(brush, snapshot.scene)
        draw_all(brush, snapshot, layers, trails)
        draw_over(brush, snapshot, present(snapshot), layers)
    if strip:
        text = summary(snapshot, outcome) if caption is None else caption
        span = trails.span if trails and not trails.is_tail else None
        draw_strip(canvas, (width, height + strip), text, camera.scale, span)
    return canvas


def _camera(snapshot: Snapshot, view: View, size: tuple[int, int] | None, scale: float | None, strip: int) -> Camera:
    if view == "top":
        return camera_for(snapshot.scene, size=size, scale=scale, strip=strip)
    if size is None:
        raise RenderError("a picture from behind the robot needs a size; give width and height in pixels")
    robot = snapshot.robot
    return Camera.behind(robot.position, robot.direction, size=(size[0], size[1] - strip))
