"""Runs the command line as `python -m sonata2d_cli`."""

from . import main

main(prog_name="sonata2d")
