"""Files are written completely or not at all, and have safe names."""

from __future__ import annotations

import errno
import gzip
import os
import re
import tempfile
import time
from datetime import UTC, datetime, timedelta, timezone
from pathlib import Path
from typing import Any

import pytest
import zstandard
from hypothesis import given, strategies as st

from sonata2d.core.files.limits import MAX_UNPACKED_WITHOUT_RATIO
from sonata2d.core.files.reading import is_shell_pipe
from sonata2d.errors import RecordError
from sonata2d.record.files import compress, file_stem, read_bytes, read_stored, safe_name, write_atomically
from sonata2d.record.recorder import JsonRecorder

NOON = datetime(2025, 1, 2, 12, 0, 0, tzinfo=UTC)


def test_writing_replaces_the_file_and_leaves_no_other(tmp_path: Path) -> None:
    path = tmp_path / "new" / "nested folder" / "a.json"
    write_atomically(path, b"old")
    write_atomically(path, b"new")
    assert path.read_bytes() == b"new"
    assert list(path.parent.iterdir()) == [path]


@pytest.mark.parametrize("step", ["replace", "fsync"])
def test_a_full_disk_leaves_the_old_file_and_no_other(
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


def test_a_folder_that_cannot_be_created_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(RecordError, match="cannot be written"):
        write_atomically(tmp_path / "file" / "a.json", b"")


@pytest.mark.parametrize("suffix", [".json", ".json.gz", ".json.zst"])
def test_compression_does_not_depend_on_the_time(tmp_path: Path, suffix: str, monkeypatch: pytest.MonkeyPatch) -> None:
    path, document = tmp_path / f"a{suffix}", b'{"a":1}\n' * 1000
    first = compress(document, path)
    monkeypatch.setattr(time, "time", lambda: 4e9)
    assert compress(document, path) == first
    write_atomically(path, first)
    assert read_bytes(path) == document


@pytest.mark.parametrize("compressor", [gzip.compress, zstandard.ZstdCompressor().compress, bytes])
def test_a_file_above_the_size_limit_is_refused(tmp_path: Path, compressor: Any) -> None:
    path = tmp_path / "big.json"
    path.write_bytes(compressor(b"0" * 100_000))
    assert len(read_bytes(path, max_bytes=100_000)) == 100_000
    with pytest.raises(RecordError, match="more than 99999"):
        read_bytes(path, max_bytes=99_999)


@pytest.mark.parametrize("compressor", [gzip.compress, zstandard.ZstdCompressor().compress])
def test_a_small_file_that_unpacks_to_a_large_one_is_refused(tmp_path: Path, compressor: Any) -> None:
    path, content = tmp_path / "bomb.json", b"[" * (MAX_UNPACKED_WITHOUT_RATIO + 1)
    path.write_bytes(compressor(content[1:]))
    assert len(read_bytes(path)) == MAX_UNPACKED_WITHOUT_RATIO
    path.write_bytes(compressor(content))
    with pytest.raises(RecordError, match="if you trust it, unpack it with gzip or zstd"):
        read_bytes(path)


def test_folders_devices_and_impossible_names_are_refused(tmp_path: Path) -> None:
    for path, message in ((tmp_path, "is a folder"), (Path("a\0b"), "null"), (Path(os.devnull), "is a device")):
        with pytest.raises(RecordError, match=message):
            read_bytes(path)


def test_a_recorder_refuses_a_path_without_a_known_suffix() -> None:
    for name in ("polite.txt", "polite", ".json"):
        with pytest.raises(RecordError, match=r"ends in \.json"):
            JsonRecorder(name)
    assert file_stem(Path("a/polite.v2.json.zst")) == "polite.v2"


def test_the_time_in_a_file_name_is_utc() -> None:
    local = NOON.astimezone(timezone(timedelta(hours=5, minutes=30)))
    assert safe_name("ann", local, "r1") == safe_name("ann", NOON, "r1") == "ann__20250102T120000Z__r1.json"


@pytest.mark.parametrize("name", ["", "..", "../../etc/passwd", "CON", "con.txt", "a b", "ñandú", "x" * 500, "a__b\n"])
def test_unusual_names_are_made_safe(name: str) -> None:
    _assert_safe(safe_name(name, NOON, name))


@given(st.text(), st.text())
def test_any_name_is_made_safe(contributor: str, id: str) -> None:
    _assert_safe(safe_name(contributor, NOON, id, ".json.zst"))


def _assert_safe(name: str) -> None:
    assert not set(name) & set('<>:"/\\|?* \0\n')
    assert name.isprintable()
    assert len(name.encode()) < 255
    assert len(name.split("__")) == 3
    assert all(part and not part.startswith((".", "-")) for part in name.split("__"))
    assert not re.match(r"(?i)(con|prn|aux|nul)(\.|$)", name)


@pytest.mark.skipif(os.name != "posix", reason="needs device files and named pipes")
def test_what_may_have_no_end_is_not_read(tmp_path: Path) -> None:
    (tmp_path / "zero.json").symlink_to("/dev/zero")
    os.mkfifo(tmp_path / "pipe.json")
    with pytest.raises(RecordError, match=r"zero\.json cannot be read: it is a device, not a file"):
        read_stored(tmp_path / "zero.json")
    with pytest.raises(RecordError, match=r"pipe\.json cannot be read: it is a named pipe, not a file"):
        read_bytes(tmp_path / "pipe.json")
    assert not is_shell_pipe(tmp_path / "pipe.json")
    reading, writing = os.pipe()
    try:
        assert is_shell_pipe(Path(f"/dev/fd/{reading}"))
    finally:
        os.close(reading)
        os.close(writing)


@pytest.mark.skipif(not os.access("/dev/shm", os.W_OK), reason="needs the folder /dev/shm of Linux")
def test_a_pipe_in_shared_memory_is_no_pipe_of_a_shell() -> None:
    with tempfile.TemporaryDirectory(dir="/dev/shm") as folder:
        os.mkfifo(Path(folder, "pipe"))
        assert not is_shell_pipe(Path(folder, "pipe"))


def test_all_frames_of_a_zstd_file_are_read_and_nothing_may_follow_them(tmp_path: Path) -> None:
    path, frame = tmp_path / "a.json.zst", compress(b"12", tmp_path / "a.json.zst")
    skippable = b"\x50\x2a\x4d\x18" + (4).to_bytes(4, "little") + b"abcd"
    path.write_bytes(skippable + frame + skippable + frame)
    assert read_bytes(path) == b"1212"
    for damaged in (frame + b"garbage", frame + b"\n", frame + frame[:-1], skippable + frame[:5]):
        path.write_bytes(damaged)
        with pytest.raises(RecordError, match=re.escape(f"{path} cannot be read: ")):
            read_bytes(path)
