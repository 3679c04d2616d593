"""Reading an episode file: whole, of a known version, or refused in one line that names it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import orjson

from ..core.humans import frozen
from ..core.portable_math import Array
from ..core.snapshot import Outcome
from ..errors import NewerFormatError, RecordError
from ..version import FORMAT, FORMAT_VERSION
from .files import read_bytes
from .layout import ABSENT, COMMAND_NAMES, HUMAN_NAMES, ROBOT_NAMES, Tree
from .record import EpisodeRecord, Looks, reading

MIGRATIONS: dict[int, Callable[[Tree], Tree]] = {}  # version: what makes a document of it one of the next version


def read_episode(path: str | Path) -> EpisodeRecord:
    """Read an episode file, plain or packed, of this format version or an older one.

    Raises:
        RecordError: it cannot be read, is no whole episode, or was written by a newer format version.
    """
    path = Path(path)
    return record_of(_document(path), path)


def record_of(document: Tree, path: Path) -> EpisodeRecord:
    """The episode that a document of this format version tells.

    Args:
        document: all that a file says, as JSON gives it.
        path: of the file, for errors.

    Raises:
        RecordError: it is no whole episode.
    """
    with reading(path):
        record = _record(path, document)
        record.scene()
    return record


def _document(path: Path) -> Tree:
    """The file as JSON gives it, brought to this format version."""
    try:
        document: Tree = orjson.loads(read_bytes(path))
    except orjson.JSONDecodeError as error:
        raise RecordError(f"{path} is not whole JSON, it was cut short or damaged: {error}") from error
    if not isinstance(document, dict) or document.get("format") != FORMAT:
        told = repr(document.get("format")) if isinstance(document, dict) else f"a JSON {type(document).__name__}"
        raise RecordError(f"{path} is no {FORMAT} file: its format is {told}")
    version = document.get("version")
    if not isinstance(version, int) or isinstance(version, bool):
        raise RecordError(f"{path} does not say its format version: got {version!r}")
    if version > FORMAT_VERSION:
        raise NewerFormatError(
            f"{path} was written by format version {version}, this sonata2d reads up to {FORMAT_VERSION};"
            " upgrade sonata2d"
        )
    with reading(path):
        while version < FORMAT_VERSION:
            if version not in MIGRATIONS:
                raise RecordError(f"{path} has format version {version}, which never was")
            document, version = MIGRATIONS[version](document), version + 1
    return document


def _record(path: Path, document: Tree) -> EpisodeRecord:
    frames, outcome = document["frames"], document["outcome"]
    return EpisodeRecord(
        path=path,
        document=document,
        looks=_looks([*frames, document["final"]], len(document["humans"])),
        command=_rows([f["command"] for f in frames], "command", (3,), COMMAND_NAMES),
        executed=_rows([f["executed"] for f in frames], "executed", (3,), COMMAND_NAMES),
        guarded=frozen(np.array([f["guarded"] for f in frames], dtype=bool)),
        outcome=Outcome(outcome["status"], outcome["reason"], outcome["tick"], outcome["time"]),
    )


def _looks(told: list[Tree], people: int) -> Looks:
    activity: Any = _rows([look["activity"] for look in told], "activity", (people,)).astype(np.int64)
    present: Any = activity != ABSENT
    humans = [look["humans"] for look in told]
    if not present.all():
        gap = [np.nan] * len(HUMAN_NAMES)
        humans = [[gap if row is None else row for row in rows] for rows in humans]
    return Looks(
        tick=frozen(np.array([look["tick"] for look in told], dtype=np.int64)),
        time=_rows([look["time"] for look in told], "time", ()),
        robot=_rows([look["robot"] for look in told], "robot", (6,), ROBOT_NAMES),
        humans=_rows(humans, "humans", (people, 7), HUMAN_NAMES, present),
        present=frozen(present),
        activity=frozen(activity),
    )


def _rows(
    values: list[Any], key: str, shape: tuple[int, ...], names: tuple[str, ...] = (), present: Any = None
) -> Array:
    """One array of what each look holds under a key.

    Raises:
        ValueError: it is no array of finite numbers of this shape, or where somebody is not present, not all NaN.
    """
    array = np.array(values if values else np.zeros((0, *shape)))
    if array.size == 0 and 0 in (len(values), *shape):
        array = np.zeros((len(values), *shape))
    if array.dtype.kind not in "if" or array.shape != (len(values), *shape):
        columns = f" ({', '.join(names)})" if names else ""
        raise ValueError(f"{key} must be rows of shape {shape} of numbers{columns} in every frame")
    there = np.ones(array.shape[:1], dtype=bool) if present is None else present
    if not np.isfinite(array[there]).all() or np.isfinite(array[~there]).any():
        raise ValueError(f"{key} must be numbers for whoever is present, and null for whoever is not")
    return frozen(array.astype(np.float64))
