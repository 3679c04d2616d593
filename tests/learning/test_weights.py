"""Files of weights: the same bytes each time, nothing that could be executed, and one clear error for each fault."""

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

from .samples import ALL, drawn, weights_file


def packed(path: Path, arrays: dict[str, Any], about: Any) -> Path:
    """A file that `write_weights` would not write."""
    np.savez(path, about=np.array(json.dumps(about)), **arrays)
    return path


def broken(change: Callable[[dict[str, Any]], None], kind: str) -> Weights:
    arrays = dict(drawn("modern", kind).arrays)
    change(arrays)
    return replace(drawn("modern", kind), arrays=arrays)


@pytest.mark.parametrize(("graph", "kind"), ALL)
def test_what_was_written_reads_back(tmp_path: Path, graph: str, kind: str) -> None:
    told = drawn(graph, kind)
    write_weights(tmp_path / "one.npz", told)
    read = read_weights(tmp_path / "one.npz")
    assert (read.graph, read.kind, read.note) == (graph, kind, {"seed": 0})
    assert read.arrays.keys() == told.arrays.keys()
    for name, array in read.arrays.items():
        assert array == pytest.approx(told.arrays[name], abs=1e-6)


def test_the_same_weights_give_the_same_bytes_in_any_order(tmp_path: Path) -> None:
    told = drawn()
    turned = replace(told, arrays=dict(reversed(told.arrays.items())))
    write_weights(tmp_path / "one.npz", told)
    write_weights(tmp_path / "two.npz", turned)
    assert (tmp_path / "one.npz").read_bytes() == (tmp_path / "two.npz").read_bytes()


def test_what_numpy_wrote_is_read_too(tmp_path: Path) -> None:
    told = drawn("modern", "gatv2")
    path = packed(tmp_path / "own.npz", dict(told.arrays), {"graph": "modern", "kind": "gatv2", "note": {}})
    assert read_weights(path).kind == "gatv2"


def test_a_file_that_changed_is_read_anew(tmp_path: Path) -> None:
    before = read_weights(weights_file(tmp_path / "a.npz", seed=1))
    assert read_weights(weights_file(tmp_path / "a.npz", seed=2)).sha256 != before.sha256


def test_the_packages_own_weights_are_a_network_of_looks() -> None:
    own = read_weights(STOCK)
    assert (own.graph, own.kind) == ("modern", "gatv2")
    assert STOCK.stat().st_size < 1_000_000


@pytest.mark.parametrize(
    ("kind", "change", "message"),
    [
        ("rgcn", lambda a: a.pop("layer1.bias"), "it has no layer1.bias"),
        (
            "rgcn",
            lambda a: a.update({"layer0.weight": np.zeros((16, 30, 12))}),
            r"layer0.weight must have .*\(16, 31, ",
        ),
        ("rgcn", lambda a: a.update({"layer0.weight": np.zeros((3, 31, 12))}), r"must have the shape \(16, 31, any\)"),
        ("rgcn", lambda a: a.update({"layer3.weight": np.zeros((16, 3, 2))}), "it has no layer3.bias"),
        ("rgcn", lambda a: a.update({"extra": np.zeros(3)}), "a rgcn has no extra"),
        (
            "rgcn",
            lambda a: a.update({"layer2.weight": np.zeros((16, 7, 2)), "layer2.bias": np.zeros(2)}),
            "must give 3",
        ),
        ("rgcn", lambda a: a["layer0.bias"].__setitem__(2, 32.5), r"layer0.bias holds 32.5; weights are within ±32"),
        ("rgcn", lambda a: a["layer0.bias"].__setitem__(2, np.nan), "layer0.bias holds nan"),
        ("rgcn", lambda a: a.update({"layer2.bias": np.array(["a", "b", "c"])}), "layer2.bias must be of floats"),
        ("rgcn", lambda a: a.clear(), "it has no layer0.weight"),
        (
            "gatv2",
            lambda a: a.update({"conv0.attention": np.zeros((5, 2))}),
            "5 heads, which do not part a width of 12",
        ),
        ("gatv2", lambda a: a.update({"conv1.relation": np.zeros((20, 12))}), r"conv1.relation must .* \(16, 12\)"),
        ("gatv2", lambda a: a.pop("conv0.source.bias"), "it has no conv0.source.bias"),
        ("gatv2", lambda a: a.pop("head1.weight"), "it has no head1.weight"),
    ],
)
def test_arrays_of_no_network_are_neither_written_nor_read(
    tmp_path: Path, kind: str, change: Callable[[dict[str, Any]], None], message: str
) -> None:
    told, path = broken(change, kind), tmp_path / "bad.npz"
    with pytest.raises(ValueError, match=message):
        write_weights(path, told)
    assert not path.exists()
    packed(path, dict(told.arrays), {"graph": "modern", "kind": kind, "note": {}})
    with pytest.raises(ControllerError, match=rf"bad.npz holds no weights of a graph policy: .*{message}"):
        GraphPolicy(path)


@pytest.mark.parametrize("about", [[], {}, {"graph": "paper"}, {"graph": "x", "kind": "rgcn", "note": {}}, "no"])
def test_a_file_that_does_not_say_what_it_is_is_refused(tmp_path: Path, about: Any) -> None:
    with pytest.raises(ControllerError, match=r"bad.npz holds no weights of a graph policy"):
        read_weights(packed(tmp_path / "bad.npz", dict(drawn().arrays), about))


def test_a_pickle_is_refused_and_not_executed(tmp_path: Path) -> None:
    class Evil:
        def __reduce__(self) -> tuple[Any, ...]:
            return Path.touch, (tmp_path / "executed",)

    array = np.array([Evil()], dtype=object)
    np.savez(tmp_path / "evil.npz", about=array, allow_pickle=True)
    (tmp_path / "plain.npz").write_bytes(pickle.dumps(Evil()))
    for name in ("evil", "plain"):
        with pytest.raises(ControllerError, match=f"{name}.npz holds no weights"):
            read_weights(tmp_path / f"{name}.npz")
    assert not (tmp_path / "executed").exists()


def test_a_damaged_file_is_refused_wherever_the_damage_is(tmp_path: Path) -> None:
    whole = weights_file(tmp_path / "whole.npz").read_bytes()
    rng, path, told = np.random.default_rng(3), tmp_path / "hurt.npz", []
    for at in rng.integers(0, len(whole), 40).tolist():
        for hurt in (whole[:at], whole[:at] + bytes([whole[at] ^ 255]) + whole[at + 1 :]):
            path.write_bytes(hurt)
            try:
                read = read_weights(path)
            except ControllerError as error:
                told.append(str(error))
                continue
            meant = read_weights(tmp_path / "whole.npz").arrays  # a date, or the like, was hurt
            assert all(np.array_equal(array, meant[name]) for name, array in read.arrays.items())
    assert len(told) > 40
    assert all("hurt.npz holds no weights" in message for message in told)


def test_what_is_no_archive_is_refused(tmp_path: Path) -> None:
    for name, data in (("empty", b""), ("text", b"weights"), ("array", _array())):
        (tmp_path / f"{name}.npz").write_bytes(data)
        with pytest.raises(ControllerError, match=f"{name}.npz holds no weights"):
            read_weights(tmp_path / f"{name}.npz")
    with zipfile.ZipFile(tmp_path / "other.npz", "w") as archive:
        archive.writestr("readme.txt", "hello")
    with pytest.raises(ControllerError, match=r"other.npz holds no weights"):
        read_weights(tmp_path / "other.npz")
    with pytest.raises(ControllerError, match=r"none.npz cannot be read: No such file"):
        read_weights(tmp_path / "none.npz")


def test_weights_are_written_under_a_name_that_is_known_for_them(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"ends in .npz, got .*policy.bin"):
        write_weights(tmp_path / "policy.bin", drawn())


def _array() -> bytes:
    held = io.BytesIO()
    np.save(held, np.zeros(3))
    return held.getvalue()
