"""Export and import of single files and of whole folders."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, fields
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from ..core.files.locations import file_names, is_remote, location, make_folder
from ..core.wording import counted
from ..datasets.dataset import Dataset
from ..datasets.manifest import MANIFEST, METRICS, SCENARIO, files_of
from ..errors import RecordError, UnsuitableEpisode
from ..record.files import SUFFIXES, compress, episode_key, file_exists, safe_text, write_atomically
from ..record.layout import JsonDict
from ..record.reader import read_episode
from ..record.shard_file import is_shard
from ..registry import FORMATS
from ..workers.executors import Workers, parallel_map, shared_workers
from ..workers.processes import end_if_unguarded
from ..workers.tasks import stop_if_over, stop_if_unwanted
from . import sonata
from .format import Format, Options, Tables
from .importing import encode_episode
from .robots import of_one_robot

Advance = Callable[[int], None]
T = TypeVar("T")
_DEFAULT_OPTIONS = Options()


@dataclass(frozen=True, slots=True)
class Omission:
    """A file that was not transferred; `str` gives the reason.

    Attributes:
        file: the source.
        reason: one line that names the file.
        cause: equal for all files that were not transferred for this reason.
    """

    file: Path
    reason: str
    cause: str

    def __str__(self) -> str:
        return self.reason


@dataclass(frozen=True, slots=True)
class TransferResult:
    """Outcome of an export or an import.

    Attributes:
        files: the files that were written.
        refused: files that could not be read, converted or written.
        skipped: valid episodes that the format cannot hold, or that its readers would misinterpret.
        notes: remarks on the files that were written.
        tracks: facts about the recorded tracks of each file that was written, see `TrackSummary`.
    """

    files: list[Path]
    refused: list[Omission] = field(default_factory=list)
    skipped: list[Omission] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    tracks: dict[Path, JsonDict] = field(default_factory=dict, compare=False)

    def add_omission(self, file: Path, error: RecordError) -> None:
        """Record why a file was not transferred."""
        if isinstance(error, UnsuitableEpisode):
            self.skipped.append(Omission(file, str(error), error.cause))
        else:
            self.refused.append(Omission(file, str(error), str(error).replace(str(file), "")))


def summarised(omissions: Iterable[Omission]) -> list[str]:
    """One line per cause: the reason of the first file, and the number of other files with the same cause."""
    groups: dict[str, list[Omission]] = {}
    for omission in omissions:
        groups.setdefault(omission.cause, []).append(omission)
    return [
        str(first) + (f" (and {len(others)} more for this reason)" if others else "")
        for first, *others in groups.values()
    ]


def format_named(name: str) -> Format:
    """Return the format of a name, e.g. `socnav3`.

    Raises:
        RecordError: no format has this name.
    """
    format: Format = FORMATS.load(name, _problem)
    return format


def _problem(plugin: object) -> str | None:
    """The reason why an object cannot be used as a format, or None."""
    return None if isinstance(plugin, Format) else "is not a Format; define it as sonata2d.formats.Format(...)"


def unsupported_options(format: str, options: Options) -> list[str]:
    """Names of the options that are set, but that a format does not use.

    Raises:
        RecordError: no format has this name.
    """
    supported = format_named(format).options
    names = (field.name for field in fields(Options) if field.name not in supported)
    return [name for name in names if getattr(options, name) != getattr(_DEFAULT_OPTIONS, name)]


def _require_supported(format: str, options: Options) -> None:
    if names := unsupported_options(format, options):
        raise RecordError(f"the format {format} does not use the option {names[0]}; leave it out")


def episodes_in(source: Path) -> Sequence[Path]:
    """List the episode files of a source.

    Args:
        source: an episode file, a shard, or a folder.

    Raises:
        RecordError: the source does not exist or holds no episodes.
    """
    files = files_of(source)
    if isinstance(files, list):  # of a folder that may have no manifest
        files = [file for file in files if file.name not in (MANIFEST, SCENARIO, METRICS)]
    if not files:
        raise RecordError(f"{source} holds no episodes")
    return files


def export_to(
    source: str | Path | Dataset,
    format: str,
    out: str | Path,
    options: Options = _DEFAULT_OPTIONS,
    *,
    shard_size: int | None = None,
    workers: int | Executor | Workers = 1,
    advance: Advance = lambda step: None,
) -> TransferResult:
    """Write episodes in another format.

    Episodes that the format cannot hold, or that its readers would misinterpret, are skipped, and damaged files are
    refused; the others are still written.

    Args:
        source: an episode file, a folder of them, or a data set, such as `Dataset.filter` returns.
        format: name of the format, see `registry.FORMATS`.
        out: a folder; for a single episode file that becomes a single file, a path that ends with the suffix of the
            format is the name of the file.
        options: see `Options`.
        shard_size: of a format of tables, number of episodes in each file; None: one file for each table.
        workers: number of processes; or an executor, or workers that several calls share, see `sonata2d.Workers`.
        advance: called with the number of finished episodes.

    Returns:
        The files that were written, and why others were not.

    Raises:
        RecordError: no format has this name, it does not export or use an option of `options`, the source holds no
            episodes, or tables would be written into the folder of a data set.
        WorkerError: a worker crashed, was killed, or has other software.
    """
    end_if_unguarded()
    out = location(out)
    if isinstance(source, Dataset):
        files, is_single = source.files, False
        if not files:
            raise RecordError(f"{source!r} holds no episodes")
    else:
        place = location(source)
        files, is_single = episodes_in(place), file_exists(place) and not is_shard(place)
    chosen = format_named(format)
    _require_supported(format, options)
    if shard_size is not None and (chosen.tables is None or not chosen.tables.is_divisible):
        raise RecordError(f"the format {format} has no shards; leave out the size of shards")
    if chosen.tables is None and chosen.export is None:
        raise RecordError(f"{format} files can only be imported")
    if chosen.tables is not None and (out / MANIFEST).exists():
        # the tables come with a README.md, which would replace the data card
        raise RecordError(f"{out} holds a data set; choose another folder")
    with shared_workers(workers) as pool:
        transfer = _Transfer(format, chosen, files, out, options, pool, advance)
        if shard_size is not None:
            return transfer.parts(shard_size)
        return transfer.tables() if chosen.tables is not None else transfer.files_of_each(is_single)


@dataclass(frozen=True, slots=True)
class _Transfer:
    """An export.

    Attributes:
        name, format: of the files.
        files: the episodes.
        out: the folder, or the file.
        options: of the format.
        workers: which read and convert the episodes.
        advance: progress callback.
    """

    name: str
    format: Format
    files: Sequence[Path]
    out: Path
    options: Options
    workers: Workers
    advance: Advance

    def files_of_each(self, is_single: bool) -> TransferResult:
        """Write a file for each episode."""
        result, notes, written = TransferResult([]), Counter[str](), set[Path]()
        convert = partial(_converted, self.name, self.options, episode_key(self.files))
        for source, (name, data, note, omission) in zip(self.files, self._mapped(convert), strict=True):
            try:
                if omission is not None:
                    raise omission
                is_file = is_single and self.out.name.endswith(self.format.suffix) and not self.out.is_dir()
                path = self.out if is_file else self.out / name
                _write(path, data, source, written)
                result.files.append(path)
                if note:
                    notes[note] += 1
            except RecordError as error:
                result.add_omission(source, error)
            self.advance(1)
        result.notes.extend(f"{note} ({count} of {len(self.files)} episodes)" for note, count in notes.items())
        if not is_single and self.out.is_dir():
            names = {path.name for path in result.files}
            if others := sum(n.endswith(self.format.suffix) and n not in names for n in file_names(self.out)):
                result.notes.append(
                    f"{self.out} holds {counted(others, 'file')} more of this kind, as of an earlier export"
                )
        return result

    def tables(self) -> TransferResult:
        """Write tables of all episodes."""
        result = TransferResult([])
        tables = _tables(self.name)

        def packed() -> Iterator[Any]:
            pack = partial(_packed, self.name, self.options, episode_key(self.files))
            for source, (item, omission) in zip(self.files, self._mapped(pack), strict=True):
                if omission is None:
                    yield item
                else:
                    result.add_omission(source, omission)
                self.advance(1)

        result.files.extend(tables.write(packed(), self.out, None))
        result.files.extend(tables.finish(self.out, 0))
        return result

    def parts(self, size: int) -> TransferResult:
        """Write tables of some episodes each: every part by one worker."""
        result, numbers = TransferResult([]), range(-(-len(self.files) // size))
        make_folder(self.out)
        place = self.workers.place(self.out)
        parts = (
            (number, [self.workers.place(file) for file in self.files[number * size : (number + 1) * size]])
            for number in numbers
        )
        write = partial(_part, self.name, self.options, place, episode_key(self.files))
        done = parallel_map(write, parts, total=len(numbers), workers=self.workers, reads=self._reads, writes=place)
        for files, omissions, count in done:
            result.files.extend(files)
            for source, error in omissions:
                result.add_omission(source, error)
            self.advance(count)
        result.files.extend(_tables(self.name).finish(self.out, len(numbers)))
        return result

    def _mapped(self, function: Callable[[Path], T]) -> Iterator[T]:
        """Apply a function to all files in the workers."""
        files = map(self.workers.place, self.files)
        return parallel_map(function, files, total=len(self.files), workers=self.workers, reads=self._reads)

    @property
    def _reads(self) -> Path:
        return self.workers.place(self.files[0]).parent


def _converted(
    name: str, options: Options, key: Callable[[Path], str], file: Path
) -> tuple[str, bytes, str | None, RecordError | None]:
    """Name and content of the exported file of an episode, a note about it, and the error if there is no file."""
    chosen = format_named(name)
    assert chosen.export is not None
    try:
        record = read_episode(file)
        if not chosen.holds_robots:
            record = of_one_robot(record, options, ends_on_arrival="robot" in chosen.options)
        data = chosen.export(record, options)
        note = chosen.note(record, options) if chosen.note else None
    except RecordError as error:
        return "", b"", None, error
    exported = sonata.original_name(record) if options.original else f"{key(file).replace('/', '__')}{chosen.suffix}"
    return exported, data, note, None


def _packed(name: str, options: Options, key: Callable[[Path], str], file: Path) -> tuple[Any, RecordError | None]:
    """The rows of an episode in the form that the format needs, or the error if it cannot be read."""
    try:
        record = read_episode(file)
        if not format_named(name).holds_robots:
            record = of_one_robot(record, options, ends_on_arrival="robot" in format_named(name).options)
        return _tables(name).pack(record, key(file), options), None
    except RecordError as error:
        return None, error


def _part(
    name: str, options: Options, out: Path, key: Callable[[Path], str], part: tuple[int, Sequence[Path]]
) -> tuple[list[Path], list[tuple[Path, RecordError]], int]:
    """Write a part of the tables; returns its files, the episodes that cannot be read, and the number of all."""
    number, files = part
    omissions: list[tuple[Path, RecordError]] = []

    def packed() -> Iterator[Any]:
        for file in files:
            stop_if_over()
            item, omission = _packed(name, options, key, file)
            if omission is None:
                yield item
            else:
                omissions.append((file, omission))
        stop_if_unwanted()

    return _tables(name).write(packed(), out, number), omissions, len(files)


def _tables(name: str) -> Tables:
    """The tables of a format that has some."""
    tables = format_named(name).tables
    assert tables is not None
    return tables


def _write(path: Path, data: bytes, source: Path, written: set[Path]) -> None:
    """Write a file, unless it would overwrite its own source, a file of a data set or another one of the transfer."""
    if path in written:
        raise RecordError(f"{source}: {path} already holds another episode; transfer them one by one")
    if path == source or (not is_remote(path) and source.is_file() and path.exists() and path.samefile(source)):
        raise RecordError(f"{path} is the source; choose another output")
    if path.exists() and (path.parent / MANIFEST).exists():
        raise RecordError(f"{path} belongs to the data set {path.parent}; choose another output")
    write_atomically(path, data)
    written.add(path)


def _free(path: Path, written: set[Path]) -> Path:
    """The path, or one with a number if it is written."""
    number, free = 1, path
    while free in written:
        number += 1
        free = path.with_name(f"{path.name.removesuffix('.json')}-{number}.json")
    return free


def import_from(
    source: str | Path,
    format: str,
    out: str | Path,
    options: Options = _DEFAULT_OPTIONS,
    *,
    advance: Advance = lambda step: None,
) -> TransferResult:
    """Convert files of another format to episode files.

    Files that do not describe an episode are refused; the others are still converted.

    Args:
        source: a file, or a folder of them.
        format: name of the format, see `registry.FORMATS`.
        out: a folder; for a single file, a path that ends in .json, .json.gz or .json.zst is the name of the episode.
        options: see `Options`.
        advance: called with 1 after each file.

    Returns:
        The episode files that were written, and why others were refused.

    Raises:
        RecordError: no format has this name, it does not import or use an option of `options`, the source holds no
            files of it, or the output is in the folder of a data set.
    """
    chosen, result, written = format_named(format), TransferResult([]), set[Path]()
    read = chosen.import_
    if read is None:
        raise RecordError(f"{format} files can only be exported")
    _require_supported(format, options)
    source, out = location(source), location(out)
    is_single = source.is_file() and out.name.endswith(SUFFIXES) and not out.is_dir()
    folder = out.parent if is_single else out
    if (folder / MANIFEST).exists():  # its manifest would not list the episodes
        raise RecordError(f"{folder} holds a data set; choose another folder")
    files = _sources(source, chosen)
    if files != [source]:
        suffixes = (chosen.suffix, *chosen.other_suffixes)
        others = [file.name for file in source.iterdir() if file.is_file() and not file.name.endswith(suffixes)]
        if others:
            result.notes.append(
                f"{len(others)} files of {source} do not end in {' or '.join(suffixes)} and are not read"
            )
    for file in files:
        try:
            for document in read(file, options):
                data = encode_episode(document, file)
                # A folder of tables holds many episodes: each is named by its id. Else the file gives the name.
                name = document["id"] if chosen.tables is not None else file.name.split(".")[0]
                path = out if is_single else out / f"{safe_text(name)}.json"
                if chosen.tables is not None:  # tables of merged data sets
                    path = _free(path, written)
                _write(path, compress(data, path), file, written)
                result.files.append(path)
                if summary := document.get("imported", {}).get("tracks"):
                    result.tracks[path] = summary
        except RecordError as error:
            result.add_omission(file, error)
        advance(1)
    return result


def _sources(source: Path, chosen: Format) -> list[Path]:
    """The files to import; of a format of tables, the folder.

    Raises:
        RecordError: the source does not exist, or holds no files of the format.
    """
    if source.is_file() or (chosen.tables is not None and source.is_dir()):
        return [source]
    if not source.is_dir():
        raise RecordError(f"{source} does not exist")
    suffixes = (chosen.suffix, *chosen.other_suffixes)
    files = sorted(file for suffix in suffixes for file in source.glob(f"*{suffix}") if not _is_beside(file.name))
    if not files:
        raise RecordError(f"{source} holds no {' or '.join(suffixes)} files")
    return files


def _is_beside(name: str) -> bool:
    """Whether a file lies beside others and is none to import: walls, a homography, or a text for people."""
    return name.endswith(".obstacles.csv") or name == "H.txt" or name.lower().startswith(("readme", "licen"))


def count_sources(source: Path, format: str) -> int:
    """Number of files that `import_from` will read, for a progress bar.

    Raises:
        RecordError: no format has this name, or the source holds no files of it.
    """
    return len(_sources(source, format_named(format)))
