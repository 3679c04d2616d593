"""Writes an episode as a picture, film or page; the suffix of the file selects the kind."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from ..core.files.locations import location
from ..core.snapshot import Snapshot
from ..errors import RenderError
from .episode_page import save_page
from .film import save_film
from .layers import Layers
from .stills import save_moment, save_picture
from .trails import Trails

SUFFIXES = (".png", ".gif", ".mp4", ".html", ".svg")
FILM_SUFFIXES, _PICTURE_SUFFIXES = (".gif", ".mp4"), (".png", ".svg")
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
    given = {"fps": fps, "speed": speed, "size": size, "scale": scale, "strip": strip}
    for name, value in given.items():
        if value is not None and suffix not in _SUFFIXES_OF[name]:
            raise RenderError(f"{path}: {name} has no effect on this format, only on {', '.join(_SUFFIXES_OF[name])}")
    if strip is not None and size is not None:
        raise RenderError(f"{path}: size has no effect on moments side by side; leave out one of them")
    if not snapshots:
        raise RenderError("there is nothing to draw: the episode holds no frame")
    layers = layers or Layers(legend=True)
    texts: dict[str, Any] = {"caption": caption, "outcome": outcome, "layers": layers}
    if suffix == ".png":
        save_picture(path, snapshots, size=size, scale=scale, strip=strip, **texts)
    elif suffix == ".svg":
        trails = Trails.of(snapshots)
        save_moment(path, snapshots[-1], size=size, scale=scale, trails=trails, **texts)
    elif suffix == ".html":
        save_page(path, snapshots, commands=commands, labels=labels, **texts)
    else:
        pace = 1.0 if speed is None else speed
        save_film(path, snapshots, fps=fps, speed=pace, size=size, scale=scale, advance=advance, **texts)
