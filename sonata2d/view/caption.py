"""Words on a picture: the strip below it with caption, scale bar and time bar, and small labels within it."""

from __future__ import annotations

import pygame

from ..core.geometry import Point
from ..core.scene import Scene
from ..core.snapshot import Snapshot
from .canvas import Canvas
from .fonts import shortened, width_of
from .palette import FAINT, INK, PAPER, WALL, time_colour

STRIP = 34  # pixels
TEXT, SMALL = 18, 16  # pixels
_EDGE, _GAP = 14, 22


def origin(scene: Scene) -> str:
    """Where a scene comes from: seed and episode."""
    return f"seed {scene.seed} / episode {scene.episode}"


def summary(snapshot: Snapshot, outcome: str | None = None) -> str:
    """Scenario, seed and episode, time, and how it ended."""
    parts = [snapshot.scene.name, origin(snapshot.scene), f"t = {snapshot.time:.1f} s"]
    return "   ".join([*parts, outcome] if outcome else parts)


def draw_strip(
    canvas: Canvas, size: tuple[int, int], text: str, scale: float, span: tuple[float, float] | None
) -> None:
    """Caption to the left, bars to the right, at the bottom of a picture of this size in pixels."""
    width, height = size
    middle = height - STRIP // 2 - 2
    free = _scale_bar(canvas, (width - _EDGE, middle), scale) - _GAP
    if span is not None and free > 420:
        free = _time_bar(canvas, (free, middle), span) - _GAP
    canvas.text(INK, shortened(text, free - _EDGE, TEXT), (_EDGE, middle), TEXT, "midleft")


def _scale_bar(canvas: Canvas, right: tuple[int, int], scale: float) -> int:
    """One metre as a bar with end marks; the leftmost pixel it takes."""
    (x, y), length = right, round(scale)
    canvas.rectangle(INK, pygame.Rect(x - length, y - 1, length, 2))
    for end in (x - length, x - 2):
        canvas.rectangle(INK, pygame.Rect(end, y - 5, 2, 10))
    return canvas.text(INK, "1 m", (x - length - 6, y), SMALL, "midright").left


def _time_bar(canvas: Canvas, right: tuple[int, int], span: tuple[float, float], length: int = 90) -> int:
    """The colours of the robot's trail with the times they stand for; the leftmost pixel it takes."""
    end = canvas.text(FAINT, f"{span[1]:.1f} s", right, SMALL, "midright")
    x = end.left - 6 - length
    for k in range(length):
        canvas.rectangle(time_colour(k / (length - 1)), pygame.Rect(x + k, right[1] - 4, 1, 8))
    return canvas.text(FAINT, f"{span[0]:.1f}", (x - 6, right[1]), SMALL, "midright").left


def label(canvas: Canvas, text: str, place: Point) -> None:
    """A small text on a light plate, standing on `place`."""
    box = pygame.Rect(0, 0, width_of(text, SMALL) + 6, SMALL)
    box.midbottom = (round(place[0]), round(place[1]) - 2)
    canvas.rectangle(PAPER, box, WALL)
    canvas.text(INK, text, box.center, SMALL)
