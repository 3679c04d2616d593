"""Weights of a policy network: one `.npz` file of plain arrays with a JSON header, validated when it is read."""

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

from ..core.portable_math import Array
from ..errors import ControllerError
from .fixed_point import LARGEST_WEIGHT
from .graph.graph import RELATIONS
from .graph.paper import FEATURES, INSTANTS
from .inputs import INPUTS

GRAPHS = {  # what a network reads: inputs of a node, relations of an edge
    "paper": (len(FEATURES), len(RELATIONS) + 2 * (INSTANTS - 1)),
    "modern": (len(INPUTS), len(RELATIONS)),
}
KINDS = ("rgcn", "gatv2")
OUT = 3  # ahead, sideways, turn
ANY = -1  # a size that the arrays are free to choose
Arrays = Mapping[str, Any]


def refuse(graph: str, kind: str, arrays: Arrays) -> None:
    """Refuse arrays that are no network's; F inputs a node and R relations are those of the graph.

    Of `rgcn`, for k = 0, 1, …: `layer{k}.weight` (R, in, out), `layer{k}.bias` (out,); the first takes F, the last
    gives 3. Of `gatv2`: `encoder{k}.weight` (in, out), `encoder{k}.bias` (out,), from F to D; `conv{k}.source.weight`
    and `conv{k}.target.weight` (D, D), `conv{k}.source.bias`, `conv{k}.target.bias` and `conv{k}.bias` (D,),
    `conv{k}.relation` (R, D), `conv{k}.attention` (H, D / H); `head{k}.weight`, `head{k}.bias`, from 2 D to 3.

    Args:
        graph: `paper` or `modern`.
        kind: `rgcn` or `gatv2`.
        arrays: by name.

    Raises:
        ValueError: there is no such graph or kind; an array is missing, is one too many, has another shape or no
            numbers, or one of them is beyond ±32.
    """
    if graph not in GRAPHS or kind not in KINDS:
        known = f"known are {', '.join(GRAPHS)}, and {', '.join(KINDS)}"
        raise ValueError(f"its graph is {graph!r} and its kind {kind!r}; {known}")
    wanted = (_rgcn if kind == "rgcn" else _gatv2)(arrays, *GRAPHS[graph])
    if too_many := sorted(set(arrays) - wanted):
        raise ValueError(f"a {kind} has no {too_many[0]}")
    for name, array in arrays.items():
        if np.asarray(array).dtype.kind != "f":
            raise ValueError(f"{name} must be of floats, is of {np.asarray(array).dtype}")
        if not np.isfinite(array).all():
            raise ValueError(f"{name} holds nan or infinity")
        if not (np.abs(array) <= LARGEST_WEIGHT).all():
            largest = float(np.abs(array).max())
            raise ValueError(f"{name} holds {largest:g}; weights are within ±{LARGEST_WEIGHT:g}: train with more decay")


def layers(arrays: Arrays, name: str) -> int:
    """How many layers of a name there are."""
    return len({key.partition(".")[0] for key in arrays if key.startswith(name)})


def _rgcn(arrays: Arrays, inputs: int, relations: int) -> set[str]:
    """The names of all its arrays."""
    names, width = set(), inputs
    for k in range(max(layers(arrays, "layer"), 1)):
        width = _sized(arrays, f"layer{k}.weight", relations, width, ANY)[2]
        _sized(arrays, f"layer{k}.bias", width)
        names |= {f"layer{k}.weight", f"layer{k}.bias"}
    _ends("layer", width)
    return names


def _gatv2(arrays: Arrays, inputs: int, relations: int) -> set[str]:
    """The names of all its arrays."""
    names, width = _dense(arrays, "encoder", inputs)
    for k in range(layers(arrays, "conv")):
        heads = _sized(arrays, f"conv{k}.attention", ANY, ANY)[0]
        if width % heads:
            raise ValueError(f"conv{k}.attention has {heads} heads, which do not part a width of {width}")
        sizes = {"attention": (heads, width // heads), "relation": (relations, width), "bias": (width,)}
        for side in ("source", "target"):
            sizes |= {f"{side}.weight": (width, width), f"{side}.bias": (width,)}
        for name, size in sizes.items():
            _sized(arrays, f"conv{k}.{name}", *size)
        names |= {f"conv{k}.{name}" for name in sizes}
    more, last = _dense(arrays, "head", 2 * width)
    _ends("head", last)
    return names | more


def _dense(arrays: Arrays, name: str, width: int) -> tuple[set[str], int]:
    """The names of the arrays of one or more fully connected layers, and how many numbers they give."""
    names = set()
    for k in range(max(layers(arrays, name), 1)):
        width = _sized(arrays, f"{name}{k}.weight", width, ANY)[1]
        _sized(arrays, f"{name}{k}.bias", width)
        names |= {f"{name}{k}.weight", f"{name}{k}.bias"}
    return names, width


def _sized(arrays: Arrays, name: str, *wanted: int) -> tuple[int, ...]:
    """The shape of an array, which must be so; `ANY` is 1 or more."""
    if name not in arrays:
        raise ValueError(f"it has no {name}")
    shape = np.shape(arrays[name])
    fits = len(shape) == len(wanted) and all(
        has == size or (size == ANY and has > 0) for has, size in zip(shape, wanted, strict=True)
    )
    if not fits:
        told = ", ".join("any" if size == ANY else str(size) for size in wanted)
        raise ValueError(f"{name} must have the shape ({told}), has {shape}")
    return shape


def _ends(name: str, width: int) -> None:
    if width != OUT:
        raise ValueError(f"the last {name} must give {OUT} numbers, gives {width}")


SUFFIX = ".npz"
ABOUT = "about"  # the entry that holds the note
STOCK = Path(__file__).parent / "pretrained" / "graph-policy.npz"


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
            f"{path} holds no weights of a graph policy: {told}; sonata2d.learning.write_weights makes such files"
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
