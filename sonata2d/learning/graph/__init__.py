"""Episodes as graphs: the representation of the SONATA paper and a modern variant, for NumPy or PyTorch Geometric."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
