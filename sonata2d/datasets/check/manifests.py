"""Checks episode files and data sets: schema, hashes, consistency of the manifest, and plausibility of the numbers."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, SupportsIndex, overload

import orjson

from ...core.files.locations import file_names, location
from ...errors import InvalidFileError, RecordError
from ...record.files import file_exists, file_stem, read_bytes, sha256_of
from ...record.layout import JsonDict
from ...record.reader import read_episode
from ...record.record import EpisodeRecord
from ...record.shard_file import SHARD_SUFFIX, is_shard, members_of, shard_manifest_path
from ..card.croissant import croissant_findings
from ..card.write import count_differences
from ..generate.start import unlisted_episodes
from ..manifest.models import Manifest, ManifestFile, Shard, ShardedManifest, Source, is_episode_name
from ..manifest.read import (
    CARD,
    CROISSANT,
    LOG,
    MANIFEST,
    METRICS,
    SCENARIO,
    manifest_entry,
    read_manifest,
)
from ..manifest.rows import PART, ShardRows, stored_form
from .plausibility import Finding, implausible_values

if TYPE_CHECKING:
    from pydantic import BaseModel

# keys that the manifest of a shard repeats
_SHARED_BY_SHARDS = ("name", "settings", "seed", "keep", "controller", "precision", "physics", "mirrored", "collected")
_MAXIMUM_FINDINGS = 20  # of the reader, reported per file


@dataclass(frozen=True, slots=True)
class Problem:
    """A problem in a file of a data set.

    Attributes:
        file: file name.
        place: key in the file, such as `frames.3.robot`, or the name of a check.
        message: what is wrong.
        is_warning: whether the data can be read and reproduced nevertheless.
    """

    file: str
    place: str
    message: str
    is_warning: bool = False

    def __str__(self) -> str:
        return f"{self.file}: {self.place}: {'warning: ' if self.is_warning else ''}{self.message}"


@dataclass(frozen=True, slots=True)
class ListedFile:
    """An episode file of a data set, with what the manifest states about it.

    Attributes:
        path: location of the file.
        entry: row of the file in the manifest.
        shared: document keys that all files of its source have in common, with their values.
    """

    path: Path
    entry: JsonDict
    shared: JsonDict


def check_episode(path: str | Path) -> list[Problem]:
    """Problems of an episode file; an empty list if there are none.

    Checks the schema, then the plausibility of the numbers (`plausibility.implausible_values`).
    """
    record, problems = open_to_check(location(path))
    return problems if record is None else check_record(record)


def check_dataset(folder: str | Path) -> list[Problem]:
    """Problems of a data set: each listed episode, then the manifest."""
    folder = location(folder)
    problems = check_manifest(folder)
    if any(problem.place == "file" for problem in problems):
        return problems
    manifest = read_manifest(folder)
    problems = [problem for shard in listed_shards(folder, manifest) for problem in check_shard(shard)] + problems
    return [problem for file in files_in(folder, manifest) for problem in check_listed(file)] + problems


def listed_shards(folder: Path, manifest: JsonDict) -> list[ListedFile]:
    """The shards that the manifest of a folder lists; none of a data set without shards."""
    shared = {key: manifest[key] for key in _SHARED_BY_SHARDS if key in manifest}
    shared = {} if manifest.get("sources") else shared
    return [ListedFile(folder / shard["name"], shard, shared) for shard in manifest.get("shards", ())]


def check_shard(shard: ListedFile) -> list[Problem]:
    """Problems of a shard as a file, and of the manifest beside it; not those of its episodes."""
    path, row = shard.path, shard.entry
    beside = shard_manifest_path(path).name
    if not path.is_file():
        return [Problem(MANIFEST, "shards", f"{path.name} is listed but not in the folder")]
    try:
        manifest = read_manifest(path)
    except RecordError as error:
        return [Problem(beside, "file", str(error))]
    content = manifest.get("shard") or {}
    found = {
        "sha256": sha256_of(path),
        "bytes": path.stat().st_size,
        "episodes": len(manifest["files"]),
        "ticks": sum(file["ticks"] for file in manifest["files"]),
    }
    problems = [
        Problem(path.name, key, f"is {value}, {MANIFEST} says {row[key]}")
        for key, value in found.items()
        if row[key] != value
    ]
    problems += [
        Problem(beside, f"shard.{key}", f"is {content.get(key)}, but that of {path.name} is {found[key]}")
        for key in ("sha256", "bytes")
        if content.get(key) != found[key]
    ]
    problems += [
        Problem(beside, key, f"differs from {MANIFEST}")
        for key, value in shard.shared.items()
        if manifest.get(key) != value
    ]
    problems += [*_repetitions(shard_manifest_path(path))]
    problems += [Problem(beside, *finding) for finding in _manifest_findings(path, manifest)]
    return problems + [Problem(beside, *finding, is_warning=True) for finding in _unknown_keys(manifest)]


def check_manifest(folder: Path) -> list[Problem]:
    """Problems of a manifest, of the set of files in the folder, and of the files that repeat its content."""
    try:
        manifest = read_manifest(folder)
    except RecordError as error:
        return [Problem(MANIFEST, "file", str(error))]
    if is_shard(folder):
        row = {"name": folder.name, "episodes": len(manifest["files"]), **(manifest.get("shard") or {})}
        row["ticks"] = sum(file["ticks"] for file in manifest["files"])
        return check_shard(ListedFile(folder, row, {}))
    findings = _shard_findings if "shards" in manifest else _manifest_findings
    return [
        *_repetitions(folder / MANIFEST),
        *(Problem(MANIFEST, *finding) for finding in findings(folder, manifest)),
        *(Problem(MANIFEST, *finding, is_warning=True) for finding in _unknown_keys(manifest)),
        *_scenario_problems(folder, manifest),
        *_card_problems(folder, manifest),
        *(Problem(CROISSANT, *finding) for finding in croissant_findings(folder)),
    ]


def listed_files(folder: Path) -> Sequence[ListedFile]:
    """The files that a manifest lists; those in shards are read from the manifests of the shards when they are needed.

    Raises:
        RecordError: the folder has no valid manifest.
    """
    return files_in(folder, read_manifest(folder))


def files_in(folder: Path, manifest: JsonDict) -> Sequence[ListedFile]:
    """The files that the manifest of a folder lists, see `listed_files`."""
    return _ListedFiles(folder, manifest)


class _ListedFiles(Sequence[ListedFile]):
    """The files that a manifest lists, each made when it is needed."""

    def __init__(self, folder: Path, manifest: JsonDict) -> None:
        self._folder, self._rows = folder, manifest["files"]
        versions = {key: manifest[key] for key in ("precision", "physics")}
        self._is_merged = bool(manifest.get("sources"))
        sources = [(source, _shared_values(source, versions)) for source in _sources(manifest)]
        self._only = None if self._is_merged else sources[0]
        # of a merged data set, by the file, or by the shard
        self._by_name = {
            name: pair for pair in sources if self._is_merged for name in pair[0].get("shards") or pair[0]["files"]
        }

    def __len__(self) -> int:
        return len(self._rows)

    @overload
    def __getitem__(self, index: SupportsIndex) -> ListedFile: ...

    @overload
    def __getitem__(self, index: slice) -> list[ListedFile]: ...

    def __getitem__(self, index: SupportsIndex | slice) -> ListedFile | list[ListedFile]:
        if isinstance(index, slice):
            return [self._listed(row) for row in self._rows[index]]
        return self._listed(self._rows[index])

    def __iter__(self) -> Iterator[ListedFile]:
        if not isinstance(self._rows, ShardRows):
            yield from map(self._listed, self._rows)
            return
        for shard in self._rows.shards:
            with suppress(RecordError):  # of its manifest, which is checked as well
                yield from map(self._listed, self._rows.of_shard(shard))

    def _listed(self, row: JsonDict) -> ListedFile:
        name = row["name"]
        found = self._only or self._by_name.get(name) or self._by_name.get(name.partition("/")[0])
        if found is None:
            return ListedFile(self._folder / name, row, {})
        source, shared = found
        return ListedFile(self._folder / name, row, shared | _expected_id(source, name, is_merged=self._is_merged))


def _sources(manifest: JsonDict) -> list[JsonDict]:
    """The merged data sets, or the data set itself as its only source."""
    return manifest.get("sources") or [manifest | {"scenario": manifest["name"]}]


def _shared_values(source: JsonDict, versions: JsonDict) -> JsonDict:
    """Document values that all files of a source share; collected runs may differ in each of them."""
    if source["scenario"] is None:
        return {}
    return versions | {"name": source["scenario"], **{key: source[key] for key in ("settings", "seed", "controller")}}


def _expected_id(source: JsonDict, name: str, *, is_merged: bool) -> JsonDict:
    """The id of a generated episode, which is the name of its file; collected runs have ids of their own."""
    if source["scenario"] is None:
        return {}
    stem = file_stem(Path(name))  # of a file in a shard, without that of the shard
    return {"id": stem.rpartition("__")[2] if is_merged else stem}


def check_listed(file: ListedFile) -> list[Problem]:
    """Problems of a listed file: differences from the manifest, then those of `check_episode`."""
    record, problems = open_to_check(file)
    return problems if record is None else check_record(record, file)


def open_to_check(file: Path | ListedFile) -> tuple[EpisodeRecord | None, list[Problem]]:
    """The content of a file; or None, and why it cannot be checked."""
    path = file.path if isinstance(file, ListedFile) else file
    if isinstance(file, ListedFile) and not file_exists(path):
        return None, [Problem(MANIFEST, "files", f"{file.entry['name']} is listed but not in the folder")]
    try:
        return read_episode(path), []
    except InvalidFileError as error:
        return None, _invalid_content(path, error, file.entry if isinstance(file, ListedFile) else None)
    except RecordError as error:
        return None, [Problem(path.name, "file", str(error))]


def _repetitions(path: Path) -> list[Problem]:
    """A key that a JSON object has twice: parsers use one of the values, and do not say which."""
    repeated: list[str] = []

    def note(pairs: list[tuple[str, object]]) -> dict[str, object]:
        content = dict(pairs)
        if len(content) < len(pairs):
            repeated.extend(_repeated(key for key, _ in pairs))
        return content

    json.loads(read_bytes(path), object_pairs_hook=note)
    return [Problem(path.name, repeated[0], "is given twice; one of the values is ignored")] if repeated else []


def _invalid_content(path: Path, error: InvalidFileError, entry: JsonDict | None) -> list[Problem]:
    """All that the reader found in a file; and whether it differs from its row in the manifest."""
    problems = [Problem(path.name, *finding) for finding in error.findings[:_MAXIMUM_FINDINGS]]
    if (rest := len(error.findings) - _MAXIMUM_FINDINGS) > 0:
        problems.append(Problem(path.name, "schema", f"{rest} more problems"))
    if entry is not None and sha256_of(path) != entry["sha256"]:
        problems.insert(0, Problem(path.name, "sha256", "differs from the manifest"))
    return problems


def check_record(record: EpisodeRecord, file: ListedFile | None = None) -> list[Problem]:
    """Problems of an episode; if its file is listed in a manifest, also differences from the manifest."""
    implausible = [Problem(record.path.name, *finding) for finding in implausible_values(record)]
    return (_differences(record, file) if file else []) + _repetitions(record.path) + implausible


def _differences(record: EpisodeRecord, file: ListedFile) -> list[Problem]:
    """Differences between a file and what the manifest states about it."""
    name, entry = file.entry["name"], file.entry
    actual = manifest_entry(record).row() | {"name": name}  # that of its shard included
    problems = [
        Problem(name, key, f"is {actual[key]}, the manifest says {entry[key]}")
        for key in actual
        if key in entry and actual[key] != entry[key]  # manifests of version 0.1 do not count contacts
    ]
    for key, value in file.shared.items():
        if record.document[key] == value:
            continue
        differs = "differs from the manifest"
        problems.append(
            Problem(name, key, f"is {record.id!r}, but the file's name says {value!r}" if key == "id" else differs)
        )
    return problems


def _manifest_findings(folder: Path, manifest: JsonDict) -> Iterator[Finding]:
    """Contradictions within a manifest, and between the manifest and the files of its folder."""
    files = manifest["files"]
    names, episodes = [file["name"] for file in files], [file["episode"] for file in files]
    if shard := manifest.get("shard"):
        yield from _range_findings(manifest, shard, episodes)
    elif not manifest["complete"]:
        yield "complete", f"{len(files)} of {manifest['episodes']} episodes exist; generate the others with --resume"
    elif manifest.get("keep"):
        yield from _selection_findings(manifest, episodes)
    elif not (manifest["collected"] or manifest.get("sources")) and not _counts_to(manifest["episodes"], episodes):
        yield "files", f"must list the episodes 0 to {manifest['episodes'] - 1} in order"
    for key, stated in manifest["counts"].items():
        if stated != (counted := dict(Counter(file[key] for file in files if file.get(key) is not None))):
            yield f"counts.{key}", f"is {stated}, but the listed files give {counted}"
    for name in _repeated(names):
        yield "files", f"lists {name} more than once"
    if manifest.get("sources") and sorted(names) != sorted(name for s in _sources(manifest) for name in s["files"]):
        yield "sources", "must list each file once"
    parts = [name for part in (manifest["split"] or {}).values() for name in part]
    for name in [*_repeated(parts), *sorted(set(parts) - set(names))]:
        yield "split", f"{name} is in two parts, or is not a listed file"
    if manifest["split"] is not None and (omitted := sorted(set(names) - set(parts))):
        yield "split", f"{omitted[0]} is in no part ({len(omitted)} files in all); split the data set again"
    if shard is not None:
        for name in sorted(set(members_of(folder)) - set(names)):
            yield "files", f"{name} is in the shard but not listed"
        return
    yield from _unknown_files(folder, manifest, {*names})


def _unknown_files(folder: Path, manifest: JsonDict, names: set[str]) -> Iterator[Finding]:
    """Files of a folder that look like episodes, or remained of a run.

    Args:
        folder: of the data set.
        manifest: of the data set.
        names: of the files that it lists.
    """
    known = {*names, MANIFEST, SCENARIO, CARD, LOG, METRICS, CROISSANT}
    unknown = set(file_names(folder)) - known
    if unlisted := unlisted_episodes(folder, manifest):
        yield "files", unlisted
        unknown = {name for name in unknown if not is_episode_name(name)}
    if not manifest["complete"]:
        unknown = {name for name in unknown if not name.startswith(PART)}  # --resume continues unfinished shards
    for name in sorted(name for name in unknown if ".json" in name or name.endswith((".tmp", SHARD_SUFFIX))):
        yield "files", f"{name} is in the folder but not listed"


def _range_findings(manifest: JsonDict, shard: JsonDict, episodes: list[int]) -> Iterator[Finding]:
    """Contradictions between the episodes of a shard and the numbers that it covers."""
    left_out = [number for number, _ in shard.get("left_out") or ()]
    is_generated = not (manifest["collected"] or manifest.get("sources"))
    lists_all = not manifest.get("keep") or "left_out" in shard  # not after files were merged into shards
    if is_generated and lists_all and sorted([*episodes, *left_out]) != list(range(shard["first"], shard["stop"])):
        yield "files", f"must list the episodes {shard['first']} to {shard['stop'] - 1} that are kept"
    if len(episodes) != manifest["episodes"]:
        yield "episodes", f"is {manifest['episodes']}, but {len(episodes)} are listed"


def _shard_findings(folder: Path, manifest: JsonDict) -> Iterator[Finding]:
    """Contradictions within the manifest of a data set in shards, and between it and those of the shards."""
    shards, counts = manifest["shards"], {key: Counter[str]() for key in manifest["counts"]}
    parts, left_out, following, are_all_read = Counter[str](), Counter[str](), 0, True
    is_generated = not (manifest["collected"] or manifest.get("sources"))
    for name in _repeated(shard["name"] for shard in shards):
        yield "shards", f"lists {name} more than once"
    for shard in shards:
        try:
            own = manifest["files"].manifest_of(shard)
        except RecordError as error:
            yield "shards", str(error)
            are_all_read = False
            continue
        for key, counter in counts.items():
            counter.update(own["counts"].get(key) or {})
        left_out.update(own.get("left_out") or {})
        if own["split"] is not None and manifest["split"] is None:
            yield "split", f"is none, but the manifest of {shard['name']} has one; split the data set again"
        parts.update({part: len(names) for part, names in (own["split"] or {}).items()})
        content = own.get("shard") or {}
        if is_generated and are_all_read and content.get("first") != following:
            yield "shards", f"{shard['name']} begins with episode {content.get('first')}, and not {following}"
        following = content.get("stop", -1)
    count = len(manifest["files"])
    if not manifest["complete"]:
        yield "complete", f"{count} of {manifest['episodes']} episodes exist; generate the others with --resume"
    elif count != manifest["episodes"]:
        yield "shards", f"have {count} episodes, and not {manifest['episodes']}"
    for key, stated in manifest["counts"].items() if are_all_read else ():
        if stated != dict(counts[key]):
            yield f"counts.{key}", f"is {stated}, but the shards give {dict(counts[key])}"
    if manifest.get("keep") and (manifest.get("left_out") or {}) != dict(left_out):
        yield "left_out", f"is {manifest.get('left_out')}, but the shards give {dict(left_out)}"
    if manifest["split"] is not None:
        stated = {part: len(names) for part, names in manifest["split"].items()}
        if stated != {part: parts[part] for part in stated} or sum(parts.values()) != count:
            yield "split", f"is {stated}, but the shards give {dict(parts)}; split the data set again"
    names = [shard["name"] for shard in shards]
    beside = {shard_manifest_path(folder / name).name for name in names}
    yield from _unknown_files(folder, manifest | {"complete": True}, {*names, *beside})


def _counts_to(count: int, numbers: list[int]) -> bool:
    """Whether the numbers are 0 to count - 1 in order."""
    return len(numbers) == count and numbers == list(range(len(numbers)))


def _unknown_keys(manifest: JsonDict) -> Iterator[Finding]:
    """Keys of a manifest that this version does not know: of a newer version, or misspelt."""
    rows: tuple[tuple[str, type[BaseModel], list[JsonDict]], ...] = (
        ("", ShardedManifest if "shards" in manifest else Manifest, [stored_form(manifest)]),
        ("shards", Shard, manifest.get("shards") or []),
        ("files", ManifestFile, [] if "shards" in manifest else manifest["files"]),
        ("sources", Source, manifest.get("sources") or []),
    )
    for place, model, documents in rows:
        unknown = {key for document in documents for key in document} - set(model.model_fields)
        for key in sorted(unknown):
            yield f"{place}.{key}".lstrip("."), "is unknown to this version of sonata2d, and ignored"


def _scenario_problems(folder: Path, manifest: JsonDict) -> Iterator[Problem]:
    """Differences between the file of a generated data set's scenario and the settings in its manifest."""
    if manifest["settings"] is None or manifest["collected"]:
        return  # of merged data sets, without such a file, and of runs that may have other settings than the first
    path = folder / SCENARIO
    if not path.is_file():
        message = f"is missing; the settings are in {MANIFEST} and in every episode"
        yield Problem(SCENARIO, "file", message, is_warning=True)
        return
    try:
        settings = orjson.loads(read_bytes(path))
    except (RecordError, orjson.JSONDecodeError) as error:
        yield Problem(SCENARIO, "file", f"cannot be read: {error}")
        return
    if settings != manifest["settings"]:
        is_mapping = isinstance(settings, dict)
        keys = [
            key
            for key in dict.fromkeys([*settings, *manifest["settings"]] if is_mapping else [])
            if settings.get(key) != manifest["settings"].get(key)
        ]
        yield Problem(SCENARIO, ", ".join(keys[:3]) or "file", f"differs from the settings in {MANIFEST}")


def _card_problems(folder: Path, manifest: JsonDict) -> Iterator[Problem]:
    """Differences between the counts in the card and the manifest; the text of a card may be anything."""
    if not (folder / CARD).is_file():
        yield Problem(CARD, "file", "is missing; write it with `sonata2d card`", is_warning=True)
    for difference in count_differences(folder, manifest) if manifest["complete"] else ():
        yield Problem(CARD, "counts", f"{difference}; write it again with `sonata2d card`")


def _selection_findings(manifest: JsonDict, episodes: list[int]) -> Iterator[Finding]:
    """Contradictions in a data set that keeps some outcomes only: every episode number must be accounted for."""
    keep, left_out = manifest["keep"], manifest.get("left_out") or {}
    if len(episodes) != manifest["episodes"] or episodes != sorted(set(episodes)):
        yield "files", f"must list {manifest['episodes']} episodes in order"
    for file in manifest["files"]:
        if file["outcome"] not in keep:
            yield "keep", f"{file['name']} ended in {file['outcome']}, but only {', '.join(keep)} is kept"
    missing = episodes[-1] + 1 - len(episodes) if episodes else 0
    if missing != sum(left_out.values()) or set(left_out) & set(keep):
        yield "left_out", f"is {left_out}, but {missing} episode numbers are not listed"


def _repeated(names: Iterable[str]) -> list[str]:
    return [name for name, count in Counter(names).items() if count > 1]
