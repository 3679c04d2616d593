"""What a network has learned, in one `.npz` file: plain arrays and a note in JSON, nothing that could be executed."""

from __future__ import annotations

import hashlib
import io
import json
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import ControllerError
from ..exact import Array
from .shapes import refuse

SUFFIX = ".npz"
ABOUT = "about"  # the entry that holds the note
STOCK = Path(__file__).parent / "weights" / "graph-policy.npz"


@dataclass(frozen=True, eq=False)
class Weights:
    """A network's arrays by name, and what it is.

    Attributes:
        graph: what it reads, `paper` or `modern`.
        kind: what it is, `rgcn` or `gatv2`.
        arrays: by name; see `shapes.refuse`.
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

    Raises:
        ValueError: the path ends otherwise, or no network has such arrays; see `shapes.refuse`.
    """
    path = Path(path)
    if path.suffix != SUFFIX:
        raise ValueError(f"weights are written to a file that ends in {SUFFIX}, got {path}")
    refuse(weights.graph, weights.kind, weights.arrays)
    about = json.dumps({"graph": weights.graph, "kind": weights.kind, "note": dict(weights.note)}, sort_keys=True)
    packed = {name: np.asarray(array, dtype=np.float32) for name, array in sorted(weights.arrays.items())}
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, array in {ABOUT: np.array(about), **packed}.items():
            held = io.BytesIO()
            np.save(held, array, allow_pickle=False)
            archive.writestr(zipfile.ZipInfo(f"{name}.npy"), held.getvalue(), zipfile.ZIP_DEFLATED)


def read_weights(path: Path) -> Weights:
    """Read weights that were written so.

    Raises:
        ControllerError: there is no such file, or it holds no network that is known here.
    """
    try:
        data = path.read_bytes()
        arrays, about = _unpacked(data)
        graph, kind, note = about["graph"], about["kind"], about["note"]
        refuse(graph, kind, arrays)
    except OSError as error:
        raise ControllerError(f"the weights {path} cannot be read: {error.strerror}") from error
    except Exception as error:  # a damaged archive fails in many ways
        told = str(error) if isinstance(error, ValueError) else f"{type(error).__name__}: {error}"
        raise ControllerError(
            f"{path} holds no weights of a graph policy: {told}; sonata2d.learned.write_weights makes such files"
        ) from error
    exact = {name: array.astype(np.float64) for name, array in arrays.items()}
    return Weights(graph, kind, exact, note, hashlib.sha256(data).hexdigest())


def _unpacked(data: bytes) -> tuple[dict[str, Any], dict[str, Any]]:
    """The arrays, and what they are."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        arrays = {
            name.removesuffix(".npy"): np.lib.format.read_array(io.BytesIO(archive.read(name)), allow_pickle=False)
            for name in archive.namelist()
        }
    return arrays, json.loads(str(arrays.pop(ABOUT)))
