"""What a device does just now, drawn: its sticks, what else is held, and what the robot would be asked for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import pygame
from pygame import Rect, Vector2

from ..agents.controllers.teleoperation import STICKS, Axis, Hand
from ..view.fonts import rendered, shortened, width_of
from ..view.palette import BLUE, FAINT, INK, ORANGE, PAPER, Colour
from .actions import in_words
from .bindings import is_numbered

_LINE: Colour = (200, 204, 210)
_TINT: Colour = (236, 239, 243)
_BARS: tuple[tuple[Axis, str, str, int], ...] = (  # which way is positive: 1 to the right, -1 to the left
    ("ahead", "back", "ahead", 1), ("turn", "turn left", "turn right", -1), ("left", "left", "right", -1),
    ("brake", "", "brake", 1),
)  # fmt: skip
_TITLES = {
    "left_x": "left stick",
    "right_x": "right stick",
    "drag_x": "drag",
    "axis0": "axes 0, 1",
    "axis2": "axes 2, 3",
}


def sticks_of(slot: str, is_named: bool) -> tuple[str, ...]:
    """The first controls of the sticks that a device has."""
    if slot.startswith("pad"):
        return ("left_x", "right_x") if is_named else ("axis0", "axis2")
    return ("drag_x",) if slot == "mouse" else ()


@dataclass(frozen=True, slots=True)
class DevicePicture:
    """Draws a device as it stands.

    Attributes:
        surface: is drawn on.
        hand: how the device is read.
        values: where its controls stand, -1..1.
        sticks: first controls of its sticks; none for a keyboard.
        is_named: whether its controls have names, or numbers.
        size: of text, pixels.
    """

    surface: pygame.Surface
    hand: Hand
    values: Mapping[str, float]
    sticks: Sequence[str]
    is_named: bool
    size: int

    def draw(self, box: Rect) -> None:
        """Sticks above, then what else is held beside the curve, then what the robot is asked for."""
        row = self.size + 8
        bars = Rect(box.left, box.bottom - len(_BARS) * row, box.width, len(_BARS) * row)
        is_small = box.height < 13 * row
        if self.sticks and is_small:
            self._draw_sticks(Rect(box.left, box.top, box.width, bars.top - box.top - row // 2))
        elif self.sticks:
            middle = Rect(box.left, bars.top - row - box.height // 4, box.width, box.height // 4)
            self._draw_sticks(Rect(box.left, box.top, box.width, middle.top - box.top - row // 2))
            curve = Rect(box.left, middle.top, middle.height, middle.height)
            self._draw_curve(curve)
            self._draw_caps(Rect(curve.right + row, middle.top, box.right - curve.right - row, middle.height))
        else:
            self._write("Press keys to try them.", FAINT, topleft=(box.left, box.top))
            large = self if is_small else replace(self, size=round(self.size * 1.3))
            large._draw_caps(Rect(box.left, box.top + row, box.width, bars.top - box.top - row))
        asked = self.hand.read(self.values)
        for number, (axis, left, right, way) in enumerate(_BARS):
            self._draw_bar(bars.move(0, number * row), way * asked[axis], left, right)

    def _draw_sticks(self, box: Rect) -> None:
        """Circles side by side, each with its name below."""
        cell = box.width / len(self.sticks)
        radius = min(box.height - self.size - 10, cell - 16) / 2
        pairs = [pair for pair in STICKS if pair[0] in self.sticks]
        for number, (first, second) in enumerate(pairs):
            centre = Vector2(box.left + cell * (number + 0.5), box.top + radius)
            self._draw_stick(centre, radius, (self.values.get(first, 0.0), self.values.get(second, 0.0)))
            below = round(centre.x), round(centre.y + radius + 4)
            self._write(_TITLES[first], FAINT, midtop=below)

    def _draw_stick(self, centre: Vector2, radius: float, place: tuple[float, float]) -> None:
        """The dead zone in the middle; a ring where the stick stands, a disc for what it is taken for."""
        surface, dead, dot = self.surface, self.hand.dead_zone * radius, max(radius * 0.08, 4.0)
        pygame.draw.aacircle(surface, _TINT, centre, dead)
        for arm in (Vector2(radius, 0.0), Vector2(0.0, radius)):
            pygame.draw.line(surface, _LINE, centre - arm, centre + arm)
        if dead >= 1.0:
            pygame.draw.aacircle(surface, ORANGE, centre, dead, 2)
        pygame.draw.aacircle(surface, INK, centre, radius, 2)
        pygame.draw.aacircle(surface, BLUE, centre + Vector2(self.hand.shaped(*place)) * radius, dot)
        pygame.draw.aacircle(surface, INK, centre + Vector2(place) * radius, dot + 3, 2)

    def _draw_curve(self, box: Rect) -> None:
        """Upwards what the robot is asked for, by how far a stick is moved, to the right."""
        dead = Rect(box.left, box.top, round(self.hand.dead_zone * box.width), box.height)
        pygame.draw.rect(self.surface, _TINT, dead)
        if dead.width:
            pygame.draw.line(self.surface, ORANGE, dead.topright, (dead.right, dead.bottom - 1), 2)
        answers = [(k / 40, self.hand.shaped(k / 40, 0.0)[0]) for k in range(41)]
        inside = box.inflate(-4, -4)
        points = [(inside.left + x * inside.width, inside.bottom - y * inside.height) for x, y in answers]
        for lower in (-0.5, 0.0, 0.5):  # a thick line is not smooth, so a few thin ones
            pygame.draw.aalines(self.surface, BLUE, False, [(x, y + lower) for x, y in points])
        pygame.draw.rect(self.surface, INK, box, 2)

    def _draw_caps(self, box: Rect) -> None:
        """A cap for each control that drives and is no stick, and for whatever else is held; those held are filled."""
        drawn = {control for pair in STICKS if pair[0] in self.sticks for control in pair}
        bound = [control for control in self.hand.controls if is_numbered(control) is not self.is_named]
        held = [control for control, value in self.values.items() if abs(value) > 0.05]
        x, y, height = box.left, box.top, self.size + 14
        for control in dict.fromkeys(control for control in (*bound, *held) if control not in drawn):
            words = shortened(self._told(control), box.width - 16, self.size)
            width = width_of(words, self.size) + 16
            if x > box.left and x + width > box.right:
                x, y = box.left, y + height + 6
            if y + height > box.bottom:
                break
            self._draw_cap(Rect(x, y, width, height), words, control in held)
            x += width + 6

    def _draw_cap(self, cap: Rect, words: str, is_held: bool) -> None:
        pygame.draw.rect(self.surface, BLUE if is_held else PAPER, cap, border_radius=6)
        pygame.draw.rect(self.surface, BLUE if is_held else _LINE, cap, 2, border_radius=6)
        self._write(words, PAPER if is_held else INK, center=cap.center)

    def _draw_bar(self, box: Rect, value: float, left: str, right: str) -> None:
        """What is asked of the robot along one axis, from the middle out; positive is to the right."""
        side = width_of("turn right", self.size) + 10
        track = Rect(box.left + side, box.top + 2, box.width - 2 * side, self.size)
        reach = round(min(abs(value), 1.0) * track.width / 2)
        pygame.draw.rect(self.surface, _TINT, track, border_radius=4)
        start = track.centerx - (reach if value < 0.0 else 0)
        pygame.draw.rect(self.surface, BLUE, (start, track.top, reach, track.height))
        pygame.draw.line(self.surface, INK, track.midtop, (track.centerx, track.bottom - 1), 2)
        self._write(left, INK, midright=(track.left - 8, track.centery))
        self._write(right, INK, midleft=(track.right + 8, track.centery))

    def _told(self, control: str) -> str:
        value = self.values.get(control, 0.0)
        return in_words(control) + (f" {value:+.2f}" if 0.05 < abs(value) < 0.995 else "")

    def _write(self, words: str, colour: Colour, **place: tuple[int, int]) -> None:
        line = rendered(words, self.size, colour)
        self.surface.blit(line, line.get_rect(**place))
