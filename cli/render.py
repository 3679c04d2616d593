"""`sonata2d render`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from .output import json_option, show_json

if TYPE_CHECKING:
    from sonata2d.record.record import EpisodeRecord


@click.command(
    epilog="Examples:  sonata2d render demo/000000.json -o a.html   ·   … -o b.png --strip 4   ·   … -o c.png --graph"
)
@click.argument("file", type=click.Path(path_type=Path))
@click.option("-o", "--output", type=click.Path(path_type=Path), required=True, help=".png, .gif, .mp4 or .html")
@click.option("--strip", type=click.IntRange(2, 20), help="A .png of this many moments side by side.")
@click.option("--fps", type=click.IntRange(1, 120), help="Pictures a second of a film.")
@click.option("--speed", type=click.FloatRange(0.05, 50.0), help="Pace of a film; 1 is real time.")
@click.option("--size", type=(click.IntRange(16, 8000), click.IntRange(16, 8000)), help="Width and height in pixels.")
@click.option("--zones", is_flag=True, help="Draw people's intimate and personal space.")
@click.option("--ids", is_flag=True, help="Write the ids of people and things.")
@click.option("--graph", is_flag=True, help="A .png of the run as a graph, its last three instants side by side.")
@json_option
def command(
    file: Path,
    output: Path,
    strip: int | None,
    fps: int | None,
    speed: float | None,
    size: tuple[int, int] | None,
    zones: bool,
    ids: bool,
    graph: bool,
    as_json: bool,
) -> None:
    """Turn an episode into a picture (.png), a film (.gif, .mp4) or one self-contained page that plays (.html)."""
    from sonata2d.record.reader import read_episode
    from sonata2d.view.draw import Layers
    from sonata2d.view.files import render

    record = read_episode(file)
    if graph:
        if any((strip, fps, speed, size, zones, ids)):
            raise click.UsageError("--graph takes none of --strip, --fps, --speed, --size, --zones, --ids")
        _graph(record, output, as_json)
        return
    given: dict[str, Any] = {"strip": strip, "fps": fps, "speed": speed, "size": size}
    render(
        list(record.snapshots()),
        output,
        layers=Layers(zones=zones, ids=ids),
        outcome=record.outcome.status,
        commands=record.command.tolist(),
        labels=record.labels,
        **{name: value for name, value in given.items() if value is not None},
    )
    if as_json:
        show_json({"output": str(output), "frames": len(record)})
    else:
        click.echo(f"{output}: {len(record)} frames, {record.outcome.status}")


def _graph(record: EpisodeRecord, output: Path, as_json: bool) -> None:
    """The last of the paper's graphs of an episode."""
    from sonata2d.errors import RenderError
    from sonata2d.learning.graph.paper import paper_graphs
    from sonata2d.learning.graph.picture import save_graph

    graphs = paper_graphs(record)
    if not graphs:
        raise RenderError(f"{record.path} gives no graph: it has {len(record)} frames, which is less than a second")
    save_graph(output, graphs[-1], dt=record.scene().rules.dt, title=f"{record.family}   {record.id}")
    if as_json:
        show_json({"output": str(output), "graphs": len(graphs), "edges": len(graphs[-1].relation)})
    else:
        click.echo(f"{output}: the last of {len(graphs)} graphs, {len(graphs[-1].ticks)} instants")
