"""Draws graphs: nodes coloured by type, several instants of an episode side by side."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import pygame

from ..core.geometry import Point
from ..errors import RenderError
from .annotations import Label, draw_labels
from .canvas import PixelCanvas
from .fonts import shortened
from .palette import BLUE, FAINT, GREEN, GREY, INK, ORANGE, PAPER, PURPLE, VERMILLION, WALL, Colour, mixed
from .projection import Camera

NODE_COLOUR: dict[str, Colour] = {
    "human": BLUE, "object": ORANGE, "room": PURPLE, "robot": PURPLE, "wall": WALL, "goal": GREEN,
}  # fmt: skip
_GAP, _TITLE, _TEXT = 24, 30, 15  # px: between panels, height of a title, font size
_NODE, _NODE_TEXT = 9.0, 11  # px: radius, font size in it
_PANEL = 520  # px, width and height
_EDGE_COLOUR, _INTERACTION_COLOUR = mixed(GREY, PAPER, 0.6), mixed(VERMILLION, PAPER, 0.1)


@dataclass(frozen=True, slots=True)
class Panel:
    """One instant of a graph.

    Attributes:
        title: text above the panel.
        nodes: for each its type (a key of `NODE_COLOUR`), a short text, and its position, m.
        edges: pairs of indices into `nodes`; drawn as thin, pale lines.
        interactions: pairs of indices into `nodes`; drawn as thick lines.
    """

    title: str
    nodes: Sequence[tuple[str, str, Point]]
    edges: Sequence[tuple[int, int]]
    interactions: Sequence[tuple[int, int]]


def network_picture(panels: Sequence[Panel], title: str) -> pygame.Surface:
    """Draw instants of a graph side by side, at the same scale, with a legend of the types in the first one.

    Args:
        panels: the instants, at least one.
        title: text above all panels.

    Raises:
        RenderError: there are no nodes.
    """
    points = [place for panel in panels for _, _, place in panel.nodes]
    if not points:
        raise RenderError(
            "there is no graph to draw; an episode has one graph per second, so record at least one second"
        )
    camera = Camera.fit(points, size=(_PANEL, _PANEL), margin=0.5)
    width = len(panels) * (_PANEL + _GAP) + _GAP
    sheet = PixelCanvas.blank((width, _PANEL + 3 * _TITLE))
    for k, panel in enumerate(panels):
        left = _GAP + k * (_PANEL + _GAP)
        _draw_panel(PixelCanvas(sheet.surface.subsurface((left, 2 * _TITLE, _PANEL, _PANEL))), panel, camera)
        sheet.text(FAINT, panel.title, (left + _PANEL // 2, 1.5 * _TITLE), _TEXT)
    sheet.text(INK, shortened(title, width - 2 * _GAP, _TEXT + 2), (width // 2, _TITLE // 2), _TEXT + 2)
    _draw_legend(sheet, [kind for kind in NODE_COLOUR if any(node[0] == kind for node in panels[0].nodes)])
    return sheet.surface


def _draw_panel(canvas: PixelCanvas, panel: Panel, camera: Camera) -> None:
    places = [camera.to_pixels(place) for _, _, place in panel.nodes]
    for pairs, colour, width in ((panel.edges, _EDGE_COLOUR, 1.0), (panel.interactions, _INTERACTION_COLOUR, 3.0)):
        for a, b in pairs:
            canvas.stroke(colour, [places[a], places[b]], width)
    for (kind, _, _), place in zip(panel.nodes, places, strict=True):
        canvas.circle(PAPER, place, _NODE + 1.5)
        canvas.circle(NODE_COLOUR[kind], place, _NODE)
    _draw_texts(canvas, [text for _, text, _ in panel.nodes], places)


def _draw_texts(canvas: PixelCanvas, texts: Sequence[str], places: Sequence[Point]) -> None:
    """Write the text of each node in it, or beside it if another node overlaps it, as a laptop does its table."""
    beside, others = [], []
    for k, (text, place) in enumerate(zip(texts, places, strict=True)):
        label = Label(text, place, _NODE)
        is_overlapped = any(math.dist(place, other) < 2 * _NODE for j, other in enumerate(places) if j != k)
        if text and is_overlapped:
            beside.append(label)
        else:
            others.append(label.body)
            canvas.text(PAPER, text, place, _NODE_TEXT)
    draw_labels(canvas, beside, _NODE_TEXT + 2, others)


def _draw_legend(canvas: PixelCanvas, kinds: Sequence[str]) -> None:
    x, y = float(_GAP), canvas.surface.get_height() - _TITLE // 2
    for kind in kinds:
        canvas.circle(NODE_COLOUR[kind], (x + 6, y), 6)
        x = canvas.text(INK, kind, (x + 18, y), _TEXT, "midleft").right + 18.0
