"""Speed of writing and reading each format, in MB/s of its own files, and of the standard library's JSON.

    python benchmarks/formats.py [--episodes 5] [--seconds 60] [--json]

Medians of several repeats in one process.
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
from sonata2d.formats.api import export_to, import_from
from sonata2d.formats.format import Options
from sonata2d.registry import FORMATS

REPEATS = 3


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--episodes", type=int, default=5)
    parser.add_argument("--seconds", type=float, default=60.0, help="of each episode")
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder) / "episodes"
        generate_episodes(source, arguments.episodes, arguments.seconds)
        rows = [json_speed(source), *(row for name in FORMATS if (row := format_speed(name, source, Path(folder))))]
    if arguments.json:
        print(json.dumps(rows, indent=2))
        return
    for row in rows:
        print("{format:10}  {megabytes:7.2f} MB  out {out_mb_s:7.1f} MB/s  in {in_mb_s:7.1f} MB/s".format(**row))


def generate_episodes(folder: Path, episodes: int, seconds: float) -> None:
    """Write episodes with five people and some furniture."""
    settings = {"time_limit": seconds, "ends_on": ["time"]}
    config = s2.ScenarioConfig(standing=2, wandering=3, tables=1, plants=1, relations=0, rules=settings)
    for k in range(episodes):
        with s2.JsonRecorder(folder / f"{k:06d}.json") as recorder:
            s2.Episode(s2.generate(config, 1, k), s2.StraightToGoal(), observers=[recorder]).run()


def json_speed(folder: Path) -> dict[str, object]:
    """`json.loads` and `json.dumps` of the standard library on the episode files."""
    files = sorted(folder.iterdir())
    size = sum(path.stat().st_size for path in files) / 1e6
    trees = [json.loads(path.read_bytes()) for path in files]
    read = median_seconds(lambda: [json.loads(path.read_bytes()) for path in files])
    write = median_seconds(lambda: [json.dumps(tree) for tree in trees])
    return {"format": "json", "megabytes": size, "out_mb_s": size / write, "in_mb_s": size / read}


def format_speed(name: str, source: Path, folder: Path) -> dict[str, object] | None:
    """The speed of one format; None if its package is not installed or it refuses the episodes."""
    out = folder / name
    try:
        write = median_seconds(lambda: export_to(source, name, out))
    except RecordError:
        return None
    if not out.exists():  # every episode was refused: too short for the format
        return None
    size = sum(path.stat().st_size for path in out.iterdir()) / 1e6
    read = median_seconds(lambda: import_from(out, name, folder / f"{name}-back", Options(frame_time=0.1)))
    return {"format": name, "megabytes": size, "out_mb_s": size / write, "in_mb_s": size / read}


def median_seconds(work: Callable[[], object]) -> float:
    """Median wall time of several calls, s."""
    seconds = []
    for _ in range(REPEATS):
        start = time.perf_counter()
        work()
        seconds.append(time.perf_counter() - start)
    return statistics.median(seconds)


if __name__ == "__main__":
    main()
