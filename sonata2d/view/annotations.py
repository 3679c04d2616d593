"""Text on a picture: the strip below it with caption, scale bar and time bar; labels."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import pygame

from ..core.geometry import Point
from ..core.scene import Scene
from ..core.snapshot import Snapshot
from .canvas import Picture
from .fonts import shortened, width_of
from .palette import FAINT, FLOOR, INK, PAPER, Colour, mixed, time_colour

STRIP = 34  # px, height of the strip
TEXT, SMALL = 18, 16  # px, font sizes
_EDGE, _GAP, _TIME_BAR = 14, 22, 90  # px; the last one is the length of the time bar
_PLATE_EDGE = mixed(FLOOR, INK, 0.3)
_MIN_TIME_BAR_WIDTH = 420  # px; a narrower strip has no time bar


def origin(scene: Scene) -> str:
    """Seed and episode of a scene as text; empty for a scene that was recorded elsewhere."""
    return "" if "seed" in scene.unmeasured else f"seed {scene.seed} / episode {scene.episode}"


def summary(snapshot: Snapshot, outcome: str | None = None) -> str:
    """Default caption: scenario, seed and episode, time, outcome."""
    scene = snapshot.scene
    known = None if "outcome" in scene.unmeasured else outcome
    return "   ".join(part for part in (scene.name, origin(scene), f"t = {snapshot.time:.1f} s", known) if part)


def value_text(value: Any) -> str:
    """A label or another JSON value as text; numbers have at most six significant digits.

    >>> value_text({"twist": [0.30000000000000004, -0.0, 1.0], "note": "calm"})
    'twist [0.3, 0, 1], note calm'
    """
    if value is None or isinstance(value, str):
        return "none" if value is None else value
    if isinstance(value, dict):
        return ", ".join(f"{name} {value_text(item)}" for name, item in value.items())
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(value_text(item) for item in value)}]"
    if isinstance(value, float):
        return f"{value + 0.0:.6g}"  # adding 0.0 turns -0.0 into 0.0
    return json.dumps(value, default=str)


def draw_strip(
    canvas: Picture, size: tuple[int, int], text: str, scale: float, span: tuple[float, float] | None
) -> None:
    """Draw the caption on the left and the bars on the right of the strip.

    Args:
        size: width of the picture, and its height up to the lower edge of the strip, px.
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


def _draw_scale_bar(canvas: Picture, right: tuple[int, int], scale: float) -> int:
    """Draw a bar of one metre that ends at `right`; returns its leftmost pixel."""
    (x, y), length = right, round(scale)
    canvas.rectangle(INK, pygame.Rect(x - length, y - 1, length, 2))
    for end in (x - length, x - 2):
        canvas.rectangle(INK, pygame.Rect(end, y - 5, 2, 10))
    return canvas.text(INK, "1 m", (x - length - 6, y), SMALL, "midright").left


def _draw_time_bar(canvas: Picture, right: tuple[int, int], span: tuple[float, float]) -> int:
    """Draw the colours of the robot's trail between first and last time; returns the leftmost pixel."""
    end = canvas.text(FAINT, f"{span[1]:.1f} s", right, SMALL, "midright")
    x = end.left - 6 - _TIME_BAR
    for k in range(_TIME_BAR):
        canvas.rectangle(time_colour(k / (_TIME_BAR - 1)), pygame.Rect(x + k, right[1] - 4, 1, 8))
    return canvas.text(FAINT, f"{span[0]:.1f}", (x - 6, right[1]), SMALL, "midright").left


def draw_labels(canvas: Picture, labels: Sequence[Label], size: int, unlabelled: Sequence[pygame.Rect] = ()) -> None:
    """Draw small texts on light plates beside their objects, within the picture and apart where possible.

    Args:
        labels: in order of importance; a label avoids the labels before it, and the objects of all labels.
        size: font size, px.
        unlabelled: boxes of objects without a label, which labels avoid too, px.
    """
    picture = pygame.Rect((0, 0), canvas.size)
    labels = [label for label in labels if picture.colliderect(label.body)]
    taken: list[pygame.Rect] = []
    bodies = [label.body for label in labels]
    for k, label in enumerate(labels):
        others = [*unlabelled, *(body for j, body in enumerate(bodies) if j != k)]
        beside = _places_beside(label, size)
        places = [box for box in beside if picture.contains(box)] or [box.clamp(picture) for box in beside]
        box = next((box for box in places if box.collidelist([*taken, *others]) < 0), None)
        if box is None:  # no place is free: rather hide an entity than a label
            box = next((box for box in places if box.collidelist(taken) < 0), places[0])
        taken.append(box)
        canvas.rectangle(PAPER, box, _PLATE_EDGE)
        canvas.text(label.colour, label.text, box.center, size)


@dataclass(frozen=True, slots=True)
class Label:
    """A text, and the pixels of its object: a box around `centre` that extends by `radius`."""

    text: str
    centre: Point
    radius: float
    colour: Colour = INK

    @property
    def body(self) -> pygame.Rect:
        side = math.ceil(2 * self.radius)
        return pygame.Rect(round(self.centre[0] - self.radius), round(self.centre[1] - self.radius), side, side)


def _places_beside(label: Label, size: int) -> list[pygame.Rect]:
    """Boxes for the label above, below, right and left of its entity, then at the corners."""
    box, body = pygame.Rect(0, 0, width_of(label.text, size) + 5, size - 1), label.body.inflate(4, 4)
    places = []
    for corner, opposite in (
        ("midbottom", "midtop"), ("midtop", "midbottom"), ("midleft", "midright"), ("midright", "midleft"),
        ("bottomleft", "topright"), ("bottomright", "topleft"), ("topleft", "bottomright"),
        ("topright", "bottomleft"),
    ):  # fmt: skip
        place = box.copy()
        setattr(place, corner, getattr(body, opposite))
        places.append(place)
    return places
