"""Generates batches of episodes: each by one worker, whole or not at all, and continued after an interruption.

A batch is a shard. A folder of files is treated as a shard that is not packed: there, each file is a batch of one
episode, so that the workers share the folder.
"""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Callable, Container, Iterable, Mapping, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Self

from ...agents.controllers.base import Controller
from ...core.files.locations import delete, file_names
from ...errors import NewerFormatError, RecordError
from ...record.files import read_stored, sha256_of, write_atomically
from ...record.layout import JsonDict
from ...record.reader import read_episode
from ...record.recorder import EpisodeRecorder
from ...record.shard_file import ShardWriter, extents, shard_manifest_path
from ...workers.tasks import stop_if_over, stop_if_unwanted
from ..manifest.names import episode_number, part_path, parts_in, shard_name, shard_number
from ..manifest.read import read_document
from ..manifest.write import counts_of, row_of, sum_of
from ..shards import shard_row, write_shard_manifest
from .episodes import Job, created, packed_episode, run_episode
from .progress import Batch, FailedEpisode, logged_exclusions
from .specification import DatasetSpec, identity_of, manifest_of, require_episode_of

logger = logging.getLogger(__name__)


def batch_runner(job: Job) -> Callable[[int], Batch | FailedEpisode]:
    """A function that generates a batch by number; all its episodes share one controller."""
    return partial(_run_batch, job, created(job.source))


def _run_batch(job: Job, controller: Controller, number: int) -> Batch | FailedEpisode:
    """Generate a batch. Finished episodes of an interrupted shard stay in a file; the next attempt takes them over."""
    first, stop = job.spec.covered(number)
    with _NewBatch(job, number) as batch:
        for episode in range(first, stop):
            stop_if_over()
            if batch.takes_over(episode):
                continue
            if (failure := run_episode(job, controller, episode, batch)) is not None:
                return failure
        return batch.finish(stop)


class _NewBatch:
    """A batch that is being written: a shard, which gets its name when it is complete, or a file of a folder.

    Args:
        job: of the data set.
        number: of the batch.

    Raises:
        RecordError: the shard cannot be written.
    """

    def __init__(self, job: Job, number: int) -> None:
        folder, spec = job.out, job.spec
        self._folder, self._number, self._spec, self._claim = folder, number, spec, job.claim
        self._rows: list[JsonDict] = []
        self._left_out: list[tuple[int, str]] = []
        self._path = folder / shard_name(number)
        self._earlier: list[Path] = []
        self._known: dict[str, Path] = {}
        self._writer: ShardWriter | None = None
        if spec.shard_size is not None:
            self._earlier = parts_in(folder, self._path.name)
            self._known = _members_by_name(self._earlier)
            with suppress(OSError, RecordError):
                _whole_shard(self._path)  # it may have covered fewer episodes
                self._known |= _members_by_name([self._path])
            self._writer = ShardWriter(self._path, part_path(self._path))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self._writer is not None:
            self._writer.__exit__()

    def takes_over(self, episode: int) -> bool:
        """Take over an episode that an earlier attempt has run; False if it must be run.

        Raises:
            NewerFormatError: a newer version wrote it.
            RecordError: the shard cannot be written.
        """
        path = self._known.get(self._spec.file_name(episode))
        if path is None:
            return False
        try:
            row, data = _usable_row(path, self._spec, episode), read_stored(path)
        except NewerFormatError:
            raise
        except RecordError as error:
            logger.warning("%s; the episode is generated again", error)
            return False
        self._append(row, data)
        return True

    def add(self, episode: int, recorder: EpisodeRecorder) -> None:
        """Store a recorded episode.

        Raises:
            RecordError: it cannot be written.
        """
        self._append(*packed_episode(self._spec, episode, recorder))

    def leave_out(self, episode: int, outcome: str) -> None:
        """Note an episode that was run and is not kept."""
        self._left_out.append((episode, outcome))

    def finish(self, stop: int) -> Batch:
        """Give a shard its name, and write its manifest and card beside it.

        If another attempt has finished the same shard meanwhile, that one stays: after a lost connection, two workers
        may work on one shard.

        Args:
            stop: episode number after the last one that the batch covers.

        Raises:
            RecordError: a file cannot be written.
        """
        if self._writer is None:
            left_out = dict(Counter(outcome for _, outcome in self._left_out))
            return Batch(self._number, stop, next(iter(self._rows), None), counts_of(self._rows), left_out)
        if (manifest := self._finished_meanwhile(stop)) is not None:
            self._writer.discard()
        else:
            stop_if_unwanted()
            self._claim.require()
            delete(shard_manifest_path(self._path))  # it would describe the new file wrongly
            manifest = self._manifest(self._writer, stop)
            write_shard_manifest(self._path, manifest)
        for part in self._earlier:
            with suppress(OSError):
                part.unlink()
        return _batch_of(self._number, manifest)

    def _manifest(self, writer: ShardWriter, stop: int) -> JsonDict:
        """Complete the shard, and return its manifest."""
        first = self._spec.covered(self._number)[0]
        content = {"first": first, "stop": stop, "sha256": writer.finish(), "bytes": writer.size}
        if self._spec.keep:
            content["left_out"] = [list(episode) for episode in self._left_out]
        left_out = sum_of({outcome: 1} for _, outcome in self._left_out)
        return manifest_of(self._spec, self._rows, counts_of(self._rows), left_out, complete=True, shard=content)

    def _finished_meanwhile(self, stop: int) -> JsonDict | None:
        """The manifest of the same shard if it exists; None: there is none, or another one."""
        with suppress(OSError, RecordError):
            manifest = read_document(self._path)
            if manifest["shard"]["stop"] == stop and manifest["files"] == self._rows:
                return _whole_shard(self._path)
        return None

    def _append(self, row: JsonDict, data: bytes) -> None:
        if self._writer is None:
            stop_if_unwanted()
            self._claim.require()
            write_atomically(self._folder / row["name"], data)
        else:
            row = row | {"offset": self._writer.add(row["name"], data)}
        self._rows.append(row)


def existing_batches(
    folder: Path, spec: DatasetSpec, listed: Mapping[str, str] | None = None, *, known: Container[int] = ()
) -> tuple[list[Batch], list[RecordError]]:
    """Usable batches of a specification that a folder already holds, and the errors of other files.

    Args:
        folder: of the data set.
        spec: specification of the data set.
        listed: SHA-256 by file name, from `start_dataset`; a file with another hash counts as changed.
        known: numbers of batches to leave out.

    Raises:
        NewerFormatError: a file was written by a newer version.
    """
    batches, faults = list[Batch](), list[RecordError]()
    existing = _existing_file if spec.shard_size is None else _existing_shard
    for name in sorted(file_names(folder)):
        number = spec.batch_in(name)
        if number is None or number in known:
            continue
        try:
            batch, sha256 = existing(folder / name, spec, number)
            if (listed or {}).get(name, sha256) != sha256:
                raise RecordError(f"{folder / name} was changed since it was generated")
            batches.append(batch)
        except NewerFormatError:
            raise  # never overwrite a file of a newer version
        except RecordError as error:
            faults.append(error)
    # a folder of files has no other trace of the episodes that were not kept
    logged = logged_exclusions(folder) if spec.keep and spec.shard_size is None else []
    return [*logged, *batches], faults


def _existing_file(path: Path, spec: DatasetSpec, episode: int) -> tuple[Batch, str]:
    """The batch of an episode file, and its SHA-256."""
    row = _usable_row(path, spec, episode)
    return Batch(episode, episode + 1, row, counts_of([row]), {}), row["sha256"]


def _usable_row(path: Path, spec: DatasetSpec, episode: int) -> JsonDict:
    """The manifest row of an episode that a file or a shard holds.

    Raises:
        RecordError: it cannot be read, or the specification does not produce it.
    """
    record = read_episode(path)
    require_episode_of(record, spec, episode)
    return row_of(record)


def _existing_shard(path: Path, spec: DatasetSpec, number: int) -> tuple[Batch, str]:
    """The batch of a complete shard, and its SHA-256."""
    manifest = _whole_shard(path)
    identity = {key: value for key, value in identity_of(spec).items() if key != "episodes"}
    different = [key for key, value in identity.items() if manifest.get(key) != value]
    if different or manifest.get("shard") is None:
        raise RecordError(f"{path} belongs to another data set: its {', '.join(different) or 'kind'} differs")
    return _batch_of(number, manifest), manifest["shard"]["sha256"]


def _whole_shard(shard: Path) -> JsonDict:
    """The manifest of a shard, after a comparison of the file with its hash.

    Raises:
        RecordError: the manifest or the file cannot be read, or the file was changed.
    """
    manifest = read_document(shard)
    if manifest.get("shard") is not None and sha256_of(shard) != manifest["shard"]["sha256"]:
        raise RecordError(f"{shard} was changed since it was generated")
    return manifest


def _batch_of(number: int, manifest: JsonDict) -> Batch:
    """The batch of a complete shard, by its manifest."""
    row, left_out = shard_row(shard_name(number), manifest), manifest.get("left_out", {})
    return Batch(number, manifest["shard"]["stop"], row, manifest["counts"], left_out, manifest["split"] is not None)


def cut_shard(job: Job, batch: Batch, episodes: int) -> Batch:
    """The last shard of a data set with `keep`, with its first episodes only.

    Args:
        job: of the data set.
        batch: the shard.
        episodes: number of episodes that it should have; 1 or more.

    Raises:
        RecordError: the shard cannot be read or written.
    """
    path = job.out / shard_name(batch.number)
    manifest = read_document(path)
    numbers = [row["episode"] for row in manifest["files"][:episodes]]
    stop = numbers[-1] + 1
    if stop == batch.stop and len(numbers) == batch.episodes:
        return batch
    with _NewBatch(job, batch.number) as shard:
        for number in numbers:
            if not shard.takes_over(number):
                raise RecordError(f"{path / job.spec.file_name(number)} was changed since it was generated")
        for number, outcome in manifest["shard"]["left_out"]:
            if number < stop:
                shard.leave_out(number, outcome)
        return shard.finish(stop)


def remove_split(shard: Path) -> None:
    """Remove the split from the manifest of a shard, because the split of the data set does not hold any more.

    Raises:
        RecordError: the manifest cannot be read or written.
    """
    write_shard_manifest(shard, read_document(shard) | {"split": None})


def remove_surplus(folder: Path, spec: DatasetSpec, batches: Sequence[Batch]) -> None:
    """Remove batches that do not belong to the data set, as workers run ahead with `keep`, and unfinished shards."""
    number_in = episode_number if spec.shard_size is None else shard_number
    kept = {batch.number for batch in batches if batch.row is not None}
    for name in file_names(folder) if spec.keep or spec.shard_size else ():
        number = number_in(name)
        if number is not None and number not in kept:
            delete(folder / name)
    for path in parts_in(folder):
        delete(path)


def _members_by_name(paths: Iterable[Path]) -> dict[str, Path]:
    """The members of tar files by name."""
    members: dict[str, Path] = {}
    for path in paths:
        with suppress(OSError):
            members |= {name: path / name for name in extents(path)}
    return members
