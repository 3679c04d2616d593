"""Begins, continues and replaces generated data sets."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from ...core.files.locations import file_names, is_remote
from ...core.files.locking import acquired_lock
from ...core.files.whole_file import TEMPORARY_PREFIX
from ...core.wording import shown
from ...errors import RecordError
from ...record.files import SUFFIXES, file_suffix
from ...record.layout import JsonDict
from ...version import PHYSICS_VERSION
from ..card.write import has_edited_card
from ..manifest.models import is_episode_name
from ..manifest.read import (
    CARD,
    CROISSANT,
    FAILED,
    FIGURES,
    LOCK,
    LOG,
    MANIFEST,
    METRICS,
    PREVIEW,
    SCENARIO,
    DatasetSpec,
    identity_of,
    manifest_of,
    read_manifest,
    remove_partial_files,
    sharded_manifest_of,
    write_json,
)
from ..manifest.rows import PART, remove_shards, shard_number

_MAXIMUM_DIFFERENCES = 5  # named in a message


def start_dataset(folder: Path, spec: DatasetSpec, *, resume: bool = False, overwrite: bool = False) -> dict[str, str]:
    """Begin a data set in a new or empty folder or in place of another one, or continue an interrupted one.

    A data set without episodes, as of a run that failed at once, is always replaced.

    Args:
        folder: of the data set.
        spec: specification of the data set.
        resume: continue the data set that the folder holds.
        overwrite: replace the data set that the folder holds: its episodes and the other files that sonata2d writes.
            Other files stay.

    Returns:
        SHA-256 by file name of the files listed in the manifest of a continued data set.

    Raises:
        RecordError: the folder holds other files, or a data set that can be neither continued nor replaced.
    """
    listed: dict[str, str] = {}
    _require_no_file(folder)
    if (folder / MANIFEST).exists():
        stored = read_manifest(folder)
        _require_replaceable(folder, stored)
        if resume and not (differences := _differences(stored, spec)):
            _require_same_suffix(folder, spec, stored)
            listed = {} if spec.shard_size else {entry["name"]: entry["sha256"] for entry in stored["files"]}
        elif overwrite or not (stored["files"] or has_episodes(folder)):
            _remove_dataset(folder)
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
    remove_partial_files(folder)
    # The manifest is written first, because a later resumption recognises the data set by it.
    begun = manifest_of(spec, (), complete=False)
    write_json(folder / MANIFEST, sharded_manifest_of(folder, spec, (), complete=False) if spec.shard_size else begun)
    if spec.settings is not None:
        write_json(folder / SCENARIO, spec.settings)
    return listed


@contextmanager
def sole_writer(folder: Path) -> Iterator[None]:
    """Hold the lock of a folder, which is created: two programs that generate one data set would lose episodes.

    A folder in a store has no lock.

    Raises:
        RecordError: another program holds the lock, or the folder cannot be written.
    """
    _require_no_file(folder)
    if is_remote(folder):  # a store has no locks
        yield
        return
    lock = acquired_lock(
        folder / LOCK, f"another program is generating {folder}; wait for it, or choose another folder"
    )
    try:
        yield
    finally:
        lock.release()
        (folder / LOCK).unlink(missing_ok=True)


def _require_no_file(folder: Path) -> None:
    """Raise RecordError if the path of a data set is that of a file."""
    if folder.exists() and not folder.is_dir():
        raise RecordError(f"{folder} is a file; choose another name for the folder")


def remove_failed_episodes(folder: Path) -> None:
    """Remove the episodes in the subfolder `failed`, and the subfolder if nothing else is in it."""
    failed = folder / FAILED
    if failed.is_dir():
        remove_partial_files(failed)
        for path in episode_files(failed):
            path.unlink(missing_ok=True)
        with suppress(OSError):
            failed.rmdir()


def episode_files(folder: Path) -> list[Path]:
    """The files of a folder, if it exists, that are named as generated episodes are."""
    return [folder / name for name in file_names(folder) if is_episode_name(name)]


def has_episodes(folder: Path) -> bool:
    """Whether a folder holds generated episodes, in files or in shards, which may be unfinished."""
    names = file_names(folder)
    return any(is_episode_name(name) or name.startswith(PART) or shard_number(name) is not None for name in names)


def unlisted_episodes(folder: Path, manifest: JsonDict) -> str:
    """That the manifest of an interrupted run does not list all files or shards of its folder yet; empty if it does.

    A run that was killed leaves such a manifest.
    """
    if manifest["complete"]:
        return ""
    listed = {row["name"] for row in manifest["shards" if "shards" in manifest else "files"]}
    if "shards" in manifest:
        names, what = [name for name in file_names(folder) if shard_number(name) is not None], "shard"
    else:
        names, what = [path.name for path in episode_files(folder)], "episode file"
    count = sum(name not in listed for name in names)
    if not count:
        return ""
    files = f"1 {what} is" if count == 1 else f"{count} {what}s are"
    return f"{files} not listed until `generate` with --resume has completed the data set"


def _remove_dataset(folder: Path) -> None:
    """Remove the files that sonata2d writes, the manifest last: if that is interrupted, it can be repeated.

    They are recognised by their names: a manifest that was edited may list any file.
    """
    own = (FIGURES, CROISSANT, METRICS, PREVIEW, LOG, SCENARIO) + (() if has_edited_card(folder) else (CARD,))
    try:
        for path in (*(folder / name for name in own), *episode_files(folder)):
            path.unlink(missing_ok=True)
        remove_failed_episodes(folder)
        remove_shards(folder)
        (folder / MANIFEST).unlink()
    except OSError as error:
        raise RecordError(f"{folder} cannot be overwritten: {error.strerror or error}") from error


def _require_replaceable(folder: Path, stored: JsonDict) -> None:
    """Raise RecordError for data sets that `generate` did not make: it neither continues nor replaces them."""
    if stored["collected"]:
        raise RecordError(f"{folder} holds runs driven by people; choose another folder")
    if stored.get("sources"):
        raise RecordError(f"{folder} holds merged data sets; choose another folder")
    if stored.get("mirrored"):
        raise RecordError(f"{folder} holds mirror images; resume the original data set and mirror it again")


def _differences(stored: JsonDict, spec: DatasetSpec) -> str:
    """In which keys a data set differs from a specification, which may have more episodes; empty if in none."""
    requested = {"keep": None, "shard_size": spec.shard_size, **identity_of(spec), "physics": PHYSICS_VERSION}
    if stored["episodes"] < spec.episodes:
        del requested["episodes"]
    if (stored["controller"] or {}).get("path") != spec.controller_info.path:  # its settings are then others as well
        requested["controller"] = {**(stored["controller"] or {}), "path": spec.controller_info.path}
    found = [
        f"{key} {shown(old, 100)} stored, {shown(new, 100)} requested"
        for key, old, new in _changes({key: stored.get(key) for key in requested}, requested)
    ]
    # version 0.1 stored no hashes; the episodes of such a data set are taken as they are
    code = stored.get("controller_sha256") or {}
    for name, sha256 in spec.controller_sha256.items():
        if code.get(name, sha256) != sha256:
            found.append(f"the code of {name}, SHA-256 {code[name][:12]}… stored, {sha256[:12]}… now")
    rest = len(found) - _MAXIMUM_DIFFERENCES
    return "; ".join(found[:_MAXIMUM_DIFFERENCES] + ([f"and {rest} more differences"] if rest > 0 else []))


def _changes(stored: Any, requested: Any, place: str = "") -> Iterator[tuple[str, Any, Any]]:
    """The keys in which two documents differ, such as `settings.robot.radius`, with both values."""
    if isinstance(stored, dict) and isinstance(requested, dict):
        for key in {**stored, **requested}:
            yield from _changes(stored.get(key), requested.get(key), f"{place}.{key}" if place else key)
    elif stored != requested:
        yield place, stored, requested


def _require_same_suffix(folder: Path, spec: DatasetSpec, stored: JsonDict) -> None:
    """Raise RecordError if the data set holds episode files with another suffix."""
    if spec.shard_size and stored["files"] and file_suffix(folder / stored["files"][0]["name"]) != spec.suffix:
        raise RecordError(f"{folder} holds files like {stored['files'][0]['name']}; resume with the same --compress")
    for name in file_names(folder):
        is_episode = name.split(".")[0].isdigit() and name.endswith(SUFFIXES)
        if is_episode and file_suffix(folder / name) != spec.suffix:
            raise RecordError(f"{folder} holds files like {name}; resume with the same --compress")
