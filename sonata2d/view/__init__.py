"""Pictures, films and pages of an episode; the only place where y points down."""

import os

os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")  # before anything here imports pygame

from .camera import Camera
from .draw import Layers, backdrop, picture
from .film import save_film
from .page import save_page
from .render import SUFFIXES, render
from .sheet import moments, scene_picture, snapshot_of
from .still import save_picture, save_surface
from .trails import Trails

__all__ = [
    "SUFFIXES",
    "Camera",
    "Layers",
    "Trails",
    "backdrop",
    "moments",
    "picture",
    "render",
    "save_film",
    "save_page",
    "save_picture",
    "save_surface",
    "scene_picture",
    "snapshot_of",
]
