"""`sonata2d generate`."""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import click

from .controllers import NAMES
from .output import json_option, progress, show_json, show_table

PREVIEW = "preview.png"


@click.command(
    epilog="Examples:  sonata2d generate demo   ·   "
    "sonata2d generate out --controller ./polite.py:Polite --scenario office.yaml --episodes 100 --seed 7 --workers 2"
    "   ·   sonata2d generate successes --controller human-like --keep goal --episodes 100"
)
@click.argument("out", type=click.Path(path_type=Path))
@click.option(
    "--scenario", default="sonata-2020", show_default=True, metavar="NAME|FILE", help="What scenes look like."
)
@click.option(
    "--controller",
    default="social-planner",
    show_default=True,
    metavar="NAME",
    help=f"Drives the robot and labels the frames. {NAMES}",
)
@click.option("--episodes", type=click.IntRange(1), default=20, show_default=True, help="How many.")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="Of the whole data set.")
@click.option(
    "--workers", type=click.IntRange(1, 256), default=min(2, os.cpu_count() or 1), show_default=True, help="Processes."
)
@click.option(
    "--keep",
    multiple=True,
    type=click.Choice(["goal", "timeout", "contact", "stopped", "regenerate"]),
    help="Keep only episodes that ended so, and make more until there are as many as asked for; may be repeated.",
)
@click.option("--resume", is_flag=True, help="Go on with a data set that was interrupted.")
@click.option(
    "--compress", type=click.Choice(["none", "gz", "zst"]), default="none", show_default=True, help="How to pack files."
)
@click.option("--picture/--no-picture", default=True, show_default=True, help="Draw the first episode.")
@json_option
def command(
    out: Path,
    scenario: str,
    controller: str,
    episodes: int,
    seed: int,
    workers: int,
    keep: tuple[str, ...],
    resume: bool,
    compress: str,
    picture: bool,
    as_json: bool,
) -> None:
    """Make a data set in the folder OUT: episodes, manifest, data card.

    The same scenario, controller, seed and number give the same bytes, whatever the workers and interruptions.
    """
    from sonata2d.datasets.generate import generate_dataset
    from sonata2d.scenegen.scenario.load import load_scenario

    suffix = ".json" if compress == "none" else f".json.{compress}"
    config = load_scenario(scenario)
    with progress(episodes, "episodes") as advance, _hint_at_resume(out):
        manifest = generate_dataset(
            out,
            config,
            controller,
            episodes=episodes,
            seed=seed,
            workers=workers,
            keep=keep,
            resume=resume,
            suffix=suffix,
            advance=advance,
        )
    first = out / manifest["files"][0]["name"]
    if picture:
        _draw(first, out / PREVIEW)
    if as_json:
        show_json(manifest)
    else:
        _tell(out, first, manifest, picture)


@contextmanager
def _hint_at_resume(out: Path) -> Iterator[None]:
    """Say what stays when a person breaks off, and how to go on."""
    try:
        yield
    except KeyboardInterrupt:
        click.echo(f"\ninterrupted; whole episodes stay in {out}, the same command with --resume goes on", err=True)
        sys.exit(130)


def _draw(episode: Path, picture: Path) -> None:
    """Draw one episode of the data set."""
    from sonata2d.record.reader import read_episode
    from sonata2d.view.files import render

    record = read_episode(episode)
    render(list(record.snapshots()), picture, outcome=record.outcome.status)


def _tell(out: Path, first: Path, manifest: dict[str, Any], picture: bool) -> None:
    """What was made, and what to do with it."""
    files = manifest["files"]
    outcomes = ", ".join(f"{count} {name}" for name, count in manifest["counts"]["outcome"].items())
    size = sum(file["bytes"] for file in files) / 1e6
    click.echo(
        f"{out}: {len(files)} episodes of {manifest['name']}, {sum(f['ticks'] for f in files)} frames, {size:.1f} MB"
    )
    rows: list[tuple[str, object]] = [("outcomes", outcomes)]
    if "left_out" in manifest:
        rows.append(("left out", ", ".join(f"{n} {name}" for name, n in manifest["left_out"].items()) or "none"))
    rows += [("manifest", out / "manifest.json"), ("data card", out / "README.md")]
    if picture:
        rows.append(("picture", out / PREVIEW))
    show_table(rows, indent="  ")
    program = "sonata2d" if shutil.which("sonata2d") else sys.argv[0]
    click.echo(f"next:  {program} render {first} -o {first.name.split('.')[0]}.html")
