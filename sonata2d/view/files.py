"""One door for all kinds of pictures: the file's suffix says which."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ..core.snapshot import Snapshot
from ..errors import RenderError
from .draw import Layers
from .film import save_film
from .page import save_page
from .still import save_picture
from .trails import Trails
from .vector import save_moment

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
    """Draw an episode into a file, told by its suffix.

    `.png` and `.svg` are one picture, of pixels or of vectors; `.gif` and `.mp4` a film; `.html` a page that plays it.

    Args:
        snapshots: of one episode, in order.
        fps: pictures a second of a film; 10 for a GIF, 30 for an MP4 unless given.
        speed: seconds of the episode in a second of a film.
        size: width and height in pixels, caption included; not for a page, which fits its window.
        scale: pixels a metre, if no size is given.
        strip: for a PNG, so many moments side by side.
        layers: what to show.
        caption: text below, instead of scenario, seed, episode and time.
        outcome: how the episode ended.
        commands: (T, 3) or one row less, what the controller asked for: m/s, m/s, rad/s; body frame; shown on a page.
        labels: (T,) or one less, texts or what JSON can hold; shown on a page.

    Raises:
        RenderError: the suffix is none of these, there is no frame, or the file cannot be drawn or written.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in SUFFIXES:
        raise RenderError(f"cannot tell from {str(path)!r} what to draw; end the name in one of {', '.join(SUFFIXES)}")
    if not snapshots:
        raise RenderError("there is nothing to draw: the episode holds no frame")
    texts: dict[str, Any] = {"caption": caption, "outcome": outcome, "layers": layers}
    if suffix == ".png":
        save_picture(path, snapshots, size=size, scale=scale, strip=strip, **texts)
    elif suffix == ".svg":
        if strip is not None:
            raise RenderError(f"{path}: several moments side by side are a PNG; end the name in .png")
        trails = Trails.of(snapshots)
        save_moment(path, snapshots[-1], size=size, scale=scale, trails=trails, **texts)
    elif suffix == ".html":
        save_page(path, snapshots, commands=commands, labels=labels, **texts)
    else:
        save_film(path, snapshots, fps=fps, speed=speed, size=size, scale=scale, **texts)
