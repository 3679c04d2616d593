"""Parts of the commands `sonata2d export` and `sonata2d import`."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from .output import aligned, echo, show_json, wants_json

if TYPE_CHECKING:
    from sonata2d.formats.api import TransferResult
    from sonata2d.formats.format import Options

F = TypeVar("F", bound=Callable[..., Any])
TRACK_OPTIONS = ("frame_time", "frame_rate", "columns", "unit", "homography", "walls")
_COLUMNS = (
    ("persons", "persons"), ("frames", "frames"), ("interval", "step, s"), ("median_speed", "median, m/s"),
    ("largest_speed", "largest, m/s"), ("width", "width, m"), ("depth", "depth, m"), ("walls", "walls"),
)  # fmt: skip
_FLAGS = {
    "original": "--quirks",
    "frame_time": "--frame-time",
    "frame_rate": "--frame-rate",
    "types": "--as",
}  # else -- and the name of the option


def track_options(command: F) -> F:
    """Add the options of the reader of recorded tracks, which have the names of the fields of `Options`."""
    for decorate in reversed(
        (
            click.option(
                "--frame-rate",
                type=click.FloatRange(1e-3, 1e6),
                metavar="HZ",
                help="Frame numbers per second of the recording, for track files that do not give it.",
            ),
            click.option(
                "--frame-time",
                type=click.FloatRange(1e-6, 3600.0),
                metavar="S",
                help="Duration of one frame number in s.",
            ),
            click.option(
                "--columns",
                metavar="NAMES",
                callback=_names,
                help="Columns of a track file in its order: frame, ped (or id), x, y, z, t, group; - for others.",
            ),
            click.option(
                "--unit", metavar="UNIT", help="Unit of positions: m, cm, mm, ft, or a number of metres (per pixel)."
            ),
            click.option(
                "--homography",
                type=click.Path(path_type=Path, exists=True, dir_okay=False),
                metavar="FILE",
                help="Matrix from pixels to metres: 3 x 3 numbers, one scale, or SDD's estimated_scales.yaml.",
            ),
            click.option(
                "--walls",
                type=click.Path(path_type=Path, exists=True, dir_okay=False),
                metavar="FILE",
                help="Walls of the room, x1,y1,x2,y2 in m.  [default: NAME.obstacles.csv beside tracks, if it exists]",
            ),
        )
    ):
        command = decorate(command)
    return command


def _names(context: click.Context, parameter: click.Parameter, value: str | None) -> tuple[str, ...] | None:
    return None if value is None else tuple(name.strip() for name in value.split(","))


def show_tracks(tracks: dict[Path, dict[str, Any]]) -> None:
    """Print on standard error, for each file, a row of facts about its tracks, then remarks and doubts."""
    if not tracks or wants_json():
        return
    rows = [["tracks", *(title for _, title in _COLUMNS)]]
    rows += [[path.name, *(_cell(facts[key]) for key, _ in _COLUMNS)] for path, facts in tracks.items()]
    for line in aligned(rows):
        click.echo(line, err=True)
    for path, facts in tracks.items():
        for kind in ("notes", "doubts"):
            for remark in facts[kind]:
                echo(f"{'warning' if kind == 'doubts' else 'note'}: {path.name}: {remark}", err=True)


def _cell(value: Any) -> str:
    return "-" if value is None else f"{value:.3g}" if isinstance(value, float) else str(value)


def require_supported(format: str, options: Options) -> None:
    """Refuse the flag of an option that a format does not use."""
    from sonata2d.formats.api import unsupported_options

    if names := unsupported_options(format, options):
        flag = _FLAGS.get(names[0], f"--{names[0].replace('_', '-')}")
        raise click.ClickException(f"the format {format} does not use {flag}; leave it out")


def show_transfer(result: TransferResult, format: str, line: str) -> None:
    """Print the files, and on standard error the omissions; exit with 1 if files were refused or none was written."""
    from sonata2d.formats.api import summarised

    omitted = {"skipped": result.skipped, "refused": result.refused}
    if wants_json():
        reasons = {name: [str(omission) for omission in omissions] for name, omissions in omitted.items()}
        tracks = {"tracks": {str(path): facts for path, facts in result.tracks.items()}} if result.tracks else {}
        files = [str(file) for file in result.files]
        show_json({"format": format, "files": files, **reasons, "notes": result.notes, **tracks})
    else:
        echo(line + "".join(f", {len(omissions)} {name}" for name, omissions in omitted.items() if omissions))
        show_tracks(result.tracks)
        for name, omissions in omitted.items():
            for reason in summarised(omissions):
                click.echo(f"{name}: {reason}", err=True)
        for remark in result.notes:
            echo(f"note: {remark}", err=True)
    if result.refused or not result.files:
        raise click.exceptions.Exit(1)
