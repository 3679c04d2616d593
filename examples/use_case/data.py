"""The data set for training: runs of an expert that reached the goal, with mirror images, split by scene.

python examples/use_case/data.py -o runs
python examples/use_case/data.py -o runs --add my-recordings
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import click
from settings import DATA_SEED, EXPERT, PARTS, PRESET, SETTINGS
from tqdm import tqdm

from sonata2d import ScenarioConfig, Sonata2dError, generate_dataset, load_scenario, read_episode
from sonata2d.datasets import merge_datasets, mirror_dataset, read_manifest, split_dataset, twist_image, write_card
from sonata2d.errors import RecordError

LabelImage = Callable[[Any], Any]


def make_dataset(out: Path, driver: str, episodes: int, seed: int, workers: int, added: tuple[Path, ...] = ()) -> Path:
    """Record runs, add their mirror images, split the result, and write its card.

    Args:
        out: the runs are recorded into `out/driven`, where an interrupted recording is continued; `out/data` is
            written anew.
        driver: name of the controller.
        episodes: number of runs that reach the goal; other runs are not kept.
        seed: of the scenes.
        workers: number of processes.
        added: further data sets to include, such as runs that people drove in the window.

    Returns:
        `out/data`.

    Raises:
        RecordError: `out/data` exists and was not made by this function, `out/driven` has other settings, or a data set
            is damaged.
    """
    driven, data = out / "driven", out / "data"
    check_replaceable(data)
    record_runs(driver, driven, load_scenario(PRESET), episodes, seed, workers, keep=("goal",))
    originals = [driven, *added]
    shutil.rmtree(data, ignore_errors=True)
    add_mirror_images(originals, data)
    split_dataset(data, PARTS)
    write_card(data)
    return data


def record_runs(
    controller: str,
    folder: Path,
    scenario: ScenarioConfig,
    episodes: int,
    seed: int,
    workers: int,
    *,
    keep: tuple[str, ...] = (),
) -> None:
    """Record runs with a progress bar, or the missing ones if the folder exists; arguments as `generate_dataset`."""
    with progress_bar(f"runs of {folder.name}", episodes) as advance:
        generate_dataset(
            folder,
            scenario,
            controller,
            episodes=episodes,
            seed=seed,
            workers=workers,
            keep=keep,
            resume=folder.exists(),
            suffix=".json.zst",
            advance=advance,
        )


def check_replaceable(data: Path) -> None:
    """Check, before any work is done, that a folder may be replaced.

    Raises:
        RecordError: the folder exists and is not a merged data set.
    """
    if data.exists() and not read_manifest(data).get("sources"):
        raise RecordError(f"{data} was not made by this script; choose another output folder with -o")


def add_mirror_images(folders: list[Path], out: Path, label_image: LabelImage | None = None) -> None:
    """Merge data sets and their mirror images into one data set, the originals first.

    Args:
        folders: complete data sets.
        out: a new folder.
        label_image: mirrors one label, in all data sets. By default, twists are mirrored as commands are, and other
            labels are left to `mirror_dataset`.
    """
    with TemporaryDirectory(prefix="mirrors-", dir=out.parent) as temporary:
        # Data sets of one name stay apart: each mirror image has a numbered folder.
        mirrored = [Path(temporary, str(k), f"{folder.resolve().name}-mirrored") for k, folder in enumerate(folders)]
        for folder, target in zip(folders, mirrored, strict=True):
            with progress_bar("mirrors", len(read_manifest(folder)["files"])) as advance:
                mirror_dataset(folder, target, label=label_image or label_image_of(folder), advance=advance)
        merge_datasets([*folders, *mirrored], out)


def label_image_of(folder: Path) -> LabelImage | None:
    """Return `twist_image` if frames of a data set are labelled with twists, which the loader prefers to commands."""
    for row in read_manifest(folder)["files"]:
        labels = (frame.get("label") for frame in read_episode(folder / row["name"]).document["frames"])
        if any(isinstance(label, list) and len(label) == 3 for label in labels):
            return twist_image
    return None


def run_command(command: click.Command) -> None:
    """Run the command of a script; errors that a user can correct are printed without a traceback."""
    try:
        command()
    except (Sonata2dError, ValueError, OSError) as error:
        raise SystemExit(f"Error: {error}") from error


@contextmanager
def progress_bar(description: str, count: int) -> Iterator[Callable[[int], object]]:
    """Show a progress bar of `count` steps, on a terminal only; yields the function that advances it."""
    with tqdm(total=count, desc=description, disable=None) as bar:
        yield bar.update


@click.command()
@click.option("-o", "--out", type=click.Path(path_type=Path), default=Path("runs"), show_default=True)
@click.option(
    "--driver",
    default=EXPERT,
    show_default=True,
    help="Controller that drives; human-like: the expert with human delay and noise.",
)
@click.option(
    "--episodes",
    type=click.IntRange(20),
    default=SETTINGS.episodes,
    show_default=True,
    help="Number of runs that reach the goal.",
)
@click.option("--seed", type=click.IntRange(0), default=DATA_SEED, show_default=True)
@click.option("--workers", type=click.IntRange(1), default=2, show_default=True)
@click.option(
    "--add",
    "added",
    type=click.Path(path_type=Path, exists=True),
    multiple=True,
    help="Include another data set; may be repeated.",
)
def main(out: Path, driver: str, episodes: int, seed: int, workers: int, added: tuple[Path, ...]) -> None:
    """Make the data set OUT/data: runs that reached the goal, mirror images, a split by scene, and a card."""
    out.mkdir(parents=True, exist_ok=True)
    click.echo(make_dataset(out, driver, episodes, seed, workers, added))


if __name__ == "__main__":
    run_command(main)
