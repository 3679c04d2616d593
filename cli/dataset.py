"""Commands on whole data sets: `check`, `mirror`, `split`, `merge` and `card`."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from sonata2d.core.wording import counted

from .command import Command
from .common import PATH, examples, json_option, note, progress, show_json, show_table
from .workers import WorkerOptions, workers_options

if TYPE_CHECKING:
    from sonata2d.datasets import Problem

MAX_PROBLEMS = 20  # problems printed by `check` without --json
DEFAULT_PARTS = "train=0.8,dev=0.1,test=0.1"


@click.command(cls=Command, epilog=examples("check demo", "check demo --replay --workers 2", "check demo/000000.json"))
@click.argument("path", type=PATH, metavar="DIR|FILE")
@click.option("--replay", is_flag=True, help="Also run the recorded commands again and compare every byte.")
@click.option("--rerun", is_flag=True, help="Also run the controller again and compare every byte.")
@click.option("--controller", metavar="NAME", help="Controller for --rerun, if not built in or renamed.")
@workers_options
@json_option
def check(path: Path, replay: bool, rerun: bool, controller: str | None, workers: WorkerOptions, as_json: bool) -> None:
    """Verify a data set or an episode file.

    Checks the schema, hashes, finite numbers, ids and physical plausibility, and that scenario.json, data card and
    Croissant metadata agree with the manifest; with --replay and --rerun also that the simulation reproduces the
    episodes. The exit code is 1 if there is a problem, and 0 if there are only warnings, such as unknown keys.
    """
    from sonata2d.datasets import verify
    from sonata2d.datasets.manifest import files_of

    files = files_of(path)
    with workers.started() as pool, progress(len(files), "files") as advance:
        problems = verify(
            path, replay=replay, rerun=rerun or controller is not None, controller=controller, workers=pool,
            advance=advance,
        )  # fmt: skip
    if as_json:
        rows = [{"file": p.file, "place": p.place, "message": p.message, "is_warning": p.is_warning} for p in problems]
        show_json({"files": len(files), "problems": rows})
    else:
        lines = _grouped(problems)
        for line in lines[:MAX_PROBLEMS]:
            click.echo(line)
        if len(lines) > MAX_PROBLEMS:
            click.echo(f"... and {len(lines) - MAX_PROBLEMS} more; --json prints all")
        refused = len({problem.file for problem in problems if problem.place == "physics"})
        how_many = f"{len(files) - refused} of them " if refused else ""
        done = "".join([f", {how_many}replayed" if replay else "", f", {how_many}rerun" if rerun else ""])
        count = sum(not problem.is_warning for problem in problems)
        warnings = f", {counted(len(problems) - count, 'warning')}" if len(problems) > count else ""
        found = counted(count, "problem") if count else "no problems"
        note(f"{path}: {counted(len(files), 'file')} checked{done}, {found}{warnings}")
    if any(not problem.is_warning for problem in problems):
        raise click.exceptions.Exit(1)


def _grouped(problems: Iterable[Problem]) -> list[str]:
    """One line per problem; a problem that several files have is one line, which names the first of them."""
    files: dict[Problem, list[str]] = {}
    for problem in problems:
        files.setdefault(replace(problem, file=""), []).append(problem.file)
    return [
        str(replace(problem, file=first + (f" and {counted(len(others), 'other file')}" if others else "")))
        for problem, (first, *others) in files.items()
    ]


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
def mirror(path: Path, output: Path, labels: str, workers: WorkerOptions, as_json: bool) -> None:
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
    if as_json:
        show_json({"output": str(output), "episodes": episodes, "frames": frames})
    else:
        note(f"{output}: {counted(episodes, 'episode')} mirrored, {counted(frames, 'frame')}")


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
                f"{piece!r} is not of the form part=fraction, or is given twice; e.g. {DEFAULT_PARTS}"
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
    default=DEFAULT_PARTS,
    help="Names of the parts, with fractions that add up to 1, or proportions such as train=8,test=2.",
)
@click.option("--seed", type=click.IntRange(min=0), default=0, help="Seed of the assignment.")
@click.option("--whole-families", is_flag=True, help="Keep all scenes of a family (one kind of room) in one part.")
@json_option
def split(folder: Path, parts: dict[str, float], seed: int, whole_families: bool, as_json: bool) -> None:
    """Split a data set into parts, e.g. for training and testing.

    The parts are written into the manifest; files are not moved. All episodes of one scene stay in one part: mirror
    images, branches and runs of other controllers. The scenes of each family are distributed over all parts, unless
    --whole-families is given.
    """
    from sonata2d.datasets import split_dataset
    from sonata2d.datasets.manifest import read_manifest

    with progress(len(read_manifest(folder)["files"]), "episodes") as advance:
        names = split_dataset(folder, parts, seed=seed, whole_families=whole_families, advance=advance)
    if as_json:
        show_json({"folder": str(folder), "split": names})
    else:
        show_table((f"{part}:", counted(len(own), "episode")) for part, own in names.items())


@click.command(cls=Command, epilog=examples("merge demo demo-mirrored -o both", "merge a b c -o all --json"))
@click.argument("folders", type=PATH, metavar="DIR...", nargs=-1, required=True)
@click.option("-o", "--output", type=PATH, required=True, help="New folder.")
@json_option
def merge(folders: tuple[Path, ...], output: Path, as_json: bool) -> None:
    """Merge two or more data sets into a new one.

    Episode files are copied unchanged; the manifest keeps settings and seed of each source.
    """
    from sonata2d.datasets import merge_datasets
    from sonata2d.datasets.manifest import read_manifest

    with progress(sum(len(read_manifest(folder)["files"]) for folder in folders), "episodes") as advance:
        manifest = merge_datasets(folders, output, advance=advance)
    sources = [source["name"] for source in manifest["sources"]]
    if as_json:
        show_json({"output": str(output), "episodes": manifest["episodes"], "sources": sources})
    else:
        note(f"{output}: {manifest['episodes']} episodes of {', '.join(sources)}")


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
def card(folder: Path, as_json: bool, **statements: Any) -> None:
    """Write the data card of a data set.

    The card is README.md, with the metadata that Hugging Face reads, and croissant.json, with Croissant metadata. What
    is stated once, such as a licence or a date, stays until another value is given. A card that was edited is replaced.
    """
    from sonata2d.datasets import CROISSANT, write_card

    written = {"card": str(write_card(folder, **statements)), "metadata": str(folder / CROISSANT)}
    if as_json:
        show_json(written)
    else:
        note(", ".join(written.values()))
