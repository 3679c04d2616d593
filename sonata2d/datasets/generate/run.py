"""Generates data sets: the same bytes for any number of workers and after any interruption."""

from __future__ import annotations

import logging
import os
import platform
import sys
import time
import warnings
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor
from contextlib import closing, contextmanager, nullcontext, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import get_args

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
from ...sim.driver import controller_info_of
from ...workers.executors import Workers, shared_workers
from ...workers.processes import end_if_unguarded
from ...workers.tasks import Call, RaisedInWorker
from ..card.write import write_manifest_and_card, write_tables_and_card
from ..dataset import Dataset
from ..manifest.names import FAILED, MANIFEST, SCENARIO
from ..manifest.read import read_document
from ..manifest.rows import with_rows
from ..manifest.write import sum_of, write_json
from ..summaries import commands_warning
from ..tables import has_pyarrow, pyarrow
from .batches import batch_runner, cut_shard, existing_batches, remove_split, remove_surplus
from .episodes import FAILURES, Job, created, is_failure
from .progress import Batch, Progress, append_to_log, log_excluded
from .specification import DatasetSpec, manifest_of
from .start import has_episodes, remove_failed_episodes, remove_partial_files, sole_writer, start_dataset

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
    tables: bool | None = None,
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
        tables: whether to write tables of the episodes and frames, which Hugging Face `datasets` reads, see
            `sonata2d.datasets.write_tables`; None: if pyarrow is installed.
        progress: whether to show a progress bar; None: in a notebook. Or a function of the number of episodes and the
            word `episodes` that returns a context manager, which gives a callback as `advance`.
        advance: in place of `progress`: called with the number of newly kept episodes.

    Returns:
        The data set; its `manifest` has hashes, outcomes and contacts of all files.

    Raises:
        RecordError: the folder cannot be used or written, it holds a data set with other settings, a file of it was
            removed meanwhile, fewer than 1 in 50 episodes is kept, or `tables` needs pyarrow.
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
    if tables is None:
        tables = has_pyarrow()
    elif tables:
        pyarrow()
    if suffix not in SUFFIXES:
        raise ValueError(f"suffix must be one of {', '.join(SUFFIXES)}, got {shown(suffix)}")
    if shard_size is not None:
        whole_number("shard_size", shard_size, 1)
    out = location(out)
    kept_outcomes = _in_fixed_order(keep)
    source = ControllerSource(controller)
    loaded, name = created(source), source.name
    split = read_document(out)["split"] if resume and (out / MANIFEST).exists() else None
    info = controller_info_of(loaded, name)
    hashes = source_hashes(name, loaded) | registered_hashes(config.settings())
    spec = DatasetSpec(config.name, config.settings(), seed, episodes, info, suffix, kept_outcomes, hashes, shard_size)
    bar = bar_of(progress)(episodes, "episodes") if advance is None else nullcontext(advance)
    with pool as run_workers, sole_writer(out) as claim, bar as step:
        listed = start_dataset(out, spec, resume=resume, overwrite=overwrite, claim=claim)
        run = _Run(out, Job(out.absolute(), config, spec, source, claim), run_workers, step, overwrite)
        batches, faults = existing_batches(out, spec, listed) if resume else ([], [])
        for fault in faults:
            logger.warning("%s; it is generated again", fault)
        manifest = run.completed(Progress(spec, batches), split)
        if tables:
            with bar_of(progress)(episodes, "episodes in tables") as advance_tables:
                try:
                    write_tables_and_card(out, workers=run_workers, advance=advance_tables)
                except RecordError as error:
                    text = f"{error}; the episodes are complete, and `sonata2d card {out}` writes the tables"
                    raise RecordError(text) from error
    warning = None if is_built_in(loaded) else commands_warning(manifest["files"], name)
    if warning is not None:
        warnings.warn(warning, ControllerWarning, stacklevel=2)
    return Dataset.of_manifest(out, manifest)


def _in_fixed_order(keep: str | Sequence[str]) -> tuple[Status, ...]:
    """The outcomes to keep, without repetitions and in the order of `Status`."""
    keep = (keep,) if isinstance(keep, str) else keep
    for status in keep:
        if status not in KEEPABLE:
            raise ValueError(f"keep accepts {', '.join(KEEPABLE)}; got {status!r}")
    return tuple(status for status in KEEPABLE if status in keep)


@dataclass(frozen=True, slots=True)
class _Run:
    """A run that generates the missing batches of a data set.

    Attributes:
        out: folder of the data set, as given.
        job: of the workers.
        workers: of the run.
        advance: progress callback.
        overwrite: as of `generate_dataset`.
    """

    out: Path
    job: Job
    workers: Workers
    advance: Advance
    overwrite: bool

    def completed(self, progress: Progress, split: JsonDict | None) -> JsonDict:
        """Generate the batches that are missing, and return the manifest of the complete data set.

        Args:
            progress: with the batches of earlier runs.
            split: as stored in the manifest that is continued, if it has one.
        """
        out, spec = self.out, self.job.spec
        self.advance(min(progress.kept, spec.episodes))
        missing = max(0, spec.episodes - sum(batch.episodes for batch in progress.stored))
        with self._logged(missing), self._listed_if_interrupted(progress):
            self._run_pending(progress)
            batches = progress.batches
            if spec.keep and spec.shard_size:
                rest = spec.episodes - sum(batch.episodes for batch in batches[:-1])
                batches[-1] = cut_shard(self.job, batches[-1], rest)
            self.job.claim.require()
            self._restore_removed([batch.row["name"] for batch in batches if batch.row is not None])
        remove_partial_files(out)  # again: the workers of a killed run may have lived on for a moment
        remove_failed_episodes(out)  # they have been generated by now
        remove_surplus(out, spec, batches)
        if missing and split is not None:
            logger.warning("%s has new episodes, so its split was removed; split it again", out)
            split = None
        for batch in batches if split is None else ():
            if batch.is_split and batch.row is not None:
                remove_split(out / batch.row["name"])
        return self._write_manifest(batches, complete=True, split=split)

    def _run_pending(self, progress: Progress) -> None:
        """Run pending batches until the progress is finished.

        Raises:
            SceneError, RecordError, ControllerError: an error ended an episode that is needed.
        """
        spec = self.job.spec
        call = Call(partial(batch_runner, self.job), is_failure, writes=self.job.out)
        total = None if spec.keep else sum(1 for _ in progress.pending())
        with closing(self.workers.results(call, progress.pending(), total, in_order=False)) as results:
            for result in results:
                self.job.claim.require(now=False)
                if isinstance(result, Batch) and result.row is None:
                    log_excluded(self.job.out, result)
                self.advance(progress.add(result))
                if progress.is_finished:
                    break
        failure = progress.failure
        if failure is not None:
            self.job.claim.require()
            message = f"episode {failure.episode} of seed {spec.seed}: {failure.message}"
            if failure.partial_file is not None:
                message += f"; the frames before it are in {self.out / FAILED / failure.partial_file}"
            raise failure.error(message) from RaisedInWorker(failure.traceback)

    def _write_manifest(self, batches: Sequence[Batch], *, complete: bool, split: JsonDict | None = None) -> JsonDict:
        """Write the manifest and the data card, and return the manifest."""
        self.job.claim.require()
        rows = [batch.row for batch in batches if batch.row is not None]
        counts = {key: sum_of(batch.counts[key] for batch in batches) for key in ("outcome", "family")}
        left_out = sum_of(batch.left_out for batch in batches)
        manifest = manifest_of(self.job.spec, rows, counts, left_out, complete=complete, split=split)
        manifest = with_rows(manifest, self.out)
        write_manifest_and_card(self.out, manifest)
        return manifest

    def _finished(self, progress: Progress) -> list[Batch]:
        """The batches that an interrupted data set lists."""
        batches = progress.batches
        if not self.job.spec.keep:  # with `keep`, a batch counts once the batches before it have been run
            known = {batch.number for batch in progress.stored}
            unseen, _ = existing_batches(self.out, self.job.spec, known=known)  # finished while the run was ending
            batches = sorted([*progress.stored, *unseen], key=lambda batch: batch.number)
        return [batch for batch in batches if batch.row is None or (self.out / batch.row["name"]).is_file()]

    @contextmanager
    def _listed_if_interrupted(self, progress: Progress) -> Iterator[None]:
        """If the run is interrupted, list the finished episodes in the manifest, so that other commands see them.

        An error of the run gets a note with the advice how to continue.
        """
        process = os.getpid()
        try:
            yield
        except BaseException as error:
            # Not in a copy of the process, forked by the controller, nor in a folder that another program writes.
            if os.getpid() == process and not self.job.claim.is_lost:
                with suppress(OSError, Sonata2dError):  # the reason of the interruption is more important
                    batches = self._finished(progress)
                    stored = sum(batch.episodes for batch in batches)
                    if isinstance(error, (WorkerError, *FAILURES)):
                        error.add_note(self._how_to_go_on(stored))
                    remove_partial_files(self.out)
                    if stored:
                        self._write_manifest(batches, complete=False)
            raise

    def _how_to_go_on(self, stored: int) -> str:
        """The advice after a failure.

        Args:
            stored: number of finished episodes.
        """
        out, spec = self.out, self.job.spec
        if not stored and not has_episodes(out):
            return f"no episode is complete in {out}, correct the cause and run the same command again"
        advice = how_to_continue(overwrite=self.overwrite)
        text = f"{stored} of {spec.episodes} episodes are complete in {out}, {advice}"
        return f"{text}, or with --overwrite if you change the controller's code" if spec.controller_sha256 else text

    def _restore_removed(self, names: Sequence[str]) -> None:
        """Write the scenario file again if it was removed during the run, as by a controller.

        Args:
            names: of the files or shards of the run.

        Raises:
            RecordError: files or shards were removed.
        """
        out, spec = self.out, self.job.spec
        if spec.settings is not None and not (out / SCENARIO).is_file():
            write_json(out / SCENARIO, spec.settings)
        removed = len(set(names) - set(file_names(out)))
        if removed:
            what = "episodes" if spec.shard_size is None else "shards"
            raise RecordError(f"{removed} of {len(names)} {what} in {out} were removed while it was generated")

    @contextmanager
    def _logged(self, missing: int) -> Iterator[None]:
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
                    self.out,
                    begun=begun,
                    seconds=round(time.perf_counter() - start, 1),
                    host=platform.node(),
                    workers=self.workers.count,
                    asked=missing,
                    command=sys.argv,
                    outcome=outcome,
                )


def how_to_continue(*, overwrite: bool) -> str:
    """The advice after an interruption; the same command with `--overwrite` would remove the complete episodes."""
    return "continue with the same command and --resume" + (" in place of --overwrite" if overwrite else "")
