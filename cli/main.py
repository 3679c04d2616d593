"""`sonata2d …`: the commands, and what all of them share."""

from __future__ import annotations

import importlib
import os
import sys
import warnings
from typing import Any

import click

# name: (module, one line for the overview); a module is imported when its command is run
COMMANDS = {
    "generate": ("generate", "Make a data set: many episodes, labelled, reproducible."),
    "collect": ("collect", "A person drives in a window, and labels; or rates recorded runs."),
    "check": ("check", "Prove a data set: schema, hashes, physical sense, replay."),
    "describe": ("describe", "Say what an episode file or a data set holds."),
    "mirror": ("mirror", "Mirror an episode or a data set, left for right, exactly."),
    "split": ("split", "Part a data set into train, dev and test by scene family."),
    "merge": ("merge", "Make one data set of several, seeds kept apart."),
    "evaluate": ("evaluate", "Measure runs or controllers, side by side: table, JSON, picture."),
    "render": ("render", "Turn an episode into a picture, a film or a page that plays."),
    "view": ("view", "Play recorded runs in a window, or watch a controller at work."),
    "export": ("export", "Write episodes in a format that other programs read."),
    "import": ("import_", "Make episodes of files in another format."),
    "card": ("card", "Write a data set's card: figures, front matter, Croissant metadata."),
    "scenarios": ("scenarios", "List, show and draw scenarios."),
    "controllers": ("controllers", "List the controllers that can be named."),
    "doctor": ("doctor", "Check that this installation works, and how well."),
}


class Commands(click.Group):
    """Imports a command when it is asked for, so that `--help` is quick; shows errors in one line."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in COMMANDS:
            return None
        module = importlib.import_module(f".{COMMANDS[cmd_name][0]}", __package__)
        command: click.Command = module.command
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands"):
            formatter.write_dl([(name, line) for name, (_, line) in COMMANDS.items()])

    def invoke(self, ctx: click.Context) -> Any:
        warnings.formatwarning = _warning_line
        try:
            return super().invoke(ctx)
        except BrokenPipeError:  # `sonata2d describe out | head`
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            raise SystemExit(141) from None
        except Exception as error:
            from sonata2d.errors import Sonata2dError

            if isinstance(error, Sonata2dError):
                raise click.ClickException(_one_line(error)) from error
            raise


def _one_line(error: Exception) -> str:
    """`SceneError: no free spot …`, with the notes that were added on the way."""
    return "; ".join([f"{type(error).__name__}: {error}", *getattr(error, "__notes__", [])])


def _warning_line(
    message: Warning | str, category: type[Warning], filename: str, lineno: int, line: str | None = None
) -> str:
    """A warning as one line, without the place in sonata2d that issued it."""
    return f"Warning: {message}\n"


def _show_version(ctx: click.Context, _: click.Parameter, asked: bool) -> None:
    """Say which versions are at work, and leave."""
    if asked:
        from sonata2d.version import FORMAT_VERSION, PHYSICS_VERSION, __version__

        click.echo(f"sonata2d {__version__}, physics {PHYSICS_VERSION}, format {FORMAT_VERSION}")
        ctx.exit()


@click.group(
    cls=Commands,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
    epilog="A first data set:  sonata2d generate demo   — then:  sonata2d render demo/000000.json -o demo.html",
)
@click.option(
    "--version", is_flag=True, callback=_show_version, expose_value=False, is_eager=True, help="Show versions."
)
def main() -> None:
    """Labelled, reproducible social-navigation data sets from a light 2-D simulator."""
