"""`sonata2d mirror`."""

from __future__ import annotations

from pathlib import Path

import click

from .output import json_option, progress, show_json


@click.command(
    epilog="Examples:  sonata2d mirror demo -o demo-mirrored   ·   sonata2d mirror demo/000000.json -o twin.json   ·   "
    "sonata2d mirror taught -o taught-mirrored --labels twist"
)
@click.argument("path", type=click.Path(path_type=Path), metavar="DIR|FILE")
@click.option("-o", "--output", type=click.Path(path_type=Path), required=True, help="A new folder, or a file.")
@click.option(
    "--labels",
    type=click.Choice(["stay", "twist"]),
    default="stay",
    show_default=True,
    help="What becomes of them; `twist`: each is [vx, vy, omega], and is mirrored as commands are.",
)
@json_option
def command(path: Path, output: Path, labels: str, as_json: bool) -> None:
    """Mirror every episode of a data set, or one, left for right.

    Exact: mirrored twice, with the same --labels, they are the same bytes again. Commands are mirrored; labels stay,
    unless they are twists.
    """
    twists = labels == "twist"
    episodes, frames = _data_set(path, output, twists) if path.is_dir() else _file(path, output, twists)
    if as_json:
        show_json({"output": str(output), "episodes": episodes, "frames": frames})
    else:
        click.echo(f"{output}: {episodes} episodes mirrored, {frames} frames")


def _data_set(path: Path, output: Path, twists: bool) -> tuple[int, int]:
    from sonata2d.datasets.manifest import read_manifest
    from sonata2d.datasets.mirror import mirror_dataset
    from sonata2d.datasets.mirror_image import twist_image

    with progress(len(read_manifest(path)["files"]), "episodes") as advance:
        manifest = mirror_dataset(path, output, label=twist_image if twists else None, advance=advance)
    return len(manifest["files"]), sum(row["ticks"] for row in manifest["files"])


def _file(path: Path, output: Path, twists: bool) -> tuple[int, int]:
    from sonata2d.datasets.mirror import mirror_file
    from sonata2d.datasets.mirror_image import twist_image

    if output.exists():
        raise click.UsageError(f"{output} exists; name a new file")
    return 1, len(mirror_file(path, output, label=twist_image if twists else None))
