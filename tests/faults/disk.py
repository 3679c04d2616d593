"""A disk on which one call fails, or the power is cut at one call; in this process, without root rights.

`Disk` replaces the functions of `os` and `io` through which Python reads and changes files. Calls under its folder are
counted; all others pass. After a power cut every further call raises, also in clean-up code, and `lose` leaves in the
folder what was certainly on the disk: contents up to their last `fsync`, and names up to the last `fsync` of their
folder. Folders exist from `mkdir` on, as on file systems that order their journal.
"""

from __future__ import annotations

import builtins
import errno
import io
import os
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Self

_REASONS = {"write": errno.ENOSPC, "create": errno.ENOSPC, "mkdir": errno.ENOSPC, "fsync": errno.EIO, "read": errno.EIO}
_TEXT_OPTIONS = ("encoding", "errors", "newline")


class PowerCut(BaseException):
    """The machine stops: no code of the program has an effect after this."""


class _File:
    """A file, under whatever name: its content at the last `fsync`; None: it never had one."""

    def __init__(self, durable: bytes | None = None) -> None:
        self.durable = durable


@dataclass
class Disk:
    """The files under a folder, as a context.

    Attributes:
        folder: an existing folder.
        fails_at: number of the call that fails, from 1; 0: none.
        is_cut: whether the power is cut at this call, instead of a failure.
        calls: names of the calls so far, such as `write 000000.json`.
    """

    folder: Path
    fails_at: int = 0
    is_cut: bool = False
    calls: list[str] = field(default_factory=list)

    def __enter__(self) -> Self:
        self._root, self.is_off = os.path.realpath(self.folder), False
        paths = [path for path in Path(self._root).rglob("*") if path.is_file()]
        self._files = {str(path): _File(path.read_bytes()) for path in paths}
        self._durable_names = dict(self._files)
        self._handles: dict[int, str] = {}
        self._moved_folders: list[tuple[str, str]] = []  # old and new name, which is not synced yet
        one_path = {"mkdir": "mkdir", "rmdir": "rmdir", "truncate": "write", "ftruncate": "write"}
        new: list[tuple[Any, str, Callable[..., Any]]] = [
            (io, "open", self._open_file),
            (builtins, "open", self._open_file),
            (os, "open", self._open_handle),
            (os, "fsync", self._fsync),
            *((os, name, self._renaming(getattr(os, name))) for name in ("rename", "replace")),
            *((os, name, self._unlinking(getattr(os, name))) for name in ("unlink", "remove")),
            *((os, name, self._counted(getattr(os, name), kind)) for name, kind in one_path.items()),
        ]
        self._real_open, self._real_os_open, self._real_fsync = io.open, os.open, os.fsync
        self._restored = [(module, name, getattr(module, name)) for module, name, _ in new]
        for module, name, function in new:
            setattr(module, name, function)
        return self

    def __exit__(self, *_: object) -> None:
        for module, name, function in self._restored:
            setattr(module, name, function)

    def lose(self, *, keeps_names: bool = False) -> None:
        """Leave what survives the power cut.

        Args:
            keeps_names: whether changes of names that were not synced survive; contents that were not synced do not.
        """
        for path in [path for path in Path(self._root).rglob("*") if path.is_file()]:
            path.unlink()
        for name, file in (self._files if keeps_names else self._durable_names).items():
            if os.path.isdir(os.path.dirname(name)):
                Path(name).write_bytes(file.durable or b"")

    def count(self, kind: str, path: str) -> None:
        """Count a call, which fails if it is the chosen one.

        Raises:
            OSError: it fails.
            PowerCut: the power is cut now, or was before.
        """
        if self.is_off:
            raise PowerCut
        self.calls.append(f"{kind} {os.path.relpath(path, self._root)}")
        if len(self.calls) == self.fails_at:
            if self.is_cut:
                self.is_off = True
                raise PowerCut
            reason = _REASONS.get(kind, errno.EACCES)
            raise OSError(reason, os.strerror(reason), path)

    def _path(self, path: Any, dir_fd: int | None = None) -> str | None:
        """The absolute path of an argument, if it is in the folder."""
        if isinstance(path, int):
            return self._handles.get(path)
        if dir_fd is not None and not os.path.isabs(path):
            path = os.path.join(self._handles.get(dir_fd, os.sep), os.fsdecode(path))
        folder, name = os.path.split(os.path.abspath(os.fsdecode(path)))
        full = os.path.join(os.path.realpath(folder), name) if name else folder
        return full if full == self._root or full.startswith(self._root + os.sep) else None

    def _counted(self, function: Callable[..., Any], kind: str) -> Callable[..., Any]:
        def call(path: Any, *arguments: Any, **options: Any) -> Any:
            inside = self._path(path, options.get("dir_fd"))
            if inside is not None:
                self.count(kind, inside)
            return function(path, *arguments, **options)

        return call

    def _renaming(self, function: Callable[..., Any]) -> Callable[..., Any]:
        def call(source: Any, target: Any, **options: Any) -> None:
            old, new = self._path(source), self._path(target)
            if new is not None:
                self.count("rename", new)
            function(source, target, **options)
            if old is None or new is None:
                return
            if os.path.isdir(new):
                self._moved_folders.append((old, new))
            # of a file, or of a folder with all files in it
            moved = [name for name in self._files if name == old or name.startswith(old + os.sep)]
            for name in moved:
                self._files[new + name[len(old) :]] = self._files.pop(name)

        return call

    def _unlinking(self, function: Callable[..., Any]) -> Callable[..., Any]:
        def call(path: Any, **options: Any) -> None:
            inside = self._path(path, options.get("dir_fd"))
            if inside is not None:
                self.count("unlink", inside)
            function(path, **options)
            if inside is not None:
                self._files.pop(inside, None)

        return call

    def _open_handle(self, path: Any, flags: int, *arguments: Any, **options: Any) -> int:
        inside = self._path(path, options.get("dir_fd"))
        if inside is not None and not os.path.isdir(inside):
            self.count("read" if os.path.exists(inside) else "create", inside)
        handle: int = self._real_os_open(path, flags, *arguments, **options)
        if inside is not None:
            self._handles[handle] = inside
            if not os.path.isdir(inside):
                self._files.setdefault(inside, _File())
        return handle

    def _open_file(self, file: Any, mode: str = "r", buffering: int = -1, *arguments: Any, **options: Any) -> Any:
        path = None if isinstance(file, int) else self._path(file)
        if path is None:
            return self._real_open(file, mode, buffering, *arguments, **options)
        reads_only = not set(mode) & set("wax+")
        self.count("read" if reads_only else "open" if os.path.exists(path) else "create", path)
        raw = _Raw(path, mode.replace("b", "").replace("t", ""), opener=options.get("opener"))
        raw.disk, raw.path = self, path
        self._handles[raw.fileno()] = path
        if not reads_only:
            self._files.setdefault(path, _File())
        if buffering == 0:
            return raw
        kind: Any = io.BufferedReader if reads_only else io.BufferedRandom if "+" in mode else io.BufferedWriter
        if "b" in mode:
            return kind(raw)
        given = dict(zip(_TEXT_OPTIONS, arguments, strict=False)) | options
        return io.TextIOWrapper(kind(raw), **{name: given[name] for name in _TEXT_OPTIONS if name in given})

    def _fsync(self, handle: int) -> None:
        path = self._handles.get(handle)
        if path is None:
            return self._real_fsync(handle)
        self.count("fsync", path)
        if os.path.isdir(path):
            for old, new in [names for names in self._moved_folders if os.path.dirname(names[1]) == path]:
                self._moved_folders.remove((old, new))
                for name in [name for name in self._durable_names if name.startswith(old + os.sep)]:
                    self._durable_names[new + name[len(old) :]] = self._durable_names.pop(name)
            elsewhere = {name: file for name, file in self._durable_names.items() if os.path.dirname(name) != path}
            here = {name: file for name, file in self._files.items() if os.path.dirname(name) == path}
            self._durable_names = elsewhere | here
        elif path in self._files:
            with self._real_open(path, "rb") as file:
                self._files[path].durable = file.read()
        return None


class _Raw(io.FileIO):
    """An open file that counts its writes."""

    disk: Disk
    path: str

    def write(self, data: Any) -> int:
        self.disk.count("write", self.path)
        return super().write(data)

    def truncate(self, size: int | None = None) -> int:
        self.disk.count("write", self.path)
        return super().truncate(size)
