"""The command `sonata2d run`."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path

import click

from sonata2d.core.wording import counted

from .command import Command
from .controllers import controller_option
from .options import PATH, examples, json_option
from .output import echo, progress, show_json, show_table, wants_json

_PICTURE = Path("run.png")


@click.command(
    cls=Command,
    epilog=examples(
        "run",
        "run --controller ./polite.py --scenario lively --seed 7",
        "run --scenario lively -o run.html -o run.json",
    ),
)
@click.option("--scenario", default="sonata-2020", metavar="NAME|FILE", help="Scenario preset, or a scenario file.")
@controller_option
@click.option("--seed", type=click.IntRange(0), default=0, help="Seed of the scene.")
@click.option("--episode", type=click.IntRange(0), default=0, help="Number of the scene among the scenes of the seed.")
@click.option(
    "outputs",
    "-o",
    "--output",
    type=PATH,
    multiple=True,
    default=[_PICTURE],
    metavar="FILE",
    help="What to write; may be repeated: a picture (.png, .svg), a film (.gif, .mp4), a page that plays the episode"
    f" (.html), or the episode file (.json, .json.gz, .json.zst).  [default: {_PICTURE}]",
    show_default=False,
)
@json_option
def command(scenario: str, controller: str, seed: int, episode: int, outputs: tuple[Path, ...]) -> None:
    """Run one episode, print its outcome and metrics, and draw it.

    The same seed and episode number give the same episode as in a data set that `generate` makes.
    """
    from sonata2d.agents.controllers.loading import load_controller
    from sonata2d.metrics.catalogue import headline_metrics
    from sonata2d.metrics.measurement import measure_together
    from sonata2d.metrics.summary import format_number
    from sonata2d.record.files import SUFFIXES, write_document
    from sonata2d.record.recorder import EpisodeRecorder
    from sonata2d.scenegen.generator import generate
    from sonata2d.scenegen.scenario.load import scenario_of
    from sonata2d.sim.driver import controller_info_of, renderer_for
    from sonata2d.sim.episode import Episode
    from sonata2d.view.episode_files import SUFFIXES as DRAWN, render
    from sonata2d.view.film import FILM_SUFFIXES

    for path in outputs:  # before the run
        if path.suffix.lower() not in DRAWN and not path.name.endswith(SUFFIXES):
            raise click.UsageError(f"{path}: end the name in one of {', '.join((*DRAWN, *SUFFIXES))}")
        path.parent.mkdir(parents=True, exist_ok=True)
    config, driver = scenario_of(scenario), load_controller(controller)
    scene, info = generate(config, seed, episode), controller_info_of(driver, controller)
    recorder = EpisodeRecorder(id=f"{episode:06d}", context=config.context)
    Episode(scene, driver, observers=[recorder], controller_info=info, renderer=renderer_for(driver)).run()
    record = recorder.record()
    for path in outputs:
        if path.name.endswith(SUFFIXES):
            write_document(path, recorder.complete())
            continue
        is_film = path.suffix.lower() in FILM_SUFFIXES
        with progress(len(record) + 1, "snapshots drawn") if is_film else nullcontext() as advance:
            render(list(record.snapshots()), path, outcome=record.outcome.status, advance=advance,
                   commands=record.command.tolist(), labels=record.labels)  # fmt: skip
    metrics = headline_metrics()
    values = measure_together(record, metrics, rerun=False)
    written = [str(path) for path in outputs]
    if wants_json():
        show_json({"scene": scene.name, "seed": seed, "episode": episode, "controller": info.path,
                   "outcome": record.outcome.status, "reason": record.outcome.reason, "frames": len(record),
                   "metrics": values, "written": written})  # fmt: skip
        return
    others = [each.path for each in record.controller_info.others]
    known = [(metric, value) for metric in metrics if (value := values[metric.name]) is not None]
    show_table(
        [
            ("scenario", f"{scene.family}, seed {seed}, episode {episode}, {counted(len(scene.humans), 'person')}"),
            ("controller", info.path),
            *([("other robots", ", ".join(others))] if others else []),
            ("outcome", f"{record.outcome.status}: {record.outcome.reason}, after {record.outcome.time:g} s"),
            *((metric.name, f"{format_number(value)} {_unit(metric.unit)}".rstrip()) for metric, value in known),
        ]
    )
    echo(f"written: {', '.join(written)}")


def _unit(unit: str) -> str:
    """The unit of a number; a share and a yes or no have none."""
    return "" if unit in ("0/1", "share", "count") else unit
