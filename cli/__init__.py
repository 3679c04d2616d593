"""The command line: arguments in, exit code out. Installed as `sonata2d_cli`."""

from .main import main

__all__ = ["main"]
