"""Output of the commands: results as text or JSON, summaries and hints, and progress bars."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import click

from .command import has_flag

JSON = "sonata2d.json"  # key of `click.Context.meta`: the context in which other output goes to standard error


@contextmanager
def prints_to_stderr() -> Iterator[None]:
    """Send all output, also of worker processes and compiled code, to standard error."""
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


def wants_json() -> bool:
    """Whether the command line has `--json`."""
    context = click.get_current_context(silent=True)
    return context is not None and JSON in context.meta


def echo(text: str, *, err: bool = False) -> None:
    """Print a summary, or a hint on standard error (`err`); `--quiet` leaves both out."""
    if not has_flag("quiet"):
        click.echo(text, err=err)


def show_result(value: Any, summary: str) -> None:
    """Print the result of a command: a value with `--json`, else a summary, which `--quiet` leaves out."""
    if wants_json():
        show_json(value)
    else:
        echo(summary)


def show_json(value: Any) -> None:
    """Print a value as indented JSON."""
    import orjson

    if wants_json():
        click.get_current_context().meta[JSON].close()
    options = orjson.OPT_INDENT_2 | orjson.OPT_SERIALIZE_NUMPY | orjson.OPT_APPEND_NEWLINE
    click.echo(orjson.dumps(value, option=options), nl=False)


def require_new(*paths: Path) -> None:
    """Require that files do not exist, before a command takes time to make them.

    Raises:
        UsageError: one does.
    """
    for path in paths:
        if path.exists():
            raise click.UsageError(f"{path} already exists; give a new file name, or remove the file first")


def show_links(links: dict[str, str]) -> None:
    """Print the links of a study, by name."""
    show_result(links, "\n".join(f"{name}:  {link}" for name, link in links.items()))


def show_table(rows: Iterable[tuple[str, object]], indent: str = "") -> None:
    """Print names and values in two columns."""
    pairs = [(name, str(value)) for name, value in rows]
    width = max((len(name) for name, _ in pairs), default=0)
    for name, value in pairs:
        click.echo(f"{indent}{name:<{width}}  {value}")


def aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    """The lines of a table, with the first column on the left and the others on the right of their width."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [
        "  ".join(
            [row[0].ljust(widths[0]), *(cell.rjust(width) for cell, width in zip(row[1:], widths[1:], strict=True))]
        )
        for row in rows
    ]


@contextmanager
def progress(total: int, unit: str) -> Iterator[Callable[[int], None]]:
    """Show a progress bar on standard error if that is a terminal; yields a function that advances it by steps.

    `--quiet` and `--verbose` hide it: it would be between the lines of the latter.
    """
    from tqdm import tqdm

    is_hidden = has_flag("quiet") or has_flag("verbose") or None  # None: hidden if standard error is no terminal
    with tqdm(total=total, unit=f" {unit}", disable=is_hidden, file=sys.stderr, leave=False) as bar:

        def advance(steps: int) -> None:
            bar.update(steps)

        yield advance
