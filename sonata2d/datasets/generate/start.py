"""Begins, continues and replaces generated data sets."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from ...core.files.locations import delete, file_names, is_remote
from ...core.files.locking import acquired_lock
from ...core.files.whole_file import TEMPORARY_PREFIX
from ...core.wording import shown
from ...errors import RecordError
from ...record.claims import StoreClaim
from ...record.files import file_suffix
from ...record.layout import JsonDict
from ...record.shard_file import extents
from ...version import PHYSICS_VERSION
from ..card.write import has_edited_card
from ..manifest.names import (
    CARD,
    CROISSANT,
    FAILED,
    LOCK,
    LOG,
    MANIFEST,
    METRICS,
    PART,
    PREVIEW,
    SCENARIO,
    episode_number,
    parts_in,
    shard_number,
)
from ..manifest.rows import listing, read_manifest
from ..manifest.write import counts_of, write_json
from ..tables import remove_tables
from .specification import DatasetSpec, identity_of, manifest_of

_MAXIMUM_DIFFERENCES = 5  # number of keys named in a message
_NOT_GENERATED = {  # by key of a manifest
    "collected": "runs driven by people; choose another folder",
    "sources": "merged data sets; choose another folder",
    "mirrored": "mirror images; resume the original data set and mirror it again",
}


def start_dataset(
    folder: Path, spec: DatasetSpec, *, resume: bool = False, overwrite: bool = False, claim: StoreClaim | None = None
) -> dict[str, str]:
    """Begin a data set in a new or empty folder or in place of another one, or continue an interrupted one.

    A data set without episodes, as of a run that failed at once, is always replaced.

    Args:
        folder: of the data set.
        spec: specification of the data set.
        resume: continue the data set that the folder holds.
        overwrite: replace the data set that the folder holds: its episodes and the other files that sonata2d writes.
            Other files stay.
        claim: of the folder; it is taken before the folder is changed.

    Returns:
        SHA-256 by file name of the files listed in the manifest of a continued data set.

    Raises:
        RecordError: the folder holds other files, or a data set that can be neither continued nor replaced; or another
            program writes to it.
    """
    is_replaced = False
    listed: dict[str, str] = {}
    _require_no_file(folder)
    if (folder / MANIFEST).exists():
        stored = read_manifest(folder)
        _require_replaceable(folder, stored)
        if resume and not (differences := _differences(stored, spec)):
            _require_same_suffix(folder, spec)
            listed = {row["name"]: row["sha256"] for row in listing(stored)}
        elif overwrite or not (stored["files"] or has_episodes(folder)):
            is_replaced = True
        elif resume:
            remedy = "repeat the options with which it was begun, choose another folder, or replace it with --overwrite"
            raise RecordError(f"{folder} holds another data set: {differences}; {remedy}")
        else:
            raise RecordError(
                f"{folder} already holds a data set; continue it with --resume (resume=True), replace it with "
                "--overwrite (overwrite=True), or choose another folder"
            )
    elif folder.exists() and any(not path.name.startswith(TEMPORARY_PREFIX) for path in folder.iterdir()):
        raise RecordError(f"{folder} is not empty and has no {MANIFEST}; choose another folder")
    if claim is not None:
        claim.take()
    if is_replaced:
        _remove_dataset(folder)
    remove_partial_files(folder)
    # The manifest is written first, because a later resumption recognises the data set by it.
    write_json(folder / MANIFEST, manifest_of(spec, (), counts_of(()), {}, complete=False))
    if spec.settings is not None:
        write_json(folder / SCENARIO, spec.settings)
    return listed


@contextmanager
def sole_writer(folder: Path) -> Iterator[StoreClaim]:
    """Hold the lock of a folder, which is created: two programs that generate one data set would lose episodes.

    Yields the claim of a folder in a store, which has no lock; `start_dataset` takes it.

    Raises:
        RecordError: another program holds the lock, or the folder cannot be written.
    """
    _require_no_file(folder)
    claim = StoreClaim(folder / LOCK)
    if is_remote(folder):
        try:
            yield claim
        finally:
            claim.release()
        return
    lock = acquired_lock(
        folder / LOCK, f"another program is generating {folder}; wait for it, or choose another folder"
    )
    try:
        yield claim
    finally:
        lock.release()
        with suppress(OSError):  # the file alone locks nothing
            (folder / LOCK).unlink()


def _require_no_file(folder: Path) -> None:
    """Raise RecordError if the path of a data set is the path of a file."""
    if folder.exists() and not folder.is_dir():
        raise RecordError(f"{folder} is a file; choose another name for the folder")


def remove_partial_files(folder: Path) -> None:
    """Remove incomplete files that a killed run left."""
    for name in file_names(folder):
        if name.startswith(TEMPORARY_PREFIX) and name != LOCK:
            delete(folder / name)


def remove_failed_episodes(folder: Path) -> None:
    """Remove the episodes in the subfolder `failed`, and the subfolder if nothing else is in it."""
    failed = folder / FAILED
    if failed.is_dir():
        remove_partial_files(failed)
        for name in file_names(failed):
            if episode_number(name) is not None:
                delete(failed / name)
        with suppress(OSError):
            failed.rmdir()


def _is_generated(name: str) -> bool:
    """Whether a file is named as generated episodes and shards are."""
    return episode_number(name) is not None or shard_number(name) is not None


def has_episodes(folder: Path) -> bool:
    """Whether a folder holds generated episodes, in files or in shards, which may be unfinished."""
    return any(_is_generated(name) or name.startswith(PART) for name in file_names(folder))


def _remove_dataset(folder: Path) -> None:
    """Remove the files that sonata2d writes, the manifest last: if that is interrupted, it can be repeated.

    They are recognised by their names: a manifest that was edited may list any file.
    """
    written = (CROISSANT, METRICS, PREVIEW, LOG, SCENARIO) + (() if has_edited_card(folder) else (CARD,))
    generated = [name for name in file_names(folder) if _is_generated(name)]
    try:
        for path in (*(folder / name for name in (*written, *generated)), *parts_in(folder)):
            path.unlink(missing_ok=True)
        remove_failed_episodes(folder)
        remove_tables(folder)
        (folder / MANIFEST).unlink()
    except OSError as error:
        raise RecordError(f"{folder} cannot be overwritten: {error.strerror or error}") from error


def _require_replaceable(folder: Path, stored: JsonDict) -> None:
    """Raise RecordError for data sets that `generate` did not make: it neither continues nor replaces them."""
    for key, content in _NOT_GENERATED.items():
        if stored.get(key):
            raise RecordError(f"{folder} holds {content}")


def _differences(stored: JsonDict, spec: DatasetSpec) -> str:
    """The keys in which a data set differs from a specification, which may have more episodes; empty without any."""
    requested = {"keep": None, "shard_size": spec.shard_size, **identity_of(spec), "physics": PHYSICS_VERSION}
    if stored["episodes"] < spec.episodes:
        del requested["episodes"]
    if (stored["controller"] or {}).get("path") != spec.controller_info.path:  # its settings are then others as well
        requested["controller"] = {**(stored["controller"] or {}), "path": spec.controller_info.path}
    differences = [
        f"{key} {shown(old, 100)} stored, {shown(new, 100)} requested"
        for key, old, new in _changes({key: stored.get(key) for key in requested}, requested)
    ]
    stored_code = stored.get("controller_sha256") or {}
    for name, sha256 in spec.controller_sha256.items():
        old = stored_code.get(name, "none")
        if old != sha256:
            differences.append(f"the code of {name}, SHA-256 {old[:12]}… stored, {sha256[:12]}… now")
    rest = len(differences) - _MAXIMUM_DIFFERENCES
    return "; ".join(differences[:_MAXIMUM_DIFFERENCES] + ([f"and {rest} more differences"] if rest > 0 else []))


def _changes(stored: Any, requested: Any, place: str = "") -> Iterator[tuple[str, Any, Any]]:
    """The keys in which two documents differ, such as `settings.robot.radius`, with both values."""
    if isinstance(stored, dict) and isinstance(requested, dict):
        for key in {**stored, **requested}:
            yield from _changes(stored.get(key), requested.get(key), f"{place}.{key}" if place else key)
    elif stored != requested:
        yield place, stored, requested


def _require_same_suffix(folder: Path, spec: DatasetSpec) -> None:
    """Raise RecordError if the data set holds episodes with another suffix, in files or in shards."""
    for name in sorted(file_names(folder)):
        episodes: Sequence[str] = (name,) if episode_number(name) is not None else ()
        if spec.batch_in(name) is not None and spec.shard_size is not None:
            with suppress(OSError):
                episodes = tuple(extents(folder / name))[:1]
        if episodes and file_suffix(Path(episodes[0])) != spec.suffix:
            raise RecordError(f"{folder} holds files like {episodes[0]}; resume with the same --compress")
