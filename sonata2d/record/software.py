"""What a file says of the software that made it."""

from __future__ import annotations

import platform
import sysconfig
from functools import cache

from ..version import __version__


def software() -> dict[str, str]:
    """Versions of sonata2d, Python, NumPy and pymunk, and the platform: what bytes may depend on, and no more."""
    return dict(_software())


@cache
def _software() -> dict[str, str]:
    return {
        "sonata2d": __version__,
        "python": platform.python_version(),
        "numpy": _version_of("numpy"),
        "pymunk": _version_of("pymunk"),
        "platform": sysconfig.get_platform(),
    }


def _version_of(package: str) -> str:
    from importlib.metadata import PackageNotFoundError, version  # a tenth of the time that `import sonata2d` takes

    try:
        return version(package)
    except PackageNotFoundError:
        return "none"
