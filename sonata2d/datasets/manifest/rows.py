"""The episodes of a data set: rows of its manifest, or of the manifests of its shards, read when they are needed.

A folder of episode files is treated as a shard that is not packed. The manifest of the folder lists the rows of the
episodes as the manifest of a shard does; a data set in shards has one more manifest, which lists the shards.
"""

from __future__ import annotations

import hashlib
import warnings
from array import array
from bisect import bisect_right
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from itertools import accumulate
from pathlib import Path
from typing import SupportsIndex, TypeVar, overload

from ...core.files.locations import file_names
from ...core.wording import counted
from ...errors import DatasetWarning, RecordError
from ...record.files import SUFFIXES, file_exists, read_stored
from ...record.layout import JsonDict
from ...record.shard_file import (
    SHARD_MANIFEST_SUFFIX,
    SHARD_SUFFIX,
    extents,
    is_member,
    is_shard,
    members_of,
    shard_manifest_path,
)
from .names import CROISSANT, MANIFEST, METRICS, SCENARIO, episode_number, shard_number
from .read import has_manifest, read_document

_NOT_EPISODES = (SCENARIO, METRICS, CROISSANT, "evaluation.json")  # JSON beside episodes without a manifest
_FIRST_FILES = 10  # number of files of a manifest of which one must exist
_KEPT_SHARDS = 8  # number of shards whose rows stay in memory

T = TypeVar("T")


class Lazy(Sequence[T]):
    """A sequence whose items are made when they are accessed.

    Args:
        count: number of items.
        item: makes the item of a number; None: items can only be iterated over, so an index reads all of them.
        every: iterates over all items; None: calls `item` for each number.
    """

    def __init__(
        self, count: int, item: Callable[[int], T] | None = None, every: Callable[[], Iterator[T]] | None = None
    ) -> None:
        self._count, self._item, self._every = count, item, every

    def __len__(self) -> int:
        """Number of items."""
        return self._count

    @overload
    def __getitem__(self, index: SupportsIndex) -> T: ...

    @overload
    def __getitem__(self, index: slice) -> list[T]: ...

    def __getitem__(self, index: SupportsIndex | slice) -> T | list[T]:
        """An item, or several.

        Raises:
            IndexError: there is no such item.
            RecordError: the manifest of a shard cannot be read.
        """
        if self._item is None:
            return list(self)[index]
        if isinstance(index, slice):
            return [self._item(number) for number in range(self._count)[index]]
        return self._item(range(self._count)[index])

    def __iter__(self) -> Iterator[T]:
        """All items in order."""
        if self._every is not None:
            return self._every()
        assert self._item is not None
        return map(self._item, range(self._count))


def selection(items: Sequence[T], numbers: Iterable[int]) -> Lazy[T]:
    """Some items of a sequence, in the order of their numbers."""
    indices = array("q", numbers)
    return Lazy(len(indices), partial(_selected, items, indices))


def _selected(items: Sequence[T], indices: array[int], number: int) -> T:
    return items[indices[number]]


class ShardRows(Lazy[JsonDict]):
    """The rows of the episodes of all shards.

    The name of a row is the path of its member, such as `shard-000000.tar/000007.json`. Only the rows of a few shards
    are in memory at a time.

    Args:
        folder: of the data set.
        shards: rows of the shards in its manifest.
    """

    def __init__(self, folder: Path, shards: Sequence[JsonDict]) -> None:
        self.folder, self.shards = folder, shards
        self._starts: list[int] = [0, *accumulate(shard["episodes"] for shard in shards)]
        self._rows: dict[str, list[JsonDict]] = {}  # by name of the shard
        self._names: dict[str, Sequence[str]] = {}  # likewise
        super().__init__(self._starts[-1], self._row, partial(self.every, shards))

    def every(self, shards: Iterable[JsonDict]) -> Iterator[JsonDict]:
        """The rows of the episodes of some shards."""
        for shard in shards:
            yield from self.of_shard(shard)

    def of_shard(self, shard: JsonDict) -> list[JsonDict]:
        """The rows of the episodes of a shard.

        Raises:
            RecordError: as of `read_shard`.
        """
        return _recent(self._rows, shard["name"], partial(_rows_of_shard, self.folder, shard))

    def path_of(self, number: int) -> Path:
        """The path of an episode, for which the rows are not read.

        Raises:
            RecordError: as of `read_shard`.
        """
        shard, k = self._place(number)
        names = _recent(self._names, shard["name"], partial(_names_of_shard, self.folder, shard))
        path: Path = self.folder / shard["name"]
        return path / names[k]

    def _row(self, number: int) -> JsonDict:
        shard, k = self._place(number)
        return self.of_shard(shard)[k]

    def _place(self, number: int) -> tuple[JsonDict, int]:
        """The shard of an episode, and the number of the episode in it."""
        k = bisect_right(self._starts, number) - 1
        return self.shards[k], number - self._starts[k]


def _recent(cache: dict[str, T], name: str, make: Callable[[], T]) -> T:
    """The value of a name in a cache, in which the last few values stay."""
    if name not in cache:
        while len(cache) >= _KEPT_SHARDS:
            del cache[next(iter(cache))]
        cache[name] = make()
    return cache[name]


def _rows_of_shard(folder: Path, shard: JsonDict) -> list[JsonDict]:
    name = shard["name"]
    return [row | {"name": f"{name}/{row['name']}"} for row in read_shard(folder, shard)["files"]]


def _names_of_shard(folder: Path, shard: JsonDict) -> Sequence[str]:
    """The names of the members of a shard."""
    try:
        names = tuple(extents(folder / shard["name"]))
    except OSError:
        names = ()
    # else the names in the manifest, or the error of `read_shard` that explains the difference
    return names if len(names) == shard["episodes"] else [row["name"] for row in read_shard(folder, shard)["files"]]


def read_shard(folder: Path, shard: JsonDict) -> JsonDict:
    """The manifest of a shard.

    Args:
        folder: of the data set.
        shard: row of the shard in the manifest of the data set.

    Raises:
        RecordError: it cannot be read, or lists another number of episodes.
    """
    path = folder / shard["name"]
    for file in (path, shard_manifest_path(path)):
        if not file.is_file():
            raise RecordError(f"{file} is missing; if the data set was generated, run the command with --resume")
    manifest = read_document(path)
    if len(manifest["files"]) != shard["episodes"]:
        raise RecordError(
            f"{path}: its manifest lists {len(manifest['files'])} episodes, and the data set {shard['episodes']}; "
            "run `sonata2d check`"
        )
    return manifest


def read_manifest(folder: Path) -> JsonDict:
    """The manifest of a data set; `collected` is always present.

    Raises:
        RecordError: the folder has no manifest, or the manifest is damaged or was written by a newer version.
    """
    return {"collected": False} | read_stored_manifest(folder)


def read_stored_manifest(folder: Path) -> JsonDict:
    """The manifest of a data set with the keys that are stored, so that a rewritten one differs in changed keys only.

    Raises:
        RecordError: as `read_manifest`.
    """
    return with_rows(read_document(folder), folder)


def with_rows(manifest: JsonDict, folder: Path) -> JsonDict:
    """A stored manifest; if it lists shards, with the keys of a manifest of files, also in `split` and `sources`.

    Args:
        manifest: as stored.
        folder: of the data set.
    """
    if "shards" not in manifest:
        return manifest
    rows = ShardRows(folder, manifest["shards"])
    whole = manifest | {"files": rows}
    if manifest["split"] is not None:
        whole["split"] = {
            part: Lazy(count, every=partial(_names_of_part, rows, part)) for part, count in manifest["split"].items()
        }
    if manifest.get("sources"):
        whole["sources"] = [source | {"files": _names_of_source(rows, source)} for source in manifest["sources"]]
    return whole


def _names_of_part(rows: ShardRows, part: str) -> Iterator[str]:
    """The names of the episodes in a part of a split data set."""
    for shard in rows.shards:
        for name in (read_shard(rows.folder, shard)["split"] or {}).get(part, ()):
            yield f"{shard['name']}/{name}"


def _names_of_source(rows: ShardRows, source: JsonDict) -> Lazy[str]:
    """The names of the episodes of a data set that was merged: the members of its shards."""
    names = set(source["shards"])
    shards = [shard for shard in rows.shards if shard["name"] in names]
    return Lazy(sum(shard["episodes"] for shard in shards), every=partial(_names_in, rows, shards))


def _names_in(rows: ShardRows, shards: Sequence[JsonDict]) -> Iterator[str]:
    return (row["name"] for row in rows.every(shards))


def stored_form(manifest: JsonDict) -> JsonDict:
    """A manifest as it is stored: for shards, without the rows and names that their manifests list."""
    if "shards" not in manifest:
        return manifest
    split = manifest["split"]
    stored = {key: value for key, value in manifest.items() if key != "files"}
    stored["split"] = None if split is None else {part: len(names) for part, names in split.items()}
    if manifest.get("sources"):
        stored["sources"] = [
            {key: value for key, value in source.items() if key != "files"} for source in manifest["sources"]
        ]
    return stored


def listing(manifest: JsonDict) -> list[JsonDict]:
    """The rows of the files that lie in the folder of a data set: of its shards, or else of its episodes."""
    rows: list[JsonDict] = manifest["shards" if "shards" in manifest else "files"]
    return rows


def files_of(path: Path) -> Sequence[Path]:
    """Episode files at a path: the file itself, the files listed in its manifest, or else the JSON files of the folder.

    Files in shards are paths such as `demo/shard-000000.tar/000007.json`.

    Raises:
        RecordError: the path does not exist or holds no episode, or its manifest is damaged.

    Warns:
        DatasetWarning: the data set is interrupted.
    """
    if has_manifest(path):
        return files_in_manifest(path, read_manifest(path))
    if is_shard(path):
        names = [name for name in members_of(path) if name.endswith(SUFFIXES) and name not in _NOT_EPISODES]
        if not names:
            raise RecordError(f"{path} holds no episode files")
        return [path / name for name in names]
    if path.is_file() or is_member(path):
        return [path]
    names = [name for name in sorted(file_names(path)) if not name.endswith(SHARD_MANIFEST_SUFFIX)]
    files = [path / name for name in names if name.endswith(SUFFIXES) and name not in _NOT_EPISODES]
    if not files:
        if any(name.endswith(SHARD_SUFFIX) for name in names):
            raise RecordError(f"{path} holds shards, but no {MANIFEST}; name one of the shards")
        if path.is_dir():
            raise RecordError(f"{path} holds no episode files")
        raise RecordError(f"{path} is neither a file nor a folder" if path.exists() else f"{path} does not exist")
    return files


def files_in_manifest(folder: Path, manifest: JsonDict) -> Sequence[Path]:
    """The episode files that a manifest lists.

    Raises:
        RecordError: there are many, and the first ones are missing.

    Warns:
        DatasetWarning: the data set is interrupted.
    """
    rows = manifest["files"]
    if rows:  # without any, the caller says more
        warn_if_incomplete(folder, manifest)
    first = [] if isinstance(rows, ShardRows) else [row["name"] for row in rows[:_FIRST_FILES]]
    if first and len(rows) > _FIRST_FILES and not any(file_exists(folder / name) for name in first):
        raise RecordError(f"{folder}: {MANIFEST} lists {len(rows)} files, but {first[0]} to {first[-1]} are missing")
    return paths_in(folder, rows)


def paths_in(folder: Path, rows: Sequence[JsonDict]) -> Sequence[Path]:
    """The paths of the episodes in the rows of a manifest; paths in shards are made when they are needed."""
    return Lazy(len(rows), rows.path_of) if isinstance(rows, ShardRows) else tuple(folder / row["name"] for row in rows)


def warn_if_incomplete(folder: Path, manifest: JsonDict) -> None:
    """Warn of episodes that an interrupted data set does not have yet.

    Warns:
        DatasetWarning: the data set is interrupted.
    """
    if not manifest["complete"]:
        message = (
            f"{folder} is interrupted: it has {len(manifest['files'])} of {manifest['episodes']} episodes; complete it "
            "with generate --resume"
        )
        warnings.warn(message, DatasetWarning, stacklevel=3)


def unlisted_episodes(folder: Path, manifest: JsonDict) -> str:
    """A message that a manifest does not list all episode files or shards of its folder yet; empty if it does.

    A run that was killed leaves such a manifest.
    """
    if manifest["complete"]:
        return ""
    what, number_in = ("shard", shard_number) if "shards" in manifest else ("episode file", episode_number)
    listed = {number_in(row["name"]) for row in listing(manifest)}
    count = len({number_in(name) for name in file_names(folder)} - listed - {None})
    if not count:
        return ""
    files = f"{counted(count, what)} {'is' if count == 1 else 'are'}"
    return f"{files} not listed until `generate` with --resume has completed the data set"


def read_listed_file(folder: Path, row: JsonDict) -> bytes:
    """The stored bytes of a file of a data set.

    Args:
        folder: of the data set.
        row: of the file in the manifest.

    Raises:
        RecordError: the file cannot be read, or its hash differs from the manifest.
    """
    path = folder / row["name"]
    data = read_stored(path)
    if hashlib.sha256(data).hexdigest() != row["sha256"]:
        raise RecordError(f"{path} was changed: its hash differs from the manifest; run `sonata2d check`")
    return data
