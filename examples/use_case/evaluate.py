"""Evaluate the learned controllers beside their expert and two that learned nothing, on scenes that none has met.

python examples/use_case/evaluate.py -o runs
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import click

from sonata2d.scenegen import scenario_names

OTHERS = ("social-planner", "social-force", "straight-to-goal")
SHIPPED = ("attention-aggregated", "graph-policy")
LEARNED = ("paper", "paper-aggregated", "attention", "attention-aggregated")
SCENES = {"few": (60, 60), "many": (1000, 1000), "everywhere": (30, 30)}  # how many in a scenario, and their seed


@click.command()
@click.option("-o", "--out", type=click.Path(path_type=Path, exists=True), default=Path("runs"), show_default=True)
@click.option(
    "--scenes", type=click.Choice(list(SCENES)), default="few", show_default=True, help="60, 1000, or all scenarios."
)
@click.option("--workers", type=click.IntRange(1), default=2, show_default=True)
def main(out: Path, scenes: str, workers: int) -> None:
    """Let `sonata2d evaluate` make OUT/evaluation-SCENES, with its page and picture."""
    episodes, seed = SCENES[scenes]
    everywhere = scenes == "everywhere"
    learned, others = (SHIPPED, OTHERS[:1]) if everywhere else (LEARNED, OTHERS)
    controllers = [*(str(out / name / "policy.npz") for name in learned), *others]
    scenarios = sorted(scenario_names()) if everywhere else ["sonata-2020"]
    place = out / f"evaluation-{scenes}"
    options = {
        "episodes": episodes,
        "seed": seed,
        "workers": workers,
        "out": place,
        "page": place.with_suffix(".html"),
        "picture": place.with_suffix(".png"),
    }
    words = [word for controller in controllers for word in ("--controller", controller)]
    words += [word for scenario in scenarios for word in ("--scenario", scenario)]
    words += [word for key, value in options.items() for word in (f"--{key}", str(value))]
    subprocess.run([sys.executable, "-m", "sonata2d_cli", "evaluate", *words, "--no-rerun"], check=True)


if __name__ == "__main__":
    main()
