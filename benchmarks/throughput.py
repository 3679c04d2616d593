"""Cost of a whole frame relative to the bare physics step of the same world in the same run.

    python benchmarks/throughput.py [--people 5 10 20 50 100] [--model sonata2026 ...] [--repeats 5] [--json]

Episodes of 200 frames in a room of 8 walls and 8 pieces of furniture, 4 m2 or more a person: scene, snapshot,
controller, crowd, physics, recording and the JSON file on disk are included. "engine" is the sum, over the steps of
the same run, of the shortest time that `pymunk.Space.step` took in any repeat.
"""

from __future__ import annotations

import argparse
import json
import math
import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pymunk

import sonata2d as s2

FRAMES = 200


def scenario(people: int, model: str) -> s2.ScenarioConfig:
    """An L-shaped room with two inner walls that grows with the number of people."""
    a = math.sqrt(max(4.0 * people, 60.0) / 3.0)
    polygon = [[-a, -a], [a, -a], [a, 0], [0, 0], [0, a], [-a, a]]
    return s2.ScenarioConfig(
        name="throughput",
        room={"polygon": polygon, "walls": [[-a, 0, -a + 1, 0], [0, -a, 0, -a + 1]]},
        standing=0, wandering=people, tables=4, plants=4, relations=0, laptops_on_tables=False,
        person={"model": model},
        rules={"time_limit": FRAMES / 10, "ends_on": ["time"]},
    )  # fmt: skip


def run(config: s2.ScenarioConfig, controller: s2.Controller, path: Path) -> float:
    """CPU seconds of one episode, from its settings to its file."""
    start = time.process_time()
    scene = s2.generate(config, seed=1)
    with s2.JsonRecorder(path) as recorder:
        s2.Episode(scene, controller, observers=[recorder]).run()
    return time.process_time() - start


def timed(function: Callable[..., Any], into: list[float]) -> Callable[..., Any]:
    """Wrap a function so that the duration of each call is appended to `into`."""

    def wrapper(*arguments: Any) -> Any:
        start = time.perf_counter()
        result = function(*arguments)
        into.append(time.perf_counter() - start)
        return result

    return wrapper


def calls_of(owner: Any, name: str, work: Callable[[], Any]) -> list[float]:
    """Duration of each call of a method during `work`, s."""
    original, seconds = getattr(owner, name), []
    setattr(owner, name, timed(original, seconds))
    try:
        work()
    finally:
        setattr(owner, name, original)
    return seconds


def measure(people: int, model: str, repeats: int, folder: Path) -> dict[str, float | str]:
    """One row of the table."""
    config, path = scenario(people, model), folder / "episode.json"
    run(config, s2.StraightToGoal(), path)
    total, steps = [], []
    for _ in range(repeats):
        total.append(run(config, s2.StraightToGoal(), path))
        steps.append(calls_of(pymunk.Space, "step", lambda: run(config, s2.StraightToGoal(), path)))
    engine = sum(min(each) for each in zip(*steps, strict=True))
    planner = calls_of(s2.SocialPlanner, "act", lambda: run(config, s2.SocialPlanner(), path))
    frame = statistics.median(total) / FRAMES
    return {
        "people": people,
        "model": model,
        "frames per CPU second": round(1 / frame),
        "frame (us)": round(frame * 1e6, 1),
        "engine (us)": round(engine / FRAMES * 1e6, 1),
        "frame / engine": round(frame * FRAMES / engine, 1),
        "social-planner's act (us)": round(statistics.median(planner) * 1e6, 1),
        "human-step (us)": round(frame * 1e6 / people, 2),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--people", type=int, nargs="+", default=[5, 10, 20, 50, 100])
    parser.add_argument("--model", nargs="+", default=["sonata2026"])
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        rows = [
            measure(people, model, arguments.repeats, Path(folder))
            for people in arguments.people
            for model in arguments.model
        ]
    if arguments.json:
        print(json.dumps(rows, indent=2))
        return
    print("".join(f"{name:>27}" for name in rows[0]))
    for row in rows:
        print("".join(f"{value:>27}" for value in row.values()))


if __name__ == "__main__":
    main()
