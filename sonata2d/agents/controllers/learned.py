"""Base class of controllers that a file of weights defines."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, Self

from ...errors import ControllerError
from .base import Controller


class LearnedController(Controller):
    """Base class of controllers that a file of weights defines; its path and SHA-256 are recorded.

    A subclass takes the path as first argument, and sets `_path` and `_sha256`, both None without a file of its own.
    """

    robots_as_people = True
    stock: ClassVar[str] = "the policy"  # name of the weights that have no path

    _path: str | None
    _sha256: str | None

    def settings(self) -> dict[str, Any]:
        """Return the path and the hash of the weights."""
        return {"weights": self._path, "sha256": self._sha256}

    @classmethod
    def from_settings(cls, settings: Mapping[str, Any], *, weights: str | None = None) -> Self:
        """Reconstruct a recorded policy.

        Args:
            settings: as stored in an episode file.
            weights: path of the file, if it has moved since; None: the recorded path.

        Raises:
            ControllerError: the file cannot be read, or its weights differ from the recorded ones.
        """
        policy = cls(weights or settings.get("weights"))  # type: ignore[call-arg]
        if settings.get("sha256", policy._sha256) != policy._sha256:
            sha256 = str(settings["sha256"])[:8]
            raise ControllerError(
                f"{policy._path or cls.stock} has other weights now than when the episode was recorded; "
                f"provide the weights of SHA-256 {sha256}…"
            )
        policy._path = settings.get("weights", policy._path)
        return policy
