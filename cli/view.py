"""The command `sonata2d view`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from .command import Command
from .controllers import CONTROLLER_NAMES
from .options import PATH, examples, json_option, language_option, size_option
from .output import show_json, wants_json

if TYPE_CHECKING:
    from sonata2d.core.devices import View


@click.command(
    cls=Command,
    epilog=examples(
        "view demo",
        "view demo/000000.json --follow --speed 2",
        "view --live --controller ./polite.py:Polite --scenario sonata-2020-crowded --seed 7",
    ),
)
@click.argument("path", type=PATH, metavar="[DIR|FILE]", required=False)
@click.option("--follow/--top", default=None, help="Camera behind the robot, or the whole room.  [default: --top]")
@click.option("--speed", type=click.FloatRange(0.25, 8.0), default=1.0, help="1 is real time.")
@click.option("--fps", type=click.IntRange(5, 240), default=60, help="Maximum pictures per second.")
@click.option("--live", is_flag=True, help="Run a controller and watch it, instead of recorded episodes.")
@click.option("--controller", metavar="NAME", help=f"Controller of --live. {CONTROLLER_NAMES}")
@click.option("--scenario", metavar="NAME|FILE", help="Scenario of --live.  [default: sonata-2020]")
@click.option("--seed", type=click.IntRange(0), help="Seed of the scenes of --live.  [default: 0]")
@language_option
@size_option
@json_option
def command(
    path: Path | None,
    follow: bool | None,
    speed: float,
    fps: int,
    live: bool,
    controller: str | None,
    scenario: str | None,
    seed: int | None,
    language: str,
    size: tuple[int, int] | None,
) -> None:
    """Play recorded episodes in a window, or watch a controller drive.

    DIR plays all episodes of a data set, FILE a single one. In the window you can pause, step, change the camera and
    save pictures (PNG or SVG); F1 shows the keys. With --live, the exit code is 1 if the controller raises an error.
    """
    from sonata2d.collect.texts import choose_language
    from sonata2d.window.stage import Stage

    view: View = "follow" if follow else "top"
    choose_language(language)
    if live:
        if path is not None or controller is None:
            raise click.UsageError("--live needs --controller and takes no DIR|FILE")
        from sonata2d.scenegen.scenario.load import load_scenario
        from sonata2d.window.live_screen import LiveScreen  # loads the simulation

        drive = LiveScreen(load_scenario(scenario or "sonata-2020"), controller, seed or 0, view=view, speed=speed)
        Stage(f"sonata2d: {controller}", size=size, fps=fps).run(drive)
        if wants_json():
            show_json({"outcomes": drive.outcomes, "failed": drive.failed})
        click.get_current_context().exit(int(drive.failed))
    if path is None or (controller, scenario, seed) != (None, None, None):
        raise click.UsageError("give a DIR|FILE to play, or --live with --controller, --scenario and --seed")
    from sonata2d.datasets.manifest import files_of
    from sonata2d.window.view_screen import ViewScreen

    replay = ViewScreen(files_of(path), view=view, speed=speed)
    Stage(f"sonata2d: {path}", size=size, fps=fps).run(replay)
    if wants_json():
        show_json({"saved": [str(path) for path in replay.saved]})
    for path in () if wants_json() else replay.saved:
        click.echo(f"saved: {path}")
