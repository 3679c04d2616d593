"""The data set that the paper's network learns from: kept runs of an expert and their mirror images, split by scene.

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
from tqdm import tqdm

from sonata2d.datasets.full_card import write_card
from sonata2d.datasets.generate import generate_dataset
from sonata2d.datasets.manifest import read_manifest
from sonata2d.datasets.merge import merge_datasets
from sonata2d.datasets.mirror import mirror_dataset
from sonata2d.datasets.mirror_image import twist_image
from sonata2d.datasets.split import split_dataset
from sonata2d.errors import RecordError, Sonata2dError
from sonata2d.record.reader import read_episode
from sonata2d.scenegen.scenario.config import ScenarioConfig
from sonata2d.scenegen.scenario.load import load_scenario

ROOMS = "sonata-2020"
KEPT = 3092  # trajectories, as in the paper
SEED = 2020
PARTS = {"train": 0.9, "dev": 0.05, "test": 0.05}


def make(out: Path, driver: str, episodes: int, seed: int, workers: int, added: tuple[Path, ...] = ()) -> Path:
    """Make the data set in `out/data`; what is there of it already is used.

    Args:
        out: folder for it and for what it is made from.
        driver: name of the controller.
        episodes: how many runs that reached the goal are kept.
        seed: of the scenes.
        workers: processes.
        added: data sets of others, such as what people drove in the window.

    Returns:
        Its folder.

    Raises:
        RecordError: `out/data` is there and was not made here, or a data set is damaged or made otherwise.
    """
    driven, data = out / "driven", out / "data"
    refuse_others(data)
    drive(driver, driven, load_scenario(ROOMS), episodes, seed, workers, keep=("goal",))
    originals = [driven, *added]
    shutil.rmtree(data, ignore_errors=True)
    with_mirrors(originals, data)
    split_dataset(data, PARTS)
    with bar("card", len(read_manifest(data)["files"])) as advance:
        write_card(data, advance=advance)
    return data


def drive(
    controller: str,
    folder: Path,
    scenario: ScenarioConfig,
    episodes: int,
    seed: int,
    workers: int,
    *,
    keep: tuple[str, ...] = (),
) -> None:
    """Runs of a controller in a scenario; what is there of them is used. The rest is as of `generate_dataset`."""
    with bar(f"runs of {folder.name}", episodes) as advance:
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


def refuse_others(data: Path) -> None:
    """Say before the work whether a folder that will be made anew holds something else.

    Raises:
        RecordError: it is there, and is no merged data set.
    """
    if data.exists() and not read_manifest(data).get("sources"):
        raise RecordError(f"{data} was not made here; name another folder by -o")


def with_mirrors(folders: list[Path], out: Path, label: Callable[[Any], Any] | None = None) -> None:
    """Data sets and their mirror images, together; twists that label frames are mirrored as commands are.

    Args:
        folders: complete data sets.
        out: a new folder.
        label: the image of a label, for all of them; unless given, each set's own labels tell.
    """
    with TemporaryDirectory(prefix="mirrors-", dir=out.parent) as place:
        twins = [Path(place, str(k), f"{folder.resolve().name}-mirrored") for k, folder in enumerate(folders)]
        for folder, twin in zip(folders, twins, strict=True):
            with bar("mirrors", len(read_manifest(folder)["files"])) as advance:
                mirror_dataset(folder, twin, label=label or label_image(folder), advance=advance)
        merge_datasets([*folders, *twins], out)


def label_image(folder: Path) -> Callable[[Any], Any] | None:
    """`twist_image` if frames of a data set are labelled with twists, as the loader learns these, not the commands."""
    for row in read_manifest(folder)["files"]:
        told = (frame.get("label") for frame in read_episode(folder / row["name"]).document["frames"])
        if any(isinstance(label, list) and len(label) == 3 for label in told):
            return twist_image
    return None


def run_cleanly(command: click.Command) -> None:
    """Run a script's command; what a user can mend is one line, and not a traceback."""
    try:
        command()
    except (Sonata2dError, ValueError, OSError) as error:
        raise SystemExit(f"Error: {error}") from error


@contextmanager
def bar(what: str, count: int) -> Iterator[Callable[[int], object]]:
    """A progress bar, quiet where nobody looks."""
    with tqdm(total=count, desc=what, disable=None) as shown:
        yield shown.update


@click.command()
@click.option("-o", "--out", type=click.Path(path_type=Path), default=Path("runs"), show_default=True)
@click.option("--driver", default="social-planner", show_default=True, help="human-like: an unsteady hand.")
@click.option("--episodes", type=click.IntRange(20), default=KEPT, show_default=True, help="Kept runs.")
@click.option("--seed", type=click.IntRange(0), default=SEED, show_default=True)
@click.option("--workers", type=click.IntRange(1), default=2, show_default=True)
@click.option("--add", "added", type=click.Path(path_type=Path, exists=True), multiple=True, help="Another data set.")
def main(out: Path, driver: str, episodes: int, seed: int, workers: int, added: tuple[Path, ...]) -> None:
    """Make the data set OUT/data: kept runs, their mirror images, a split by scene, a card."""
    out.mkdir(parents=True, exist_ok=True)
    click.echo(make(out, driver, episodes, seed, workers, added))


if __name__ == "__main__":
    run_cleanly(main)
