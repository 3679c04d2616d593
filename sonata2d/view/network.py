"""Graphs as pictures: nodes coloured by type, instants side by side, as the moments of a strip are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import pygame

from ..core.geometry import Point
from ..errors import RenderError
from .camera import Camera
from .canvas import Pixels
from .fonts import shortened
from .palette import BLUE, FAINT, GREEN, GREY, INK, ORANGE, PAPER, PURPLE, VERMILLION, WALL, Colour, mixed

NODE_COLOUR: dict[str, Colour] = {
    "human": BLUE, "object": ORANGE, "room": PURPLE, "robot": PURPLE, "wall": WALL, "goal": GREEN,
}  # fmt: skip
_GAP, _TITLE, _TEXT = 24, 30, 15  # pixels
_NODE = 9.0  # pixels, radius
_PANEL = 520  # pixels, width and height
_TIED = mixed(VERMILLION, PAPER, 0.1)


@dataclass(frozen=True, slots=True)
class Panel:
    """One instant of a graph.

    Attributes:
        title: above it.
        nodes: type (a key of `NODE_COLOUR`), a short text, and place in m, of each.
        edges: pairs of indices into the nodes, drawn pale.
        ties: the same, of interactions, drawn strong.
    """

    title: str
    nodes: Sequence[tuple[str, str, Point]]
    edges: Sequence[tuple[int, int]]
    ties: Sequence[tuple[int, int]]


def network_picture(panels: Sequence[Panel], title: str) -> pygame.Surface:
    """Instants of a graph side by side, to one scale, with a legend of the types below.

    Args:
        panels: the instants, at least one.
        title: above all.

    Raises:
        RenderError: there is nothing to draw.
    """
    points = [place for panel in panels for _, _, place in panel.nodes]
    if not points:
        raise RenderError("there is no graph to draw; an episode gives one a second, after the first second")
    camera = Camera.fit(points, size=(_PANEL, _PANEL), margin=0.5)
    width = len(panels) * (_PANEL + _GAP) + _GAP
    sheet = pygame.Surface((width, _PANEL + 3 * _TITLE), 0, 32)
    sheet.fill(PAPER)
    for k, panel in enumerate(panels):
        tile = _panel(panel, camera)
        sheet.blit(tile, (_GAP + k * (_PANEL + _GAP), 2 * _TITLE))
        middle = _GAP + k * (_PANEL + _GAP) + _PANEL // 2
        Pixels(sheet).text(FAINT, panel.title, (middle, 1.5 * _TITLE), _TEXT)
    Pixels(sheet).text(INK, shortened(title, width - 2 * _GAP, _TEXT + 2), (width // 2, _TITLE // 2), _TEXT + 2)
    _legend(sheet, [kind for kind in NODE_COLOUR if any(node[0] == kind for node in panels[0].nodes)])
    return sheet


def _panel(panel: Panel, camera: Camera) -> pygame.Surface:
    """One instant, drawn twice as large and made smaller, for soft edges."""
    tile = pygame.Surface((2 * _PANEL, 2 * _PANEL), 0, 32)
    tile.fill(PAPER)
    canvas = Pixels(tile)
    places = [_doubled(camera.to_pixels(place)) for _, _, place in panel.nodes]
    for pairs, colour, wide in ((panel.edges, mixed(GREY, PAPER, 0.6), 2.0), (panel.ties, _TIED, 6.0)):
        for a, b in pairs:
            canvas.stroke(colour, [places[a], places[b]], wide)
    for (kind, _, _), place in zip(panel.nodes, places, strict=True):
        canvas.circle(PAPER, place, 2 * _NODE + 3)
        canvas.circle(NODE_COLOUR[kind], place, 2 * _NODE)
    small = pygame.transform.smoothscale(tile, (_PANEL, _PANEL))
    for (_, text, _), (x, y) in zip(panel.nodes, places, strict=True):
        Pixels(small).text(PAPER, text, (x / 2, y / 2), 11)
    return small


def _legend(sheet: pygame.Surface, kinds: Sequence[str]) -> None:
    canvas, y = Pixels(sheet), sheet.get_height() - _TITLE // 2
    x = float(_GAP)
    for kind in kinds:
        canvas.circle(NODE_COLOUR[kind], (x + 6, y), 6)
        x = canvas.text(INK, kind, (x + 18, y), _TEXT, "midleft").right + 18.0


def _doubled(place: Point) -> Point:
    return 2 * place[0], 2 * place[1]
