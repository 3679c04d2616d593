"""Multilayer perceptrons as files that need no deep-learning library, with the same bits on every processor."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.compiled.kernel import kernel
from ..core.compiled.scalar import exp
from ..core.files.archives import read_npz, write_npz
from ..core.files.limits import MAX_WEIGHTS_BYTES
from ..core.portable_math import Array
from ..core.wording import one_line
from ..errors import ControllerError, RecordError
from ..learning.fixed_point import LARGEST_VALUE, UNIT, product, round_weights
from ..record.files import read_bytes

_ACTIVATIONS, _OUTPUTS = ("tanh", "relu"), ("clip", "tanh", "argmax")
_KIND = "mlp"
_HEADER = "about"


@dataclass(frozen=True, eq=False)
class Mlp:
    """A multilayer perceptron from a flat observation to an action.

    Values are rounded to multiples of 2^-14 within ±64, weights to multiples of 2^-13 within ±32; the actions therefore
    differ a little from the actions of a network without rounding.

    Attributes:
        weights: of each layer, (in, out).
        biases: of each layer, (out,).
        activation: of the hidden layers.
        output: the action from the numbers of the last layer: `clip`: the numbers within [-1, 1]; `tanh`: their
            hyperbolic tangents; `argmax`: the index of the largest.
        environment: see `description.describe`.
        mean, scale: (in,); the input is (observation - mean) * scale, within ±`limit`.
        limit: of the input.
        output_limit: of the numbers of the last layer, before `tanh`.
        note: how it was made, for human readers.
    """

    weights: Sequence[Array]
    biases: Sequence[Array]
    activation: str
    output: str
    environment: Mapping[str, Any]
    mean: Array
    scale: Array
    limit: float = LARGEST_VALUE
    output_limit: float = LARGEST_VALUE
    note: str = ""

    def __post_init__(self) -> None:
        if self.activation not in _ACTIVATIONS or self.output not in _OUTPUTS:
            raise ValueError(
                f"the activation is one of {', '.join(_ACTIVATIONS)} and the output one of {', '.join(_OUTPUTS)}, got "
                f"{self.activation!r} and {self.output!r}"
            )
        if not self.weights or len(self.weights) != len(self.biases):
            raise ValueError(f"there are {len(self.weights)} weights and {len(self.biases)} biases")
        width = len(self.mean)
        if self.scale.shape != (width,):
            raise ValueError(f"mean and scale have the shapes {self.mean.shape} and {self.scale.shape}")
        for k, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            if weight.ndim != 2 or weight.shape[0] != width or bias.shape != weight.shape[1:]:
                raise ValueError(
                    f"layer {k} has {width} inputs; its weight has the shape {weight.shape}, its bias {bias.shape}"
                )
            width = weight.shape[1]
        arrays = (*self.weights, *self.biases, self.mean, self.scale)
        if not all(np.isfinite(array).all() for array in arrays):
            raise ValueError("a number is not finite")
        rounded = [np.ascontiguousarray(round_weights(weight)) for weight in self.weights]
        object.__setattr__(self, "_rounded", rounded)

    def __call__(self, observation: NDArray[Any]) -> Any:
        """The action for an observation of as many numbers as there are inputs, in any shape.

        Raises:
            ControllerError: the observation has more or fewer numbers.
        """
        if np.size(observation) != len(self.mean):
            raise ControllerError(
                f"the policy reads {len(self.mean)} numbers, the observation has the shape {np.shape(observation)}"
            )
        values = (np.ravel(np.asarray(observation, dtype=float)) - self.mean) * self.scale
        h, last = _rounded(np.clip(values, -self.limit, self.limit)), len(self.weights) - 1
        rounded: list[Array] = self._rounded  # type: ignore[attr-defined]
        for k, (weight, bias) in enumerate(zip(rounded, self.biases, strict=True)):
            h = product(h[None], weight)[0] + bias
            if k == last and self.output == "argmax":
                return int(np.argmax(h))  # before clipping, which may make values equal
            if k < last:
                h = _tanh(h) if self.activation == "tanh" else np.maximum(h, 0.0)
            h = _rounded(h)
        h = np.clip(h, -self.output_limit, self.output_limit)
        return (_tanh(h) if self.output == "tanh" else np.clip(h, -1.0, 1.0)).astype(np.float32)


def _rounded(values: Array) -> Array:
    result: Array = np.rint(np.clip(values, -LARGEST_VALUE, LARGEST_VALUE) / UNIT) * UNIT
    return result


@kernel
def _tanh(values: Array) -> Array:
    """Hyperbolic tangents; (n,)."""
    result = np.empty(len(values))
    for k in range(len(values)):
        small = exp(-2.0 * abs(values[k]))
        result[k] = (-1.0 if values[k] < 0.0 else 1.0) * (1.0 - small) / (1.0 + small)
    return result


def write_mlp(path: str | Path, mlp: Mlp) -> None:
    """Write a perceptron; the same one gives the same bytes.

    Raises:
        ValueError: the path does not end in .npz.
    """
    path = Path(path)
    if path.suffix != ".npz":
        raise ValueError(f"the name of the file must end in .npz, got {path}")
    about = {
        "kind": _KIND, "activation": mlp.activation, "output": mlp.output, "environment": dict(mlp.environment),
        "limit": mlp.limit, "output_limit": mlp.output_limit, "layers": len(mlp.weights), "note": mlp.note,
    }  # fmt: skip
    arrays: dict[str, NDArray[Any]] = {"mean": mlp.mean, "scale": mlp.scale}
    for k, (weight, bias) in enumerate(zip(mlp.weights, mlp.biases, strict=True)):
        arrays |= {f"layer{k}.weight": weight.astype(np.float32), f"layer{k}.bias": bias}
    write_npz(path, {_HEADER: np.array(json.dumps(about, sort_keys=True)), **arrays})


def read_mlp(path: Path) -> Mlp:
    """Read a file of `write_mlp`; nothing in it is executed.

    Raises:
        ControllerError: the file cannot be read, or does not hold a perceptron.
    """
    try:
        arrays = read_npz(read_bytes(path, max_bytes=MAX_WEIGHTS_BYTES), MAX_WEIGHTS_BYTES)
        about = json.loads(str(arrays.pop(_HEADER)))
        if about["kind"] != _KIND:
            raise ValueError(f"its kind is {about['kind']!r}")
        layers = range(about["layers"])
        return Mlp(
            weights=[arrays[f"layer{k}.weight"].astype(float) for k in layers],
            biases=[arrays[f"layer{k}.bias"].astype(float) for k in layers],
            activation=about["activation"],
            output=about["output"],
            environment=about["environment"],
            mean=arrays["mean"].astype(float),
            scale=arrays["scale"].astype(float),
            limit=float(about["limit"]),
            output_limit=float(about["output_limit"]),
            note=str(about["note"]),
        )
    except (ArithmeticError, KeyError, RecordError, RecursionError, TypeError, ValueError) as error:
        reason = str(error) if isinstance(error, (ValueError, RecordError)) else f"{type(error).__name__}: {error}"
        raise ControllerError(
            f"{path} does not hold a policy: {one_line(reason, 200)}; write such files with sonata2d.gym.save_policy"
        ) from error
