"""What lies over the picture while somebody drives: time, run, speed, clearance, the way to the goal, the keys."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
import pygame

from ..core.proxemics import INTIMATE_DISTANCE, PERSONAL_DISTANCE, clearances
from ..core.snapshot import Snapshot
from .camera import Camera
from .palette import FAINT, GOAL, INK, METAL, PAPER, Colour, mixed, shaded
from .pen import Pen

Light = Literal["waiting", "recording", "paused", "frozen", "replay", "watching"]

_RED: Colour = (200, 30, 30)
_AMBER: Colour = (176, 108, 0)
_LIGHTS: dict[str, tuple[str, Colour]] = {
    "waiting": ("ring", FAINT),
    "recording": ("dot", _RED),
    "paused": ("bars", _AMBER),
    "frozen": ("square", (0, 90, 150)),
    "replay": ("play", shaded(GOAL, 0.2)),
    "watching": ("eye", INK),
}
_GAUGE, _KEY = 196, 18  # pixels at scale 1: width of speed and clearance, height of a key's letters


@dataclass(frozen=True, slots=True)
class Hud:
    """What the picture does not know.

    Attributes:
        run, runs: which one of how many; without the latter there is no end.
        kept: runs that were kept so far.
        contributor: who drives.
        light: what is going on.
        label: the label as it stands, in words; empty where none is asked.
        keys: keys of the moment and what they do.
        notice: one line that matters now.
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
    """Draw all of it over a finished picture.

    Args:
        camera: the one the picture was drawn with.
        scale: of texts and signs; heeded as far as the surface has room.
        title: in the upper middle.
        question: what the label answers.
    """
    pen = Pen.on(surface, scale)
    top = _draw_top(pen, hud, snapshot.time, title)
    bottom = _draw_keys(pen, hud.keys)
    high = _draw_gauges(pen, snapshot, bottom)
    high = min(high, _draw_label(pen, hud.label, question, bottom))
    if hud.notice:
        top = _draw_notice(pen, hud.notice, top)
    free = pygame.Rect(pen.gap, top, surface.get_width() - 2 * pen.gap, max(high - top, 1))
    _draw_way(pen, snapshot, camera, free)


def _draw_top(pen: Pen, hud: Hud, time: float, title: str) -> int:
    """Run, time and contributor to the left, the light to the right, the title between; where the free part begins."""
    width, gap = pen.surface.get_width(), pen.gap
    kind, colour = _LIGHTS[hud.light]
    right = _draw_light(pen, hud.light, kind, colour)
    run = f"run {hud.run}" + (f" of {hud.runs}" if hud.runs is not None else "")
    parts = [run, f"{time:.1f} s", f"kept {hud.kept}" if hud.kept else "", pen.fitted(hud.contributor, 0.2 * width)]
    text = "   ".join(part for part in parts if part)
    left = pen.panel(text, (gap, gap), "topleft", room=right.left - 2 * gap)
    room = right.left - left.right - 2 * gap
    if title and room > pen.px(90):
        pen.panel(title, (left.right + gap + room // 2, gap), "midtop", room=room)
    return left.bottom + gap


def _draw_light(pen: Pen, word: str, kind: str, colour: Colour) -> pygame.Rect:
    pad, sign = pen.px(10), pen.px(7)
    box = pygame.Rect(0, 0, pen.width(word) + 2 * pad + 3 * sign, pen.row)
    box.topright = pen.surface.get_width() - pen.gap, pen.gap
    pen.plate(box)
    pen.sign(kind, (box.left + pad + sign, box.centery), sign, colour)
    pen.write(word, (box.left + pad + 3 * sign, box.centery), colour=colour)
    return box


def _draw_keys(pen: Pen, keys: tuple[tuple[str, str], ...]) -> int:
    """Keys along the bottom, as many as fit; where the free part ends."""
    gap, (width, height) = pen.gap, pen.surface.get_size()
    if not keys:
        return height - gap
    pad, shown, used = pen.px(6), [], 2 * pen.px(6)
    for key, does in keys:
        wide = pen.width(key, _KEY) + 2 * pad, pen.width(does, _KEY) + 3 * pad
        if used + sum(wide) > width - 2 * gap:
            break
        used += sum(wide)
        shown.append((key, does, wide))
    bar = pygame.Rect(gap, height - gap - pen.row, used, pen.row)
    bar.centerx = width // 2
    pen.plate(bar)
    x = bar.left + 2 * pad
    for key, does, (cap, rest) in shown:
        box = pygame.Rect(x, 0, cap, pen.px(21))
        box.centery = bar.centery
        pen.plate(box, colour=mixed(METAL, PAPER, 0.35), alpha=255)
        pen.write(key, box.center, size=_KEY, anchor="center")
        pen.write(does, (box.right + pad, bar.centery), size=_KEY, colour=mixed(INK, FAINT, 0.4))
        x += cap + rest
    return bar.top - gap


def _draw_gauges(pen: Pen, snapshot: Snapshot, bottom: int) -> int:
    """Clearance above speed in the lower left; where the free part ends."""
    box = pygame.Rect(pen.gap, 0, pen.px(_GAUGE), 2 * pen.row)
    box.bottom = bottom
    pen.plate(box)
    pad, robot = pen.px(10), snapshot.robot
    _draw_clearance(pen, snapshot, (box.left + pad, box.top + pen.row // 2))
    y, speed = box.bottom - pen.row // 2, math.hypot(*robot.velocity)
    pen.write(f"{speed:.2f} m/s", (box.left + pad, y))
    left = box.left + pad + pen.px(84)
    track = pygame.Rect(left, y - pen.px(4), box.right - pad - left, pen.px(8))
    pygame.draw.rect(pen.surface, mixed(METAL, PAPER, 0.3), track, border_radius=pen.px(4))
    share = min(speed / robot.body.limits.ahead, 1.0)
    if share > 0.01:
        full = track.copy()
        full.width = max(round(track.width * share), pen.px(4))
        pygame.draw.rect(pen.surface, INK, full, border_radius=pen.px(4))
    return box.top - pen.gap


def _draw_clearance(pen: Pen, snapshot: Snapshot, place: tuple[int, int]) -> None:
    gaps = clearances(snapshot)
    gaps = gaps[np.isfinite(gaps)]
    if not len(gaps):
        pen.write("nobody here", place, colour=FAINT)
        return
    nearest = float(gaps.min())
    word, sign, colour = zone_of(nearest)
    radius = pen.px(7)
    pen.sign(sign, (place[0] + radius, place[1]), radius, colour)
    pen.write(f"{max(nearest, 0.0):.2f} m  {word}", (place[0] + 3 * radius, place[1]), colour=colour)


def zone_of(clearance: float) -> tuple[str, str, Colour]:
    """The zone that a clearance (m) lies in: its name, its sign, its colour."""
    if clearance < INTIMATE_DISTANCE:
        return "intimate", "diamond", _RED
    if clearance < PERSONAL_DISTANCE:
        return "personal", "triangle", _AMBER
    return "clear", "ring", shaded(GOAL, 0.3)


def _draw_label(pen: Pen, label: str, question: str, bottom: int) -> int:
    """The label below its question, in the lower right; where the free part ends."""
    right = pen.surface.get_width() - pen.gap
    room = right - pen.px(_GAUGE) - 3 * pen.gap
    for text, colour in ((label, INK), (question if label else "", mixed(INK, FAINT, 0.6))):
        if text:
            bottom = pen.panel(text, (right, bottom), "bottomright", room=room, colour=colour).top - pen.px(2)
    return bottom - pen.gap


def _draw_notice(pen: Pen, notice: str, top: int) -> int:
    """The notice, dark so that it stands out; where the free part begins."""
    width, pad = pen.surface.get_width(), pen.px(16)
    line = pen.fitted(notice, width - 2 * pen.gap - 2 * pad, 26)
    box = pygame.Rect(0, top, pen.width(line, 26) + 2 * pad, pen.px(38))
    box.centerx = width // 2
    pen.plate(box, colour=INK, alpha=235)
    pen.write(line, box.center, colour=PAPER, size=26, anchor="center")
    return box.bottom + pen.gap


def _draw_way(pen: Pen, snapshot: Snapshot, camera: Camera, free: pygame.Rect) -> None:
    """How far the goal is: beside it if it is in view, else beside an arrow at the edge that points to it."""
    goal, robot = snapshot.goal, snapshot.robot.position
    away = f"{math.hypot(goal.x - robot[0], goal.y - robot[1]):.1f} m"
    x, y = camera.to_pixels(goal.position)
    colour = shaded(GOAL, 0.35)
    if pen.surface.get_rect().collidepoint(x, y):
        _draw_distance(pen, away, (x, y + goal.distance * camera.scale + pen.px(14)), free)
        return
    middle = free.center
    angle, size, margin = math.atan2(y - middle[1], x - middle[0]), pen.px(30), pen.px(4)
    c, s = math.cos(angle), math.sin(angle)
    reach = min(
        (free.width / 2 - margin) / max(abs(c), 1e-9),
        (free.height / 2 - margin) / max(abs(s), 1e-9),
    )
    tip = middle[0] + reach * c, middle[1] + reach * s
    pen.arrow(tip, angle, size, colour)
    _draw_distance(pen, away, (tip[0] - 1.9 * size * c, tip[1] - 1.6 * size * s), free)


def _draw_distance(pen: Pen, text: str, centre: tuple[float, float], free: pygame.Rect) -> None:
    box = pygame.Rect(0, 0, pen.width(text) + pen.px(12), pen.px(24))
    box.center = round(centre[0]), round(centre[1])
    box.clamp_ip(free)
    pen.plate(box)
    pen.write(text, box.center, colour=shaded(GOAL, 0.45), anchor="center")
