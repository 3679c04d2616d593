"""Studies: what a participant reads, drives, answers and rates, from one file; independent of pygame and HTTP."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
