"""The command `sonata2d card`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from .command import Command
from .options import PATH, examples, json_option
from .output import show_result


@click.command(
    cls=Command,
    epilog=examples("card demo", "card demo --licence mit", "card demo --date 2026-05-01 --creator Lab --organisation"),
)
@click.argument("folder", type=PATH, metavar="DIR")
@click.option("--licence", metavar="NAME", help="Licence of the data.  [default: cc-by-4.0; other for recorded people]")
@click.option("--date", metavar="YYYY-MM-DD", help="Date of publication.")
@click.option("--data-version", "version", metavar="X.Y.Z", help="Version of the data set.  [default: 1.0.0]")
@click.option("--creator", metavar="NAME", help="Person or organisation that made the data set.")
@click.option("--organisation/--person", default=None, help="Kind of the creator.  [default: person]")
@click.option("--url", metavar="URL", help="Page of the data set.")
@json_option
def command(folder: Path, **statements: Any) -> None:
    """Write the data card of a data set.

    The card is README.md, with the metadata that Hugging Face reads, and croissant.json, with Croissant metadata. A
    licence, a date and other statements stay until another value is given. A card that was edited is replaced.
    """
    from sonata2d.datasets import CROISSANT, write_card

    written = {"card": str(write_card(folder, **statements)), "metadata": str(folder / CROISSANT)}
    show_result(written, ", ".join(written.values()))
