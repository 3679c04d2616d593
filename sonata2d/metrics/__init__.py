"""Metrics of recorded episodes, with formula, unit and source; summaries, tables, plots and pages."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
