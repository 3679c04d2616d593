"""The window: a person drives, labels, rates and replays; any controller can be watched at work."""

import os

os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")  # before anything here imports pygame
os.environ.setdefault("SDL_WINDOWS_DPI_AWARENESS", "permonitorv2")  # a pixel is a pixel of the screen

from .stage import Screen, Stage

__all__ = ["Screen", "Stage"]
