# ruff: noqa: E501 (lists of odd values)
"""Random damage of files: of their bytes, of their text, and of the values in JSON, npz and parquet files."""

from __future__ import annotations

import gzip
import io
import json
import os
import re
from collections.abc import Callable, Iterator
from copy import deepcopy
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import zstandard

Mutation = Callable[[Random, bytes], bytes]

NESTED = "NESTED"  # replaced by deeply nested lists when the values are serialised: json.dumps has a limit of its own
ODD: list[Any] = [
    None, True, False, 0, 1, -1, 2, 7, 2**31, 2**53 + 1, 2**63, 2**64, -(2**63) - 1, 10**30, 0.5, -0.0, 1e-300, -1e12, 1e12,
    1e300, -1e308, float("nan"), float("inf"), "", "x", "nan", "1", "a\nb", "a\0b", "../x", "/dev/zero", "\ud800", "😀",
    "x" * 5000, [], {}, [[]], [None], {"a": 1}, [1, 2, 3], [[1, 2]] * 50, NESTED,
]  # fmt: skip
ODD_TOKENS = [
    "", "-1", "0", "1e9", "1e400", "99999999999999999999", "nan", "-inf", "null", "true", "~", "[]", "{}", "[[", "'", '"',
    "&a [*a]", "*a", "!!python/object:os.system x", "<<: *a", "\0", "\x07", "\ufeff", "\u2028", "😀", "x" * 5000, "[" * 400,
    "{a: " * 400, "../../x", "/dev/zero", "1_000", "0x10", ";", ",", "\t", "#", "---", "...",
]  # fmt: skip
MAX_REPEATED = 2_000_000  # characters: a small file whose content is checked for each element
TOKEN = re.compile(r"[\w.+-]+")


def mutated(rng: Random, name: str, data: bytes, others: list[bytes]) -> bytes:
    """The content of a file after one random mutation, or two.

    Args:
        rng: decides everything.
        name: of the file; its suffix says which mutations are possible.
        data: its content.
        others: contents of other files, which may replace it or be spliced into it.
    """
    for _ in range(rng.choice((1, 1, 2))):
        kind = rng.random()
        if kind < 0.04:
            data = rng.choice(others)
        elif kind < 0.55 and (structured := _structured(rng, name, data)) is not None:
            data = structured
        elif kind < 0.7 and not name.endswith((".npz", ".parquet", ".tar", ".gz", ".zst")):
            data = _text(rng, data)
        else:
            data = rng.choice(BYTES)(rng, data)
    return data


def _structured(rng: Random, name: str, data: bytes) -> bytes | None:
    """The content with other values; None if it has no values that can be changed one by one."""
    try:
        if name.endswith(".npz"):
            return _npz(rng, data)
        if name.endswith(".parquet"):
            return _parquet(rng, data)
        if name.endswith(".tar"):
            return _tar(rng, data)
        if name.endswith((".jsonl", ".ndjson")):
            return b"\n".join(dumped(line) for line in _values(rng, [json.loads(line) for line in data.splitlines()]))
        if name.endswith(".gz"):
            return gzip.compress(dumped(_values(rng, json.loads(gzip.decompress(data)))))
        if name.endswith(".zst"):
            return zstandard.compress(dumped(_values(rng, json.loads(zstandard.decompress(data)))))
        return dumped(_values(rng, json.loads(data)))
    except Exception:  # an earlier mutation left something that cannot be parsed
        return None


def dumped(tree: Any) -> bytes:
    """The values as JSON, with the constants NaN and Infinity; lone surrogates are escaped."""
    text = json.dumps(tree)
    return text.replace(f'"{NESTED}"', "[" * 600 + "]" * 600).encode()


# Values


def _places(tree: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """The path of every value in a tree; of long lists only some elements."""
    if path:
        yield path
    if isinstance(tree, dict):
        for key in tree:
            yield from _places(tree[key], (*path, key))
    elif isinstance(tree, list):
        for key in sorted({0, 1, len(tree) // 2, len(tree) - 1} & set(range(len(tree)))):
            yield from _places(tree[key], (*path, key))


def _at(tree: Any, path: tuple[Any, ...]) -> Any:
    for key in path:
        tree = tree[key]
    return tree


def _values(rng: Random, tree: Any) -> Any:
    """Change one value, or up to three."""
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        depth = rng.randint(1, 5)  # most values lie deep, in frames; choose shallow ones as often
        places = [path for path in _places(tree) if len(path) <= depth]
        if places:
            _change(rng, tree, rng.choice(places), places)
    return tree


def _change(rng: Random, tree: Any, path: tuple[Any, ...], places: list[tuple[Any, ...]]) -> None:
    parent, key = _at(tree, path[:-1]), path[-1]
    value = parent[key]
    match rng.randrange(10):
        case 0:
            del parent[key]
        case 1 | 2 | 3:
            parent[key] = deepcopy(rng.choice(ODD))
        case 4 if isinstance(parent, list):
            count = min(rng.choice((1, 1, 100, 100_000)), MAX_REPEATED // len(json.dumps(value)))
            parent[key:key] = [deepcopy(value)] * count
        case 5 if isinstance(value, int | float):
            parent[key] = rng.choice((-value, value * 1e6, value + 1, str(value), [value], float(value)))
        case 5 if isinstance(value, list):
            rng.shuffle(value)
        case 7 | 8 if isinstance(value, float):  # a number that may be accepted
            parent[key] = round(value * rng.uniform(-2, 2) + rng.choice((0, 0.1, -3)), 4)
        case 7 | 8 if type(value) is int:
            parent[key] = rng.randint(-2, 12)
        case 6 if isinstance(parent, dict):
            parent[rng.choice((*parent, f"{key}_", ""))] = parent.pop(key)
        case _:
            parent[key] = deepcopy(_at(tree, rng.choice(places)))


def _npz(rng: Random, data: bytes) -> bytes:
    """Change an array, or the texts in JSON of an archive; sometimes the header of an array."""
    arrays = dict(np.load(io.BytesIO(data)))
    name = rng.choice(sorted(arrays))
    array = arrays[name]
    match rng.randrange(7):
        case 0:
            del arrays[name]
        case 1:
            arrays[name] = np.broadcast_to(np.float32(0), (rng.choice((1, 1, 1, 20)) * 1_000_000,)).copy()
        case 2 if array.ndim:
            arrays[name] = array[: rng.randint(0, len(array))]
        case 3:
            arrays[name] = array.astype(rng.choice(("U9", "f4", "i8", "?", "c16")))
        case 4 if array.dtype.kind == "U":
            arrays[name] = np.array(dumped(_values(rng, json.loads(str(array)))).decode())
        case 5 if array.size and array.dtype.kind in "fi":
            arrays[name] = array.copy()
            arrays[name].flat[rng.randrange(array.size)] = rng.choice(
                (-1, 99, 2**31) if array.dtype.kind == "i" else ODD[13:23]
            )
        case _:
            arrays[name] = array.T if rng.random() < 0.5 else array[None]
    out = io.BytesIO()
    np.savez_compressed(out, allow_pickle=True, **arrays)
    return out.getvalue()


def _tar(rng: Random, data: bytes) -> bytes:
    """Change a field of a header, with the right checksum; or cut, drop or repeat blocks."""
    blocks = [data[k : k + 512] for k in range(0, len(data), 512)]
    headers = [k for k, block in enumerate(blocks) if block[257:262] == b"ustar"]
    k = rng.choice(headers)
    header = bytearray(blocks[k])
    match rng.randrange(6):
        case 0 | 1 | 2:  # a size: octal digits, or a signed number of 11 bytes after 0xff or 0x80
            size = rng.choice((0, 1, 511, 512, -1, -512, -1024, -(2**40), 2**40, 2**63, 2**80))
            signed = bytes([0xFF if size < 0 else 0x80]) + size.to_bytes(11, signed=True)
            header[124:136] = b"%011o\0" % size if 0 <= size < 2**33 and rng.random() < 0.5 else signed
        case 3:
            header[156] = rng.choice(b"\001234567gxLKSX?")
        case 4:
            header[:100] = rng.choice((b"../x.json", b"/x.json", b"a/b.json", b"\xff.json", b"", b"a\nb.json")).ljust(
                100, b"\0"
            )
        case _:
            at, count = rng.randrange(len(blocks)), rng.choice((0, 1, 2, 100))
            blocks[at : at + 1] = [blocks[at]] * count
            return b"".join(blocks)
    header[148:156] = b" " * 8
    header[148:156] = b"%06o\0 " % sum(header)
    blocks[k] = bytes(header)
    return b"".join(blocks)


def _parquet(rng: Random, data: bytes) -> bytes:
    """Drop, repeat, retype or clear a column of a table; or repeat or drop rows."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    table = pq.read_table(io.BytesIO(data))
    k = rng.randrange(table.num_columns)
    name, column = table.schema.names[k], table.column(k)
    match rng.randrange(6):
        case 0:
            table = table.drop_columns([name])
        case 1:
            table = table.set_column(k, name, pa.array([rng.choice((None, "x", "[]"))] * table.num_rows, pa.string()))
        case 2:
            table = table.set_column(k, name, pa.array([rng.choice((0.0, 1e300, float("nan"), None))] * table.num_rows))
        case 3:
            table = pa.concat_tables([table, table.slice(0, rng.randint(0, 3))])
        case 4:
            table = table.slice(rng.randint(0, 2), rng.randint(0, max(table.num_rows, 1)))
        case _ if column.type == pa.string():
            texts = [text and dumped(_values(rng, json.loads(text))).decode() for text in column.to_pylist()]
            table = table.set_column(k, name, pa.array(texts))
    out = io.BytesIO()
    pq.write_table(table, out)
    return out.getvalue()


# Text


def _text(rng: Random, data: bytes) -> bytes:
    """Replace, drop or repeat words and lines."""
    text = data.decode("utf-8", "replace")
    match rng.randrange(4):
        case 0:
            lines = text.split("\n")
            k = rng.randrange(len(lines))
            lines[k : k + 1] = rng.choice(([], [lines[k]] * 2, [rng.choice(ODD_TOKENS)], [" " * 9 + lines[k]]))
            return "\n".join(lines).encode("utf-8", "replace")
        case 1:
            k = rng.randint(0, len(text))
            return (text[:k] + rng.choice(ODD_TOKENS) + text[k:]).encode("utf-8", "replace")
        case _:
            tokens = list(TOKEN.finditer(text))
            if not tokens:
                return data
            token = rng.choice(tokens)
            return (text[: token.start()] + rng.choice(ODD_TOKENS) + text[token.end() :]).encode("utf-8", "replace")


# Bytes


def _truncated(rng: Random, data: bytes) -> bytes:
    return data[: rng.randint(0, len(data))]


def _flipped(rng: Random, data: bytes) -> bytes:
    flipped = bytearray(data)
    for _ in range(rng.randint(1, 8) if data else 0):
        flipped[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
    return bytes(flipped)


def _spliced(rng: Random, data: bytes) -> bytes:
    start, end, at = (rng.randint(0, len(data)) for _ in range(3))
    return data[:at] + data[min(start, end) : max(start, end)] + data[rng.choice((at, 0)) :]


def _inserted(rng: Random, data: bytes) -> bytes:
    at = rng.randint(0, len(data))
    return data[:at] + rng.choice((b"\0", b"\xff\xfe", b"\n" * 9, rng.randbytes(20), b"\xed\xa0\x80")) + data[at:]


def _recoded(rng: Random, data: bytes) -> bytes:
    text = data.decode("utf-8", "replace")
    encoding = rng.choice(("utf-16", "utf-32", "utf-8-sig", "latin-1", "cp500"))
    return rng.choice((text, text + "é")).encode(encoding, "replace")


def _bomb(rng: Random, data: bytes) -> bytes:
    """A few kilobytes that unpack to 40 megabytes."""
    unit = rng.choice((b"[", b"0", b"[],", b"\0", b'{"a":1},', data[:2000] or b" "))
    content = unit * (40_000_000 // len(unit))
    level = zstandard.ZstdCompressor(level=1, write_content_size=rng.random() < 0.5)
    return level.compress(content) if rng.random() < 0.8 else gzip.compress(content, 1)


def _nested(rng: Random, data: bytes) -> bytes:
    opening, closing = rng.choice(((b"[", b"]"), (b'{"a":', b"}"), (b"- ", b""), (b"a = [", b"]"), (b"(", b")")))
    depth = rng.choice((40, 300, 1100, 20_000))
    return opening * depth + b"1" + closing * depth


BYTES: list[Mutation] = [
    _truncated, _truncated, _flipped, _flipped, _flipped, _spliced, _spliced, _inserted, _recoded, _nested,
    lambda rng, data: b"", lambda rng, data: rng.randbytes(rng.randint(1, 300)),
    lambda rng, data: data * 2, lambda rng, data: gzip.compress(data), lambda rng, data: zstandard.compress(data),
    lambda rng, data: data.replace(b"\n", b"\r\n"), lambda rng, data: data.lower(),
    lambda rng, data: _bomb(rng, data) if rng.random() < 0.15 else _flipped(rng, data),
]  # fmt: skip


def damage_path(rng: Random, path: Path) -> None:
    """Replace a file by a folder, a link to itself or to a device, a pipe or nothing, or make it unreadable."""
    match rng.randrange(6):
        case 0:
            path.unlink()
        case 1:
            path.unlink()
            path.mkdir()
        case 2:
            path.unlink()
            path.symlink_to(path.name)
        case 3:
            path.unlink()
            path.symlink_to("/dev/zero")
        case 4:
            path.unlink()
            os.mkfifo(path)
        case _:
            path.chmod(0)
