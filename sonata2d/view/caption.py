"""Words on a picture: the strip below it with caption, scale bar and time bar, and small labels within it."""

from __future__ import annotations

import pygame

from ..entities import Scene
from ..frame import Snapshot
from ..geometry import Point
from .palette import FAINT, INK, PAPER, WALL, Colour, time_colour

STRIP = 34  # pixels
_EDGE, _TEXT, _SMALL = 14, 18, 16
_GAP = 22


def write(
    surface: pygame.Surface,
    text: str,
    place: Point,
    *,
    size: int = _TEXT,
    colour: Colour = INK,
    anchor: str = "midleft",
) -> pygame.Rect:
    """Write one line; `anchor` names the point of its box that lies at `place`, as pygame's rectangles do."""
    if not pygame.font.get_init():
        pygame.font.init()
    line = pygame.font.Font(None, size).render(text, True, colour)
    box = line.get_rect(**{anchor: (round(place[0]), round(place[1]))})
    surface.blit(line, box)
    return box


def width_of(text: str, size: int = _TEXT) -> int:
    """How many pixels a line takes."""
    if not pygame.font.get_init():
        pygame.font.init()
    return pygame.font.Font(None, size).size(text)[0]


def shortened(text: str, room: float, size: int = _TEXT) -> str:
    """The text, or as much of its beginning as fits into so many pixels."""
    if width_of(text, size) <= room:
        return text
    while text and width_of(text + "…", size) > room:
        text = text[:-1]
    return text.rstrip() + "…" if text else ""


def origin(scene: Scene) -> str:
    """Where a scene comes from: seed and episode."""
    return f"seed {scene.seed} / episode {scene.episode}"


def summary(snapshot: Snapshot, outcome: str | None = None) -> str:
    """Scenario, seed and episode, time, and how it ended."""
    parts = [snapshot.scene.name, origin(snapshot.scene), f"t = {snapshot.time:.1f} s"]
    return "   ".join([*parts, outcome] if outcome else parts)


def draw_strip(surface: pygame.Surface, text: str, scale: float, span: tuple[float, float] | None) -> None:
    """Caption to the left, bars to the right, at the bottom of the picture."""
    width, height = surface.get_size()
    middle = height - STRIP // 2 - 2
    free = _scale_bar(surface, (width - _EDGE, middle), scale) - _GAP
    if span is not None and free > 420:
        free = _time_bar(surface, (free, middle), span) - _GAP
    write(surface, shortened(text, free - _EDGE), (_EDGE, middle))


def _scale_bar(surface: pygame.Surface, right: tuple[int, int], scale: float) -> int:
    """One metre as a bar with end marks; the leftmost pixel it takes."""
    (x, y), length = right, round(scale)
    pygame.draw.rect(surface, INK, (x - length, y - 1, length, 2))
    for end in (x - length, x - 2):
        pygame.draw.rect(surface, INK, (end, y - 5, 2, 10))
    return write(surface, "1 m", (x - length - 6, y), size=_SMALL, anchor="midright").left


def _time_bar(surface: pygame.Surface, right: tuple[int, int], span: tuple[float, float], length: int = 90) -> int:
    """The colours of the robot's trail with the times they stand for; the leftmost pixel it takes."""
    end = write(surface, f"{span[1]:.1f} s", right, size=_SMALL, colour=FAINT, anchor="midright")
    x = end.left - 6 - length
    for k in range(length):
        pygame.draw.rect(surface, time_colour(k / (length - 1)), (x + k, right[1] - 4, 1, 8))
    return write(surface, f"{span[0]:.1f}", (x - 6, right[1]), size=_SMALL, colour=FAINT, anchor="midright").left


def label(surface: pygame.Surface, text: str, place: Point) -> None:
    """A small text on a light plate, standing on `place`."""
    box = pygame.Rect(0, 0, width_of(text, _SMALL) + 6, _SMALL)
    box.midbottom = (round(place[0]), round(place[1]) - 2)
    pygame.draw.rect(surface, PAPER, box, border_radius=4)
    pygame.draw.rect(surface, WALL, box, width=1, border_radius=4)
    write(surface, text, box.center, size=_SMALL, anchor="center")
