"""Learning: episodes as graphs, and policies that run in NumPy with the same bits on every processor."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
