"""Export and import of single files and of whole folders."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from ..datasets.check import Listed
from ..datasets.manifest import MANIFEST, METRICS, SCENARIO
from ..datasets.verification import files_of
from ..errors import RecordError
from ..record.files import SUFFIXES, packed, safe_text, stem_of, write_atomically
from ..record.reader import read_episode
from ..record.record import EpisodeRecord
from ..registry import FORMATS
from . import sonata
from .base import Format, Options
from .validate import proven

Advance = Callable[[int], None]
_PLAIN = Options()


@dataclass(frozen=True, slots=True)
class Done:
    """What came of an export or an import.

    Attributes:
        files: that were written.
        refused: a line for each episode or file that was not.
    """

    files: list[Path]
    refused: list[str]


def format_named(name: str) -> Format:
    """A format by its name.

    Raises:
        RecordError: there is none of this name.
    """
    format: Format = FORMATS.load(name, _problem)
    return format


def _problem(found: object) -> str | None:
    """Why an object cannot be used as a format."""
    return None if isinstance(found, Format) else "is no Format; it must be sonata2d.formats.Format(...)"


def episodes_in(source: Path) -> list[Path]:
    """The one episode file, or those of a folder.

    Raises:
        RecordError: there are none.
    """
    return [file.path if isinstance(file, Listed) else file for file in files_of(source) if not _is_manifest(file)]


def _is_manifest(file: Path | Listed) -> bool:
    """What lies beside episodes and is none."""
    return isinstance(file, Path) and file.name in (MANIFEST, SCENARIO, METRICS)


def export_to(
    source: Path, format: str, out: Path, options: Options = _PLAIN, *, advance: Advance = lambda step: None
) -> Done:
    """Write episodes in another format; an episode that would mislead its readers is refused, and the rest go on.

    Args:
        source: an episode file, or a folder of them.
        format: its name, see `FORMATS`.
        out: a folder; of one episode that becomes one file, the file's name if it ends as the format's files do.
        options: see `Options`.
        advance: is told how many episodes are done, as they are.

    Raises:
        RecordError: there is no such format, or nothing to export.
    """
    chosen, files = format_named(format), episodes_in(source)
    if options.original and format != sonata.NAME:
        raise RecordError(f"{format} has no quirks to keep; they are for {sonata.NAME}")
    done = Done([], [])
    if chosen.gather is not None:
        done.files.extend(chosen.gather(_read(files, done, advance), out))
        return done
    for record in _read(files, done, advance):
        try:
            path = _target(record, chosen, out, options, alone=source.is_file())
            _write(path, _exported(chosen, record, options), record.path, done)
        except RecordError as error:
            done.refused.append(str(error))
    return done


def _exported(chosen: Format, record: EpisodeRecord, options: Options) -> bytes:
    assert chosen.export is not None, "a format writes files one by one or together"
    return chosen.export(record, options)


def _read(files: list[Path], done: Done, advance: Advance) -> Iterator[EpisodeRecord]:
    """Episodes one after another, so that a data set need not fit into memory; those that cannot be read are told."""
    for file in files:
        try:
            yield read_episode(file)
        except RecordError as error:
            done.refused.append(str(error))
        advance(1)


def _target(record: EpisodeRecord, chosen: Format, out: Path, options: Options, *, alone: bool) -> Path:
    """Where an episode goes."""
    if alone and out.name.endswith(chosen.suffix) and not out.is_dir():
        return out
    return out / (sonata.original_name(record) if options.original else f"{stem_of(record.path)}{chosen.suffix}")


def _write(path: Path, data: bytes, source: Path, done: Done) -> None:
    """Write a file, but never over its own source or over another one of the same go."""
    if path in done.files:
        raise RecordError(f"{source}: {path} holds another episode already; take them one by one")
    if path.exists() and path.samefile(source):
        raise RecordError(f"{path} is what is read; choose another place to write to")
    write_atomically(path, data)
    done.files.append(path)


def import_from(
    source: Path, format: str, out: Path, options: Options = _PLAIN, *, advance: Advance = lambda step: None
) -> Done:
    """Make episode files of files in another format; a file that tells no episode is refused, and the rest go on.

    Args:
        source: a file, or a folder of them.
        format: its name, see `FORMATS`.
        out: a folder; of one file, the episode's name if it ends in .json, .json.gz or .json.zst.
        options: see `Options`.
        advance: is told how many files are done, as they are.

    Raises:
        RecordError: there is no such format, or nothing to import.
    """
    chosen, done = format_named(format), Done([], [])
    alone = source.is_file() and out.name.endswith(SUFFIXES) and not out.is_dir()
    for file in _sources(source, chosen):
        try:
            for document in chosen.import_(file, options):
                data = proven(document, file)
                name = document["id"] if chosen.gather is not None else file.name.split(".")[0]
                path = out if alone else out / f"{safe_text(name)}.json"
                _write(path, packed(data, path), file, done)
        except RecordError as error:
            done.refused.append(str(error))
        advance(1)
    return done


def _sources(source: Path, chosen: Format) -> list[Path]:
    """The files to import.

    Raises:
        RecordError: there are none.
    """
    if source.is_file() or (chosen.gather is not None and source.is_dir()):
        return [source]
    if not source.is_dir():
        raise RecordError(f"{source} does not exist")
    files = sorted(file for file in source.glob(f"*{chosen.suffix}") if not file.name.endswith(".obstacles.csv"))
    if not files:
        raise RecordError(f"{source} holds no {chosen.suffix} files")
    return files


def count_sources(source: Path, format: str) -> int:
    """How many files an import will read, for a progress bar."""
    return len(_sources(source, format_named(format)))
