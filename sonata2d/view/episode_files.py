"""Writes an episode as a picture, film or page; the suffix of the file selects the kind."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from ..core.files.locations import location
from ..core.snapshot import Snapshot
from ..errors import RenderError
from .drawing import Drawing
from .episode_page import page_of
from .film import FILM_SUFFIXES, save_film
from .layers import Layers
from .sheets import SUFFIXES as SUFFIXES, moments
from .stills import save_moment, write_file
from .trails import Trails

_PICTURE_SUFFIXES = (".png", ".svg")
_SUFFIXES_OF = {  # of the formats on which an argument of `render` has an effect
    "fps": FILM_SUFFIXES,
    "speed": FILM_SUFFIXES,
    "size": (*_PICTURE_SUFFIXES, *FILM_SUFFIXES),
    "scale": (*_PICTURE_SUFFIXES, *FILM_SUFFIXES),
    "strip": (".png",),
}


def render(
    snapshots: Sequence[Snapshot],
    path: str | Path,
    *,
    fps: float | None = None,
    speed: float | None = None,
    size: tuple[int, int] | None = None,
    scale: float | None = None,
    strip: int | None = None,
    layers: Layers | None = None,
    caption: str | None = None,
    outcome: str | None = None,
    advance: Callable[[int], None] | None = None,
    commands: Any = None,
    labels: Sequence[Any] | None = None,
) -> None:
    """Draw an episode into a file.

    `.png` and `.svg` are one picture, of pixels or vectors; `.gif` and `.mp4` a film; `.html` a page that plays it.

    Args:
        snapshots: of one episode, in order.
        path: the file to write.
        fps: pictures per second of a film; by default 10 for a GIF, 30 for an MP4.
        speed: seconds of the episode per second of a film; by default 1.
        size: width and height of a picture or film, caption and legend included, px.
        scale: pixels per metre of a picture or film, if no size is given.
        strip: for a PNG, the number of moments side by side.
        layers: what to show; by default `Layers(legend=True)`.
        caption: text below the picture; by default scenario, seed, episode and time.
        outcome: how the episode ended.
        advance: called with 1 for each snapshot of a film that was drawn, as of a progress bar.
        commands: (T, 3) or (T - 1, 3), the controller's commands, m/s, m/s, rad/s, body frame; shown on a page.
        labels: (T,) or (T - 1,), texts or JSON values; shown on a page.

    Raises:
        RenderError: the suffix is unknown, an argument has no effect on this format, `snapshots` is empty, or the file
            cannot be drawn or written.

    Example:
        render(list(record.snapshots()), "episode.png", size=(800, 600))
    """
    suffix = location(path).suffix.lower()
    if suffix not in SUFFIXES:
        raise RenderError(
            f"cannot render {str(path)!r}: its suffix selects the format; end the name in one of {', '.join(SUFFIXES)}"
        )
    options = {"fps": fps, "speed": speed, "size": size, "scale": scale, "strip": strip}
    for name, value in options.items():
        if value is not None and suffix not in _SUFFIXES_OF[name]:
            raise RenderError(f"{path}: {name} has no effect on this format, only on {', '.join(_SUFFIXES_OF[name])}")
    if strip is not None and size is not None:
        raise RenderError(f"{path}: size has no effect on moments side by side; leave out one of them")
    if not snapshots:
        raise RenderError("there is nothing to draw: the episode holds no frame")
    layers = layers or Layers(legend=True)
    if suffix == ".html":
        page = page_of([Drawing(snapshots, outcome, commands, labels)], layers=layers, caption=caption)
        write_file(path, page.encode())
    elif suffix in FILM_SUFFIXES:
        save_film(
            path, snapshots, fps=fps, speed=1.0 if speed is None else speed, size=size, scale=scale, layers=layers,
            caption=caption, outcome=outcome, advance=advance,
        )  # fmt: skip
    elif strip is not None:
        sheet = moments(snapshots, strip, scale=scale, layers=layers, caption=caption, outcome=outcome)
        write_file(path, sheet.content())
    else:
        save_moment(
            path, snapshots[-1], size=size, scale=scale, layers=layers, trails=Trails.of(snapshots), caption=caption,
            outcome=outcome,
        )  # fmt: skip
