"""The window: opens, resizes, keeps time, and shows one screen after another."""

from __future__ import annotations

import json
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Protocol

import pygame
import pygame_gui
from pygame._sdl2 import controller

from ..collect.texts import text
from ..core.geometry import Disc
from ..errors import RenderError, WindowError
from ..view.brush import Brush
from ..view.canvas import PixelCanvas
from ..view.display import start_display
from ..view.figures import draw_chassis
from ..view.fonts import FAMILY
from ..view.projection import Camera
from ..view.stills import save_surface
from .gui_fonts import provide_fonts
from .widgets import text_size

_REFERENCE = (1280, 800)  # px, size of a window at scale 1
_FPS = 60
_ICON = 64  # px
_CTRL = pygame.KMOD_CTRL | pygame.KMOD_META
_THEME = Path(__file__).with_name("theme.json")
# Text sizes of widgets at scale 1, px. The "defaults" of a theme are colours only, so elements are named.
_TEXT_SIZES = dict.fromkeys(("button", "label", "text_entry_line", "text_box"), 20) | {"#title": 26}
_LENGTHS = (  # of the theme, px at scale 1
    *((part, "shape_corner_radius", 6) for part in ("button", "text_entry_line", "panel")),
    *((part, "border_width", 1) for part in ("button", "text_entry_line", "panel")),
    ("tool_tip", "rect_width", 260),
)
_MIN_DRAWN = 160, 120  # px; a window that was dragged to a smaller size keeps its last picture
_MIN_SIZE, _MAX_SHARE = (1024, 640), (0.86, 0.82)  # of the desktop: title bar and panels need the rest


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
        """Save what must not be lost; called when another screen follows or the window closes. Nothing by default."""
        return


class Stage:
    """A window with widgets.

    Args:
        title: of the window.
        size: px; None to choose one that fits the desktop.
        fps: maximum number of frames per second.
        clock: waits for the next frame at a given rate and returns the ms that have passed; real time by default.

    Attributes:
        ui: pygame_gui's manager of the widgets; emptied when a screen is entered.
        scale: size of texts and widgets relative to a window of `_REFERENCE`.

    Raises:
        WindowError: there is no display.
    """

    def __init__(
        self,
        title: str = "sonata2d",
        *,
        size: tuple[int, int] | None = None,
        fps: int = _FPS,
        clock: Callable[[int], int] | None = None,
    ) -> None:
        self._fps, self._clock = fps, clock or pygame.time.Clock().tick
        self._held: set[int] = set()  # keys that are down
        self._stale: set[int] = set()  # keys that are down since an earlier screen
        _open_display(title, size)
        self._reset_ui(self.size)

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
            if self._is_stale(event):
                continue
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
            self._stale = set(self._held)
            self._reset_ui(self.size)
            following.enter(self)
        self.ui.update(seconds)
        if self.size[0] >= _MIN_DRAWN[0] and self.size[1] >= _MIN_DRAWN[1]:
            following.draw(self.surface)
            self.ui.draw_ui(self.surface)
        pygame.display.flip()
        return following

    def _is_stale(self, event: pygame.Event) -> bool:
        """Whether an event repeats a key that is down since an earlier screen: that screen has used the key.

        A text field switches key repeat on. While the next screen is made, which takes a moment, repetitions of Enter
        arrive, and the next screen would take them for its own Enter.
        """
        if event.type == pygame.KEYUP:
            self._held.discard(event.key)
            self._stale.discard(event.key)
        elif event.type == pygame.KEYDOWN:
            self._held.add(event.key)
            return event.key in self._stale
        return False

    def _save_screenshot(self) -> None:
        """Save the window's content into the working directory."""
        path = Path.cwd() / f"sonata2d-{datetime.now(UTC):%Y%m%dT%H%M%SZ}.png"
        try:
            save_surface(self.surface, path)
            pygame.display.set_caption(text("notice.saved", path=path))
        except RenderError as error:
            pygame.display.set_caption(text("notice.not_saved", problem=error))

    def _reset_ui(self, size: tuple[int, int]) -> None:
        """Replace the manager by an empty one for a window size; all texts and widgets have one scale."""
        self.scale = max(min(size[0] / _REFERENCE[0], size[1] / _REFERENCE[1]), 0.75)
        theme = json.loads(_THEME.read_text(encoding="utf-8"))
        sizes = {part: text_size(points, self.scale) for part, points in _TEXT_SIZES.items()}
        for part, points in sizes.items():
            theme.setdefault(part, {})["font"] = {"name": FAMILY, "size": str(points)}
        for part, name, length in _LENGTHS:
            pixels = str(max(round(length * self.scale), 1))
            text_of_length = ",".join([pixels] * 4) if "radius" in name else pixels
            theme.setdefault(part, {}).setdefault("misc", {})[name] = text_of_length
        self.ui = pygame_gui.UIManager(size)
        provide_fonts(self.ui, set(sizes.values()))
        self.ui.get_theme().load_theme(theme)


def fitting_size(desktop: tuple[int, int]) -> tuple[int, int]:
    """Size of a window that leaves room for its title bar and the panels of a desktop of a given size, px.

    >>> fitting_size((1280, 800))
    (1049, 656)
    """
    limits = [
        min(max(share * side, minimum), 0.96 * side)
        for share, side, minimum in zip(_MAX_SHARE, desktop, _MIN_SIZE, strict=True)
    ]
    scale = min(limit / side for limit, side in zip(limits, _REFERENCE, strict=True))
    width, height = (int(scale * side) for side in _REFERENCE)
    # The shape of _REFERENCE would make a window on a small desktop lower or narrower than the minimum.
    return max(width, int(min(limits[0], _MIN_SIZE[0]))), max(height, int(min(limits[1], _MIN_SIZE[1])))


def _icon() -> pygame.Surface:
    """The robot as the icon of the window, which points up."""
    surface = pygame.Surface((_ICON, _ICON), pygame.SRCALPHA)
    camera = Camera(_ICON, -0.5, 0.5, surface.get_size())
    draw_chassis(Brush(PixelCanvas(surface), camera).at((0.0, 0.0), (0.0, 1.0)), shape=Disc(0.46))
    return surface


def _open_display(title: str, size: tuple[int, int] | None) -> None:
    """Open the window; only pygame's display and fonts are started, not its sound."""
    try:
        start_display()
        pygame.font.init()
        pygame.display.set_caption(title)
        pygame.display.set_icon(_icon())
        pygame.display.set_mode(size or fitting_size(pygame.display.get_desktop_sizes()[0]), pygame.RESIZABLE)
    except pygame.error as error:
        raise WindowError(
            f"the window cannot be opened ({error}); without a display, use `sonata2d generate` to make data sets and"
            " `sonata2d render` to draw episodes"
        ) from None
