"""The window itself: opens, resizes, keeps time, and shows one screen after another."""

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
from ..view.still import save_surface

SIZE = (1280, 800)
FPS = 60
_CTRL = pygame.KMOD_CTRL | pygame.KMOD_META
_UNSEEN = ("offscreen", "dummy")  # what SDL falls back to; fine only where it was asked for
_THEME = Path(__file__).with_name("theme.json")
_POINTS = {"defaults": 14, "#title": 18, "#line": 14, "#row": 14, "#key": 14}  # of texts, in a window of SIZE


class Screen(Protocol):
    """What the window shows, and what it makes of a person's doings."""

    def enter(self, stage: Stage) -> None:
        """It is shown from now on, or again after a change of size: make the widgets anew."""

    def handle(self, event: pygame.Event) -> None:
        """An event that no widget has taken."""

    def advance(self, seconds: float) -> Screen | None:
        """So much real time has passed. Answers the screen to show next: itself, another, or None to close."""

    def draw(self, surface: pygame.Surface) -> None:
        """Draw all but the widgets, which come on top."""

    def leave(self) -> None:
        """The window closes, or another screen takes over: put away what must not be lost."""


class Stage:
    """A window with widgets.

    Args:
        title: of the window.
        size: pixels.
        fps: pictures a second at most.
        clock: waits for the next of so many pictures a second, and answers the ms that passed; real time unless given.

    Attributes:
        ui: pygame_gui's manager of the widgets on show; emptied whenever a screen is entered.
        scale: by how much texts and widgets are larger than in a window of `SIZE`.

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
        self._widgets_for(size)

    @property
    def size(self) -> tuple[int, int]:
        """Of the window, pixels."""
        return self.surface.get_size()

    @property
    def surface(self) -> pygame.Surface:
        surface = pygame.display.get_surface()
        assert surface is not None
        return surface

    def run(self, screen: Screen) -> None:
        """Show a screen, and those that follow it, until one asks to close."""
        current: Screen | None = screen
        screen.enter(self)
        try:
            while current is not None:
                current = self.turn(current)
        finally:
            controller.quit()  # pygame.quit() leaves it, and a window opened later would hear of no pad
            pygame.quit()

    def turn(self, screen: Screen) -> Screen | None:
        """One picture: hand on what happened, let time pass, draw. Answers the screen to show next."""
        seconds = self._clock(self._fps) / 1000.0
        for event in pygame.event.get():
            if event.type == pygame.VIDEORESIZE:
                self._widgets_for(self.size)
                screen.enter(self)
            elif event.type == pygame.KEYDOWN and event.key == pygame.K_F12:
                self._save_picture()
            elif event.type == pygame.KEYDOWN and event.key == pygame.K_q and event.mod & _CTRL:
                screen.handle(pygame.event.Event(pygame.QUIT))  # wherever the focus is
            elif not self.ui.process_events(event) or event.type in (pygame.KEYUP, pygame.MOUSEBUTTONUP):
                screen.handle(event)
        following = screen.advance(seconds)
        if following is not screen:
            screen.leave()
            if following is None:
                return None
            self._widgets_for(self.size)
            following.enter(self)
        self.ui.update(seconds)
        following.draw(self.surface)
        self.ui.draw_ui(self.surface)
        pygame.display.flip()
        return following

    def _save_picture(self) -> None:
        """Save what the window shows, into the folder that the program was started in."""
        path = Path.cwd() / f"sonata2d-{datetime.now(UTC):%Y%m%dT%H%M%SZ}.png"
        try:
            save_surface(self.surface, path)
            pygame.display.set_caption(f"saved: {path}")
        except RenderError as error:
            pygame.display.set_caption(f"not saved: {error}")

    def _widgets_for(self, size: tuple[int, int]) -> None:
        """No widgets, for a window of this size."""
        self.scale = max(min(size[0] / SIZE[0], size[1] / SIZE[1]), 0.75)
        theme = json.loads(_THEME.read_text(encoding="utf-8"))
        for part, points in _POINTS.items():
            theme.setdefault(part, {})["font"] = {"name": "noto_sans", "size": str(round(points * self.scale))}
        self.ui = pygame_gui.UIManager(size, theme)


def _open_display(title: str, size: tuple[int, int]) -> None:
    """Open the window; only what it needs of pygame is started, and no sound."""
    is_linux = sys.platform.startswith("linux")
    named = any(os.environ.get(key) for key in ("DISPLAY", "WAYLAND_DISPLAY", "SDL_VIDEODRIVER"))
    try:
        if is_linux and not named:
            raise pygame.error("neither DISPLAY nor WAYLAND_DISPLAY is set")
        pygame.display.init()
        if pygame.display.get_driver() in _UNSEEN and not os.environ.get("SDL_VIDEODRIVER"):
            raise pygame.error("the display that the environment names does not answer")
        pygame.font.init()
        pygame.display.set_caption(title)
        pygame.display.set_mode(size, pygame.RESIZABLE)
    except pygame.error as error:
        raise WindowError(
            f"no window can be opened here ({error}); without a display, `sonata2d generate` makes data sets with any"
            " controller and `sonata2d render` draws episodes"
        ) from None
