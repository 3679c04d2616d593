"""Fit the parameters of the default pedestrian model to recorded pedestrians, from start to end.

    python benchmarks/calibrate.py REALISM.py WALKS.py SCENE.csv ... [--minutes 120] [--state FILE]
    python benchmarks/calibrate.py REALISM.py WALKS.py SCENE.csv ... --ablation
    python benchmarks/calibrate.py REALISM.py WALKS.py SCENE.csv ... --held-back

REALISM.py evaluates short replays, a corridor and doors: `Scene`, `replay`, `corridor` and `bottleneck`, which take a
function like `sonata2d.testing.realism.simulate`. WALKS.py measures turns and groups in a data set: `dataset`, which
takes its folder. Free runs are judged by `free_runs.py` beside this file, which needs scikit-learn. Each figure is
divided by its target, and the cost is a sum over all figures that grows quickly above their targets. CMA-ES (package
`cma`) minimises it; its state is saved after every generation, and a second call continues. The first call starts from
the middle of the ranges, or with `--refine` from the present parameters: no parameter is set by hand. Prints each
generation, the best parameters as arguments of `Sonata2026`, and all figures, unabridged, at the end; `--ablation`
prints the figures with each parameter neutralised. `--held-back` prints figures of what the search does not use: other
windows (which overlap with its own), other episodes, densities and widths of doors, and another seed of the free runs.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import math
import os
import pickle
import tempfile
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any, NamedTuple

import free_runs

import sonata2d as s2
import sonata2d.agents.pedestrians.models.sonata2026 as model
from sonata2d.core.scene import Scene
from sonata2d.scenegen.generator import generate
from sonata2d.testing.realism import simulate

# name: minimum and maximum; searched on a logarithmic scale if both are above 0
RANGES = {
    "relaxation_time": (0.1, 0.8), "turning_time": (0.15, 0.8), "headway_half_width": (0.15, 0.5),
    "standstill_gap": (-0.25, 0.15), "time_gap": (0.3, 1.3), "matching_time": (0.0, 1.5),
    "look_ahead_time": (0.3, 2.5), "temperature": (0.03, 0.3), "side_bonus": (0.005, 0.2),
    "anticipation_strength": (0.1, 4.0), "anticipation_length": (0.1, 1.5), "proximity_strength": (0.3, 8.0),
    "wall_strength": (0.1, 6.0), "proximity_length": (0.05, 0.5), "cohesion": (0.03, 0.8), "spacing": (0.7, 1.2),
    "wander": (0.02, 0.25), "pace_deviation": (0.02, 0.25), "deviation_time": (0.4, 5.0), "crowd": (0.3, 8.0),
}  # fmt: skip
# Values that disable a parameter; a name stands for the value of that parameter.
NEUTRAL = {
    "matching_time": 0.0, "wall_strength": 0.0, "turning_time": "relaxation_time",
    "standstill_gap": 0.0, "side_bonus": 0.0, "anticipation_strength": 0.0, "proximity_strength": 0.0, "cohesion": 0.0,
    "wander": 0.0, "pace_deviation": 0.0, "temperature": 0.001, "headway_half_width": 0.05, "time_gap": 0.2,
    "look_ahead_time": 0.1, "anticipation_length": 0.02, "proximity_length": 0.02, "spacing": 0.3, "crowd": 1000.0,
    "deviation_time": 0.1, "relaxation_time": 1.0,
}  # fmt: skip
# Of the free runs: s, and the AUC to reach.
FREE = {
    "zara01": (200.0, 0.62), "eth": (300.0, 0.62), "citr_bi": (70.0, 0.62), "students03_late": (99.0, 0.72),
    "corridor_uni": (60.0, 0.68), "corridor_bo": (60.0, 0.68), "corridor_boa": (60.0, 0.68),
}  # fmt: skip
SKIPPED = {"eth": 2, "zara01": 2, "corridor_uni": 4}  # every n-th window is used during the search
# Targets of replays: ADE in m; distances of distributions in m and 1/s.
REPLAY = {"eth": (0.20, 0.015, 0.02), "zara01": (0.17, 0.015, 0.02), "corridor_uni": (0.40, 0.03, None)}
HALL, EPISODES, EPISODE_TIME = "crowded-hall", 6, 40.0  # preset, number and duration (s) of the episodes for WALKS.py
DENSITIES, OTHER_DENSITIES = (0.5, 1.0, 1.5, 2.0, 3.0, 4.0), (0.75, 1.25, 1.75, 2.5, 3.5)  # 1/m2
WIDTHS, OTHER_WIDTHS = (0.8, 1.2), (1.0, 1.4, 1.6)  # m
WEIGHTS = {"ADE": 2.5, "AUC": 2.5, "free speed": 2.5}  # 1 for the other figures


@cache
def module(path: str) -> Any:
    """Import a module from its file."""
    spec = importlib.util.spec_from_file_location(Path(path).stem, path)
    assert spec is not None
    assert spec.loader is not None
    found = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(found)
    return found


class Protocols(NamedTuple):
    """Paths of the two protocols that evaluate the parameters, and of the recordings."""

    realism: str
    walks: str
    scenes: Sequence[str]


def figures(parameters: dict[str, float], protocols: Protocols, fast: bool) -> dict[str, float]:
    """Every figure divided by its target: 1 is on target.

    Args:
        parameters: of the model.
        protocols: and recordings.
        fast: whether to use fewer windows, densities and widths, as during the search.
    """
    model.PARAMETERS = model.PARAMETERS._replace(**parameters)
    found: dict[str, float] = {}
    for path in protocols.scenes:
        name = Path(path).stem
        if name in REPLAY:
            found |= _replay(module(protocols.realism), path, name, slice(None, None, SKIPPED[name] if fast else None))
        if name in FREE:
            found |= _free(Path(path), name, 0)
    found |= _hall(module(protocols.walks), 0)
    if fast:
        return found | _crowds(module(protocols.realism), DENSITIES, 5, WIDTHS, 60.0)
    return found | _crowds(module(protocols.realism), None, 8, (0.8, 1.0, 1.2, 1.6), 120.0)


def held_back(protocols: Protocols) -> dict[str, float]:
    """`figures` of the present parameters on what the search does not use."""
    found: dict[str, float] = {}
    for path in protocols.scenes:
        name = Path(path).stem
        if name in REPLAY:
            found |= _replay(module(protocols.realism), path, name, slice(1, None, SKIPPED[name]))
        if name in FREE:
            found |= _free(Path(path), name, 1)
    found |= _hall(module(protocols.walks), EPISODES)
    return found | _crowds(module(protocols.realism), OTHER_DENSITIES, 5, OTHER_WIDTHS, 120.0)


def _crowds(
    protocol: Any, densities: Sequence[float] | None, seconds: int, widths: Sequence[float], limit: float
) -> dict[str, float]:
    """Speeds in a corridor, and flows through doors."""
    chosen = {} if densities is None else {"densities": densities}
    corridor = protocol.corridor(simulate, settle=seconds, measure=seconds, **chosen)
    found = {"corridor Weidmann": corridor["rmse"] / 0.12, "corridor measured": corridor["rmse_measured"] / 0.20}
    for row in protocol.bottleneck(simulate, widths=widths, limit=limit)["rows"]:
        found[f"door {row['width']}"] = abs(row["specific_flow"] - 2.0) / 0.15
        found[f"not passed at {row['width']}"] = max(72 - row["passed"], 0) / 5.0
    return found


class Still(s2.Controller):
    """Leaves the robot where it is."""

    def act(self, snapshot: s2.Snapshot) -> s2.Twist:
        return s2.Twist()


@cache
def hall_scene(episode: int) -> Scene:
    """A scene of the preset in which pedestrians ignore the robot."""
    config = s2.load_scenario(HALL)
    person = config.person.model_copy(update={"ignores_robot": 1.0})
    rules = replace(config.rules, ends_on=("time",), time_limit=EPISODE_TIME)
    return generate(config.model_copy(update={"person": person, "rules": rules}), seed=episode)


def _hall(protocol: Any, first: int) -> dict[str, float]:
    """Turns and groups in episodes of a crowded hall."""
    with tempfile.TemporaryDirectory() as folder:
        for episode in range(first, first + EPISODES):
            with s2.JsonRecorder(Path(folder) / f"{episode:06}.json") as recorder:
                s2.Episode(hall_scene(episode), Still(), observers=[recorder]).run()
        row = protocol.dataset(Path(folder))
    pairs, angle = row["pairs p50 p90"] or (None, None), row["pairs angle"] or [None]
    return {
        "hall about-faces": _limited(row["about-faces/min"], 0.5),
        "hall slip": _limited(row["slip"], 0.01),
        "hall bend speed": _limited(row["bend speed"], 0.8, is_minimum=True),
        "hall pairs p90": _limited(pairs[1], 1.7),
        "hall pairs angle": _limited(angle[0], 60.0, is_minimum=True),
    }


def _limited(value: float | None, target: float, *, is_minimum: bool = False) -> float:
    """A figure divided by its target, or the target by the figure, at most 3; 3 if it could not be measured."""
    if value is None:
        return 3.0
    return min(target / max(value, 1e-9) if is_minimum else value / target, 3.0)


@cache
def _straight(protocol: Any, path: str, start: int | None, step: int | None) -> float:
    """ADE of walking straight to the goal in a part of the windows, m: how hard these windows are."""
    return float(_in_windows(protocol, protocol.load("straight"), path, slice(start, None, step))["ADE"])


def _in_windows(protocol: Any, walk: Any, path: str, chosen: slice) -> Any:
    every = protocol.windows
    protocol.windows = lambda scene, oracle: list(every(scene, oracle))[chosen]
    try:
        return protocol.replay(walk, protocol.Scene(path))
    finally:
        protocol.windows = every


def _replay(protocol: Any, path: str, name: str, chosen: slice) -> dict[str, float]:
    """Short replays in a part of the windows; the target of the ADE is scaled by how hard they are."""
    ade, nearest, urgency = REPLAY[name]
    row = _in_windows(protocol, simulate, path, chosen)
    scale = _straight(protocol, path, chosen.start, chosen.step) / _straight(protocol, path, None, None)
    noise = 1.0 if chosen.step is None else 0.9  # fewer windows make distributions differ more
    found = {f"{name} ADE": row["ADE"] / (ade * scale), f"{name} nearest": noise * row["W_nn"] / nearest}
    if urgency is not None:
        found[f"{name} urgency"] = noise * row["W_urgency"] / urgency
    return found | {f"{name} contacts": row["contacts"] / 2.0, f"{name} walls": row["wall_hits"] / 0.5}


@cache
def _recorded(path: Path, seconds: float) -> free_runs.Tracks:
    """`free_runs.recorded`, read once."""
    return free_runs.recorded(path, seconds)


def _free(path: Path, name: str, seed: int) -> dict[str, float]:
    """A free run: AUC, speed, people in view, and how much people vary on their way."""
    seconds, auc = FREE[name]
    real, run = _recorded(path, seconds), free_runs.simulated(path, seconds, seed)
    found = {f"{name} AUC": free_runs.judge(real, run)[0] / auc}
    for what, tolerance, own, theirs in zip(
        ("free speed", "in view"), (0.08, 0.15), free_runs.scene_means(run), free_runs.scene_means(real), strict=True
    ):
        found[f"{name} {what}"] = abs(own / theirs - 1.0) / tolerance
    for what, own, theirs in zip(("speed", "course"), free_runs.within(run), free_runs.within(real), strict=False):
        found[f"{name} {what} within a person"] = abs(own / theirs - 1.0) / 0.25
    return found


def cost(ratios: dict[str, float]) -> float:
    """Distance from the targets."""
    total = 0.0
    for name, ratio in ratios.items():
        excess = max(ratio - 0.95, 0.0)
        weight = next((weight for part, weight in WEIGHTS.items() if part in name), 1.0)
        total += weight * (0.2 * ratio + 3.0 * excess + 3.0 * min(excess, 2.0) ** 2)
    return total


def decoded(point: Any) -> dict[str, float]:
    """Parameters of a point in the unit cube."""
    found = {}
    for x, (name, (low, high)) in zip(point, RANGES.items(), strict=True):
        fraction = min(max(x, 0.0), 1.0)
        found[name] = low * math.exp(fraction * math.log(high / low)) if low > 0.0 else low + fraction * (high - low)
    return found


def encoded(parameters: dict[str, float]) -> list[float]:
    """The point in the unit cube that has these parameters."""
    point = []
    for name, (low, high) in RANGES.items():
        value = parameters[name]
        x = math.log(value / low) / math.log(high / low) if low > 0.0 else (value - low) / (high - low)
        point.append(min(max(x, 0.0), 1.0))
    return point


def cost_of_point(point: Any, protocols: Protocols) -> float:
    return cost(figures(decoded(point), protocols, fast=True))


def show(ratios: dict[str, float]) -> None:
    for name, value in ratios.items():
        print(f"{name:28} {value:6.2f} of the target")


def ablate(protocols: Protocols) -> None:
    """Print the figures that get worse by a tenth of their target without each parameter."""
    own = model.PARAMETERS._asdict()
    whole = figures(own, protocols, fast=False)
    print(f"{'all parameters':32} cost {cost(whole):7.2f}")
    for name, value in NEUTRAL.items():
        without = figures({**own, name: own[value] if isinstance(value, str) else value}, protocols, fast=False)
        worse = {k: f"{whole[k]:.2f} -> {without[k]:.2f}" for k in whole if without[k] > max(whole[k], 0.9) + 0.1}
        print(f"{'without ' + name:32} cost {cost(without):7.2f}  {json.dumps(worse)}", flush=True)


def search(protocols: Protocols, minutes: float, workers: int, state: Path, *, refine: bool) -> None:
    """Minimise the cost."""
    import cma

    os.environ["OMP_NUM_THREADS"] = "1"  # of each worker: threads of several workers would wait for each other
    options = {"bounds": [0.0, 1.0], "seed": 1, "verbose": -9, "popsize": 12}
    start = encoded(model.PARAMETERS._asdict()) if refine else [0.5] * len(RANGES)
    strategy = cma.CMAEvolutionStrategy(start, 0.07 if refine else 0.2, options)
    if state.exists():
        strategy = pickle.loads(state.read_bytes())
    begin = time.monotonic()
    with ProcessPoolExecutor(workers) as pool:
        while time.monotonic() < begin + 60.0 * minutes and not strategy.stop():
            points = strategy.ask()
            strategy.tell(points, list(pool.map(partial(cost_of_point, protocols=protocols), points)))
            state.write_bytes(pickle.dumps(strategy))
            elapsed = (time.monotonic() - begin) / 60.0
            print(f"{strategy.countevals:5d} {strategy.result.fbest:9.3f} {elapsed:7.1f} min", flush=True)
    best = {name: round(value, 4) for name, value in decoded(strategy.result.xbest).items()}
    print(best)
    ratios = figures(best, protocols, fast=False)
    print(f"cost {cost(ratios):.2f}")
    show(ratios)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name in ("realism", "walks"):
        parser.add_argument(name)
    parser.add_argument("scenes", nargs="+")
    parser.add_argument("--minutes", type=float, default=120.0)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--state", type=Path, default=Path("calibration.pickle"))
    parser.add_argument("--refine", action="store_true")
    parser.add_argument("--ablation", action="store_true")
    parser.add_argument("--held-back", action="store_true")
    arguments = parser.parse_args()
    protocols = Protocols(arguments.realism, arguments.walks, tuple(arguments.scenes))
    if arguments.ablation:
        ablate(protocols)
    elif arguments.held_back:
        show(held_back(protocols))
    else:
        search(protocols, arguments.minutes, arguments.workers, arguments.state, refine=arguments.refine)


if __name__ == "__main__":
    main()
