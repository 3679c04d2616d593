"""Start of pygame's display, for packages that open windows."""

from __future__ import annotations

import os
import sys

import pygame

_FALLBACK_DRIVERS = ("offscreen", "dummy")  # SDL uses them if there is no display; allowed only on request


def start_display() -> None:
    """Start pygame's display, so that windows can be opened.

    Raises:
        pygame.error: there is no display.
    """
    has_display = any(os.environ.get(key) for key in ("DISPLAY", "WAYLAND_DISPLAY", "SDL_VIDEODRIVER"))
    if sys.platform.startswith("linux") and not has_display:
        raise pygame.error("neither DISPLAY nor WAYLAND_DISPLAY is set")
    pygame.display.init()
    if pygame.display.get_driver() in _FALLBACK_DRIVERS and not os.environ.get("SDL_VIDEODRIVER"):
        pygame.display.quit()
        raise pygame.error("the display named by the environment does not respond")
