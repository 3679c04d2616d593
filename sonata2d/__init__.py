"""sonata2d: labelled, reproducible social-navigation data sets from a light 2-D simulator."""

import lazy_loader

from .core import drawable as _drawable

_drawable.display_module = f"{__name__}.view.notebook_views"
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
