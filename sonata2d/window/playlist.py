"""Recorded runs one after another; those that cannot be read are passed over."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from pathlib import Path

from ..errors import RecordError
from ..record.reader import read_episode
from ..record.record import EpisodeRecord

_log = logging.getLogger(__name__)


class Playlist:
    """Files in their order, one of them open.

    Args:
        paths: of the files.

    Attributes:
        record: the run that is open.
        index: its place among the files, from 0.

    Raises:
        RecordError: none of the files can be read; says why the last one cannot.
    """

    def __init__(self, paths: Sequence[Path]) -> None:
        self._paths = list(paths)
        opened, passed = self._open(0, 1)
        if opened is None:
            raise passed[-1] if passed else RecordError("there is no file to view")
        self.index, self.record = opened
        self.passed = passed[-1] if passed else None

    def __len__(self) -> int:
        return len(self._paths)

    def turn(self, direction: int) -> str:
        """Open the next file that can be read (1), or the one before (-1); answers what the person should know."""
        opened, passed = self._open(self.index + direction, direction)
        notice = f"passed over: {passed[-1]}" if passed else ""
        if opened is None:
            end = f"this is the {'last' if direction > 0 else 'first'} file"
            return f"{end}; {notice}" if notice else end
        self.index, self.record = opened
        return notice

    def _open(self, index: int, direction: int) -> tuple[tuple[int, EpisodeRecord] | None, list[RecordError]]:
        """The first file from there on that can be read, and why those before it cannot."""
        passed: list[RecordError] = []
        while 0 <= index < len(self._paths):
            try:
                return (index, read_episode(self._paths[index])), passed
            except RecordError as error:
                _log.warning("passed over: %s", error)
                passed.append(error)
                index += direction
        return None, passed
