"""Fit the predicted time of `sonata2d.metrics.difficulty` to the expert, and judge it in other scenes.

    python benchmarks/fit_difficulty.py [--scenes 1000] [--workers 2]

Runs the expert in scenes of all presets, half of which are used for the fit, and prints the weights and Spearman's rank
correlation of the prediction with the expert's time in the other half, for all presets together and for each.
"""

from __future__ import annotations

import argparse
from concurrent.futures import ProcessPoolExecutor

import numpy as np
from scipy.optimize import nnls
from scipy.stats import spearmanr

import sonata2d as s2
from sonata2d.metrics import difficulty
from sonata2d.scenegen import scenario_names

SEED = 77
EXPERT = "social-planner"


def measured(case: tuple[str, int]) -> tuple[str, list[float], float, float]:
    """Preset, parts of the difficulty, its value, and the expert's time (the time limit if it does not arrive), s."""
    name, episode = case
    scene = s2.generate(name, SEED, episode)
    found = difficulty(scene)
    outcome = s2.Episode(scene, s2.load_controller(EXPERT)).run()
    time = outcome.time if outcome.status == "goal" else scene.rules.time_limit
    parts = [1.0, found.free_time, found.encounters, found.standing, found.narrowness, found.turns]
    return name, parts, found.value, time


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", type=int, default=1000)
    parser.add_argument("--workers", type=int, default=2)
    arguments = parser.parse_args()
    names = [name for name in scenario_names() if name != "empty"]
    cases = [(names[k % len(names)], k // len(names)) for k in range(2 * arguments.scenes)]
    with ProcessPoolExecutor(arguments.workers) as pool:
        rows = list(pool.map(measured, cases, chunksize=8))
    preset = np.array([name for name, *_ in rows])
    parts, value, time = (np.array(column) for column in list(zip(*rows, strict=True))[1:])
    half = np.arange(len(rows)) // len(names) % 2 == 0
    weights, _ = nnls(parts[half], time[half])
    print("weights: 1, free time, encounters, standing, narrowness, turns:", weights.round(2).tolist())
    fitted = parts @ weights
    print(
        f"all presets: fitted {spearmanr(fitted[~half], time[~half])[0]:.2f}, as it is {spearmanr(value, time)[0]:.2f}"
    )
    for name in names:
        chosen = ~half & (preset == name)
        print(f"{name:24} {spearmanr(fitted[chosen], time[chosen])[0]:5.2f}  {time[chosen].mean():5.1f} s")


if __name__ == "__main__":
    main()
