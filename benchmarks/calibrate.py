"""Fit the parameters of the default pedestrian model to recorded pedestrians.

    python benchmarks/calibrate.py PROTOCOL.py SCENE.csv [SCENE.csv ...] [--minutes 40] [--state calibration.pickle]

PROTOCOL.py is a module that evaluates a crowd: `Scene`, `replay`, `corridor` and `bottleneck`, each of which takes a
function like `sonata2d.testing.realism.simulate`. The cost is the sum, over all figures with a target, of the distance
to the target. CMA-ES (package `cma`) minimises it; its state is saved after every generation, and a second call
continues. Prints the best parameters as arguments of `Sonata2026`.
"""

from __future__ import annotations

import argparse
import importlib.util
import math
import pickle
import time
from concurrent.futures import ProcessPoolExecutor
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np

import sonata2d.agents.pedestrians.models.sonata2026 as model
from sonata2d.core.entities import PERSON_RADIUS
from sonata2d.testing.realism import simulate

# name: minimum and maximum; searched on a logarithmic scale if both are above 0
RANGES = {
    "relaxation_time": (0.3, 1.0), "following_time": (0.8, 3.0), "starting_time": (0.12, 0.4),
    "turning_time": (0.2, 0.6), "headway_half_width": (0.25, 0.4), "standstill_gap": (-0.2, 0.1),
    "time_gap": (0.6, 1.2), "anticipation_strength": (0.2, 1.5), "anticipation_decay_length": (0.2, 1.0),
    "anticipation_decay_time": (0.5, 2.0), "proximity_strength": (0.1, 1.5), "proximity_decay_length": (0.1, 0.4),
    "anisotropy": (0.1, 1.0), "look_ahead_time": (0.6, 1.6), "group_attention": (0.15, 1.0), "radius": (0.153, 0.2),
}  # fmt: skip
ADE = {"eth": 0.20 / 0.199, "zara01": 0.17 / 0.176, "corridor_uni": 0.40 / 1.153}  # relative to walking straight
SKIPPED = {"eth": 5, "zara01": 3, "corridor_uni": 4}  # every n-th window is used
DENSITIES, WIDTHS = (0.5, 1.0, 1.5, 2.0, 3.0, 4.0), (0.8, 1.2)
PASSING = 0.25  # m, clearance of two pedestrians who meet head-on


@cache
def protocol(path: str) -> Any:
    """Import a module from its file."""
    spec = importlib.util.spec_from_file_location("protocol", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def people(parameters: dict[str, float]) -> Any:
    """The simulator of a crowd with these parameters."""
    own = dict(parameters)
    radius = own.pop("radius")
    model.PARAMETERS = model.PARAMETERS._replace(**own)
    return lambda x, v, goals, speeds, walls, dt, steps, groups: simulate(
        x, v, goals, speeds, walls, dt, steps, groups, radius=radius
    )


def figures(parameters: dict[str, float], check: str, scenes: list[str]) -> dict[str, float]:
    """Every figure divided by its target: 1 is on target."""
    module, walk = protocol(check), people(parameters)
    found = {"head-on clearance": PASSING / max(passing_gap(walk) - 2.0 * parameters["radius"], 0.02)}
    every = module.windows
    for path in scenes:
        name = Path(path).stem
        module.windows = partial(_subset, every, SKIPPED.get(name, 1))
        row = module.replay(walk, module.Scene(path))
        is_open = name != "corridor_uni"
        straight = module.replay(module.load("straight"), module.Scene(path))["ADE"]
        found[f"{name} ADE"] = row["ADE"] / (ADE.get(name, 1.0) * straight)
        found[f"{name} nn"] = row["W_nn"] / (0.015 if is_open else 0.03)
        if is_open:
            found[f"{name} urgency"] = row["W_urgency"] / 0.02
        found[f"{name} contacts"] = row["contacts"] / 2.0
        found[f"{name} walls"] = row["wall_hits"] / 0.5
    module.windows = every
    corridor = module.corridor(walk, densities=DENSITIES, settle=5, measure=5)
    found["corridor Weidmann"], found["corridor measured"] = corridor["rmse"] / 0.12, corridor["rmse_measured"] / 0.20
    for row in module.bottleneck(walk, widths=WIDTHS, limit=60.0)["rows"]:
        found[f"door {row['width']}"] = 1.0 + max(abs(row["specific_flow"] - 1.95) - 0.15, -0.15) / 0.2
        found[f"not passed at {row['width']}"] = max(72 - row["passed"], 0) / 5.0
    return found


def _subset(windows: Any, step: int, scene: Any, oracle: str) -> list[Any]:
    return list(windows(scene, oracle))[::step]


def passing_gap(walk: Any) -> float:
    """Mean closest distance of two pedestrians at 1.3 m/s who meet head-on with an offset of up to 0.2 m, m."""
    nearest = []
    for offset in (0.0, 0.05, -0.05, 0.1, -0.1, 0.2, -0.2):
        start, goal = np.array([[-4.0, offset], [4.0, 0.0]]), np.array([[9.0, offset], [-9.0, 0.0]])
        ahead, walls = np.array([[1.3, 0.0], [-1.3, 0.0]]), np.zeros((0, 4))
        path = walk(start, ahead, goal, np.array([1.3, 1.3]), walls, 0.1, 50, np.zeros(2, int))
        nearest.append(np.hypot(*(path[:, 0] - path[:, 1]).T).min())
    return float(np.mean(nearest))


def cost(parameters: dict[str, float], check: str, scenes: list[str]) -> float:
    """Distance from the targets; figures beyond them have a larger weight."""
    ratios = figures(parameters, check, scenes).values()
    return sum(0.2 * f + 3.0 * max(f - 0.95, 0.0) + 3.0 * max(f - 0.95, 0.0) ** 2 for f in ratios)


def decoded(point: Any) -> dict[str, float]:
    """Parameters of a point in the unit cube."""
    found = {}
    for x, (name, (low, high)) in zip(point, RANGES.items(), strict=True):
        fraction = min(max(x, 0.0), 1.0)
        found[name] = low * math.exp(fraction * math.log(high / low)) if low > 0.0 else low + fraction * (high - low)
    return found


def encoded(parameters: dict[str, float]) -> list[float]:
    """The point of given parameters: the inverse of `decoded`."""
    return [
        math.log(parameters[k] / a) / math.log(b / a) if a > 0.0 else (parameters[k] - a) / (b - a)
        for k, (a, b) in RANGES.items()
    ]


def cost_of_point(point: Any, check: str, scenes: list[str]) -> float:
    return cost(decoded(point), check, scenes)


def main() -> None:
    import cma

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("check")
    parser.add_argument("scenes", nargs="+")
    parser.add_argument("--minutes", type=float, default=40.0)
    parser.add_argument("--sigma", type=float, default=0.12)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--state", type=Path, default=Path("calibration.pickle"))
    arguments = parser.parse_args()
    start = {k: getattr(model.PARAMETERS, k, PERSON_RADIUS) for k in RANGES}
    options = {"bounds": [0.0, 1.0], "seed": 1, "verbose": -9, "popsize": 12}
    search = cma.CMAEvolutionStrategy(encoded(start), arguments.sigma, options)
    if arguments.state.exists():
        search = pickle.loads(arguments.state.read_bytes())
    until = time.monotonic() + 60.0 * arguments.minutes
    evaluate = partial(cost_of_point, check=arguments.check, scenes=arguments.scenes)
    with ProcessPoolExecutor(arguments.workers) as pool:
        while time.monotonic() < until and not search.stop():
            points = search.ask()
            search.tell(points, list(pool.map(evaluate, points)))
            arguments.state.write_bytes(pickle.dumps(search))
            print(f"{search.countevals:5d} {search.result.fbest:9.3f}", flush=True)
    best = decoded(search.result.xbest)
    print({k: round(v, 4) for k, v in best.items()})
    for name, value in figures(best, arguments.check, arguments.scenes).items():
        print(f"{name:24} {value:6.2f} of the target")


if __name__ == "__main__":
    main()
