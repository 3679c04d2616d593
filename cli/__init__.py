"""The command line of sonata2d, installed as the package `sonata2d_cli`: arguments in, text and exit code out."""

from .start import ended_by_signals

with ended_by_signals():
    from .main import main

__all__ = ["main"]
