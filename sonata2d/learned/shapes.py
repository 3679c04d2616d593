"""What arrays a network has, and how large: so that a file is refused when it is read, not when it drives."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..graph import FEATURES, RELATIONS
from ..graph.paper import INSTANTS
from .fixed import LARGEST_WEIGHT
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
