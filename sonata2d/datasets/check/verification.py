"""Verification of an episode file or a data set, in parallel: all checks, and on request replay and rerun."""

from __future__ import annotations

import logging
import warnings
from collections.abc import Callable, Mapping
from concurrent.futures import Executor
from contextlib import suppress
from functools import partial
from pathlib import Path

from ...agents.controllers.loading import is_installed, load_controller, source_hashes
from ...core.files import interruption
from ...core.files.locations import location
from ...core.notebook import Advance
from ...core.wording import described
from ...errors import ControllerError, ControllerWarning
from ...record.layout import JsonDict
from ...record.record import EpisodeRecord
from ...workers.executors import Workers, parallel_map, shared_workers
from ...workers.processes import end_if_unguarded
from ..manifest.names import MANIFEST
from ..manifest.read import has_manifest
from ..manifest.rows import files_of, read_manifest
from .episodes import ListedFile, Problem, check_record, open_to_check
from .manifests import check_manifest, check_shard, check_tar, files_in, listed_shards
from .replay import check_replay, check_rerun

logger = logging.getLogger(__name__)


def verify(
    path: str | Path,
    *,
    replay: bool = False,
    rerun: bool = False,
    controller: str | None = None,
    workers: int | Executor | Workers = 1,
    advance: Advance = lambda step: None,
) -> list[Problem]:
    """Problems of an episode file or a data set; an empty list if there are none.

    Args:
        path: a file or a folder.
        replay: also run the recorded commands again and compare every byte.
        rerun: also run the controller again and compare every byte.
        controller: name of the controller, if the name in the files no longer finds it.
        workers: number of processes; or an executor, or workers that several calls share, see `sonata2d.Workers`.
        advance: progress callback; its argument is the number of files checked.

    Raises:
        RecordError: the path does not exist or holds no episode, or its manifest is damaged.

    Warns:
        ControllerWarning: `rerun` gives the same frames, although the controller's code has changed.
    """
    end_if_unguarded()
    shared = shared_workers(workers)
    path = location(path)
    stored = read_manifest(path) if has_manifest(path) else None
    problems = check_tar(path) if stored is None else check_manifest(path, stored)
    verify_file = partial(_verify_file, replay=replay, rerun=rerun, controller=controller)
    with shared as pool:
        place = pool.place(path)
        manifest = None if stored is None else read_manifest(place)
        shards = [] if manifest is None else listed_shards(place, manifest)
        for shard_problems in parallel_map(check_shard, shards, workers=pool, reads=place):
            problems += shard_problems
        files = [ListedFile(file) for file in files_of(place)] if manifest is None else files_in(place, manifest)
        for file_problems in parallel_map(verify_file, files, workers=pool, reads=place):
            problems += file_problems
            advance(1)
    if rerun and manifest is not None:
        problems += _changed_code(manifest, controller, any(problem.place == "rerun" for problem in problems))
    return problems


def _changed_code(manifest: JsonDict, name: str | None, differs: bool) -> list[Problem]:
    """Controllers whose source file differs from the one that made the data set.

    Args:
        manifest: of the data set.
        name: name of the controller; None: the recorded one, if it is built in or a plug-in's.
        differs: whether frames differ, which the changed code then explains; else it is only worth a warning.
    """
    problems = []
    for source in manifest.get("sources") or [manifest]:
        recorded, info = source.get("controller_sha256"), source["controller"]
        if not recorded or not (name or is_installed(info["path"], info["settings"] or {})):
            continue
        path = name or info["path"]
        with suppress(ControllerError):  # a controller that does not load is a problem of each file already
            present = source_hashes(path, load_controller(path, info["settings"]))
            stored = [
                sha256
                for place, sha256 in recorded.items()
                if not place.startswith(("pedestrian model ", "room kind "))
            ]
            if list(present.values()) == stored:
                continue
            now, then = (_short_hashes(hashes) for hashes in (present, recorded))
            message = f"the code of {path} differs from the data set: SHA-256 {now} now, {then} recorded"
            if differs:
                problems.append(Problem(MANIFEST, "controller_sha256", f"{message}; this may explain other frames"))
            else:
                warnings.warn(message, ControllerWarning, stacklevel=3)
    return problems


def _short_hashes(hashes: Mapping[str, str]) -> str:
    return ", ".join(f"{sha256[:12]}…" for sha256 in hashes.values()) or "unknown"


def _verify_file(file: ListedFile, *, replay: bool, rerun: bool, controller: str | None) -> list[Problem]:
    """Problems of one file; only a readable file is run again."""
    logger.info("checking %s", file.path)
    record, stored, problems = open_to_check(file)
    if record is None:
        return problems
    problems += check_record(record, stored, file)
    checks: dict[str, Callable[[EpisodeRecord], list[Problem]]] = {"replay": check_replay} if replay else {}
    if rerun:
        checks["rerun"] = partial(check_rerun, name=controller)
    for place, check in checks.items():
        try:
            problems += check(record)
        except BaseException as error:  # a changed file or a faulty controller may raise any error
            interruption.reraise(error)
            problems.append(Problem(record.path.name, place, described(error)))
    return problems
