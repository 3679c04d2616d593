"""The command `sonata2d controllers`, and the help text on how controllers are named."""

from __future__ import annotations

import click

from .command import Group
from .options import examples, json_option
from .output import show_json, show_table, wants_json

CONTROLLER_NAMES = "A listed name, package.module:Class, ./file.py:Class, ./weights.npz, or driver+labeller."
controller_option = click.option(
    "--controller", default="social-planner", metavar="NAME", help=f"Drives the robot. {CONTROLLER_NAMES}"
)


@click.group(cls=Group, invoke_without_command=True)
@click.pass_context
def command(context: click.Context) -> None:
    """List the available controllers.

    Commands take a controller as one of:

    \b
      name                   a built-in controller or a plug-in, as listed
      package.module:Class   a class in an installed package
      ./file.py:Class        a class in a file
      ./weights.npz          the weights of a learned controller
      driver+labeller        the first drives the robot; the label of each
                             frame is the twist that the second would command
    """
    if context.invoked_subcommand is None:
        context.invoke(list_controllers)


@command.command("list", epilog=examples("controllers list", "controllers list --json"))
@json_option
def list_controllers() -> None:
    """List the built-in controllers and the controllers of installed plug-ins."""
    from sonata2d.agents.controllers.loading import named_controllers

    rows = [
        {"name": name, "class": f"{kind.__module__}:{kind.__qualname__}", "about": (kind.__doc__ or "").splitlines()[0]}
        for name, kind in named_controllers().items()
    ]
    if wants_json():
        show_json(rows)
    else:
        show_table((row["name"], row["about"]) for row in rows)
        click.echo("\nYour own: package.module:Class, ./file.py:Class, ./weights.npz, or driver+labeller")
