"""Pictures of the environment, and its window."""

from __future__ import annotations

import time
from typing import Any, Literal

import pygame

from ..core.devices import ImageRequest
from ..core.snapshot import Snapshot
from ..view.painter import Painter, image_of

_CAPTION = "sonata2d"


class Renderer:
    """Draws snapshots as arrays or in a window.

    Args:
        size: width and height, px.
        view: `top` or `follow`.
        fps: pictures per second in the window.
    """

    def __init__(self, size: tuple[int, int], view: Literal["top", "follow"], fps: int) -> None:
        self._request = ImageRequest(*size, view=view)
        self._pictures: list[Any] = []
        self._window: pygame.Surface | None = None
        self._painter: Painter | None = None
        self._shown: Snapshot | None = None
        self._interval, self._next = 1.0 / fps, 0.0

    def begin(self) -> None:
        """Begin an episode: forget the pictures of the last one."""
        self._pictures, self._painter = [], None

    def picture(self, snapshot: Snapshot) -> Any:
        """(height, width, 3) of uint8."""
        return image_of(snapshot, self._request)

    def keep(self, snapshot: Snapshot) -> None:
        """Draw a picture for `take`."""
        self._pictures.append(self.picture(snapshot))

    def take(self) -> list[Any]:
        """The pictures kept since the last call."""
        pictures, self._pictures = self._pictures, []
        return pictures

    def show(self, snapshot: Snapshot) -> None:
        """Show a snapshot in the window, at the pace of the simulated time; nothing if it is shown already."""
        if snapshot is self._shown:  # `step` shows it, and some programs call `render` as well
            return
        self._shown = snapshot
        if self._window is None:
            pygame.display.init()
            self._window = pygame.display.set_mode((self._request.width, self._request.height))
            pygame.display.set_caption(_CAPTION)
        if self._painter is None:
            self._painter = Painter(snapshot.scene)
        pygame.event.pump()  # else the system takes the window for one that hangs
        self._painter.draw(self._window, snapshot, view=self._request.view)
        pygame.display.flip()
        now = time.monotonic()
        time.sleep(max(self._next - now, 0.0))
        self._next = max(self._next, now) + self._interval

    def close(self) -> None:
        """Close the window."""
        if self._window is not None:
            pygame.display.quit()
            self._window = self._shown = None
