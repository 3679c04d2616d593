"""The command `sonata2d mirror`."""

from __future__ import annotations

from pathlib import Path

import click

from sonata2d.core.wording import counted

from .command import Command
from .options import PATH, examples, json_option
from .output import progress, show_result
from .workers import WorkerOptions, workers_options


@click.command(
    cls=Command,
    epilog=examples(
        "mirror demo -o demo-mirrored",
        "mirror demo/000000.json -o mirrored.json",
        "mirror demo -o demo-mirrored --labels twist",
    ),
)
@click.argument("path", type=PATH, metavar="DIR|FILE")
@click.option("-o", "--output", type=PATH, required=True, help="New folder, or new file.")
@click.option(
    "--labels",
    type=click.Choice(["stay", "twist"]),
    default="stay",
    help="Keep labels unchanged, or mirror labels that are twists, [vx, vy, omega].",
)
@workers_options
@json_option
def command(path: Path, output: Path, labels: str, workers: WorkerOptions) -> None:
    """Mirror a data set or an episode file left to right.

    Positions, headings and commands are mirrored exactly: mirroring twice with the same --labels gives the same bytes.
    """
    from sonata2d.datasets.manifest import read_manifest
    from sonata2d.datasets.transforms.mirror import mirror_dataset, mirror_file, twist_image

    label = twist_image if labels == "twist" else None
    if path.is_dir():
        with workers.started() as pool, progress(len(read_manifest(path)["files"]), "episodes") as advance:
            manifest = mirror_dataset(path, output, label=label, workers=pool, advance=advance)
        episodes = len(manifest["files"])
        frames = sum(row["ticks"] for row in manifest.get("shards") or manifest["files"])
    elif output.exists():
        raise click.UsageError(f"{output} already exists; give a new file name")
    else:
        episodes, frames = 1, len(mirror_file(path, output, label=label))
    result = {"output": str(output), "episodes": episodes, "frames": frames}
    show_result(result, f"{output}: {counted(episodes, 'episode')} mirrored, {counted(frames, 'frame')}")
