"""Studies of people who read, drive, answer and rate, described by one file; independent of HTTP."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
