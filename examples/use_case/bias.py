"""Where learner and expert part: how near to things and people they drive, and how far apart their answers are there.

    python examples/use_case/bias.py -o runs

Three sets of the same scenes for each network: the expert drives and the learner says what it would have done; the
learner drives, as it was before and as it is after aggregation, and the expert says it.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import click
import matplotlib
import numpy as np
from aggregate import cut_short
from data import ROOMS, drive, run_cleanly

from sonata2d.core.geometry import Barriers
from sonata2d.datasets.manifest import read_manifest
from sonata2d.metrics.summary import bootstrap_interval
from sonata2d.record.reader import read_episode
from sonata2d.record.record import EpisodeRecord

matplotlib.use("Agg")
import matplotlib.pyplot as plt

EPISODES, SEED = 60, 4000
NEAR = 0.1  # m
FEWEST = 10  # runs, else nothing is told
EDGES = np.array([-0.1, 0.05, 0.1, 0.2, 0.3, 0.45, 0.6, 0.8, 1.0, 1.4, 2.0])  # m, of gaps
WHO = {
    "expert": ("social-planner", "{before}"),
    "before": ("{before}", "social-planner"),
    "after": ("{after}", "social-planner"),
}
NAMES = {"expert": "where the expert goes", "before": "where the learner goes", "after": "after aggregation"}
COLOURS = {"expert": "#0072b2", "before": "#d55e00", "after": "#009e73"}  # Okabe & Ito


def driven(out: Path, network: str, who: str, workers: int) -> Path:
    """A set of runs in which both say what to do."""
    policies = {"before": out / network / "policy.npz", "after": out / f"{network}-aggregated" / "policy.npz"}
    controller = "+".join(part.format(**policies) for part in WHO[who])
    folder = out / "bias" / f"{network}-{who}"
    drive(controller, folder, cut_short(ROOMS), EPISODES, SEED, workers)
    return folder


def runs_of(folder: Path) -> list[Any]:
    """Of each run (T, 2): gap to the nearest person, thing or wall, m, and mean squared difference of the answers."""
    files = [folder / row["name"] for row in read_manifest(folder)["files"]]
    return [_rows(record) for record in map(read_episode, files) if len(record)]


def _rows(record: EpisodeRecord) -> Any:
    scene = record.scene()
    limits = np.array([scene.robot.limits.ahead, scene.robot.limits.sideways, scene.robot.limits.turn])
    apart = (((np.array(record.labels, dtype=float) - record.command) / limits) ** 2).mean(axis=1)
    return np.column_stack((gaps_of(record, scene.barriers), apart))


def gaps_of(record: EpisodeRecord, barriers: Barriers) -> Any:
    """(T,), m."""
    place, radius = record.robot[:, :2], record.scene().robot.radius
    gaps = barriers.gaps(place).min(axis=0) if len(barriers) else np.full(len(place), np.inf)
    for k, human in enumerate(record.scene().humans):
        away = np.hypot(*(record.humans[:, k, :2] - place).T) - human.radius
        gaps = np.fmin(gaps, away)
    return gaps - radius


def told(runs: list[Any]) -> dict[str, Any]:
    """Shares of frames and mean squared differences, by gap and over all; each run counts alike, however long."""
    at = [np.clip(np.digitize(rows[:, 0], EDGES) - 1, 0, len(EDGES) - 1) for rows in runs]
    pairs = list(zip(runs, at, strict=True))
    there = [[rows[k == edge, 1].mean() for rows, k in pairs if (k == edge).any()] for edge in range(len(EDGES))]
    return {
        "runs": len(runs),
        "near": with_interval([(rows[:, 0] < NEAR).mean() for rows in runs]),
        "difference": with_interval([rows[:, 1].mean() for rows in runs]),
        "share": [float(np.mean([(k == edge).mean() for k in at])) for edge in range(len(EDGES))],
        "by gap": [float(np.mean(values)) if len(values) >= FEWEST else None for values in there],
    }


def with_interval(values: list[float]) -> list[float]:
    """Mean, and the ends of its bootstrap interval over runs."""
    interval = bootstrap_interval(np.array(values))
    assert interval is not None
    return [float(np.mean(values)), *interval]


def draw(found: dict[str, dict[str, Any]], path: Path) -> None:
    """Two panels a network: where they are, and how far their answers are apart there."""
    figure, axes = plt.subplots(len(found), 2, figsize=(9, 3.2 * len(found)), squeeze=False, layout="constrained")
    places = np.arange(len(EDGES))
    names = [f"{max(low, 0):g}" for low in EDGES]
    for (network, sets), (left, right) in zip(found.items(), axes, strict=True):
        for k, (who, numbers) in enumerate(sets.items()):
            left.bar(places + 0.27 * (k - 1), numbers["share"], 0.27, color=COLOURS[who], label=NAMES[who])
            apart = [np.nan if value is None else value for value in numbers["by gap"]]
            right.plot(places, apart, "os^"[k] + "-", color=COLOURS[who], label=NAMES[who])
        left.set(ylabel=f"{network}\nshare of frames")
        right.set(ylabel="mean squared difference\nof learner and expert", ylim=(0, None))
        for axis in (left, right):
            axis.set_xticks(places, names)
            axis.set_xlabel("gap to the nearest person, thing or wall, from m on")
            axis.spines[["top", "right"]].set_visible(False)
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper center", ncols=3, frameon=False)
    figure.savefig(path, dpi=110)
    plt.close(figure)


@click.command()
@click.option("-o", "--out", type=click.Path(path_type=Path, exists=True), default=Path("runs"), show_default=True)
@click.option("--workers", type=click.IntRange(1), default=2, show_default=True)
def main(out: Path, workers: int) -> None:
    """Write OUT/bias.json and draw OUT/bias.png."""
    found = {
        network: {who: told(runs_of(driven(out, network, who, workers))) for who in WHO}
        for network in ("paper", "attention")
    }
    (out / "bias.json").write_text(json.dumps({"edges": EDGES.tolist(), **found}, indent=1))
    draw(found, out / "bias.png")


if __name__ == "__main__":
    run_cleanly(main)
