"""The command `sonata2d evaluate`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from itertools import islice
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from sonata2d.core.wording import counted

from .command import Command, RenamedOption
from .common import PATH, examples, json_option, note, progress, show_json, workers_option
from .controllers import CONTROLLER_NAMES

if TYPE_CHECKING:
    from sonata2d.datasets.executors import Workers
    from sonata2d.metrics.definition import Metric
    from sonata2d.metrics.measurement import Evaluation, Measured
    from sonata2d.scenegen.scenario.config import ScenarioConfig

COMPARISON = "evaluation.json"
DEFAULT_SCENARIO = "sonata-2020"


@click.command(
    cls=Command,
    epilog=examples(
        "evaluate demo",
        "evaluate runs-a runs-b --picture compared.pdf",
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
    help=f"Scenario in which controllers run; may be repeated.  [default: {DEFAULT_SCENARIO}]",
)
@click.option(
    "--episodes", type=click.IntRange(1), default=20, help="Number of episodes for each controller and scenario."
)
@click.option("--seed", type=click.IntRange(0), default=0, help="Seed of the scenes, the same for all.")
@workers_option
@click.option(
    "out",
    "-o",
    "--output",
    "--out",
    cls=RenamedOption,
    type=PATH,
    metavar="DIR",
    help="Store the episodes of the controllers in this folder, and continue them later; else they are deleted.",
)
@click.option(
    "--metric",
    "names",
    multiple=True,
    metavar="NAME",
    help="Metric to show; may be repeated. `all` shows all metrics; `socnavgym`, `hunavsim` or `socnav3` those of"
    " another project.  [default: the main metrics]",
)
@click.option(
    "--rerun/--no-rerun", default=True, help="Also run each seed without a robot, for metrics of its effect on people."
)
@click.option(
    "--resamples", type=click.IntRange(100, 100_000), default=2000, help="Number of resamples of the bootstrap."
)
@click.option("--picture", type=PATH, metavar="FILE", help="Draw means and intervals: .png, .pdf or .svg.")
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
    """Compute metrics of recorded episodes, or run controllers in the same scenes and compare them.

    The table shows means with 95 % bootstrap intervals. Each data set gets a metrics.json with all metrics of every
    episode. docs/metrics.md explains the metrics.
    """
    from sonata2d.datasets.executors import Workers
    from sonata2d.metrics.catalogue import headline_metrics, select_metrics
    from sonata2d.metrics.measurement import Evaluation, episode_files, measure_files
    from sonata2d.metrics.plots import check_picture_path

    _check_arguments(paths, controllers, out)
    metrics = select_metrics(names) if names else headline_metrics()
    if picture is not None:
        check_picture_path(picture)
    if page is not None:
        from sonata2d.metrics.page import check_page_path, save_page  # loads pygame and jinja2

        check_page_path(page)
    settings = episodes, seed
    with (
        Workers(workers) as pool,
        _sources(paths, controllers, scenarios or (DEFAULT_SCENARIO,), out, settings, pool) as sources,
    ):
        files = {label: [file for path in own for file in episode_files(path)] for label, own in sources.items()}
        _require_episodes(sources, files)
        paths_of_all = [file for own in files.values() for file in own]
        with progress(len(paths_of_all), "episodes measured") as advance:
            # all in one call: the controllers share the runs of their scenes without a robot
            results = iter(measure_files(paths_of_all, rerun=rerun, workers=pool, advance=advance))
        measured = {label: list(islice(results, len(own))) for label, own in files.items()}
        evaluations = [Evaluation(label, own, resamples) for label, own in measured.items()]
        _save_metrics(sources, measured, resamples)
        if page is not None:  # before temporary episodes are deleted, since the page shows pictures of them
            with progress(len(evaluations), "film strips") as advance:
                save_page(page, evaluations, list(files.values()), metrics if names else None, advance)
    _write_results(evaluations, metrics, out, picture)
    if as_json:
        show_json(_comparison(evaluations))
    else:
        _show_table(evaluations, metrics)
        for name, path in {"stored": out and out / COMPARISON, "picture": picture, "page": page}.items():
            if path is not None:
                note(f"{name}  {path}")


def _write_results(
    evaluations: Sequence[Evaluation], metrics: Sequence[Metric], out: Path | None, picture: Path | None
) -> None:
    """Write the comparison into the folder of the episodes, and its chart."""
    if out is not None:
        from sonata2d.datasets.manifest import write_json

        write_json(out / COMPARISON, _comparison(evaluations))
    if picture is not None:
        from sonata2d.metrics.plots import chart

        chart(picture, evaluations, metrics, title=_title(evaluations))


def _check_arguments(paths: Sequence[Path], controllers: Sequence[str], out: Path | None) -> None:
    """Require either recorded episodes or controllers to run."""
    from sonata2d.datasets.manifest import MANIFEST

    if bool(paths) == bool(controllers):
        problem = "not both" if paths else "neither was given"
        raise click.UsageError(f"give folders of recorded episodes, or --controller to run controllers: {problem}")
    if out is not None and (out / MANIFEST).exists():
        raise click.UsageError(f"{out} is a data set; give a folder for the data sets of the controllers")
    given = click.get_current_context().get_parameter_source
    is_set = {name: given(name) is not ParameterSource.DEFAULT for name in ("scenarios", "out", "episodes", "seed")}
    if paths and any(is_set.values()):
        raise click.UsageError(
            "--scenario, --output, --episodes and --seed require --controller; recorded episodes have their own scenes"
        )


@contextmanager
def _sources(
    paths: Sequence[Path],
    controllers: Sequence[str],
    scenarios: Sequence[str],
    out: Path | None,
    settings: tuple[int, int],
    workers: Workers,
) -> Iterator[dict[str, list[Path]]]:
    """Yield the folders or files to evaluate by label: the given ones, or data sets generated for the controllers."""
    if paths:
        yield {str(path): [path] for path in paths}
        return
    from sonata2d.agents.controllers.loading import load_controller
    from sonata2d.errors import Sonata2dError
    from sonata2d.record.files import safe_texts
    from sonata2d.scenegen.scenario.load import load_scenario

    configs = [load_scenario(scenario) for scenario in dict.fromkeys(scenarios)]
    for name in controllers:  # before any episode is generated
        load_controller(name)
    with TemporaryDirectory(prefix="sonata2d-", ignore_cleanup_errors=True) as temporary:
        root, names = out or Path(temporary), list(dict.fromkeys(controllers))
        try:
            made = {
                name: [_generate(root / folder, name, config, *settings, workers) for config in configs]
                for name, folder in zip(names, safe_texts(names), strict=True)
            }
        except Sonata2dError as error:
            remedy = "keep the complete episodes with --output DIR" if out is None else "run the same command again"
            error.__notes__ = [remedy]  # in place of the options of `generate`
            raise
        yield made


def _generate(
    parent: Path, controller: str, config: ScenarioConfig, episodes: int, seed: int, workers: Workers
) -> Path:
    """Generate, or continue, the data set of a controller in a scenario, and return its folder."""
    from sonata2d.datasets.generate import generate_dataset
    from sonata2d.datasets.manifest import MANIFEST
    from sonata2d.record.files import safe_text

    folder = parent / safe_text(config.name)
    resume = (folder / MANIFEST).exists()
    with progress(episodes, f"episodes of {controller}") as advance:
        generate_dataset(
            folder, config, controller, episodes=episodes, seed=seed, workers=workers, resume=resume, advance=advance
        )
    return folder


def _require_episodes(sources: Mapping[str, Sequence[Path]], files: Mapping[str, Sequence[Path]]) -> None:
    """Raise RecordError for a data set without episodes: there is nothing to evaluate."""
    from sonata2d.datasets.manifest import read_manifest
    from sonata2d.datasets.start import unlisted_episodes
    from sonata2d.errors import RecordError

    for label, own in files.items():
        if not own:  # only a manifest can list none
            folder = sources[label][0]
            reason = unlisted_episodes(folder, read_manifest(folder))
            raise RecordError(f"{folder} lists no episodes{reason and f': {reason}'}")


def _save_metrics(sources: dict[str, list[Path]], measured: dict[str, list[Measured]], resamples: int) -> None:
    """Write metrics.json into each data set; single files and folders without a manifest get none."""
    from sonata2d.datasets.manifest import MANIFEST, read_manifest
    from sonata2d.metrics.measurement import Evaluation, save_metrics

    for label, paths in sources.items():
        remaining = iter(measured[label])  # in the order of the paths
        for path in paths:
            if path.is_dir() and (path / MANIFEST).exists():
                own = [next(remaining) for _ in read_manifest(path)["files"]]
                save_metrics(path, Evaluation(path.name, own, resamples))


def _comparison(evaluations: Sequence[Evaluation]) -> dict[str, Any]:
    """All evaluations, and the differences of each from the first, as JSON."""
    first = evaluations[0]
    names = next((list(one.episodes[0].values) for one in evaluations if one.episodes), [])
    return {
        "evaluations": [{"label": one.label, **one.to_json()} for one in evaluations],
        "differences": [
            {"of": one.label, "from": first.label} | {name: one.difference(first, name).to_json() for name in names}
            for one in evaluations[1:]
        ],
    }


def _title(evaluations: Sequence[Evaluation]) -> str:
    scenarios = ", ".join(sorted({episode.name for one in evaluations for episode in one.episodes}))
    counts = " or ".join(map(str, sorted({len(one.episodes) for one in evaluations})))
    return f"{scenarios}: {counts} episodes each; mean, 95 % bootstrap interval, every episode"


def _show_table(evaluations: Sequence[Evaluation], metrics: Sequence[Metric]) -> None:
    from sonata2d.metrics.measurement import comparison_table

    for line in comparison_table(evaluations, metrics):
        click.echo(line)
    counts = ", ".join(f"{counted(len(one.episodes), 'episode')} of {one.label}" for one in evaluations)
    mark = "; * significant difference from the first, in the common scenes" if len(evaluations) > 1 else ""
    note(f"{counts}; mean [95 % bootstrap interval]{mark}")
    first, others = evaluations[0], evaluations[1:]
    if any(one.scenes != first.scenes for one in others):
        common = ", ".join(f"{len(one.scenes & first.scenes)} of {one.label}" for one in others)
        note(f"differences are over the scenes in common with {first.label}: {common}")
    for one in evaluations if len(evaluations) > 1 else ():
        failed = sum(not episode.values.get("success") for episode in one.episodes)
        if failed:
            note(f"means of {one.label} include {counted(failed, 'episode')} of {len(one.episodes)} without success")
    for one in evaluations:
        stopped = sum(episode.outcome == "stopped" for episode in one.episodes)
        if stopped:
            note(f"{counted(stopped, 'episode')} of {one.label} stopped before the end; counted as without success")
        # path_length and others are defined in every episode with a robot
        if not any(value is not None for episode in one.episodes for value in episode.values.values()):
            note(f"{one.label}: no metric is defined, because imported tracks have no robot")
