"""Files are whole or not there."""

from __future__ import annotations

import errno
import gzip
import os
import re
import time
from datetime import UTC, datetime, timedelta, timezone
from pathlib import Path
from typing import Any

import pytest
import zstandard
from hypothesis import given
from hypothesis import strategies as st

from sonata2d.errors import RecordError
from sonata2d.record.files import packed, read_bytes, safe_name, stem_of, write_atomically
from sonata2d.record.recorder import JsonRecorder

NOON = datetime(2025, 1, 2, 12, 0, 0, tzinfo=UTC)


def test_a_file_replaces_the_old_one_and_leaves_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "made" / "on the way" / "a.json"
    write_atomically(path, b"old")
    write_atomically(path, b"new")
    assert path.read_bytes() == b"new"
    assert list(path.parent.iterdir()) == [path]


@pytest.mark.parametrize("step", ["replace", "fsync"])
def test_a_full_disk_leaves_the_old_file_and_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, step: str
) -> None:
    def fail(*_: Any) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    path = tmp_path / "a.json"
    write_atomically(path, b"old")
    monkeypatch.setattr(os, step, fail)
    with pytest.raises(RecordError, match=re.escape(f"{path} cannot be written: No space left on device")):
        write_atomically(path, b"new")
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def test_a_folder_that_cannot_be_is_told(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(RecordError, match="cannot be written"):
        write_atomically(tmp_path / "file" / "a.json", b"")


@pytest.mark.parametrize("suffix", [".json", ".json.gz", ".json.zst"])
def test_packing_gives_the_same_bytes_at_any_time(tmp_path: Path, suffix: str, monkeypatch: pytest.MonkeyPatch) -> None:
    path, document = tmp_path / f"a{suffix}", b'{"a":1}\n' * 1000
    first = packed(document, path)
    monkeypatch.setattr(time, "time", lambda: 4e9)
    assert packed(document, path) == first
    write_atomically(path, first)
    assert read_bytes(path) == document


@pytest.mark.parametrize("pack", [gzip.compress, zstandard.ZstdCompressor().compress, bytes])
def test_no_more_than_the_limit_is_unpacked(tmp_path: Path, pack: Any) -> None:
    path = tmp_path / "bomb.json"
    path.write_bytes(pack(b"0" * 100_000))
    assert len(read_bytes(path, largest=100_000)) == 100_000
    with pytest.raises(RecordError, match="more than 99999 bytes"):
        read_bytes(path, largest=99_999)


def test_a_name_without_a_known_suffix_is_refused_at_once() -> None:
    for name in ("polite.txt", "polite", ".json"):
        with pytest.raises(RecordError, match=r"ends in \.json"):
            JsonRecorder(name)
    assert stem_of(Path("a/polite.v2.json.zst")) == "polite.v2"


def test_the_time_in_a_name_is_utc() -> None:
    there = NOON.astimezone(timezone(timedelta(hours=5, minutes=30)))
    assert safe_name("ann", there, "r1") == safe_name("ann", NOON, "r1") == "ann__20250102T120000Z__r1.json"


@pytest.mark.parametrize("name", ["", "..", "../../etc/passwd", "CON", "con.txt", "a b", "ñandú", "x" * 500, "a__b\n"])
def test_names_for_example(name: str) -> None:
    _check_name(safe_name(name, NOON, name))


@given(st.text(), st.text())
def test_every_name_is_safe_on_every_system(contributor: str, id: str) -> None:
    _check_name(safe_name(contributor, NOON, id, ".json.zst"))


def _check_name(name: str) -> None:
    assert not set(name) & set('<>:"/\\|?* \0\n')
    assert name.isprintable()
    assert len(name.encode()) < 255
    assert len(name.split("__")) == 3
    assert all(part and not part.startswith((".", "-")) for part in name.split("__"))
    assert not re.match(r"(?i)(con|prn|aux|nul)(\.|$)", name)
