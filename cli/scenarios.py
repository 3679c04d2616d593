"""`sonata2d scenarios list|show|draw|check`."""

from __future__ import annotations

from pathlib import Path

import click

from .output import json_option, progress, show_json, show_table


@click.group()
def command() -> None:
    """Scenarios: presets, and files of your own (.yaml, .json, .toml)."""


@command.command("list", epilog="Example:  sonata2d scenarios list")
@json_option
def list_scenarios(as_json: bool) -> None:
    """List the presets."""
    from sonata2d.scenegen import scenario_names

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
    from sonata2d.scenegen import load_scenario

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
    from sonata2d.scenegen import generate, load_scenario
    from sonata2d.view import save_surface, scene_picture

    config = load_scenario(scenario)
    save_surface(scene_picture(*(generate(config, seed, episode) for episode in range(scenes))), output)
    if as_json:
        show_json({"picture": str(output), "scenes": scenes})
    else:
        click.echo(f"{output}: {scenes} scenes of {config.name}")


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
    metavar="NAME|MODULE:CLASS|FILE:CLASS",
    help="Drives the robot.",
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
    from sonata2d.plugins import eye_of, load_controller
    from sonata2d.scenegen import load_scenario
    from sonata2d.situations import named, rehearse

    config = load_scenario(scenario)
    wanted, driver = named(situation or config.name), load_controller(controller)
    verdicts = []
    with progress(episodes, "episodes") as advance:
        for episode in range(episodes):
            verdicts.append(rehearse(config, wanted, driver, seed=seed, episode=episode, renderer=eye_of(driver)))
            advance(1)
    took_place = sum(verdict.took_place for verdict in verdicts)
    if as_json:
        told = [{"episode": k, "took_place": v.took_place, "told": v.told} for k, v in enumerate(verdicts)]
        show_json({"scenario": config.name, "situation": wanted, "took_place": took_place, "episodes": told})
    else:
        show_table((f"{k:6d}", f"{'yes' if v.took_place else 'NO ':3}  {v.told}") for k, v in enumerate(verdicts))
        click.echo(f"{wanted} took place in {took_place} of {episodes} episodes of {config.name}")
    context.exit(0 if took_place == episodes else 1)
