"""Recordings of the episodes of an environment."""

from __future__ import annotations

from contextlib import suppress
from itertools import count
from pathlib import Path

from ..core.snapshot import Outcome, Snapshot
from ..datasets.manifest import MANIFEST
from ..errors import RecordError
from ..record.files import write_document
from ..record.recorder import EpisodeRecorder


def recording_folder(path: str | Path) -> Path:
    """The folder of the recordings.

    Raises:
        TypeError: it is not a path.
        RecordError: it is a data set, whose manifest would not list the recordings.
    """
    if not isinstance(path, str | Path):
        raise TypeError(f"record must be the path of a folder, got {path!r}")
    if (Path(path) / MANIFEST).exists():
        raise RecordError(f"{path} is a data set, whose {MANIFEST} lists its episodes; record in another folder")
    return Path(path)


class FolderRecorder(EpisodeRecorder):
    """Recorder of each episode in the next free file of a folder, 000000.json and so on; processes may share it.

    Args:
        folder: is created if it is missing.
    """

    def __init__(self, folder: Path) -> None:
        super().__init__()
        self._folder = folder

    def close(self, last: Snapshot, outcome: Outcome) -> None:
        """End the episode, and write its file.

        Raises:
            RecordError: the file cannot be written.
        """
        super().close(last, outcome)
        path = self._reserved()
        self.id = path.stem
        try:
            write_document(path, self.complete())
        except BaseException:
            path.unlink(missing_ok=True)  # it is empty
            raise

    def _reserved(self) -> Path:
        """A new empty file in the folder."""
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            numbers = [int(path.stem) for path in self._folder.glob("*.json") if path.stem.isdecimal()]
            for number in count(max(numbers, default=-1) + 1):
                path = self._folder / f"{number:06}.json"
                with suppress(FileExistsError):
                    path.touch(exist_ok=False)
                    return path
        except OSError as error:
            raise RecordError(f"cannot record in {self._folder}: {error.strerror or error}") from error
        raise AssertionError("unreachable")
