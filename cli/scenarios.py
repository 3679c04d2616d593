"""The commands `sonata2d scenarios list|show|draw|from-tracks|from-map|check|difficulty`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from .command import Group
from .controllers import controller_option
from .options import PATH, examples, json_option
from .output import aligned, echo, progress, require_new, show_json, show_result, show_table, wants_json
from .transfer import TRACK_OPTIONS, show_tracks, track_options


@click.group(cls=Group)
def command() -> None:
    """List, show, draw, check and create scenarios.

    A scenario describes which rooms, people and objects are generated. It is a preset, or a file of your own (.yaml,
    .json or .toml).
    """


@command.command("list", epilog=examples("scenarios list"))
@json_option
def list_scenarios() -> None:
    """List the presets."""
    from sonata2d.scenegen.scenario.load import scenario_names

    presets = scenario_names()
    if wants_json():
        show_json([{"name": name, "about": about} for name, about in presets.items()])
    else:
        show_table(presets.items())


@command.command("show", epilog=examples("scenarios show sonata-2020 > mine.yaml"))
@click.argument("scenario", metavar="NAME|FILE")
@json_option
def show_scenario(scenario: str) -> None:
    """Print all settings of a scenario as YAML.

    The output includes defaults, and can serve as a starting point for a file of your own.
    """
    from sonata2d.scenegen.scenario.load import load_scenario

    settings = load_scenario(scenario).model_dump(mode="json")
    if wants_json():
        show_json(settings)
    else:
        import yaml

        click.echo(yaml.safe_dump(settings, sort_keys=False, allow_unicode=True, width=120), nl=False)


@command.command("draw", epilog=examples("scenarios draw sonata-2020-crowded --scenes 6 -o scenes.png"))
@click.argument("scenario", metavar="NAME|FILE")
@click.option("-o", "--output", type=PATH, required=True, help="Output file, .png.")
@click.option("--scenes", type=click.IntRange(1, 100), default=6, help="Number of scenes.")
@click.option("--seed", type=click.IntRange(0), default=0, help="Seed of the scenes.")
@json_option
def draw_scenario(scenario: str, output: Path, scenes: int, seed: int) -> None:
    """Draw scenes generated from a scenario side by side."""
    from sonata2d.scenegen.generator import generate
    from sonata2d.scenegen.scenario.load import load_scenario
    from sonata2d.view.sheets import scene_picture
    from sonata2d.view.stills import save_surface

    config = load_scenario(scenario)
    save_surface(scene_picture(*(generate(config, seed, episode) for episode in range(scenes))), output)
    show_result({"picture": str(output), "scenes": scenes}, f"{output}: {scenes} scenes of {config.name}")


@command.command(
    "from-tracks",
    epilog=examples(
        "scenarios from-tracks eth.csv -o eth.yaml",
        "scenarios from-tracks eth.csv --walls walls.csv --people simulated -o eth.json",
        "scenarios from-tracks eth.csv --replay 12 --robot 0 5 0 --goal 12 5 -o one.yaml",
    ),
)
@click.argument("tracks", type=PATH, metavar="FILE")
@click.option("-o", "--output", type=PATH, required=True, help="Scenario file to write, .yaml or .json.")
@track_options
@click.option(
    "--people",
    type=click.Choice(["replayed", "simulated"]),
    default="replayed",
    help="Move people along their tracks, or simulate them from the start to the end of the track.",
)
@click.option(
    "--replay", type=int, multiple=True, metavar="ID", help="Replay this person and simulate the others; repeatable."
)
@click.option("--start", type=click.FloatRange(0.0), default=0.0, help="Start of the time window, s.")
@click.option("--seconds", type=click.FloatRange(0.1), default=60.0, help="Length of the time window, s.")
@click.option("--robot", type=(float,) * 3, metavar="X Y THETA", help="Start pose, m and rad.  [default: random]")
@click.option("--goal", type=(float,) * 2, metavar="X Y", help="Position of the goal, m.  [default: random]")
@click.option("--robot-as", type=int, metavar="ID", help="Put the robot, with its goal, in the place of this person.")
@click.option(
    "--speed", type=click.FloatRange(0.1, 5.0), help="Speed of people with short tracks, m/s.  [default: random]"
)
@json_option
def scenario_from_tracks(tracks: Path, output: Path, **options: Any) -> None:
    """Create a scenario from recorded tracks of people.

    FILE is in any layout that `import --from tracks` reads.
    """
    from sonata2d.formats.format import Options
    from sonata2d.formats.from_tracks import save_scenario, scenario_and_summary

    require_new(output)
    of_reader = {name: options.pop(name) for name in TRACK_OPTIONS}
    config, summary = scenario_and_summary(tracks, Options(**of_reader), **options)  # options have its arguments' names
    save_scenario(config, output)
    replayed = sum(person.resolved_behaviour == "recorded" for person in config.people)
    show_tracks({tracks: summary.to_json()})
    show_result(
        {
            "scenario": str(output), "people": len(config.people), "replayed": replayed,
            "walls": len(config.room.walls), "tracks": summary.to_json(),
        },
        f"{output}: {config.description}; {len(config.people)} people, {replayed} of them replayed",
    )  # fmt: skip


_LENGTH = click.FloatRange(0.0, min_open=True)


@command.command(
    "from-map",
    epilog=examples(
        "scenarios from-map map.yaml -o house.yaml",
        "scenarios from-map flat.png --unit 0.02 --robot-at 3.5 2 -o flat.yaml",
        "scenarios from-map office.dxf --walls A-WALL --furniture 'A-FURN*' -o office.yaml",
    ),
)
@click.argument("map_file", type=PATH, metavar="FILE")
@click.option("-o", "--output", type=PATH, required=True, help="Scenario file to write, .yaml or .json.")
@click.option("--unit", type=_LENGTH, metavar="M", help="Size of a pixel of an image, or of a unit of a drawing, m.")
@click.option(
    "--robot-at", type=(float,) * 2, metavar="X Y", help="Use the floor around this point, m.  [default: the largest]"
)
@click.option("--smallest", type=_LENGTH, metavar="M", help="Leave out smaller obstacles, m.  [default: 0.15]")
@click.option("--narrowest", type=_LENGTH, metavar="M", help="Close narrower passages, m.  [default: 0.3]")
@click.option(
    "--thin",
    type=click.FloatRange(0.0),
    metavar="M",
    help="Thinner lines of an image are no walls, such as texts and swings of doors, m.  [default: 0.08; ROS: 0]",
)
@click.option(
    "--tolerance", type=_LENGTH, metavar="M", help="Straighten walls by up to this, m.  [default: half a pixel; 0.01]"
)
@click.option(
    "--most-walls", type=click.IntRange(10, 5000), metavar="N", help="Straighten more walls further.  [default: 1000]"
)
@click.option(
    "--threshold",
    type=click.FloatRange(0.0, 1.0),
    help="Darkness from which a pixel of an image is a wall, 0 (white) to 1 (black).  [default: 0.5]",
)
@click.option("--wall-width", type=_LENGTH, metavar="M", help="Width of walls drawn as lines, m.  [default: 0.1]")
@click.option("--walls", multiple=True, metavar="NAME", help="Layer, group or #colour of walls.  [default: *wall*]")
@click.option("--doors", multiple=True, metavar="NAME", help="The same for doors.  [default: *door*]")
@click.option("--furniture", multiple=True, metavar="NAME", help="The same for furniture.  [default: *furn*]")
@click.option("--rooms", multiple=True, metavar="NAME", help="The same for outlines of rooms.  [default: *room*]")
@click.option(
    "--leaves", type=click.Choice(["hinged", "sliding"]), help="Doors between rooms of a drawing open and close."
)
@click.option("--overwrite", is_flag=True, help="Replace scenario and picture of an earlier call.")
@json_option
def scenario_from_map(map_file: Path, output: Path, overwrite: bool, **options: Any) -> None:
    """Create a scenario from a floor plan.

    FILE is a map.yaml of ROS, an image with dark walls, or a drawing in SVG or DXF. A picture of the walls on the map
    is written beside the scenario, as NAME-map.png.
    """
    from sonata2d.formats.from_tracks import save_scenario
    from sonata2d.scenegen import generate, scenario_from_map
    from sonata2d.view.map_picture import draw_on_map
    from sonata2d.view.stills import save_surface

    picture = output.with_name(f"{output.stem}-map.png")
    is_map = map_file.resolve() in (output.resolve(), picture.resolve())
    if is_map or not overwrite or output.exists() != picture.exists():  # one alone is not of an earlier call
        require_new(output, picture)
    found = scenario_from_map(map_file, **{name: value for name, value in options.items() if value not in (None, ())})
    scene = generate(found.config)  # before anything is written: people and robot have space
    save_scenario(found.config, output)
    save_surface(draw_on_map(scene, found.picture), picture)
    for note in found.notes:
        echo(f"note: {map_file.name}: {note}", err=True)
    counts = ", ".join(f"{found.facts[key]} {key}" for key in ("walls", "rooms", "furniture", "entrances"))
    show_result(
        {"scenario": str(output), "picture": str(picture), **found.facts, "notes": found.notes},
        f"{output}: floor of {found.facts['floor']:g} m², {counts}; {picture} shows them on the map",
    )


@command.command(
    "check",
    epilog=examples(
        "scenarios check blind-corner --episodes 50",
        "scenarios check mine.yaml --situation narrow-doorway --controller ./mine.py:Mine",
    ),
)
@click.argument("scenario", metavar="NAME|FILE")
@click.option("--situation", metavar="NAME", help="Situation to check for.  [default: the name of the scenario]")
@controller_option
@click.option("--episodes", type=click.IntRange(1), default=20, help="Number of episodes.")
@click.option("--seed", type=click.IntRange(0), default=0, help="Seed of the scenes.")
@json_option
@click.pass_context
def check_scenario(
    context: click.Context, scenario: str, situation: str | None, controller: str, episodes: int, seed: int
) -> None:
    """Check that a situation takes place in a scenario.

    Runs episodes of the scenario and checks each of them for the situation, e.g. an overtaking. The exit code is 1 if
    it does not take place in every episode. docs/scenarios.md describes the situations.
    """
    from sonata2d.agents.controllers.loading import load_controller
    from sonata2d.errors import ConfigError
    from sonata2d.metrics.situations import SITUATIONS, check_situation, rehearse
    from sonata2d.scenegen.scenario.load import load_scenario
    from sonata2d.sim.driver import renderer_for

    config = load_scenario(scenario)
    if situation is None and config.name not in SITUATIONS:
        raise ConfigError(
            f"the scenario's name {config.name!r} is not a situation; give one with --situation NAME;"
            f" situations are {', '.join(SITUATIONS)}; `sonata2d scenarios draw` shows whether a file is valid"
        )
    situation = situation or config.name
    check_situation(situation)
    driver = load_controller(controller)
    verdicts = []
    with progress(episodes, "episodes") as advance:
        for k in range(episodes):
            verdicts.append(rehearse(config, situation, driver, seed=seed, episode=k, renderer=renderer_for(driver)))
            advance(1)
    took_place = sum(verdict.took_place for verdict in verdicts)
    if wants_json():
        rows = [{"episode": k, "took_place": v.took_place, "told": v.description} for k, v in enumerate(verdicts)]
        show_json({"scenario": config.name, "situation": situation, "took_place": took_place, "episodes": rows})
    else:
        show_table(
            (f"{k:6d}", f"{'yes' if v.took_place else 'NO ':3}  {v.description}") for k, v in enumerate(verdicts)
        )
        click.echo(f"{situation} took place in {took_place} of {episodes} episodes of {config.name}")
    context.exit(0 if took_place == episodes else 1)


@command.command(
    "difficulty",
    epilog=examples(
        "scenarios difficulty lively",
        "scenarios difficulty mine.yaml --scenes 100 --certify --json",
    ),
)
@click.argument("scenario", metavar="NAME|FILE")
@click.option("--scenes", type=click.IntRange(1), default=20, help="Number of scenes.")
@click.option("--seed", type=click.IntRange(0), default=0, help="Seed of the scenes.")
@click.option("--certify", "certifies", is_flag=True, help="Also run the expert, to see whether a scene can be solved.")
@json_option
def show_difficulty(scenario: str, scenes: int, seed: int, certifies: bool) -> None:
    """Show how difficult the scenes of a scenario are.

    The difficulty is the time, s, in which the expert is expected to reach the goal. It is computed from the shortest
    path, its narrowest passage and turns, and the people who are expected near it.
    """
    from dataclasses import asdict

    from sonata2d.metrics import certify, difficulty
    from sonata2d.scenegen.generator import generate
    from sonata2d.scenegen.scenario.load import load_scenario

    config, rows = load_scenario(scenario), []
    with progress(scenes, "scenes") as advance:
        for k in range(scenes):
            scene = generate(config, seed, k)
            row: dict[str, Any] = {"episode": k, **asdict(difficulty(scene))}
            rows.append(row | (asdict(certify(scene)) if certifies else {}))
            advance(1)
    if wants_json():
        show_json({"scenario": config.name, "seed": seed, "scenes": rows})
        return
    columns = [("value", "s"), ("free_time", "s"), ("encounters", ""), ("standing", ""), ("narrowness", "")]
    columns += [("turns", "rad"), ("passage", "m"), *([("solvable", ""), ("time", "s")] if certifies else [])]
    names = [(name.replace("_", " "), unit) for name, unit in columns]
    table = [["scene", *(f"{name}, {unit}" if unit else name for name, unit in names)]]
    table += [[f"{row['episode']:5d}", *(_cell(row[name]) for name, _ in columns)] for row in rows]
    for line in aligned(table):
        click.echo(line)
    values = sorted(row["value"] for row in rows)
    middle = values[len(values) // 2]
    echo(f"{config.name}: difficulty {values[0]:.1f} to {values[-1]:.1f} s, median {middle:.1f} s")


def _cell(value: Any) -> str:
    return "-" if value is None else f"{value:.2f}" if isinstance(value, float) else str(value)
