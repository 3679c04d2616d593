"""Several episodes side by side: as a picture, as a film, or as a page that plays the one that is chosen."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import pygame
from jinja2 import Environment, PackageLoader

from ..core.files.locations import location
from ..core.notebook import ProgressBar, bar_of
from ..errors import RenderError
from .annotations import TEXT
from .draw import camera_for, picture
from .drawing import Drawing
from .episode_page import page_of
from .film import save_sheet_film
from .fonts import shortened
from .layers import Layers
from .legend import Legend
from .palette import FAINT, PAPER
from .sequence import PictureSequence
from .stills import GAP, TITLE, common_scale, filmstrip, save_surface, tiled, vectors, with_title, write_file
from .svg import SvgCanvas
from .trails import Trails

SUFFIXES = (".png", ".svg", ".gif", ".mp4", ".html")
_LAYERS = Layers(caption=False, legend=False)


@dataclass(frozen=True)
class Sheet:
    """Episodes side by side, all at the same scale.

    Args:
        drawings: of the episodes.
        titles: one for each; the outcome is added.

    Raises:
        RenderError: there is no episode.
    """

    drawings: Sequence[Drawing]
    titles: Sequence[str]

    def __post_init__(self) -> None:
        if not self.drawings:
            raise RenderError("there is no episode to draw")

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
        if suffix not in (".gif", ".mp4") and (fps, speed) != (None, None):
            raise RenderError(f"{path}: fps and speed have an effect on films only, .gif and .mp4")
        if suffix == ".png":
            save_surface(self.picture(), path)
        elif suffix == ".svg":
            self._vectors().write(path)
        elif suffix == ".html":
            write_file(path, self.page().encode())
        else:
            make = partial(PictureSequence, scale=self._scale, layers=_LAYERS)
            episodes = [drawing.snapshots for drawing in self.drawings]
            pace = 1.0 if speed is None else speed
            save_sheet_film(path, episodes, make, self._arranged, fps=fps, speed=pace, bar=bar_of(progress))

    def picture(self) -> pygame.Surface:
        """Each episode at its end, with the paths up to it.

        Raises:
            RenderError: a picture would be too large or too small at the common scale.
        """
        return self._arranged(
            [
                picture(drawing.snapshots[-1], layers=_LAYERS, trails=Trails.of(drawing.snapshots), scale=self._scale)
                for drawing in self.drawings
            ]
        )

    def page(self) -> str:
        """A page with a picture of each episode, which plays the one that is chosen."""
        episodes = [
            {
                "title": title,
                "picture": filmstrip(drawing.snapshots, [len(drawing.snapshots) - 1])[0],
                "page": page_of(
                    drawing.snapshots, commands=drawing.commands, labels=drawing.labels, outcome=drawing.outcome
                ),
            }
            for title, drawing in zip(self._texts, self.drawings, strict=True)
        ]
        environment = Environment(loader=PackageLoader(__package__, "."), autoescape=True)
        text: str = environment.get_template("sheet.html").render(episodes=episodes)
        return text

    @property
    def _texts(self) -> list[str]:
        return [
            f"{title}   {drawing.outcome or ''}".rstrip()
            for title, drawing in zip(self.titles, self.drawings, strict=True)
        ]

    @property
    def _columns(self) -> int:
        return math.ceil(math.sqrt(len(self.drawings)))

    @property
    def _scale(self) -> float:
        return common_scale([drawing.snapshots[-1].scene for drawing in self.drawings], self._columns)

    def _arranged(self, pictures: Sequence[pygame.Surface]) -> pygame.Surface:
        """The pictures in rows, with their titles."""
        return tiled([with_title(*one) for one in zip(pictures, self._texts, strict=True)], self._columns)

    def _vectors(self) -> SvgCanvas:
        """The same as `picture`, as vectors."""
        parts = []
        for drawing in self.drawings:
            last = drawing.snapshots[-1]
            camera = camera_for(last.scene, scale=self._scale)
            parts.append(vectors(last, camera, _LAYERS, Legend(), Trails.of(drawing.snapshots), None, None))
        sizes = [(int(part.root.attrib["width"]), int(part.root.attrib["height"]) + TITLE) for part in parts]
        columns = min(self._columns, len(parts))
        width = max(size[0] for size in sizes)
        heights = [max(size[1] for size in sizes[k : k + columns]) for k in range(0, len(parts), columns)]
        whole = (columns * (width + GAP) - GAP, sum(heights) + (len(heights) - 1) * GAP)
        canvas = SvgCanvas(whole)
        canvas.rectangle(PAPER, pygame.Rect(0, 0, *whole))
        for k, (part, text) in enumerate(zip(parts, self._texts, strict=True)):
            row, column = divmod(k, columns)
            left = column * (width + GAP) + (width - sizes[k][0]) // 2
            top = sum(heights[:row]) + row * GAP
            place = (left + sizes[k][0] // 2, top + TITLE // 2 + 4)
            canvas.text(FAINT, shortened(text, sizes[k][0] - 12, TEXT), place, TEXT)
            canvas.place(part, left, top + TITLE)
        return canvas
