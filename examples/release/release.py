"""Makes the files of a release: data sets in shards with tables and cards, weights, checksums, and a record for Zenodo.

    pip install -e '.[hub]'
    python examples/release/release.py -o release --creator "The sonata2d developers" --date 2026-12-01
    python examples/release/release.py -o small --episodes 200 --creator Lab --date 2026-12-01    # a trial

Finished parts stay, and an interrupted data set is continued. `--use-case DIR` adds the data and policies of the output
folder of `examples/use_case/run.py`. Nothing is uploaded: `sonata2d push release/rooms OWNER/NAME` does that.
"""

from __future__ import annotations

import json
import shutil
from concurrent.futures import Executor
from importlib.resources import files
from pathlib import Path

import click

import sonata2d as s2
from sonata2d.datasets import merge_datasets, split_dataset, verify, write_card
from sonata2d.datasets.check.replay import check_replay
from sonata2d.metrics.situations import SITUATIONS
from sonata2d.record.files import sha256_of
from sonata2d.scenegen import scenario_names

SHARES = {"rooms": ("sonata-2020", 0.5), "lively": ("lively", 0.3), "crowded": ("sonata-2020-crowded", 0.1)}
SITUATIONS_SHARE = 0.1  # of the data set `situations`, over all presets that show one
WEIGHTS = {
    "graph-policy.npz": "sonata2d.learning/pretrained/graph-policy.npz",
    "ppo.npz": "sonata2d.benchmark/ppo.npz",
    "attention.npz": "sonata2d.benchmark/attention.npz",
    "r-gcn.npz": "sonata2d.benchmark/r-gcn.npz",
}
SHARD, SEED, REPLAYED = 1000, 20_26, 5


def generated(folder: Path, scenario: str, episodes: int, workers: int | Executor) -> Path:
    """A data set of a scenario, in shards; it is continued if it exists."""
    is_begun = (folder / "manifest.json").exists()
    s2.generate_dataset(
        folder, scenario, episodes=episodes, seed=SEED, shard_size=SHARD, suffix=".json.zst", resume=is_begun,
        workers=workers, progress=True, tables=False,
    )  # fmt: skip
    return folder


def finished(folder: Path, **statements: str) -> None:
    """Split a data set, write its card and tables, and run some episodes again.

    Raises:
        ClickException: the data set is damaged.
    """
    split_dataset(folder, seed=SEED)
    write_card(folder, licence="cc-by-4.0", **statements)  # type: ignore[arg-type]
    problems = [problem for problem in verify(folder) if not problem.is_warning]
    dataset = s2.Dataset(folder)
    for k in range(REPLAYED):
        problems += check_replay(dataset[k * (len(dataset) - 1) // (REPLAYED - 1)])
    if problems:
        raise click.ClickException(f"{folder}: {problems[0]}")


@click.command()
@click.option("-o", "--output", "out", type=click.Path(path_type=Path), default=Path("release"), show_default=True)
@click.option("--episodes", type=click.IntRange(100), default=100_000, show_default=True, help="Of all data sets.")
@click.option("--workers", type=click.IntRange(1), default=2, show_default=True)
@click.option("--creator", required=True, metavar="NAME", help="Who makes the release.")
@click.option("--date", required=True, metavar="YYYY-MM-DD", help="Date of publication.")
@click.option("--use-case", type=click.Path(path_type=Path, exists=True), help="Output of examples/use_case/run.py.")
def main(out: Path, episodes: int, workers: int, creator: str, date: str, use_case: Path | None) -> None:
    """Write the files of a release into a folder."""
    folders = [
        generated(out / name, scenario, round(share * episodes), workers)
        for name, (scenario, share) in SHARES.items()
    ]  # fmt: skip
    shown = sorted(set(SITUATIONS) & set(scenario_names()))
    count = max(2, round(SITUATIONS_SHARE * episodes / len(shown)))
    if not (out / "situations").exists():
        parts = [generated(out / "parts" / name, name, count, workers) for name in shown]
        merge_datasets(parts, out / "situations")
        shutil.rmtree(out / "parts")
    for folder in (*folders, out / "situations"):
        finished(folder, creator=creator, date=date)
        click.echo(f"{folder}: {len(s2.Dataset(folder))} episodes")
    (out / "weights").mkdir(exist_ok=True)
    for name, place in WEIGHTS.items():
        package, _, path = place.partition("/")
        (out / "weights" / name).write_bytes(files(package).joinpath(path).read_bytes())
    if use_case is not None:
        for name in ("data", "paper", "attention"):
            shutil.copytree(use_case / name, out / "use-case" / name, dirs_exist_ok=True)
    record = {
        "title": f"Social-navigation data sets of sonata2d {s2.__version__}",
        "description": f"{episodes} episodes of a robot among simulated pedestrians, in shards and tables; "
        "weights of policies. The same seed gives the same bytes: sonata2d replays each episode.",
        "upload_type": "dataset", "publication_date": date, "license": "cc-by-4.0", "access_right": "open",
        "creators": [{"name": creator}], "keywords": ["social navigation", "robotics", "pedestrian simulation"],
    }  # fmt: skip
    (out / ".zenodo.json").write_text(json.dumps(record, indent=2) + "\n")
    names = sorted(path for path in out.rglob("*") if path.is_file() and path.name not in ("SHA256SUMS", "run.jsonl"))
    sums = "".join(f"{sha256_of(path)}  {path.relative_to(out).as_posix()}\n" for path in names)
    (out / "SHA256SUMS").write_text(sums)
    click.echo(f"{out}: {len(names)} files, {sum(path.stat().st_size for path in names) / 1e9:.2f} GB")


if __name__ == "__main__":
    main()
