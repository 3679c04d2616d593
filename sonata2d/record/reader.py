"""Reading episode files. Incomplete files and newer versions are refused with one line that names the file."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import groupby
from pathlib import Path

import orjson

from ..core.files.limits import MAX_FILE_BYTES
from ..core.files.locations import is_remote, location
from ..core.garbage import without_garbage_collection
from ..core.wording import shown
from ..errors import NewerFormatError, RecordError
from ..version import FORMAT, FORMAT_VERSION, LAST_RELEASE
from .files import read_bytes, unpacked
from .layout import JsonDict
from .record import EpisodeRecord, record_from_document
from .shard_file import is_member, is_shard, members_of, read_members
from .validate import require_valid


def read_episode(path: str | Path) -> EpisodeRecord:
    """Read an episode file, compressed or not.

    Args:
        path: of the file.

    Returns:
        The episode: arrays of all states, commands, labels, and each frame as the snapshot that the controller saw.

    Raises:
        NewerFormatError: a newer version of sonata2d wrote the file.
        InvalidFileError: the content is not a valid episode; `findings` lists the faults.
        RecordError: the file cannot be read, or is not a complete episode.
    """
    return episode_in(location(path), None)


def read_episodes(files: Sequence[Path]) -> Iterator[EpisodeRecord]:
    """Read episode files one after another; members of one shard that follow each other are read at once from a store.

    Args:
        files: of the episodes.

    Raises:
        RecordError: as of `read_episode`.
    """
    for shard, group in groupby(files, key=lambda file: file.parent):
        members = list(group)
        if is_remote(shard) and is_member(members[0]):  # one request for all of them
            contents = read_members(shard, [file.name for file in members], MAX_FILE_BYTES)
            yield from map(episode_in, members, contents)
        else:
            yield from map(read_episode, members)


def episode_in(path: Path, stored: bytes | None) -> EpisodeRecord:
    """The episode of a file.

    Args:
        path: of the file.
        stored: its bytes; None: they are read.

    Raises:
        RecordError: as of `read_episode`.
    """
    if is_shard(path):
        first = next(iter(members_of(path)), "000000.json")
        raise RecordError(f"{path} is a shard; name an episode in it, such as {path / first}, or its data set")
    with without_garbage_collection():
        document = _document_of(read_bytes(path) if stored is None else unpacked(stored, path), path)
        return record_from_document(document, path, require_valid(document, path))


def _document_of(content: bytes, path: Path) -> JsonDict:
    """Parse the content of a file of this format.

    Raises:
        NewerFormatError: a newer version of sonata2d wrote the file.
        RecordError: it is not a file of this format, or a release wrote it whose files are not read any more.
    """
    try:
        document: JsonDict = orjson.loads(content)
    except orjson.JSONDecodeError as error:
        raise RecordError(f"{path} is not valid JSON, it is truncated or damaged: {error}") from error
    if not isinstance(document, dict) or document.get("format") != FORMAT:
        kind = shown(document.get("format")) if isinstance(document, dict) else f"a JSON {type(document).__name__}"
        raise RecordError(f"{path} is not a {FORMAT} file: its format is {kind}")
    version = document.get("version")
    if not isinstance(version, int) or isinstance(version, bool):
        raise RecordError(f"{path} has no valid format version: got {shown(version)}")
    if version > FORMAT_VERSION:
        raise NewerFormatError(
            f"{path} was written by format version {version}, this sonata2d reads up to {FORMAT_VERSION};"
            " upgrade sonata2d"
        )
    physics = document.get("physics")
    if isinstance(physics, int) and physics in LAST_RELEASE:
        raise RecordError(
            f"{path} has physics version {physics}; sonata2d {LAST_RELEASE[physics]} is the last release that reads it"
        )
    return document
