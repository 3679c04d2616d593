"""The command `sonata2d evaluate`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

from .command import Command
from .controllers import CONTROLLER_NAMES
from .options import PATH, examples, json_option
from .output import echo, progress, show_json, wants_json
from .workers import WorkerOptions, workers_options

_DEFAULT_SCENARIO = "sonata-2020"


@click.command(
    cls=Command,
    epilog=examples(
        "evaluate demo",
        "evaluate runs-a runs-b --page compared.html",
        "evaluate --controller social-planner --controller ./mine.py:Mine --episodes 50 --page mine.html",
    ),
)
@click.argument("paths", nargs=-1, type=PATH, metavar="[DIR|FILE]...")
@click.option(
    "--controller",
    "controllers",
    multiple=True,
    metavar="NAME",
    help=f"Run this controller and evaluate it; may be repeated. {CONTROLLER_NAMES}",
)
@click.option(
    "--scenario",
    "scenarios",
    multiple=True,
    metavar="NAME|FILE",
    help=f"Scenario in which controllers run; may be repeated.  [default: {_DEFAULT_SCENARIO}]",
)
@click.option(
    "--episodes", type=click.IntRange(1), default=20, help="Number of episodes for each controller and scenario."
)
@click.option("--seed", type=click.IntRange(0), default=0, help="Seed of the scenes, the same for all.")
@workers_options
@click.option(
    "out",
    "-o",
    "--output",
    type=PATH,
    metavar="DIR",
    help="Store the episodes of the controllers in this folder, and continue them later; else they are deleted.",
)
@click.option(
    "--metric",
    "metrics",
    multiple=True,
    metavar="NAME",
    help="Metric to show; may be repeated. `all` shows all metrics; `socnavgym`, `hunavsim` or `socnav3` the"
    " metrics of another project.  [default: the main metrics]",
)
@click.option(
    "--rerun/--no-rerun", default=True, help="Also run each seed without a robot, for metrics of its effect on people."
)
@click.option(
    "--resamples", type=click.IntRange(100, 100_000), default=2000, help="Number of resamples of the bootstrap."
)
@click.option(
    "--page",
    type=PATH,
    metavar="FILE.html",
    help="Write an HTML page: outcomes, metrics, plots, and film strips of the best and the worst episodes.",
)
@json_option
def command(
    paths: tuple[Path, ...],
    controllers: tuple[str, ...],
    scenarios: tuple[str, ...],
    workers: WorkerOptions,
    out: Path | None,
    page: Path | None,
    **options: Any,
) -> None:
    """Compute metrics of recorded episodes, or run controllers in the same scenes and compare them.

    The table shows means with 95 % bootstrap intervals. Each data set gets a metrics.json with all metrics of every
    episode. docs/metrics.md explains the metrics.
    """
    from sonata2d.metrics.evaluating import COMPARISON, evaluate

    _check_arguments(paths, controllers, out)
    if page is not None:
        from sonata2d.metrics.evaluation_page import check_page_path  # loads pygame and jinja2

        check_page_path(page)
    with workers.started() as pool:
        comparison = evaluate(
            {str(path): path for path in paths} if paths else {name: name for name in controllers},
            list(dict.fromkeys(scenarios or (_DEFAULT_SCENARIO,))),
            workers=pool,
            out=out,
            progress=progress,
            **options,
        )
    if paths:
        comparison.save_metrics()
    if page is not None:
        comparison.save(page, progress=progress)
    if wants_json():
        show_json(comparison.to_json())
        return
    click.echo(comparison.table())
    for line in comparison.notes():
        echo(line)
    for name, path in {"stored": out and out / COMPARISON, "page": page}.items():
        if path is not None:
            echo(f"{name}  {path}")


def _check_arguments(paths: Sequence[Path], controllers: Sequence[str], out: Path | None) -> None:
    """Require either recorded episodes or controllers to run."""
    from sonata2d.datasets.manifest import MANIFEST

    if bool(paths) == bool(controllers):
        problem = "not both" if paths else "neither was given"
        raise click.UsageError(f"give folders of recorded episodes, or --controller to run controllers: {problem}")
    if out is not None and (out / MANIFEST).exists():
        raise click.UsageError(f"{out} is a data set; give a folder for the data sets of the controllers")
    source_of = click.get_current_context().get_parameter_source
    is_set = {name: source_of(name) is not ParameterSource.DEFAULT for name in ("scenarios", "out", "episodes", "seed")}
    if paths and any(is_set.values()):
        raise click.UsageError(
            "--scenario, --output, --episodes and --seed require --controller; recorded episodes have their own scenes"
        )
