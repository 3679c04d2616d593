"""`sonata2d controllers list`."""

from __future__ import annotations

import click

from .output import json_option, show_json, show_table

NAMES = "A name, module:Class, ./file.py:Class, weights ./policy.npz, or two: driver+labeller."


@click.group()
def command() -> None:
    """Controllers: stock ones, and those that installed packages publish.

    Your own is named package.module:Class, or ./mine.py:Class; a learned one by its weights, ./policy.npz. Two joined
    by a plus, driver+labeller: one drives, and each frame's label is the twist that the other would have asked for.
    """


@command.command("list", epilog="Example:  sonata2d controllers list --json")
@json_option
def list_controllers(as_json: bool) -> None:
    """List every controller that has a name."""
    from sonata2d.agents.controllers.loading import named_controllers

    rows = [
        {"name": name, "class": f"{kind.__module__}:{kind.__qualname__}", "about": (kind.__doc__ or "").splitlines()[0]}
        for name, kind in named_controllers().items()
    ]
    if as_json:
        show_json(rows)
    else:
        show_table((row["name"], row["about"]) for row in rows)
        click.echo("\nYour own: package.module:Class, ./mine.py:Class, weights ./policy.npz; or driver+labeller")
