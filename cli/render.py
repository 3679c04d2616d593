"""The command `sonata2d render`."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from sonata2d.core.wording import counted

from .command import Command
from .options import PATH, examples, json_option
from .output import progress, show_result

if TYPE_CHECKING:
    from sonata2d.record.record import EpisodeRecord


@click.command(
    cls=Command,
    epilog=examples(
        "render demo/000000.json -o episode.html",
        "render demo/000000.json -o moments.png --strip 4",
        "render demo/000000.json -o film.mp4 --speed 2",
        "render demo/000000.json -o graph.png --graph",
        "render demo -o episodes.png",
    ),
)
@click.argument("file", type=PATH, metavar="FILE|DIR")
@click.option("-o", "--output", type=PATH, required=True, help="Output file: .png, .svg, .gif, .mp4 or .html.")
@click.option("--strip", type=click.IntRange(2, 20), help="Draw this number of moments side by side (.png).")
@click.option("--fps", type=click.IntRange(1, 120), help="Frames per second of a film.")
@click.option("--speed", type=click.FloatRange(0.05, 50.0), help="Speed of a film; 1 is real time.")
@click.option(
    "--size", type=(click.IntRange(16, 8000), click.IntRange(16, 8000)), metavar="WIDTH HEIGHT", help="Size, pixels."
)
@click.option("--zones", is_flag=True, help="Draw the intimate and personal space of people.")
@click.option("--ids", is_flag=True, help="Draw the ids of people and objects.")
@click.option(
    "--legend/--no-legend",
    default=None,
    help="Explain the symbols below a picture or film, or not.  [default: --legend]",
)
@click.option("--graph", is_flag=True, help="Draw the last graph of the episode: up to three instants (.png).")
@click.option("--count", type=click.IntRange(1, 100), help="Number of episodes of DIR.  [default: 12]")
@json_option
def command(
    file: Path,
    output: Path,
    zones: bool,
    ids: bool,
    legend: bool | None,
    graph: bool,
    count: int | None,
    **options: Any,
) -> None:
    """Draw the episode FILE, or the first episodes of DIR side by side, as a picture, a film or a page.

    The suffix of the output selects the format: a picture (.png, .svg), a film (.gif, .mp4) or a self-contained page
    that plays an episode (.html).
    """
    from sonata2d.record.reader import read_episode
    from sonata2d.view.episode_files import render
    from sonata2d.view.film import FILM_SUFFIXES
    from sonata2d.view.layers import Layers

    if file.is_dir():
        has_others = any((options.pop("strip"), options.pop("size"), zones, ids, legend is not None, graph))
        if has_others:
            raise click.UsageError(f"{file} is a folder: only --count, --fps and --speed can be given with -o")
        _draw_sheet(file, output, count, **options)
        return
    if count is not None:
        raise click.UsageError(f"--count is for folders, and {file} is a file")
    record = read_episode(file)
    if graph:
        if any((*options.values(), zones, ids, legend is not None)):
            raise click.UsageError(
                "--graph cannot be combined with --strip, --fps, --speed, --size, --zones, --ids or --legend"
            )
        _draw_graph(record, output)
        return
    if legend is not None and output.suffix.lower() == ".html":
        raise click.UsageError("--legend and --no-legend have no effect on a page, which always has its legend")
    snapshots = list(record.snapshots())
    is_film = output.suffix.lower() in FILM_SUFFIXES
    with progress(len(snapshots), "snapshots drawn") if is_film else nullcontext() as advance:
        render(
            snapshots,
            output,
            layers=Layers(zones=zones, ids=ids, legend=legend is not False),
            outcome=record.outcome.status,
            advance=advance,
            commands=record.command.tolist(),
            labels=record.labels,
            **options,  # strip, fps, speed, size
        )
    result = {"output": str(output), "frames": len(record)}
    show_result(result, f"{output}: {len(record)} frames, {record.outcome.status}")


def _draw_sheet(folder: Path, output: Path, count: int | None, **options: Any) -> None:
    """Draw the first episodes of a folder side by side."""
    from sonata2d.datasets.dataset import SHOWN, Dataset

    dataset, count = Dataset(folder), count or SHOWN
    dataset.save(output, count=count, progress=progress, **options)
    drawn = min(count, len(dataset))
    result = {"output": str(output), "episodes": drawn}
    show_result(result, f"{output}: {drawn} of {counted(len(dataset), 'episode')}")


def _draw_graph(record: EpisodeRecord, output: Path) -> None:
    """Draw the last of the paper's graphs of an episode."""
    from sonata2d.errors import RenderError
    from sonata2d.learning.graph import paper_graphs, save_graph

    graphs = paper_graphs(record)
    if not graphs:
        raise RenderError(f"{record.path} is too short for a graph: {len(record)} frames last less than a second")
    save_graph(output, graphs[-1], dt=record.scene().rules.dt, title=f"{record.family}   {record.id}")
    result = {"output": str(output), "graphs": len(graphs), "edges": len(graphs[-1].relation)}
    show_result(result, f"{output}: the last of {len(graphs)} graphs, {len(graphs[-1].ticks)} instants")
