"""Data-set aggregation (DAgger): the learner drives, the expert labels each tick, and the learner trains on the labels.

    python examples/use_case/aggregate.py --network paper -o runs

Source: S. Ross, G. Gordon & D. Bagnell, "A reduction of imitation learning and structured prediction to no-regret
online learning", AISTATS 2011.
"""

from __future__ import annotations

import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path

import click
from data import add_mirror_images, record_runs, run_command
from networks import NETWORKS
from settings import AGGREGATION_SEED, EXPERT, PRESET, SETTINGS, TIME_LIMIT
from train import train

from sonata2d import ScenarioConfig, load_scenario
from sonata2d.datasets import twist_image
from sonata2d.record.files import safe_text


def aggregate(
    name: str,
    start: Path,
    out: Path,
    data: Sequence[Path],
    *,
    scenarios: Mapping[str, int],
    expert: str = EXPERT,
    rounds: int = SETTINGS.rounds,
    epochs: int = SETTINGS.epochs,
    seed: int = AGGREGATION_SEED,
    workers: int = 1,
) -> Path:
    """Run rounds of data-set aggregation.

    Each round records runs of the last network, labelled by the expert, and continues its training on all data.

    Args:
        name: key of `NETWORKS`.
        start: folder of a trained network.
        out: folder for the network of the last round. Recorded runs and networks of earlier rounds are written beside
            it, to `{out}-met1`, `{out}-round1`, ...; recorded runs that exist are reused.
        data: data sets of the first training; the first one provides the dev and test parts.
        scenarios: names of the scenarios, and the number of runs in each per round.
        expert: name of the controller that labels.
        rounds: number of rounds.
        epochs: of training per round.
        seed: round k records scenes of seed `seed` + k.
        workers: number of processes.

    Returns:
        `out`.
    """
    data, network = [*data], start
    for k in range(1, rounds + 1):
        recorded, trained = (out.with_name(f"{out.name}-{kind}{k}") for kind in ("met", "round"))
        if not recorded.exists():
            record_scenarios(f"{network / 'policy.npz'}+{expert}", recorded, scenarios, seed + k, workers)
        data.append(recorded)
        network = train(name, data, out if k == rounds else trained, start=network, epochs=epochs)
    return network


def record_scenarios(controller: str, out: Path, scenarios: Mapping[str, int], seed: int, workers: int) -> None:
    """Record runs of a controller in several scenarios, and write them with their mirror images to one data set.

    Args:
        controller: name of the controller; a pair `driver+labeller` labels every frame.
        out: a new folder.
        scenarios: names of the scenarios, and the number of runs in each.
        seed: of the scenes.
        workers: number of processes.
    """
    folders = [out.with_name(f"{out.name}-{safe_text(scenario)}") for scenario in scenarios]
    for folder, (scenario, episodes) in zip(folders, scenarios.items(), strict=True):
        record_runs(controller, folder, short_scenario(scenario), episodes, seed, workers)
    add_mirror_images(folders, out, twist_image)
    for folder in folders:
        shutil.rmtree(folder)


def short_scenario(name: str) -> ScenarioConfig:
    """Load a scenario and set its time limit to `TIME_LIMIT`."""
    return load_scenario(name).changed(rules={"time_limit": TIME_LIMIT})


@click.command()
@click.option("--network", type=click.Choice(list(NETWORKS)), default="paper", show_default=True)
@click.option("-o", "--out", type=click.Path(path_type=Path, exists=True), default=Path("runs"), show_default=True)
@click.option("--rounds", type=click.IntRange(1), default=SETTINGS.rounds, show_default=True)
@click.option("--episodes", type=click.IntRange(1), default=SETTINGS.met, show_default=True, help="Runs per round.")
@click.option("--epochs", type=click.IntRange(1), default=SETTINGS.epochs, show_default=True, help="Epochs per round.")
@click.option("--workers", type=click.IntRange(1), default=1, show_default=True)
def main(network: str, out: Path, rounds: int, episodes: int, epochs: int, workers: int) -> None:
    """Improve the network in OUT/NETWORK by data-set aggregation; write OUT/NETWORK-aggregated."""
    target = out / f"{network}-aggregated"
    data, scenarios = [out / "data"], {PRESET: episodes}
    aggregate(network, out / network, target, data, scenarios=scenarios, rounds=rounds, epochs=epochs, workers=workers)
    click.echo(target / "policy.npz")


if __name__ == "__main__":
    run_command(main)
