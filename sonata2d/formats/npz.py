"""`npz`: NumPy arrays of a whole episode, with everything else as JSON text; nothing is lost.

For T frames and the final state of N pedestrians, the keys are `tick`, `time`, `robot` (T + 1, 6), `humans`
(T + 1, N, 7) with NaN where a pedestrian is absent, `activity`, `command` and `executed` (T, 3), `guarded`, `human_id`,
`header` (text: the keys of the episode file besides frames) and `texts` (text: interactions, contacts, doors, other
robots, events, label and readings of each frame). `numpy.load` reads the file without pickle.
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
from .estimates import X
from .format import Format, Options, header_of
from .importing import document_of, parsing

NAME = "npz"
_STATES = ("tick", "time", "robot", "humans", "activity")  # arrays of T + 1 states
_TWISTS = ("command", "executed", "guarded")  # arrays of T frames
_ARRAYS = (*_STATES, *_TWISTS)
_OLD_TEXTS = "told"  # name of `texts` in files of 0.3.0
_TEXT_KEYS = ("interactions", "contacts", "doors", "robots", "events", "label", "sensors")


def export(record: EpisodeRecord, options: Options) -> bytes:
    """Return the file of an episode."""
    document, states = record.document, record.states
    frames = (*document["frames"], document["final"])
    texts = [{key: frame[key] for key in _TEXT_KEYS if key in frame} for frame in frames]
    if "command" in frames[-1]:  # the arrays hold the commands of the T frames only
        texts[-1]["command"] = frames[-1]["command"]
    arrays: dict[str, Any] = {
        **{name: getattr(states, name) for name in _STATES},
        **{name: getattr(record, name) for name in _TWISTS},
        "human_id": record.scene().human_table.id,
        "header": np.array(orjson.dumps(header_of(document)).decode()),
        "texts": np.array(orjson.dumps(texts).decode()),
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
        yield _document(read_npz(data, MAX_FILE_BYTES))


def _document(arrays: dict[str, Any]) -> JsonDict:
    """The document, with keys in the order of the recorder."""
    texts = arrays[_OLD_TEXTS if _OLD_TEXTS in arrays else "texts"]
    header, texts = orjson.loads(str(arrays["header"])), orjson.loads(str(texts))
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
            frame |= {key: lists[key][t] for key in _TWISTS}
        frames.append(frame | {"humans": rows, "activity": lists["activity"][t]} | text)
    return document_of(header, frames)


FORMAT = Format("NumPy arrays of the whole episode", ".npz", import_, export=export, holds_robots=True)
