"""Versions: of the package, and of what decides the numbers in a file."""

__version__ = "0.1.0"
PHYSICS_VERSION = 2  # rises whenever the same seed, settings and commands give other frames
FORMAT = "sonata2d-episode"
FORMAT_VERSION = 1
