"""Options and output that several commands share."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NoReturn

import click

from sonata2d.registry import Registry

PATH = click.Path(path_type=Path)

json_option = click.option("--json", "as_json", is_flag=True, help="Print the result as JSON.")
workers_option = click.option(
    "--workers", type=click.IntRange(1, 256), default=min(2, os.cpu_count() or 1), help="Number of processes."
)
compress_option = click.option(
    "--compress", type=click.Choice(["none", "gz", "zst"]), default="none", help="Compression of the episode files."
)
size_option = click.option(
    "--size",
    type=(click.IntRange(640), click.IntRange(480)),
    metavar="WIDTH HEIGHT",
    help="Size of the window, pixels.  [default: fits the screen]",
)
language_option = click.option(
    "--language",
    metavar="NAME|FILE",
    default="en",
    help="Words of the window: en, de, zh, or your own table (TOML).",
)


def episode_suffix(compress: str) -> str:
    """Suffix of episode files for a value of `--compress`."""
    return ".json" if compress == "none" else f".json.{compress}"


def examples(*lines: str) -> str:
    """Epilog of a command's help: example command lines, without the program's name, one per line."""
    return "Examples:\n\n\b\n" + "\n".join(f"  sonata2d {line}" for line in lines)  # \b: keep the line breaks


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


def show_json(value: Any) -> None:
    """Print a value as indented JSON."""
    import orjson

    options = orjson.OPT_INDENT_2 | orjson.OPT_SERIALIZE_NUMPY | orjson.OPT_APPEND_NEWLINE
    click.echo(orjson.dumps(value, option=options), nl=False)


def show_table(rows: Iterable[tuple[str, object]], indent: str = "") -> None:
    """Print names and values in two columns."""
    pairs = [(name, str(value)) for name, value in rows]
    width = max((len(name) for name, _ in pairs), default=0)
    for name, value in pairs:
        click.echo(f"{indent}{name:<{width}}  {value}")


class Terminated(KeyboardInterrupt):
    """SIGTERM was received, as from a cluster that needs the machine."""


@contextmanager
def raising_terminated() -> Iterator[None]:
    """Raise `Terminated` on SIGTERM, so that work in progress ends in an orderly way, as on Ctrl-C."""

    def stop(number: int, frame: object) -> None:
        raise Terminated

    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGTERM, stop)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def exit_interrupted(error: KeyboardInterrupt, hint: str = "") -> NoReturn:
    """Say that the command was interrupted, and exit with the code that shells expect: 128 plus the signal."""
    is_terminated = isinstance(error, Terminated)
    click.echo(f"\n{'terminated' if is_terminated else 'interrupted'}{hint}", err=True)
    sys.exit(128 + (signal.SIGTERM if is_terminated else signal.SIGINT))


@contextmanager
def progress(total: int, unit: str) -> Iterator[Callable[[int], None]]:
    """Show a progress bar on standard error if that is a terminal; yields a function that advances it by steps."""
    from tqdm import tqdm

    with tqdm(total=total, unit=f" {unit}", disable=None, file=sys.stderr, leave=False) as bar:

        def advance(steps: int) -> None:
            bar.update(steps)

        yield advance
