"""Makes the weights that sonata2d ships: the attention network, trained with a careful expert in every preset.

python examples/use_case/ship.py -o runs
"""

from __future__ import annotations

from pathlib import Path

import click
from aggregate import aggregate, record_scenarios
from data import run_command
from settings import PARTS, SETTINGS, SHIPPING_SEED

from sonata2d.datasets import split_dataset
from sonata2d.scenegen import scenario_names

NETWORK = "attention"
CAREFUL = f"{Path(__file__).with_name('careful.py')}:Careful"


@click.command()
@click.option("-o", "--out", type=click.Path(path_type=Path, exists=True), default=Path("runs"), show_default=True)
@click.option("--workers", type=click.IntRange(1), default=2, show_default=True)
def main(out: Path, workers: int) -> None:
    """Write OUT/graph-policy/policy.npz."""
    scenarios, everywhere = sorted(scenario_names()), out / "everywhere"
    if not everywhere.exists():
        episodes = {name: SETTINGS.careful_episodes(name) for name in scenarios}
        record_scenarios(CAREFUL, everywhere, episodes, SHIPPING_SEED, workers)
    split_dataset(everywhere, PARTS)
    target = out / "graph-policy"
    aggregate(
        NETWORK,
        out / f"{NETWORK}-aggregated",
        target,
        [everywhere],
        scenarios={name: SETTINGS.shipped_episodes(name) for name in scenarios},
        expert=CAREFUL,
        rounds=SETTINGS.shipped_rounds,
        epochs=SETTINGS.shipped_epochs,
        seed=SHIPPING_SEED,
        workers=workers,
    )
    click.echo(target / "policy.npz")


if __name__ == "__main__":
    run_command(main)
