"""What the colours stand for: a small plate in the picture's corner."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial

import pygame

from .brush import Brush
from .camera import Camera
from .canvas import Canvas
from .caption import SMALL
from .fonts import width_of
from .palette import ACTIVITY, INK, PAPER, WALL
from .people import draw_body, draw_chassis, draw_head, draw_target

_ROW, _SIGN, _PAD, _EDGE = 22, 8.5, 8, 10  # pixels; of the sign its radius


def draw_legend(canvas: Canvas, size: tuple[int, int], activities: Iterable[str]) -> None:
    """Draw the plate in the upper right corner of a picture of this size in pixels.

    Args:
        activities: of the people who are there; each is named once.
    """
    occurring = set(activities)
    rows: list[tuple[str, Callable[[Brush], None]]] = [
        (name, partial(_draw_person, activity=name)) for name in ACTIVITY if name in occurring
    ]
    rows += [("robot", partial(draw_chassis, r=0.2)), ("goal", partial(draw_target, reach=0.2))]
    width = max(width_of(name, SMALL) for name, _ in rows) + 2 * _PAD + 26
    plate = pygame.Rect(size[0] - _EDGE - width, _EDGE, width, len(rows) * _ROW + _PAD)
    with canvas.group("legend"):
        canvas.rectangle(PAPER, plate, WALL)
        for k, (name, draw) in enumerate(rows):
            x, y = plate.left + _PAD + _SIGN, plate.top + _PAD / 2 + (k + 0.5) * _ROW
            scale = _SIGN / 0.2
            draw(Brush(canvas, Camera(scale, -x / scale, y / scale, size), direction=(0.0, 1.0)))
            canvas.text(INK, name, (x + _SIGN + 9, y), SMALL, "midleft")


def _draw_person(brush: Brush, activity: str) -> None:
    draw_body(brush, activity, 0.2, 0.7)
    draw_head(brush, 0.2)
