"""Camera, zoom and layers that a person selects, for scenes that are driven, watched or replayed."""

from __future__ import annotations

import pygame

from ..core.devices import View
from ..core.scene import Scene
from ..core.snapshot import Snapshot
from ..view.layers import Layers
from ..view.painter import Painter
from ..view.palette import OUTSIDE
from ..view.projection import Camera
from ..view.trails import Trails
from .actions import Action
from .hud import Hud, draw_hud, free_area

_ZOOM_STEP, _MIN_ZOOM, _MAX_ZOOM = 1.25, 0.4, 4.0
_MIN_HEIGHT = 0.4  # of the world below a card, as a fraction of the window's height


class SceneCamera:
    """Draws one scene after another with the view, zoom and layers that the person selected.

    Args:
        view: initial view: `top` (the whole room) or `follow` (above the robot, which points up).

    Attributes:
        view: the view on show.
        zones: whether personal space is drawn.
        shows_hud: whether the readings are drawn.
        zoom: magnification, 1 by default.
    """

    def __init__(self, view: View) -> None:
        self.view: View = view
        self.zones, self.shows_hud, self.zoom = False, True, 1.0
        self._painter: Painter | None = None
        self._scene: Scene | None = None

    def apply(self, action: Action) -> bool:
        """Change the display; returns False if the action is not about the display."""
        if action is Action.HUD:
            self.shows_hud = not self.shows_hud
        elif action is Action.ZONES:
            self.zones = not self.zones
        elif action is Action.VIEW:
            self.view = "top" if self.view == "follow" else "follow"
        elif action in (Action.ZOOM_IN, Action.ZOOM_OUT):
            self.zoom_by(_ZOOM_STEP if action is Action.ZOOM_IN else 1 / _ZOOM_STEP)
        else:
            return False
        return True

    def zoom_by(self, factor: float) -> None:
        """Multiply the zoom, within 0.4 to 4."""
        self.zoom = min(max(self.zoom * factor, _MIN_ZOOM), _MAX_ZOOM)

    def draw_picture(self, surface: pygame.Surface, snapshot: Snapshot, trails: Trails | None = None) -> Camera:
        """Fill a surface with the world; returns the camera of the picture."""
        if self._painter is None or self._scene is None or not self._scene.differs_in_goal_only(snapshot.scene):
            self._scene, self._painter = snapshot.scene, Painter(snapshot.scene)
        layers = Layers(caption=False, zones=self.zones)
        return self._painter.draw(surface, snapshot, view=self.view, layers=layers, zoom=self.zoom, trails=trails)

    def draw(
        self,
        surface: pygame.Surface,
        snapshot: Snapshot,
        hud: Hud,
        *,
        scale: float,
        top: int = 0,
        trails: Trails | None = None,
    ) -> None:
        """Draw the readings, and the world where they leave space, so that they cover neither robot nor pedestrians.

        Args:
            surface: of the window.
            snapshot: the state to draw.
            hud: the readings.
            scale: of texts and signs.
            top: lower edge of a card, px; the world is drawn below it if that is a large enough part of the window.
            trails: past paths of robot and pedestrians.
        """
        area = free_area(surface, hud, scale=scale) if self.shows_hud else surface.get_rect()
        below = area.bottom - max(top, area.top)
        if below >= _MIN_HEIGHT * surface.get_height():
            area = pygame.Rect(0, area.bottom - below, area.width, below)
        surface.fill(OUTSIDE)
        camera = self.draw_picture(surface.subsurface(area), snapshot, trails)
        if self.shows_hud:
            draw_hud(surface, hud, snapshot, camera, scale=scale, origin=area.topleft)
