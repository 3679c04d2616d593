"""Files are read up to a limit only, and what is wrong with an archive is told apart from exhausted memory."""

from __future__ import annotations

import io
import os
import zipfile
from pathlib import Path

import numpy as np
import pytest

from sonata2d.core.files.archives import read_npz
from sonata2d.core.files.reading import read_at_most


def test_a_file_is_read_up_to_the_limit(tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(b"12345")
    assert read_at_most(tmp_path / "a", 5) == b"12345"
    with pytest.raises(OSError, match="more than 4 bytes"):
        read_at_most(tmp_path / "a", 4)


@pytest.mark.skipif(not Path("/dev/fd").exists(), reason="needs the pipes of a shell")
def test_the_limit_holds_for_the_pipe_of_a_shell_whose_size_is_unknown() -> None:
    reader, writer = os.pipe()
    os.write(writer, b"12345")
    os.close(writer)
    with pytest.raises(OSError, match="more than 4 bytes"):
        read_at_most(Path(f"/dev/fd/{reader}"), 4)
    os.close(reader)


def test_folders_and_devices_are_refused(tmp_path: Path) -> None:
    for path, message in ((tmp_path, "is a folder"), (Path(os.devnull), "is a device")):
        with pytest.raises(OSError, match=message):
            read_at_most(path, 5)


def archive(header: bytes) -> bytes:
    """An archive with an array of the given header."""
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as written:
        written.writestr("a.npy", b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header)
    return file.getvalue()


def test_only_a_header_is_called_nested_too_deeply(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(ValueError, match="header"):
        read_npz(archive(b"(" * 5000 + b")" * 5000), 1000_000)

    def fail(*_: object) -> bytes:
        raise MemoryError

    file = io.BytesIO()
    np.savez(file, a=np.zeros(3))
    monkeypatch.setattr(zipfile.ZipFile, "read", fail)
    with pytest.raises(MemoryError):
        read_npz(file.getvalue(), 1000_000)
