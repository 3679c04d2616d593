"""Texts, plates and signs over the scene: the readings while driving (HUD), and the legend."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import pygame

from ..collect.texts import text
from ..core.furniture_types import METAL
from ..core.geometry import Point
from ..core.proxemics import INTIMATE_DISTANCE, PERSONAL_DISTANCE, clearance, touched_kind
from ..core.snapshot import Snapshot
from ..view.canvas import PixelCanvas, put
from ..view.fonts import shortened, width_of
from ..view.layers import Layers
from ..view.legend import Legend
from ..view.palette import FAINT, GOAL, INK, PAPER, Colour, mixed, shaded
from ..view.projection import MIN_SIDE, Camera
from .answer import FrameQuestion
from .question_panel import question_panel
from .widgets import draw_notice, write

Light = Literal["waiting", "recording", "paused", "frozen", "replay", "watching"]

_REFERENCE_SIZE = (640, 480)  # px, the smallest surface for texts at scale 1
_TEXT, _PADDING, _GAP, _PLATE_ALPHA = 21, 8, 8, 222
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
_SHAPES: dict[str, tuple[list[Point], ...]] = {  # polygons of signs with radius 1
    "bars": tuple([(x, -0.9), (x + 0.6, -0.9), (x + 0.6, 0.9), (x, 0.9)] for x in (-0.8, 0.2)),
    "square": ([(-0.85, -0.85), (0.85, -0.85), (0.85, 0.85), (-0.85, 0.85)],),
    "triangle": ([(0.0, -1.0), (1.0, 0.8), (-1.0, 0.8)],),
    "play": ([(1.0, 0.0), (-0.7, 1.0), (-0.7, -1.0)],),
    "diamond": ([(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)],),
}
_GAUGES, _KEY, _NOTICE = 560, 19, 26  # px at scale 1: width of clearance and speed, text heights of keys and notices
_SPEED_SHARE = 0.56  # of the width of clearance and speed, left of the speed
_MIN_KEY = 19  # px, text height of keys at any scale; 13 px without the space between lines
_MAX_NOTICE_WIDTH = 1000  # px at scale 1
_LEGEND = 1.2  # scale of the legend, for the text size of the readings


def _limited_scale(size: tuple[int, int], scale: float) -> float:
    """A scale of texts that a surface of a size in pixels has space for."""
    limit = min(side / minimum for side, minimum in zip(size, _REFERENCE_SIZE, strict=True))
    return max(min(scale, limit), 0.25)


@dataclass(frozen=True)
class _Pen:
    """Writes on a surface; lengths are pixels at scale 1, places are pixels of the surface."""

    surface: pygame.Surface
    scale: float

    @classmethod
    def on(cls, surface: pygame.Surface, scale: float) -> _Pen:
        """A pen of the requested scale, limited by the size of the surface."""
        return cls(surface, _limited_scale(surface.get_size(), scale))

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
        return self.px(_GAP)

    def width(self, line: str) -> int:
        """Width of a line, px."""
        return width_of(line, self.px(_TEXT))

    def fitted(self, line: str, max_width: float) -> str:
        """The line, shortened to a width in pixels."""
        return shortened(line, max_width, self.px(_TEXT))

    def write(
        self, line: str, place: Point, *, colour: Colour = INK, size: float = _TEXT, anchor: str = "midleft"
    ) -> pygame.Rect:
        """Write a line; `anchor` names the point of its box at `place`, as in `pygame.Rect`. Returns the box."""
        return write(self.surface, line, place, size=self.px(size), colour=colour, anchor=anchor)

    def plate(self, box: pygame.Rect, *, colour: Colour = PAPER, alpha: int = _PLATE_ALPHA) -> None:
        """Draw a translucent plate with round corners."""
        put(self.surface, _plate_image(box.size, self.px(7), colour, alpha), *box.topleft)

    def panel(self, line: str, place: Point, anchor: str, *, max_width: float) -> pygame.Rect:
        """Write a line on a plate, shortened to `max_width` pixels; returns an empty box if nothing fits."""
        padding = self.px(_PADDING)
        line = self.fitted(line, max_width - 2 * padding)
        box = pygame.Rect(0, 0, self.width(line) + 2 * padding if line else 0, self.row if line else 0)
        setattr(box, anchor, (round(place[0]), round(place[1])))
        if line:
            self.plate(box)
            self.write(line, (box.left + padding, box.centery))
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
        for shape in _SHAPES.get(kind, ()):
            canvas.polygon(colour, [(x + r * a, y + r * b) for a, b in shape])

    def arrow(self, tip: Point, angle: float, length: float, colour: Colour) -> None:
        """Draw an arrow head that points along an angle, rad, clockwise from the right; length in pixels."""
        c, s = math.cos(angle), math.sin(angle)
        shape = [(0.0, 0.0), (-1.0, 0.62), (-0.72, 0.0), (-1.0, -0.62)]
        points = [(tip[0] + length * (a * c - b * s), tip[1] + length * (a * s + b * c)) for a, b in shape]
        PixelCanvas(self.surface).polygon(colour, points)


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
        contributor: name of the driver.
        light: state of the recording.
        label: recorded label as text; empty without one.
        question: the question that is asked while driving.
        keys: active keys and their functions.
        notice: a message shown prominently.
        has_arrived: whether the robot is at its goal, and waits until other robots are at theirs.
    """

    run: int = 1
    runs: int | None = None
    kept: int = 0
    contributor: str = ""
    light: Light = "waiting"
    label: str = ""
    question: FrameQuestion | None = None
    keys: tuple[tuple[str, str], ...] = ()
    notice: str = ""
    has_arrived: bool = False


def free_area(surface: pygame.Surface, hud: Hud, *, scale: float) -> pygame.Rect:
    """The part of a surface that the readings leave free, px; all of it if that part is too small for a picture."""
    pen = _Pen.on(surface, scale)
    width, height = surface.get_size()
    top = pen.gap + (2 if _has_two_rows(pen) else 1) * (pen.row + pen.gap)
    bottom = height - pen.gap
    if hud.keys or hud.label:
        bottom -= (pen.row if hud.label else _key_bar_height(pen)) + pen.gap
    if hud.question is not None:
        bottom -= question_panel(surface.get_size(), hud.question, pen.scale).height + pen.gap
    return pygame.Rect(0, top, width, bottom - top) if bottom - top >= MIN_SIDE else surface.get_rect()


def draw_hud(
    surface: pygame.Surface, hud: Hud, snapshot: Snapshot, camera: Camera, *, scale: float, origin: Point = (0, 0)
) -> None:
    """Draw all readings over a finished picture.

    Args:
        camera: the camera of the picture.
        scale: of texts and signs; limited by the size of the surface.
        origin: upper left corner of the picture on the surface, px.
    """
    pen = _Pen.on(surface, scale)
    top = _draw_top(pen, hud, snapshot)
    bottom = _draw_keys(pen, hud.keys, hud.label)
    if hud.question is not None:
        bottom = question_panel(surface.get_size(), hud.question, pen.scale).draw(surface, bottom).top - pen.gap
    if hud.notice:
        width = min(surface.get_width() - 2 * pen.gap, pen.px(_MAX_NOTICE_WIDTH))
        place = surface.get_width() / 2, top
        top = draw_notice(surface, hud.notice, place, size=pen.px(_NOTICE), max_width=width).bottom + pen.gap
    free = pygame.Rect(pen.gap, top, surface.get_width() - 2 * pen.gap, max(bottom - top, 1))
    picture = pygame.Rect(origin, camera.size)
    _draw_goal_distance(pen, snapshot, camera, picture, free.clip(picture), hud.has_arrived)


# Each of the following functions returns the y coordinate at which the free part of the picture starts or ends, px.


def _has_two_rows(pen: _Pen) -> bool:
    """Whether the readings at the top need two rows, because the surface is narrow."""
    return pen.surface.get_width() < pen.px(_GAUGES + 620)  # of run, time, contributor and light


def _draw_top(pen: _Pen, hud: Hud, snapshot: Snapshot) -> int:
    """Draw run, time and contributor on the left, the light on the right, clearance and speed between or below them."""
    width, gap = pen.surface.get_width(), pen.gap
    light = _draw_light(pen, hud.light)
    run = text("readings.run", number=hud.run)
    if hud.runs is not None:
        run = text("readings.run_of", number=hud.run, count=hud.runs)
    kept = text("readings.kept", count=hud.kept) if hud.kept else ""
    time = text("readings.seconds", time=f"{snapshot.time:.1f}")
    parts = [run, time, kept, pen.fitted(hud.contributor, 0.2 * width)]
    gauges = pygame.Rect(gap, gap, pen.px(_GAUGES), pen.row)
    if _has_two_rows(pen):
        gauges.top += pen.row + gap
        gauges.width = min(gauges.width, width - 2 * gap)
        limit = light.left
    else:
        gauges.right = light.left - gap
        limit = gauges.left
    line = "   ".join(part for part in parts if part)
    pen.panel(line, (gap, gap), "topleft", max_width=limit - 2 * gap)
    _draw_gauges(pen, snapshot, gauges)
    return gauges.bottom + gap


def _draw_light(pen: _Pen, light: Light) -> pygame.Rect:
    kind, colour = _LIGHTS[light]
    word = text(f"readings.{light}")
    padding, radius = pen.px(10), pen.px(7)
    box = pygame.Rect(0, 0, pen.width(word) + 2 * padding + 3 * radius, pen.row)
    box.topright = pen.surface.get_width() - pen.gap, pen.gap
    pen.plate(box)
    pen.sign(kind, (box.left + padding + radius, box.centery), radius, colour)
    pen.write(word, (box.left + padding + 3 * radius, box.centery), colour=colour)
    return box


def _draw_keys(pen: _Pen, keys: tuple[tuple[str, str], ...], label: str) -> int:
    """Draw keys and their functions along the bottom, as many as fit, or a recorded label in the right corner."""
    gap, (width, height) = pen.gap, pen.surface.get_size()
    if label:
        return pen.panel(label, (width - gap, height - gap), "bottomright", max_width=width - 2 * gap).top - gap
    if not keys:
        return height - gap
    padding, size = pen.px(6), _key_size(pen)
    shown, used = [], 2 * padding
    for key, function in keys:
        widths = width_of(key, size) + 2 * padding, width_of(function, size) + 3 * padding
        if used + sum(widths) > width - 2 * gap:
            break
        used += sum(widths)
        shown.append((key, function, widths))
    bar = pygame.Rect(0, 0, used, _key_bar_height(pen))
    bar.midbottom = width // 2, height - gap
    pen.plate(bar)
    x = bar.left + 2 * padding
    for key, function, (cap_width, text_width) in shown:
        cap = pygame.Rect(x, 0, cap_width, max(pen.px(22), size))
        cap.centery = bar.centery
        pen.plate(cap, colour=mixed(METAL, PAPER, 0.35), alpha=255)
        write(pen.surface, key, cap.center, size=size, anchor="center")
        write(pen.surface, function, (cap.right + padding, bar.centery), size=size, colour=mixed(INK, FAINT, 0.4))
        x += cap_width + text_width
    return bar.top - gap


def _key_size(pen: _Pen) -> int:
    """Text height of the keys, px; not smaller than readable, and fewer keys are shown in a small window."""
    return max(pen.px(_KEY), _MIN_KEY)


def _key_bar_height(pen: _Pen) -> int:
    return max(pen.row, _key_size(pen) + pen.px(6))


def _draw_gauges(pen: _Pen, snapshot: Snapshot, box: pygame.Rect) -> None:
    """Draw clearance and speed side by side; nothing for a run without a recorded robot."""
    if "robot" in snapshot.scene.unmeasured:
        return
    pen.plate(box)
    padding, robot, y = pen.px(10), snapshot.robot, box.centery
    speed = math.hypot(*robot.velocity)
    left = box.left + round(_SPEED_SHARE * box.width)
    _draw_clearance(pen, snapshot, (box.left + padding, y), left - padding)
    pen.write(text("readings.speed", speed=f"{speed:.1f}"), (left, y))
    left += pen.width(text("readings.speed", speed="0.0")) + padding  # digits have the same width
    track = pygame.Rect(left, y - pen.px(4), max(box.right - padding - left, 1), pen.px(8))
    pygame.draw.rect(pen.surface, mixed(METAL, PAPER, 0.3), track, border_radius=pen.px(4))
    fraction = min(speed / robot.body.limits.ahead, 1.0)
    if fraction > 0.01:
        bar = track.copy()
        bar.width = max(round(track.width * fraction), pen.px(4))
        pygame.draw.rect(pen.surface, INK, bar, border_radius=pen.px(4))


def _draw_clearance(pen: _Pen, snapshot: Snapshot, place: tuple[int, int], right: int) -> None:
    """Write the contact of the robot, or the distance to the nearest pedestrian, with the sign of its zone."""
    touched, nearest = touched_kind(snapshot), clearance(snapshot)
    if touched is None and nearest == math.inf:
        pen.write(pen.fitted(text("readings.nobody"), right - place[0]), place, colour=FAINT)
        return
    words = text("readings.nearest", distance=f"{max(nearest, 0.0):.1f}")
    if touched is not None:
        words, nearest = text(f"readings.touching_{touched}"), -math.inf
    sign, colour = zone_of(nearest)
    radius = pen.px(7)
    pen.sign(sign, (place[0] + radius, place[1]), radius, colour)
    left = place[0] + 3 * radius
    pen.write(pen.fitted(words, right - left), (left, place[1]), colour=colour)


def zone_of(gap: float) -> tuple[str, Colour]:
    """Sign and colour of Hall's zone at a gap between outlines, m: intimate, personal, or beyond both."""
    if gap < INTIMATE_DISTANCE:
        return "diamond", _RED
    if gap < PERSONAL_DISTANCE:
        return "triangle", _AMBER
    return "ring", shaded(GOAL, 0.3)


def _draw_goal_distance(
    pen: _Pen, snapshot: Snapshot, camera: Camera, picture: pygame.Rect, free: pygame.Rect, has_arrived: bool
) -> None:
    """Write the distance to the goal next to it if it is in view, else next to an arrow at the edge towards it.

    Args:
        has_arrived: whether the robot has reached it, and waits for others.
        picture: place of the camera's picture on the surface, px.
        free: the part of it that is free of readings, px.
    """
    if {"robot", "goal"} & snapshot.scene.unmeasured:
        return
    goal, robot = snapshot.goal, snapshot.robot.position
    metres = math.hypot(goal.x - robot[0], goal.y - robot[1])
    word = text("readings.goal", distance=f"{metres:.1f}")
    if has_arrived:
        word = text("readings.arrived")
    x, y = camera.to_pixels(goal.position)
    x, y = x + picture.left, y + picture.top
    box = pygame.Rect(0, 0, pen.width(word) + pen.px(12), pen.px(24))
    if picture.collidepoint(x, y):
        centre = x, y + goal.distance * camera.scale + pen.px(14)
    else:
        middle, size, margin = free.center, pen.px(30), pen.px(4)
        angle = math.atan2(y - middle[1], x - middle[0])
        c, s = math.cos(angle), math.sin(angle)
        radius = min(  # from the middle to the edge of the free part
            (free.width / 2 - margin) / max(abs(c), 1e-9), (free.height / 2 - margin) / max(abs(s), 1e-9)
        )
        tip = middle[0] + radius * c, middle[1] + radius * s
        pen.arrow(tip, angle, size, shaded(GOAL, 0.35))
        half = min(box.width / 2 / max(abs(c), 1e-9), box.height / 2 / max(abs(s), 1e-9))  # of the box, along the arrow
        centre = tip[0] - (size + half) * c, tip[1] - (size + half) * s
    box.center = round(centre[0]), round(centre[1])
    box.clamp_ip(free)
    pen.plate(box)
    pen.write(word, box.center, colour=shaded(GOAL, 0.45), anchor="center")


def legend_box(
    size: tuple[int, int], snapshot: Snapshot, *, zones: bool, paths: bool = False, scale: float = 1.0
) -> pygame.Rect:
    """Place of the legend on a picture of a given size, px; other arguments as of `draw_legend`."""
    return _legend_of(size, snapshot, zones, paths, _limited_scale(size, scale))[1]


def draw_legend(
    surface: pygame.Surface, snapshot: Snapshot, *, zones: bool, paths: bool = False, scale: float = 1.0
) -> None:
    """Explain the symbols of the picture on a plate at its lower edge.

    Args:
        surface: the picture.
        snapshot: the state on show.
        zones: whether personal space is drawn.
        paths: whether past paths are drawn.
        scale: of the texts; limited by the size of the surface.
    """
    pen = _Pen.on(surface, scale)
    legend, box = _legend_of(surface.get_size(), snapshot, zones, paths, pen.scale)
    pen.plate(box, alpha=255)  # it covers the keys
    legend.draw(PixelCanvas(surface.subsurface(box)), pen.px(_PADDING), box.width)


def _legend_of(
    size: tuple[int, int], snapshot: Snapshot, zones: bool, paths: bool, scale: float
) -> tuple[Legend, pygame.Rect]:
    """The legend and the box of its plate, px."""
    area, gap = pygame.Rect((0, 0), size), round(_GAP * scale)
    layers, wording = Layers(zones=zones, legend=True), lambda name, **values: text(f"legend.{name}", **values)
    legend = Legend.of([snapshot], layers, paths=paths, scale=scale * _LEGEND, wording=wording)
    box = area.inflate(-2 * gap, 0)
    box.height = legend.height(box.width) + round(_PADDING * scale)
    box.bottom = area.bottom - gap
    return legend, box.clip(area)
