"""Still pictures of a snapshot, of pixels or vectors, and moments of an episode for a page."""

from __future__ import annotations

import base64
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import pygame

from ..core.devices import View
from ..core.files.locations import location
from ..core.files.whole_file import whole_file
from ..core.snapshot import Snapshot, snapshot_of as snapshot_of
from ..errors import RenderError
from .brush import Brush
from .canvas import Picture, PixelCanvas
from .draw import (
    QUICK,
    backdrop,
    camera_for,
    draw_caption,
    draw_moving_parts,
    draw_on_backdrop,
    draw_still_parts,
    draw_words,
)
from .layers import Layers
from .legend import Legend
from .projection import Camera
from .svg import SvgCanvas
from .trails import Trails

_MOMENT_SIDE = 480  # px, longer side of a moment on a page, which browsers make smaller


def picture(snapshot: Snapshot, **options: Any) -> pygame.Surface:
    """Draw a snapshot.

    The picture is a function of its arguments and needs no display. It is drawn at a multiple of its size and then made
    smaller, which smooths all edges.

    Args:
        options: attributes of `Still`: `view`, `size`, `scale`, `layers`, `trails`, `caption`, `outcome`.

    Raises:
        RenderError: a side of the picture would be outside 16 to 6000 px.

    Example:
        picture(snapshot, size=(800, 600), layers=Layers(zones=True))
    """
    return Still(snapshot, **options).pixels().surface


def save_moment(
    path: str | Path, snapshot: Snapshot, *, size: tuple[int, int] | None = (1280, 800), **options: Any
) -> None:
    """Write one snapshot as `.png` or `.svg`, selected by the suffix.

    Args:
        size: width and height, caption and legend included, px; None to use `scale` (only for the view `top`).
        options: other attributes of `Still`.

    Raises:
        RenderError: the suffix is another one, the size is out of range, or the file cannot be written.
    """
    suffix = location(path).suffix.lower()
    if suffix not in (".png", ".svg"):
        raise RenderError(f"{path}: a snapshot is written as PNG or SVG; end the name in .png or .svg")
    still = Still(snapshot, size=size, **options)
    write_file(path, (still.vectors() if suffix == ".svg" else still.pixels()).content())


@dataclass(frozen=True)
class Still:
    """A picture of a snapshot, drawn as pixels or as vectors.

    Attributes:
        view: `top`, the whole room; or `follow`, from behind the robot, whose direction points up in the picture; the
            whole room if the robot was not recorded.
        size: width and height, caption and legend included, px.
        scale: pixels per metre of the whole room, if no size is given; by default 80, less for a large room.
        layers: what to show. A legend that would take more than a quarter of a given size is left out.
        trails: past paths of robot and pedestrians.
        caption: text below the picture; by default scenario, seed, episode and time.
        outcome: how the episode ended; added to the default caption.
    """

    snapshot: Snapshot
    view: View = "top"
    size: tuple[int, int] | None = None
    scale: float | None = None
    layers: Layers = field(default_factory=Layers)
    trails: Trails | None = None
    caption: str | None = None
    outcome: str | None = None

    @cached_property
    def legend(self) -> Legend:
        """The legend; without entries if there is none."""
        marks = self.trails is not None and self.trails.has_marks
        legend = Legend.of([self.snapshot], self.layers, paths=self.trails is not None, time_marks=marks)
        return legend.fitting(self.size)

    @cached_property
    def camera(self) -> Camera:
        """The view on the world above caption and legend.

        Raises:
            RenderError: a side of the picture would be outside 16 to 6000 px.
        """
        scene, size, robot = self.snapshot.scene, self.size, self.snapshot.robot
        below = self.layers.strip + self.legend.height(size[0]) if size else 0
        if self.view == "top" or "robot" in scene.unmeasured:
            return camera_for(scene, size=size, scale=self.scale, below=below)
        if size is None:
            raise RenderError("a picture from behind the robot needs a size; give width and height in pixels")
        return Camera.behind(robot.position, robot.direction, size=(size[0], size[1] - below))

    def pixels(self) -> PixelCanvas:
        """Draw the picture as pixels."""
        surface = backdrop(self.snapshot.scene, self.camera, self.layers)
        draw_on_backdrop(surface, self.camera, self.snapshot, self.layers, self.trails)
        canvas = PixelCanvas.blank(self._size)
        pygame.transform.smoothscale(surface, self.camera.size, canvas.surface.subsurface((0, 0, *self.camera.size)))
        self._annotate(canvas)
        return canvas

    def vectors(self) -> SvgCanvas:
        """Draw the picture as vectors."""
        canvas = SvgCanvas.blank(self._size)
        brush = Brush(canvas, self.camera)
        with canvas.clip(self.camera.size):
            draw_still_parts(brush, self.snapshot.scene, grid=self.layers.grid)
            draw_moving_parts(brush, self.snapshot, self.layers, self.trails)
        self._annotate(canvas)
        return canvas

    @property
    def _size(self) -> tuple[int, int]:
        width, height = self.camera.size
        return width, height + self.layers.strip + self.legend.height(width)

    def _annotate(self, canvas: Picture) -> None:
        """Draw the texts, at the picture's final size."""
        draw_words(canvas, self.camera, self.snapshot, self.layers)
        if self.layers.caption:
            draw_caption(canvas, self.camera, self.snapshot, self.trails, self.caption, self.outcome)
        self.legend.draw(canvas, self.camera.size[1] + self.layers.strip, self.camera.size[0])


def filmstrip(snapshots: Sequence[Snapshot], indices: Sequence[int]) -> list[str]:
    """Draw moments of an episode for a page, each with the paths up to it.

    The pictures show the whole room, without caption and legend, and are transparent outside.

    Args:
        snapshots: of one episode, in order.
        indices: of the snapshots to draw.

    Returns:
        A data URL per index, each a PNG of the same size.

    Raises:
        RenderError: `indices` is empty or contains an index out of range.
    """
    if not indices or not all(0 <= k < len(snapshots) for k in indices):
        raise RenderError(
            f"cannot show snapshots {[*indices]} of {len(snapshots)}; ask for some of 0..{len(snapshots) - 1}"
        )
    layers, scene = Layers(), snapshots[0].scene
    camera = camera_for(scene, side=_MOMENT_SIDE)
    room = backdrop(scene, camera, layers, outside=None, fine=QUICK)
    urls = []
    for k in indices:
        surface = room.copy()
        draw_on_backdrop(surface, camera, snapshots[k], layers, Trails.of(snapshots[: k + 1]))
        content = PixelCanvas(pygame.transform.smoothscale(surface, camera.size)).content()
        urls.append("data:image/png;base64," + base64.b64encode(content).decode("ascii"))
    return urls


def save_surface(surface: pygame.Surface, path: str | Path) -> None:
    """Write a surface as PNG.

    Raises:
        RenderError: the name does not end in .png, or the file cannot be written.
    """
    if location(path).suffix.lower() != ".png":
        raise RenderError(f"{path}: a picture is written as PNG; end the name in .png")
    write_file(path, PixelCanvas(surface).content())


def write_file(path: str | Path, content: bytes) -> None:
    """Write a file, whole or not at all.

    Raises:
        RenderError: the file cannot be written.
    """
    with written(path) as temporary:
        temporary.write_bytes(content)


@contextmanager
def written(path: str | Path) -> Iterator[Path]:
    """Yield a path to write to, which becomes the file, whole or not at all.

    Raises:
        RenderError: the file cannot be written.
    """
    try:
        with whole_file(path) as temporary:
            yield temporary
    except OSError as error:
        raise RenderError(f"cannot write {path}: {error.strerror or error}") from error
