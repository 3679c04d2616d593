"""Files of weights: the same bytes each time, nothing that could be executed, and a clear error for each fault."""

from __future__ import annotations

import io
import json
import pickle
import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sonata2d.errors import ControllerError
from sonata2d.learning.policy import GraphPolicy
from sonata2d.learning.weights import STOCK, Weights, read_weights, write_weights

from .samples import ALL, random_weights, weights_file


def raw_file(path: Path, arrays: dict[str, Any], header: Any) -> Path:
    """Write a file that `write_weights` would refuse."""
    np.savez(path, about=np.array(json.dumps(header)), **arrays)
    return path


def changed_weights(change: Callable[[dict[str, Any]], None], kind: str) -> Weights:
    arrays = dict(random_weights("modern", kind).arrays)
    change(arrays)
    return replace(random_weights("modern", kind), arrays=arrays)


@pytest.mark.parametrize(("graph", "kind"), ALL)
def test_written_weights_read_back(tmp_path: Path, graph: str, kind: str) -> None:
    weights = random_weights(graph, kind)
    write_weights(tmp_path / "one.npz", weights)
    read = read_weights(tmp_path / "one.npz")
    assert (read.graph, read.kind, read.note) == (graph, kind, {"seed": 0})
    assert read.arrays.keys() == weights.arrays.keys()
    for name, array in read.arrays.items():
        assert array == pytest.approx(weights.arrays[name], abs=1e-6)


def test_same_weights_give_same_bytes_in_any_order(tmp_path: Path) -> None:
    weights = random_weights()
    reordered = replace(weights, arrays=dict(reversed(weights.arrays.items())))
    write_weights(tmp_path / "one.npz", weights)
    write_weights(tmp_path / "two.npz", reordered)
    assert (tmp_path / "one.npz").read_bytes() == (tmp_path / "two.npz").read_bytes()


def test_file_written_by_numpy_is_read(tmp_path: Path) -> None:
    weights = random_weights("modern", "gatv2")
    path = raw_file(tmp_path / "own.npz", dict(weights.arrays), {"graph": "modern", "kind": "gatv2", "note": {}})
    assert read_weights(path).kind == "gatv2"


def test_changed_file_is_read_again(tmp_path: Path) -> None:
    before = read_weights(weights_file(tmp_path / "a.npz", seed=1))
    assert read_weights(weights_file(tmp_path / "a.npz", seed=2)).sha256 != before.sha256


def test_stock_weights_are_small_and_documented() -> None:
    weights = read_weights(STOCK)
    assert STOCK.stat().st_size < 500_000
    assert (weights.graph, weights.kind) == ("modern", "gatv2")
    assert weights.note["error"]["test"] < 0.1
    assert weights.note["data"]


@pytest.mark.parametrize(
    ("kind", "change", "message"),
    [
        ("rgcn", lambda a: a.pop("layer1.bias"), "the array layer1.bias is missing"),
        (
            "rgcn",
            lambda a: a.update({"layer0.weight": np.zeros((16, 30, 12))}),
            r"layer0.weight must have .*\(16, 31, ",
        ),
        ("rgcn", lambda a: a.update({"layer0.weight": np.zeros((3, 31, 12))}), r"must have the shape \(16, 31, any\)"),
        ("rgcn", lambda a: a.update({"layer3.weight": np.zeros((16, 3, 2))}), "the array layer3.bias is missing"),
        ("rgcn", lambda a: a.update({"extra": np.zeros(3)}), "a network of kind rgcn has no array extra"),
        (
            "rgcn",
            lambda a: a.update({"layer2.weight": np.zeros((16, 7, 2)), "layer2.bias": np.zeros(2)}),
            "must have 3 outputs",
        ),
        (
            "rgcn",
            lambda a: a["layer0.bias"].__setitem__(2, 32.5),
            r"layer0.bias holds 32.5; weights must be within ±32",
        ),
        ("rgcn", lambda a: a["layer0.bias"].__setitem__(2, np.nan), "layer0.bias holds nan"),
        ("rgcn", lambda a: a.update({"layer2.bias": np.array(["a", "b", "c"])}), "layer2.bias must be of floats"),
        ("rgcn", lambda a: a.clear(), "the array layer0.weight is missing"),
        (
            "gatv2",
            lambda a: a.update({"conv0.attention": np.zeros((5, 2))}),
            "5 heads, which do not divide the width 12",
        ),
        ("gatv2", lambda a: a.update({"conv1.relation": np.zeros((20, 12))}), r"conv1.relation must .* \(16, 12\)"),
        ("gatv2", lambda a: a.pop("conv0.source.bias"), "the array conv0.source.bias is missing"),
        ("gatv2", lambda a: a.pop("head1.weight"), "the array head1.weight is missing"),
    ],
)
def test_invalid_arrays_are_neither_written_nor_read(
    tmp_path: Path, kind: str, change: Callable[[dict[str, Any]], None], message: str
) -> None:
    weights, path = changed_weights(change, kind), tmp_path / "bad.npz"
    with pytest.raises(ValueError, match=message):
        write_weights(path, weights)
    assert not path.exists()
    raw_file(path, dict(weights.arrays), {"graph": "modern", "kind": kind, "note": {}})
    with pytest.raises(ControllerError, match=rf"bad.npz does not hold weights of a graph policy: .*{message}"):
        GraphPolicy(path)


@pytest.mark.parametrize("header", [[], {}, {"graph": "paper"}, {"graph": "x", "kind": "rgcn", "note": {}}, "no"])
def test_file_with_an_invalid_header_is_refused(tmp_path: Path, header: Any) -> None:
    with pytest.raises(ControllerError, match=r"bad.npz does not hold weights of a graph policy"):
        read_weights(raw_file(tmp_path / "bad.npz", dict(random_weights().arrays), header))


def test_pickle_is_refused_and_not_executed(tmp_path: Path) -> None:
    class Evil:
        def __reduce__(self) -> tuple[Any, ...]:
            return Path.touch, (tmp_path / "executed",)

    array = np.array([Evil()], dtype=object)
    np.savez(tmp_path / "evil.npz", about=array, allow_pickle=True)
    (tmp_path / "plain.npz").write_bytes(pickle.dumps(Evil()))
    for name in ("evil", "plain"):
        with pytest.raises(ControllerError, match=f"{name}.npz does not hold weights"):
            read_weights(tmp_path / f"{name}.npz")
    assert not (tmp_path / "executed").exists()


def test_damaged_file_is_refused_or_reads_back_equal(tmp_path: Path) -> None:
    whole = weights_file(tmp_path / "whole.npz").read_bytes()
    rng, path, messages = np.random.default_rng(3), tmp_path / "damaged.npz", []
    for at in rng.integers(0, len(whole), 40).tolist():
        for damaged in (whole[:at], whole[:at] + bytes([whole[at] ^ 255]) + whole[at + 1 :]):
            path.write_bytes(damaged)
            try:
                read = read_weights(path)
            except ControllerError as error:
                messages.append(str(error))
                continue
            # The damage is in a date or the like.
            expected = read_weights(tmp_path / "whole.npz").arrays
            assert all(np.array_equal(array, expected[name]) for name, array in read.arrays.items())
    assert len(messages) > 40
    assert all("damaged.npz does not hold weights" in message for message in messages)


def test_files_that_are_not_archives_of_weights_are_refused(tmp_path: Path) -> None:
    for name, data in (("empty", b""), ("text", b"weights"), ("array", _array())):
        (tmp_path / f"{name}.npz").write_bytes(data)
        with pytest.raises(ControllerError, match=f"{name}.npz does not hold weights"):
            read_weights(tmp_path / f"{name}.npz")
    with zipfile.ZipFile(tmp_path / "other.npz", "w") as archive:
        archive.writestr("readme.txt", "hello")
    with pytest.raises(ControllerError, match=r"other.npz does not hold weights"):
        read_weights(tmp_path / "other.npz")
    with pytest.raises(ControllerError, match=r"none.npz cannot be read: No such file"):
        read_weights(tmp_path / "none.npz")


def test_weights_are_only_written_to_npz_files(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"must end in .npz, got .*policy.bin"):
        write_weights(tmp_path / "policy.bin", random_weights())


def _array() -> bytes:
    data = io.BytesIO()
    np.save(data, np.zeros(3))
    return data.getvalue()
