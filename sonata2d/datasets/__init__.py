"""Data sets: folders of episodes with a manifest; generation, verification, mirroring, splitting and merging."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
