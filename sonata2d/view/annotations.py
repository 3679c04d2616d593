"""Text on a picture: the strip below it with caption, scale bar and time bar; labels; the legend."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial

import pygame

from ..core.geometry import Point
from ..core.scene import Scene
from ..core.snapshot import Snapshot
from .brush import Brush
from .camera import Camera
from .canvas import Canvas
from .figures import draw_body, draw_chassis, draw_head, draw_target
from .fonts import shortened, width_of
from .palette import ACTIVITY, FAINT, INK, PAPER, WALL, time_colour

STRIP = 34  # px, height of the strip
TEXT, SMALL = 18, 16  # px, font sizes
_EDGE, _GAP = 14, 22  # px
_MIN_TIME_BAR_WIDTH = 420  # px; a narrower strip has no time bar
_LEGEND_ROW, _LEGEND_RADIUS, _LEGEND_PADDING, _LEGEND_EDGE = 22, 8.5, 8, 10  # px


def origin(scene: Scene) -> str:
    """Seed and episode of a scene as text."""
    return f"seed {scene.seed} / episode {scene.episode}"


def summary(snapshot: Snapshot, outcome: str | None = None) -> str:
    """Default caption: scenario, seed and episode, time, outcome."""
    parts = [snapshot.scene.name, origin(snapshot.scene), f"t = {snapshot.time:.1f} s"]
    return "   ".join([*parts, outcome] if outcome else parts)


def draw_strip(
    canvas: Canvas, size: tuple[int, int], text: str, scale: float, span: tuple[float, float] | None
) -> None:
    """Draw the caption on the left and the bars on the right of the strip.

    Args:
        size: width and height of the picture, strip included, px.
        text: the caption; shortened if it is too long.
        scale: pixels per metre.
        span: first and last time of the robot's trail, s; None omits the time bar.
    """
    width, height = size
    middle = height - STRIP // 2 - 2
    right = _draw_scale_bar(canvas, (width - _EDGE, middle), scale) - _GAP
    if span is not None and right > _MIN_TIME_BAR_WIDTH:
        right = _draw_time_bar(canvas, (right, middle), span) - _GAP
    canvas.text(INK, shortened(text, right - _EDGE, TEXT), (_EDGE, middle), TEXT, "midleft")


def _draw_scale_bar(canvas: Canvas, right: tuple[int, int], scale: float) -> int:
    """Draw a bar of one metre that ends at `right`; returns its leftmost pixel."""
    (x, y), length = right, round(scale)
    canvas.rectangle(INK, pygame.Rect(x - length, y - 1, length, 2))
    for end in (x - length, x - 2):
        canvas.rectangle(INK, pygame.Rect(end, y - 5, 2, 10))
    return canvas.text(INK, "1 m", (x - length - 6, y), SMALL, "midright").left


def _draw_time_bar(canvas: Canvas, right: tuple[int, int], span: tuple[float, float], length: int = 90) -> int:
    """Draw the colours of the robot's trail between first and last time; returns the leftmost pixel."""
    end = canvas.text(FAINT, f"{span[1]:.1f} s", right, SMALL, "midright")
    x = end.left - 6 - length
    for k in range(length):
        canvas.rectangle(time_colour(k / (length - 1)), pygame.Rect(x + k, right[1] - 4, 1, 8))
    return canvas.text(FAINT, f"{span[0]:.1f}", (x - 6, right[1]), SMALL, "midright").left


def draw_label(canvas: Canvas, text: str, place: Point) -> None:
    """Draw a small text on a light plate that stands on a pixel position."""
    box = pygame.Rect(0, 0, width_of(text, SMALL) + 6, SMALL)
    box.midbottom = (round(place[0]), round(place[1]) - 2)
    canvas.rectangle(PAPER, box, WALL)
    canvas.text(INK, text, box.center, SMALL)


def draw_legend(canvas: Canvas, size: tuple[int, int], activities: Iterable[str]) -> None:
    """Draw the meaning of the colours on a plate in the upper right corner.

    Args:
        size: width and height of the picture, px.
        activities: of the pedestrians in the picture; each activity is listed once.
    """
    present = set(activities)
    rows: list[tuple[str, Callable[[Brush], None]]] = [
        (name, partial(_draw_human, activity=name)) for name in ACTIVITY if name in present
    ]
    rows += [("robot", partial(draw_chassis, r=0.2)), ("goal", partial(draw_target, radius=0.2))]
    width = max(width_of(name, SMALL) for name, _ in rows) + 2 * _LEGEND_PADDING + 26
    height = len(rows) * _LEGEND_ROW + _LEGEND_PADDING
    plate = pygame.Rect(size[0] - _LEGEND_EDGE - width, _LEGEND_EDGE, width, height)
    with canvas.group("legend"):
        canvas.rectangle(PAPER, plate, WALL)
        for k, (name, draw) in enumerate(rows):
            x, y = (
                plate.left + _LEGEND_PADDING + _LEGEND_RADIUS,
                plate.top + _LEGEND_PADDING / 2 + (k + 0.5) * _LEGEND_ROW,
            )
            scale = _LEGEND_RADIUS / 0.2
            draw(Brush(canvas, Camera(scale, -x / scale, y / scale, size), direction=(0.0, 1.0)))
            canvas.text(INK, name, (x + _LEGEND_RADIUS + 9, y), SMALL, "midleft")


def _draw_human(brush: Brush, activity: str) -> None:
    draw_body(brush, activity, 0.2, 0.7)
    draw_head(brush, 0.2)
