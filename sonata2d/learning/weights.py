"""Weights of a policy network: one `.npz` file of plain arrays with a JSON header, validated when it is read."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..core.files.archives import read_npz, write_npz
from ..core.files.limits import MAX_WEIGHTS_BYTES
from ..core.portable_math import Array
from ..core.wording import one_line
from ..errors import ControllerError, RecordError
from ..record.files import read_bytes
from .fixed_point import LARGEST_WEIGHT
from .graph.features import FEATURES, INPUTS, INSTANTS
from .graph.graph import RELATIONS

GRAPHS = {  # kinds of graph: number of inputs per node, number of relations
    "paper": (len(FEATURES), len(RELATIONS) + 2 * (INSTANTS - 1)),
    "modern": (len(INPUTS), len(RELATIONS)),
}
_KINDS = ("rgcn", "gatv2")
_OUTPUTS = 3  # ahead, sideways, turn
_ANY = -1  # a size that the file chooses
_SUFFIX = ".npz"
_HEADER = "about"  # name of the archive entry with the JSON header
STOCK = Path(__file__).parent / "pretrained" / "graph-policy.npz"
Arrays = Mapping[str, Array]


@dataclass(frozen=True, eq=False)
class Weights:
    """The arrays of a network by name, and its kind.

    For `rgcn` and k = 0, 1, ...: `layer{k}.weight` (R, in, out) and `layer{k}.bias` (out,); the first layer has F
    inputs, the last one 3 outputs. For `gatv2`: `encoder{k}.weight` (in, out) and `encoder{k}.bias` (out,), from F to
    D; `conv{k}.source.weight` and `conv{k}.target.weight` (D, D), `conv{k}.source.bias`, `conv{k}.target.bias` and
    `conv{k}.bias` (D,), `conv{k}.relation` (R, D), `conv{k}.attention` (H, D / H); `head{k}.weight` and `head{k}.bias`,
    from 2 D to 3. `GRAPHS` has the inputs per node F and the relations R of each kind of graph.

    Attributes:
        graph: input of the network, `paper` or `modern`.
        kind: architecture, `rgcn` or `gatv2`.
        arrays: by name, finite and within ±32.
        note: how the weights were made, for human readers.
        sha256: of the bytes of the file.
    """

    graph: str
    kind: str
    arrays: Arrays
    note: Mapping[str, Any]
    sha256: str = ""


def write_weights(path: str | Path, weights: Weights) -> None:
    """Write weights as float32; the same weights give the same bytes.

    Args:
        path: ends in .npz.
        weights: to write; their `sha256` is ignored.

    Raises:
        ValueError: the path has another suffix, or the arrays do not form a network, see `Weights`.
    """
    path = Path(path)
    if path.suffix != _SUFFIX:
        raise ValueError(f"the name of a file of weights must end in {_SUFFIX}, got {path}")
    _check_arrays(weights.graph, weights.kind, weights.arrays)
    header = json.dumps({"graph": weights.graph, "kind": weights.kind, "note": dict(weights.note)}, sort_keys=True)
    arrays = {name: np.asarray(array, dtype=np.float32) for name, array in sorted(weights.arrays.items())}
    write_npz(path, {_HEADER: np.array(header), **arrays})


def read_weights(path: Path) -> Weights:
    """Read a file of `write_weights`, or any `.npz` with the same content; nothing in it is executed.

    Raises:
        ControllerError: the file cannot be read, or does not hold the weights of a known network.
    """
    try:
        data = read_bytes(path, max_bytes=MAX_WEIGHTS_BYTES)
    except RecordError as error:
        raise ControllerError(f"the weights {error}") from error
    try:
        arrays = read_npz(data, MAX_WEIGHTS_BYTES)
        header = json.loads(str(arrays.pop(_HEADER)))
        graph, kind, note = header["graph"], header["kind"], header["note"]
        _check_arrays(graph, kind, arrays)
    except (ArithmeticError, KeyError, RecursionError, TypeError, ValueError) as error:
        reason = str(error) if isinstance(error, ValueError) else f"{type(error).__name__}: {error}"
        raise ControllerError(
            f"{path} does not hold weights of a graph policy: {one_line(reason, 200)}; write such files with"
            " sonata2d.learning.write_weights, and files of other policies with sonata2d.gym.save_policy"
        ) from error
    exact = {name: array.astype(np.float64) for name, array in arrays.items()}
    return Weights(graph, kind, exact, note, hashlib.sha256(data).hexdigest())


def _check_arrays(graph: str, kind: str, arrays: Arrays) -> None:
    """Check names, shapes and values of the arrays of a network; see `Weights`.

    Args:
        graph: `paper` or `modern`.
        kind: `rgcn` or `gatv2`.
        arrays: by name.

    Raises:
        ValueError: the graph or the kind is unknown; an array is missing, superfluous, of another shape, not of finite
            floats, or beyond ±32.
    """
    if graph not in GRAPHS or kind not in _KINDS:
        known = f"known graphs are {', '.join(GRAPHS)}, known kinds {', '.join(_KINDS)}"
        raise ValueError(f"its graph is {graph!r} and its kind {kind!r}; {known}")
    expected = (_check_rgcn if kind == "rgcn" else _check_gatv2)(arrays, *GRAPHS[graph])
    if superfluous := sorted(set(arrays) - expected):
        raise ValueError(f"a network of kind {kind} has no array {superfluous[0]}; remove it")
    for name, array in arrays.items():
        if np.asarray(array).dtype.kind != "f":
            raise ValueError(f"{name} must be of floats, is of {np.asarray(array).dtype}")
        if not np.isfinite(array).all():
            raise ValueError(f"{name} holds nan or infinity")
        if not (np.abs(array) <= LARGEST_WEIGHT).all():
            largest = float(np.abs(array).max())
            raise ValueError(
                f"{name} holds {largest:g}; weights must be within ±{LARGEST_WEIGHT:g}: train with more weight decay"
            )


def layer_count(arrays: Arrays, name: str) -> int:
    """Return the number of layers whose names begin with `name`, e.g. conv0 and conv1."""
    return len({key.partition(".")[0] for key in arrays if key.startswith(name)})


def _check_rgcn(arrays: Arrays, inputs: int, relations: int) -> set[str]:
    """The names of all arrays, after checking their shapes."""
    names, width = set(), inputs
    for k in range(max(layer_count(arrays, "layer"), 1)):
        width = _checked_shape(arrays, f"layer{k}.weight", relations, width, _ANY)[2]
        _checked_shape(arrays, f"layer{k}.bias", width)
        names |= {f"layer{k}.weight", f"layer{k}.bias"}
    _check_outputs("layer", width)
    return names


def _check_gatv2(arrays: Arrays, inputs: int, relations: int) -> set[str]:
    """The names of all arrays, after checking their shapes."""
    names, width = _check_dense(arrays, "encoder", inputs)
    for k in range(layer_count(arrays, "conv")):
        heads = _checked_shape(arrays, f"conv{k}.attention", _ANY, _ANY)[0]
        if width % heads:
            raise ValueError(f"conv{k}.attention has {heads} heads, which do not divide the width {width}")
        shapes = {"attention": (heads, width // heads), "relation": (relations, width), "bias": (width,)}
        for side in ("source", "target"):
            shapes |= {f"{side}.weight": (width, width), f"{side}.bias": (width,)}
        for name, shape in shapes.items():
            _checked_shape(arrays, f"conv{k}.{name}", *shape)
        names |= {f"conv{k}.{name}" for name in shapes}
    head_names, outputs = _check_dense(arrays, "head", 2 * width)
    _check_outputs("head", outputs)
    return names | head_names


def _check_dense(arrays: Arrays, name: str, width: int) -> tuple[set[str], int]:
    """The names of the arrays of one or more dense layers, and the number of their outputs."""
    names = set()
    for k in range(max(layer_count(arrays, name), 1)):
        width = _checked_shape(arrays, f"{name}{k}.weight", width, _ANY)[1]
        _checked_shape(arrays, f"{name}{k}.bias", width)
        names |= {f"{name}{k}.weight", f"{name}{k}.bias"}
    return names, width


def _checked_shape(arrays: Arrays, name: str, *expected: int) -> tuple[int, ...]:
    """The shape of an array, which must be the expected one; `_ANY` stands for 1 or more."""
    if name not in arrays:
        raise ValueError(f"the array {name} is missing")
    shape = np.shape(arrays[name])
    fits = len(shape) == len(expected) and all(
        actual == size or (size == _ANY and actual > 0) for actual, size in zip(shape, expected, strict=True)
    )
    if not fits:
        sizes = ", ".join("any" if size == _ANY else str(size) for size in expected)
        raise ValueError(f"{name} must have the shape ({sizes}), has {shape}")
    return shape


def _check_outputs(name: str, width: int) -> None:
    if width != _OUTPUTS:
        raise ValueError(f"the last {name} must have {_OUTPUTS} outputs, has {width}")
