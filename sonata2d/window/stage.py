"""The window: opens, resizes, keeps time, and shows one screen after another."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Protocol

import pygame
import pygame_gui
from pygame._sdl2 import controller

from ..errors import RenderError, WindowError
from ..view.stills import save_surface

SIZE = (1280, 800)
FPS = 60
_CTRL = pygame.KMOD_CTRL | pygame.KMOD_META
_FALLBACK_DRIVERS = ("offscreen", "dummy")  # SDL uses them if there is no display; allowed only on request
_THEME = Path(__file__).with_name("theme.json")
_FONT_SIZES = {"defaults": 14, "#title": 18, "#line": 14, "#row": 14}  # in a window of SIZE


class Screen(Protocol):
    """Content of the window, and its reaction to events."""

    def enter(self, stage: Stage) -> None:
        """Create the widgets; called when the screen appears and after a change of the window's size."""

    def handle(self, event: pygame.Event) -> None:
        """Process an event that no widget has used."""

    def advance(self, seconds: float) -> Screen | None:
        """Advance by real time; returns the screen to show next: itself, another one, or None to close the window."""

    def draw(self, surface: pygame.Surface) -> None:
        """Draw everything below the widgets."""

    def leave(self) -> None:
        """Save what must not be lost; called when another screen follows or the window closes."""


class Stage:
    """A window with widgets.

    Args:
        title: of the window.
        size: px.
        fps: maximum number of frames per second.
        clock: waits for the next frame at a given rate and returns the ms that have passed; real time by default.

    Attributes:
        ui: pygame_gui's manager of the widgets; emptied when a screen is entered.
        scale: size of texts and widgets relative to a window of `SIZE`.

    Raises:
        WindowError: there is no display.
    """

    def __init__(
        self,
        title: str = "sonata2d",
        *,
        size: tuple[int, int] = SIZE,
        fps: int = FPS,
        clock: Callable[[int], int] | None = None,
    ) -> None:
        self._fps, self._clock = fps, clock or pygame.time.Clock().tick
        _open_display(title, size)
        self._reset_ui(size)

    @property
    def size(self) -> tuple[int, int]:
        """Size of the window, px."""
        return self.surface.get_size()

    @property
    def surface(self) -> pygame.Surface:
        """Surface of the window."""
        surface = pygame.display.get_surface()
        assert surface is not None
        return surface

    def run(self, screen: Screen) -> None:
        """Show a screen and its successors until one of them closes the window."""
        current: Screen | None = screen
        screen.enter(self)
        try:
            while current is not None:
                current = self.show_frame(current)
        finally:
            controller.quit()  # pygame.quit() does not do this, and a later window would not find any pad
            pygame.quit()

    def show_frame(self, screen: Screen) -> Screen | None:
        """Process events, advance and draw one frame; returns the screen to show next."""
        seconds = self._clock(self._fps) / 1000.0
        for event in pygame.event.get():
            if event.type == pygame.VIDEORESIZE:
                self._reset_ui(self.size)
                screen.enter(self)
            elif event.type == pygame.KEYDOWN and event.key == pygame.K_F12:
                self._save_screenshot()
            elif event.type == pygame.KEYDOWN and event.key == pygame.K_q and event.mod & _CTRL:
                screen.handle(pygame.event.Event(pygame.QUIT))  # regardless of the focus
            elif not self.ui.process_events(event) or event.type in (pygame.KEYUP, pygame.MOUSEBUTTONUP):
                screen.handle(event)
        following = screen.advance(seconds)
        if following is not screen:
            screen.leave()
            if following is None:
                return None
            self._reset_ui(self.size)
            following.enter(self)
        self.ui.update(seconds)
        following.draw(self.surface)
        self.ui.draw_ui(self.surface)
        pygame.display.flip()
        return following

    def _save_screenshot(self) -> None:
        """Save the window's content into the working directory."""
        path = Path.cwd() / f"sonata2d-{datetime.now(UTC):%Y%m%dT%H%M%SZ}.png"
        try:
            save_surface(self.surface, path)
            pygame.display.set_caption(f"saved: {path}")
        except RenderError as error:
            pygame.display.set_caption(f"not saved: {error}")

    def _reset_ui(self, size: tuple[int, int]) -> None:
        """Replace the manager by an empty one for a window size."""
        self.scale = max(min(size[0] / SIZE[0], size[1] / SIZE[1]), 0.75)
        theme = json.loads(_THEME.read_text(encoding="utf-8"))
        for part, points in _FONT_SIZES.items():
            theme.setdefault(part, {})["font"] = {"name": "noto_sans", "size": str(round(points * self.scale))}
        self.ui = pygame_gui.UIManager(size, theme)


def _open_display(title: str, size: tuple[int, int]) -> None:
    """Open the window; only pygame's display and fonts are started, not its sound."""
    is_linux = sys.platform.startswith("linux")
    has_display = any(os.environ.get(key) for key in ("DISPLAY", "WAYLAND_DISPLAY", "SDL_VIDEODRIVER"))
    try:
        if is_linux and not has_display:
            raise pygame.error("neither DISPLAY nor WAYLAND_DISPLAY is set")
        pygame.display.init()
        if pygame.display.get_driver() in _FALLBACK_DRIVERS and not os.environ.get("SDL_VIDEODRIVER"):
            raise pygame.error("the display named by the environment does not respond")
        pygame.font.init()
        pygame.display.set_caption(title)
        pygame.display.set_mode(size, pygame.RESIZABLE)
    except pygame.error as error:
        raise WindowError(
            f"the window cannot be opened ({error}); without a display, use `sonata2d generate` to make data sets and"
            " `sonata2d render` to draw episodes"
        ) from None
