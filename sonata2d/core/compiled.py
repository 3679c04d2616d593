"""Functions that numba compiles and the interpreter can run: one text, the same bits.

A kernel is written in the subset of Python that numba compiles: numbers, NumPy arrays, named tuples of them, loops and
branches. Where numba is missing, or `NUMBA_DISABLE_JIT=1` is set, the interpreter runs the same text, more slowly.

- `kernel` marks a function that ordinary Python calls. Numba compiles it at its first call and keeps the machine code
  in a folder, from which later processes load it.
- `subroutine` marks a function that only kernels call; it becomes a part of them.

Kernels use ``+ - * /``, `sqrt` and comparisons only, and add in a fixed order, so that every processor gives the same
bits: fast-math stays off, and `core.scalar` has the elementary functions. Numba does not check indices; tests run with
`NUMBA_BOUNDSCHECK=1`.

The machine code is kept in a folder whose name is a hash of all sources of sonata2d, of the plug-in that a kernel
belongs to, and of the versions of Python, NumPy and numba: numba itself would not notice a change in another file.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any, TypeVar

import filelock
import platformdirs

F = TypeVar("F", bound=Callable[..., Any])

_PACKAGE = Path(__file__).resolve().parents[1]
_PREFIX = "kernels-"
_KEPT = 5  # folders of other versions that are not deleted
_NO_EFFECT = ("NUMBA_CACHE_DIR", "NUMBA_NUM_THREADS")  # settings of numba that do not change machine code


def _load_numba() -> tuple[Any, str]:
    """Numba, or None, and which of the two it is in words."""
    if os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0"):
        return None, "interpreted, because NUMBA_DISABLE_JIT is set"
    try:
        numba = import_module("numba")
    except ImportError as error:  # not installed, or not for this version of NumPy
        return None, f"interpreted, because numba cannot be imported ({error}); pip install numba"
    if numba.config.DISABLE_JIT:  # by a configuration file
        return None, "interpreted, because numba's configuration disables it"
    return numba, f"compiled by numba {numba.__version__}"


_numba, BACKEND = _load_numba()
IS_COMPILED: bool = _numba is not None


def subroutine(function: F) -> F:
    """Mark a function that kernels call; see the module."""
    if _numba is None:
        return function
    compiled: F = _numba.njit(error_model="numpy", nogil=True)(function)
    return compiled


def kernel(function: F) -> F:
    """Mark a function that ordinary Python calls; see the module.

    A kernel releases the interpreter's lock, so that threads can run several worlds at a time. Give its arguments the
    same types in every call: numba compiles it anew for an int in the place of a float, or for an array that is not
    contiguous.

    >>> import numpy as np
    >>> @kernel
    ... def total(values):
    ...     result = 0.0
    ...     for value in values:
    ...         result += value
    ...     return result
    >>> float(total(np.array([1.0, 2.0])))
    3.0
    """
    if _numba is None:
        return function
    folder = _cache_folder(_plugin_of(function))
    # Numba reads the setting when it decorates; other users of numba in this process keep their own.
    previous, _numba.config.CACHE_DIR = _numba.config.CACHE_DIR, str(folder or "")
    try:
        compiled: Any = _numba.njit(error_model="numpy", nogil=True, cache=folder is not None)(function)
    finally:
        _numba.config.CACHE_DIR = previous
    compiled.compile = _compile_once(compiled.compile, f"{function.__module__}.{function.__qualname__}", folder)
    result: F = compiled
    return result


def _compile_once(compile_kernel: Callable[..., Any], name: str, folder: Path | None) -> Callable[..., Any]:
    """Wrap a kernel's method `compile`: a first compilation is announced, and done by one process at a time."""

    def compile_or_load(signature: Any) -> Any:
        mark = folder and folder / f"{_hash([f'{name}{signature}'.encode()])}.done"
        if mark is None:
            _announce()
            return compile_kernel(signature)
        if mark.exists():
            return compile_kernel(signature)  # numba loads it
        with _locked(mark.parent):
            if not mark.exists():  # no other process has compiled it in the meantime
                _announce()
            result = compile_kernel(signature)
            with suppress(OSError):  # a full disk: the next process compiles again
                mark.touch()
            return result

    return compile_or_load


_in_process = threading.RLock()


@contextmanager
def _locked(folder: Path) -> Iterator[None]:
    """Let only one process at a time compile. Kernels call kernels, so that a thread may enter again."""
    with _in_process:
        try:
            lock = _file_lock(folder)
            lock.acquire()
        except OSError:  # a file system without locks: several processes may compile the same
            yield
            return
        try:
            yield
        finally:
            lock.release()


@cache
def _file_lock(folder: Path) -> filelock.BaseFileLock:
    return filelock.FileLock(folder / "lock")


@cache
def _announce() -> None:
    """Say once in a process that kernels are being compiled."""
    print("sonata2d: compiling, once per machine and version (about 15 s) ...", file=sys.stderr, flush=True)  # noqa: T201


def _plugin_of(function: Callable[..., Any]) -> Path | None:
    """The folder or file of the plug-in that defines a function; None for sonata2d."""
    file = Path(function.__code__.co_filename).resolve()
    if file.is_relative_to(_PACKAGE):
        return None
    package = sys.modules.get(function.__module__.partition(".")[0])
    init = getattr(package, "__file__", None) if hasattr(package, "__path__") else None
    return Path(init).resolve().parent if init else file


@cache
def _cache_folder(plugin: Path | None) -> Path | None:
    """A folder for the machine code of sonata2d's kernels, or of a plug-in's; None if no folder can be written.

    It lies in the package's own folder, or in the user's cache folder if that one is read-only.
    """
    name = _PREFIX + _hash([_sources(_PACKAGE), _sources(plugin) if plugin else b"", _versions()])
    given = os.environ.get("NUMBA_CACHE_DIR")
    bases = (Path(given),) if given else (_PACKAGE / "__pycache__", platformdirs.user_cache_path("sonata2d", False))
    if plugin is not None and not plugin.exists():
        return None  # defined in a notebook or a terminal
    for base in bases:
        folder = base / name
        try:
            is_new = not folder.exists()
            folder.mkdir(parents=True, exist_ok=True)
            probe = folder / f"write-{os.getpid()}-{threading.get_ident()}"
            probe.touch()
            probe.unlink()
        except OSError:
            continue
        if is_new:
            _delete_old_folders(base, folder)
        return folder
    return None


def _delete_old_folders(base: Path, current: Path) -> None:
    """Delete the machine code of other versions, but for the newest folders."""
    others = [(folder.stat().st_mtime, folder) for folder in base.glob(f"{_PREFIX}*") if folder != current]
    for _, folder in sorted(others, reverse=True)[_KEPT:]:
        shutil.rmtree(folder, ignore_errors=True)


def _versions() -> bytes:
    """Versions and settings that machine code depends on, besides the processor, which numba checks."""
    names = ("numba", "llvmlite", "numpy")
    versions = [sys.version, *(f"{name} {import_module(name).__version__}" for name in names)]
    settings = sorted(f"{k}={v}" for k, v in os.environ.items() if k.startswith("NUMBA_") and k not in _NO_EFFECT)
    return "\n".join(versions + settings).encode()


@cache
def _sources(place: Path) -> bytes:
    """The hash of a Python file, or of all Python files in a folder."""
    files = sorted(place.rglob("*.py")) if place.is_dir() else [place]
    parts = [part for file in files if file.exists() for part in (file.name.encode(), file.read_bytes())]
    return _hash(parts).encode()


def _hash(parts: list[bytes]) -> str:
    digest = hashlib.blake2b(digest_size=8)
    for part in parts:
        digest.update(b"%d:" % len(part) + part)
    return digest.hexdigest()
