"""Cost of a whole frame relative to the bare physics step of the same world in the same run.

    python benchmarks/throughput.py [--people 5 10 20 ...] [--model sonata2026 ...] [--repeats 5] [--json]

Episodes of 200 frames in a room of 8 walls and 8 pieces of furniture, 4 m2 or more a person: scene, snapshot,
controller, crowd, physics, recording and the JSON file on disk are included; compiling is not. "tick" leaves out what
comes before the first tick: generating the scene and building the episode. "human-step" is the time of a frame per
person, and "relative" this time relative to that at 10 people. "engine" is the sum,
over the steps of the same run, of the shortest time that the engine's C function `cpSpaceStep` took in any repeat;
"Space.step" is the same for pymunk's Python method, which calls it. "planner" is what `social-planner` takes, its
preparation at the start of the episode included.
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
from unittest.mock import patch

from engine import FRAMES, crowded_room, engine_steps, run_episode, shortest

import sonata2d as s2
from sonata2d.core.compiled.kernel import BACKEND

PEOPLE = (5, 10, 20, 50, 100, 200, 500, 1000)


def timed(function: Callable[..., Any], into: list[float]) -> Callable[..., Any]:
    """Wrap a function so that the duration of each call is appended to `into`, s."""

    def wrapper(*arguments: Any) -> Any:
        start = time.perf_counter()
        result = function(*arguments)
        into.append(time.perf_counter() - start)
        return result

    return wrapper


def planner_seconds(config: s2.ScenarioConfig, path: Path) -> float:
    """CPU-bound seconds that `social-planner` takes in an episode."""
    seconds: list[float] = []
    with (
        patch.object(s2.SocialPlanner, "act", timed(s2.SocialPlanner.act, seconds)),
        patch.object(s2.SocialPlanner, "reset", timed(s2.SocialPlanner.reset, seconds)),
    ):
        run_episode(config, s2.SocialPlanner(), path)
    return sum(seconds)


def measure(people: int, model: str, repeats: int, folder: Path) -> dict[str, float | str]:
    """One row of the table."""
    config, path = crowded_room(people, model), folder / "episode.json"
    run_episode(config, s2.StraightToGoal(), path)
    run_episode(config, s2.SocialPlanner(), path)
    total, planner, c_steps, python_steps = [], [], [], []

    def straight() -> tuple[float, float]:
        return run_episode(config, s2.StraightToGoal(), path)

    for _ in range(repeats):  # interleaved, so that a busy machine slows all of them
        total.append(straight())
        planner.append(planner_seconds(config, path))
        c_steps.append(engine_steps(straight, through_pymunk=False))
        python_steps.append(engine_steps(straight, through_pymunk=True))
    engine, space_step = shortest(c_steps), shortest(python_steps)
    frame, tick = (statistics.median(seconds) for seconds in zip(*total, strict=True))
    best, extra = min(total)[0], statistics.median(planner)
    return {
        "people": people,
        "model": model,
        "frames per CPU second": round(FRAMES / frame),
        "frame (us)": round(frame / FRAMES * 1e6, 1),
        "best frame (us)": round(best / FRAMES * 1e6, 1),
        "tick (us)": round(tick / FRAMES * 1e6, 1),
        "engine (us)": round(engine / FRAMES * 1e6, 1),
        "Space.step (us)": round(space_step / FRAMES * 1e6, 1),
        "frame / engine": round(frame / engine, 1),
        "tick / engine": round(tick / engine, 1),
        "frame / Space.step": round(frame / space_step, 1),
        "planner (us)": round(extra / FRAMES * 1e6, 1),
        "planner / engine": round(extra / engine, 1),
        "human-step (us)": round(frame / FRAMES * 1e6 / people, 2),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--people", type=int, nargs="+", default=PEOPLE)
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
    at_10 = {row["model"]: row["human-step (us)"] for row in rows if row["people"] == 10}
    for row in rows:
        row["relative"] = round(float(row["human-step (us)"]) / float(at_10.get(row["model"], math.nan)), 2)
    if arguments.json:
        print(json.dumps(rows, indent=2))
        return
    print(BACKEND)
    print("".join(f"{name:>23}" for name in rows[0]))
    for row in rows:
        print("".join(f"{value:>23}" for value in row.values()))


if __name__ == "__main__":
    main()
