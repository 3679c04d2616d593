"""Versions of the package, of the physics and of the file format."""

__version__ = "0.4.0"
PHYSICS_VERSION = 4  # increases whenever the same seed, settings and commands give other frames
LAST_RELEASE = {1: "0.2.0", 2: "0.2.0"}  # by physics version whose files are refused: the last release that reads them
LAST_REPLAY = {3: "0.3.0"}  # by physics version whose files are read but not run again: the last release that runs them
FORMAT = "sonata2d-episode"
FORMAT_VERSION = 2  # the newest; files that need no more than version 1 are of version 1
