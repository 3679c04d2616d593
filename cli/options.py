"""Options and arguments that several commands share, and the examples of their help."""

from __future__ import annotations

import os
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import click

from sonata2d.core.wording import one_line, shown
from sonata2d.registry import Registry

from .output import JSON, prints_to_stderr


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


def _keep_output_for_json(ctx: click.Context, _: click.Parameter, as_json: bool) -> None:
    """With --json, standard output holds the result only: a controller may print as well."""
    if as_json and not ctx.resilient_parsing:
        ctx.meta[JSON] = ctx.find_root().with_resource(ExitStack())
        ctx.meta[JSON].enter_context(prints_to_stderr())


json_option = click.option(
    "--json", is_flag=True, expose_value=False, callback=_keep_output_for_json, help="Print the result as JSON."
)
compress_option = click.option(
    "--compress",
    "suffix",
    type=click.Choice(["none", "gz", "zst"]),
    default="none",
    callback=lambda ctx, param, value: ".json" if value == "none" else f".json.{value}",
    help="Compression of the episode files.",
)
size_option = click.option(
    "--size",
    type=(click.IntRange(640), click.IntRange(480)),
    metavar="WIDTH HEIGHT",
    help="Size of the window, pixels; at least 640 x 480.  [default: fits the screen]",
)
language_option = click.option(
    "--language", metavar="NAME|FILE", default="en", help="Words of the window: en, de, es, zh, or a table (TOML)."
)


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
