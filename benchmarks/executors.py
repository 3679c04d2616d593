"""Scaling from one process to several, and the overhead of Dask against processes of this machine.

python benchmarks/executors.py [--workers 2] [--episodes 400] [--repeats 3]

Scaling: generation, checks and evaluation with one process and with several that are already running, in turn,
so that a busy machine slows both; "2 programs" is what the machine allows: the same work in as many programs at once.
Overhead: the same generation in a local Dask cluster and in processes, with 10, 100 and 1000 episodes a task.
"""

from __future__ import annotations

import argparse
import json
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import sonata2d as s2
from sonata2d.datasets import verify
from sonata2d.workers import DaskExecutor

SCENARIO, CONTROLLER = "sonata-2020", "social-planner"
SHORT = {"scenario": "empty", "controller": "straight-to-goal"}  # episodes of 5 ms, of which a task has many
ALONE = "import sys; import sonata2d as s2; s2.generate_dataset(sys.argv[1], episodes=int(sys.argv[2]))"


def alternating(works: Sequence[Callable[[], Any]], repeats: int) -> list[list[float]]:
    """Seconds of each work, run in turn; one row per repetition."""
    return [[seconds(work) for work in works] for _ in range(repeats)]


def seconds(work: Callable[[], Any]) -> float:
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def generated(folder: Path, episodes: int, workers: Any, **options: Any) -> None:
    shutil.rmtree(folder, ignore_errors=True)
    s2.generate_dataset(folder, episodes=episodes, workers=workers, **options)


def scaling(folder: Path, count: int, episodes: int, repeats: int) -> dict[str, Any]:
    """Medians of the speed-up of each kind of work."""
    data = folder / "data"
    generated(data, episodes, 1)
    works: dict[str, Callable[[Any], Any]] = {
        "generate": lambda workers: generated(folder / "out", episodes, workers),
        "generate, shards": lambda workers: generated(folder / "out", episodes, workers, shard_size=episodes // 20),
        "check": lambda workers: verify(data, workers=workers),
        "check --replay": lambda workers: verify(data, replay=True, workers=workers),
        "evaluate": lambda workers: s2.evaluate(s2.Dataset(data), workers=workers, resamples=100),
    }
    found: dict[str, Any] = {}
    with s2.Workers(count) as workers:
        verify(data, workers=workers)  # the processes start
        for name, work in works.items():
            work(workers)
            pairs = alternating([partial(work, 1), partial(work, workers)], repeats)
            found[name] = round(statistics.median(one / several for one, several in pairs), 2)
            print(name, found[name], pairs, file=sys.stderr, flush=True)
    pairs = alternating([partial(programs, folder, episodes, 1), partial(programs, folder, episodes, count)], repeats)
    found[f"{count} programs"] = round(statistics.median(count * one / several for one, several in pairs), 2)
    return found


def programs(folder: Path, episodes: int, count: int) -> None:
    """Let as many programs generate a data set each, at once."""
    for number in range(count):
        shutil.rmtree(folder / f"alone{number}", ignore_errors=True)
    running = [
        subprocess.Popen([sys.executable, "-c", ALONE, str(folder / f"alone{number}"), str(episodes)])
        for number in range(count)
    ]
    for process in running:
        process.wait()


def overhead(folder: Path, count: int, repeats: int) -> dict[str, Any]:
    """Time with Dask relative to that with processes, by number of episodes a task."""
    found: dict[str, Any] = {}
    with DaskExecutor(workers=count) as executor, s2.Workers(count) as plain:
        for size in (10, 100, 1000):
            episodes = max(2000, 4 * size)
            dask = s2.Workers(executor, task_size=size)
            local = s2.Workers(count, task_size=size)
            for workers in (dask, local, plain):
                generated(folder / "out", 50, workers, **SHORT)  # the processes start
            works = [partial(generated, folder / "out", episodes, workers, **SHORT) for workers in (dask, local)]
            rows = alternating(works, repeats)
            local.close()
            found[f"{size} episodes a task"] = {
                "seconds": [[round(one, 2), round(other, 2)] for one, other in rows],
                "dask / processes": round(statistics.median(one / other for one, other in rows), 3),
                "ms more a task": round(
                    statistics.median(one - other for one, other in rows) / (episodes / size) * 1e3 * count, 1
                ),
            }
    return found


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--episodes", type=int, default=400)
    parser.add_argument("--repeats", type=int, default=3)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        found = {
            "scaling": scaling(folder, options.workers, options.episodes, options.repeats),
            "overhead": overhead(folder, options.workers, options.repeats),
        }
    print(json.dumps(found, indent=2))


if __name__ == "__main__":
    main()
