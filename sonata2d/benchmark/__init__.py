"""The benchmark: frozen suites of scenes, controllers in processes of their own, and rows that anybody can replay."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
