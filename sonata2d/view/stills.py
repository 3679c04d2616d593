"""Still pictures of a snapshot, of pixels or vectors, and moments of an episode for a page."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

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
    draw_ids,
    draw_moving_parts,
    draw_on_backdrop,
    draw_still_parts,
)
from .layers import Layers
from .legend import Legend
from .projection import Camera
from .svg import SvgCanvas
from .trails import Trails

MOMENT_SIDE = 480  # px, longer side of a moment on a page, which browsers make smaller


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

    The picture is a function of its arguments and needs no display. It is drawn at a multiple of its size and then made
    smaller, which smooths all edges.

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
    still = Still.of(
        snapshot, size=size, scale=scale, layers=layers, trails=trails, caption=caption, outcome=outcome, camera=camera
    )
    return still.pixels(room).surface


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
    """Write one snapshot as `.png` or `.svg`, selected by the suffix.

    Args:
        view: `top`, the whole room; or `follow`, from behind the robot, whose direction points up in the picture; the
            whole room if the robot was not recorded.
        size: width and height, caption and legend included, px; None to use `scale` (only for `top`).
        scale: pixels per metre of the whole room, if no size is given.
        layers, trails, caption, outcome: as for `picture`.

    Raises:
        RenderError: the suffix is another one, the size is out of range, or the file cannot be written.
    """
    suffix = location(path).suffix.lower()
    if suffix not in (".png", ".svg"):
        raise RenderError(f"{path}: a snapshot is written as PNG or SVG; end the name in .png or .svg")
    still = Still.of(
        snapshot, view=view, size=size, scale=scale, layers=layers, trails=trails, caption=caption, outcome=outcome
    )
    write_file(path, still.drawn(vectors=suffix == ".svg").content())


@dataclass(frozen=True)
class Still:
    """A picture of a snapshot that is not drawn yet.

    Attributes:
        legend: of the picture; without entries if it has none.
        snapshot, layers, trails, caption, outcome, camera: as for `picture`.
    """

    snapshot: Snapshot
    camera: Camera
    layers: Layers
    legend: Legend
    trails: Trails | None
    caption: str | None
    outcome: str | None

    @classmethod
    def of(
        cls,
        snapshot: Snapshot,
        *,
        view: View = "top",
        size: tuple[int, int] | None = None,
        scale: float | None = None,
        layers: Layers | None = None,
        trails: Trails | None = None,
        caption: str | None = None,
        outcome: str | None = None,
        camera: Camera | None = None,
    ) -> Still:
        """Choose camera and legend of a picture; arguments as for `picture` and `save_moment`.

        Raises:
            RenderError: a side of the picture would be outside 16 to 6000 px.
        """
        layers, scene = layers or Layers(), snapshot.scene
        marks = trails is not None and trails.has_marks
        legend = Legend.of([snapshot], layers, paths=trails is not None, time_marks=marks).fitting(size)
        below = layers.strip + legend.height(size[0]) if size else 0
        if camera is None and (view == "top" or "robot" in scene.unmeasured):
            camera = camera_for(scene, size=size, scale=scale, below=below)
        elif camera is None:
            if size is None:
                raise RenderError("a picture from behind the robot needs a size; give width and height in pixels")
            robot = snapshot.robot
            camera = Camera.behind(robot.position, robot.direction, size=(size[0], size[1] - below))
        return cls(snapshot, camera, layers, legend, trails, caption, outcome)

    def drawn(self, *, vectors: bool) -> Picture:
        """Draw the picture as vectors or as pixels."""
        return self.vectors() if vectors else self.pixels()

    def pixels(self, room: pygame.Surface | None = None) -> PixelCanvas:
        """Draw the picture; `room` as for `picture`."""
        surface = room.copy() if room is not None else backdrop(self.snapshot.scene, self.camera, self.layers)
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
        draw_ids(canvas, self.camera, self.snapshot, self.layers)
        if self.layers.caption:
            draw_caption(canvas, self.camera, self.snapshot, self.trails, self.caption, self.outcome)
        self.legend.draw(canvas, self.camera.size[1] + self.layers.strip, self.camera.size[0])


def filmstrip(snapshots: Sequence[Snapshot], indices: Sequence[int], *, layers: Layers | None = None) -> list[str]:
    """Draw moments of an episode for a page, each with the paths up to it.

    The pictures show the whole room, and are transparent outside.

    Args:
        snapshots: of one episode, in order.
        indices: of the snapshots to draw.
        layers: what to show; caption and legend are never drawn.

    Returns:
        A data URL per index, each a PNG of the same size.

    Raises:
        RenderError: `indices` is empty or contains an index out of range.
    """
    if not indices or not all(0 <= k < len(snapshots) for k in indices):
        raise RenderError(
            f"cannot show snapshots {[*indices]} of {len(snapshots)}; ask for some of 0..{len(snapshots) - 1}"
        )
    layers, scene = layers or Layers(), snapshots[0].scene
    camera = camera_for(scene, side=MOMENT_SIDE)
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
    try:
        with whole_file(path) as temporary:
            temporary.write_bytes(content)
    except OSError as error:
        raise RenderError(f"cannot write {path}: {error.strerror or error}") from error
