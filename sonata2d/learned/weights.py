"""What a network has learned, in one `.npz` file: plain arrays and a note in JSON, nothing that could be executed."""

from __future__ import annotations

import hashlib
import io
import json
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import ControllerError
from ..exact import Array

SUFFIX = ".npz"
ABOUT = "about"  # the entry that holds the note
GRAPHS, KINDS = ("paper", "modern"), ("rgcn", "gatv2")
STOCK = Path(__file__).parent / "weights" / "graph-policy.npz"


@dataclass(frozen=True, eq=False)
class Weights:
    """A network's arrays by name, and what it is.

    Attributes:
        graph: what it reads, `paper` or `modern`.
        kind: what it is, `rgcn` or `gatv2`.
        arrays: by name; see `network`.
        note: how it came to be, for people.
        sha256: of the file's bytes.
    """

    graph: str
    kind: str
    arrays: Mapping[str, Array]
    note: Mapping[str, Any]
    sha256: str = ""


def write_weights(path: str | Path, weights: Weights) -> None:
    """Write weights as float32; the same weights give the same bytes.

    Args:
        path: ends in .npz.
        weights: what to write.
    """
    about = json.dumps({"graph": weights.graph, "kind": weights.kind, "note": dict(weights.note)}, sort_keys=True)
    packed = {name: np.asarray(array, dtype=np.float32) for name, array in sorted(weights.arrays.items())}
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, array in {ABOUT: np.array(about), **packed}.items():
            held = io.BytesIO()
            np.save(held, array, allow_pickle=False)
            archive.writestr(zipfile.ZipInfo(f"{name}.npy"), held.getvalue(), zipfile.ZIP_DEFLATED)


@lru_cache(maxsize=4)
def read_weights(path: Path) -> Weights:
    """Read weights that were written so.

    Raises:
        ControllerError: there is no such file, or it holds no network that is known here.
    """
    try:
        data = path.read_bytes()
        with np.load(io.BytesIO(data), allow_pickle=False) as archive:
            arrays = {name: np.asarray(archive[name]) for name in archive.files}
        about = json.loads(str(arrays.pop(ABOUT)))
        if about["graph"] not in GRAPHS or about["kind"] not in KINDS:
            raise ValueError(f"its graph is {about['graph']!r}, its kind {about['kind']!r}")
    except (OSError, ValueError, KeyError, zipfile.BadZipFile) as error:
        raise ControllerError(f"{path} holds no weights of a graph policy: {error}") from error
    exact = {name: array.astype(np.float64) for name, array in arrays.items()}
    return Weights(about["graph"], about["kind"], exact, about["note"], hashlib.sha256(data).hexdigest())
