"""Drawing of a scene that is driven: camera, zoom, personal space, readings, tints, and the mouse joystick."""

from __future__ import annotations

import math

import pygame

from ..core.devices import View
from ..core.scene import Scene
from ..core.snapshot import Snapshot
from ..view.layers import Layers
from ..view.painter import Painter
from ..view.palette import INK, OUTSIDE, PAPER, Colour
from .actions import Action
from .hud import Hud, draw_hud, free_area
from .input import MouseJoystick

_ZOOM_STEP, _MIN_ZOOM, _MAX_ZOOM = 1.25, 0.4, 3.0
_MIN_HEIGHT = 0.4  # of the world below a card, as a fraction of the window's height


class SceneCamera:
    """Draws one scene after another with the view, zoom and layers that the driver selected.

    Args:
        view: initial view.

    Attributes:
        view: the view on show.
        zones: whether personal space is drawn.
    """

    def __init__(self, view: View) -> None:
        self.view: View = view
        self.zones = False
        self._zoom, self._hud = 1.0, True
        self._painter: Painter | None = None
        self._scene: Scene | None = None

    def apply(self, action: Action) -> bool:
        """Change the display; returns False if the action is not about the display."""
        if action is Action.HUD:
            self._hud = not self._hud
        elif action is Action.ZONES:
            self.zones = not self.zones
        elif action is Action.VIEW:
            self.view = "top" if self.view == "follow" else "follow"
        elif action in (Action.ZOOM_IN, Action.ZOOM_OUT):
            zoom = self._zoom * (_ZOOM_STEP if action is Action.ZOOM_IN else 1 / _ZOOM_STEP)
            self._zoom = min(max(zoom, _MIN_ZOOM), _MAX_ZOOM)
        else:
            return False
        return True

    def draw(self, surface: pygame.Surface, snapshot: Snapshot, hud: Hud, *, scale: float, top: int = 0) -> None:
        """Draw the readings, and the world where they leave space, so that they cover neither robot nor pedestrians.

        Args:
            surface: of the window.
            snapshot: the state to draw.
            hud: the readings.
            scale: of texts and signs.
            top: lower edge of a card, px; the world is drawn below it if that is a large enough part of the window.
        """
        if self._painter is None or self._scene is not snapshot.scene:
            self._scene, self._painter = snapshot.scene, Painter(snapshot.scene)
        area = free_area(surface, hud, scale=scale) if self._hud else surface.get_rect()
        below = area.bottom - max(top, area.top)
        if below >= _MIN_HEIGHT * surface.get_height():
            area = pygame.Rect(0, area.bottom - below, area.width, below)
        surface.fill(OUTSIDE)
        picture, layers = surface.subsurface(area), Layers(caption=False, zones=self.zones)
        camera = self._painter.draw(picture, snapshot, view=self.view, layers=layers, zoom=self._zoom)
        if self._hud:
            draw_hud(surface, hud, snapshot, camera, scale=scale, origin=area.topleft)


def draw_mouse_joystick(surface: pygame.Surface, joystick: MouseJoystick) -> None:
    """Draw a ring where the mouse was pressed, and a knob at the mouse, at most on the ring."""
    (x, y), (to_x, to_y), radius = joystick
    dx, dy = to_x - x, to_y - y
    distance = math.hypot(dx, dy)
    fraction = min(radius / distance, 1.0) if distance > 0.0 else 1.0
    knob = (round(x + dx * fraction), round(y + dy * fraction))
    side = round(2 * radius) + 4
    disc = pygame.Surface((side, side), pygame.SRCALPHA, 32)
    pygame.draw.aacircle(disc, (*PAPER, 70), (side // 2, side // 2), radius)
    surface.blit(disc, (x - side // 2, y - side // 2))
    pygame.draw.aacircle(surface, INK, (x, y), radius, 2)
    pygame.draw.aacircle(surface, INK, knob, radius * 0.22)


def draw_tint(surface: pygame.Surface, colour: Colour, alpha: int) -> None:
    """Blend a colour over the whole picture; alpha is 0 (no effect) to 255 (only the colour)."""
    kept = 255 - alpha
    surface.fill((kept, kept, kept), special_flags=pygame.BLEND_RGB_MULT)
    r, g, b = (value * alpha // 255 for value in colour)
    surface.fill((r, g, b), special_flags=pygame.BLEND_RGB_ADD)
