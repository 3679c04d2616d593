"""Checks the folder of a data set: files that the manifest does not list, and files that repeat its content."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import orjson

from ...core.files.locations import file_names
from ...errors import RecordError
from ...record.files import read_bytes
from ...record.layout import JsonDict
from ...record.shard_file import SHARD_SUFFIX, shard_manifest_path
from ..card.croissant import croissant_findings
from ..card.write import card_differences
from ..manifest.names import CARD, CROISSANT, LOG, MANIFEST, METRICS, PART, SCENARIO, episode_number, shard_number
from ..manifest.rows import listing, unlisted_episodes
from ..tables import has_pyarrow, tables_are_stale
from .episodes import Problem
from .plausibility import Finding


def folder_problems(folder: Path, manifest: JsonDict) -> Iterator[Problem]:
    """Differences between a manifest and the files beside it that repeat its content."""
    yield from _scenario_problems(folder, manifest)
    if not (folder / CARD).is_file():  # its text may be anything, apart from the counts
        yield Problem(CARD, "file", "is missing; write it with `sonata2d card`", is_warning=True)
    for place, difference in card_differences(folder, manifest) if manifest["complete"] else ():
        yield Problem(CARD, place, f"{difference}; write it again with `sonata2d card`")
    if manifest["complete"] and has_pyarrow() and tables_are_stale(folder, manifest):
        message = "do not hold the present episodes; write them again with `sonata2d card`"
        yield Problem("frames-*.parquet", "tables", message, is_warning=True)
    yield from (Problem(CROISSANT, *finding) for finding in croissant_findings(folder))


def unknown_files(folder: Path, manifest: JsonDict) -> Iterator[Finding]:
    """Files of a folder that look like episodes, or remained of a run, and that its manifest does not list."""
    names = {row["name"] for row in listing(manifest)}
    names |= {shard_manifest_path(folder / name).name for name in names if name.endswith(SHARD_SUFFIX)}
    unknown = set(file_names(folder)) - {*names, MANIFEST, SCENARIO, CARD, LOG, METRICS, CROISSANT}
    if unlisted := unlisted_episodes(folder, manifest):
        # a killed run: one message for all
        yield "files", unlisted
        number_in = shard_number if "shards" in manifest else episode_number
        unknown = {name for name in unknown if number_in(name) is None}
    if not manifest["complete"]:
        unknown = {name for name in unknown if not name.startswith(PART)}  # --resume continues unfinished shards
    for name in sorted(name for name in unknown if ".json" in name or name.endswith((".tmp", SHARD_SUFFIX))):
        yield "files", f"{name} is in the folder but not listed"


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
        expected = manifest["settings"]
        keys = [*settings, *expected] if isinstance(settings, dict) else []
        different = [key for key in dict.fromkeys(keys) if settings.get(key) != expected.get(key)]
        yield Problem(SCENARIO, ", ".join(different[:3]) or "file", f"differs from the settings in {MANIFEST}")
