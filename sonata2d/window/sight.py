"""How the driving screen shows the world: camera, zoom, what lies over it."""

from __future__ import annotations

import pygame

from ..core.devices import View
from ..core.scene import Scene
from ..core.snapshot import Snapshot
from ..view.draw import Layers
from ..view.hud import Hud, draw_hud
from ..view.live import Painter
from .actions import Action

STEP, MARGIN = 1.25, 0.92  # of the zoom; the whole room is shown a little smaller, free of the readings in the corners


class Sight:
    """Draws one scene after another as the person wants to see them.

    Args:
        view: at first.
    """

    def __init__(self, view: View) -> None:
        self.view: View = view
        self._zoom, self._zones, self._hud = 1.0, False, True
        self._painter: Painter | None = None
        self._scene: Scene | None = None

    def turn(self, action: Action) -> bool:
        """See otherwise; whether the action asks for that."""
        if action is Action.HUD:
            self._hud = not self._hud
        elif action is Action.ZONES:
            self._zones = not self._zones
        elif action is Action.VIEW:
            self.view = "top" if self.view == "follow" else "follow"
        elif action in (Action.ZOOM_IN, Action.ZOOM_OUT):
            zoom = self._zoom * (STEP if action is Action.ZOOM_IN else 1 / STEP)
            self._zoom = min(max(zoom, 0.4), 3.0)
        else:
            return False
        return True

    def draw(self, surface: pygame.Surface, snapshot: Snapshot, hud: Hud, *, scale: float, question: str = "") -> None:
        """The world, and the readings over it."""
        if self._painter is None or self._scene is not snapshot.scene:
            self._scene, self._painter = snapshot.scene, Painter(snapshot.scene)
        layers = Layers(caption=False, zones=self._zones)
        zoom = self._zoom * (MARGIN if self.view == "top" else 1.0)
        camera = self._painter.draw(surface, snapshot, view=self.view, layers=layers, zoom=zoom)
        if self._hud:
            draw_hud(surface, hud, snapshot, camera, scale=scale, question=question)
