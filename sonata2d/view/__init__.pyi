from .episode_files import SUFFIXES as SUFFIXES, render as render
from .film import save_film as save_film
from .interpolation import between as between
from .layers import Layers as Layers
from .painter import Painter as Painter, image_of as image_of
from .projection import Camera as Camera
from .sheets import scene_picture as scene_picture
from .stills import (
    Still as Still,
    filmstrip as filmstrip,
    picture as picture,
    save_moment as save_moment,
    save_surface as save_surface,
    snapshot_of as snapshot_of,
)
from .trails import Trails as Trails
