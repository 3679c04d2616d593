"""Still pictures: PNG and SVG files, contact sheets of scenes, and moments of an episode side by side or for a page."""

from __future__ import annotations

import base64
import io
import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pygame

from ..core.devices import View
from ..core.files.locations import location
from ..core.files.whole_file import whole_file
from ..core.scene import Scene
from ..core.snapshot import Snapshot, snapshot_of as snapshot_of
from ..errors import RenderError
from .annotations import STRIP, TEXT, draw_strip, origin, summary
from .brush import Brush
from .canvas import PixelCanvas
from .draw import QUICK, annotate, backdrop, camera_for, draw_moving, draw_on_backdrop, height_below, picture
from .fonts import shortened
from .furniture import draw_furniture
from .landmarks import draw_landmarks
from .layers import Layers
from .legend import Legend
from .palette import FAINT, PAPER
from .projection import Camera
from .room import FloorPlan, draw_room
from .svg import SvgCanvas
from .trails import Trails, draw_trails

GAP, TITLE = 10, 26  # px: between pictures, and height of a title
_SHEET_WIDTH, _MAX_SCALE = 1600.0, 80.0  # px, px/m: of a sheet by default
_MAX_COLUMNS = 4  # moments side by side
MOMENT_SIDE = 480  # px, longer side of a moment on a page, which browsers make smaller


# Files


def save_surface(surface: pygame.Surface, path: str | Path) -> None:
    """Write a surface as PNG.

    Raises:
        RenderError: the name does not end in .png, or the file cannot be written.
    """
    if location(path).suffix.lower() != ".png":
        raise RenderError(f"{path}: a picture is written as PNG; end the name in .png")
    write_file(path, png_of(surface))


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


def url_of(surface: pygame.Surface) -> str:
    """A data URL that holds a surface as PNG, for pages that consist of one file."""
    return "data:image/png;base64," + base64.b64encode(png_of(surface)).decode("ascii")


def png_of(surface: pygame.Surface) -> bytes:
    """A surface as the content of a PNG file."""
    file = io.BytesIO()
    pygame.image.save(surface, file, "picture.png")
    return file.getvalue()


def save_picture(
    path: str | Path,
    snapshots: Sequence[Snapshot],
    *,
    size: tuple[int, int] | None = None,
    scale: float | None = None,
    layers: Layers | None = None,
    strip: int | None = None,
    caption: str | None = None,
    outcome: str | None = None,
) -> None:
    """Write a PNG of an episode: its last snapshot with the paths up to it, or several moments side by side.

    Args:
        strip: number of moments side by side, evenly spaced in time; None for the last snapshot only.
        size, scale, layers, caption, outcome: as for `picture`; `size` has no effect on a strip.

    Raises:
        RenderError: the size is out of range, or the file cannot be written.
    """
    if strip is not None:
        drawn = moments(snapshots, strip, scale=scale, layers=layers, caption=caption, outcome=outcome)
    else:
        drawn = picture(
            snapshots[-1],
            size=size,
            scale=scale,
            layers=layers,
            trails=Trails.of(snapshots),
            caption=caption,
            outcome=outcome,
        )
    save_surface(drawn, path)


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
    suffix, layers = location(path).suffix.lower(), layers or Layers()
    if suffix not in (".png", ".svg"):
        raise RenderError(f"{path}: a snapshot is written as PNG or SVG; end the name in .png or .svg")
    marks = trails is not None and trails.has_marks
    legend = Legend.of([snapshot], layers, paths=trails is not None, time_marks=marks).fitting(size)
    layers = replace(layers, legend=bool(legend.entries))
    below = height_below(layers, legend, size[0]) if size else 0
    if view == "top" or "robot" in snapshot.scene.unmeasured:
        camera = camera_for(snapshot.scene, size=size, scale=scale, below=below)
    elif size is not None:
        robot = snapshot.robot
        camera = Camera.behind(robot.position, robot.direction, size=(size[0], size[1] - below))
    else:
        raise RenderError("a picture from behind the robot needs a size; give width and height in pixels")
    if suffix == ".png":
        drawn = picture(snapshot, layers=layers, trails=trails, caption=caption, outcome=outcome, camera=camera)
        save_surface(drawn, path)
    else:
        vectors(snapshot, camera, layers, legend, trails, caption, outcome).write(path)


def vectors(
    snapshot: Snapshot,
    camera: Camera,
    layers: Layers,
    legend: Legend,
    trails: Trails | None,
    caption: str | None,
    outcome: str | None,
) -> SvgCanvas:
    """The same as `picture`, as vectors."""
    width, height = camera.size
    total = height + height_below(layers, legend, width)
    canvas = SvgCanvas((width, total))
    canvas.rectangle(PAPER, pygame.Rect(0, 0, width, total))
    brush = Brush(canvas, camera)
    with canvas.clip(camera.size):
        draw_room(brush, FloorPlan.of(snapshot.scene), grid=layers.grid)
        draw_landmarks(brush, snapshot.scene)
        draw_furniture(brush, snapshot.scene)
        draw_moving(brush, snapshot, layers, partial(draw_trails, trails=trails))
    annotate(canvas, camera, snapshot, layers, trails, caption, outcome)
    legend.draw(canvas, height + height_below(layers), width)
    return canvas


# Scenes


def scene_picture(
    *scenes: Scene,
    columns: int | None = None,
    scale: float | None = None,
    layers: Layers | None = None,
    titles: Sequence[str] | None = None,
) -> pygame.Surface:
    """Draw a contact sheet of scenes, each with a title, all at the same scale.

    Args:
        columns: pictures per row; by default about as many as rows.
        scale: pixels per metre; by default the one that makes the sheet 1600 px wide, at most 80.
        layers: what to show, without legend; by default everything but the caption.
        titles: one per scene; by default name, seed and episode.

    Raises:
        RenderError: no scene is given, or a picture would be too large or too small at that scale.
    """
    if not scenes:
        raise RenderError("there is no scene to draw; give at least one")
    columns = columns or math.ceil(math.sqrt(len(scenes)))
    layers, scale = layers or Layers(caption=False), scale or common_scale(scenes, columns)
    bare = replace(layers, legend=False)
    titles = titles or [f"{scene.name}   {origin(scene)}" for scene in scenes]
    tiles = [
        with_title(picture(snapshot_of(scene), layers=bare, camera=camera_for(scene, scale=scale)), title)
        for scene, title in zip(scenes, titles, strict=True)
    ]
    return tiled(tiles, columns)


# Moments of an episode


def moments(
    snapshots: Sequence[Snapshot],
    count: int,
    *,
    scale: float | None = None,
    layers: Layers | None = None,
    caption: str | None = None,
    outcome: str | None = None,
) -> pygame.Surface:
    """Draw moments of an episode side by side, evenly spaced from first to last, each with the paths up to it.

    Args:
        count: number of moments; more than fit into a row become several rows.
        scale, layers, caption, outcome: as for `picture`; by default a moment is 380 px wide or more.

    Raises:
        RenderError: the count is outside 1 to the number of snapshots.
    """
    if not 1 <= count <= len(snapshots):
        raise RenderError(f"cannot show {count} moments of {len(snapshots)}; ask for 1 to {len(snapshots)}")
    scene, layers = snapshots[0].scene, layers or Layers()
    columns = _columns(count)
    camera = camera_for(scene, scale=scale or common_scale([scene], columns))
    bare = replace(layers, caption=False, legend=False)
    indices = [round(x) for x in np.linspace(0 if count > 1 else len(snapshots) - 1, len(snapshots) - 1, count)]
    tiles = []
    for k in indices:
        drawn = picture(snapshots[k], layers=bare, trails=Trails.of(snapshots[: k + 1]), camera=camera)
        tiles.append(with_title(drawn, f"{snapshots[k].time:.1f} s"))
    rows = tiled(tiles, columns)
    width, height = rows.get_size()
    marks = Trails.of(snapshots[: indices[-1] + 1]).has_marks
    legend = Legend.of([snapshots[k] for k in indices], layers, paths=True, time_marks=marks)
    sheet = _extended(rows, below=height_below(layers, legend, width))
    canvas = PixelCanvas(sheet)
    if layers.caption:
        text = summary(snapshots[-1], outcome) if caption is None else caption
        draw_strip(canvas, (width, height + STRIP), text, camera.scale, None)
    legend.draw(canvas, height + height_below(layers), width)
    return sheet


def _columns(count: int) -> int:
    """Number of columns for a number of moments: as few rows as possible, filled as evenly as possible."""
    rows = math.ceil(count / _MAX_COLUMNS)
    return math.ceil(count / rows)


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
    layers = layers or Layers()
    camera = camera_for(snapshots[0].scene, side=MOMENT_SIDE)
    room = backdrop(snapshots[0].scene, camera, layers, outside=None, fine=QUICK)
    urls = []
    for k in indices:
        surface = room.copy()
        draw_on_backdrop(surface, camera, snapshots[k], layers, Trails.of(snapshots[: k + 1]))
        urls.append(url_of(pygame.transform.smoothscale(surface, camera.size)))
    return urls


# Sheets


def tiled(pictures: Sequence[pygame.Surface], columns: int) -> pygame.Surface:
    """Arrange pictures in rows from the upper left, each centred in its column."""
    columns = min(columns, len(pictures))
    rows = [pictures[k : k + columns] for k in range(0, len(pictures), columns)]
    width = max(drawn.get_width() for drawn in pictures)
    heights = [max(drawn.get_height() for drawn in row) for row in rows]
    sheet = pygame.Surface((columns * (width + GAP) - GAP, sum(heights) + (len(rows) - 1) * GAP), 0, 32)
    sheet.fill(PAPER)
    for k, row in enumerate(rows):
        for column, drawn in enumerate(row):
            left = column * (width + GAP) + (width - drawn.get_width()) // 2
            sheet.blit(drawn, (left, sum(heights[:k]) + k * GAP))
    return sheet


def common_scale(scenes: Sequence[Scene], columns: int) -> float:
    """Pixels per metre at which the widest scene fills a column of a sheet; a room without outline counts as 10 m."""
    widest = max(float(np.ptp(scene.outline[:, 0])) for scene in scenes) if all(s.polygon for s in scenes) else 10.0
    return min(_MAX_SCALE, (_SHEET_WIDTH / columns - GAP) / (widest + 0.6))


def with_title(drawn: pygame.Surface, title: str) -> pygame.Surface:
    """The picture with a line of text above it."""
    sheet, width = _extended(drawn, above=TITLE), drawn.get_width()
    PixelCanvas(sheet).text(FAINT, shortened(title, width - 12, TEXT), (width // 2, TITLE // 2 + 4), TEXT)
    return sheet


def _extended(drawn: pygame.Surface, *, above: int = 0, below: int = 0) -> pygame.Surface:
    """The picture with empty rows of pixels above and below it."""
    width, height = drawn.get_size()
    sheet = pygame.Surface((width, above + height + below), 0, 32)
    sheet.fill(PAPER)
    sheet.blit(drawn, (0, above))
    return sheet
