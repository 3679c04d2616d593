"""One episode as one picture."""

from __future__ import annotations

import base64
import io
from collections.abc import Sequence
from pathlib import Path

import pygame

from ..core.snapshot import Snapshot
from ..errors import RenderError
from .draw import Layers, picture
from .sheet import moments
from .trails import Trails


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
    """Write a PNG of an episode: its last moment with the ways that led there, or `strip` moments side by side.

    Args:
        size, scale, layers, caption, outcome: as for `picture`; a strip heeds no size.

    Raises:
        RenderError: the picture cannot be drawn or written.
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


def save_surface(surface: pygame.Surface, path: str | Path) -> None:
    """Write a surface as PNG.

    Raises:
        RenderError: the name does not end in .png, or the file cannot be written.
    """
    if Path(path).suffix.lower() != ".png":
        raise RenderError(f"{path}: a picture is written as PNG; end the name in .png")
    try:
        with open(path, "wb") as file:
            pygame.image.save(surface, file, "picture.png")
    except (OSError, pygame.error) as error:
        raise RenderError(f"cannot write {path}: {error}") from error


def url_of(surface: pygame.Surface) -> str:
    """A surface as a PNG within a URL, for a page that must not need another file."""
    file = io.BytesIO()
    pygame.image.save(surface, file, "picture.png")
    return "data:image/png;base64," + base64.b64encode(file.getvalue()).decode("ascii")
