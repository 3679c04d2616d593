"""Pictures of the environment, and its window."""

from __future__ import annotations

import logging
import time
from typing import Any, ClassVar

import pygame

from ..core.devices import ImageRequest
from ..core.snapshot import Snapshot
from ..errors import WindowError
from ..view.display import start_display
from ..view.painter import Painter, image_of

_CAPTION = "sonata2d"


class Renderer:
    """Draws snapshots as arrays or in a window.

    Args:
        mode: of the environment.
        request: size and view of the pictures.
        interval: between two pictures in the window, s.
    """

    _has_started_display: ClassVar[bool] = False

    def __init__(self, mode: str | None, request: ImageRequest, interval: float) -> None:
        self._mode, self._request = mode, request
        self._pictures: list[Any] = []
        self._window: pygame.Window | None = None
        self._was_closed = False  # by the user
        self._painter: Painter | None = None
        self._shown: Snapshot | None = None
        self._interval, self._next = interval, 0.0

    def begin(self) -> None:
        """Begin an episode: forget the pictures of the last one."""
        self._pictures, self._painter = [], None

    def step(self, snapshot: Snapshot) -> None:
        """Show the snapshot in the window, or keep its picture for `render`."""
        if self._mode == "human":
            self._show(snapshot)
        else:
            self._pictures.append(image_of(snapshot, self._request))

    def render(self, snapshot: Snapshot) -> Any:
        """See `SocialNavEnv.render`."""
        if self._mode == "rgb_array":
            return image_of(snapshot, self._request)
        if self._mode == "human":
            return self._show(snapshot)
        pictures, self._pictures = self._pictures, []
        return pictures

    def _show(self, snapshot: Snapshot) -> None:
        """Show a snapshot in the window, at the pace of the simulated time.

        Nothing happens if the snapshot is shown already, or the user has closed the window.

        Raises:
            WindowError: there is no display.
        """
        if snapshot is self._shown:  # `step` shows it, and some programs call `render` as well
            return
        self._shown = snapshot
        if self._window is None and not self._was_closed:
            self._window = self._open()
        if self._window is not None:
            _close_unwanted()
        if self._window is None:
            return
        if self._painter is None:
            self._painter = Painter(snapshot.scene)
        self._painter.draw(self._window.get_surface(), snapshot, view=self._request.view)
        self._window.flip()
        now = time.monotonic()
        time.sleep(max(self._next - now, 0.0))
        self._next = max(self._next, now) + self._interval

    def close(self) -> None:
        """Close the window; the next picture opens a new one."""
        self._close_window()
        self._shown, self._was_closed = None, False

    def _open(self) -> pygame.Window:
        is_running = pygame.display.get_init()
        try:
            start_display()
            window = pygame.Window(_CAPTION, (self._request.width, self._request.height))
        except pygame.error as error:
            raise WindowError(
                f"the window cannot be opened ({error}); without a display, use render_mode='rgb_array'"
            ) from None
        _OPEN[window.id] = self
        Renderer._has_started_display |= not is_running
        return window

    def _close_window(self) -> None:
        if self._window is not None:
            del _OPEN[self._window.id]
            self._window.destroy()
            self._window = None
            # The program keeps a display that it started itself, or in which it has opened a window.
            if not _OPEN and Renderer._has_started_display and pygame.display.get_surface() is None:
                Renderer._has_started_display = False
                pygame.display.quit()


_OPEN: dict[int, Renderer] = {}  # by the id of their windows; a program may show several environments


def _close_unwanted() -> None:
    """Close the windows whose close button was clicked; reading events also tells the system that the program runs."""
    for event in pygame.event.get(pygame.WINDOWCLOSE):  # other events are left to the program
        renderer = _OPEN.get(event.window.id) if event.window is not None else None
        if renderer is not None:
            logging.getLogger(__name__).info("the window was closed; the environment runs on without it")
            renderer._was_closed = True
            renderer._close_window()
