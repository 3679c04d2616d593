"""Checks of controllers for their authors, of the realism of the pedestrians, and standard tests."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
