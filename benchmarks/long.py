"""Memory and time of an episode that is written as it goes, by its number of ticks.

python benchmarks/long.py [--ticks 10000 100000 1000000] [--people 10]

Each length is run in a process of its own; "memory" is the peak of its resident memory, and the file is `.json.zst`.
"""

from __future__ import annotations

import argparse
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import sonata2d as s2


def run(ticks: int, people: int) -> None:
    """Run an episode, and print its figures."""
    rules = {"time_limit": ticks / 10, "ends_on": ["time"]}
    scene = s2.generate(s2.load_scenario("empty").changed(wandering=people, rules=rules), seed=1)
    with tempfile.TemporaryDirectory() as folder:
        path, start = Path(folder) / "long.json.zst", time.process_time()
        s2.Episode(scene, s2.StraightToGoal(), observers=[s2.JsonRecorder(path)]).run()
        seconds, size = time.process_time() - start, path.stat().st_size
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"{ticks:>9} ticks: {seconds / ticks * 1e6:6.1f} us a tick, {memory:6.0f} MB, file {size / 1e6:8.1f} MB")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--ticks", type=int, nargs="+", default=(10_000, 100_000, 1_000_000))
    parser.add_argument("--people", type=int, default=10)
    parser.add_argument("--here", action="store_true", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    for ticks in arguments.ticks:
        if arguments.here:
            run(ticks, arguments.people)
        else:
            numbers = "--ticks", str(ticks), "--people", str(arguments.people)
            subprocess.run([sys.executable, __file__, *numbers, "--here"], check=True)


if __name__ == "__main__":
    main()
