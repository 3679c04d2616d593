"""Measuring metrics: of one episode, of files in parallel; comparing evaluations, and storing them as JSON."""

from __future__ import annotations

import hashlib
import logging
from collections.abc import Iterable, Sequence
from concurrent.futures import Executor
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import orjson

from ..core.files import interruption
from ..core.notebook import Advance
from ..core.wording import counted, described, one_line
from ..datasets.manifest import METRICS as METRICS_FILE, files_of as episode_files, write_json
from ..datasets.workers.executors import Workers, parallel_map, shared_workers
from ..datasets.workers.processes import end_if_unguarded
from ..errors import MetricError, Sonata2dError
from ..record.files import sha256_of
from ..record.layout import scene_to_json, software_versions
from ..record.reader import read_episode
from ..record.record import EpisodeRecord
from ..registry import did_you_mean
from .catalogue import ALL, is_measurable
from .definition import ARROWS, DEFINITIONS_VERSION, Metric
from .disturbance import RunWithoutRobot, without_robot
from .summary import LEVEL, RESAMPLES, Summary, differences, summarise
from .trajectory import Trajectory

__all__ = ["Evaluation", "Measured", "episode_files", "measure", "measure_files", "save_metrics"]

logger = logging.getLogger(__name__)

METRICS_FORMAT = "sonata2d-metrics"
MARK = "*"  # of values that differ from those of the first evaluation


@dataclass(frozen=True, slots=True)
class Measured:
    """The metrics of one episode.

    Attributes:
        file, sha256: the episode file and its hash.
        name, family: of the scenario.
        seed, episode: as in the file.
        scene: hash of the scene, equal for episodes that start alike, whatever the controller; see `scene_hash`.
        outcome: status with which the episode ended.
        values: value of each metric; None where it is not defined.
    """

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
    """The measured episodes of one controller or one data set.

    Args:
        label: name in tables.
        episodes: the measured episodes.
        resamples: of the bootstrap.

    >>> files = episode_files(Path("demo"))
    >>> Evaluation("demo", measure_files(files, rerun=False)).summary("path_length").mean
    6...
    """

    label: str
    episodes: Sequence[Measured]
    resamples: int = RESAMPLES
    _cache: dict[str, Summary] = field(default_factory=dict, repr=False, compare=False)

    def __repr__(self) -> str:
        return f"<Evaluation {self.label}: {counted(len(self.episodes), 'episode')}>"

    def values(self, name: str) -> list[float]:
        """Values of a metric in the episodes in which it is defined.

        Raises:
            MetricError: no metric has this name.
        """
        _require_known(name)
        return [value for episode in self.episodes if (value := episode.values.get(name)) is not None]

    def summary(self, name: str) -> Summary:
        """Summary of a metric over all episodes.

        Raises:
            MetricError: no metric has this name.
        """
        _require_known(name)
        if name not in self._cache:
            self._cache[name] = self._summarise(name, self.episodes)
        return self._cache[name]

    def difference(self, baseline: Evaluation, name: str) -> Summary:
        """Summary of this evaluation's metric minus the baseline's, over the scenes common to both."""
        own, other = ({episode.scene: episode.values for episode in each.episodes} for each in (self, baseline))
        return differences(other, own, name, resamples=self.resamples)

    def differs(self, baseline: Evaluation, name: str) -> bool:
        """Whether a metric differs significantly from that of another evaluation in the common scenes.

        False if the difference of the means over all episodes has the other sign: they are over other episodes, and a
        mark beside them would be read the wrong way round.
        """
        own, other = self.summary(name).mean, baseline.summary(name).mean
        if baseline is self or own is None or other is None:
            return False
        difference = self.difference(baseline, name)
        return difference.excludes_zero and difference.mean is not None and difference.mean * (own - other) > 0.0

    @property
    def scenes(self) -> set[str]:
        """The hashes of the scenes."""
        return {episode.scene for episode in self.episodes}

    def to_json(self) -> dict[str, Any]:
        """Version of the definitions, summaries and the metrics of every episode, as a JSON object.

        Summaries cover all episodes, the successful ones and those of each scenario family.
        """
        names = self.episodes[0].values if self.episodes else {}
        families = sorted({episode.family for episode in self.episodes})
        return {
            "format": METRICS_FORMAT,
            "version": DEFINITIONS_VERSION,
            "metrics": {name: {"unit": ALL[name].unit, "better": ALL[name].better} for name in names},
            "bootstrap": {"level": LEVEL, "resamples": self.resamples, "seed": 0},
            "rerun": any(episode.values.get("human_slowing") is not None for episode in self.episodes),
            "summary": {
                "all": self._summaries(self.episodes),
                "successful": self._summaries([e for e in self.episodes if e.values.get("success")]),
                "by_family": {name: self._summaries([e for e in self.episodes if e.family == name])
                              for name in families},
            },
            "episodes": [asdict(episode) for episode in self.episodes],
        }  # fmt: skip

    def _summarise(self, name: str, episodes: Sequence[Measured]) -> Summary:
        return summarise([episode.values.get(name) for episode in episodes], resamples=self.resamples)

    def _summaries(self, episodes: Sequence[Measured]) -> dict[str, Any]:
        names = self.episodes[0].values if self.episodes else ()  # also for an empty selection
        return {name: self._summarise(name, episodes).to_json() for name in names}


def _require_known(name: str) -> None:
    if name not in ALL:
        hint = did_you_mean(name, ALL) or "; sonata2d.metrics.ALL holds all metrics"
        raise MetricError(f"no metric is named {name!r}{hint}")


def measure(
    record: EpisodeRecord, metrics: Iterable[Metric] = tuple(ALL.values()), *, rerun: bool = True
) -> dict[str, float | None]:
    """Compute metrics of one episode.

    Args:
        record: the episode.
        metrics: by default all, with the variants of other projects.
        rerun: whether to run the seed again without a robot, for the metrics of its effect on humans. This takes as
            long as an episode, and is skipped for episodes made by another version of the physics.

    Returns:
        Value by name; None where a metric is not defined, or where an imported episode lacks the data.
    """
    return _values(Trajectory(record, without_robot(record) if rerun else None), metrics)


def measure_files(
    paths: Sequence[Path],
    *,
    rerun: bool = True,
    workers: int | Executor | Workers = 1,
    advance: Advance = lambda step: None,
) -> list[Measured]:
    """Compute all metrics of episode files.

    Files of the same name in folders of the same name are measured by the same process, one after another: if several
    controllers were run in the same scenes, they share the runs without a robot.

    Args:
        paths: episode files.
        rerun: as for `measure`.
        workers: number of processes; or an executor, or workers that several calls share, see `sonata2d.Workers`. With
            several processes, a script needs `if __name__ == "__main__":` around its start.
        advance: called after each group of such files, with their number.

    Returns:
        The metrics, in the order of the files.

    Raises:
        RecordError: a file cannot be read.
    """
    end_if_unguarded()
    groups: dict[tuple[str, str], list[int]] = {}
    for index, path in enumerate(paths):
        groups.setdefault((path.parent.name, path.name), []).append(index)
    measured: dict[int, Measured] = {}
    with shared_workers(workers) as pool:
        sent = [pool.place(path) for path in paths]
        tasks = [[sent[index] for index in group] for group in groups.values()]
        reads = sent[0].parent if sent else None
        results = parallel_map(partial(_measure_group, rerun=rerun), tasks, workers=pool, reads=reads)
        for group, result in zip(groups.values(), results, strict=True):
            measured |= zip(group, result, strict=True)
            advance(len(group))
    return [measured[index] for index in range(len(paths))]


def save_metrics(folder: Path, evaluation: Evaluation) -> Path:
    """Write `metrics.json` into the folder of a data set and return its path.

    Raises:
        RecordError: the file cannot be written.
    """
    write_json(folder / METRICS_FILE, evaluation.to_json() | {"software": software_versions()})
    return folder / METRICS_FILE


def comparison_rows(evaluations: Sequence[Evaluation], metrics: Sequence[Metric]) -> list[tuple[str, ...]]:
    """The cells of a table of evaluations side by side.

    Returns:
        A row of headings, then a row for each metric: name, arrow (which direction is better), unit, and mean with
        confidence interval of each evaluation. `(n=12)` follows where the metric is defined in 12 episodes only, and
        `*` where the value differs significantly from the first evaluation in the common scenes.
    """
    rows = [("metric", "", "unit", *(one.label for one in evaluations))]
    for metric in metrics:
        cells = (
            one.summary(metric.name).text(len(one.episodes))
            + (MARK if one.differs(evaluations[0], metric.name) else "")
            for one in evaluations
        )
        rows.append((metric.name, ARROWS[metric.better], metric.unit, *cells))
    return rows


def comparison_table(evaluations: Sequence[Evaluation], metrics: Sequence[Metric]) -> list[str]:
    """`comparison_rows` as lines of text."""
    rows = comparison_rows(evaluations, metrics)
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    return ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows]


def scene_hash(record: EpisodeRecord) -> str:
    """Hash of everything that is fixed before the first tick, including the seed from which humans make choices."""
    scene = record.scene()
    layout = scene_to_json(scene) | {"settings": None, "dropped": None, "seed": scene.seed, "episode": scene.episode}
    return hashlib.sha256(orjson.dumps(layout)).hexdigest()[:16]


def _measure_group(paths: Sequence[Path], *, rerun: bool) -> list[Measured]:
    runs: list[RunWithoutRobot] | None = [] if rerun else None
    return [_measure_file(path, runs) for path in paths]


def _measure_file(path: Path, runs: list[RunWithoutRobot] | None) -> Measured:
    """Measure a file.

    Args:
        path: of the episode file.
        runs: as for `without_robot`; None: do not run the seed without a robot.
    """
    logger.info("measuring %s", path)
    record = read_episode(path)
    try:
        undisturbed = None if runs is None else without_robot(record, runs)
    except BaseException as error:  # a pedestrian model of a plug-in is missing, or fails
        interruption.reraise(error)
        cause = one_line(error, 300) if isinstance(error, (Sonata2dError, ValueError)) else described(error)
        raise MetricError(
            f"{path} cannot be run without the robot: {cause}; --no-rerun (rerun=False) leaves out the "
            "metrics of its effect on people"
        ) from error
    trajectory = Trajectory(record, undisturbed)
    return Measured(
        file=path.name,
        sha256=sha256_of(path),
        name=record.name,
        family=record.family,
        seed=record.seed,
        episode=record.episode,
        scene=scene_hash(record),
        outcome=record.outcome.status,
        values=_values(trajectory, ALL.values()),
    )


def _values(trajectory: Trajectory, metrics: Iterable[Metric]) -> dict[str, float | None]:
    record = trajectory.record
    values: dict[str, float | None] = {}
    for metric in metrics:
        try:
            values[metric.name] = metric.of(trajectory) if is_measurable(metric, record) else None
        except BaseException as error:  # a metric of a plug-in may raise anything
            interruption.reraise(error)
            raise MetricError(f"metric {metric.name!r} of {record.path}: {described(error)}") from error
    return values
