"""The program `sonata2d`: its commands, and how it reports errors and warnings."""

from __future__ import annotations

import importlib
import os
import sys
import traceback
import warnings
from io import TextIOWrapper
from pathlib import Path
from typing import Any, NoReturn

import click

from sonata2d.core.files.interruption import exits_raised, interruption_in
from sonata2d.core.wording import described, one_line
from sonata2d.errors import Sonata2dError

from .command import SETTINGS, Group, has_flag
from .interrupts import EXIT_BUG, exit_despite_threads, exit_interrupted, raising_interruptions
from .options import examples
from .start import ended_by_signals

# section of the overview: name of the command: (module, description)
_SECTIONS = {
    "Create data": {
        "run": ("run", "Run one episode, and draw it."),
        "generate": ("generate", "Generate a data set of labelled episodes."),
        "collect": ("collect", "Drive the robot in a window, or rate recorded episodes."),
        "serve": ("serve", "Serve a study: participants drive and rate in a browser."),
        "study": ("study", "Check a study file; tables of a study's results."),
        "import": ("import_", "Import episodes from files of another program."),
    },
    "Evaluate and view": {
        "evaluate": ("evaluate", "Compute metrics of episodes, or compare controllers."),
        "benchmark": ("benchmark", "Run, verify and compare controllers in a frozen suite."),
        "standard-tests": ("standard_tests", "Run the standard tests of pedestrian models."),
        "render": ("render", "Draw an episode as a picture, a film or an HTML page."),
        "view": ("view", "Play episodes in a window, or watch a controller live."),
    },
    "Manage data sets": {
        "check": ("check", "Verify a data set or an episode."),
        "describe": ("describe", "Summarise a data set or an episode."),
        "mirror": ("mirror", "Mirror a data set or an episode left to right."),
        "split": ("split", "Split a data set into train, dev and test parts."),
        "merge": ("merge", "Merge data sets into a new one."),
        "card": ("card", "Write the data card of a data set, with figures."),
        "push": ("push", "Upload a data set to the Hugging Face Hub."),
        "export": ("export", "Export episodes to a format of another program."),
    },
    "Set up": {
        "scenarios": ("scenarios", "List, show and draw scenarios; make them from tracks."),
        "controllers": ("controllers", "List the available controllers."),
        "page": ("page", "Write the simulator as a web page that needs no server."),
        "doctor": ("doctor", "Check that the installation works."),
    },
}
WIDTH = max(len(name) for section in _SECTIONS.values() for name in section)
COMMANDS = {name: module for section in _SECTIONS.values() for name, (module, _) in section.items()}


class Commands(Group):
    """A group that imports a command only when it is used, so that `--help` is fast, and reports errors in one line."""

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        """Run the program. Tests call `main`, and stay alive."""
        try:
            with ended_by_signals():  # until `invoke`
                return super().__call__(*args, **kwargs)
        except BaseException as error:  # SystemExit, or an error of a closed or full stream
            exit_despite_threads(error.code if isinstance(error, SystemExit) else 1)
            raise

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in COMMANDS:
            return None
        command: click.Command = importlib.import_module(f".{COMMANDS[cmd_name]}", __package__).command
        command.name = cmd_name
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        for title, commands in _SECTIONS.items():
            with formatter.section(title):
                formatter.write_dl([(f"{name:<{WIDTH}}", description) for name, (_, description) in commands.items()])

    def invoke(self, ctx: click.Context) -> Any:
        warnings.formatwarning = _warning_line
        for stream in (sys.stdout, sys.stderr):
            if isinstance(stream, TextIOWrapper):  # names of files may hold bytes that are no text
                stream.reconfigure(errors="backslashreplace")
        try:
            with raising_interruptions(), exits_raised():
                return super().invoke(ctx)
        except BrokenPipeError:  # the reader of a pipe has ended, as in `sonata2d describe out | head`
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            raise SystemExit(141) from None
        except (click.ClickException, click.exceptions.Exit, click.Abort):
            raise
        except BaseException as error:  # SystemExit too: commands use click's Exit, and the code of others ends none
            if (interruption := interruption_in(error)) is not None:
                exit_interrupted(interruption)
            if has_flag("traceback"):
                click.echo("".join(traceback.format_exception(error)), err=True, nl=False)
            _exit_with(error)


def _exit_with(error: BaseException) -> NoReturn:
    """Report an error in one line, and exit with 1, or with another code if it is a bug."""
    if isinstance(error, (Sonata2dError, OSError)):  # an OSError names the file
        raise click.ClickException(_error_line(error)) from error
    if isinstance(error, MemoryError):
        raise click.ClickException("not enough memory; use fewer --workers, or smaller files") from error
    place, is_bug = _origin(error)
    line = f"{_error_line(error)} ({Path(place.filename).name}, line {place.lineno})"
    if not is_bug:
        raise click.ClickException(line) from error
    click.echo(
        f"Error: unexpected {line}; this is a bug of sonata2d or of a plug-in: please report it, with what the same"
        " command prints with --traceback",
        err=True,
    )
    raise SystemExit(EXIT_BUG) from error


def _origin(error: BaseException) -> tuple[traceback.FrameSummary, bool]:
    """The innermost place of an error outside libraries, and whether it is in sonata2d and not in a user's file.

    Nothing in sonata2d raises SystemExit within a command, except in the place of `os._exit`: its caller is the place.
    """
    import sysconfig

    import sonata2d

    packages = [Path(__file__).parent, Path(str(sonata2d.__file__)).parent]
    libraries = [Path(sysconfig.get_path(name)) for name in ("stdlib", "purelib", "platlib")]
    frames, is_exit = traceback.extract_tb(error.__traceback__), isinstance(error, SystemExit)
    for frame in reversed(frames):
        parents = Path(frame.filename).resolve().parents
        if any(folder.resolve() in parents for folder in packages):
            if not is_exit:
                return frame, True
        elif not any(folder.resolve() in parents for folder in libraries):
            return frame, frame.filename.startswith("<") and not is_exit
    return frames[-1], not is_exit


def _error_line(error: BaseException) -> str:
    """`SceneError: no free spot ...`, followed by the notes that were added to the error, in one line."""
    return "; ".join([described(error, None), *map(one_line, getattr(error, "__notes__", []))])


def _warning_line(
    message: Warning | str, category: type[Warning], filename: str, lineno: int, line: str | None = None
) -> str:
    """A warning in one line, without the source line that issued it."""
    return f"Warning: {message}\n"


def _show_version(ctx: click.Context, _: click.Parameter, is_set: bool) -> None:
    """Print the versions and exit."""
    if is_set:
        from sonata2d.version import FORMAT_VERSION, PHYSICS_VERSION, __version__

        click.echo(f"sonata2d {__version__}, physics {PHYSICS_VERSION}, format {FORMAT_VERSION}")
        ctx.exit()


@click.group(
    cls=Commands,
    context_settings=SETTINGS,
    epilog=examples("generate demo", "render demo/000000.json -o demo.html", "check demo --replay"),
)
@click.option(
    "--version", is_flag=True, callback=_show_version, expose_value=False, is_eager=True, help="Show versions and exit."
)
def main() -> None:
    """Generate and evaluate data sets for social robot navigation with a 2-D simulator.

    An episode is one run of a robot among people; it is stored as a JSON file. A data set is a folder of episodes. A
    controller drives the robot. A scenario describes which rooms, people and objects are generated.

    'sonata2d COMMAND --help' shows the options and examples of a command.
    """
