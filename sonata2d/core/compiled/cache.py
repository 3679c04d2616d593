"""Files with the machine code of kernels, so that each is compiled once per machine and version.

Numba's own cache looks at the file of a kernel only; an edited subroutine or constant in another file would leave the
old machine code in use, and a data set made with it would be wrong. The name of a file here contains the kernel's key
(`compiled.key`), a hash of all that the machine code depends on: the bytecode of the kernel and of its subroutines, the
values of the constants they use, the types of the arguments, the versions of Python, NumPy and numba, numba's settings,
and the processor. A file is never out of date: processes, plug-ins and versions of sonata2d share a folder.

A file holds pickled objects and machine code, so that loading it runs what its author wants. Files are therefore read
only if nobody but the user or root could have written them (`files.ownership`).
"""

from __future__ import annotations

import hashlib
import logging
import os
import pickle
import re
import sys
import uuid
import weakref
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from types import FunctionType
from typing import Any, TypeVar

import numba
from numba.core.compiler import CompileResult
from numba.core.compiler_lock import global_compiler_lock
from numba.core.errors import NumbaError
from numba.core.runtime.nrt import rtsys
from numba.core.serialize import dumps

from ...errors import KernelError
from ..files import interruption
from ..files.ownership import foreign_access, is_own_file, make_private
from ..files.whole_file import whole_file
from ..garbage import without_garbage_collection
from ..notebook import notebook_shell
from . import ahead
from .key import NotCacheableError, key_of

logger = logging.getLogger(__name__)

F = TypeVar("F", bound=Callable[..., Any])

STAMP, _WAIT_STAMP = "last", "waiting"  # files in the folder, touched at each compilation, and when one is waited for
_SUFFIX = ".kernel"
_MAX_FILES = 16  # of one kernel: versions, settings, argument types
_MAX_AGE = 90 * 86400.0  # s since a file was last used
_SILENT_WAIT = 3.0  # s of waiting for another process, after which the user gets a message
_LOCK_TIMEOUT = 120.0  # s; then a process compiles although another one seems to
_SAME_START = 10.0  # s between compilations that are announced once


def use_cache(kernel: F) -> F:
    """Make a function compiled by numba use the files of this module; returns the function."""
    dispatcher: Any = kernel
    dispatcher._cache = files = _KernelFiles(dispatcher)
    dispatcher.compile = files.compile
    dispatcher.__reduce__ = files.reduce
    return kernel


@cache
def _location() -> Path | None:
    """Path of the folder of kernels, in `NUMBA_CACHE_DIR` or the user's cache folder; None without a home folder.

    Not in the package: files that a run leaves there would survive its uninstallation, and the folder that holds them
    would shadow an editable installation as an empty namespace package.
    """
    setting = numba.config.CACHE_DIR
    if setting:
        return Path(setting).absolute() / "sonata2d"
    import platformdirs

    folder = platformdirs.user_cache_path("sonata2d", appauthor=False) / "kernels"
    return folder if folder.is_absolute() else None  # "~" stays if there is no home folder


def cache_folder() -> Path | None:
    """The folder of kernels, which may be missing; None without one that only the user and root can write to.

    Loading a kernel runs what its file contains. The folder is checked at each use, since programs that clean `/tmp`
    could have deleted it, and another user could have made it again.
    """
    folder = _location()
    return None if folder is None or foreign_access(folder) else folder


def reason_without_folder() -> str:
    """Reason why `writable_folder` is None, and the remedy."""
    folder = _location()
    if folder is None:
        return "there is no home folder; set NUMBA_CACHE_DIR to a folder of your own"
    return foreign_access(folder) or f"not writable: {folder}; set NUMBA_CACHE_DIR to a folder of your own"


@cache
def _is_writable(folder: Path) -> bool:
    with suppress(OSError):
        make_private(folder)
        probe = folder / f"{uuid.uuid4().hex}.tmp"
        probe.touch()
        probe.unlink()
        return True
    return False


def writable_folder() -> Path | None:
    """The folder of kernels, made if it is missing; None if it is not safe or cannot be written."""
    folder = cache_folder()
    # Checked again after it was made, since another user could have made it in between.
    return folder if folder and _is_writable(folder) and cache_folder() else None


class _KernelFiles:
    """The files of one kernel, in the place of numba's cache for it (`numba.core.caching`)."""

    def __init__(self, kernel: Any) -> None:
        self._kernel = kernel
        self._compile = kernel.compile
        self._reduce = kernel.__reduce__
        self._names: dict[Any, str | None] = {}

    @property
    def cache_path(self) -> str:
        return str(writable_folder())

    def flush(self) -> None:
        """Forget nothing: files are never out of date."""

    def compile(self, signature: Any) -> Any:
        """Load the kernel or compile it, in one process at a time, and return its entry point."""
        # Numba's lock is taken before the lock of the file everywhere, so that two threads cannot wait for each other.
        with global_compiler_lock:
            numba.core.config.reload_config()  # as numba does when it compiles: the settings are a part of the name
            name = self._name(signature)
            try:
                if name is not None and _find(name):
                    return self._compile(signature)
                interruption.check()  # a compilation takes up to 10 s, and an episode needs a dozen
                with without_garbage_collection():
                    if name is None:
                        return self._compile(signature)
                    with _locked(name, ahead.compile_one if ahead.is_listed(self._kernel) else bool):
                        return self._compile(signature)
            except NumbaError as error:
                raise KernelError(self._cause(error)) from error

    def compile_if_free(self, signature: Any) -> bool:
        """Compile the kernel, unless it is there or another process compiles it; returns whether it was compiled."""
        import filelock

        with global_compiler_lock:
            name, folder = self._name(signature), writable_folder()
            if name is None or folder is None or _find(name):
                return False
            lock = filelock.FileLock(_lock_path(folder, name))
            if not _acquire(lock, 0.0):
                return False
            try:
                self._compile(signature)
            finally:
                _unlock(lock)
            return True

    def _cause(self, error: NumbaError) -> str:
        """Cause of an error of numba, whose message repeats itself for each function on the way, in up to 100 lines."""
        text = re.sub("\x1b\\[[0-9;]*m", "", str(error))  # without colours
        lines = (line.strip() for line in text.splitlines())
        what = next((line for line in lines if line and not line.startswith("Failed in ")), "")
        place = re.search(r'File "(.*?)", line (\d+)', text)
        where = f" ({Path(place[1]).name}, line {place[2]})" if place else ""
        kernel = f"{self._kernel.__module__}.{self._kernel.py_func.__name__}"
        return f"{kernel} cannot be compiled: {what}{where}; NUMBA_DISABLE_JIT=1 runs it as ordinary Python"

    def load_overload(self, signature: Any, target_context: Any) -> Any:
        """Machine code from a file, or None; called by numba within `compile`."""
        name = self._name(signature)
        content = _read(name) if name else None
        if content is not None:
            # Loaded machine code needs the allocator of arrays only. `target_context.refresh()` initialises it too, but
            # loads all that a compilation needs, which takes nearly half a second in each process.
            rtsys.initialize(target_context)
            with suppress(Exception):  # a class of an argument cannot be imported any more, ...
                result = CompileResult._rebuild(target_context, *pickle.loads(content))
                if result.signature.args == signature:
                    return result
        _announce(is_kept=name is not None)
        logger.info("compiling %s.%s", self._kernel.__module__, self._kernel.py_func.__name__)
        return None

    def save_overload(self, signature: Any, result: Any) -> None:
        """Keep what numba has compiled; called by numba within `compile`."""
        name = self._name(signature)
        # Machine code with dynamic globals contains addresses, which are valid in this process only.
        if name is not None and not result.library.has_dynamic_globals:
            with suppress(Exception):  # a full disk, a class that cannot be pickled: the kernel works all the same
                _write(name, dumps(result._reduce()))

    def reduce(self) -> Any:
        """Pickle a kernel by its name, like a function, where it has one; numba would pickle and compile a copy."""
        name: str = self._kernel.__qualname__
        value: Any = sys.modules.get(self._kernel.__module__)
        for part in name.split("."):
            value = getattr(value, part, None)
        return name if value is self._kernel else self._reduce()

    def _name(self, signature: Any) -> str | None:
        """Name of the file for some argument types; None if the kernel cannot be kept."""
        if signature not in self._names:
            function = self._kernel.py_func
            try:
                key, functions = key_of(self._kernel, signature)
            except NotCacheableError:
                self._names[signature] = None
            else:
                # Letters that every file system allows; without a dot, since "aux.x" is a device on Windows.
                readable = re.sub("[^A-Za-z0-9]+", "_", f"{function.__module__}.{function.__code__.co_qualname}")
                self._names[signature] = f"{readable[-48:]}-{key}"
                _make_symbols_unique(functions, key)
        return self._names[signature]


_renamed: weakref.WeakSet[FunctionType] = weakref.WeakSet()


def _make_symbols_unique(functions: list[FunctionType], key: str) -> None:
    """Give the machine code of functions names that no other code has.

    Numba names machine code after the function and a number that starts anew in each process. Two files loaded by one
    process, say from versions of a plug-in in two folders, could use the same name for different subroutines, and the
    linker would silently take the first for both.
    """
    for function in functions:
        if function not in _renamed:
            function.__qualname__ += f"_{key}"
            _renamed.add(function)


def _lock_path(folder: Path, name: str) -> Path:
    return folder / f"{name}.lock"


def _find(name: str) -> Path | None:
    """The file of that name, or None if it does not exist or others could have written it."""
    folder = cache_folder()
    path = folder and folder / (name + _SUFFIX)
    return path if path and is_own_file(path) else None


def _read(name: str) -> bytes | None:
    """The content of a file, or None if it is missing, damaged or not readable."""
    path = _find(name)
    with suppress(OSError):
        data = path.read_bytes() if path else b""
        if path and data[:16] == _digest(data[16:]):
            with suppress(OSError):  # a read-only folder
                os.utime(path)  # files that were not used for long are deleted
            return data[16:]
    return None


def _digest(content: bytes) -> bytes:
    return hashlib.blake2b(content, digest_size=16).digest()


def _write(name: str, content: bytes) -> None:
    """Write a file, so that other processes see it whole or not at all, and delete old ones."""
    folder = writable_folder()
    if folder is None:
        return
    make_private(folder)
    with whole_file(folder / (name + _SUFFIX)) as temporary:
        temporary.write_bytes(_digest(content) + content)
        temporary.chmod(temporary.stat().st_mode & ~0o022)  # a file in which others may write would not be read
    (folder / STAMP).touch()
    _delete_old_files(folder, name.rpartition("-")[0])


def _delete_old_files(folder: Path, kernel: str) -> None:
    """Delete files that were not used for long, and the oldest of a kernel; processes have read theirs as a whole."""
    files = sorted(((path.lstat().st_mtime, path) for path in folder.iterdir()), reverse=True)
    versions = [path for _, path in files if path.name.startswith(f"{kernel}-") and path.suffix == _SUFFIX]
    old = {path for time, path in files if files[0][0] - time > _MAX_AGE}
    for path in {*old, *versions[_MAX_FILES:]}:
        with suppress(OSError):  # Windows does not delete a file that another process is reading
            path.unlink()


@contextmanager
def _locked(name: str, use_time: Callable[[], bool] = bool) -> Iterator[None]:
    """Wait while another process compiles the same.

    Args:
        name: of the file.
        use_time: called again and again while another process compiles, as long as it returns True.
    """
    folder = writable_folder()
    if folder is None:
        yield
        return
    import filelock

    lock = filelock.FileLock(_lock_path(folder, name))
    with suppress(OSError, NotImplementedError):  # a file system without locks, or a process that hangs
        while not _acquire(lock, 0.0) and use_time():
            interruption.check()
        if not lock.is_locked and not _acquire(lock, _SILENT_WAIT):
            from multiprocessing import parent_process

            is_worker = parent_process() is not None  # which waits for another worker of the same program
            if not is_worker and not _is_start_announced(folder / _WAIT_STAMP):  # once for all that start together
                _say("another process compiles sonata2d; waiting for it ...")
            lock.acquire(timeout=_LOCK_TIMEOUT)
    try:
        yield
    finally:
        if lock.is_locked:
            _unlock(lock)


def _acquire(lock: Any, timeout: float) -> bool:
    """Acquire a lock within some seconds; returns whether no other process has it."""
    import filelock

    try:
        lock.acquire(timeout=timeout)
    except filelock.Timeout:
        return False
    return True


def _unlock(lock: Any) -> None:
    lock.release()
    with suppress(OSError):
        Path(lock.lock_file).unlink(missing_ok=True)


_is_announced = False
_announced_cell: object = None  # of a notebook, in which the last announcement appeared


def _announce(is_kept: bool) -> None:
    """Say that kernels are being compiled, once for all processes that start together; in a notebook in each cell.

    Args:
        is_kept: whether later processes load what is compiled now.
    """
    global _is_announced, _announced_cell
    cell = getattr(notebook_shell(), "execution_count", None)
    if _is_announced and cell == _announced_cell:
        return
    is_first, _is_announced, _announced_cell = not _is_announced, True, cell
    folder = writable_folder()
    if not is_first:  # another cell of a notebook, which would wait without a reason
        is_said = False
    elif folder is None:
        from multiprocessing import parent_process

        is_said = parent_process() is not None  # the workers compile the same as their parent, or as each other
    else:
        is_said = _is_start_announced(folder / STAMP)
    how = "once per version and feature" if is_kept and folder else "in every process"
    why = "" if folder else f" (machine code is not kept: {reason_without_folder()})"
    if not is_said:
        _say(f"sonata2d is compiled for this processor, {how}; this may take a minute{why} ...")


def _say(message: str) -> None:
    """Log a warning, which Python writes to standard error unless logging is configured otherwise."""
    with suppress(ValueError):  # standard error is closed
        logger.warning("%s", message)


def _is_start_announced(stamp: Path) -> bool:
    """Whether another process compiles, or has just compiled."""
    with suppress(OSError):
        try:
            stamp.touch(exist_ok=False)
        except FileExistsError:
            before = stamp.stat().st_mtime
            stamp.touch()
            return stamp.stat().st_mtime - before < _SAME_START  # no clock is read: a file server has its own
    return False
