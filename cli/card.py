"""`sonata2d card`."""

from __future__ import annotations

from pathlib import Path

import click

from .output import json_option, progress, show_json


@click.command(epilog="Examples:  sonata2d card demo   ·   sonata2d card demo --no-figures")
@click.argument("folder", type=click.Path(path_type=Path), metavar="DIR")
@click.option("--figures/--no-figures", default=True, show_default=True, help="Draw how the episodes look.")
@click.option("--licence", metavar="NAME", help="Of the data.  [default: cc-by-4.0; other, if people are recorded]")
@json_option
def command(folder: Path, figures: bool, licence: str | None, as_json: bool) -> None:
    """Write a data set's card: README.md with figures and Hugging Face front matter, and Croissant metadata."""
    from sonata2d.datasets.full_card import FIGURES, write_card
    from sonata2d.datasets.manifest import CROISSANT, read_manifest

    with progress(len(read_manifest(folder)["files"]), "episodes") as advance:
        path = write_card(folder, figures=figures, licence=licence, advance=advance)
    written = {"card": str(path), "metadata": str(folder / CROISSANT)}
    written |= {"figures": str(folder / FIGURES)} if figures else {}
    if as_json:
        show_json(written)
    else:
        click.echo(", ".join(written.values()))
