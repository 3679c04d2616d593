"""The contents of a data set in shards, read from the manifests of the shards when they are needed."""

from __future__ import annotations

from array import array
from bisect import bisect_right
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from itertools import accumulate
from pathlib import Path
from typing import SupportsIndex, TypeVar, overload
from uuid import uuid4

from ...core.files.locations import file_names
from ...errors import RecordError
from ...record.layout import JsonDict
from ...record.shard_file import SHARD_SUFFIX, member_names, shard_manifest_path

PART = ".part-"  # beginning of the names of unfinished shards
_KEPT = 8  # number of shards whose rows stay in memory

T = TypeVar("T")
ReadManifest = Callable[[Path], JsonDict]


def shard_name(number: int) -> str:
    """The name of a shard.

    >>> shard_name(7)
    'shard-000007.tar'
    """
    return f"shard-{number:06d}.tar"


def shard_card_path(shard: Path) -> Path:
    """Path of the card beside a shard."""
    return shard.with_name(f"{shard.name.removesuffix(SHARD_SUFFIX)}.README.md")


def remove_shards(folder: Path, numbers_from: int = 0) -> None:
    """Remove the shards of a folder from a number on, with their manifests and cards, and all unfinished ones."""
    for name in file_names(folder):
        number = shard_number(name.split(".")[0] + SHARD_SUFFIX)
        if number is not None and number >= numbers_from:
            shard = folder / shard_name(number)
            if name in (shard.name, shard_manifest_path(shard).name, shard_card_path(shard).name):
                (folder / name).unlink(missing_ok=True)
    remove_parts(folder)


def remove_parts(folder: Path, number: int | None = None) -> None:
    """Remove unfinished shards: those of one number, or all."""
    for path in parts_in(folder, "" if number is None else shard_name(number)):
        path.unlink(missing_ok=True)


def parts_in(folder: Path, shard: str = "") -> list[Path]:
    """The unfinished shards of a folder: those of one name, or all."""
    return [folder / name for name in file_names(folder) if name.startswith(PART) and name.endswith(shard)]


def part_path(shard: Path) -> Path:
    """A new path for a shard that is being written: several programs may try to write one shard."""
    return shard.with_name(f"{PART}{uuid4().hex[:8]}-{shard.name}")


def shard_number(name: str) -> int | None:
    """The number in the name of a shard; None: it is not named as generated shards are."""
    digits = name.removeprefix("shard-").removesuffix(SHARD_SUFFIX)
    return int(digits) if digits.isdecimal() and digits.isascii() and name == shard_name(int(digits)) else None


class ShardRows(Sequence[JsonDict]):
    """The rows of all shards of a data set, as the manifest of one without shards lists them.

    The name of a row is the path of its member, such as `shard-000000.tar/000007.json`. Only the rows of a few shards
    are in memory at a time.

    Args:
        folder: of the data set.
        shards: rows of the shards in its manifest.
        read: reads the manifest of a shard.
    """

    def __init__(self, folder: Path, shards: Sequence[JsonDict], read: ReadManifest) -> None:
        self.folder = folder
        self.shards = shards
        self._read = read
        self._starts: list[int] = [0, *accumulate(shard["episodes"] for shard in shards)]
        self._parts: tuple[str, dict[str, frozenset[str]]] = "", {}  # of one shard
        self._kept: dict[str, list[JsonDict]] = {}  # by name of the shard
        self._names: dict[str, tuple[str, ...]] = {}  # likewise

    def __len__(self) -> int:
        """Number of episodes."""
        return self._starts[-1]

    @overload
    def __getitem__(self, index: SupportsIndex) -> JsonDict: ...

    @overload
    def __getitem__(self, index: slice) -> list[JsonDict]: ...

    def __getitem__(self, index: SupportsIndex | slice) -> JsonDict | list[JsonDict]:
        """The row of an episode, or of several.

        Raises:
            IndexError: there is no such episode.
            RecordError: the manifest of a shard cannot be read.
        """
        if isinstance(index, slice):
            return [self[k] for k in range(*index.indices(len(self)))]
        shard, k = self._place(index)
        return self.of_shard(shard)[k]

    def __iter__(self) -> Iterator[JsonDict]:
        """The rows, shard by shard."""
        for shard in self.shards:
            yield from self.of_shard(shard)

    def path_of(self, number: int) -> Path:
        """The path of an episode, for which the whole row is not read.

        Raises:
            IndexError: there is no such episode.
            RecordError: the manifest of the shard cannot be read.
        """
        shard, k = self._place(number)
        path: Path = self.folder / shard["name"]
        return path / self._names_of(shard)[k]

    def _names_of(self, shard: JsonDict) -> tuple[str, ...]:
        """The names of the members of a shard; those of the last few shards stay in memory."""
        name = shard["name"]
        if name not in self._names:
            while len(self._names) >= _KEPT:
                del self._names[next(iter(self._names))]
            try:
                names = member_names(self.folder / name)
            except OSError:
                names = ()
            if len(names) != shard["episodes"]:  # the rows, or the error that explains it
                names = tuple(row["name"] for row in self.manifest_of(shard)["files"])
            self._names[name] = names
        return self._names[name]

    def _place(self, index: SupportsIndex) -> tuple[JsonDict, int]:
        """The shard of an episode, and its number in it."""
        number = range(len(self))[index]
        k = bisect_right(self._starts, number) - 1
        return self.shards[k], number - self._starts[k]

    def manifest_of(self, shard: JsonDict) -> JsonDict:
        """The manifest beside a shard.

        Raises:
            RecordError: it cannot be read, or lists another number of episodes.
        """
        name = shard["name"]
        beside = shard_manifest_path(self.folder / name)
        if not ((self.folder / name).is_file() and beside.is_file()):
            missing = beside if (self.folder / name).is_file() else self.folder / name
            raise RecordError(f"{missing} is missing; if the data set was generated, run the command with --resume")
        manifest = self._read(self.folder / name)
        if len(manifest["files"]) != shard["episodes"]:
            raise RecordError(
                f"{self.folder / name}: its manifest lists {len(manifest['files'])} episodes, that of the data set "
                f"{shard['episodes']}; run `sonata2d check`"
            )
        return manifest

    def of_shard(self, shard: JsonDict) -> list[JsonDict]:
        """The rows of a shard.

        Raises:
            RecordError: as of `manifest_of`.
        """
        name = shard["name"]
        if name not in self._kept:
            while len(self._kept) >= _KEPT:
                del self._kept[next(iter(self._kept))]
            rows = self.manifest_of(shard)["files"]
            self._kept[name] = [row | {"name": f"{name}/{row['name']}"} for row in rows]
        return self._kept[name]

    def parts_of(self, name: str) -> dict[str, frozenset[str]]:
        """The names of the episodes of a shard by part of the data set; empty if it is not split.

        Args:
            name: of the shard.

        Raises:
            RecordError: as of `manifest_of`.
        """
        if self._parts[0] != name:
            shard = next(shard for shard in self.shards if shard["name"] == name)
            split = self.manifest_of(shard)["split"] or {}
            self._parts = name, {part: frozenset(f"{name}/{own}" for own in names) for part, names in split.items()}
        return self._parts[1]


class Selection(Sequence[T]):
    """Some items of a sequence, in a given order.

    Args:
        items: of which they are selected.
        indices: of the selected items.
    """

    def __init__(self, items: Sequence[T], indices: Iterable[int]) -> None:
        self._items, self._indices = items, array("q", indices)

    def __len__(self) -> int:
        """Number of selected items."""
        return len(self._indices)

    @overload
    def __getitem__(self, index: SupportsIndex) -> T: ...

    @overload
    def __getitem__(self, index: slice) -> Selection[T]: ...

    def __getitem__(self, index: SupportsIndex | slice) -> T | Selection[T]:
        """A selected item, or several."""
        if isinstance(index, slice):
            return Selection(self._items, self._indices[index])
        return self._items[self._indices[index]]


class ShardPaths(Sequence[Path]):
    """The paths of the episodes in shards, made when they are needed.

    Args:
        rows: of the files.
    """

    def __init__(self, rows: ShardRows) -> None:
        self._rows = rows

    def __len__(self) -> int:
        """Number of files."""
        return len(self._rows)

    @overload
    def __getitem__(self, index: SupportsIndex) -> Path: ...

    @overload
    def __getitem__(self, index: slice) -> list[Path]: ...

    def __getitem__(self, index: SupportsIndex | slice) -> Path | list[Path]:
        """The path of a file, or of several."""
        if isinstance(index, slice):
            return [self._rows.path_of(number) for number in range(*index.indices(len(self)))]
        return self._rows.path_of(index.__index__())

    def __iter__(self) -> Iterator[Path]:
        """The paths in the order of the manifest."""
        return map(self._rows.path_of, range(len(self)))


class ShardNames(Sequence[str]):
    """Names of episodes that the manifests of shards list, read when they are needed.

    Args:
        count: number of names.
        read: yields them, shard by shard.
    """

    def __init__(self, count: int, read: Callable[[], Iterator[str]]) -> None:
        self._count, self._read = count, read

    def __len__(self) -> int:
        """Number of names."""
        return self._count

    def __iter__(self) -> Iterator[str]:
        """The names, shard by shard."""
        return self._read()

    @overload
    def __getitem__(self, index: SupportsIndex) -> str: ...

    @overload
    def __getitem__(self, index: slice) -> list[str]: ...

    def __getitem__(self, index: SupportsIndex | slice) -> str | list[str]:
        """A name, or several; reads all manifests."""
        return list(self)[index]


def _names_of_part(rows: ShardRows, part: str) -> Iterator[str]:
    """The names of the episodes in a part of a split data set."""
    for shard in rows.shards:
        for name in (rows.manifest_of(shard)["split"] or {}).get(part, ()):
            yield f"{shard['name']}/{name}"


def _names_in(rows: ShardRows, shards: Sequence[JsonDict]) -> Iterator[str]:
    """The names of the episodes of some shards."""
    for shard in shards:
        yield from (row["name"] for row in rows.of_shard(shard))


def _names_of_source(rows: ShardRows, source: JsonDict) -> ShardNames:
    """The names of the episodes of a data set that was merged: those of its shards."""
    names = set(source["shards"])
    shards = [shard for shard in rows.shards if shard["name"] in names]
    return ShardNames(sum(shard["episodes"] for shard in shards), partial(_names_in, rows, shards))


def with_rows(manifest: JsonDict, folder: Path, read: ReadManifest) -> JsonDict:
    """A manifest of shards with the keys of one without: `files`, and names in `split` and `sources`.

    Args:
        manifest: as stored.
        folder: of the data set.
        read: reads the manifest of a shard.
    """
    rows = ShardRows(folder, manifest["shards"], read)
    split: Mapping[str, int] | None = manifest["split"]
    whole = manifest | {"files": rows}
    if split is not None:
        whole["split"] = {part: ShardNames(count, partial(_names_of_part, rows, part)) for part, count in split.items()}
    if manifest.get("sources"):
        whole["sources"] = [source | {"files": _names_of_source(rows, source)} for source in manifest["sources"]]
    return whole


def stored_form(manifest: JsonDict) -> JsonDict:
    """A manifest as it is stored: of shards, without what the manifests of the shards list."""
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
