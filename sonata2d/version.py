"""Versions of the package, of the physics and of the file format."""

__version__ = "0.3.0"
PHYSICS_VERSION = 4  # increases whenever the same seed, settings and commands give other frames
# The last release with each earlier physics version, which can replay its files.
LAST_RELEASE = {2: "0.2.0", 3: "0.3.0"}
FORMAT = "sonata2d-episode"
FORMAT_VERSION = 1
