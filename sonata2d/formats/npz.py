"""`npz`: NumPy arrays of a whole episode, with everything else as JSON text; nothing is lost.

For T frames and the final state of N pedestrians, the keys are `tick`, `time`, `robot` (T + 1, 6), `humans`
(T + 1, N, 7) with NaN where a pedestrian is absent, `activity`, `command` and `executed` (T, 3), `guarded`, `human_id`,
`header` (text: the keys of the episode file besides frames) and `told` (text: interactions, contacts, events and label
of each frame). `numpy.load` reads the file without pickle.
"""

from __future__ import annotations

import io
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import orjson

from ..core.files.archives import read_npz
from ..core.files.limits import MAX_FILE_BYTES
from ..record.files import read_bytes
from ..record.layout import JsonDict
from ..record.record import EpisodeRecord
from .base import Format, Options
from .imported import X
from .parse import parsing

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
    with parsing(path, NAME):
        yield _document(read_npz(data, MAX_FILE_BYTES, (*_ARRAYS, "human_id", "header", "told")))


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
