from .draw import backdrop as backdrop, picture as picture
from .episode_files import SUFFIXES as SUFFIXES, render as render
from .episode_page import save_page as save_page
from .film import save_film as save_film
from .interpolation import between as between
from .layers import Layers as Layers
from .painter import Painter as Painter, image_of as image_of
from .projection import Camera as Camera
from .stills import (
    filmstrip as filmstrip,
    moments as moments,
    save_moment as save_moment,
    save_picture as save_picture,
    save_surface as save_surface,
    scene_picture as scene_picture,
    snapshot_of as snapshot_of,
)
from .trails import Trails as Trails
