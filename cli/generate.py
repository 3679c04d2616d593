"""The command `sonata2d generate`."""

from __future__ import annotations

import shlex
import shutil
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import click

from sonata2d.core.wording import counted

from .command import Command, has_flag
from .controllers import controller_option
from .interrupts import exit_interrupted
from .options import PATH, compress_option, examples, json_option
from .output import echo, progress, show_json, show_table, wants_json
from .workers import WorkerOptions, workers_options


@click.command(
    cls=Command,
    epilog=examples(
        "generate demo",
        "generate out --controller ./polite.py:Polite --scenario sonata-2020-crowded --episodes 100",
        "generate successes --controller human-like --keep goal --episodes 100",
    ),
)
@click.argument("out", type=PATH)
@click.option("--scenario", default="sonata-2020", metavar="NAME|FILE", help="Scenario preset, or a scenario file.")
@controller_option
@click.option("--episodes", type=click.IntRange(1), default=20, help="Number of episodes.")
@click.option("--seed", type=click.IntRange(0), default=0, help="Seed of the data set.")
@workers_options
@click.option(
    "--keep",
    multiple=True,
    type=click.Choice(["goal", "timeout", "contact", "stopped", "regenerate"]),
    help="Keep only episodes with this outcome, and generate until --episodes are kept; may be repeated.",
)
@click.option(
    "--shard-size",
    type=click.IntRange(1),
    metavar="N",
    help="Write shards of N episodes, tar files in the layout of WebDataset.  [default: a file for each episode]",
)
@click.option(
    "--tables/--no-tables",
    default=None,
    help="Write tables of episodes and frames for Hugging Face datasets.  [default: if pyarrow is installed]",
)
@click.option("--resume", is_flag=True, help="Continue an interrupted data set.")
@click.option("--overwrite", is_flag=True, help="Replace the data set in OUT; other files stay.")
@compress_option
@click.option("--picture/--no-picture", default=True, help="Draw the first episode.")
@json_option
def command(
    out: Path,
    scenario: str,
    controller: str,
    episodes: int,
    workers: WorkerOptions,
    resume: bool,
    overwrite: bool,
    picture: bool,
    **options: Any,
) -> None:
    """Generate a data set in the new folder OUT: episodes, manifest and data card.

    The same scenario, controller, seed and number of episodes give the same bytes, regardless of workers and
    interruptions.
    """
    from sonata2d.datasets import generate_dataset
    from sonata2d.datasets.manifest import PREVIEW, stored_form
    from sonata2d.scenegen.scenario.load import load_scenario

    if resume and overwrite:
        raise click.UsageError("--resume continues a data set and --overwrite replaces it; give one of them")
    config = load_scenario(scenario)
    with workers.started() as pool, progress(episodes, "episodes") as advance, _hint_at_resume(out, overwrite):
        dataset = generate_dataset(
            out, config, controller, episodes=episodes, workers=pool, resume=resume, overwrite=overwrite,
            advance=advance, **options,
        )  # fmt: skip
    manifest = dataset.manifest
    assert manifest is not None
    first = out / manifest["files"][0]["name"]
    if picture:
        _draw(first, out / PREVIEW)
    if wants_json():
        show_json(stored_form(manifest))
    else:
        _show_summary(out, first, manifest, picture)


@contextmanager
def _hint_at_resume(out: Path, overwrite: bool) -> Iterator[None]:
    """On Ctrl-C and SIGTERM, explain how to continue."""
    try:
        yield
    except KeyboardInterrupt as error:
        from sonata2d.datasets.generate.run import how_to_continue
        from sonata2d.datasets.generate.start import has_episodes

        if not has_episodes(out):
            exit_interrupted(error, "; no episode is complete, run the same command again")
        exit_interrupted(error, f"; complete episodes are in {out}, {how_to_continue(overwrite=overwrite)}")


def _draw(episode: Path, picture: Path) -> None:
    from sonata2d.record.reader import read_episode
    from sonata2d.view.episode_files import render

    record = read_episode(episode)
    render(list(record.snapshots()), picture, outcome=record.outcome.status)


def _show_summary(out: Path, first: Path, manifest: dict[str, Any], picture: bool) -> None:
    """Print a summary of the data set, and a command to run next."""
    from sonata2d.datasets.manifest import PREVIEW
    from sonata2d.datasets.summaries import totals_of

    totals = totals_of(manifest["files"])
    outcomes = ", ".join(f"{count} {name}" for name, count in manifest["counts"]["outcome"].items())
    amount = f"{counted(totals.episodes, 'episode')} of {manifest['name']}, {counted(totals.frames, 'frame')}"
    echo(f"{out}: {amount}, {totals.bytes / 1e6:.1f} MB")
    rows: list[tuple[str, object]] = [("outcomes", outcomes), *totals.contacts.rows()]
    if "shards" in manifest:
        rows.append(("shards", f"{len(manifest['shards'])} of {manifest['shard_size']} episodes each"))
    if "left_out" in manifest:
        rows.append(("left out", ", ".join(f"{n} {name}" for name, n in manifest["left_out"].items()) or "none"))
    rows += [("manifest", out / "manifest.json"), ("data card", out / "README.md")]
    if picture:
        rows.append(("picture", out / PREVIEW))
    if not has_flag("quiet"):
        show_table(rows, indent="  ")
    program = "sonata2d" if shutil.which("sonata2d") else sys.argv[0]
    echo(f"next:  {program} render {shlex.quote(str(first))} -o {first.name.split('.')[0]}.html")
