"""`sonata2d evaluate`."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import click

from .controllers import NAMES
from .output import json_option, progress, show_json

if TYPE_CHECKING:
    from sonata2d.metrics.definition import Metric
    from sonata2d.metrics.measurement import Evaluation, Measured

COMPARISON = "evaluation.json"


@click.command(
    epilog="Examples:  sonata2d evaluate demo   ·   sonata2d evaluate runs-a runs-b --picture compared.pdf   ·   "
    "sonata2d evaluate --controller social-planner --controller ./mine.py:Mine --scenario sonata-2020 --episodes 50 "
    "--page mine.html"
)
@click.argument("paths", nargs=-1, type=click.Path(path_type=Path), metavar="[DIR|FILE]...")
@click.option(
    "--controller",
    "controllers",
    multiple=True,
    metavar="NAME",
    help=f"Make runs of it, and measure these; may be given again. {NAMES}",
)
@click.option(
    "--scenario",
    "scenarios",
    multiple=True,
    metavar="NAME|FILE",
    help="What scenes the controllers meet; may be given again.  [default: sonata-2020]",
)
@click.option(
    "--episodes",
    type=click.IntRange(1),
    default=20,
    show_default=True,
    help="How many, of each controller in each scenario.",
)
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="Of the scenes, alike for all.")
@click.option(
    "--workers", type=click.IntRange(1, 256), default=min(2, os.cpu_count() or 1), show_default=True, help="Processes."
)
@click.option(
    "-o",
    "--out",
    type=click.Path(path_type=Path),
    metavar="DIR",
    help="Keep what the controllers did there, to go on with it later; else it is thrown away.",
)
@click.option(
    "--metric",
    "names",
    multiple=True,
    metavar="NAME",
    help="Show it; `all`, or variants: `socnavgym`, `hunavsim`, `socnav3`.  [default: the main ones]",
)
@click.option(
    "--rerun/--no-rerun",
    default=True,
    show_default=True,
    help="Run each seed without a robot too, to see what it cost the people.",
)
@click.option(
    "--resamples", type=click.IntRange(100, 100_000), default=2000, show_default=True, help="Of the bootstrap."
)
@click.option("--picture", type=click.Path(path_type=Path), metavar="FILE", help="Draw it: .png, .pdf or .svg.")
@click.option(
    "--page",
    type=click.Path(path_type=Path),
    metavar="FILE.html",
    help="Write a page for a browser: outcomes, metrics, plots, film strips of each one's best and worst run.",
)
@json_option
def command(
    paths: tuple[Path, ...],
    controllers: tuple[str, ...],
    scenarios: tuple[str, ...],
    episodes: int,
    seed: int,
    workers: int,
    out: Path | None,
    names: tuple[str, ...],
    rerun: bool,
    resamples: int,
    picture: Path | None,
    page: Path | None,
    as_json: bool,
) -> None:
    """Measure recorded runs, or controllers: means with 95 % bootstrap intervals, side by side.

    Data sets get a metrics.json beside their episodes, with every metric of every run. Formulas are in
    docs/metrics.md.
    """  # fmt: skip
    from sonata2d.metrics.catalogue import headline, named
    from sonata2d.metrics.measurement import Evaluation
    from sonata2d.metrics.page import refuse_page, save_page
    from sonata2d.metrics.plots import chart, refuse_picture

    _refuse_mixture(paths, controllers, scenarios, out)
    shown = named(names) if names else headline()
    if picture is not None:
        refuse_picture(picture)
    if page is not None:
        refuse_page(page)
    with _folders(paths, controllers, scenarios or ("sonata-2020",), out, (episodes, seed, workers)) as of:
        files = _files(of)
        measured = _measured(files, rerun=rerun, workers=workers)
        evaluations = [Evaluation(label, runs, resamples) for label, runs in measured.items()]
        _keep(of, measured, resamples)
        if page is not None:  # before the runs are thrown away, since it shows some of them
            save_page(page, evaluations, list(files.values()), shown if names else None)
    if out is not None:
        from sonata2d.datasets.manifest import write_tree

        write_tree(out / COMPARISON, _compared(evaluations))
    if picture is not None:
        chart(picture, evaluations, shown, title=_title(evaluations))
    if as_json:
        show_json(_compared(evaluations))
    else:
        _tell(evaluations, shown, {"kept": out and out / COMPARISON, "picture": picture, "page": page})


def _refuse_mixture(
    paths: Sequence[Path], controllers: Sequence[str], scenarios: Sequence[str], out: Path | None
) -> None:
    """Either runs that exist, or controllers to make runs of."""
    if bool(paths) == bool(controllers):
        told = "not both" if paths else "neither was given"
        raise click.UsageError(f"give folders of recorded runs, or --controller to make runs: {told}")
    if paths and (scenarios or out):
        raise click.UsageError("--scenario and --out go with --controller; recorded runs have their scenes")


@contextmanager
def _folders(
    paths: Sequence[Path],
    controllers: Sequence[str],
    scenarios: Sequence[str],
    out: Path | None,
    how: tuple[int, int, int],
) -> Iterator[dict[str, list[Path]]]:
    """The folders or files of each label: those given, or those that are made for the controllers."""
    if paths:
        yield {str(path): [path] for path in paths}
        return
    from sonata2d.record.files import safe_texts

    with TemporaryDirectory(prefix="sonata2d-") as temporary:
        place, names = out or Path(temporary), list(dict.fromkeys(controllers))
        yield {name: [_generated(place / own, name, scenario, *how) for scenario in dict.fromkeys(scenarios)]
               for name, own in zip(names, safe_texts(names), strict=True)}  # fmt: skip


def _generated(place: Path, controller: str, scenario: str, episodes: int, seed: int, workers: int) -> Path:
    """A data set of one controller, whose folder is the place, in one scenario: made, or gone on with if begun."""
    from sonata2d.datasets.generate import generate_dataset
    from sonata2d.datasets.manifest import MANIFEST
    from sonata2d.record.files import safe_text
    from sonata2d.scenegen.scenario.load import load_scenario

    config = load_scenario(scenario)
    folder = place / safe_text(config.name)
    resume = (folder / MANIFEST).exists()
    with progress(episodes, f"episodes of {controller}") as advance:
        generate_dataset(
            folder, config, controller, episodes=episodes, seed=seed, workers=workers, resume=resume, advance=advance
        )
    return folder


def _files(of: dict[str, list[Path]]) -> dict[str, list[Path]]:
    """The episode files of each label, folder after folder."""
    from sonata2d.metrics.measurement import episode_files

    return {label: [file for folder in folders for file in episode_files(folder)] for label, folders in of.items()}


def _measured(files: dict[str, list[Path]], *, rerun: bool, workers: int) -> dict[str, list[Measured]]:
    """Every run of each label, in the order of its files."""
    from sonata2d.metrics.measurement import measure_files

    with progress(sum(map(len, files.values())), "runs measured") as advance:
        return {
            label: measure_files(own, rerun=rerun, workers=workers, advance=advance) for label, own in files.items()
        }


def _keep(of: dict[str, list[Path]], measured: dict[str, list[Measured]], resamples: int) -> None:
    """Write metrics.json into each data set; loose files get none."""
    from sonata2d.datasets.manifest import MANIFEST, read_manifest
    from sonata2d.metrics.measurement import Evaluation, keep

    for label, folders in of.items():
        runs = iter(measured[label])  # in the order of the folders
        for folder in folders:
            if folder.is_dir() and (folder / MANIFEST).exists():
                own = [next(runs) for _ in read_manifest(folder)["files"]]
                keep(folder, Evaluation(folder.name, own, resamples))


def _compared(evaluations: Sequence[Evaluation]) -> dict[str, Any]:
    """All of it, and how each differs from the first, scene by scene."""
    from sonata2d.metrics.measurement import tree_of

    first = evaluations[0]
    names = next((list(one.runs[0].values) for one in evaluations if one.runs), [])
    return {
        "evaluations": [{"label": one.label, **tree_of(one)} for one in evaluations],
        "differences": [
            {"of": one.label, "from": first.label} | {name: one.less(first, name).tree() for name in names}
            for one in evaluations[1:]
        ],
    }


def _title(evaluations: Sequence[Evaluation]) -> str:
    families = sorted({run.name for one in evaluations for run in one.runs})
    counts = sorted({len(one.runs) for one in evaluations})
    return f"{', '.join(families)}: {' or '.join(map(str, counts))} runs each; mean, 95 % bootstrap interval, every run"


def _tell(evaluations: Sequence[Evaluation], shown: Sequence[Metric], written: dict[str, Path | None]) -> None:
    from sonata2d.metrics.table import table

    for line in table(evaluations, shown):
        click.echo(line)
    counts = ", ".join(f"{len(one.runs)} runs of {one.label}" for one in evaluations)
    mark = "; * differs from the first, scene by scene" if len(evaluations) > 1 else ""
    click.echo(f"{counts}; mean [95 % bootstrap interval]{mark}")
    for name, path in written.items():
        if path is not None:
            click.echo(f"{name}  {path}")
