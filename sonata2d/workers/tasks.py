"""Tasks: a worker of any executor applies the function of a call to the items that it is sent."""

from __future__ import annotations

import os
import pickle
import platform
import threading
import time
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal
from uuid import uuid4

from ..core.files import interruption
from ..core.files.whole_file import TEMPORARY_PREFIX
from ..core.wording import described
from ..errors import WorkerError
from ..record.files import write_atomically
from ..record.layout import software_versions
from ..registry import registered_objects, restore_registered
from ..version import PHYSICS_VERSION

_VISIBLE_WITHIN = 10.0  # s, until a new file on a file server is seen by all machines
MARK = f"{TEMPORARY_PREFIX}run-"  # beginning of the name of the mark of a call
_LOOK_INTERVAL = 1.0  # s, between two looks at the mark of a call
_THIS_PROCESS = uuid4().hex

Origin = Mapping[str, str]
# The answer of a worker: how its task ended, the results (or the error, or why the task is refused), the seconds that
# the items took, and the differences between its software and the program's. Plain values: the versions may differ.
Answer = tuple[Literal["done", "stopped", "raised", "refused"], Any, float, str]


@dataclass(frozen=True, slots=True)
class Call:
    """The work of one call of a map, which workers do item by item; sent to them with each task.

    Attributes:
        set_up: returns the function that is applied to each item; called once in each worker.
        is_last: whether a worker skips the rest of its items after this result; None: it never does.
        reads: a path that each worker must see, such as the folder of a data set; None: it needs none.
        writes: the folder that workers write to; None: they write nothing.
    """

    set_up: Callable[[], Callable[[Any], Any]]
    is_last: Callable[[Any], bool] | None = None
    reads: Path | None = None
    writes: Path | None = None

    def pickled(self, mark: Path | None = None, folder: str = os.curdir) -> bytes:
        """The call as it is sent to workers.

        Args:
            mark: an empty file. Workers stop when it disappears, because the program has ended its call; None: another
                request stops them.
            folder: absolute path of the working folder of workers; by default they keep theirs.

        Raises:
            Sonata2dError: a registered object or a controller cannot be sent.
        """
        return pickle.dumps((_THIS_PROCESS, registered_objects(), self, mark, folder))


@contextmanager
def marked(folder: Path | None) -> Iterator[Path | None]:
    """Make the mark of a call in a folder, see `Call.pickled`, and remove it at the end.

    Raises:
        RecordError: the folder cannot be written.
    """
    if folder is None:
        yield None
        return
    mark = folder / f"{MARK}{uuid4().hex}"
    write_atomically(mark, b"")
    try:
        yield mark
    finally:
        with suppress(OSError):
            mark.unlink()


def origin() -> dict[str, str]:
    """The versions with which a worker compares its own."""
    return software_versions() | {"physics": str(PHYSICS_VERSION)}


def run_task(program: Origin, call: bytes, items: Sequence[Any]) -> Answer:
    """Results for the items of a task, in their order.

    Args:
        program: versions of the program, see `origin`.
        call: see `Call.pickled`.
        items: arguments of the function.

    Returns:
        See `Answer`; `stopped`: some items were not begun, because the call is over.
    """
    refusal, remark = _compared(program)
    if refusal:
        return "refused", refusal, 0.0, ""
    try:
        present = _loaded(call)
    except _Refused as error:
        return "refused", f"{_name()} {error}", 0.0, ""
    except BaseException as error:
        return "raised", _sendable(error), 0.0, remark
    with present.at_work():
        start, results = time.perf_counter(), list[Any]()
        for item in items:
            if present.is_over():
                return "stopped", results, time.perf_counter() - start, remark
            try:
                results.append(applied(present.function, item))
            except KeyboardInterrupt:  # of `interruption`: the item's compilation was given up
                return "stopped", results, time.perf_counter() - start, remark
            except BaseException as error:
                return "raised", _sendable(error), time.perf_counter() - start, remark
            if present.is_last is not None and present.is_last(results[-1]):
                break
        return "done", results, time.perf_counter() - start, remark


def applied(function: Callable[..., Any], *arguments: Any) -> Any:
    """The result of a function, which may run the code of others."""
    with interruption.surroundings_kept():
        return function(*arguments)


def stop_if_over() -> None:
    """Stop here, within an item, if the program has ended its call.

    Raises:
        KeyboardInterrupt: it has.
    """
    interruption.check()
    present: _Present | None = getattr(_thread, "at_work", None)
    if present is not None and present.is_over():
        raise KeyboardInterrupt


def stop_if_unwanted() -> None:
    """Stop here, before a file gets its name, if the program that wanted it has ended its call and does not wait.

    Raises:
        KeyboardInterrupt: it has.
    """
    present: _Present | None = getattr(_thread, "at_work", None)
    if present is not None and present.has_lost_mark():
        raise KeyboardInterrupt


class RaisedInWorker(Exception):
    """The cause of an error that a worker raised: its traceback there."""

    def __str__(self) -> str:
        return f"\n{self.args[0]}"


class _Refused(Exception):
    """Why a worker cannot work on a call."""


class _Present:
    """The call that a worker works on: loaded, with its function set up."""

    def __init__(self, pickled: bytes, call: Call, mark: Path | None) -> None:
        self.pickled = pickled
        self.is_last = call.is_last
        self._mark = mark
        self._looked = 0.0
        for path in (mark, call.reads):
            _require_visible(path)
        self.function = applied(call.set_up)

    @contextmanager
    def at_work(self) -> Iterator[None]:
        """Let `stop_if_over` look at this call while this thread runs a task of it; the thread may be the caller's."""
        outer: _Present | None = getattr(_thread, "at_work", None)
        _thread.at_work = self
        try:
            yield
        finally:
            _thread.at_work = outer

    def is_over(self) -> bool:
        """Whether the program has ended its call; it looks at the mark once a second."""
        if interruption.is_stop_requested():
            return True
        return time.monotonic() - self._looked >= _LOOK_INTERVAL and self.has_lost_mark()

    def has_lost_mark(self) -> bool:
        """Whether the mark of the call is gone."""
        self._looked = time.monotonic()
        try:
            return self._mark is not None and not self._mark.exists()
        except OSError:  # the server does not answer; the next look will tell
            return False


_thread = threading.local()  # `present`: the call that was loaded last; `at_work`: the one of the task that runs
after_set_up: Callable[[], object] = lambda: None  # noqa: E731  # set by processes that run nothing else


def _loaded(pickled: bytes) -> _Present:
    """The call, which is loaded if it is not the present one.

    Raises:
        _Refused: the worker does not see a folder, or cannot load what it was sent.
    """
    present: _Present | None = getattr(_thread, "present", None)
    if present is None or present.pickled != pickled:
        try:
            process, registered, call, mark, folder = pickle.loads(pickled)
            os.chdir(folder)
        except Exception as error:  # whatever the classes of others do; or the folder is gone
            raise _Refused(
                f"(Python {platform.python_version()}) cannot load what it is sent: {described(error)}"
            ) from error
        if process != _THIS_PROCESS:  # threads of the program itself know its objects
            restore_registered(registered)
        present = _thread.present = _Present(pickled, call, mark)
        after_set_up()
    return present


def _require_visible(path: Path | None) -> None:
    """Wait until a path is seen: file servers show new files to other machines after some seconds."""
    deadline = time.monotonic() + _VISIBLE_WITHIN
    while path is not None:
        with suppress(OSError):
            if path.exists():
                return
        if time.monotonic() > deadline:
            folder = path.parent if path.name.startswith(".") else path
            raise _Refused(
                f"does not see {folder}; give a folder that all machines share, or a URL such as s3://bucket/folder"
            )
        time.sleep(0.2)


def _compared(theirs: Origin) -> tuple[str, str]:
    """Why a worker with other software is refused, or empty; and how its software differs otherwise, or empty."""
    present = origin()
    differences = {key: (present.get(key, "none"), value) for key, value in theirs.items() if present.get(key) != value}
    for key, name in (("sonata2d", "sonata2d"), ("physics", "physics version"), ("pymunk", "pymunk")):
        if key in differences:
            here, there = differences[key]
            return f"{_name()} has {name} {here}, and this program {there}; install the same on all machines", ""
    text = ", ".join(f"{key} {here} in place of {there}" for key, (here, there) in differences.items())
    return "", f"{_name()} has {text}" if text else ""


def _name() -> str:
    return f"worker process {os.getpid()} of {platform.node()}"


def _sendable(error: BaseException) -> tuple[BaseException, str]:
    """An error that can be sent to the program, and its traceback."""
    text = "".join(traceback.format_exception(error))
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:  # whatever the class does
        error = WorkerError(f"{_name()}: {described(error)}")
    return error, text
