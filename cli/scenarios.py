"""`sonata2d scenarios list|show|draw|check`."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Literal

import click

from .controllers import NAMES
from .output import json_option, progress, show_json, show_table


def _numbers(context: click.Context, option: click.Parameter, value: str | None) -> tuple[float, ...] | None:
    """As many numbers, with commas between, as the option's name for its value has."""
    if value is None:
        return None
    try:
        numbers = tuple(float(part) for part in value.split(","))
    except ValueError:
        numbers = ()
    wanted = str(option.metavar)
    if len(numbers) != len(wanted.split(",")) or not all(map(math.isfinite, numbers)):
        raise click.BadParameter(f"{value!r} is not {wanted}, numbers with commas between")
    return numbers


@click.group()
def command() -> None:
    """Scenarios: presets, and files of your own (.yaml, .json, .toml)."""


@command.command("list", epilog="Example:  sonata2d scenarios list")
@json_option
def list_scenarios(as_json: bool) -> None:
    """List the presets."""
    from sonata2d.scenegen.scenario.load import scenario_names

    presets = scenario_names()
    if as_json:
        show_json([{"name": name, "about": about} for name, about in presets.items()])
    else:
        show_table(presets.items())


@command.command("show", epilog="Example:  sonata2d scenarios show sonata-2020 > mine.yaml")
@click.argument("scenario", metavar="NAME|FILE")
@json_option
def show_scenario(scenario: str, as_json: bool) -> None:
    """Show every setting of a scenario, defaults included, as a file to start from."""
    from sonata2d.scenegen.scenario.load import load_scenario

    settings = load_scenario(scenario).model_dump(mode="json")
    if as_json:
        show_json(settings)
    else:
        import yaml

        click.echo(yaml.safe_dump(settings, sort_keys=False, allow_unicode=True, width=120), nl=False)


@command.command("draw", epilog="Example:  sonata2d scenarios draw office.yaml --scenes 6 -o office.png")
@click.argument("scenario", metavar="NAME|FILE")
@click.option("-o", "--output", type=click.Path(path_type=Path), required=True, help="The picture, a .png.")
@click.option("--scenes", type=click.IntRange(1, 100), default=6, show_default=True, help="How many to draw.")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="Seed of the scenes.")
@json_option
def draw_scenario(scenario: str, output: Path, scenes: int, seed: int, as_json: bool) -> None:
    """Draw some scenes that a scenario gives, side by side."""
    from sonata2d.scenegen.generator import generate
    from sonata2d.scenegen.scenario.load import load_scenario
    from sonata2d.view.sheet import scene_picture
    from sonata2d.view.still import save_surface

    config = load_scenario(scenario)
    save_surface(scene_picture(*(generate(config, seed, episode) for episode in range(scenes))), output)
    if as_json:
        show_json({"picture": str(output), "scenes": scenes})
    else:
        click.echo(f"{output}: {scenes} scenes of {config.name}")


@command.command(
    "from-tracks",
    epilog="Examples:  sonata2d scenarios from-tracks eth.csv -o eth.yaml   ·   sonata2d scenarios from-tracks eth.csv"
    " --walls walls.csv --people simulated --start 30 --seconds 40 -o eth.json   ·   sonata2d scenarios from-tracks"
    " eth.csv --replay 12 --robot 0,5,0 --goal 12,5 -o one.yaml",
)
@click.argument("tracks", type=click.Path(path_type=Path), metavar="FILE")
@click.option("-o", "--output", type=click.Path(path_type=Path), required=True, help="The scenario, .yaml or .json.")
@click.option("--walls", type=click.Path(path_type=Path), help="x1, y1, x2, y2; else FILE.obstacles.csv, if there.")
@click.option(
    "--people",
    type=click.Choice(["replayed", "simulated"]),
    default="replayed",
    show_default=True,
    help="Whether they are carried along their tracks, or walk from the same start to the same goal.",
)
@click.option(
    "--replay", type=int, multiple=True, metavar="ID", help="Replay this one, simulate the others; repeatable."
)
@click.option("--start", type=click.FloatRange(0.0), default=0.0, show_default=True, help="First moment taken, s.")
@click.option("--seconds", type=click.FloatRange(0.1), default=60.0, show_default=True, help="How long, s.")
@click.option("--robot", callback=_numbers, metavar="X,Y,THETA", help="Its start, m and rad; else drawn.")
@click.option("--goal", callback=_numbers, metavar="X,Y", help="Where it shall go, m; else drawn.")
@click.option("--frame-time", type=click.FloatRange(1e-6, 3600.0), help="Seconds a frame, where the file lacks it.")
@click.option(
    "--speed", type=click.FloatRange(0.1, 5.0), help="Desired speed, m/s, where tracks are too short to tell."
)
@json_option
def scenario_of_tracks(
    tracks: Path,
    output: Path,
    walls: Path | None,
    people: Literal["replayed", "simulated"],
    replay: tuple[int, ...],
    start: float,
    seconds: float,
    robot: tuple[float, float, float] | None,
    goal: tuple[float, float] | None,
    frame_time: float | None,
    speed: float | None,
    as_json: bool,
) -> None:
    """Make a scenario of recorded people: tracks as csv (frame, ped, x, y) or TrajNet++ (.ndjson)."""
    from sonata2d.formats.from_tracks import save_scenario, scenario_from_tracks

    config = scenario_from_tracks(
        tracks,
        people=people,
        replay=replay,
        start=start,
        seconds=seconds,
        walls=walls,
        robot=robot,
        goal=goal,
        frame_time=frame_time,
        speed=speed,
    )
    save_scenario(config, output)
    recorded = sum(person.does == "recorded" for person in config.people)
    told = {
        "scenario": str(output),
        "people": len(config.people),
        "replayed": recorded,
        "walls": len(config.room.walls),
    }
    if as_json:
        show_json(told)
    else:
        click.echo(f"{output}: {config.description}; {len(config.people)} people, {recorded} of them replayed")


@command.command(
    "check",
    epilog="Examples:  sonata2d scenarios check blind-corner --episodes 50   ·   "
    "sonata2d scenarios check mine.yaml --situation narrow-doorway --controller ./mine.py:Mine",
)
@click.argument("scenario", metavar="NAME|FILE")
@click.option("--situation", metavar="NAME", help="What is to take place.  [default: the scenario's name]")
@click.option(
    "--controller",
    default="social-planner",
    show_default=True,
    metavar="NAME",
    help=f"Drives the robot. {NAMES}",
)
@click.option("--episodes", type=click.IntRange(1), default=20, show_default=True, help="How many to run.")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="Of the scenes.")
@json_option
@click.pass_context
def check_scenario(
    context: click.Context,
    scenario: str,
    situation: str | None,
    controller: str,
    episodes: int,
    seed: int,
    as_json: bool,
) -> None:
    """Run episodes of a scenario, and see whether its situation takes place in each: who meets whom, where, when.

    Ends with 1 if it does not take place in every episode. docs/scenarios.md tells the situations.
    """  # fmt: skip
    from sonata2d.agents.controllers.loading import load_controller
    from sonata2d.errors import ConfigError
    from sonata2d.metrics.situations import SITUATIONS, named, rehearse
    from sonata2d.scenegen.scenario.load import load_scenario
    from sonata2d.sim.episode import renderer_for

    config = load_scenario(scenario)
    if situation is None and config.name not in SITUATIONS:
        raise ConfigError(
            f"no situation is named {config.name!r}; say which it is with --situation NAME; "
            f"situations are {', '.join(SITUATIONS)}"
        )
    wanted, driver = named(situation or config.name), load_controller(controller)
    verdicts = []
    with progress(episodes, "episodes") as advance:
        for episode in range(episodes):
            verdicts.append(rehearse(config, wanted, driver, seed=seed, episode=episode, renderer=renderer_for(driver)))
            advance(1)
    took_place = sum(verdict.took_place for verdict in verdicts)
    if as_json:
        told = [{"episode": k, "took_place": v.took_place, "told": v.told} for k, v in enumerate(verdicts)]
        show_json({"scenario": config.name, "situation": wanted, "took_place": took_place, "episodes": told})
    else:
        show_table((f"{k:6d}", f"{'yes' if v.took_place else 'NO ':3}  {v.told}") for k, v in enumerate(verdicts))
        click.echo(f"{wanted} took place in {took_place} of {episodes} episodes of {config.name}")
    context.exit(0 if took_place == episodes else 1)
