"""Several pictures side by side: scenes, moments of an episode, and episodes as a picture, a film or a page."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TypeVar

import numpy as np
import pygame

from ..core.files.locations import location
from ..core.notebook import ProgressBar, bar_of
from ..core.scene import Scene
from ..core.snapshot import Snapshot
from ..errors import RenderError
from .annotations import STRIP, TEXT, draw_strip, origin, summary
from .canvas import PixelCanvas
from .drawing import Drawing, drawing_of
from .episode_page import page_of
from .film import FILM_SUFFIXES, FilmPainter, save_sheet_film
from .fonts import shortened
from .layers import Layers
from .legend import Legend
from .palette import FAINT
from .stills import Still, write_file
from .svg import SvgCanvas
from .trails import Trails

SUFFIXES = (".png", *FILM_SUFFIXES, ".html", ".svg")
_GAP, _TITLE = 10, 26  # px: between pictures, and height of a title
_WIDTH, _MAX_SCALE = 1600.0, 80.0  # px, px/m: of a sheet by default
_MAX_COLUMNS = 4  # moments side by side
_LAYERS = Layers(caption=False, legend=False)

_Kind = TypeVar("_Kind", PixelCanvas, SvgCanvas)


def scene_picture(
    *scenes: Scene, columns: int | None = None, scale: float | None = None, titles: Sequence[str] | None = None
) -> pygame.Surface:
    """Draw a contact sheet of scenes, each with a title, all at the same scale.

    Args:
        columns: pictures per row; by default about as many as rows.
        scale: pixels per metre; by default the one that makes the sheet 1600 px wide, at most 80.
        titles: one per scene; by default name, seed and episode.

    Raises:
        RenderError: no scene is given, or a picture would be too large or too small at that scale.
    """
    titles = titles or [f"{scene.name}   {origin(scene)}" for scene in scenes]
    return Sheet([drawing_of(scene) for scene in scenes], titles, columns, scale).pixels().surface


def moments(
    snapshots: Sequence[Snapshot],
    count: int,
    *,
    scale: float | None = None,
    layers: Layers,
    caption: str | None = None,
    outcome: str | None = None,
) -> PixelCanvas:
    """Draw moments of an episode side by side, evenly spaced from first to last, each with the paths up to it.

    Args:
        count: number of moments; more than fit into a row become several rows.
        scale, layers, caption, outcome: as for `picture`; by default a moment is 380 px wide or more.

    Raises:
        RenderError: the count is outside 1 to the number of snapshots.
    """
    if not 1 <= count <= len(snapshots):
        raise RenderError(f"cannot show {count} moments of {len(snapshots)}; ask for 1 to {len(snapshots)}")
    columns = math.ceil(count / math.ceil(count / _MAX_COLUMNS))  # as few rows as possible, filled evenly
    indices = [round(x) for x in np.linspace(0 if count > 1 else len(snapshots) - 1, len(snapshots) - 1, count)]
    parts, shown = [Drawing(snapshots[: k + 1]) for k in indices], [snapshots[k] for k in indices]
    bare = replace(layers, caption=False, legend=False)
    rows = Sheet(parts, [f"{moment.time:.1f} s" for moment in shown], columns, scale, bare)
    tiled = rows.pixels()
    legend = Legend.of(shown, layers, paths=True, time_marks=Trails.of(snapshots).has_marks)
    width, height = tiled.size
    sheet = PixelCanvas.blank((width, height + layers.strip + legend.height(width)))
    sheet.place(tiled, 0, 0)
    if layers.caption:
        text = summary(snapshots[-1], outcome) if caption is None else caption
        draw_strip(sheet, (width, height + STRIP), text, rows.stills[0].camera.scale, None)
    legend.draw(sheet, height + layers.strip, width)
    return sheet


@dataclass(frozen=True)
class Sheet:
    """Scenes or episodes side by side, all at the same scale; an episode at its end, with the paths up to it.

    Args:
        drawings: of the scenes or episodes.
        titles: one for each; the outcome is added.
        columns: pictures per row; by default about as many as rows.
        scale: pixels per metre; by default the one that makes the sheet 1600 px wide, at most 80.
        layers: what to show, without legend.

    Raises:
        RenderError: there are no drawings.
    """

    drawings: Sequence[Drawing]
    titles: Sequence[str]
    columns: int | None = None
    scale: float | None = None
    layers: Layers = _LAYERS

    def __post_init__(self) -> None:
        if not self.drawings:
            raise RenderError("there is nothing to draw; give at least one scene or episode")

    def save(
        self,
        path: str | Path,
        *,
        fps: float | None = None,
        speed: float | None = None,
        progress: bool | ProgressBar | None = None,
    ) -> None:
        """Draw into a file, whose suffix selects the format; see `SUFFIXES`.

        Args:
            path: of the file.
            fps, speed: of a film, as for `save_film`.
            progress: of a film, as for `core.notebook.bar_of`.

        Raises:
            RenderError: the suffix is unknown, fps or speed has no effect on it, or the file cannot be written.
        """
        suffix = location(path).suffix.lower()
        if suffix not in SUFFIXES:
            raise RenderError(f"{path}: the suffix selects the format; end the name in one of {', '.join(SUFFIXES)}")
        if suffix not in FILM_SUFFIXES and (fps, speed) != (None, None):
            raise RenderError(f"{path}: fps and speed have an effect on films only, .gif and .mp4")
        if suffix == ".svg":
            write_file(path, self._tiled([still.vectors() for still in self.stills]).content())
        elif suffix == ".png":
            write_file(path, self.pixels().content())
        elif suffix == ".html":
            write_file(path, self.page().encode())
        else:
            painters = [FilmPainter(still.snapshot.scene, still.camera, self.layers) for still in self.stills]
            episodes, pace = [drawing.snapshots for drawing in self.drawings], 1.0 if speed is None else speed
            save_sheet_film(path, episodes, painters, self._tiled, fps=fps, speed=pace, bar=bar_of(progress))

    def pixels(self) -> PixelCanvas:
        """Draw the sheet as pixels.

        Raises:
            RenderError: a picture would be too large or too small at the common scale.
        """
        return self._tiled([still.pixels() for still in self.stills])

    def page(self) -> str:
        """A page with a picture of each episode, which plays the one that is chosen."""
        return page_of(self.drawings, self._texts)

    @property
    def _texts(self) -> list[str]:
        return [
            f"{title}   {drawing.outcome or ''}".rstrip()
            for title, drawing in zip(self.titles, self.drawings, strict=True)
        ]

    @property
    def _columns(self) -> int:
        return self.columns or math.ceil(math.sqrt(len(self.drawings)))

    @cached_property
    def stills(self) -> list[Still]:
        """A picture of each drawing, at the scale at which the widest scene fills a column."""
        scenes = [drawing.snapshots[-1].scene for drawing in self.drawings]
        # a room without outline counts as 10 m
        widest = max(float(np.ptp(s.outline[:, 0])) for s in scenes) if all(s.polygon for s in scenes) else 10.0
        scale = self.scale or min(_MAX_SCALE, (_WIDTH / self._columns - _GAP) / (widest + 0.6))
        return [
            Still(snapshots[-1], layers=self.layers, trails=Trails.of(snapshots), scale=scale)
            for snapshots in (drawing.snapshots for drawing in self.drawings)
        ]

    def _tiled(self, pictures: Sequence[_Kind]) -> _Kind:
        """Arrange pictures with their titles in rows from the upper left, each centred in its column."""
        columns = min(self._columns, len(pictures))
        width = max(drawn.size[0] for drawn in pictures)
        heights = [
            max(drawn.size[1] for drawn in pictures[k : k + columns]) + _TITLE for k in range(0, len(pictures), columns)
        ]
        sheet = type(pictures[0]).blank((columns * (width + _GAP) - _GAP, sum(heights) + (len(heights) - 1) * _GAP))
        for k, (drawn, title) in enumerate(zip(pictures, self._texts, strict=True)):
            row, column = divmod(k, columns)
            left = column * (width + _GAP) + (width - drawn.size[0]) // 2
            top = sum(heights[:row]) + row * _GAP
            place = (left + drawn.size[0] // 2, top + _TITLE // 2 + 4)
            sheet.text(FAINT, shortened(title, drawn.size[0] - 12, TEXT), place, TEXT)
            sheet.place(drawn, left, top + _TITLE)
        return sheet
