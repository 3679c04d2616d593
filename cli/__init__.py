"""The command line of sonata2d, installed as the package `sonata2d_cli`: arguments in, text and exit code out."""

import sys

try:
    from .main import main
except KeyboardInterrupt:  # Ctrl-C while the modules are loaded
    sys.stderr.write("\ninterrupted\n")
    sys.exit(130)

__all__ = ["main"]
