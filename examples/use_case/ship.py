"""Makes the weights that sonata2d ships: the attention network, trained with a careful expert in every preset.

python examples/use_case/ship.py -o runs
"""

from __future__ import annotations

from pathlib import Path

import click
from aggregate import aggregate, record_scenarios
from data import PARTS, PRESET, run_command

from sonata2d.datasets import split_dataset
from sonata2d.scenegen import scenario_names

NETWORK = "attention"
CAREFUL = f"{Path(__file__).with_name('careful.py')}:Careful"
EXPERT_EPISODES = {PRESET: 600, "sonata-2020-crowded": 100}  # runs of the expert; 30 in every other scenario
LEARNER_EPISODES = {PRESET: 300, "sonata-2020-crowded": 60}  # runs of the learner per round; 20 in every other scenario
ROUNDS, EPOCHS = 1, 10
SEED = 5000


@click.command()
@click.option("-o", "--out", type=click.Path(path_type=Path, exists=True), default=Path("runs"), show_default=True)
@click.option("--workers", type=click.IntRange(1), default=2, show_default=True)
def main(out: Path, workers: int) -> None:
    """Write OUT/graph-policy/policy.npz."""
    scenarios, everywhere = sorted(scenario_names()), out / "everywhere"
    if not everywhere.exists():
        episodes = {name: EXPERT_EPISODES.get(name, 30) for name in scenarios}
        record_scenarios(CAREFUL, everywhere, episodes, SEED, workers)
    split_dataset(everywhere, PARTS)
    target = out / "graph-policy"
    aggregate(
        NETWORK,
        out / f"{NETWORK}-aggregated",
        target,
        [everywhere],
        scenarios={name: LEARNER_EPISODES.get(name, 20) for name in scenarios},
        expert=CAREFUL,
        rounds=ROUNDS,
        epochs=EPOCHS,
        seed=SEED,
        workers=workers,
    )
    click.echo(target / "policy.npz")


if __name__ == "__main__":
    run_command(main)
