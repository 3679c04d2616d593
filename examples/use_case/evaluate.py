"""Evaluate the learned controllers beside their expert and two that learned nothing, on scenes that none has met.

python examples/use_case/evaluate.py -o runs
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import click

OTHERS = ("social-planner", "social-force", "straight-to-goal")
LEARNED = ("paper", "paper-aggregated", "attention", "attention-aggregated")
SCENES = {"few": (60, 60), "many": (1000, 1000)}  # how many, and their seed


@click.command()
@click.option("-o", "--out", type=click.Path(path_type=Path, exists=True), default=Path("runs"), show_default=True)
@click.option("--scenes", type=click.Choice(list(SCENES)), default="few", show_default=True, help="60, or 1000.")
@click.option("--workers", type=click.IntRange(1), default=2, show_default=True)
def main(out: Path, scenes: str, workers: int) -> None:
    """Let `sonata2d evaluate` make OUT/evaluation-SCENES, with its page and picture."""
    episodes, seed = SCENES[scenes]
    controllers = [*(str(out / name / "policy.npz") for name in LEARNED), *OTHERS]
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
    words += [word for key, value in options.items() for word in (f"--{key}", str(value))]
    subprocess.run([sys.executable, "-m", "sonata2d_cli", "evaluate", *words, "--no-rerun"], check=True)


if __name__ == "__main__":
    main()
