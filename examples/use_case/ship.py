"""The weights that sonata2d ships: the better network, aggregated once more over every scenario that has a name.

python examples/use_case/ship.py -o runs
"""

from __future__ import annotations

from pathlib import Path

import click
from aggregate import ROUNDS, aggregate, met_by

from sonata2d.scenegen import scenario_names

NETWORK = "attention"
EXPERT, LEARNER = 60, 30  # runs in each scenario: of the expert, and of the learner a round
MORE_ROUNDS, EPOCHS = 2, 8
SEED = 5000


@click.command()
@click.option("-o", "--out", type=click.Path(path_type=Path, exists=True), default=Path("runs"), show_default=True)
@click.option("--workers", type=click.IntRange(1), default=2, show_default=True)
def main(out: Path, workers: int) -> None:
    """Write OUT/graph-policy/policy.npz."""
    scenarios, expert = sorted(scenario_names()), out / "everywhere"
    if not expert.exists():
        met_by("social-planner", expert, scenarios, EXPERT, SEED, workers)
    last = out / f"{NETWORK}-aggregated"
    known = [out / "data", *(last.with_name(f"{last.name}-met{k}") for k in range(1, ROUNDS + 1)), expert]
    into = out / "graph-policy"
    aggregate(
        NETWORK, last, into, known,
        scenarios=scenarios, rounds=MORE_ROUNDS, episodes=LEARNER, epochs=EPOCHS, workers=workers,
    )  # fmt: skip
    click.echo(into / "policy.npz")


if __name__ == "__main__":
    main()
