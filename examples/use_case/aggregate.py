"""Data-set aggregation: the learner drives, the expert says what it would have done there, and the learner learns that.

    python examples/use_case/aggregate.py --network paper -o runs

Source: DAgger, S. Ross, G. Gordon & D. Bagnell, "A reduction of imitation learning and structured prediction to
no-regret online learning", AISTATS 2011.
"""

from __future__ import annotations

import shutil
from pathlib import Path

import click
from data import bar, with_mirrors
from networks import NETWORKS
from train import train

from sonata2d.batch import generate_dataset
from sonata2d.scenegen import ScenarioConfig, load_scenario
from sonata2d.transforms import twist_image

ROUNDS, EPISODES = 3, 600
SEED = 3000
LONGEST = 30.0  # s: whoever is lost for so long is lost


def aggregate(name: str, out: Path, *, rounds: int, episodes: int, epochs: int | None, workers: int) -> None:
    """Round after round from `out/{name}` on; the last is `out/{name}-aggregated`."""
    data, last = [out / "data"], out / name
    for k in range(1, rounds + 1):
        met = out / f"{name}-met{k}"
        if not met.exists():
            meet(last / "policy.npz", met, episodes=episodes, seed=SEED + k, workers=workers)
        data.append(met)
        after = out / (f"{name}-aggregated" if k == rounds else f"{name}-round{k}")
        train(name, data, after, start=last, epochs=epochs)
        last = after


def meet(policy: Path, out: Path, *, episodes: int, seed: int, workers: int) -> None:
    """What a learner meets, labelled by the expert, with its mirror image."""
    driven = out.with_name(f"{out.name}-driven")
    with bar(out.name, episodes) as advance:
        generate_dataset(
            driven,
            scenario(),
            f"{policy}+social-planner",
            episodes=episodes,
            seed=seed,
            workers=workers,
            resume=driven.exists(),
            suffix=".json.zst",
            advance=advance,
        )
    with_mirrors([driven], out, twist_image)
    shutil.rmtree(driven)


def scenario() -> ScenarioConfig:
    """The rooms that were learned from, left sooner."""
    return load_scenario("sonata-2020").changed(rules={"time_limit": LONGEST})


@click.command()
@click.option("--network", type=click.Choice(list(NETWORKS)), default="paper", show_default=True)
@click.option("-o", "--out", type=click.Path(path_type=Path, exists=True), default=Path("runs"), show_default=True)
@click.option("--rounds", type=click.IntRange(1), default=ROUNDS, show_default=True)
@click.option("--episodes", type=click.IntRange(1), default=EPISODES, show_default=True, help="A round.")
@click.option("--epochs", type=click.IntRange(1), default=12, show_default=True, help="A round.")
@click.option("--workers", type=click.IntRange(1), default=1, show_default=True)
def main(network: str, out: Path, rounds: int, episodes: int, epochs: int, workers: int) -> None:
    """Let the network in OUT/NETWORK drive, and train it on what the expert says of that."""
    aggregate(network, out, rounds=rounds, episodes=episodes, epochs=epochs, workers=workers)


if __name__ == "__main__":
    main()
