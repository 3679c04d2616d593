"""The pygame window: drive, label, rate and replay; watch any controller live."""

import os

os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")  # before anything here imports pygame
os.environ.setdefault("SDL_WINDOWS_DPI_AWARENESS", "permonitorv2")  # window pixels are screen pixels

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
