"""Options and output that several commands share."""

from __future__ import annotations

import math
import os
import signal
import sys
import threading
import time
from _thread import interrupt_main
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from types import FrameType
from typing import Any, NoReturn

import click

from sonata2d.core.files.interruption import THREAD_GRACE, check, forget, interrupt
from sonata2d.core.wording import one_line, shown
from sonata2d.registry import Registry

from .command import has_flag


class _PathType(click.Path):
    """A path that the system can open: without NUL, and not too long; or the URL of a store.

    Whether it exists is for commands to say.
    """

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        if isinstance(value, str) and "://" in value:
            from sonata2d.core.files.locations import location

            try:
                return location(value)
            except ValueError as error:
                self.fail(one_line(error, 300), param, ctx)
        try:
            os.lstat(value)
        except (FileNotFoundError, NotADirectoryError):
            pass
        except (OSError, ValueError) as error:
            reason = getattr(error, "strerror", None) or error
            self.fail(f"{shown(os.fsdecode(value), 80)} cannot be a path: {reason}", param, ctx)
        return super().convert(value, param, ctx)


PATH = _PathType(path_type=Path)
EXIT_BUG = 70  # EX_SOFTWARE of sysexits.h

_OUTPUT = "sonata2d.output"  # key of `click.Context.meta`


@contextmanager
def _prints_to_stderr() -> Iterator[None]:
    """Send what is printed, also by worker processes and compiled code, to standard error."""
    stdout = sys.stdout
    with suppress(OSError, ValueError, AttributeError):  # closed, or none
        stdout.flush()
    try:
        saved = os.dup(1)
    except OSError:  # closed
        yield
        return
    with suppress(OSError):
        os.dup2(2, 1)
    is_replaced = stdout is not sys.__stdout__  # by an object that does not write to the file descriptor
    if is_replaced:
        sys.stdout = sys.stderr
    try:
        yield
    finally:
        with suppress(OSError, ValueError, AttributeError):
            sys.stdout.flush()
        if is_replaced:
            sys.stdout = stdout
        os.dup2(saved, 1)
        os.close(saved)


def _keep_output_for_json(ctx: click.Context, _: click.Parameter, as_json: bool) -> bool:
    """With --json, standard output holds the result only: a controller may print as well."""
    if as_json and not ctx.resilient_parsing:
        ctx.meta[_OUTPUT] = ctx.find_root().with_resource(ExitStack())
        ctx.meta[_OUTPUT].enter_context(_prints_to_stderr())
    return as_json


json_option = click.option(
    "--json", "as_json", is_flag=True, callback=_keep_output_for_json, help="Print the result as JSON."
)
compress_option = click.option(
    "--compress", type=click.Choice(["none", "gz", "zst"]), default="none", help="Compression of the episode files."
)
size_option = click.option(
    "--size",
    type=(click.IntRange(640), click.IntRange(480)),
    metavar="WIDTH HEIGHT",
    help="Size of the window, pixels; at least 640 x 480.  [default: fits the screen]",
)
language_option = click.option(
    "--language",
    metavar="NAME|FILE",
    default="en",
    help="Words of the window: en, de, es, zh, or your own table (TOML).",
)


def episode_suffix(compress: str) -> str:
    """Suffix of episode files for a value of `--compress`."""
    return ".json" if compress == "none" else f".json.{compress}"


def examples(*lines: str) -> str:
    """Epilog of a command's help (`Command`): example command lines, given without the program's name."""
    return "\n".join(f"sonata2d {line}" for line in lines)


def registry_option(registry: Registry) -> dict[str, Any]:
    """Keyword arguments of `click.option` for the name of a registry entry, built in or of a plug-in."""

    def check(ctx: click.Context, param: click.Parameter, name: str) -> str:
        if name not in registry:
            raise click.BadParameter(registry.unknown(name), ctx, param)
        return name

    def complete(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[str]:
        return [name for name in registry if name.startswith(incomplete)]

    # built-in names only: the names of plug-ins would require reading the metadata of every installed package
    return {"callback": check, "shell_complete": complete, "metavar": f"[{'|'.join(registry.built_in)}|PLUG-IN]"}


def note(text: str, *, err: bool = False) -> None:
    """Print a summary, or a hint on standard error (`err`); `--quiet` leaves both out."""
    if not has_flag("quiet"):
        click.echo(text, err=err)


def show_json(value: Any) -> None:
    """Print a value as indented JSON."""
    import orjson

    context = click.get_current_context(silent=True)
    if context is not None and _OUTPUT in context.meta:
        context.meta[_OUTPUT].close()
    options = orjson.OPT_INDENT_2 | orjson.OPT_SERIALIZE_NUMPY | orjson.OPT_APPEND_NEWLINE
    click.echo(orjson.dumps(value, option=options), nl=False)


def show_links(links: dict[str, str], as_json: bool) -> None:
    """Print the links of a study, by name."""
    if as_json:
        show_json(links)
    for name, link in () if as_json else links.items():
        note(f"{name}:  {link}")


def show_table(rows: Iterable[tuple[str, object]], indent: str = "") -> None:
    """Print names and values in two columns."""
    pairs = [(name, str(value)) for name, value in rows]
    width = max((len(name) for name, _ in pairs), default=0)
    for name, value in pairs:
        click.echo(f"{indent}{name:<{width}}  {value}")


class Terminated(KeyboardInterrupt):
    """SIGTERM was received, as from a cluster that needs the machine."""


_DELICATE_GRACE = 2.0  # s, after which an interruption does not wait any more


@contextmanager
def raising_interruptions() -> Iterator[None]:
    """Raise `Terminated` on SIGTERM, so that work in progress ends in an orderly way, as on Ctrl-C.

    Both wait for the end of an import, because some extension modules crash if an exception is raised while they are
    loaded, and until pymunk has freed a world, where cffi would print the exception and go on. An error that follows a
    signal is raised as that interruption, because libraries make errors of their own of it.
    """
    deadline = math.inf

    def stop(number: int, frame: FrameType | None) -> None:
        nonlocal deadline
        now = time.monotonic()
        deadline = min(deadline, now + _DELICATE_GRACE)
        if _is_delicate(frame) and now < deadline:
            again = threading.Timer(0.01, interrupt_main, [number])
            again.daemon = True
            again.start()
            return
        deadline = math.inf
        interrupt(Terminated() if number == signal.SIGTERM else KeyboardInterrupt())

    if threading.current_thread() is not threading.main_thread():
        yield
        return
    numbers = [signal.SIGTERM]
    if signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:  # a background job of a shell ignores it
        numbers.append(signal.SIGINT)
    before = {number: signal.signal(number, stop) for number in numbers}
    try:
        yield
    except BaseException:
        check()
        raise
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        forget()


def _is_delicate(frame: FrameType | None) -> bool:
    """Whether a module is being loaded, or pymunk is freeing memory."""
    while frame is not None:
        code = frame.f_code
        if code.co_filename == "<frozen importlib._bootstrap>":
            return True
        if "free" in code.co_name and Path(code.co_filename).parent.name == "pymunk":
            return True
        frame = frame.f_back
    return False


def exit_interrupted(error: KeyboardInterrupt, hint: str = "") -> NoReturn:
    """Say that the command was interrupted, and exit with the code that shells expect: 128 plus the signal."""
    forget()
    is_terminated = isinstance(error, Terminated)
    click.echo(f"\n{'terminated' if is_terminated else 'interrupted'}{hint}", err=True)
    raise click.exceptions.Exit(128 + (signal.SIGTERM if is_terminated else signal.SIGINT)) from None


def exit_despite_threads(code: Any) -> None:
    """Let the program end after a moment, even if threads that a controller has left running would keep it alive.

    Args:
        code: of `SystemExit`.
    """
    if not _running_threads():
        return

    def exit_process() -> None:
        deadline = time.monotonic() + THREAD_GRACE
        while threads := _running_threads():
            if time.monotonic() > deadline:
                break
            time.sleep(0.01)
        else:
            return  # the program ends as usual
        names = ", ".join(thread.name for thread in threads)
        with suppress(OSError, ValueError):  # the streams may be closed or full
            click.echo(f"Warning: threads are still running and are ended: {names}; make them daemon threads", err=True)
        with suppress(OSError, ValueError):
            sys.stdout.flush()
        os._exit(code if isinstance(code, int) else int(code is not None))

    threading.Thread(target=exit_process, daemon=True).start()


def _running_threads() -> list[threading.Thread]:
    """Threads that keep the program alive."""
    return [one for one in threading.enumerate() if one is not threading.main_thread() and not one.daemon]


@contextmanager
def progress(total: int, unit: str) -> Iterator[Callable[[int], None]]:
    """Show a progress bar on standard error if that is a terminal; yields a function that advances it by steps.

    There is none with `--quiet`, and none between the lines of `--verbose`.
    """
    from tqdm import tqdm

    is_hidden = has_flag("quiet") or has_flag("verbose") or None  # None: hidden if standard error is no terminal
    with tqdm(total=total, unit=f" {unit}", disable=is_hidden, file=sys.stderr, leave=False) as bar:

        def advance(steps: int) -> None:
            bar.update(steps)

        yield advance
