"""How commands speak: a line for people, or JSON for programs."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Any, TypeVar

import click

from sonata2d.registry import Registry

F = TypeVar("F", bound=Callable[..., Any])


def named_in(registry: Registry) -> dict[str, Any]:
    """Arguments of `click.option` for a name that a registry knows: built in, or of an installed plug-in."""

    def check(ctx: click.Context, param: click.Parameter, name: str) -> str:
        if name not in registry:
            raise click.BadParameter(registry.unknown(name), ctx, param)
        return name

    def complete(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[str]:
        return [name for name in registry if name.startswith(incomplete)]

    # only the built-in names: listing those of plug-ins would read the metadata of every installed package
    return {"callback": check, "shell_complete": complete, "metavar": f"[{'|'.join(registry.built_in)}|PLUG-IN]"}


def json_option(function: F) -> F:
    """Adds `--json` to a command."""
    return click.option("--json", "as_json", is_flag=True, help="Answer in JSON on standard output.")(function)


def show_json(value: Any) -> None:
    """Print a value as JSON."""
    import orjson

    options = orjson.OPT_INDENT_2 | orjson.OPT_SERIALIZE_NUMPY | orjson.OPT_APPEND_NEWLINE
    click.echo(orjson.dumps(value, option=options), nl=False)


def show_table(rows: Iterable[tuple[str, object]], indent: str = "") -> None:
    """Print names and values in two columns."""
    pairs = [(name, str(value)) for name, value in rows]
    width = max((len(name) for name, _ in pairs), default=0)
    for name, value in pairs:
        click.echo(f"{indent}{name:<{width}}  {value}")


@contextmanager
def progress(total: int, unit: str) -> Iterator[Callable[[int], None]]:
    """A progress bar on standard error where that is a terminal; gives a function that moves it on."""
    from tqdm import tqdm

    with tqdm(total=total, unit=f" {unit}", disable=None, file=sys.stderr, leave=False) as bar:

        def advance(step: int) -> None:
            bar.update(step)

        yield advance
