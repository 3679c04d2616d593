"""Pictures, films and pages of an episode; the only place where y points down."""

import os

os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")  # before anything here imports pygame

from .between import between
from .camera import Camera
from .draw import Layers, backdrop, picture
from .eye import image_of
from .film import save_film
from .hud import Hud, draw_hud
from .live import Painter
from .page import save_page
from .render import SUFFIXES, render
from .sheet import moments, scene_picture, snapshot_of
from .still import save_picture, save_surface
from .strips import filmstrip
from .trails import Trails
from .vector import save_moment
from .veil import draw_tint, draw_veil

__all__ = [
    "SUFFIXES",
    "Camera",
    "Hud",
    "Layers",
    "Painter",
    "Trails",
    "backdrop",
    "between",
    "draw_hud",
    "draw_tint",
    "draw_veil",
    "filmstrip",
    "image_of",
    "moments",
    "picture",
    "render",
    "save_film",
    "save_moment",
    "save_page",
    "save_picture",
    "save_surface",
    "scene_picture",
    "snapshot_of",
]
