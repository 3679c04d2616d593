"""Compares the learned controllers with their expert and with two simple controllers, in unseen scenes.

python examples/use_case/evaluate.py -o runs
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import click
import numpy as np
from data import run_command
from samples import load_samples
from settings import EVALUATION_SEEDS, EXPERT, PRESET, SETTINGS

from sonata2d.learning import Weights, write_weights
from sonata2d.learning.weights import GRAPHS
from sonata2d.scenegen import scenario_names

REFERENCES = (EXPERT, "social-force", "straight-to-goal")  # controllers without training
SHIPPED = "graph-policy"
LEARNED = ("paper", "paper-aggregated", "attention", "attention-aggregated", SHIPPED)
MEAN = "mean"  # folder of the policy that always answers the mean command


def controllers_for(scenes: str, out: Path) -> list[str]:
    """Return the controllers to compare: paths of weights, then names.

    Args:
        scenes: `few`, `many` or `everywhere`, which compares the shipped policy with the expert only; the mean command
            takes part in `few` only.
        out: output folder of the use case.
    """
    if scenes == "everywhere":
        learned, references = (SHIPPED,), REFERENCES[:1]
    else:
        learned, references = (*LEARNED, *((MEAN,) if scenes == "few" else ())), REFERENCES
    return [*(str(out / name / "policy.npz") for name in learned), *references]


def write_mean_policy(out: Path) -> None:
    """Write `out/mean/policy.npz`, which always answers the mean command of the training part: its weights are zero."""
    samples = load_samples(out / "data", "paper")
    mean = samples.y[samples.part == 0].mean(axis=0)
    inputs, relations = GRAPHS["paper"]
    arrays = {"layer0.weight": np.zeros((relations, inputs, len(mean))), "layer0.bias": np.arctanh(mean)}
    (out / MEAN).mkdir(exist_ok=True)
    write_weights(out / MEAN / "policy.npz", Weights("paper", "rgcn", arrays, {"answers": "the mean command"}))


@click.command()
@click.option("-o", "--out", type=click.Path(path_type=Path, exists=True), default=Path("runs"), show_default=True)
@click.option(
    "--scenes",
    type=click.Choice(list(SETTINGS.scenes)),
    default="few",
    show_default=True,
    help="Few or many scenes of {}, {} or {}; or {} of every scenario.".format(PRESET, *SETTINGS.scenes.values()),
)
@click.option("--workers", type=click.IntRange(1), default=2, show_default=True)
def main(out: Path, scenes: str, workers: int) -> None:
    """Run `sonata2d evaluate` into OUT/evaluation-SCENES, with a page."""
    episodes, seed = SETTINGS.scenes[scenes], EVALUATION_SEEDS[scenes]
    if scenes == "few":
        write_mean_policy(out)
    scenarios = sorted(scenario_names()) if scenes == "everywhere" else [PRESET]
    folder = out / f"evaluation-{scenes}"
    options = {
        "episodes": episodes,
        "seed": seed,
        "workers": workers,
        "output": folder,
        "page": folder.with_suffix(".html"),
    }
    arguments = [word for controller in controllers_for(scenes, out) for word in ("--controller", controller)]
    arguments += [word for scenario in scenarios for word in ("--scenario", scenario)]
    arguments += [word for key, value in options.items() for word in (f"--{key}", str(value))]
    subprocess.run([sys.executable, "-m", "sonata2d_cli", "evaluate", *arguments, "--no-rerun"], check=True)


if __name__ == "__main__":
    run_command(main)
