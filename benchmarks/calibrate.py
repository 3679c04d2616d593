"""Fit the parameters of the default pedestrian model to recorded pedestrians, from start to end.

    python benchmarks/calibrate.py REALISM.py TURING.py SCENE.csv [SCENE.csv ...] [--minutes 120] [--state FILE]
    python benchmarks/calibrate.py REALISM.py TURING.py SCENE.csv [SCENE.csv ...] --ablation

REALISM.py evaluates short replays, a corridor and doors: `Scene`, `replay`, `corridor` and `bottleneck`, which take a
function like `sonata2d.testing.realism.simulate`. TURING.py compares a free run with the recording: `compare`, which
takes two track files; in a free run everybody enters where and when the recorded person did. Each figure is divided by
its target, and the cost is a sum over all figures that grows quickly above their targets. CMA-ES (package `cma`)
minimises it; its state is saved after every generation, and a second call continues. The first call starts from the
middle of the ranges, or with `--refine` from the present parameters: no parameter is set by hand. Prints each
generation, the best parameters as arguments of `Sonata2026`, and all figures, unabridged, at the end; `--ablation`
prints the figures with each parameter neutralised.
"""

from __future__ import annotations

import argparse
import csv
import importlib.util
import json
import math
import pickle
import tempfile
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import sonata2d.agents.pedestrians.models.sonata2026 as model
from sonata2d.agents.pedestrians.crowd import Crowd
from sonata2d.core.geometry import Twist
from sonata2d.core.scene import Scene
from sonata2d.formats.from_tracks import scenario_from_tracks
from sonata2d.scenegen.generator import generate
from sonata2d.sim.world import World
from sonata2d.testing.realism import simulate

# name: minimum and maximum; searched on a logarithmic scale if both are above 0
RANGES = {
    "relaxation_time": (0.15, 0.6), "turning_time": (0.2, 0.6), "following_time": (0.3, 4.0),
    "headway_half_width": (0.18, 0.5), "standstill_gap": (-0.25, 0.1), "time_gap": (0.4, 1.3),
    "look_ahead_time": (0.5, 2.5), "temperature": (0.03, 0.3), "side_bonus": (0.005, 0.15),
    "anticipation_strength": (0.1, 3.0), "proximity_strength": (0.05, 2.0), "decay_length": (0.08, 1.2),
    "cohesion": (0.03, 0.8), "spacing": (0.7, 1.2), "wander": (0.005, 0.09),
}  # fmt: skip
# Values that disable a parameter; a name stands for the value of that parameter.
NEUTRAL = {
    "following_time": "relaxation_time", "turning_time": "relaxation_time", "standstill_gap": 0.0, "side_bonus": 0.0,
    "anticipation_strength": 0.0, "proximity_strength": 0.0, "cohesion": 0.0, "wander": 0.0, "temperature": 0.001,
    "headway_half_width": 0.05, "time_gap": 0.2, "look_ahead_time": 0.1, "decay_length": 0.02, "spacing": 0.3,
    "relaxation_time": 1.0,
}  # fmt: skip
FRAME, TICKS = 0.4, 4  # s between the frames of recordings, and ticks in a frame
SECONDS = {"corridor_uni": 60.0}  # of the free runs; 300 s of the others
SKIPPED = {"eth": 2, "zara01": 2, "corridor_uni": 4}  # every n-th window is used during the search
# Targets: replays (ADE in m; distances of distributions in m and 1/s) and free runs (AUC; distances in m/s).
REPLAY = {"eth": (0.20, 0.015, 0.02), "zara01": (0.17, 0.015, 0.02), "corridor_uni": (0.40, 0.03, None)}
FREE = {"eth": (0.65, 0.05), "zara01": (0.60, 0.03), "corridor_uni": (0.70, 0.12)}
WEIGHTS = {"ADE": 2.5, "energy": 0.1}  # 1 for the other figures; the energy law is measured from few encounters


@cache
def module(path: str) -> Any:
    """Import a module from its file."""
    spec = importlib.util.spec_from_file_location(Path(path).stem, path)
    assert spec is not None
    assert spec.loader is not None
    found = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(found)
    return found


@cache
def free_scene(path: str) -> Scene:
    """The scene of a free run: pedestrians ignore the robot."""
    seconds = SECONDS.get(Path(path).stem, 300.0)
    scene = generate(scenario_from_tracks(path, people="simulated", seconds=seconds), seed=0)
    return replace(scene, humans=tuple(replace(human, reacts_to_robot=0.0) for human in scene.humans))


def free_run(path: str, out: Path) -> tuple[Path, Path]:
    """Simulate a recording freely; write the simulated tracks, and the recording cut to the same time."""
    scene, group = free_scene(path), {}
    with open(path, newline="") as file:
        recorded = list(csv.DictReader(file))
    first = min(int(row["frame"]) for row in recorded)
    seconds = SECONDS.get(Path(path).stem, 300.0)
    real, simulated = out / "real.csv", out / "simulated.csv"
    with real.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["frame", "ped", "x", "y", "group"])
        for row in recorded:
            group[row["ped"]] = row.get("group", "")
            if (int(row["frame"]) - first) * FRAME <= seconds:
                writer.writerow([int(row["frame"]) - first, row["ped"], row["x"], row["y"], row.get("group", "")])
    world, crowd = World(scene), Crowd(scene)
    with simulated.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["frame", "ped", "x", "y", "group"])
        for tick in range(int(seconds / scene.rules.dt) + 1):
            snapshot = world.snapshot()
            if tick % TICKS == 0:
                for human, (x, y) in zip(snapshot.humans.id.tolist(), snapshot.humans.position.tolist(), strict=True):
                    writer.writerow([tick // TICKS, human, round(x, 4), round(y, 4), group.get(str(human), "")])
            world.step(Twist(), crowd.act(snapshot))
    return real, simulated


def figures(
    parameters: dict[str, float], realism: str, turing: str, scenes: Sequence[str], fast: bool
) -> dict[str, float]:
    """Every figure divided by its target: 1 is on target.

    Args:
        parameters: of the model.
        realism, turing: files of the two protocols.
        scenes: recordings.
        fast: whether to use fewer windows, densities and widths, as during the search.
    """
    model.PARAMETERS = model.PARAMETERS._replace(**parameters)
    found: dict[str, float] = {}
    for path in scenes:
        name = Path(path).stem
        if name in REPLAY:
            found |= _replay(module(realism), path, name, fast)
        if name in FREE:
            found |= _free(module(turing), path, name)
    few = {"densities": (0.5, 1.0, 1.5, 2.0, 3.0, 4.0), "settle": 5, "measure": 5} if fast else {}
    corridor = module(realism).corridor(simulate, **few)
    found["corridor Weidmann"], found["corridor measured"] = corridor["rmse"] / 0.12, corridor["rmse_measured"] / 0.20
    few = {"widths": (0.8, 1.2), "limit": 60.0} if fast else {}
    for row in module(realism).bottleneck(simulate, **few)["rows"]:
        found[f"door {row['width']}"] = abs(row["specific_flow"] - 2.0) / 0.15
        found[f"not passed at {row['width']}"] = max(72 - row["passed"], 0) / 5.0
    return found


@cache
def _straight(protocol: Any, path: str, step: int) -> float:
    """ADE of walking straight to the goal in every n-th window, m: how hard these windows are."""
    return float(_in_windows(protocol, protocol.load("straight"), path, step)["ADE"])


def _in_windows(protocol: Any, walk: Any, path: str, step: int) -> Any:
    every = protocol.windows
    protocol.windows = lambda scene, oracle: list(every(scene, oracle))[::step]
    try:
        return protocol.replay(walk, protocol.Scene(path))
    finally:
        protocol.windows = every


def _replay(protocol: Any, path: str, name: str, fast: bool) -> dict[str, float]:
    ade, nearest, urgency = REPLAY[name]
    step = SKIPPED[name] if fast else 1
    row = _in_windows(protocol, simulate, path, step)
    scale = _straight(protocol, path, step) / _straight(protocol, path, 1)
    noise = 0.9 if fast else 1.0  # fewer windows make distributions differ more
    found = {f"{name} ADE": row["ADE"] / (ade * scale), f"{name} nearest": noise * row["W_nn"] / nearest}
    if urgency is not None:
        found[f"{name} urgency"] = noise * row["W_urgency"] / urgency
    return found | {f"{name} contacts": row["contacts"] / 2.0, f"{name} walls": row["wall_hits"] / 0.5}


def _free(protocol: Any, path: str, name: str) -> dict[str, float]:
    auc, speed = FREE[name]
    with tempfile.TemporaryDirectory() as folder:
        real, simulated = free_run(path, Path(folder))
        row = protocol.compare(str(real), str(simulated), name)
    found = {f"{name} AUC": row["AUC"] / auc, f"{name} free speed": row["W speed"] / speed}
    found |= {f"{name} free nearest": row["W nearest"] / 0.04, f"{name} free urgency": row["W urgency"] / 0.05}
    for k, letter in enumerate("pk"):
        ours, theirs = row["energy p,k sim"][k], row["energy p,k real"][k]
        difference = abs(ours / theirs - 1.0) / 0.2 if ours is not None and theirs else 3.0
        found[f"{name} energy {letter}"] = min(difference, 3.0)
    for k, what in enumerate(("p50", "p90", "angle")):
        if "pairs real" in row:  # groups that break up leave no pairs
            ours = row["pairs sim"][k] if "pairs sim" in row else math.inf
            found[f"{name} pairs {what}"] = min(abs(ours / row["pairs real"][k] - 1.0) / 0.1, 3.0)
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


def cost_of_point(point: Any, realism: str, turing: str, scenes: Sequence[str]) -> float:
    return cost(figures(decoded(point), realism, turing, scenes, fast=True))


def show(ratios: dict[str, float]) -> None:
    for name, value in ratios.items():
        print(f"{name:28} {value:6.2f} of the target")


def ablate(arguments: argparse.Namespace) -> None:
    """Print the figures that get worse by a tenth of their target without each parameter."""
    evaluate = partial(figures, realism=arguments.realism, turing=arguments.turing, scenes=arguments.scenes, fast=False)
    own = model.PARAMETERS._asdict()
    whole = evaluate(own)
    print(f"{'all parameters':24} cost {cost(whole):7.2f}")
    for name, value in NEUTRAL.items():
        without = evaluate({**own, name: own[value] if isinstance(value, str) else value})
        worse = {k: f"{whole[k]:.2f} -> {without[k]:.2f}" for k in whole if without[k] > max(whole[k], 0.9) + 0.1}
        print(f"{'without ' + name:32} cost {cost(without):7.2f}  {json.dumps(worse)}", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("realism")
    parser.add_argument("turing")
    parser.add_argument("scenes", nargs="+")
    parser.add_argument("--minutes", type=float, default=120.0)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--state", type=Path, default=Path("calibration.pickle"))
    parser.add_argument("--refine", action="store_true")
    parser.add_argument("--ablation", action="store_true")
    arguments = parser.parse_args()
    if arguments.ablation:
        ablate(arguments)
        return
    import cma

    options = {"bounds": [0.0, 1.0], "seed": 1, "verbose": -9, "popsize": 12}
    start = encoded(model.PARAMETERS._asdict()) if arguments.refine else [0.5] * len(RANGES)
    search = cma.CMAEvolutionStrategy(start, 0.1 if arguments.refine else 0.2, options)
    if arguments.state.exists():
        search = pickle.loads(arguments.state.read_bytes())
    until = time.monotonic() + 60.0 * arguments.minutes
    fixed = {"realism": arguments.realism, "turing": arguments.turing, "scenes": arguments.scenes}
    with ProcessPoolExecutor(arguments.workers) as pool:
        while time.monotonic() < until and not search.stop():
            points = search.ask()
            search.tell(points, list(pool.map(partial(cost_of_point, **fixed), points)))
            arguments.state.write_bytes(pickle.dumps(search))
            print(f"{search.countevals:5d} {search.result.fbest:9.3f}", flush=True)
    best = {name: round(value, 4) for name, value in decoded(search.result.xbest).items()}
    print(best)
    show(figures(best, **fixed, fast=False))


if __name__ == "__main__":
    main()
