"""Data-set aggregation: the learner drives, the expert says what it would have done there, and the learner learns that.

    python examples/use_case/aggregate.py --network paper -o runs

Source: DAgger, S. Ross, G. Gordon & D. Bagnell, "A reduction of imitation learning and structured prediction to
no-regret online learning", AISTATS 2011.
"""

from __future__ import annotations

import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path

import click
from data import ROOMS, drive, run_cleanly, with_mirrors
from networks import NETWORKS
from train import train

from sonata2d.datasets.mirror_image import twist_image
from sonata2d.record.files import safe_text
from sonata2d.scenegen.scenario.config import ScenarioConfig
from sonata2d.scenegen.scenario.load import load_scenario

ROUNDS, EPISODES, EPOCHS = 2, 300, 8
SEED = 3000
LONGEST = 30.0  # s: whoever is lost for so long is lost
EXPERT = "social-planner"


def aggregate(
    name: str,
    start: Path,
    into: Path,
    data: Sequence[Path],
    *,
    scenarios: Mapping[str, int],
    expert: str = EXPERT,
    rounds: int = ROUNDS,
    epochs: int = EPOCHS,
    seed: int = SEED,
    workers: int = 1,
) -> Path:
    """Let a learner drive and learn of it, round after round.

    Args:
        name: of `NETWORKS`.
        start: folder of the trained network.
        into: folder for the last round's; those of the rounds before, and what was met, stand beside it.
        data: what it has learned from so far; its dev and test parts are the first one's.
        scenarios: where it drives, and how many runs in each.
        expert: name of the controller that tells what should have been done.
        rounds, epochs: how often, and how long to learn from it.
        seed: of the scenes before the first round's.
        workers: processes.

    Returns:
        `into`.
    """
    data, last = [*data], start
    for k in range(1, rounds + 1):
        met, after = (into.with_name(f"{into.name}-{what}{k}") for what in ("met", "round"))
        if not met.exists():
            met_by(f"{last / 'policy.npz'}+{expert}", met, scenarios, seed + k, workers)
        data.append(met)
        last = train(name, data, into if k == rounds else after, start=last, epochs=epochs)
    return last


def met_by(controller: str, out: Path, scenarios: Mapping[str, int], seed: int, workers: int) -> None:
    """What a controller meets in some scenarios, so many runs in each, with its mirror image."""
    places = [out.with_name(f"{out.name}-{safe_text(scenario)}") for scenario in scenarios]
    for place, (scenario, episodes) in zip(places, scenarios.items(), strict=True):
        drive(controller, place, cut_short(scenario), episodes, seed, workers)
    with_mirrors(places, out, twist_image)
    for place in places:
        shutil.rmtree(place)


def cut_short(scenario: str) -> ScenarioConfig:
    """A scenario by its name, in which runs are left sooner."""
    return load_scenario(scenario).changed(rules={"time_limit": LONGEST})


@click.command()
@click.option("--network", type=click.Choice(list(NETWORKS)), default="paper", show_default=True)
@click.option("-o", "--out", type=click.Path(path_type=Path, exists=True), default=Path("runs"), show_default=True)
@click.option("--rounds", type=click.IntRange(1), default=ROUNDS, show_default=True)
@click.option("--episodes", type=click.IntRange(1), default=EPISODES, show_default=True, help="A round.")
@click.option("--epochs", type=click.IntRange(1), default=EPOCHS, show_default=True, help="A round.")
@click.option("--workers", type=click.IntRange(1), default=1, show_default=True)
def main(network: str, out: Path, rounds: int, episodes: int, epochs: int, workers: int) -> None:
    """Let the network in OUT/NETWORK drive, and train it on what the expert says of that: OUT/NETWORK-aggregated."""
    into = out / f"{network}-aggregated"
    data, scenarios = [out / "data"], {ROOMS: episodes}
    aggregate(network, out / network, into, data, scenarios=scenarios, rounds=rounds, epochs=epochs, workers=workers)
    click.echo(into / "policy.npz")


if __name__ == "__main__":
    run_cleanly(main)
