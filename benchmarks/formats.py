"""How fast each format is written and read, in MB/s of its own files, beside the standard library on the same episodes.

    python benchmarks/formats.py [--episodes 5] [--seconds 60] [--json]

Medians of several repeats in one process; nothing of it is asserted anywhere.
"""

from __future__ import annotations

import argparse
import json
import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import sonata2d as s2
from sonata2d.errors import RecordError
from sonata2d.formats.api import FORMATS, export_to, import_from
from sonata2d.formats.base import Options

REPEATS = 3


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--episodes", type=int, default=5)
    parser.add_argument("--seconds", type=float, default=60.0, help="of each episode")
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder) / "episodes"
        made(source, given.episodes, given.seconds)
        rows = [native(source), *(row for name in FORMATS if (row := measured(name, source, Path(folder))))]
    if given.json:
        print(json.dumps(rows, indent=2))
        return
    for row in rows:
        print("{format:10}  {megabytes:7.2f} MB  out {out_mb_s:7.1f} MB/s  in {in_mb_s:7.1f} MB/s".format(**row))


def made(folder: Path, episodes: int, seconds: float) -> None:
    """Episodes of five people and some furniture."""
    settings = {"time_limit": seconds, "ends_on": ["time"]}
    config = s2.ScenarioConfig(standing=2, wandering=3, tables=1, plants=1, relations=0, rules=settings)
    for k in range(episodes):
        with s2.JsonRecorder(folder / f"{k:06d}.json") as recorder:
            s2.Episode(s2.generate(config, 1, k), s2.StraightToGoal(), observers=[recorder]).run()


def native(folder: Path) -> dict[str, object]:
    """The episode files themselves: `json.loads` and `json.dumps` of the standard library."""
    files = sorted(folder.iterdir())
    size = sum(path.stat().st_size for path in files) / 1e6
    trees = [json.loads(path.read_bytes()) for path in files]
    read = timed(lambda: [json.loads(path.read_bytes()) for path in files])
    write = timed(lambda: [json.dumps(tree) for tree in trees])
    return {"format": "json", "megabytes": size, "out_mb_s": size / write, "in_mb_s": size / read}


def measured(name: str, source: Path, folder: Path) -> dict[str, object] | None:
    """One format; None if its package is not installed."""
    out = folder / name
    try:
        write = timed(lambda: export_to(source, name, out))
    except RecordError:
        return None
    size = sum(path.stat().st_size for path in out.iterdir()) / 1e6
    read = timed(lambda: import_from(out, name, folder / f"{name}-back", Options(frame_time=0.1)))
    return {"format": name, "megabytes": size, "out_mb_s": size / write, "in_mb_s": size / read}


def timed(work: Callable[[], object]) -> float:
    """Median seconds."""
    taken = []
    for _ in range(REPEATS):
        start = time.perf_counter()
        work()
        taken.append(time.perf_counter() - start)
    return statistics.median(taken)


if __name__ == "__main__":
    main()
