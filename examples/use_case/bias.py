"""Measures how close to obstacles and people expert and learner drive, and how much their commands differ there.

    python examples/use_case/bias.py -o runs

The same scenes are run three times for each network: with the expert driving and the learner labelling, and with the
learner driving and the expert labelling, before and after data-set aggregation.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import click
import matplotlib
import numpy as np
from aggregate import short_scenario
from data import record_runs, run_command
from settings import BIAS_SEED, EXPERT, PRESET, SETTINGS, title_of

from sonata2d import Array, EpisodeRecord, read_episode
from sonata2d.core.geometry import Barriers
from sonata2d.datasets import read_manifest
from sonata2d.metrics import bootstrap_interval

matplotlib.use("Agg")
import matplotlib.pyplot as plt

NEAR = 0.1  # m, clearance below which the robot counts as near
EDGES = np.array([-0.1, 0.05, 0.1, 0.2, 0.3, 0.45, 0.6, 0.8, 1.0, 1.4, 2.0])  # m, lower edges of the bins of clearance
CLEARANCE, DIFFERENCE = 0, 1  # columns of the array of a run
CONTROLLERS = {  # driver and labeller; {before} and {after} are the learner's weights
    "expert": (EXPERT, "{before}"),
    "before": ("{before}", EXPERT),
    "after": ("{after}", EXPERT),
}
LEGEND = {"expert": "where the expert goes", "before": "where the learner goes", "after": "after aggregation"}
COLOURS = {"expert": "#0072b2", "before": "#d55e00", "after": "#009e73"}  # Okabe & Ito


def record_driver(out: Path, network: str, driver: str, workers: int) -> Path:
    """Record the labelled runs of one driver.

    Args:
        out: output folder of the use case.
        network: `paper` or `attention`.
        driver: key of `CONTROLLERS`.
        workers: number of processes.

    Returns:
        The folder of the data set.
    """
    weights = {"before": out / network / "policy.npz", "after": out / f"{network}-aggregated" / "policy.npz"}
    controller = "+".join(part.format(**weights) for part in CONTROLLERS[driver])
    folder = out / "bias" / f"{network}-{driver}"
    record_runs(controller, folder, short_scenario(PRESET), SETTINGS.bias, BIAS_SEED, workers)
    return folder


def measure_runs(folder: Path) -> list[Array]:
    """Measure the runs of a data set that have at least one frame.

    Returns:
        For each run (T, 2): clearance to the nearest person, object or wall, m, and mean squared difference of command
        and label, as fractions of the robot's limits.
    """
    files = [folder / row["name"] for row in read_manifest(folder)["files"]]
    return [_measure(record) for record in map(read_episode, files) if len(record)]


def _measure(record: EpisodeRecord) -> Array:
    scene = record.scene()
    limits = np.array([scene.robot.limits.ahead, scene.robot.limits.sideways, scene.robot.limits.turn])
    difference = (((np.array(record.labels, dtype=float) - record.command) / limits) ** 2).mean(axis=1)
    return np.column_stack((clearances(record, scene.barriers), difference))


def clearances(record: EpisodeRecord, barriers: Barriers) -> Array:
    """(T,), m, from the robot's outline to the nearest person, object or wall."""
    position, radius = record.robot[:, :2], record.scene().robot.radius
    gaps = barriers.gaps(position).min(axis=0) if len(barriers) else np.full(len(position), np.inf)
    for k, human in enumerate(record.scene().humans):
        human_gap = np.hypot(*(record.humans[:, k, :2] - position).T) - human.radius
        gaps = np.fmin(gaps, human_gap)  # rows of absent pedestrians are NaN, which fmin ignores
    return gaps - radius


def statistics(runs: list[Array]) -> dict[str, Any]:
    """Compute fractions of frames and mean squared differences, over all frames and by bin of clearance.

    Each run has the same weight, whatever its length. The keys are those of `bias.json`.
    """
    bins = [np.clip(np.digitize(run[:, CLEARANCE], EDGES) - 1, 0, len(EDGES) - 1) for run in runs]
    pairs = list(zip(runs, bins, strict=True))
    by_bin = [
        [run[index == edge, DIFFERENCE].mean() for run, index in pairs if (index == edge).any()]
        for edge in range(len(EDGES))
    ]
    return {
        "runs": len(runs),
        "near": mean_with_interval([(run[:, CLEARANCE] < NEAR).mean() for run in runs]),
        "difference": mean_with_interval([run[:, DIFFERENCE].mean() for run in runs]),
        "share": [float(np.mean([(index == edge).mean() for index in bins])) for edge in range(len(EDGES))],
        "by gap": [float(np.mean(values)) if len(values) >= SETTINGS.fewest_runs else None for values in by_bin],
    }


def mean_with_interval(values: list[float]) -> list[float]:
    """Return the mean, and the lower and upper end of its bootstrap interval."""
    interval = bootstrap_interval(np.array(values))
    assert interval is not None
    return [float(np.mean(values)), *interval]


def draw(results: dict[str, dict[str, Any]], path: Path) -> None:
    """Draw two panels for each network: fraction of frames and difference of the commands, by clearance."""
    figure, axes = plt.subplots(len(results), 2, figsize=(9, 3.2 * len(results)), squeeze=False, layout="constrained")
    positions = np.arange(len(EDGES))
    names = [f"{max(low, 0):g}" for low in EDGES]
    for (network, drivers), (left, right) in zip(results.items(), axes, strict=True):
        for k, (driver, numbers) in enumerate(drivers.items()):
            style = {"color": COLOURS[driver], "label": LEGEND[driver]}
            left.bar(positions + 0.27 * (k - 1), numbers["share"], 0.27, **style)
            differences = [np.nan if value is None else value for value in numbers["by gap"]]
            right.plot(positions, differences, "os^"[k] + "-", **style)
        left.set(ylabel=f"{title_of(network)}\nshare of frames")
        right.set(ylabel="mean squared difference\nof learner and expert", ylim=(0, None))
        for axis in (left, right):
            axis.set_xticks(positions, names)
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
    results: dict[str, dict[str, Any]] = {}
    for network in ("paper", "attention"):
        runs = {driver: measure_runs(record_driver(out, network, driver, workers)) for driver in CONTROLLERS}
        results[network] = {driver: statistics(measured) for driver, measured in runs.items()}
    (out / "bias.json").write_text(json.dumps({"edges": EDGES.tolist(), **results}, indent=1))
    draw(results, out / "bias.png")


if __name__ == "__main__":
    run_command(main)
