"""Generates a large data set in one go, and measures what it takes to write, check and read it.

python benchmarks/large.py OUT [--episodes 100000] [--workers 2] [--shard-size 1000] [-o large.json]

The data sets are written to OUT: as files, in shards, and in compressed shards. Throughput is taken over the first and
the last tenth of the episodes; memory is the largest resident set of the program and of each worker.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import shutil
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import sonata2d as s2
from sonata2d.datasets import verify

VARIANTS: dict[str, dict[str, Any]] = {
    "files": {},
    "shards": {"shard_size": 1000},
    "compressed shards": {"shard_size": 1000, "suffix": ".json.zst"},
}


class Memory:
    """Samples the resident sets of this process and its children."""

    def __init__(self) -> None:
        self.parent, self.worker = 0, 0
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._watch, daemon=True)

    def __enter__(self) -> Memory:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._thread.join()

    def _watch(self) -> None:
        while not self._over.wait(0.5):
            self.parent = max(self.parent, _resident(os.getpid()))
            for child in _children():
                self.worker = max(self.worker, _resident(child))

    def megabytes(self) -> dict[str, int]:
        """Largest values."""
        return {"program": self.parent // 1000, "worker": self.worker // 1000}


def _resident(process: int) -> int:
    """Resident set of a process, kB; 0 if it has ended."""
    try:
        lines = Path(f"/proc/{process}/status").read_text().splitlines()
    except OSError:
        return 0
    return next((int(line.split()[1]) for line in lines if line.startswith("VmRSS")), 0)


def _children() -> list[int]:
    text = Path(f"/proc/self/task/{os.getpid()}/children").read_text()
    return [int(word) for word in text.split()]


def timed(work: Callable[[], Any]) -> dict[str, Any]:
    """Seconds and memory of some work."""
    with Memory() as memory:
        start = time.perf_counter()
        work()
        seconds = time.perf_counter() - start
    return {"seconds": round(seconds, 2), "megabytes": memory.megabytes()}


def generation(out: Path, episodes: int, workers: int, options: dict[str, Any]) -> dict[str, Any]:
    """Generate a data set."""
    times = [(0, time.perf_counter())]

    def advance(steps: int) -> None:
        times.append((times[-1][0] + steps, time.perf_counter()))

    def rate(low: float, high: float) -> int:
        part = [(count, at) for count, at in times if low * episodes <= count <= high * episodes]
        seconds = part[-1][1] - part[0][1]
        return round((part[-1][0] - part[0][0]) / seconds) if seconds else 0  # too few shards

    result = timed(
        lambda: s2.generate_dataset(
            out, "empty", "straight-to-goal", episodes=episodes, workers=workers, advance=advance, **options
        )
    )
    size = sum(path.stat().st_size for path in out.iterdir())
    return result | {
        "episodes_per_second": {
            "all": round(episodes / result["seconds"]),
            "first": rate(0, 0.1),
            "last": rate(0.9, 1),
        },
        "bytes": size,
        "bytes_per_episode": round(size / episodes),
    }


def reading(out: Path, workers: int) -> dict[str, Any]:
    """Check, describe and read a data set."""
    found = {"check": timed(lambda: verify(out, workers=workers)), "open": timed(lambda: len(s2.Dataset(out)))}
    found["describe"] = timed(lambda: subprocess.run(["sonata2d", "describe", out], stdout=subprocess.DEVNULL))
    dataset, chance = s2.Dataset(out), random.Random(0)
    numbers = [chance.randrange(len(dataset)) for _ in range(1000)]
    access = timed(lambda: [dataset[number].outcome for number in numbers])
    found["random access, ms"] = {"each": round(access["seconds"], 3)}
    for name, count in (("epoch", 1), (f"epoch, {workers} workers", workers)):
        found[name] = timed(lambda count=count: sum(1 for _ in dataset.stream(seconds_of, shuffle=1000, workers=count)))
    return found


def seconds_of(record: s2.EpisodeRecord) -> tuple[float]:
    """A small sample of an episode."""
    return (float(record.time[-1]),)


def json_epoch(out: Path) -> None:
    """Read every file with the standard library."""
    for path in sorted(out.glob("0*.json")):
        with path.open() as file:
            json.load(file)


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("out", type=Path)
    parser.add_argument("--episodes", type=int, default=100_000)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("-o", "--output", type=Path)
    options = parser.parse_args()
    found: dict[str, Any] = {"episodes": options.episodes, "workers": options.workers, "cpus": os.cpu_count()}
    for name, variant in VARIANTS.items():
        out = options.out / name.replace(" ", "-")
        found[name] = generation(out, options.episodes, options.workers, variant)
        print(name, json.dumps(found[name]), file=sys.stderr, flush=True)
        found[name] |= reading(out, options.workers)
        if name == "files":
            found[name]["epoch, json.load"] = timed(lambda out=out: json_epoch(out))
        print(name, json.dumps(found[name]), file=sys.stderr, flush=True)
        shutil.rmtree(out)
        if options.output:
            options.output.write_text(json.dumps(found, indent=2))
    print(json.dumps(found, indent=2))


if __name__ == "__main__":
    main()
