"""The pygame window: drive, label, rate and replay runs, and watch controllers live."""

import os

os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")  # must be set before pygame is imported
os.environ.setdefault("SDL_WINDOWS_DPI_AWARENESS", "permonitorv2")  # window pixels are screen pixels

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
