"""A player's present moment as a picture, and as a file."""

from __future__ import annotations

from pathlib import Path

import pygame

from ..core.devices import View
from ..core.snapshot import Snapshot
from ..view.camera import Camera
from ..view.draw import Layers
from ..view.interpolation import between
from ..view.live import Painter
from ..view.trails import Trails
from ..view.vector import save_moment
from .player import Player

_TAIL = 8.0  # s of the ways that are shown
_LEAST, _MOST = 0.5, 4.0  # zoom


class Projector:
    """Draws what a player shows, as a live run is drawn.

    Args:
        player: of a recorded run.
        view: `top`, the whole room, or `follow`, from above the robot, which looks up in the picture.
        like: another one whose view, layers and zoom this one takes over.

    Attributes:
        zones, trails: whether they are drawn too.
        zoom: times the usual size.
    """

    def __init__(self, player: Player, *, view: View = "top", like: Projector | None = None) -> None:
        self.player = player
        self.view: View = like.view if like else view
        self.zones: bool = like.zones if like else False
        self.trails: bool = like.trails if like else False
        self.zoom: float = like.zoom if like else 1.0
        self._painter = Painter(player.record.scene())

    @property
    def moment(self) -> Snapshot:
        """The look at the present moment, between two ticks."""
        return between(*self.player.between)

    @property
    def layers(self) -> Layers:
        return Layers(zones=self.zones, caption=False)

    def draw(self, surface: pygame.Surface) -> Camera:
        """Fill a surface with the present moment."""
        return self._painter.draw(
            surface, self.moment, view=self.view, layers=self.layers, zoom=self.zoom, trails=self._ways()
        )

    def switch(self) -> None:
        """The other view."""
        self.view = "top" if self.view == "follow" else "follow"

    def nearer(self, times: float) -> None:
        """Zoom, within reason."""
        self.zoom = min(max(self.zoom * times, _LEAST), _MOST)

    def save(self, folder: Path, suffix: str) -> Path:
        """Write the moment into a folder, as `.png` or `.svg`; answers where to.

        Raises:
            RenderError: it cannot be written.
        """
        record, look = self.player.record, self.player.look
        path = folder / f"{record.path.name.split('.')[0]}_t{look.tick:04d}{suffix}"
        layers = Layers(zones=self.zones)
        save_moment(path, self.moment, view=self.view, layers=layers, trails=self._ways())
        return path

    def _ways(self) -> Trails | None:
        """The last seconds of all ways, from the arrays of the file."""
        if not self.trails:
            return None
        looks, end = self.player.record.looks, self.player.index + 1
        part = slice(max(end - round(_TAIL / self.player.dt), 0), end)
        return Trails(looks.time[part], looks.robot[part, :2], looks.humans[part, :, :2], is_tail=True)
