"""A short benchmark of this machine: frames beside the bare physics engine, start-up, memory, scaling and reading.

python benchmarks/machine.py [--workers N] [--picture bench.png] [--json]

Takes about a minute. Compare figures of one run; those of different runs only on a machine that does nothing else.
docs/performance.md says what to expect. The picture (.png, .pdf or .svg) needs the extra `plots`.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import os
import platform
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from engine import FRAMES, crowded_room, engine_steps, run_episode, shortest

import sonata2d as s2
from sonata2d.core.compiled.kernel import BACKEND
from sonata2d.learning import GraphSamples
from sonata2d.record.layout import software_versions
from sonata2d.version import PHYSICS_VERSION

PEOPLE = (10, 20, 50)
SCENARIO = "sonata-2020"  # of the other measurements
_REPEATS = 3
_PROBE = 40  # episodes of a first generation, which shows how many take `_LEAST_SECONDS`
_LEAST_SECONDS = 4.0  # of a generation with one process
_MOST_EPISODES = 4000
_MEASURES_MEMORY = importlib.util.find_spec("resource") is not None  # Windows has no such module
_IMPORT = "import sonata2d"
_FIRST_FRAME = (
    "import sonata2d as s2; s2.Episode(s2.generate(s2.load_scenario('sonata-2020'), 1), s2.StraightToGoal()).step()"
)
_GENERATION = (
    "import resource, sys, tempfile; import sonata2d as s2; folder = tempfile.TemporaryDirectory();"
    "s2.generate_dataset(folder.name + '/set', episodes=int(sys.argv[1]));"
    "print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)"
)


@dataclass(frozen=True, slots=True)
class Throughput:
    """Cost of a frame: scene, snapshot, controller, crowd, physics, recording and the file on disk.

    Attributes:
        people: number of pedestrians, beside 8 walls and 8 pieces of furniture.
        frame, engine: time of a frame, and of the physics engine's own step of the same world, us of one processor.
        ratio: of the two.
    """

    people: int
    frame: float
    engine: float
    ratio: float


@dataclass(frozen=True, slots=True)
class Scaling:
    """Speed of a generation.

    Attributes:
        workers: number of processes.
        episodes_per_second: of processes that are already running.
        speedup: against one process.
    """

    workers: int
    episodes_per_second: float
    speedup: float


@dataclass(frozen=True, slots=True)
class Benchmark:
    """The figures of one run.

    Attributes:
        machine: processor, number of processors, and versions.
        startup: `import` and `first_frame`, seconds of a process from its start.
        throughput: by number of pedestrians.
        memory: largest resident set of a process, MB, by the number of episodes that it generates.
        scaling: by number of processes.
        reading: records, graphs and files (with `json.load`) per second, and `random_access`, ms for one episode.
    """

    machine: dict[str, str]
    startup: dict[str, float]
    throughput: list[Throughput]
    memory: dict[int, int]
    scaling: list[Scaling]
    reading: dict[str, float]

    def to_json(self) -> dict[str, Any]:
        """All figures as a JSON object."""
        return {**asdict(self), "memory": {str(episodes): size for episodes, size in self.memory.items()}}

    def rows(self) -> list[tuple[str, str]]:
        """All figures as names and texts."""
        startup, reading = self.startup, self.reading
        sizes = [f"{size} MB for {count} episodes" for count, size in self.memory.items()]
        megabytes = ", ".join(sizes) or "not measured on Windows"
        return [
            ("machine", f"{self.machine['processor']}, {self.machine['processors']} processors; {BACKEND}"),
            ("start-up", f"import {startup['import']:.2f} s, first frame after {startup['first_frame']:.2f} s"),
            *(
                (
                    f"{one.people} people",
                    f"{one.frame:.0f} us a frame, {one.ratio:.1f} times the bare engine ({one.engine:.0f} us)",
                )
                for one in self.throughput
            ),
            ("memory", megabytes),
            *(
                (
                    f"{one.workers} process{'es' * (one.workers != 1)}",
                    f"{one.episodes_per_second:.0f} episodes/s, {one.speedup:.2f} times as fast as one",
                )
                for one in self.scaling
            ),
            ("reading", f"{reading['records']:.0f} episodes/s, {reading['json']:.0f} with json.load alone"),
            ("graphs", f"{reading['graphs']:.0f} a second, made of the files"),
            ("random access", f"{reading['random_access']:.1f} ms an episode"),
        ]


def benchmark(workers: int) -> Benchmark:
    """Measure this machine, with processes up to a number of them."""
    with tempfile.TemporaryDirectory(prefix="sonata2d-") as place:
        folder = Path(place)
        startup = {"import": _seconds_of(_IMPORT), "first_frame": _seconds_of(_FIRST_FRAME)}
        throughput = [_throughput(people, folder / "episode.json") for people in PEOPLE]
        memory = {count: _megabytes(count) for count in (20, 200)} if _MEASURES_MEMORY else {}
        scaling = _scaling(folder, workers)
        reading = _reading(s2.Dataset(folder / "1"))
    machine = {"processor": _processor(), "processors": str(os.cpu_count()), "physics": str(PHYSICS_VERSION)}
    return Benchmark(machine | software_versions(), startup, throughput, memory, scaling, reading)


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    names = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(names, platform.machine())


def _seconds_of(code: str) -> float:
    """Seconds of a process that runs some code: the median of a few."""

    def once() -> float:
        start = time.perf_counter()
        subprocess.run([sys.executable, "-c", code], check=True)
        return time.perf_counter() - start

    once()  # files are in memory then, and the simulation is compiled
    return round(statistics.median(once() for _ in range(_REPEATS)), 3)


def _megabytes(episodes: int) -> int:
    done = subprocess.run(
        [sys.executable, "-c", _GENERATION, str(episodes)], check=True, capture_output=True, text=True
    )
    kilobytes = int(done.stdout.split()[-1]) / (1024 if sys.platform == "darwin" else 1)  # bytes on macOS
    return round(kilobytes / 1000)


# Throughput


def _throughput(people: int, path: Path) -> Throughput:
    config = crowded_room(people)

    def run() -> float:
        return run_episode(config, s2.StraightToGoal(), path)[0]

    run()  # compiles
    frames, engine = [], []
    for _ in range(_REPEATS):  # interleaved, so that a busy machine slows both
        frames.append(run())
        engine.append(engine_steps(run))
    frame, bare = (seconds / FRAMES * 1e6 for seconds in (statistics.median(frames), shortest(engine)))
    return Throughput(people, round(frame, 1), round(bare, 1), round(frame / bare, 2))


# Scaling and reading


def _scaling(folder: Path, most: int) -> list[Scaling]:
    """Generate the same data set with one process, two, four and so on, into folders of these names."""
    start = time.perf_counter()
    s2.generate_dataset(folder / "probe", SCENARIO, episodes=_PROBE)
    seconds = (time.perf_counter() - start) / _PROBE
    episodes = min(max(round(_LEAST_SECONDS / seconds), _PROBE), _MOST_EPISODES)
    counts = sorted({2**k for k in range(most.bit_length()) if 2**k <= most} | {most})
    rates: dict[int, float] = {}
    for count in counts:
        with s2.Workers(count) as pool:
            s2.generate_dataset(folder / f"started{count}", SCENARIO, episodes=2 * count, workers=pool)
            start = time.perf_counter()
            s2.generate_dataset(folder / str(count), SCENARIO, episodes=episodes, workers=pool)
            rates[count] = episodes / (time.perf_counter() - start)
    return [Scaling(count, round(rate, 1), round(rate / rates[1], 2)) for count, rate in rates.items()]


def _reading(dataset: s2.Dataset) -> dict[str, float]:
    """Rates of reading a data set of files."""
    files = [dataset.path / path.name for path in dataset.files]

    def parsed() -> Iterable[Any]:
        for path in files:
            with path.open(encoding="utf-8") as file:
                yield json.load(file)

    def rate(items: Iterable[Any]) -> float:
        start = time.perf_counter()
        count = sum(1 for _ in items)
        return round(count / (time.perf_counter() - start), 1)

    rate(parsed())  # files are in memory then

    start = time.perf_counter()
    for k in range(100):
        dataset[k * 7919 % len(dataset)]
    access = (time.perf_counter() - start) * 10.0
    return {
        "records": rate(dataset),
        "json": rate(parsed()),
        "graphs": rate(dataset.stream(GraphSamples())),
        "random_access": round(access, 2),
    }


def _draw(figures: Benchmark, path: Path) -> None:
    """Draw the figures."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10.0, 6.4), layout="constrained")
    axes = figure.subplots(2, 2)
    people = [str(one.people) for one in figures.throughput]
    bars = {
        "frame": [one.frame for one in figures.throughput],
        "bare engine": [one.engine for one in figures.throughput],
    }
    for k, (name, values) in enumerate(bars.items()):
        drawn = axes[0, 0].bar([number + 0.4 * k - 0.2 for number in range(len(people))], values, 0.4, label=name)
        axes[0, 0].bar_label(drawn, fmt="%.0f")
    axes[0, 0].set_xticks(range(len(people)), people)
    axes[0, 0].set(title="One frame, with recording", xlabel="people", ylabel="us")
    axes[0, 0].margins(y=0.12)
    axes[0, 0].legend()
    workers = [one.workers for one in figures.scaling]
    axes[0, 1].plot(workers, [one.speedup for one in figures.scaling], "o-", label="measured")
    axes[0, 1].plot(workers, workers, ":", label="ideal")
    axes[0, 1].set(title="generate", xlabel="processes", ylabel="times as fast as one", xticks=workers)
    axes[0, 1].legend()
    names = {"records": "Dataset", "json": "json.load"}
    drawn = axes[1, 0].barh(list(names.values()), [figures.reading[name] for name in names])
    axes[1, 0].bar_label(drawn, fmt="%.0f", padding=3)
    axes[1, 0].margins(x=0.15)
    axes[1, 0].set(title="Reading", xlabel=f"episodes a second ({figures.reading['graphs']:.0f} graphs a second)")
    startup = {"import": figures.startup["import"], "first frame": figures.startup["first_frame"]}
    drawn = axes[1, 1].barh(list(startup), list(startup.values()))
    axes[1, 1].bar_label(drawn, fmt="%.2f s", padding=3)
    axes[1, 1].margins(x=0.25)
    memory = ", ".join(f"{size} MB for {count}" for count, size in figures.memory.items()) or "not measured"
    axes[1, 1].set(title="Start of a process", xlabel=f"s (memory: {memory} episodes)")
    processor = f"{figures.machine['processor']}, {figures.machine['processors']} processors"
    figure.suptitle(f"sonata2d {figures.machine['sonata2d']} on {processor}")
    figure.savefig(path, dpi=120)


def main() -> None:
    """Measure this machine, and print or draw the figures."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1, help="largest number of processes")
    parser.add_argument("--picture", type=Path, help="draw the figures: .png, .pdf or .svg")
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    figures = benchmark(arguments.workers)
    if arguments.picture is not None:
        _draw(figures, arguments.picture)
    if arguments.json:
        print(json.dumps(figures.to_json(), indent=2))
        return
    for name, text in figures.rows():
        print(f"{name:15}{text}")


if __name__ == "__main__":
    main()
