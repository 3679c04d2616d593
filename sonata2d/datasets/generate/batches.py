"""Generates the shards of a data set: each by one worker, whole or not at all, and continued after an interruption."""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from itertools import count
from pathlib import Path
from typing import Self

from ...core.files.locations import file_names
from ...errors import NewerFormatError, RecordError
from ...record.files import file_suffix, read_stored, sha256_of
from ...record.layout import JsonDict
from ...record.reader import read_episode
from ...record.recorder import EpisodeRecorder
from ...record.shard_file import ShardWriter, extents, shard_manifest_path
from ..manifest.read import (
    DatasetSpec,
    ManifestEntry,
    identity_of,
    manifest_entry,
    manifest_of,
    packed_episode,
    read_stored_manifest,
    require_episode_of,
)
from ..manifest.rows import part_path, parts_in, shard_name, shard_number
from ..workers.tasks import stop_if_over, stop_if_unwanted
from .episodes import EpisodeRuns, Job, prepared
from .progress import ExcludedEpisode, FailedEpisode, too_few_kept
from .shard_output import shard_row, write_shard_manifest

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class ShardResult:
    """A generated shard.

    Attributes:
        number: of the shard.
        stop: episode number after the last one that it covers.
        row: of the shard: the keys of `manifest_models.Shard`, `counts`, and with `keep` also `left_out`.
        is_split: whether its manifest divides its episodes among parts.
    """

    number: int
    stop: int
    row: JsonDict
    is_split: bool = False

    @property
    def episodes(self) -> int:
        """Number of episodes in the shard."""
        return int(self.row["episodes"])


class ShardProgress:
    """The shards of a generation run, counted in order, as `Progress` counts episodes.

    Args:
        spec: specification of the data set, with a shard size.
        known: shards of earlier runs.

    Attributes:
        shards: the first ones, without a gap.
        kept: number of their episodes.
        failure: the failed episode that ends the run; None if there is none.

    Raises:
        RecordError: too few episodes are kept, see `Progress`.
    """

    def __init__(self, spec: DatasetSpec, known: Iterable[ShardResult] = ()) -> None:
        self._spec = spec
        self._results: dict[int, ShardResult | FailedEpisode] = {result.number: result for result in known}
        self._left_out = Counter[str]()  # of the counted shards, by outcome
        self.shards: list[ShardResult] = []
        self.kept = 0
        self.failure: FailedEpisode | None = None
        self._count()

    @property
    def is_finished(self) -> bool:
        """Whether the run needs no further result."""
        return self.failure is not None or self.kept >= self._spec.episodes

    @property
    def stored(self) -> int:
        """Number of episodes in all shards that exist."""
        return sum(result.episodes for result in self._results.values() if isinstance(result, ShardResult))

    def add(self, result: ShardResult | FailedEpisode) -> int:
        """Add a result and return the number of newly kept episodes.

        Raises:
            RecordError: too few episodes are kept.
        """
        before = min(self.kept, self._spec.episodes)
        number = result.number if isinstance(result, ShardResult) else result.episode // shard_size_of(self._spec)
        self._results[number] = result
        self._count()
        return min(self.kept, self._spec.episodes) - before

    def pending(self) -> Iterator[int]:
        """Numbers of shards without a result: endless with `keep`, empty if the run is finished."""
        if self.is_finished:
            return iter(())
        numbers = count() if self._spec.keep else range(shard_count(self._spec))
        return (number for number in numbers if number not in self._results)

    def _count(self) -> None:
        while not self.is_finished and (result := self._results.get(len(self.shards))) is not None:
            if isinstance(result, FailedEpisode):
                self.failure = result
                return
            covers_all = result.stop == shard_range(self._spec, result.number)[1]
            if not covers_all and self.kept + result.episodes < self._spec.episodes:
                del self._results[result.number]  # it was the last one of a smaller data set
                return
            self.shards.append(result)
            self.kept += result.episodes
            self._left_out.update(result.row.get("left_out", {}))
            too_few_kept(self._spec, self.kept, self.kept + self._left_out.total(), self._left_out)


def shard_size_of(spec: DatasetSpec) -> int:
    """The number of episode numbers that each shard of a specification covers."""
    assert spec.shard_size is not None
    return spec.shard_size


def shard_count(spec: DatasetSpec) -> int:
    """The number of shards of a data set without `keep`."""
    return -(-spec.episodes // shard_size_of(spec))


def shard_range(spec: DatasetSpec, number: int) -> tuple[int, int]:
    """The first episode number that a shard covers, and the one after the last."""
    size = shard_size_of(spec)
    stop = (number + 1) * size
    return number * size, stop if spec.keep else min(stop, spec.episodes)


def shard_runner(job: Job) -> Callable[[int], ShardResult | FailedEpisode]:
    """A function that generates a shard by number; all its episodes share one controller."""
    return partial(_run_shard, prepared(job))


def _run_shard(runs: EpisodeRuns, number: int) -> ShardResult | FailedEpisode:
    """Generate a shard. If that is interrupted, its episodes stay in a file that the next attempt takes them from."""
    spec = runs.job.spec
    first, stop = shard_range(spec, number)
    entries: list[ManifestEntry] = []
    left_out: list[ExcludedEpisode] = []
    with NewShard(runs.job.out, number, spec) as shard:
        for episode in range(first, stop):
            stop_if_over()
            if (known := shard.known(episode)) is not None:
                entries.append(known)
                continue
            result = runs.run(episode, shard.add)
            if isinstance(result, FailedEpisode):
                return result
            if isinstance(result, ExcludedEpisode):
                left_out.append(result)
            else:
                entries.append(result)
        return shard.finish(entries, left_out, stop)


class NewShard:
    """A shard that is being written: it gets its name when it is complete.

    Args:
        folder: of the data set.
        number: of the shard.
        spec: specification of the data set.
    """

    def __init__(self, folder: Path, number: int, spec: DatasetSpec) -> None:
        self._folder, self._number, self._spec = folder, number, spec
        self._path = folder / shard_name(number)
        self._earlier = parts_in(folder, self._path.name)
        self._known = _members_by_name(self._earlier)
        with suppress(OSError, RecordError):
            _whole_shard(self._path)  # it may have covered fewer episodes
            self._known |= _members_by_name([self._path])
        self._writer = ShardWriter(self._path, part_path(self._path))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._writer.__exit__()

    def known(self, episode: int) -> ManifestEntry | None:
        """The row of an episode that an earlier attempt has run, which is taken over; None: it must be run.

        Raises:
            NewerFormatError: a newer version wrote it.
            RecordError: the shard cannot be written.
        """
        path = self._known.get(self._spec.file_name(episode))
        if path is None:
            return None
        try:
            record = read_episode(path)
            require_episode_of(record, self._spec, episode)
            entry, data = manifest_entry(record), read_stored(path)
        except NewerFormatError:
            raise
        except RecordError as error:
            logger.warning("%s; the episode is generated again", error)
            return None
        return self._append(entry, data)

    def add(self, episode: int, recorder: EpisodeRecorder) -> ManifestEntry:
        """Append a recorded episode, and return its row.

        Raises:
            RecordError: the shard cannot be written.
        """
        return self._append(*packed_episode(self._spec, episode, recorder))

    def finish(self, entries: list[ManifestEntry], left_out: list[ExcludedEpisode], stop: int) -> ShardResult:
        """Give the shard its name, and write its manifest and card beside it.

        If another attempt has finished the same shard meanwhile, that one stays: after a lost connection, two workers
        may work on one shard.

        Args:
            entries: rows of its episodes, in order.
            left_out: episodes that were run and not kept.
            stop: episode number after the last one that it covers.

        Raises:
            RecordError: a file cannot be written.
        """
        if (manifest := self._finished(entries, stop)) is not None:
            self._writer.discard()
        else:
            stop_if_unwanted()
            shard_manifest_path(self._path).unlink(missing_ok=True)  # it would describe the new file wrongly
            content = {
                "first": shard_range(self._spec, self._number)[0],
                "stop": stop,
                "sha256": self._writer.finish(),
                "bytes": self._writer.size,
            }
            if self._spec.keep:
                content["left_out"] = [[one.episode, one.outcome] for one in left_out]
            manifest = _shard_manifest(self._spec, entries, content)
            write_shard_manifest(self._path, manifest)
        for part in self._earlier:
            with suppress(OSError):
                part.unlink()
        return result_of(self._number, manifest)

    def _finished(self, entries: list[ManifestEntry], stop: int) -> JsonDict | None:
        """The manifest of the same shard if it exists; None: there is none, or another one."""
        with suppress(OSError, RecordError):
            found = read_stored_manifest(self._path)
            if found["shard"]["stop"] == stop and found["files"] == [entry.row() for entry in entries]:
                return _whole_shard(self._path)
        return None

    def _append(self, entry: ManifestEntry, data: bytes) -> ManifestEntry:
        return replace(entry, offset=self._writer.add(entry.name, data))


def _shard_manifest(spec: DatasetSpec, entries: list[ManifestEntry], content: JsonDict) -> JsonDict:
    """The manifest of a shard."""
    left_out = Counter(outcome for _, outcome in content.get("left_out", ()))
    manifest = manifest_of(spec, entries, complete=True, left_out=left_out, shard=content)
    return manifest | {"episodes": len(entries)}


def result_of(number: int, manifest: JsonDict) -> ShardResult:
    """The result of a shard that is complete, by its manifest."""
    row = shard_row(shard_name(number), manifest) | {"counts": manifest["counts"]}
    if "left_out" in manifest:
        row["left_out"] = manifest["left_out"]
    return ShardResult(number, manifest["shard"]["stop"], row, manifest["split"] is not None)


def _whole_shard(shard: Path) -> JsonDict:
    """The manifest of a shard, after a comparison of the file with its hash.

    Raises:
        RecordError: the manifest or the file cannot be read, or the file was changed.
    """
    manifest = read_stored_manifest(shard)
    if manifest.get("shard") is not None and sha256_of(shard) != manifest["shard"]["sha256"]:
        raise RecordError(f"{shard} was changed since it was generated")
    return manifest


def existing_shards(folder: Path, spec: DatasetSpec) -> Iterator[ShardResult]:
    """The complete shards of a specification that a folder already holds; others are logged."""
    identity = identity_of(spec)
    del identity["episodes"]
    for name in sorted(file_names(folder)):
        number, path = shard_number(name), folder / name
        if number is None:
            continue
        try:
            manifest = _whole_shard(path)
            different = [key for key, value in identity.items() if manifest.get(key) != value]
            if different or manifest.get("shard") is None:
                raise RecordError(f"{path} belongs to another data set: its {', '.join(different) or 'kind'} differs")
        except RecordError as error:
            logger.warning("%s; the shard is generated again", error)
            continue
        first = manifest["files"][0]["name"] if manifest["files"] else ""
        if first and file_suffix(Path(first)) != spec.suffix:
            raise RecordError(f"{path} holds files like {first}; resume with the same --compress")
        yield result_of(number, manifest)


def cut_shard(folder: Path, spec: DatasetSpec, result: ShardResult, episodes: int) -> ShardResult:
    """The last shard of a data set with `keep`, with its first episodes only.

    Args:
        folder: of the data set.
        spec: specification of the data set.
        result: of the shard.
        episodes: number of episodes that it should have; 1 or more.

    Raises:
        RecordError: the shard cannot be read or written.
    """
    path = folder / shard_name(result.number)
    manifest = read_stored_manifest(path)
    names = [row["name"] for row in manifest["files"][:episodes]]
    stop = manifest["files"][episodes - 1]["episode"] + 1
    if stop == result.stop and len(names) == result.episodes:
        return result
    left_out = [ExcludedEpisode(k, outcome) for k, outcome in manifest["shard"]["left_out"] if k < stop]
    with NewShard(folder, result.number, spec) as shard:
        entries = []
        for name in names:
            entry = shard.known(int(name.split(".")[0]))
            if entry is None:
                raise RecordError(f"{path / name} was changed since it was generated; generate it again with --resume")
            entries.append(entry)
        return shard.finish(entries, left_out, stop)


def remove_split(shard: Path) -> None:
    """Remove the split from the manifest of a shard, because that of the data set does not hold any more.

    Raises:
        RecordError: the manifest cannot be read or written.
    """
    manifest = read_stored_manifest(shard)
    if manifest["split"] is not None:
        write_shard_manifest(shard, manifest | {"split": None})


def _members_by_name(paths: Iterable[Path]) -> dict[str, Path]:
    """The members of tar files by name."""
    found: dict[str, Path] = {}
    for path in paths:
        with suppress(OSError):
            found |= {member: path / member for member in extents(path)}
    return found
