"""Goal rate of a controller and its contacts by its own fault, in unseen scenes.

    python benchmarks/expert.py [--episodes 200] [--controller social-planner] [--kinematics unicycle]
        [--seed 100000] [--workers 2] [--json]

Half of the people ignore the robot. A run counts as a contact by its fault if at any tick the robot touched a person
and its own velocity closed the gap.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterable
from concurrent.futures import ProcessPoolExecutor
from functools import partial

import numpy as np

import sonata2d as s2
from sonata2d.agents.controllers.loading import load_controller
from sonata2d.core.scene import Scene
from sonata2d.core.snapshot import ControllerInfo, Frame, Outcome, Snapshot

PRESETS = ("sonata-2020", "sonata-2020-crowded")


class ContactObserver:
    """An observer of contacts and clearances."""

    def __init__(self) -> None:
        self.at_fault = self.touched = self.touched_object = False
        self.nearest, self.near = float("inf"), []

    def open(self, scene: Scene, controller_info: ControllerInfo) -> None: ...

    def on_frame(self, frame: Frame) -> None:
        self._observe(frame.snapshot)

    def close(self, last: Snapshot, outcome: Outcome) -> None:
        self._observe(last)

    def _observe(self, snapshot: Snapshot) -> None:
        for contact in snapshot.contacts:
            if contact.kind == "human":
                self.touched, self.at_fault = True, self.at_fault or contact.robot_at_fault
            elif contact.robot_at_fault:
                self.touched_object = True
        gap = s2.clearance(snapshot)
        self.nearest = min(self.nearest, gap)
        self.near.append(gap < s2.INTIMATE_DISTANCE)


def run_one(seed: int, preset: str, controller: str, kinematics: str) -> dict[str, float]:
    """The result of one scene."""
    config = s2.load_scenario(preset)
    person = config.person.model_copy(update={"ignores_robot": 0.5})
    robot = config.robot.model_copy(update={"kinematics": kinematics})
    config = config.model_copy(update={"person": person, "robot": robot})
    observer = ContactObserver()
    scene = s2.generate(config, seed=seed)
    start = time.process_time()
    outcome = s2.Episode(scene, load_controller(controller), observers=[observer]).run()
    return {
        "seed": seed,
        "goal": outcome.status == "goal",
        "contact by its fault": observer.at_fault,
        "contact": observer.touched,
        "contact with an object": observer.touched_object,
        "time": outcome.time,
        "intimate": float(np.mean(observer.near)) if observer.near else 0.0,
        "us per tick": (time.process_time() - start) / max(outcome.tick, 1) * 1e6,
    }


def table(rows: Iterable[dict[str, float]]) -> dict[str, object]:
    """Percentages and medians of many runs."""
    runs = list(rows)
    rates = ("goal", "contact by its fault", "contact", "contact with an object")
    return {
        "runs": len(runs),
        **{f"{name} (%)": round(100 * float(np.mean([r[name] for r in runs])), 1) for name in rates},
        "frames within 0.45 m of a person (%)": round(100 * float(np.mean([r["intimate"] for r in runs])), 1),
        "time, median (s)": round(float(np.median([r["time"] for r in runs])), 1),
        "CPU per tick, median (us)": round(float(np.median([r["us per tick"] for r in runs]))),
        "seeds not at the goal": [r["seed"] for r in runs if not r["goal"]],
        "seeds of contacts by its fault": [r["seed"] for r in runs if r["contact by its fault"]],
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--episodes", type=int, default=200)
    parser.add_argument("--seed", type=int, default=100_000, help="seed of the first episode")
    parser.add_argument("--controller", default="social-planner")
    parser.add_argument("--kinematics", default="holonomic", choices=["holonomic", "unicycle"])
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    seeds = range(arguments.seed, arguments.seed + arguments.episodes)
    run = partial(run_one, controller=arguments.controller, kinematics=arguments.kinematics)
    with ProcessPoolExecutor(arguments.workers) as pool:
        result = {preset: table(pool.map(partial(run, preset=preset), seeds, chunksize=5)) for preset in PRESETS}
    if arguments.json:
        print(json.dumps(result, indent=2))
        return
    for row in result[PRESETS[0]]:
        print(f"{row:40}" + "".join(f"{result[preset][row]!s:>24}" for preset in PRESETS))


if __name__ == "__main__":
    main()
