"""Claims of folders in stores, which have no locks."""

from __future__ import annotations

import time
from contextlib import suppress
from pathlib import Path
from uuid import uuid4

from ..core.files.locations import content_of, explained, is_remote, put_content
from ..errors import RecordError

_SETTLE_S = 0.6  # after which the claims of programs that begin together are visible to all of them
_CHECK_S = 0.2  # between two looks at a claim


class StoreClaim:
    """A marker with a random id in a folder of a store: the program that wrote it last may write the folder.

    A folder on this machine needs no claim: there, all methods do nothing.

    Args:
        path: of the marker, in the folder.

    Attributes:
        is_lost: whether another program was found to have the folder.
    """

    def __init__(self, path: Path) -> None:
        self._path, self._id, self._looked, self.is_lost = path, uuid4().hex.encode(), 0.0, False
        self._is_taken = False

    def take(self) -> None:
        """Write the marker and read it back, after a time in which other programs may have written theirs.

        Raises:
            RecordError: another program has the folder, or it cannot be written.
        """
        if is_remote(self._path):
            with explained(self._path, "written"):
                put_content(self._path, self._id)
            self._is_taken = True
            time.sleep(_SETTLE_S)
            self.require()

    def require(self, *, now: bool = True) -> None:
        """Raise RecordError if another program has the folder; unless `now`, look from time to time only."""
        if not self._is_taken or (not now and time.monotonic() < self._looked + _CHECK_S):
            return
        self._looked = time.monotonic()
        try:
            self.is_lost = content_of(self._path) != self._id
        except FileNotFoundError:  # the other program has finished, and removed its marker
            self.is_lost = True
        except OSError as error:
            raise RecordError(f"{self._path} cannot be read: {error.strerror or error}") from error
        if self.is_lost:
            raise RecordError(
                f"another program writes to {self._path.parent}, so this one has stopped; choose another folder"
            )

    def release(self) -> None:
        """Remove the marker, unless another program has the folder."""
        if self._is_taken and not self.is_lost:
            with suppress(OSError, RecordError):
                self.require()
                self._path.unlink(missing_ok=True)
