"""Generates data sets: the same bytes for any number of workers and after any interruption."""

from __future__ import annotations

import logging
import os
import platform
import sys
import time
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import closing, contextmanager, nullcontext, suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, get_args

from ...agents.controllers.base import Controller
from ...agents.controllers.loading import ControllerSource, is_built_in, source_hashes
from ...core.arguments import whole_number
from ...core.files.locations import file_names, location
from ...core.notebook import Advance, ProgressBar, bar_of
from ...core.snapshot import Status
from ...core.wording import shown
from ...errors import ControllerWarning, RecordError, Sonata2dError, WorkerError
from ...record.files import SUFFIXES
from ...record.layout import JsonDict
from ...registry import registered_hashes
from ...scenegen.scenario.config import ScenarioConfig
from ...scenegen.scenario.load import scenario_of
from ...sim.episode import controller_info_of
from ..card.write import write_manifest_and_card
from ..dataset import Dataset
from ..manifest.read import (
    FAILED,
    MANIFEST,
    SCENARIO,
    DatasetSpec,
    ManifestEntry,
    episode_numbers,
    existing_episodes,
    manifest_of,
    read_manifest,
    remove_partial_files,
    sharded_manifest_of,
    write_json,
)
from ..manifest.rows import remove_shards
from ..summaries import commands_warning
from ..workers.executors import Workers, shared_workers, unordered_map
from ..workers.processes import end_if_forked, end_if_unguarded
from ..workers.tasks import RaisedInWorker
from .batches import ShardProgress, cut_shard, existing_shards, remove_split, shard_count, shard_runner
from .episodes import FAILURES, Job, episode_runner, is_failure
from .progress import (
    ExcludedEpisode,
    FailedEpisode,
    Progress,
    append_to_log,
    log_excluded,
    read_excluded,
)
from .start import has_episodes, remove_failed_episodes, sole_writer, start_dataset

logger = logging.getLogger(__name__)

KEEPABLE: tuple[Status, ...] = tuple(status for status in get_args(Status) if status != "error")  # an error aborts


def generate_dataset(
    out: str | Path,
    scenario: str | Path | ScenarioConfig = "sonata-2020",
    controller: str | Controller | type[Controller] = "social-planner",
    *,
    episodes: int = 20,
    seed: int = 0,
    workers: int | Executor | Workers = 1,
    resume: bool = False,
    overwrite: bool = False,
    suffix: str = ".json",
    keep: str | Sequence[str] = (),
    shard_size: int | None = None,
    progress: bool | ProgressBar | None = None,
    advance: Advance | None = None,
) -> Dataset:
    """Generate a data set, or the missing episodes of one.

    Args:
        out: folder of the data set. Unless `resume` or `overwrite` is set, it is new or empty, or holds a data set
            without episodes, as of a run that failed at once.
        scenario: settings of the scenes, the name of a preset (`sonata2d.scenegen.scenario_names()` lists them), or the
            path of a scenario file.
        controller: name of the controller (`sonata2d controllers` lists them), or a class, of which each worker creates
            its own; or an object, of which each worker gets a copy. Classes of a notebook are sent with their code.
        episodes: number of episodes; with `keep`, number of kept episodes.
        seed: seed of the data set; the bytes of episode k depend on no other argument but scenario and controller.
        workers: number of processes; or an executor, or workers that several calls share, see `sonata2d.Workers`. With
            several processes, a script must guard its entry point by `if __name__ == "__main__":`.
        resume: continue an interrupted data set with the same settings, controller and code of the controller.
        overwrite: replace the data set in the folder; only its own files are removed, and no edited card.
        suffix: `.json`, `.json.gz` or `.json.zst`.
        keep: outcomes to keep (`Status`); empty: all. Episodes 0, 1, 2, … are run until the requested number has one
            of these outcomes; the manifest counts the others by outcome.
        shard_size: number of episodes in each shard, a tar file that also WebDataset reads; for data sets of more than
            about 100 000 episodes. None: a file for each episode.
        progress: whether to show a progress bar; None: in a notebook. Or a function of the number of episodes and the
            word `episodes` that returns a context manager, which gives a callback as `advance`.
        advance: in place of `progress`: called with the number of newly kept episodes.

    Returns:
        The data set; its `manifest` has hashes, outcomes and contacts of all files.

    Raises:
        RecordError: the folder cannot be used or written, it holds a data set with other settings, a file of it was
            removed meanwhile, or fewer than 1 in 50 episodes is kept.
        ControllerError: the controller cannot be created, or an error ended an episode; finished episodes stay.
        WorkerError: a worker crashed, was killed, or has other software; finished episodes stay.
        SceneError: a scene cannot be generated; finished episodes stay.
        ValueError: `keep` names an outcome that cannot be kept, both `resume` and `overwrite` are set, or the suffix or
            a number is not valid.
        ConfigError: there is no such preset or scenario file, or the file is invalid.
        TypeError: the scenario, the controller or a number is something else.

    Warns:
        ControllerWarning: most commands exceed the limits of the robot's drive, or move a unicycle sideways.
    """
    end_if_unguarded()
    if progress and advance:
        raise ValueError("progress and advance both report the same; give one of them")
    if resume and overwrite:
        raise ValueError("resume continues a data set and overwrite replaces it; set one of them")
    config = scenario_of(scenario)
    episodes, seed = whole_number("episodes", episodes, 1), whole_number("seed", seed)
    pool = shared_workers(workers)
    if suffix not in SUFFIXES:
        raise ValueError(f"suffix must be one of {', '.join(SUFFIXES)}, got {shown(suffix)}")
    if shard_size is not None:
        whole_number("shard_size", shard_size, 1)
    out = location(out)
    kept_outcomes = _in_fixed_order(keep)
    process = os.getpid()
    source = ControllerSource(controller)
    loaded, name = source.create(), source.name
    end_if_forked(process)
    stored = read_manifest(out) if resume and (out / MANIFEST).exists() else None
    split = None if stored is None else stored["split"]
    info = controller_info_of(loaded, name)
    hashes = source_hashes(name, loaded) | registered_hashes(config.settings())
    spec = DatasetSpec(config.name, config.settings(), seed, episodes, info, suffix, kept_outcomes, hashes, shard_size)
    spec = _without_unknown_code(spec, out, stored)
    bar = bar_of(progress)(episodes, "episodes") if advance is None else nullcontext(advance)
    with pool as own_workers, sole_writer(out), bar as step:
        listed = start_dataset(out, spec, resume=resume, overwrite=overwrite)
        run = _Run(out, Job(out.absolute(), config, spec, source), own_workers, step, resume, overwrite)
        manifest = run.files(listed, split) if shard_size is None else run.shards(split)
    warning = None if is_built_in(loaded) else commands_warning(manifest["files"], name)
    if warning is not None:
        warnings.warn(warning, ControllerWarning, stacklevel=2)
    return Dataset.of_manifest(out, manifest)


def _without_unknown_code(spec: DatasetSpec, out: Path, stored: JsonDict | None) -> DatasetSpec:
    """The specification; without hashes if it continues episodes whose code is unknown, as those of version 0.1."""
    is_unknown = stored is not None and "controller_sha256" not in stored and episode_numbers(out, spec)
    return replace(spec, controller_sha256={}) if is_unknown else spec


@dataclass(frozen=True, slots=True)
class _Run:
    """A run that generates what a data set lacks.

    Attributes:
        out: folder of the data set, as given.
        job: what is generated.
        workers: which do it.
        advance: progress callback.
        resume, overwrite: as of `generate_dataset`.
    """

    out: Path
    job: Job
    workers: Workers
    advance: Advance
    resume: bool
    overwrite: bool

    def files(self, listed: Mapping[str, str], split: Mapping[str, list[str]] | None) -> JsonDict:
        """Generate a data set of files, and return its manifest.

        Args:
            listed: SHA-256 by file name, from `start_dataset`.
            split: of the data set that is continued, if it has one.
        """
        out, spec = self.out, self.job.spec
        results = Progress(spec, _known_results(out, spec, listed) if self.resume else ())
        self.advance(len(results.kept))
        missing = spec.episodes - min(len(results.stored), spec.episodes)
        finished = partial(_finished_files, out, spec, results)
        with _logged(out, missing, self.workers), _listed_if_interrupted(out, finished):
            with self._failures_explained(lambda: len(results.kept)):
                total = None if spec.keep and missing > 1 else missing
                _run_pending(self.job, episode_runner, results, total, self.workers, self.advance)
                self._raise(results.failure)
            self._restore_removed([entry.name for entry in results.kept], "episodes")
        self._clean_up(split is not None and missing > 0)
        return finish_dataset(out, spec, results.kept, left_out=results.left_out, split=None if missing else split)

    def shards(self, split: Mapping[str, Sequence[str]] | None) -> JsonDict:
        """Generate a data set in shards, and return its manifest.

        Args:
            split: of the data set that is continued, if it has one.
        """
        out, spec = self.out, self.job.spec
        results = ShardProgress(spec, existing_shards(out, spec) if self.resume else ())
        self.advance(min(results.kept, spec.episodes))
        missing = spec.episodes - min(results.stored, spec.episodes)
        finished = partial(_finished_shards, out, spec, results)
        with _logged(out, missing, self.workers), _listed_if_interrupted(out, finished):
            with self._failures_explained(lambda: results.kept):
                total = None if spec.keep else shard_count(spec) - len(results.shards)
                _run_pending(self.job, shard_runner, results, total, self.workers, self.advance)
                self._raise(results.failure)
            shards = results.shards
            if spec.keep:
                rest = spec.episodes - sum(shard.episodes for shard in shards[:-1])
                shards[-1] = cut_shard(out, spec, shards[-1], rest)
            self._restore_removed([shard.row["name"] for shard in shards], "shards")
        remove_shards(out, len(shards))
        self._clean_up(split is not None and missing > 0)
        parts = None if split is None or missing else {part: len(names) for part, names in split.items()}
        for shard in shards if parts is None else ():
            if shard.is_split:
                remove_split(out / shard.row["name"])
        manifest = sharded_manifest_of(out, spec, [shard.row for shard in shards], complete=True, split=parts)
        write_manifest_and_card(out, manifest)
        return manifest

    @contextmanager
    def _failures_explained(self, kept: Callable[[], int]) -> Iterator[None]:
        """Add to errors what to do."""
        try:
            yield
        except (WorkerError, *FAILURES) as error:
            error.add_note(_how_to_go_on(self.out, self.job.spec, kept(), self.overwrite))
            raise

    def _raise(self, failure: FailedEpisode | None) -> None:
        """Raise the error that ended an episode, if one did."""
        if failure is not None:
            message = _failure_message(failure, self.out, self.job.spec)
            raise failure.error(message) from RaisedInWorker(failure.traceback)

    def _restore_removed(self, names: Sequence[str], what: str) -> None:
        """Write the scenario file again if it was removed during the run, as by a controller.

        Args:
            names: of the files of the run.
            what: the files hold.

        Raises:
            RecordError: files were removed.
        """
        out, spec = self.out, self.job.spec
        if spec.settings is not None and not (out / SCENARIO).is_file():
            write_json(out / SCENARIO, spec.settings)
        present = set(file_names(out))
        removed = sum(name not in present for name in names)
        if removed:
            raise RecordError(
                f"{removed} of {len(names)} {what} in {out} were removed while it was generated; "
                f"{how_to_continue(overwrite=self.overwrite)}"
            )

    def _clean_up(self, is_split_removed: bool) -> None:
        """Remove what is left of earlier runs."""
        remove_partial_files(self.out)  # again: the workers of a killed run may have lived on for a moment
        remove_failed_episodes(self.out)  # they have been generated by now
        if is_split_removed:
            logger.warning("%s has new episodes, so its split was removed; split it again", self.out)


def finish_dataset(
    folder: Path,
    spec: DatasetSpec,
    entries: Iterable[ManifestEntry],
    *,
    left_out: Mapping[str, int] | None = None,
    split: Mapping[str, list[str]] | None = None,
) -> JsonDict:
    """Write the manifest and the data card; with `keep`, remove episode files beyond the last requested one.

    Args:
        folder: folder of the data set.
        spec: specification of the data set.
        entries: manifest rows of the episodes, in any order; the data set is complete if none is missing.
        left_out: number of episodes not kept before the last kept one, by outcome.
        split: file names by part.

    Returns:
        The manifest.
    """
    entries = sorted(entries, key=lambda entry: entry.episode)
    numbers = [entry.episode for entry in entries]
    complete = len(numbers) == spec.episodes if spec.keep else numbers == list(range(spec.episodes))
    for surplus in set(episode_numbers(folder, spec)).difference(numbers) if spec.keep else ():
        (folder / spec.file_name(surplus)).unlink(missing_ok=True)
    manifest = manifest_of(spec, entries, complete=complete, left_out=left_out, split=split)
    write_manifest_and_card(folder, manifest)
    return manifest


def _in_fixed_order(keep: str | Sequence[str]) -> tuple[Status, ...]:
    """The outcomes to keep, without repetitions and in the order of `Status`."""
    keep = (keep,) if isinstance(keep, str) else keep
    for status in keep:
        if status not in KEEPABLE:
            raise ValueError(f"keep accepts {', '.join(KEEPABLE)}; got {status!r}")
    return tuple(status for status in KEEPABLE if status in keep)


def _known_results(out: Path, spec: DatasetSpec, listed: Mapping[str, str]) -> list[ManifestEntry | ExcludedEpisode]:
    """Results of earlier runs in this folder."""
    entries, faults = existing_episodes(out, spec, listed)
    for fault in faults:
        logger.warning("%s; the episode is generated again", fault)
    return [*(read_excluded(out) if spec.keep else ()), *entries.values()]


def _run_pending(
    job: Job,
    runner: Callable[[Job], Callable[[int], Any]],
    progress: Progress | ShardProgress,
    total: int | None,
    workers: Workers,
    advance: Advance,
) -> None:
    """Run pending episodes or shards until the progress is finished.

    Args:
        job: what is generated.
        runner: makes the function that runs an episode or a shard by number.
        progress: of the run.
        total: number of pending episodes or shards; None: unknown.
        workers: which run them.
        advance: progress callback.
    """
    results = unordered_map(
        partial(runner, job),
        progress.pending(),
        workers=workers,
        is_last=is_failure,
        total=total,
        writes=job.out,
    )
    with closing(results):
        for result in results:
            if isinstance(result, ExcludedEpisode):
                log_excluded(job.out, result)
            advance(progress.add(result))
            if progress.is_finished:
                return


def _failure_message(failure: FailedEpisode, out: Path, spec: DatasetSpec) -> str:
    message = f"episode {failure.episode} of seed {spec.seed}: {failure.message}"
    if failure.partial_file is None:
        return message
    return f"{message}; the frames before it are in {out / FAILED / failure.partial_file}"


def how_to_continue(*, overwrite: bool) -> str:
    """The advice after an interruption; the same command with `--overwrite` would remove the complete episodes."""
    return "continue with the same command and --resume" + (" in place of --overwrite" if overwrite else "")


def _how_to_go_on(out: Path, spec: DatasetSpec, kept: int, overwrite: bool) -> str:
    """What to do after a failure."""
    # with `keep`, kept episodes after the failed one do not count yet
    stored = kept if spec.keep or spec.shard_size else len(episode_numbers(out, spec))
    if not stored and not has_episodes(out):
        return f"no episode is complete in {out}, correct the cause and run the same command again"
    text = f"{stored} of {spec.episodes} episodes are complete in {out}, {how_to_continue(overwrite=overwrite)}"
    return f"{text}, or with --overwrite if you change the controller's code" if spec.controller_sha256 else text


@contextmanager
def _listed_if_interrupted(out: Path, finished: Callable[[], JsonDict | None]) -> Iterator[None]:
    """If the run is interrupted, list the finished episodes in the manifest, so that other commands see them.

    Args:
        out: folder of the data set.
        finished: returns that manifest, or None if no episode is finished.
    """
    process = os.getpid()
    try:
        yield
    except BaseException:
        if os.getpid() == process:  # and not in a copy of the process, forked by the controller
            with suppress(OSError, Sonata2dError):  # the reason of the interruption is more important
                remove_partial_files(out)
                if (manifest := finished()) is not None:
                    write_manifest_and_card(out, manifest)
        raise


def _finished_files(out: Path, spec: DatasetSpec, progress: Progress) -> JsonDict | None:
    """The manifest of the finished episodes of a data set of files; None if there are none."""
    entries = progress.kept
    if not spec.keep:  # with `keep`, an episode counts once the numbers before it have been run
        stored = {entry.episode: entry for entry in progress.stored}
        unseen, _ = existing_episodes(out, spec, {}, known=stored)  # finished while the run was ending
        entries = sorted((stored | unseen).values(), key=lambda entry: entry.episode)
    entries = [entry for entry in entries if (out / entry.name).is_file()]
    return manifest_of(spec, entries, complete=False, left_out=progress.left_out) if entries else None


def _finished_shards(out: Path, spec: DatasetSpec, progress: ShardProgress) -> JsonDict | None:
    """The manifest of the finished shards of a data set; None if there are none."""
    rows = [shard.row for shard in progress.shards if (out / shard.row["name"]).is_file()]
    return sharded_manifest_of(out, spec, rows, complete=False) if rows else None


@contextmanager
def _logged(out: Path, missing: int, workers: Workers) -> Iterator[None]:
    """Append a line about this run to the run log when it ends."""
    start, begun = time.perf_counter(), time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime())
    outcome = "interrupted"
    try:
        yield
        outcome = "complete"
    except Sonata2dError as error:
        outcome = f"{type(error).__name__}: {error}"
        raise
    finally:
        # the reason of a failure is more important than that the log cannot be written
        with nullcontext() if outcome == "complete" else suppress(RecordError):
            append_to_log(
                out,
                begun=begun,
                seconds=round(time.perf_counter() - start, 1),
                host=platform.node(),
                workers=workers.count,
                asked=missing,
                command=sys.argv,
                outcome=outcome,
            )
