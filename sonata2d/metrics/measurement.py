"""Measuring: one record, a file, a data set on as many processors as asked for; and the file that keeps it."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import orjson

from ..datasets.check import Listed
from ..datasets.manifest import METRICS as METRICS_FILE
from ..datasets.manifest import write_tree
from ..datasets.verification import files_of
from ..record.layout import layout_of, software
from ..record.reader import read_episode
from ..record.record import EpisodeRecord
from .catalogue import ALL
from .definition import DEFINITIONS_VERSION, METRICS_FORMAT, Metric
from .disturbance import without_robot
from .missing import is_measurable
from .summary import LEVEL, RESAMPLES, Summary, differences, summarise
from .trajectory import Trajectory

Advance = Callable[[int], None]


@dataclass(frozen=True, slots=True)
class Measured:
    """The metrics of one run, and which it was; `scene` is a hash that tells scenes apart, whoever drove in them."""

    file: str
    sha256: str
    name: str
    family: str
    seed: int
    episode: int
    scene: str
    outcome: str
    values: dict[str, float | None]


@dataclass(frozen=True)
class Evaluation:
    """All that was measured of one controller, or of one data set.

    Args:
        label: what tables call it.
        runs: what was measured.
        resamples: of the bootstrap.
    """

    label: str
    runs: Sequence[Measured]
    resamples: int = RESAMPLES
    _known: dict[str, Summary] = field(default_factory=dict, repr=False, compare=False)

    def summary(self, name: str) -> Summary:
        """One metric over all runs."""
        if name not in self._known:
            self._known[name] = self._over(name, self.runs)
        return self._known[name]

    def summaries(self) -> dict[str, Any]:
        """Every metric over all runs, over those that reached the goal, and over those of each family, as JSON."""
        families = sorted({run.family for run in self.runs})
        return {
            "all": self._table(self.runs),
            "successful": self._table([run for run in self.runs if run.values.get("success")]),
            "by_family": {family: self._table([r for r in self.runs if r.family == family]) for family in families},
        }

    def less(self, other: Evaluation, name: str) -> Summary:
        """This one's metric less the other's, run by run in the scenes that both were in."""
        mine, others = ({run.scene: run.values for run in each.runs} for each in (self, other))
        return differences(others, mine, name, resamples=self.resamples)

    def _over(self, name: str, runs: Sequence[Measured]) -> Summary:
        return summarise([run.values.get(name) for run in runs], resamples=self.resamples)

    def _table(self, runs: Sequence[Measured]) -> dict[str, Any]:
        return {name: self._over(name, runs).tree() for name in self.runs[0].values} if self.runs else {}


def measure(
    record: EpisodeRecord, metrics: Iterable[Metric] = tuple(ALL.values()), *, rerun: bool = True
) -> dict[str, float | None]:
    """The metrics of one run.

    Args:
        record: the episode.
        metrics: which; by default all and their variants.
        rerun: also run the seed without a robot, to see what the robot cost the people; takes as long as an episode
            does, and is left out where this version's physics did not make the episode.

    Returns:
        By name; None where a metric is not defined, or rests on what an imported run does not tell.
    """
    run = Trajectory(record, without_robot(record) if rerun else None)
    return {metric.name: metric.of(run) if is_measurable(metric, record) else None for metric in metrics}


def measure_files(
    paths: Sequence[Path],
    *,
    rerun: bool = True,
    workers: int = 1,
    advance: Advance = lambda step: None,
) -> list[Measured]:
    """The metrics of each file.

    Args:
        paths: episode files.
        rerun: as for `measure`.
        workers: processes. With more than one, a script must guard its start by `if __name__ == "__main__":`.
        advance: is told how many files are done, as they are.

    Raises:
        RecordError: a file cannot be read.
    """
    found = []
    with _mapper(workers if len(paths) > 1 else 1) as each:
        for one in each(partial(_measured, rerun=rerun), paths):
            found.append(one)
            advance(1)
    return found


def episode_files(path: Path) -> list[Path]:
    """The one episode file, or those of a folder.

    Raises:
        RecordError: there is no such file or folder, no episode in it, or its manifest is damaged.
    """
    return [file.path if isinstance(file, Listed) else file for file in files_of(path)]


def keep(folder: Path, evaluation: Evaluation) -> Path:
    """Write `metrics.json` beside the episodes; its path.

    Raises:
        RecordError: it cannot be written.
    """
    write_tree(folder / METRICS_FILE, tree_of(evaluation) | {"software": software()})
    return folder / METRICS_FILE


def tree_of(evaluation: Evaluation) -> dict[str, Any]:
    """An evaluation as JSON: the version of the definitions, every run, and what they come to."""
    names: Mapping[str, Any] = evaluation.runs[0].values if evaluation.runs else {}
    return {
        "format": METRICS_FORMAT,
        "version": DEFINITIONS_VERSION,
        "metrics": {name: {"unit": ALL[name].unit, "better": ALL[name].better} for name in names},
        "bootstrap": {"level": LEVEL, "resamples": evaluation.resamples, "seed": 0},
        "rerun": any(run.values.get("human_slowing") is not None for run in evaluation.runs),
        "summary": evaluation.summaries(),
        "episodes": [asdict(run) for run in evaluation.runs],
    }


def _measured(path: Path, *, rerun: bool) -> Measured:
    record = read_episode(path)
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    return Measured(
        file=path.name,
        sha256=digest,
        name=record.name,
        family=record.family,
        seed=record.seed,
        episode=record.episode,
        scene=scene_hash(record),
        outcome=record.outcome.status,
        values=measure(record, rerun=rerun),
    )


def scene_hash(record: EpisodeRecord) -> str:
    """Of all that is there before the first tick, and of what people will choose."""
    scene = record.scene()
    layout = layout_of(scene) | {"settings": None, "dropped": None, "seed": scene.seed, "episode": scene.episode}
    return hashlib.sha256(orjson.dumps(layout)).hexdigest()[:16]


@contextmanager
def _mapper(workers: int) -> Iterator[Callable[..., Iterator[Measured]]]:
    """`map`, here or in other processes."""
    if workers <= 1:
        yield map
        return
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        yield partial(pool.map, chunksize=4)
