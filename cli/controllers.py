"""The command `sonata2d controllers`, and the help text on how controllers are named."""

from __future__ import annotations

import click

from .command import Command
from .options import examples, json_option
from .output import show_json, show_table, wants_json

CONTROLLER_NAMES = "A listed name, package.module:Class, ./file.py:Class, ./weights.npz, or driver+labeller."
controller_option = click.option(
    "--controller", default="social-planner", metavar="NAME", help=f"Drives the robot. {CONTROLLER_NAMES}"
)


@click.command(cls=Command, epilog=examples("controllers", "controllers --json"))
@json_option
def command() -> None:
    """List the built-in controllers and the controllers of installed plug-ins.

    Commands take a controller as one of:

    \b
      name                   a built-in controller or a plug-in, as listed
      package.module:Class   a class in an installed package
      ./file.py:Class        a class in a file
      ./weights.npz          the weights of a learned controller
      driver+labeller        the first drives the robot; the label of each
                             frame is the twist that the second would command
    """
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
