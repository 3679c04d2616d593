"""Versions of the package, of the physics and of the file format."""

__version__ = "0.2.0"
PHYSICS_VERSION = 2  # increases whenever the same seed, settings and commands give other frames
FORMAT = "sonata2d-episode"
FORMAT_VERSION = 1
