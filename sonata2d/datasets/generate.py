"""Generates data sets: the same bytes for any number of workers and after any interruption."""

from __future__ import annotations

import logging
import os
import platform
import sys
import sysconfig
import time
import traceback
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import closing, contextmanager, nullcontext, suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import get_args

from ..agents.controllers.base import Controller
from ..agents.controllers.loading import ControllerSource, is_built_in, source_hashes
from ..core import interruption
from ..core.arguments import whole_number
from ..core.notebook import Advance, ProgressBar, bar_of
from ..core.scene import Scene
from ..core.snapshot import ControllerInfo, Frame, Outcome, Snapshot, Status
from ..core.wording import described, one_line, shown, text_of
from ..errors import ControllerError, ControllerWarning, RecordError, SceneError, Sonata2dError, WorkerError
from ..record.files import SUFFIXES
from ..record.layout import JsonDict
from ..record.recorder import EpisodeRecorder
from ..registry import registered_hashes
from ..scenegen.generator import generate
from ..scenegen.scenario.config import ScenarioConfig
from ..scenegen.scenario.load import scenario_of
from ..sim.episode import Episode, controller_info_of, renderer_for
from .card import write_manifest_and_card
from .dataset import Dataset
from .executors import Workers, shared_workers, unordered_map
from .manifest import (
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
    store_episode,
    write_json,
)
from .processes import end_if_forked, end_if_unguarded
from .progress import (
    EpisodeResult,
    ExcludedEpisode,
    FailedEpisode,
    Progress,
    append_to_log,
    log_excluded,
    read_excluded,
)
from .start import remove_failed_episodes, sole_writer, start_dataset
from .summaries import commands_warning

logger = logging.getLogger(__name__)

_FAILURES = SceneError, RecordError, ControllerError  # of an episode
_PACKAGE_FOLDER = Path(__file__).resolve().parents[1]
KEEPABLE: tuple[Status, ...] = tuple(status for status in get_args(Status) if status != "error")  # an error aborts


@dataclass(frozen=True, slots=True)
class Job:
    """Everything that a worker needs to generate any episode of a data set.

    Attributes:
        out: folder of the data set; absolute, because a controller may change the working folder.
        scenario: settings of the scenes.
        spec: specification of the data set.
        source: of the controller.
        process: id of the process that runs the episodes; set there.
    """

    out: Path
    scenario: ScenarioConfig
    spec: DatasetSpec
    source: ControllerSource
    process: int = 0


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
    out = Path(out)
    kept_outcomes = _in_fixed_order(keep)
    process = os.getpid()
    source = ControllerSource(controller)
    loaded, name = source.create(), source.name
    end_if_forked(process)
    stored = read_manifest(out) if resume and (out / MANIFEST).exists() else None
    split = None if stored is None else stored["split"]
    info = controller_info_of(loaded, name)
    hashes = source_hashes(name, loaded) | registered_hashes(config.settings())
    spec = DatasetSpec(config.name, config.settings(), seed, episodes, info, suffix, kept_outcomes, hashes)
    spec = _without_unknown_code(spec, out, stored)
    bar = bar_of(progress)(episodes, "episodes") if advance is None else nullcontext(advance)
    with pool as own_workers, sole_writer(out), bar as step:
        listed = start_dataset(out, spec, resume=resume, overwrite=overwrite)
        results = Progress(spec, _known_results(out, spec, listed) if resume else ())
        step(len(results.kept))
        missing = episodes - min(len(results.stored), episodes)
        with _logged(out, missing, own_workers), _finished_listed(out, spec, results):
            try:
                _run_episodes(Job(out.absolute(), config, spec, source), results, own_workers, step)
                if (failure := results.failure) is not None:
                    raise failure.error(_failure_message(failure, out, spec)) from _RaisedInWorker(failure.traceback)
            except (WorkerError, *_FAILURES) as error:
                error.add_note(_how_to_go_on(out, spec, results, overwrite))
                raise
            _restore_removed(out, spec, results, overwrite)
        remove_partial_files(out)  # again: the workers of a killed run may have lived on for a moment
        remove_failed_episodes(out)  # they have been generated by now
        if split is not None and missing:
            logger.warning("%s has new episodes, so its split was removed; split it again", out)
        manifest = finish_dataset(out, spec, results.kept, left_out=results.left_out, split=None if missing else split)
    warning = None if is_built_in(loaded) else commands_warning(manifest["files"], name)
    if warning is not None:
        warnings.warn(warning, ControllerWarning, stacklevel=2)
    return Dataset.of_manifest(out, manifest)


def _without_unknown_code(spec: DatasetSpec, out: Path, stored: JsonDict | None) -> DatasetSpec:
    """The specification; without hashes if it continues episodes whose code is unknown, as those of version 0.1."""
    is_unknown = stored is not None and "controller_sha256" not in stored and episode_numbers(out, spec)
    return replace(spec, controller_sha256={}) if is_unknown else spec


class _RaisedInWorker(Exception):
    """The cause of an error that ended an episode: the traceback of the process that ran it."""


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


def _restore_removed(out: Path, spec: DatasetSpec, progress: Progress, overwrite: bool) -> None:
    """Write the scenario file again if it was removed during the run, as by a controller.

    Raises:
        RecordError: an episode was removed.
    """
    if spec.settings is not None and not (out / SCENARIO).is_file():
        write_json(out / SCENARIO, spec.settings)
    removed = sum(not (out / entry.name).is_file() for entry in progress.kept)
    if removed:
        raise RecordError(
            f"{removed} of {spec.episodes} episodes in {out} were removed while it was generated; "
            f"{how_to_continue(overwrite=overwrite)}"
        )


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


def _run_episodes(job: Job, progress: Progress, workers: Workers, advance: Advance) -> None:
    """Run pending episodes until the progress is finished."""
    missing = job.spec.episodes - len(progress.kept)
    results = unordered_map(
        partial(_episode_runner, job),
        progress.pending(),
        workers=workers,
        is_last=_is_failure,
        total=None if job.spec.keep and missing > 1 else missing,
        writes=job.out,
    )
    with closing(results):
        for result in results:
            if isinstance(result, ExcludedEpisode):
                log_excluded(job.out, result)
            advance(progress.add(result))
            if progress.is_finished:
                return


def _episode_runner(job: Job) -> Callable[[int], EpisodeResult]:
    """A function that runs an episode by number; all its episodes share one controller."""
    process = os.getpid()
    controller = job.source.create()
    end_if_forked(process)
    return partial(_run_episode, replace(job, process=process), controller)


class _ForkGuard:
    """An observer that ends copies of the process which the controller has forked, in the tick in which it did.

    Args:
        process: id of the process that runs the batch.
    """

    def __init__(self, process: int) -> None:
        self._process = process

    def open(self, scene: Scene, controller_info: ControllerInfo) -> None:
        end_if_forked(self._process)

    def note(self, frame: Frame) -> None:
        end_if_forked(self._process)

    def close(self, last: Snapshot, outcome: Outcome) -> None:
        end_if_forked(self._process)


def _is_failure(result: EpisodeResult) -> bool:
    return isinstance(result, FailedEpisode)


def _run_episode(job: Job, controller: Controller, episode: int) -> EpisodeResult:
    """Run one episode and write its file if its outcome is kept."""
    spec = job.spec
    recorder = EpisodeRecorder(id=f"{episode:06d}", context=job.scenario.context)
    try:
        scene = generate(job.scenario, spec.seed, episode)
        run = Episode(
            scene,
            controller,
            observers=[_ForkGuard(job.process), recorder],
            controller_info=spec.controller_info,
            renderer=renderer_for(controller),
        )
        status = run.run().status
        logger.info("episode %d: %s after %d frames", episode, status, len(run.past))
        if spec.keep and status not in spec.keep:
            return ExcludedEpisode(episode, status)
        return store_episode(job.out, spec, episode, recorder)
    except BaseException as error:
        interruption.reraise(error)
        # not the class itself, which a controller may have defined where pickle cannot find it
        kind = next((one for one in _FAILURES if isinstance(error, one)), ControllerError)
        partial_file = _store_partial(job, recorder, episode)
        return FailedEpisode(episode, kind, _message(error), partial_file, "".join(traceback.format_exception(error)))


def _store_partial(job: Job, recorder: EpisodeRecorder, episode: int) -> str | None:
    """Write the frames of a failed episode for debugging, and return the file's name; None if there are none."""
    try:
        return store_episode(job.out / FAILED, job.spec, episode, recorder).name
    except RecordError:
        return None


def _message(error: BaseException) -> str:
    """The error on one line; for an error of the code of others also its class and its innermost place there."""
    notes = getattr(error, "__notes__", [])
    if isinstance(error, Sonata2dError):
        return "; ".join([one_line(text_of(error) or type(error).__name__, 1000), *notes])
    text = "; ".join([described(error), *notes])
    places = traceback.extract_tb(error.__traceback__)
    libraries = {_PACKAGE_FOLDER, *(Path(path) for path in sysconfig.get_paths().values())}
    foreign = [
        place
        for place in places
        if place.filename != "<string>" and libraries.isdisjoint(Path(place.filename).resolve().parents)
    ]
    return f"{text} ({Path(foreign[-1].filename).name}, line {foreign[-1].lineno})" if foreign else text


def _failure_message(failure: FailedEpisode, out: Path, spec: DatasetSpec) -> str:
    message = f"episode {failure.episode} of seed {spec.seed}: {failure.message}"
    if failure.partial_file is None:
        return message
    return f"{message}; the frames before it are in {out / FAILED / failure.partial_file}"


def how_to_continue(*, overwrite: bool) -> str:
    """The advice after an interruption; the same command with `--overwrite` would remove the complete episodes."""
    return "continue with the same command and --resume" + (" in place of --overwrite" if overwrite else "")


def _how_to_go_on(out: Path, spec: DatasetSpec, progress: Progress, overwrite: bool) -> str:
    """What to do after a failure."""
    # with `keep`, kept episodes after the failed one do not count yet
    stored = len(progress.kept) if spec.keep else len(episode_numbers(out, spec))
    if not episode_numbers(out, spec):
        return f"no episode is complete in {out}, correct the cause and run the same command again"
    text = f"{stored} of {spec.episodes} episodes are complete in {out}, {how_to_continue(overwrite=overwrite)}"
    return f"{text}, or with --overwrite if you change the controller's code" if spec.controller_sha256 else text


@contextmanager
def _finished_listed(out: Path, spec: DatasetSpec, progress: Progress) -> Iterator[None]:
    """If the run is interrupted, list the finished episodes in the manifest, so that other commands see them."""
    process = os.getpid()
    try:
        yield
    except BaseException:
        if os.getpid() != process:  # a copy of the process, forked by the controller
            raise
        with suppress(OSError, Sonata2dError):  # the reason of the interruption is more important
            remove_partial_files(out)
            entries = progress.kept
            if not spec.keep:  # with `keep`, an episode counts once the numbers before it have been run
                stored = {entry.episode: entry for entry in progress.stored}
                unseen, _ = existing_episodes(out, spec, {}, known=stored)  # finished while the run was ending
                entries = sorted((stored | unseen).values(), key=lambda entry: entry.episode)
            entries = [entry for entry in entries if (out / entry.name).is_file()]
            if entries:
                manifest = manifest_of(spec, entries, complete=False, left_out=progress.left_out)
                write_manifest_and_card(out, manifest)
        raise


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
