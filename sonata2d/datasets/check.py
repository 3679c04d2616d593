"""Is a file, or a data set, what it says it is? Schema, hashes, and agreement of the numbers with one another."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import orjson

from ..errors import RecordError
from ..record.layout import Tree
from ..record.reader import read_episode
from ..record.record import EpisodeRecord
from .manifest import CARD, CROISSANT, MANIFEST, METRICS, SCENARIO, entry_of, read_manifest
from .plausibility import Doubt, doubts
from .progress import LOG

if TYPE_CHECKING:
    from pydantic import BaseModel

_MOST_TOLD = 20  # problems of the schema told of one file


@dataclass(frozen=True, slots=True)
class Problem:
    """What is wrong, in which file, and where in it."""

    file: str
    place: str
    message: str

    def __str__(self) -> str:
        return f"{self.file}: {self.place}: {self.message}"


@dataclass(frozen=True, slots=True)
class Listed:
    """A file of a data set, what the manifest says of it, and what of all of them."""

    path: Path
    told: Tree
    common: Tree


def check_episode(path: str | Path) -> list[Problem]:
    """What is wrong with an episode file; an empty list if nothing is.

    The schema, then whether the numbers agree with one another and with what bodies can do: see `sense`.
    """
    path = Path(path)
    try:
        record = read_episode(path)
    except RecordError as error:
        return [Problem(path.name, "file", str(error))]
    return _check_record(record)


def check_dataset(folder: str | Path) -> list[Problem]:
    """What is wrong with a data set: its manifest, the files that it lists, and each episode."""
    folder = Path(folder)
    problems = check_manifest(folder)
    if any(problem.place == "file" for problem in problems):
        return problems
    return [problem for path in listed_files(folder) for problem in check_listed(path)] + problems


def check_manifest(folder: Path) -> list[Problem]:
    """What is wrong with a manifest by itself and with which files there are."""
    try:
        manifest = read_manifest(folder)
    except RecordError as error:
        return [Problem(MANIFEST, "file", str(error))]
    return [Problem(MANIFEST, *doubt) for doubt in _manifest_doubts(folder, manifest)]


def listed_files(folder: Path) -> list[Listed]:
    """The files that a manifest lists, each with what it says of it.

    Raises:
        RecordError: there is no whole manifest.
    """
    manifest = read_manifest(folder)
    common = {key: manifest[key] for key in ("physics", "precision")}
    shared = {name: _shared(source, common) for source in _sources(manifest) for name in source["files"]}
    return [Listed(folder / told["name"], told, shared.get(told["name"], {})) for told in manifest["files"]]


def _sources(manifest: Tree) -> list[Tree]:
    """The data sets that it was merged from, or itself as the only one."""
    files = [told["name"] for told in manifest["files"]]
    return manifest.get("sources") or [manifest | {"scenario": manifest["name"], "files": files}]


def _shared(source: Tree, common: Tree) -> Tree:
    """What all files of a source say alike; of runs that people drove each tells its own."""
    if source["scenario"] is None:
        return {}
    return common | {"name": source["scenario"], **{key: source[key] for key in ("settings", "seed", "controller")}}


def check_listed(listed: Listed) -> list[Problem]:
    """A file against what the manifest says of it, then for itself."""
    path, told = listed.path, listed.told
    if path.name != told["name"] or not path.is_file():
        return [Problem(MANIFEST, "files", f"{told['name']} is in the list but not in the folder")]
    try:
        record = read_episode(path)
    except RecordError as error:
        return [Problem(path.name, "file", str(error))]
    found = asdict(entry_of(record))
    problems = [
        Problem(path.name, key, f"is {found[key]}, the manifest says {told[key]}")
        for key in found
        if found[key] != told[key]
    ]
    for key, value in listed.common.items():
        if record.document[key] != value:
            problems.append(Problem(path.name, key, "differs from the manifest's"))
    return problems + _check_record(record)


def _check_record(record: EpisodeRecord) -> list[Problem]:
    from ..record.models import Episode

    name = record.path.name
    problems = _check_schema(name, Episode, record.document)
    return problems or [Problem(name, *doubt) for doubt in doubts(record)]


def _check_schema(name: str, model: type[BaseModel], document: Tree) -> list[Problem]:
    from pydantic import ValidationError

    try:
        model.model_validate_json(orjson.dumps(document))
    except ValidationError as error:
        found = error.errors(include_url=False, include_context=False)
        problems = [Problem(name, ".".join(map(str, e["loc"])), f"{e['msg']}, got {e['input']!r:.60}") for e in found]
        rest = len(problems) - _MOST_TOLD
        return problems[:_MOST_TOLD] + ([Problem(name, "schema", f"{rest} more problems")] if rest > 0 else [])
    return []


def _manifest_doubts(folder: Path, manifest: Tree) -> Iterator[Doubt]:
    """Does the manifest agree with itself and with the folder?"""
    files = manifest["files"]
    names, episodes = [file["name"] for file in files], [file["episode"] for file in files]
    if not manifest["complete"]:
        yield "complete", f"{len(files)} of {manifest['episodes']} episodes are there; go on with --resume"
    elif manifest.get("keep"):
        yield from _keep_doubts(manifest, episodes)
    elif not (manifest["collected"] or manifest.get("sources")) and episodes != list(range(manifest["episodes"])):
        yield "files", f"should list the episodes 0 to {manifest['episodes'] - 1} in order"
    for key, told in manifest["counts"].items():
        if told != (counted := dict(Counter(file[key] for file in files if file.get(key) is not None))):
            yield f"counts.{key}", f"says {told}, the list gives {counted}"
    for name in _repeated(names):
        yield "files", f"lists {name} more than once"
    if manifest.get("sources") and sorted(names) != sorted(name for s in _sources(manifest) for name in s["files"]):
        yield "sources", "should list each file once"
    parts = [name for part in (manifest["split"] or {}).values() for name in part]
    for name in [*_repeated(parts), *sorted(set(parts) - set(names))]:
        yield "split", f"{name} is in two parts, or in none of the files listed"
    known = {*names, MANIFEST, SCENARIO, CARD, LOG, METRICS, CROISSANT}
    strangers = {path.name for path in folder.iterdir() if path.is_file()} - known
    for name in sorted(name for name in strangers if ".json" in name or name.endswith(".tmp")):
        yield "files", f"{name} is in the folder but not in the list"


def _keep_doubts(manifest: Tree, episodes: list[int]) -> Iterator[Doubt]:
    """Of a data set of which some outcomes were kept: does it account for each number?"""
    keep, left_out = manifest["keep"], manifest.get("left_out") or {}
    if len(episodes) != manifest["episodes"] or episodes != sorted(set(episodes)):
        yield "files", f"should list {manifest['episodes']} episodes in order"
    for file in manifest["files"]:
        if file["outcome"] not in keep:
            yield "keep", f"{file['name']} ended in {file['outcome']}, kept are {', '.join(keep)}"
    gaps = episodes[-1] + 1 - len(episodes) if episodes else 0
    if gaps != sum(left_out.values()) or set(left_out) & set(keep):
        yield "left_out", f"says {left_out}, the list leaves out {gaps}"


def _repeated(names: Iterable[str]) -> list[str]:
    return [name for name, count in Counter(names).items() if count > 1]
