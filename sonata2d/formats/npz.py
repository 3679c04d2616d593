"""`npz`: NumPy arrays of a whole episode, with its header and what is no array as JSON text; nothing is lost.

Keys: `tick`, `time`, `robot` (T + 1, 6), `humans` (T + 1, N, 7) with NaN for whoever is not present, `activity`,
`command` and `executed` (T, 3), `guarded`, `human_id`, `header` (text of the episode file's keys besides frames) and
`told` (text: interactions, contacts, events, label of each look). `numpy.load` reads it without pickle.
"""

from __future__ import annotations

import io
import zipfile
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import orjson
from numpy.lib import format as npy

from ..errors import RecordError
from ..record.files import LARGEST, read_bytes
from ..record.layout import Tree
from ..record.record import EpisodeRecord
from .base import Format, Options, parsing

NAME = "npz"
_ARRAYS = ("tick", "time", "robot", "humans", "activity", "command", "executed", "guarded")
_TOLD = ("interactions", "contacts", "events", "label")


def export(record: EpisodeRecord, options: Options) -> bytes:
    """The file of an episode."""
    document, looks = record.document, record.looks
    header = {key: value for key, value in document.items() if key not in ("frames", "final")}
    told = [
        {key: look[key] for key in (*_TOLD, *(("command",) if look is document["final"] else ())) if key in look}
        for look in (*document["frames"], document["final"])
    ]
    arrays: dict[str, Any] = {
        "tick": looks.tick,
        "time": looks.time,
        "robot": looks.robot,
        "humans": looks.humans,
        "activity": looks.activity,
        "command": record.command,
        "executed": record.executed,
        "guarded": record.guarded,
        "human_id": np.array([human.id for human in record.scene().humans], dtype=np.int64),
        "header": np.array(orjson.dumps(header).decode()),
        "told": np.array(orjson.dumps(told).decode()),
    }
    data = io.BytesIO()
    np.savez_compressed(data, allow_pickle=False, **arrays)
    return data.getvalue()


def import_(path: Path, options: Options) -> Iterator[Tree]:
    """The episode that was exported.

    Raises:
        RecordError: it is damaged, or not of sonata2d's making.
    """
    data = read_bytes(path)
    try:
        with parsing(path, NAME):
            yield _document(_load(data))
    except (zipfile.BadZipFile, zlib.error, EOFError, OSError, NotImplementedError, SyntaxError) as error:
        told = " ".join(str(error).split())
        raise RecordError(f"{path} is no whole {NAME} file: {told:.200}") from error


def _load(data: bytes) -> dict[str, Any]:
    """The arrays, none of them larger than what the archive says it holds."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        entries = {entry.filename: entry for entry in archive.infolist()}
        if sum(entry.file_size for entry in entries.values()) > LARGEST:
            raise ValueError(f"it unpacks to more than {LARGEST} bytes; no episode is that long")
        found = {}
        for name in (*_ARRAYS, "human_id", "header", "told"):
            if f"{name}.npy" not in entries:
                raise KeyError(name)
            with archive.open(entries[f"{name}.npy"]) as member:
                found[name] = _array(io.BytesIO(member.read(LARGEST)), name)
    return found


def _array(file: io.BytesIO, name: str) -> Any:
    """An array whose header claims no more than follows it."""
    version = npy.read_magic(file)
    if version not in ((1, 0), (2, 0)):
        raise ValueError(f"{name} has version {version} of the array format")
    read = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
    shape, fortran, dtype = read(file)
    left = len(file.getbuffer()) - file.tell()
    count = 1
    for length in shape:
        count *= length
    if dtype.hasobject or dtype.kind not in "biufU" or fortran or count * dtype.itemsize != left:
        raise ValueError(f"{name} claims {shape} of {dtype}, which is not what follows")
    return np.frombuffer(file.read(), dtype=dtype, count=count).reshape(shape)


def _document(found: dict[str, Any]) -> Tree:
    """The document, keys in the order of the recorder."""
    header, told = orjson.loads(str(found["header"])), orjson.loads(str(found["told"]))
    software = header.pop("software")
    lists = {name: found[name].tolist() for name in _ARRAYS}
    gone = np.isnan(found["humans"][..., 0]) if found["humans"].size else np.zeros((len(told), 0), dtype=bool)
    looks = []
    for t, told_look in enumerate(told):
        people = [None if away else row for row, away in zip(lists["humans"][t], gone[t].tolist(), strict=True)]
        look: Tree = {"tick": lists["tick"][t], "time": lists["time"][t], "robot": lists["robot"][t]}
        if t < len(told) - 1:
            look |= {key: lists[key][t] for key in ("command", "executed", "guarded")}
        looks.append(look | {"humans": people, "activity": lists["activity"][t]} | told_look)
    return {**header, "frames": looks[:-1], "final": looks[-1], "software": software}


FORMAT = Format("NumPy arrays of the whole episode", ".npz", import_, export=export)
