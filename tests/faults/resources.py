"""Disks that fill up, folders that cannot be written, and too few file handles."""

from __future__ import annotations

import errno
import os
import resource
import shutil
import subprocess
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

from .commands import COMMANDS, Command, contents, is_root, run, unexpected_files
from .table import Row

FULL_AT = (0.0, 0.3, 0.7, 0.97)  # fractions of what a complete run writes
HANDLES = (8, 10, 12, 14, 16, 20, 24, 32)
_BLOCK = 4096  # bytes; a file system of the kernel's memory counts whole pages


def full_disk(material: Path, work: Path) -> Iterator[Row]:
    """Let each command fill the disk: a small file system in memory, or without root a limit on the size of a file."""
    for command in COMMANDS:
        row = Row("disk full", command.name)
        whole, written = _complete_run(command, material, work / "whole")
        for fraction in FULL_AT:
            if is_root():
                size = written.before + int(fraction * written.by_command) // _BLOCK * _BLOCK
                with _small_disk(work / "out", max(size, _BLOCK)):
                    row.add(*_failing(command, material, work / "out", whole, (os.strerror(errno.ENOSPC),)))
            elif fraction < 1:
                limit = partial(resource.setrlimit, resource.RLIMIT_FSIZE, (int(fraction * written.largest),) * 2)
                with _new_folder(work / "out"):
                    row.add(*_failing(command, material, work / "out", whole, (os.strerror(errno.EFBIG),), limit))
        yield row


def read_only(material: Path, work: Path) -> Iterator[Row]:
    """Let each command write into a folder that cannot be written: a read-only mount, or without root a permission."""
    reasons = tuple(os.strerror(number) for number in (errno.EROFS, errno.EACCES, errno.EPERM))
    for command in COMMANDS:
        row = Row("read-only folder", command.name)
        whole, written = _complete_run(command, material, work / "whole")
        del whole
        output = work / "out"
        if is_root():
            with _small_disk(output, 2 * (written.before + written.by_command) + 2**20):
                command.prepare(material, output)
                before = contents(output)
                subprocess.run(["mount", "-o", "remount,ro", str(output)], check=True)
                row.add(*_failing(command, material, output, before, reasons, prepared=True))
        else:
            with _new_folder(output):
                command.prepare(material, output)
                before = contents(output)
                folders = [output, *(path for path in output.rglob("*") if path.is_dir())]
                for folder in folders:
                    folder.chmod(0o555)
                row.add(*_failing(command, material, output, before, reasons, prepared=True))
                for folder in folders:
                    folder.chmod(0o755)
        yield row


def few_handles(material: Path, work: Path) -> Iterator[Row]:
    """Run each command with few file handles: it gives the same files, or one error."""
    for command in COMMANDS:
        row = Row("few file handles", command.name)
        whole, _ = _complete_run(command, material, work / "whole")
        for count in HANDLES:
            limit = partial(resource.setrlimit, resource.RLIMIT_NOFILE, (count, count))
            with _new_folder(work / "out"):
                row.add(*_failing(command, material, work / "out", whole, (os.strerror(errno.EMFILE),), limit))
        yield row


class _Written:
    """What a complete run writes, bytes on disk."""

    def __init__(self, before: int, after: int, largest: int) -> None:
        self.before, self.by_command, self.largest = before, after - before, largest


def _complete_run(command: Command, material: Path, output: Path) -> tuple[dict[str, str], _Written]:
    with _new_folder(output):
        command.prepare(material, output)
        before = _size_of(output)
        result = run(command.line(material, output))
        assert result.code == 0, result
        sizes = [path.stat().st_size for path in output.rglob("*") if path.is_file()]
        return contents(output), _Written(before, _size_of(output), max(sizes))


def _size_of(folder: Path) -> int:
    return sum(-(-path.stat().st_size // _BLOCK) * _BLOCK for path in folder.rglob("*") if path.is_file())


def _failing(
    command: Command,
    material: Path,
    output: Path,
    whole: dict[str, str],
    reasons: tuple[str, ...],
    before_start: Callable[[], None] | None = None,
    prepared: bool = False,
) -> tuple[str, str]:
    """The outcome of a run that may fail, and what is wrong: the error must be one line and tell one of the reasons."""
    if not prepared:
        command.prepare(material, output)
    before = contents(output)
    result = run(command.line(material, output), before_start=before_start)
    if result.code == 0:
        return "complete", "" if contents(output) == whole else "success was told, but files are missing or differ"
    if result.fault or result.code != 1:
        return "", result.fault or f"exit code {result.code}: {result.errors[-300:]!r}"
    if not any(reason in result.errors for reason in reasons):
        return "", f"the error does not tell the reason: {result.errors[-300:]!r}"
    return "error, exit code 1", unexpected_files(output, before, whole)


@contextmanager
def _small_disk(folder: Path, size: int) -> Iterator[None]:
    """An empty file system of a size in bytes, in memory."""
    folder.mkdir(parents=True, exist_ok=True)
    subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", str(folder)], check=True)
    try:
        yield
    finally:
        subprocess.run(["umount", str(folder)], check=True)
        folder.rmdir()


@contextmanager
def _new_folder(folder: Path) -> Iterator[None]:
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    try:
        yield
    finally:
        shutil.rmtree(folder, ignore_errors=True)
