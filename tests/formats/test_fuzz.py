"""Import of arbitrary bytes: the result is a valid episode, or a refusal of one line."""

from __future__ import annotations

import json
from collections.abc import Iterator
from copy import deepcopy
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings, strategies as st

from sonata2d.datasets.check import check_episode
from sonata2d.formats.api import export_to, format_named, import_from
from sonata2d.formats.base import Options
from sonata2d.record.reader import read_episode

JSON = ("sonata", "socnav3", "trajnet")
NAMES = ("sonata", "socnav3", "foreign", "csv", "trajnet", "npz")
ODD = [None, True, -1, 0, 2**63, -1e300, 1e12, "", "nan", [], {}, [[]], {"a": 1}, "\ud800"]
FUZZ = settings(
    max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow]
)


class Files(dict[str, bytes]):
    """Bytes of files by format, with a short repr for the reports of hypothesis."""

    def __repr__(self) -> str:
        return f"files of {', '.join(self)}"


@pytest.fixture(scope="module")
def valid(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Files:
    """A valid file of each format with one file per episode; `foreign` is a SocNav3 file of another program."""
    from .test_socnav3 import foreign

    out = tmp_path_factory.mktemp("valid")
    files = Files()
    for name in ("sonata", "socnav3", "csv", "npz"):
        files[name] = export_to(folder / "000002.json", name, out / name).files[0].read_bytes()
    scene = {"scene": {"id": 0, "p": 1, "s": 0, "e": 4, "fps": 2.5}}
    tracks = [{"track": {"f": f, "p": p, "x": 0.1 * f, "y": 1.0 * p}} for f in range(5) for p in (1, 2)]
    files["trajnet"] = b"\n".join(json.dumps(line).encode() for line in (scene, *tracks))
    files["foreign"] = json.dumps(foreign()).encode()
    return files


def check_import(name: str, data: bytes, folder: Path) -> None:
    """Import the bytes: the result is an episode that reads back, or one short line that names the file."""
    format = "socnav3" if name == "foreign" else name
    folder = folder / name  # files beside a track file are read too
    folder.mkdir(exist_ok=True)
    path = folder / f"fuzz{format_named(format).suffix}"
    path.write_bytes(data)
    result = import_from(path, format, folder / "made", Options(frame_time=0.1))
    assert len(result.files) + len(result.refused) == 1
    for line in result.refused:
        assert "\n" not in line
        assert len(line) < 600
        assert path.name in line
    for file in result.files:
        assert read_episode(file)
        check_episode(file)
        file.unlink()


@FUZZ
@given(name=st.sampled_from(NAMES), fraction=st.floats(0, 1))
def test_truncated_files(name: str, fraction: float, valid: Files, tmp_path: Path) -> None:
    check_import(name, valid[name][: int(fraction * len(valid[name]))], tmp_path)


@FUZZ
@given(
    name=st.sampled_from(NAMES), places=st.lists(st.tuples(st.floats(0, 1), st.integers(0, 7)), min_size=1, max_size=8)
)
def test_files_with_flipped_bits(name: str, places: list[tuple[float, int]], valid: Files, tmp_path: Path) -> None:
    data = bytearray(valid[name])
    for fraction, bit in places:
        data[min(int(fraction * len(data)), len(data) - 1)] ^= 1 << bit
    check_import(name, bytes(data), tmp_path)


@FUZZ
@given(name=st.sampled_from(NAMES), data=st.binary(max_size=200))
def test_files_of_random_bytes(name: str, data: bytes, tmp_path: Path) -> None:
    check_import(name, data, tmp_path)


def places(tree: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Yield the path of every value in a tree; of lists only the first and the last element."""
    yield path
    if isinstance(tree, dict):
        for key in tree:
            yield from places(tree[key], (*path, key))
    elif isinstance(tree, list):
        for key in sorted({0, len(tree) - 1} if tree else ()):
            yield from places(tree[key], (*path, key))


def changed(tree: Any, path: tuple[Any, ...], value: Any, *, drop: bool) -> Any:
    """Return the tree with another value at a path, or without the value there."""
    value = deepcopy(value)  # a later change may modify it
    if not path:
        return value
    parent = tree
    for key in path[:-1]:
        parent = parent[key]
    if drop:
        del parent[path[-1]]
    else:
        parent[path[-1]] = value
    return tree


@FUZZ
@given(data=st.data(), name=st.sampled_from(["sonata", "socnav3", "foreign"]))
def test_files_with_wrong_types_and_missing_keys(data: st.DataObject, name: str, valid: Files, tmp_path: Path) -> None:
    tree = json.loads(valid[name])
    for _ in range(data.draw(st.integers(1, 3))):
        path = data.draw(st.sampled_from(list(places(tree))))
        tree = changed(tree, path, data.draw(st.sampled_from(ODD)), drop=data.draw(st.booleans()))
    check_import(name, json.dumps(tree).encode(), tmp_path)


@FUZZ
@given(data=st.data())
def test_lines_with_wrong_types_and_missing_keys(data: st.DataObject, valid: Files, tmp_path: Path) -> None:
    lines = [json.loads(line) for line in valid["trajnet"].splitlines()]
    path = data.draw(st.sampled_from(list(places(lines))[1:]))
    lines = changed(lines, path, data.draw(st.sampled_from(ODD)), drop=data.draw(st.booleans()))
    check_import("trajnet", b"\n".join(json.dumps(line).encode() for line in lines), tmp_path)


@pytest.mark.parametrize("name", JSON)
@pytest.mark.parametrize("depth", [500, 2000, 100_000])
def test_deeply_nested_files(name: str, depth: int, tmp_path: Path) -> None:
    check_import(name, b"[" * depth + b"]" * depth, tmp_path)
    check_import(name, b'{"sequence":' * depth + b"1" + b"}" * depth, tmp_path)


def test_tracks_over_a_million_years(tmp_path: Path) -> None:
    check_import("csv", b"0,1,0,0\n1,1,0,0\n99999999999,2,0,0\n", tmp_path)
    lines = [{"track": {"f": f, "p": 2**62, "x": 0, "y": 0}} for f in (0, 1, 10**10)]
    check_import("trajnet", b"\n".join(json.dumps(line).encode() for line in lines), tmp_path)


@settings(FUZZ, max_examples=20)
@given(
    table=st.sampled_from(["episodes", "frames", "agents", "interactions"]),
    places=st.lists(st.tuples(st.floats(0, 1), st.integers(0, 7)), min_size=1, max_size=4),
    fraction=st.floats(0.5, 1),
)
def test_damaged_or_truncated_tables(
    table: str, places: list[tuple[float, int]], fraction: float, folder: Path, tmp_path: Path
) -> None:
    pytest.importorskip("pyarrow", reason="pyarrow comes with the parquet extra")
    out = tmp_path / "tables"
    if not (tmp_path / "whole").exists():
        export_to(folder / "000002.json", "parquet", tmp_path / "whole")
    out.mkdir(exist_ok=True)
    for path in (tmp_path / "whole").iterdir():
        data = bytearray(path.read_bytes())
        if path.stem == table:
            for place, bit in places:
                data[min(int(place * len(data)), len(data) - 1)] ^= 1 << bit
            data = data[: len(data) if fraction > 0.75 else int(fraction * len(data))]
        (out / path.name).write_bytes(data)
    result = import_from(out, "parquet", tmp_path / "made")
    assert len(result.files) + len(result.refused) <= 1 + bool(result.files)
    assert all("\n" not in line for line in result.refused)
    for file in result.files:
        assert read_episode(file)
