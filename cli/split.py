"""`sonata2d split`."""

from __future__ import annotations

from pathlib import Path

import click

from .output import json_option, progress, show_json, show_table

_DEFAULT = "train=0.8,dev=0.1,test=0.1"


def _shares(ctx: click.Context, _: click.Parameter, text: str) -> dict[str, float]:
    """`train=0.8,test=0.2` as a dictionary."""
    shares: dict[str, float] = {}
    for piece in text.split(","):
        part, _equals, share = piece.partition("=")
        try:
            number = float(share)
        except ValueError:
            number = 0.0
        if not part.strip() or part.strip() in shares or not 0.0 < number < float("inf"):
            raise click.BadParameter(f"{piece!r} is no part=share, or is given twice; e.g. {_DEFAULT}")
        shares[part.strip()] = number
    return shares


@click.command(
    epilog="Examples:  sonata2d split demo   ·   sonata2d split demo --parts train=0.9,test=0.1 --whole-families"
)
@click.argument("folder", type=click.Path(path_type=Path), metavar="DIR")
@click.option("--parts", callback=_shares, default=_DEFAULT, show_default=True, help="Parts and their shares.")
@click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True, help="Another one: another split.")
@click.option("--whole-families", is_flag=True, help="Keep each kind of scene in one part.")
@json_option
def command(folder: Path, parts: dict[str, float], seed: int, whole_families: bool, as_json: bool) -> None:
    """Part a data set by scene family, in its manifest; files stay where they are.

    Runs of one scene stay together: mirror images beside their originals, branches, and whoever else drove there.
    """
    from sonata2d.datasets.manifest import read_manifest
    from sonata2d.datasets.split import split_dataset

    with progress(len(read_manifest(folder)["files"]), "episodes") as advance:
        split = split_dataset(folder, parts, seed=seed, whole_families=whole_families, advance=advance)
    if as_json:
        show_json({"folder": str(folder), "split": split})
    else:
        show_table((part, f"{len(names)} episodes") for part, names in split.items())
