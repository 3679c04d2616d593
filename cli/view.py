"""`sonata2d view`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from .controllers import NAMES
from .output import json_option, show_json

if TYPE_CHECKING:
    from sonata2d.core.devices import View


@click.command(
    epilog="Examples:  sonata2d view demo   ·   sonata2d view demo/000000.json --follow --speed 2   ·   "
    "sonata2d view --live --controller ./polite.py:Polite --scenario office.yaml --seed 7"
)
@click.argument("path", type=click.Path(path_type=Path), metavar="DIR|FILE", required=False)
@click.option("--follow/--top", default=None, help="From behind the robot, or the whole room [default: --top].")
@click.option("--speed", type=click.FloatRange(0.25, 8.0), default=1.0, show_default=True, help="1 is real time.")
@click.option("--fps", type=click.IntRange(5, 240), default=60, show_default=True, help="Pictures a second at most.")
@click.option("--live", is_flag=True, help="Watch a controller at work instead of a recorded run.")
@click.option("--controller", metavar="NAME", help=f"Drives the robot of --live. {NAMES}")
@click.option("--scenario", metavar="NAME|FILE", help="What scenes of --live look like  [default: sonata-2020].")
@click.option("--seed", type=click.IntRange(0), help="Of the scenes of --live  [default: 0].")
@click.option("--size", type=(click.IntRange(640), click.IntRange(480)), default=(1280, 800), help="Of the window.")
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
    size: tuple[int, int],
    as_json: bool,
) -> None:
    """Play recorded runs in a window, one after another; F1 shows the keys.

    Play and pause, step, scrub, change the camera, save the moment as PNG or SVG. With --live, watch any controller
    drive.
    """
    view: View = "follow" if follow else "top"
    if live:
        if path is not None or controller is None:
            raise click.UsageError("--live takes a --controller and no DIR|FILE")
        _live(controller, scenario or "sonata-2020", seed or 0, view, speed, fps, size, as_json)
        return
    if path is None or (controller, scenario, seed) != (None, None, None):
        raise click.UsageError("give a DIR|FILE to play, or --live with --controller, --scenario and --seed")
    _recorded(path, view, speed, fps, size, as_json)


def _recorded(path: Path, view: View, speed: float, fps: int, size: tuple[int, int], as_json: bool) -> None:
    """Play a file, or those of a folder."""
    from sonata2d.datasets.check import Listed
    from sonata2d.datasets.verification import files_of
    from sonata2d.window.stage import Stage
    from sonata2d.window.view_screen import ViewScreen

    paths = [file.path if isinstance(file, Listed) else file for file in files_of(path)]
    screen = ViewScreen(paths, view=view, speed=speed)
    Stage(f"sonata2d: {path}", size=size, fps=fps).run(screen)
    if as_json:
        show_json({"saved": [str(path) for path in screen.saved]})
    for path in () if as_json else screen.saved:
        click.echo(f"saved: {path}")


def _live(
    controller: str, scenario: str, seed: int, view: View, speed: float, fps: int, size: tuple[int, int], as_json: bool
) -> None:
    """Watch a controller at work."""
    from sonata2d.scenegen.scenario.load import load_scenario
    from sonata2d.window.live_screen import LiveScreen
    from sonata2d.window.stage import Stage

    screen = LiveScreen(load_scenario(scenario), controller, seed, view=view, speed=speed)
    Stage(f"sonata2d: {controller}", size=size, fps=fps).run(screen)
    if as_json:
        show_json({"outcomes": screen.outcomes, "failed": screen.failed})
    if screen.failed:
        raise SystemExit(1)
