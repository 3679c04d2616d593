"""The command `sonata2d split`."""

from __future__ import annotations

from pathlib import Path

import click

from sonata2d.core.wording import counted

from .command import Command
from .options import PATH, examples, json_option
from .output import progress, show_json, show_table, wants_json

_DEFAULT_PARTS = "train=0.8,dev=0.1,test=0.1"


def _fractions(ctx: click.Context, _: click.Parameter, text: str) -> dict[str, float]:
    """Parse `train=0.8,test=0.2`."""
    fractions: dict[str, float] = {}
    for piece in text.split(","):
        part, _equals, number = piece.partition("=")
        try:
            fraction = float(number)
        except ValueError:
            fraction = 0.0
        if not part.strip() or part.strip() in fractions or not 0.0 < fraction < float("inf"):
            raise click.BadParameter(
                f"{piece!r} is not of the form part=fraction, or is given twice; e.g. {_DEFAULT_PARTS}"
            )
        fractions[part.strip()] = fraction
    total = sum(fractions.values())
    if max(fractions.values()) < 1.0 and abs(total - 1.0) > 0.002:  # thirds may be rounded
        raise click.BadParameter(
            f"the fractions add up to {total:g} and not to 1; with whole numbers, as in train=8,test=2, the parts are"
            " in that proportion"
        )
    return fractions


@click.command(cls=Command, epilog=examples("split demo", "split demo --parts train=0.9,test=0.1 --whole-families"))
@click.argument("folder", type=PATH, metavar="DIR")
@click.option(
    "--parts",
    callback=_fractions,
    default=_DEFAULT_PARTS,
    help="Names of the parts, with fractions that add up to 1, or proportions such as train=8,test=2.",
)
@click.option("--seed", type=click.IntRange(min=0), default=0, help="Seed of the assignment.")
@click.option("--whole-families", is_flag=True, help="Keep all scenes of a family (one kind of room) in one part.")
@json_option
def command(folder: Path, parts: dict[str, float], seed: int, whole_families: bool) -> None:
    """Split a data set into parts, e.g. for training and testing.

    The parts are written into the manifest; files are not moved. All episodes of one scene stay in one part: mirror
    images, branches and runs of other controllers. The scenes of each family are distributed over all parts, unless
    --whole-families is given.
    """
    from sonata2d.datasets.manifest import read_manifest
    from sonata2d.datasets.transforms.split import split_dataset

    with progress(len(read_manifest(folder)["files"]), "episodes") as advance:
        names = split_dataset(folder, parts, seed=seed, whole_families=whole_families, advance=advance)
    if wants_json():
        show_json({"folder": str(folder), "split": names})
    else:
        show_table((f"{part}:", counted(len(episodes), "episode")) for part, episodes in names.items())
