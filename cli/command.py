"""Options that every command has, and the layout of the help texts.

Plain click with this module in place of a library for help texts: the known ones wrap examples and error
messages at the width of the terminal, so that commands cannot be copied and errors take several lines.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from typing import Any

import click

from sonata2d.registry import did_you_mean

_COMMON = "Options of all commands"

# Colours are left out where the output is not a terminal, and if NO_COLOR is set (https://no-color.org).
SETTINGS: dict[str, Any] = {
    "help_option_names": ["-h", "--help"],
    "max_content_width": 100,
    "show_default": True,
    "color": False if os.environ.get("NO_COLOR") else None,
}


def has_flag(name: str) -> bool:
    """Whether `quiet`, `verbose` or `traceback` was given, before or after the name of the command."""
    context = click.get_current_context(silent=True)
    return context is not None and bool(context.meta.get(name))


def _remember(context: click.Context, option: click.Parameter, value: bool) -> None:
    """Store a flag that may be given before or after the name of the command."""
    if not value:
        return
    context.meta[str(option.name)] = True  # `meta` is shared by the contexts of the program and of its command
    if option.name == "traceback":
        return
    if context.meta.get("quiet") and context.meta.get("verbose"):
        raise click.UsageError("--quiet and --verbose exclude each other", context)
    _set_up_logging(context, is_verbose=option.name == "verbose")


def _set_up_logging(context: click.Context, *, is_verbose: bool) -> None:
    """Show all log records of the package on standard error, or errors only; worker processes get the same level.

    By default Python shows warnings.
    """
    import logging

    logger = logging.getLogger("sonata2d")
    logger.setLevel(logging.INFO if is_verbose else logging.ERROR)
    root = context.find_root()
    root.call_on_close(lambda: logger.setLevel(logging.NOTSET))
    if is_verbose and not logger.handlers:
        handler = logging.StreamHandler()
        handler.setFormatter(logging.Formatter(logging.BASIC_FORMAT))
        logger.addHandler(handler)
        root.call_on_close(lambda: logger.removeHandler(handler))


def _flag(*names: str, help: str) -> click.Option:
    return click.Option(names, is_flag=True, expose_value=False, is_eager=True, callback=_remember, help=help)


_COMMON_OPTIONS = [
    _flag("-q", "--quiet", help="Print results and errors only: no progress, summaries or hints."),
    _flag("-v", "--verbose", help="Print each step on standard error."),
    _flag("--traceback", help="Print where in the source an error was raised."),
]


class HelpFormatter(click.HelpFormatter):
    """Help with headings in bold and the names of options and commands in colour."""

    def write_heading(self, heading: str) -> None:
        super().write_heading(click.style(heading, bold=True))

    def write_dl(self, rows: Iterable[tuple[str, str]], col_max: int = 30, col_spacing: int = 2) -> None:
        super().write_dl([(click.style(name, fg="cyan"), text) for name, text in rows], col_max, col_spacing)


class Context(click.Context):
    """The context of a command whose help is laid out by this module."""

    formatter_class = HelpFormatter


class Command(click.Command):
    """A command with the common options, whose epilog consists of example command lines."""

    context_class = Context

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        for param in self.params:  # click would write INTEGER RANGE
            if isinstance(kind := param.type, (click.IntRange, click.FloatRange)):
                param.metavar = param.metavar or "N"
                bounds = f"{kind.min} or more" if kind.max is None else f"from {kind.min} to {kind.max}"
                kind.name = f"{'whole ' if isinstance(kind, click.IntRange) else ''}number, {bounds}"

    def get_params(self, ctx: click.Context) -> list[click.Parameter]:
        params = super().get_params(ctx)
        end = len(params) if ctx.help_option_names == [] else len(params) - 1  # before --help
        return [*params[:end], *_COMMON_OPTIONS, *params[end:]]

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the options of the command, then the options of all commands."""
        params = self.get_params(ctx)
        first = params.index(_COMMON_OPTIONS[0])
        for title, group in (("Options", params[:first]), (_COMMON, params[first:])):
            rows = [row for param in group if isinstance(param, click.Option) and (row := param.get_help_record(ctx))]
            if rows:
                with formatter.section(title):
                    formatter.write_dl(rows)

    def format_epilog(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the examples, one per line and never wrapped, so that they can be copied."""
        if self.epilog:
            with formatter.section("Examples"):
                for line in self.epilog.splitlines():
                    formatter.write(f"{'':>{formatter.current_indent}}{line}\n")


class Group(Command, click.Group):
    """A group of such commands, which suggests the name of the command that was meant."""

    command_class = Command

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the commands, then the options."""
        self.format_commands(ctx, formatter)
        super().format_options(ctx, formatter)

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        try:
            return super().resolve_command(ctx, args)
        except click.UsageError as error:
            if args[0].startswith("-"):  # an option of the group is misspelt
                raise
            known = self.list_commands(ctx)
            hint = did_you_mean(args[0], [*known, "--help"]) or f"; commands are {', '.join(known)}"
            raise click.UsageError(error.message.rstrip(".") + hint, ctx) from None
