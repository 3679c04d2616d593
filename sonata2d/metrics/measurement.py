"""Measuring metrics: of one episode, and of files in parallel; storing them beside the episodes."""

from __future__ import annotations

import hashlib
import logging
from collections.abc import Iterable, Sequence
from concurrent.futures import Executor
from functools import partial
from pathlib import Path
from statistics import fmean

import orjson

from ..core.files import interruption
from ..core.notebook import Advance
from ..core.wording import described, one_line
from ..datasets.manifest import METRICS as METRICS_FILE, files_of as episode_files, write_json
from ..errors import MetricError, Sonata2dError
from ..record.files import read_stored
from ..record.layout import scene_to_json, software_versions
from ..record.reader import episode_in
from ..record.record import EpisodeRecord
from ..workers.executors import Workers, parallel_map, shared_workers
from ..workers.processes import end_if_unguarded
from .catalogue import ALL
from .definition import Metric, missing_data
from .disturbance import RunWithoutRobot, without_robot
from .evaluation import Evaluation, Measured
from .trajectory import Trajectory

__all__ = ["episode_files", "measure", "measure_files", "save_metrics"]

logger = logging.getLogger(__name__)


def measure(
    record: EpisodeRecord, metrics: Iterable[Metric] = tuple(ALL.values()), *, rerun: bool = True
) -> dict[str, float | None]:
    """Compute metrics of one episode; of several robots, those of one until it reaches its goal.

    Args:
        record: the episode; `record.seen_by(id)` is that of another robot. `measure_together` measures all robots.
        metrics: by default all, with the variants of other projects.
        rerun: whether to run the seed again without a robot, for the metrics of its effect on humans. This takes as
            long as an episode, and is skipped for episodes made by another version of the physics.

    Returns:
        Value by name; None where a metric is not defined, or where an imported episode lacks the data.
    """
    record = record.until_arrival()
    return _values(Trajectory(record, without_robot(record) if rerun else None), metrics, missing_data(record))


def measure_together(
    record: EpisodeRecord, metrics: Iterable[Metric] = tuple(ALL.values()), *, rerun: bool = True
) -> dict[str, float | None]:
    """Compute metrics of all robots of an episode together, as tables show them, see `Measured.values`.

    Args:
        record, metrics, rerun: as of `measure`.
    """
    return _together([measure(record.seen_by(id), metrics, rerun=rerun) for id in record.robot_ids])


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
    stored = read_stored(path)
    record = episode_in(path, stored)
    try:
        undisturbed = None if runs is None else without_robot(record, runs)
    except BaseException as error:  # a pedestrian model of a plug-in is missing, or fails
        interruption.reraise(error)
        cause = one_line(error, 300) if isinstance(error, (Sonata2dError, ValueError)) else described(error)
        raise MetricError(
            f"{path} cannot be run without the robot: {cause}; --no-rerun (rerun=False) leaves out the "
            "metrics of its effect on people"
        ) from error
    lacks, robots = missing_data(record), dict[int, dict[str, float | None]]()
    if len(record.robot_ids) > 1:
        for robot_id in record.robot_ids:
            trajectory = Trajectory(record.seen_by(robot_id).until_arrival(), undisturbed)
            robots[robot_id] = _values(trajectory, ALL.values(), lacks)
    return Measured(
        file=path.name,
        sha256=hashlib.sha256(stored).hexdigest(),
        name=record.name,
        family=record.family,
        seed=record.seed,
        episode=record.episode,
        scene=scene_hash(record),
        outcome=record.outcome.status,
        values=_together([*robots.values()])
        if robots
        else _values(Trajectory(record, undisturbed), ALL.values(), lacks),
        lacks=tuple(sorted(lacks)),
        robots=robots,
    )


def _together(robots: list[dict[str, float | None]]) -> dict[str, float | None]:
    """The values of several robots together, see `Measured`."""
    values: dict[str, float | None] = {}
    for name in robots[0]:
        metric, defined = ALL[name], [value for each in robots if (value := each[name]) is not None]
        if not defined:
            values[name] = None
        elif metric.unit == "count":
            values[name] = sum(defined)
        elif metric.unit == "0/1":
            values[name] = min(defined) if metric.better == "more" else max(defined)
        else:
            values[name] = round(fmean(defined), 6)
    return values


def _values(trajectory: Trajectory, metrics: Iterable[Metric], lacks: frozenset[str]) -> dict[str, float | None]:
    """The metrics of an episode; None for metrics that need data which its source lacks."""
    values: dict[str, float | None] = {}
    for metric in metrics:
        try:
            values[metric.name] = None if lacks & set(metric.needs) else metric.of(trajectory)
        except BaseException as error:  # a metric of a plug-in may raise anything
            interruption.reraise(error)
            raise MetricError(f"metric {metric.name!r} of {trajectory.record.path}: {described(error)}") from error
    return values
