"""What stands round a replayed run: texts, rows of buttons, a time line to drag, a scale without a default."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import pygame
import pygame_gui
from pygame_gui.elements import UIButton

from ..view.fonts import rendered, shortened, width_of
from ..view.palette import BLUE, FAINT, GRID, INK, PAPER, VERMILLION, Colour
from .player import Player

PLATE: Colour = (250, 249, 246)
EDGE: Colour = (214, 212, 206)
TEXT, SMALL, LARGE = 20, 18, 28  # pixels at scale 1
_PADDING = 8  # pixels, of both sides of a button's text together
_LEAST = 17  # pixels, below which a text is hard to read
Entry = tuple[str, Callable[[], None], str]  # text, what it does, tip


def text_size(size: int, scale: float) -> int:
    """Pixels of a text in a window of this scale; small windows do not make texts too small to read."""
    return max(round(size * scale), _LEAST)


def plate(surface: pygame.Surface, box: pygame.Rect, *, edge: str) -> None:
    """A quiet ground for texts and widgets, with a line along its `top` or `bottom`."""
    surface.fill(PLATE, box)
    y = box.top if edge == "top" else box.bottom - 1
    pygame.draw.line(surface, EDGE, (box.left, y), (box.right - 1, y))


def write(
    surface: pygame.Surface,
    text: str,
    place: tuple[float, float],
    *,
    size: int,
    colour: Colour = INK,
    anchor: str = "midleft",
    room: float = 1e4,
) -> pygame.Rect:
    """One line, cut where the room of so many pixels ends; `anchor` names the point of its box that lies at `place`."""
    line = rendered(shortened(text, room, size), size, colour)
    box = line.get_rect(**{anchor: (round(place[0]), round(place[1]))})
    surface.blit(line, box)
    return box


def wrapped(text: str, room: float, size: int, *, most: int) -> list[str]:
    """The text in lines of so many pixels; what does not fit into `most` lines ends with an ellipsis."""
    lines = [""]
    words = text.split()
    for k, word in enumerate(words):
        longer = f"{lines[-1]} {word}".strip()
        if width_of(longer, size) <= room or not lines[-1]:
            lines[-1] = longer
        elif len(lines) < most:
            lines.append(word)
        else:
            lines[-1] = shortened(" ".join([lines[-1], *words[k:]]), room, size)
            break
    return [shortened(line, room, size) for line in lines if line]


def button_row(
    ui: pygame_gui.UIManager, box: pygame.Rect, entries: Sequence[Entry], *, gap: int = 6, alike: bool = False
) -> list[UIButton]:
    """Buttons side by side that fill a box; each as wide as its text asks, or all alike."""
    font = ui.get_theme().get_font(["button"])
    texts = [0 if alike else font.size(text)[0] for text, _, _ in entries]
    rest = (box.width - gap * (len(entries) - 1) - sum(texts)) / len(entries)
    if rest < _PADDING:  # too narrow for all words: the longest give way
        texts, rest = [0] * len(entries), (box.width - gap * (len(entries) - 1)) / len(entries)
    buttons, left = [], float(box.left)
    for (text, command, tip), own in zip(entries, texts, strict=True):
        place = pygame.Rect(round(left), box.top, round(own + rest), box.height)
        text = _cut(text, place.width - _PADDING, font)
        buttons.append(UIButton(place, text, ui, command=command, tool_tip_text=tip or None))
        left += own + rest + gap
    return buttons


def _cut(text: str, room: float, font: pygame_gui.core.interfaces.IGUIFontInterface) -> str:
    """As much of a text as fits on a button."""
    if font.size(text)[0] <= room:
        return text
    while text and font.size(f"{text}…")[0] > room:
        text = text[:-1]
    return f"{text.rstrip()}…"


class Timeline:
    """How much of a run has gone by, to be dragged.

    Args:
        player: of the run.
        box: where it stands, pixels.
        live: whether it can be dragged.
        marks: whether it shows where the robot touched something.
    """

    def __init__(self, player: Player, box: pygame.Rect, *, live: bool = True, marks: bool = True) -> None:
        self.player, self.box, self.live = player, box, live
        self._marks = player.contacts() if marks else []
        self._held = False

    def handle(self, event: pygame.Event) -> bool:
        """Whether the event was for it."""
        if not self.live:
            return False
        if _pressed(event, self.box.inflate(12, 8)):
            self._held = True
        elif event.type == pygame.MOUSEBUTTONUP and self._held:
            self._held = False
            return True
        elif event.type != pygame.MOUSEMOTION or not self._held:
            return False
        self.player.seek((event.pos[0] - self.box.left) / self.box.width)
        return True

    def draw(self, surface: pygame.Surface) -> None:
        box, share = self.box, self.player.share
        x, y = box.left + round(share * box.width), box.centery
        track = pygame.Rect(box.left, y - 3, box.width, 6)
        pygame.draw.rect(surface, GRID, track, border_radius=3)
        pygame.draw.rect(surface, BLUE, (box.left, y - 3, x - box.left, 6), border_radius=3)
        for mark in self._marks:
            _mark(surface, box.left + round(mark * box.width), y)
        if self.live:
            pygame.draw.circle(surface, PAPER, (x, y), 9)
            pygame.draw.aacircle(surface, BLUE, (x, y), 9, 3)


def _pressed(event: pygame.Event, box: pygame.Rect) -> bool:
    """Whether the left button was pressed in a box."""
    return bool(event.type == pygame.MOUSEBUTTONDOWN and event.button == 1 and box.collidepoint(event.pos))


def _mark(surface: pygame.Surface, x: int, y: int) -> None:
    """A touch: a small wedge that points at the track, and a line through it."""
    pygame.draw.line(surface, VERMILLION, (x, y - 4), (x, y + 4), 2)
    pygame.draw.polygon(surface, VERMILLION, [(x, y - 5), (x - 4, y - 11), (x + 4, y - 11)])


class Scale:
    """A slider from 0 to 1 on which nothing is marked before the person does it, so that nothing is suggested.

    Args:
        box: where it stands, pixels, end words included.
        ends: what 0 and 1 mean.
        scale: of texts.
        value: what was marked before the window changed its size.
    """

    def __init__(
        self, box: pygame.Rect, ends: tuple[str, str], *, scale: float = 1.0, value: float | None = None
    ) -> None:
        self.box, self.value = box, value
        self._ends, self._size, self._held = ends, text_size(TEXT, scale), False
        self.track = pygame.Rect(box.left + 12, box.top + box.height // 3 - 4, box.width - 24, 8)

    def handle(self, event: pygame.Event) -> bool:
        """Whether the event was for it: pressing and dragging along the track, or arrow keys (Shift: finely)."""
        if event.type == pygame.KEYDOWN and event.key in (pygame.K_LEFT, pygame.K_RIGHT):
            self._nudge(1 if event.key == pygame.K_RIGHT else -1, fine=bool(event.mod & pygame.KMOD_SHIFT))
            return True
        if _pressed(event, self.track.inflate(24, 36)):
            self._held = True
        elif event.type == pygame.MOUSEBUTTONUP and self._held:
            self._held = False
            return True
        elif event.type != pygame.MOUSEMOTION or not self._held:
            return False
        self.value = min(max((event.pos[0] - self.track.left) / self.track.width, 0.0), 1.0)
        return True

    def draw(self, surface: pygame.Surface) -> None:
        track, value = self.track, self.value
        pygame.draw.rect(surface, GRID, track, border_radius=4)
        for tenth in range(11):
            x = track.left + round(tenth / 10 * track.width)
            pygame.draw.line(surface, FAINT, (x, track.bottom + 3), (x, track.bottom + (9 if tenth % 5 == 0 else 6)))
        if value is not None:
            x = track.left + round(value * track.width)
            pygame.draw.circle(surface, PAPER, (x, track.centery), 12)
            pygame.draw.aacircle(surface, BLUE, (x, track.centery), 12, 4)
        y = (track.bottom + 9 + self.box.bottom) / 2
        said = "click or press an arrow key" if value is None else f"{value:.2f}"
        middle = write(surface, said, (self.box.centerx, y), size=self._size, colour=FAINT, anchor="center")
        room = (self.box.width - middle.width) / 2 - 16
        write(surface, self._ends[0], (self.box.left, y), size=self._size, room=room)
        write(surface, self._ends[1], (self.box.right, y), size=self._size, anchor="midright", room=room)

    def _nudge(self, direction: int, *, fine: bool) -> None:
        """A step; the first one only marks the middle."""
        step = 0.01 if fine else 0.05
        self.value = 0.5 if self.value is None else min(max(round(self.value + direction * step, 4), 0.0), 1.0)
