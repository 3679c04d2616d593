"""Texts, plates and signs over a picture, in pixels: the readings while driving (HUD), cards and tints."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np
import pygame

from ..core.geometry import Point
from ..core.proxemics import INTIMATE_DISTANCE, PERSONAL_DISTANCE, clearances
from ..core.snapshot import Snapshot
from ..view.camera import Camera
from ..view.canvas import PixelCanvas, put
from ..view.fonts import shortened, width_of
from ..view.palette import FAINT, GOAL, INK, METAL, PAPER, Colour, mixed, shaded

Light = Literal["waiting", "recording", "paused", "frozen", "replay", "watching"]

_REFERENCE_SIZE = (640, 480)  # px, the smallest surface for texts at scale 1
_TEXT, _PADDING, _PLATE_ALPHA = 21, 8, 222
_RED: Colour = (200, 30, 30)
_AMBER: Colour = (176, 108, 0)
_LIGHTS: dict[str, tuple[str, Colour]] = {  # sign and colour
    "waiting": ("ring", FAINT),
    "recording": ("dot", _RED),
    "paused": ("bars", _AMBER),
    "frozen": ("square", (0, 90, 150)),
    "replay": ("play", shaded(GOAL, 0.2)),
    "watching": ("eye", INK),
}
_GAUGE, _KEY = 196, 18  # px at scale 1: width of the box with clearance and speed, font size of keys
_DIM = (150, 152, 158)  # of 255, the brightness that remains below a card
_CARD_TITLE, _CARD_LINE, _CARD_PADDING = 34, 23, 26


@dataclass(frozen=True)
class Pen:
    """Writes on a surface; lengths are pixels at scale 1, places are pixels of the surface."""

    surface: pygame.Surface
    scale: float

    @classmethod
    def on(cls, surface: pygame.Surface, scale: float) -> Pen:
        """A pen of the requested scale, limited by the size of the surface."""
        limit = min(side / minimum for side, minimum in zip(surface.get_size(), _REFERENCE_SIZE, strict=True))
        return cls(surface, max(min(scale, limit), 0.25))

    def px(self, length: float) -> int:
        """Convert a length at scale 1 to pixels of the surface, at least 1."""
        return max(round(length * self.scale), 1)

    @property
    def row(self) -> int:
        """Height of a plate with one line, px."""
        return self.px(30)

    @property
    def gap(self) -> int:
        """Distance between plates, px."""
        return self.px(8)

    def width(self, text: str, size: float = _TEXT) -> int:
        """Width of a line, px."""
        return width_of(text, self.px(size))

    def fitted(self, text: str, max_width: float, size: float = _TEXT) -> str:
        """The line, shortened to a width in pixels."""
        return shortened(text, max_width, self.px(size))

    def write(
        self, text: str, place: Point, *, colour: Colour = INK, size: float = _TEXT, anchor: str = "midleft"
    ) -> pygame.Rect:
        """Write a line; `anchor` names the point of its box at `place`, as in `pygame.Rect`. Returns the box."""
        return PixelCanvas(self.surface).text(colour, text, place, self.px(size), anchor)

    def plate(self, box: pygame.Rect, *, colour: Colour = PAPER, alpha: int = _PLATE_ALPHA) -> None:
        """Draw a translucent plate with round corners."""
        put(self.surface, _plate_image(box.size, self.px(7), colour, alpha), *box.topleft)

    def panel(self, text: str, place: Point, anchor: str, *, max_width: float, colour: Colour = INK) -> pygame.Rect:
        """Write a line on a plate, shortened to `max_width` pixels; returns an empty box if nothing fits."""
        padding = self.px(_PADDING)
        line = self.fitted(text, max_width - 2 * padding)
        box = pygame.Rect(0, 0, self.width(line) + 2 * padding if line else 0, self.row if line else 0)
        setattr(box, anchor, (round(place[0]), round(place[1])))
        if line:
            self.plate(box)
            self.write(line, (box.left + padding, box.centery), colour=colour)
        return box

    def sign(self, kind: str, centre: Point, radius: float, colour: Colour) -> None:
        """Draw a small sign: dot, ring, eye, bars, square, triangle, play or diamond; radius in pixels."""
        canvas, r, (x, y) = PixelCanvas(self.surface), radius, centre
        if kind == "dot":
            canvas.circle(colour, centre, r)
        elif kind in ("ring", "eye"):
            canvas.ring(colour, centre, r, max(r / 3, 1.5))
            if kind == "eye":
                canvas.circle(colour, centre, r * 0.4)
        elif kind == "bars":
            for left in (x - 0.8 * r, x + 0.2 * r):
                canvas.polygon(colour, _box(left, y - 0.9 * r, 0.6 * r, 1.8 * r))
        elif kind == "square":
            canvas.polygon(colour, _box(x - 0.85 * r, y - 0.85 * r, 1.7 * r, 1.7 * r))
        elif kind == "triangle":
            canvas.polygon(colour, [(x, y - r), (x + r, y + 0.8 * r), (x - r, y + 0.8 * r)])
        elif kind == "play":
            canvas.polygon(colour, [(x + r, y), (x - 0.7 * r, y + r), (x - 0.7 * r, y - r)])
        elif kind == "diamond":
            canvas.polygon(colour, [(x + r, y), (x, y + r), (x - r, y), (x, y - r)])

    def arrow(self, tip: Point, angle: float, length: float, colour: Colour) -> None:
        """Draw an arrow head that points along an angle, rad, clockwise from the right; length in pixels."""
        c, s = math.cos(angle), math.sin(angle)
        shape = [(0.0, 0.0), (-1.0, 0.62), (-0.72, 0.0), (-1.0, -0.62)]
        points = [(tip[0] + length * (a * c - b * s), tip[1] + length * (a * s + b * c)) for a, b in shape]
        PixelCanvas(self.surface).polygon(colour, points)


def _box(left: float, top: float, width: float, height: float) -> list[Point]:
    return [(left, top), (left + width, top), (left + width, top + height), (left, top + height)]


@lru_cache(maxsize=128)
def _plate_image(size: tuple[int, int], corner: int, colour: Colour, alpha: int) -> pygame.Surface:
    """A premultiplied plate, supersampled for its round corners."""
    large = pygame.Surface((2 * size[0], 2 * size[1]), pygame.SRCALPHA, 32)
    shade = tuple(round(value * alpha / 255) for value in colour)
    pygame.draw.rect(large, (*shade, alpha), large.get_rect(), border_radius=2 * corner)
    return pygame.transform.smoothscale(large, size)


# The readings while driving


@dataclass(frozen=True, slots=True)
class Hud:
    """The readings that do not follow from the snapshot.

    Attributes:
        run, runs: number of the current run and of all runs; `runs` is None without a limit.
        kept: number of runs kept so far.
        contributor: name of the person who drives.
        light: state of the recording.
        label: current label as text; empty without a question.
        keys: active keys and their functions.
        notice: a message shown prominently.
    """

    run: int = 1
    runs: int | None = None
    kept: int = 0
    contributor: str = ""
    light: Light = "waiting"
    label: str = ""
    keys: tuple[tuple[str, str], ...] = ()
    notice: str = ""


def draw_hud(
    surface: pygame.Surface,
    hud: Hud,
    snapshot: Snapshot,
    camera: Camera,
    *,
    scale: float = 1.0,
    title: str = "",
    question: str = "",
) -> None:
    """Draw all readings over a finished picture.

    Args:
        camera: the camera of the picture.
        scale: of texts and signs; limited by the size of the surface.
        title: shown at the top centre.
        question: the question that the label answers.
    """
    pen = Pen.on(surface, scale)
    top = _draw_top(pen, hud, snapshot.time, title)
    bottom = _draw_keys(pen, hud.keys)
    free_bottom = min(_draw_gauges(pen, snapshot, bottom), _draw_label(pen, hud.label, question, bottom))
    if hud.notice:
        top = _draw_notice(pen, hud.notice, top)
    free = pygame.Rect(pen.gap, top, surface.get_width() - 2 * pen.gap, max(free_bottom - top, 1))
    _draw_goal_distance(pen, snapshot, camera, free)


# Each of the following functions returns the y coordinate at which the free part of the picture starts or ends, px.


def _draw_top(pen: Pen, hud: Hud, time: float, title: str) -> int:
    """Draw run, time and contributor on the left, the light on the right, the title between them."""
    width, gap = pen.surface.get_width(), pen.gap
    light = _draw_light(pen, hud.light)
    run = f"run {hud.run}" + (f" of {hud.runs}" if hud.runs is not None else "")
    parts = [run, f"{time:.1f} s", f"kept {hud.kept}" if hud.kept else "", pen.fitted(hud.contributor, 0.2 * width)]
    text = "   ".join(part for part in parts if part)
    left = pen.panel(text, (gap, gap), "topleft", max_width=light.left - 2 * gap)
    free = light.left - left.right - 2 * gap
    if title and free > pen.px(90):
        pen.panel(title, (left.right + gap + free // 2, gap), "midtop", max_width=free)
    return left.bottom + gap


def _draw_light(pen: Pen, light: Light) -> pygame.Rect:
    kind, colour = _LIGHTS[light]
    padding, radius = pen.px(10), pen.px(7)
    box = pygame.Rect(0, 0, pen.width(light) + 2 * padding + 3 * radius, pen.row)
    box.topright = pen.surface.get_width() - pen.gap, pen.gap
    pen.plate(box)
    pen.sign(kind, (box.left + padding + radius, box.centery), radius, colour)
    pen.write(light, (box.left + padding + 3 * radius, box.centery), colour=colour)
    return box


def _draw_keys(pen: Pen, keys: tuple[tuple[str, str], ...]) -> int:
    """Draw keys and their functions along the bottom, as many as fit."""
    gap, (width, height) = pen.gap, pen.surface.get_size()
    if not keys:
        return height - gap
    padding, shown, used = pen.px(6), [], 2 * pen.px(6)
    for key, function in keys:
        widths = pen.width(key, _KEY) + 2 * padding, pen.width(function, _KEY) + 3 * padding
        if used + sum(widths) > width - 2 * gap:
            break
        used += sum(widths)
        shown.append((key, function, widths))
    bar = pygame.Rect(gap, height - gap - pen.row, used, pen.row)
    bar.centerx = width // 2
    pen.plate(bar)
    x = bar.left + 2 * padding
    for key, function, (cap_width, text_width) in shown:
        cap = pygame.Rect(x, 0, cap_width, pen.px(21))
        cap.centery = bar.centery
        pen.plate(cap, colour=mixed(METAL, PAPER, 0.35), alpha=255)
        pen.write(key, cap.center, size=_KEY, anchor="center")
        pen.write(function, (cap.right + padding, bar.centery), size=_KEY, colour=mixed(INK, FAINT, 0.4))
        x += cap_width + text_width
    return bar.top - gap


def _draw_gauges(pen: Pen, snapshot: Snapshot, bottom: int) -> int:
    """Draw clearance and speed in the lower left corner; nothing for a run without a recorded robot."""
    if "robot" in snapshot.scene.unmeasured:
        return bottom
    box = pygame.Rect(pen.gap, 0, pen.px(_GAUGE), 2 * pen.row)
    box.bottom = bottom
    pen.plate(box)
    padding, robot = pen.px(10), snapshot.robot
    _draw_clearance(pen, snapshot, (box.left + padding, box.top + pen.row // 2))
    y, speed = box.bottom - pen.row // 2, math.hypot(*robot.velocity)
    pen.write(f"{speed:.2f} m/s", (box.left + padding, y))
    left = box.left + padding + pen.px(84)
    track = pygame.Rect(left, y - pen.px(4), box.right - padding - left, pen.px(8))
    pygame.draw.rect(pen.surface, mixed(METAL, PAPER, 0.3), track, border_radius=pen.px(4))
    fraction = min(speed / robot.body.limits.ahead, 1.0)
    if fraction > 0.01:
        bar = track.copy()
        bar.width = max(round(track.width * fraction), pen.px(4))
        pygame.draw.rect(pen.surface, INK, bar, border_radius=pen.px(4))
    return box.top - pen.gap


def _draw_clearance(pen: Pen, snapshot: Snapshot, place: tuple[int, int]) -> None:
    gaps = clearances(snapshot)
    gaps = gaps[np.isfinite(gaps)]
    if not len(gaps):
        pen.write("no pedestrians", place, colour=FAINT)
        return
    nearest = float(gaps.min())
    word, sign, colour = zone_of(nearest)
    radius = pen.px(7)
    pen.sign(sign, (place[0] + radius, place[1]), radius, colour)
    pen.write(f"{max(nearest, 0.0):.2f} m  {word}", (place[0] + 3 * radius, place[1]), colour=colour)


def zone_of(clearance: float) -> tuple[str, str, Colour]:
    """Name, sign and colour of Hall's zone at a clearance, m; "clear" beyond the personal zone."""
    if clearance < INTIMATE_DISTANCE:
        return "intimate", "diamond", _RED
    if clearance < PERSONAL_DISTANCE:
        return "personal", "triangle", _AMBER
    return "clear", "ring", shaded(GOAL, 0.3)


def _draw_label(pen: Pen, label: str, question: str, bottom: int) -> int:
    """Draw the label below its question, in the lower right corner."""
    right = pen.surface.get_width() - pen.gap
    max_width = right - pen.px(_GAUGE) - 3 * pen.gap
    for text, colour in ((label, INK), (question if label else "", mixed(INK, FAINT, 0.6))):
        if text:
            box = pen.panel(text, (right, bottom), "bottomright", max_width=max_width, colour=colour)
            bottom = box.top - pen.px(2)
    return bottom - pen.gap


def _draw_notice(pen: Pen, notice: str, top: int) -> int:
    """Draw the notice on a dark plate, so that it stands out."""
    width, padding = pen.surface.get_width(), pen.px(16)
    line = pen.fitted(notice, width - 2 * pen.gap - 2 * padding, 26)
    box = pygame.Rect(0, top, pen.width(line, 26) + 2 * padding, pen.px(38))
    box.centerx = width // 2
    pen.plate(box, colour=INK, alpha=235)
    pen.write(line, box.center, colour=PAPER, size=26, anchor="center")
    return box.bottom + pen.gap


def _draw_goal_distance(pen: Pen, snapshot: Snapshot, camera: Camera, free: pygame.Rect) -> None:
    """Write the distance to the goal next to it if it is in view, else next to an arrow at the edge towards it."""
    if {"robot", "goal"} & snapshot.scene.unmeasured:
        return
    goal, robot = snapshot.goal, snapshot.robot.position
    text = f"{math.hypot(goal.x - robot[0], goal.y - robot[1]):.1f} m"
    x, y = camera.to_pixels(goal.position)
    if pen.surface.get_rect().collidepoint(x, y):
        centre = x, y + goal.distance * camera.scale + pen.px(14)
    else:
        middle, size, margin = free.center, pen.px(30), pen.px(4)
        angle = math.atan2(y - middle[1], x - middle[0])
        c, s = math.cos(angle), math.sin(angle)
        radius = min(  # from the middle to the edge of the free part
            (free.width / 2 - margin) / max(abs(c), 1e-9),
            (free.height / 2 - margin) / max(abs(s), 1e-9),
        )
        tip = middle[0] + radius * c, middle[1] + radius * s
        pen.arrow(tip, angle, size, shaded(GOAL, 0.35))
        centre = tip[0] - 1.9 * size * c, tip[1] - 1.6 * size * s
    box = pygame.Rect(0, 0, pen.width(text) + pen.px(12), pen.px(24))
    box.center = round(centre[0]), round(centre[1])
    box.clamp_ip(free)
    pen.plate(box)
    pen.write(text, box.center, colour=shaded(GOAL, 0.45), anchor="center")


# Cards and tints


def draw_veil(surface: pygame.Surface, title: str, lines: Sequence[str] = (), *, scale: float = 1.0) -> None:
    """Dim the picture and show a card at its centre.

    Args:
        title: of the card.
        lines: text below the title; long lines are wrapped, and all text is scaled down if there are too many lines.
        scale: of the texts; limited by the size of the surface.
    """
    surface.fill(_DIM, special_flags=pygame.BLEND_RGB_MULT)
    pen = Pen.on(surface, scale)
    width, height = surface.get_size()
    card_height = _CARD_TITLE * 1.3 + len(lines) * _CARD_LINE * 1.3 + 2 * _CARD_PADDING
    if card_height * pen.scale > 0.94 * height:
        pen = Pen(surface, 0.94 * height / card_height)
    padding = pen.px(_CARD_PADDING)
    max_width = 0.94 * width - 2 * padding
    head = pen.fitted(title, max_width, _CARD_TITLE)
    rows = [row for line in lines for row in _wrapped(pen, line, max_width)]
    card_height = _CARD_TITLE * 1.3 + len(rows) * _CARD_LINE * 1.3 + 2 * _CARD_PADDING
    widths = [pen.width(head, _CARD_TITLE), *(pen.width(row, _CARD_LINE) for row in rows), pen.px(220)]
    box = pygame.Rect(0, 0, max(widths) + 2 * padding, round(card_height * pen.scale))
    box.center = width // 2, height // 2
    pen.plate(box, alpha=245)
    y = box.top + padding + pen.px(_CARD_TITLE * 0.5)
    pen.write(head, (box.centerx, y), size=_CARD_TITLE, anchor="center")
    y += pen.px(_CARD_TITLE * 0.8)
    for k, row in enumerate(rows):
        place = box.centerx, y + round((k + 0.5) * _CARD_LINE * 1.3 * pen.scale)
        pen.write(row, place, size=_CARD_LINE, colour=mixed(INK, PAPER, 0.15), anchor="center")


def _wrapped(pen: Pen, line: str, max_width: float) -> list[str]:
    """Break a line into rows of at most `max_width` pixels; a longer word is shortened."""
    rows = [""]
    for word in line.split(" "):
        longer = f"{rows[-1]} {word}" if rows[-1] else word
        if pen.width(longer, _CARD_LINE) <= max_width or not rows[-1]:
            rows[-1] = longer
        else:
            rows.append(word)
    return [pen.fitted(row, max_width, _CARD_LINE) for row in rows]


def draw_tint(surface: pygame.Surface, colour: Colour, alpha: int) -> None:
    """Blend a colour over the whole picture; alpha is 0 (no effect) to 255 (only the colour)."""
    kept = 255 - alpha
    surface.fill((kept, kept, kept), special_flags=pygame.BLEND_RGB_MULT)
    r, g, b = (value * alpha // 255 for value in colour)
    surface.fill((r, g, b), special_flags=pygame.BLEND_RGB_ADD)
