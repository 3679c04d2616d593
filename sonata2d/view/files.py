"""Writes an episode as a picture, film or page; the suffix of the file selects the kind."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ..core.snapshot import Snapshot
from ..errors import RenderError
from .draw import Layers
from .film import save_film
from .page import save_page
from .stills import save_moment, save_picture
from .trails import Trails

SUFFIXES = (".png", ".gif", ".mp4", ".html", ".svg")


def render(
    snapshots: Sequence[Snapshot],
    path: str | Path,
    *,
    fps: float | None = None,
    speed: float = 1.0,
    size: tuple[int, int] | None = None,
    scale: float | None = None,
    strip: int | None = None,
    layers: Layers | None = None,
    caption: str | None = None,
    outcome: str | None = None,
    commands: Any = None,
    labels: Sequence[Any] | None = None,
) -> None:
    """Draw an episode into a file.

    `.png` and `.svg` are one picture, of pixels or vectors; `.gif` and `.mp4` a film; `.html` a page that plays it.

    Args:
        snapshots: of one episode, in order.
        path: the file to write.
        fps: pictures per second of a film; by default 10 for a GIF, 30 for an MP4.
        speed: seconds of the episode per second of a film.
        size: width and height, caption included, px; ignored for a page, which fits its window.
        scale: pixels per metre, if no size is given.
        strip: for a PNG, the number of moments side by side.
        layers: what to show.
        caption: text below the picture; by default scenario, seed, episode and time.
        outcome: how the episode ended.
        commands: (T, 3) or (T - 1, 3), the controller's commands, m/s, m/s, rad/s, body frame; shown on a page.
        labels: (T,) or (T - 1,), texts or JSON values; shown on a page.

    Raises:
        RenderError: the suffix is unknown, `snapshots` is empty, or the file cannot be drawn or written.

    Example:
        render(list(record.snapshots()), "episode.png", size=(800, 600))
    """
    suffix = Path(path).suffix.lower()
    if suffix not in SUFFIXES:
        raise RenderError(
            f"cannot render {str(path)!r}: its suffix selects the format; end the name in one of {', '.join(SUFFIXES)}"
        )
    if not snapshots:
        raise RenderError("there is nothing to draw: the episode holds no frame")
    texts: dict[str, Any] = {"caption": caption, "outcome": outcome, "layers": layers}
    if suffix == ".png":
        save_picture(path, snapshots, size=size, scale=scale, strip=strip, **texts)
    elif suffix == ".svg":
        if strip is not None:
            raise RenderError(f"{path}: several moments side by side are written as PNG; end the name in .png")
        trails = Trails.of(snapshots)
        save_moment(path, snapshots[-1], size=size, scale=scale, trails=trails, **texts)
    elif suffix == ".html":
        save_page(path, snapshots, commands=commands, labels=labels, **texts)
    else:
        save_film(path, snapshots, fps=fps, speed=speed, size=size, scale=scale, **texts)
