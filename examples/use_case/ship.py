"""The weights that sonata2d ships: the better network, taught by a careful expert in every scenario that has a name.

python examples/use_case/ship.py -o runs
"""

from __future__ import annotations

from pathlib import Path

import click
from aggregate import aggregate, met_by
from data import PARTS, ROOMS, run_cleanly

from sonata2d.datasets.split import split_dataset
from sonata2d.scenegen.scenario.load import scenario_names

NETWORK = "attention"
CAREFUL = f"{Path(__file__).with_name('careful.py')}:Careful"
DRIVEN = {ROOMS: 600, "sonata-2020-crowded": 100}  # runs of the expert; in other scenarios 30
MET = {ROOMS: 300, "sonata-2020-crowded": 60}  # runs of the learner a round; in others 20
ROUNDS, EPOCHS = 1, 10
SEED = 5000


@click.command()
@click.option("-o", "--out", type=click.Path(path_type=Path, exists=True), default=Path("runs"), show_default=True)
@click.option("--workers", type=click.IntRange(1), default=2, show_default=True)
def main(out: Path, workers: int) -> None:
    """Write OUT/graph-policy/policy.npz."""
    names, everywhere = sorted(scenario_names()), out / "everywhere"
    if not everywhere.exists():
        met_by(CAREFUL, everywhere, {name: DRIVEN.get(name, 30) for name in names}, SEED, workers)
    split_dataset(everywhere, PARTS)
    into = out / "graph-policy"
    aggregate(
        NETWORK,
        out / f"{NETWORK}-aggregated",
        into,
        [everywhere],
        scenarios={name: MET.get(name, 20) for name in names},
        expert=CAREFUL,
        rounds=ROUNDS,
        epochs=EPOCHS,
        seed=SEED,
        workers=workers,
    )
    click.echo(into / "policy.npz")


if __name__ == "__main__":
    run_cleanly(main)
