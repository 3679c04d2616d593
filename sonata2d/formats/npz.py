"""`npz`: NumPy arrays of a whole episode, with everything else as JSON text; nothing is lost.

For T frames and the final state of N pedestrians, the keys are `tick`, `time`, `robot` (T + 1, 6), `humans`
(T + 1, N, 7) with NaN where a pedestrian is absent, `activity`, `command` and `executed` (T, 3), `guarded`, `human_id`,
`header` (text: the keys of the episode file besides frames) and `told` (text: interactions, contacts, events and label
of each frame). `numpy.load` reads the file without pickle.
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
from ..record.files import MAX_BYTES, read_bytes
from ..record.layout import JsonDict
from ..record.record import EpisodeRecord
from .base import Format, Options
from .imported import X
from .parse import one_line, parsing

NAME = "npz"
_ARRAYS = ("tick", "time", "robot", "humans", "activity", "command", "executed", "guarded")
_TEXT_KEYS = ("interactions", "contacts", "events", "label")


def export(record: EpisodeRecord, options: Options) -> bytes:
    """Return the file of an episode."""
    document, states = record.document, record.states
    header = {key: value for key, value in document.items() if key not in ("frames", "final")}
    texts = [  # the command of the final state, if it has one, is not in the arrays
        {
            key: frame[key]
            for key in (*_TEXT_KEYS, *(("command",) if frame is document["final"] else ()))
            if key in frame
        }
        for frame in (*document["frames"], document["final"])
    ]
    arrays: dict[str, Any] = {
        "tick": states.tick,
        "time": states.time,
        "robot": states.robot,
        "humans": states.humans,
        "activity": states.activity,
        "command": record.command,
        "executed": record.executed,
        "guarded": record.guarded,
        "human_id": np.array([human.id for human in record.scene().humans], dtype=np.int64),
        "header": np.array(orjson.dumps(header).decode()),
        "told": np.array(orjson.dumps(texts).decode()),
    }
    data = io.BytesIO()
    np.savez_compressed(data, allow_pickle=False, **arrays)
    return data.getvalue()


def import_(path: Path, options: Options) -> Iterator[JsonDict]:
    """Yield the episode that was exported.

    Raises:
        RecordError: the file is damaged, or was not exported by sonata2d.
    """
    data = read_bytes(path)
    try:
        with parsing(path, NAME):
            yield _document(_load(data))
    except (zipfile.BadZipFile, zlib.error, EOFError, OSError, NotImplementedError, SyntaxError) as error:
        raise RecordError(f"{path} is not a complete {NAME} file: {one_line(error):.200}") from error


def _load(data: bytes) -> dict[str, Any]:
    """The arrays of an archive.

    Declared sizes are checked before anything is unpacked, so that a damaged file cannot exhaust the memory.
    """
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        entries = {entry.filename: entry for entry in archive.infolist()}
        if sum(entry.file_size for entry in entries.values()) > MAX_BYTES:
            raise ValueError(f"it unpacks to more than {MAX_BYTES} bytes, the limit of an episode")
        arrays = {}
        for name in (*_ARRAYS, "human_id", "header", "told"):
            if f"{name}.npy" not in entries:
                raise KeyError(name)
            with archive.open(entries[f"{name}.npy"]) as member:
                arrays[name] = _array(io.BytesIO(member.read(MAX_BYTES)), name)
    return arrays


def _array(file: io.BytesIO, name: str) -> Any:
    """Read an array whose header declares exactly the bytes that follow it."""
    version = npy.read_magic(file)
    if version not in ((1, 0), (2, 0)):
        raise ValueError(f"{name} has version {version} of the array format; known are 1.0 and 2.0")
    read = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
    shape, fortran, dtype = read(file)
    remaining = len(file.getbuffer()) - file.tell()
    count = 1
    for length in shape:
        count *= length  # Python integers do not overflow
    if dtype.hasobject or dtype.kind not in "biufU" or fortran or count * dtype.itemsize != remaining:
        raise ValueError(f"{name} declares {shape} of {dtype}, but its data differ")
    return np.frombuffer(file.read(), dtype=dtype, count=count).reshape(shape)


def _document(arrays: dict[str, Any]) -> JsonDict:
    """The document, with keys in the order of the recorder."""
    header, texts = orjson.loads(str(arrays["header"])), orjson.loads(str(arrays["told"]))
    software = header.pop("software")
    lists = {name: arrays[name].tolist() for name in _ARRAYS}
    humans = arrays["humans"]
    absent = np.isnan(humans[..., X]) if humans.size else np.zeros((len(texts), 0), dtype=bool)
    frames = []
    for t, text in enumerate(texts):
        rows = [
            None if is_absent else row for row, is_absent in zip(lists["humans"][t], absent[t].tolist(), strict=True)
        ]
        frame: JsonDict = {"tick": lists["tick"][t], "time": lists["time"][t], "robot": lists["robot"][t]}
        if t < len(texts) - 1:
            frame |= {key: lists[key][t] for key in ("command", "executed", "guarded")}
        frames.append(frame | {"humans": rows, "activity": lists["activity"][t]} | text)
    return {**header, "frames": frames[:-1], "final": frames[-1], "software": software}


FORMAT = Format("NumPy arrays of the whole episode", ".npz", import_, export=export)
