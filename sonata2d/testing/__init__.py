"""Checks of controllers for their authors, and of the realism of the pedestrians."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
