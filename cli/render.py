"""`sonata2d render`."""

from __future__ import annotations

from pathlib import Path

import click

from .output import json_option, show_json


@click.command(epilog="Examples:  sonata2d render demo/000000.json -o one.html   ·   ... -o strip.png --strip 4")
@click.argument("file", type=click.Path(path_type=Path))
@click.option("-o", "--output", type=click.Path(path_type=Path), required=True, help=".png, .gif, .mp4 or .html")
@click.option("--strip", type=click.IntRange(2, 20), help="A .png of this many moments side by side.")
@click.option("--fps", type=click.IntRange(1, 120), help="Pictures a second of a film.")
@click.option("--speed", type=click.FloatRange(0.05, 50.0), help="Pace of a film; 1 is real time.")
@click.option("--size", type=(click.IntRange(16, 8000), click.IntRange(16, 8000)), help="Width and height in pixels.")
@click.option("--zones", is_flag=True, help="Draw people's intimate and personal space.")
@click.option("--ids", is_flag=True, help="Write the ids of people and things.")
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
    as_json: bool,
) -> None:
    """Turn an episode into a picture (.png), a film (.gif, .mp4) or one self-contained page that plays (.html)."""
    from sonata2d.record import read_episode
    from sonata2d.view import Layers, render

    record = read_episode(file)
    given = {"strip": strip, "fps": fps, "speed": speed, "size": size}
    render(
        list(record.snapshots()),
        output,
        layers=Layers(zones=zones, ids=ids),
        outcome=record.outcome.status,
        commands=record.command.tolist(),
        labels=record.labels,
        **{name: value for name, value in given.items() if value is not None},  # type: ignore[arg-type]
    )
    if as_json:
        show_json({"output": str(output), "frames": len(record)})
    else:
        click.echo(f"{output}: {len(record)} frames, {record.outcome.status}")
