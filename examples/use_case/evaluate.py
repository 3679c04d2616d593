"""Evaluate the learned controllers beside their expert and two that learned nothing, on scenes that none has met.

python examples/use_case/evaluate.py -o runs
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import click
import numpy as np
from data import run_cleanly
from samples import samples_of

from sonata2d.learning.weights import GRAPHS, Weights, write_weights
from sonata2d.scenegen.scenario.load import scenario_names

OTHERS = ("social-planner", "social-force", "straight-to-goal")
SHIPPED = "graph-policy"
LEARNED = ("paper", "paper-aggregated", "attention", "attention-aggregated", SHIPPED)
MEAN = "mean"
SCENES = {"few": (60, 60), "many": (1000, 1000), "everywhere": (20, 30)}  # how many in a scenario, and their seed


def controllers_for(scenes: str, out: Path) -> list[str]:
    """Weights of the learned, names of the others; always the mean command only where few runs are made of it."""
    if scenes == "everywhere":
        learned, others = (SHIPPED,), OTHERS[:1]
    else:
        learned, others = (*LEARNED, *((MEAN,) if scenes == "few" else ())), OTHERS
    return [*(str(out / name / "policy.npz") for name in learned), *others]


def write_mean(out: Path) -> None:
    """A policy that always answers the mean command: a network without weights."""
    samples = samples_of(out / "data", "paper")
    mean = samples.y[samples.part == 0].mean(axis=0)
    inputs, relations = GRAPHS["paper"]
    arrays = {"layer0.weight": np.zeros((relations, inputs, len(mean))), "layer0.bias": np.arctanh(mean)}
    (out / MEAN).mkdir(exist_ok=True)
    write_weights(out / MEAN / "policy.npz", Weights("paper", "rgcn", arrays, {"answers": "the mean command"}))


@click.command()
@click.option("-o", "--out", type=click.Path(path_type=Path, exists=True), default=Path("runs"), show_default=True)
@click.option(
    "--scenes", type=click.Choice(list(SCENES)), default="few", show_default=True, help="60, 1000, or all scenarios."
)
@click.option("--workers", type=click.IntRange(1), default=2, show_default=True)
def main(out: Path, scenes: str, workers: int) -> None:
    """Let `sonata2d evaluate` make OUT/evaluation-SCENES, with its page and picture."""
    episodes, seed = SCENES[scenes]
    if scenes == "few":
        write_mean(out)
    scenarios = sorted(scenario_names()) if scenes == "everywhere" else ["sonata-2020"]
    place = out / f"evaluation-{scenes}"
    options = {
        "episodes": episodes,
        "seed": seed,
        "workers": workers,
        "out": place,
        "page": place.with_suffix(".html"),
        "picture": place.with_suffix(".png"),
    }
    words = [word for controller in controllers_for(scenes, out) for word in ("--controller", controller)]
    words += [word for scenario in scenarios for word in ("--scenario", scenario)]
    words += [word for key, value in options.items() for word in (f"--{key}", str(value))]
    subprocess.run([sys.executable, "-m", "sonata2d_cli", "evaluate", *words, "--no-rerun"], check=True)


if __name__ == "__main__":
    run_cleanly(main)
