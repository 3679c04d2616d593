"""Base class of scenes, snapshots, episodes and records: pictures in notebooks and files."""

from __future__ import annotations

import importlib
from abc import abstractmethod
from collections.abc import Mapping
from pathlib import Path
from typing import Any


class Drawable:
    """Base class of objects that can be drawn; `sonata2d.view.drawing.drawing_of` has a function for each subclass.

    The module that draws is imported when something is drawn, because neither a simulation nor a program that reads
    data needs pygame.
    """

    __slots__ = ()

    def save(
        self,
        path: str | Path,
        *,
        size: tuple[int, int] | None = None,
        scale: float | None = None,
        strip: int | None = None,
        fps: float | None = None,
        speed: float | None = None,
        layers: Any = None,
        caption: str | None = None,
    ) -> None:
        """Draw into a file, whose suffix selects the format.

        `.png` and `.svg` are a picture of the last state, with the paths up to it; `.gif` and `.mp4` a film; `.html` a
        page that plays the episode without a connection.

        Args:
            path: of the file.
            size: width and height of a picture or film, px.
            scale: pixels per metre, if no size is given.
            strip: of a `.png`: the number of moments side by side.
            fps: pictures per second of a film; by default 10 for a GIF, 30 for an MP4.
            speed: seconds of the episode per second of a film; by default 1.
            layers: what is shown, a `sonata2d.view.Layers`.
            caption: text below the picture; by default scenario, seed, episode and time.

        Raises:
            RenderError: the suffix is unknown, an argument has no effect on the format, or the file cannot be written.
        """
        display().save(
            self, path, size=size, scale=scale, strip=strip, fps=fps, speed=speed, layers=layers,
            caption=caption,
        )  # fmt: skip

    def show(self, *, size: tuple[int, int] | None = None, layers: Any = None, caption: str | None = None) -> None:
        """Show the picture of the last state, with the paths up to it: below a cell of a notebook, else in a browser.

        Args:
            size, layers, caption: as for `save`.

        Raises:
            RenderError: the size is out of range, or there is neither a notebook nor a browser.
        """
        display().show(self, size=size, layers=layers, caption=caption)

    def animate(self, *, layers: Any = None, caption: str | None = None) -> None:
        """Show a page that plays the episode: below a cell of a notebook, else in a browser.

        Args:
            layers, caption: as for `save`.

        Raises:
            RenderError: there is neither a notebook nor a browser.
        """
        display().animate(self, layers=layers, caption=caption)

    def _repr_html_(self) -> str:
        """A table and a picture, which notebooks show."""
        html: str = display().card(type(self).__name__, self._facts(), [self])
        return html

    @abstractmethod
    def _facts(self) -> Mapping[str, object]:
        """The rows of the table in a notebook: values by name."""


display_module = ""
"""Name of the module that draws. `sonata2d/__init__.py` sets it, because core names no package above itself."""


def display() -> Any:
    """The module whose functions draw."""
    return importlib.import_module(display_module)
