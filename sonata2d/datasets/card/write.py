"""Writes the data card of a data set, README.md, and the Croissant metadata beside it, and recognises edited cards."""

from __future__ import annotations

import hashlib
import re
import warnings
from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import replace
from pathlib import Path
from typing import Any

from ...core.files.locations import location
from ...core.notebook import Advance
from ...errors import DatasetWarning, RecordError
from ...record.files import read_bytes, read_stored, read_text, write_atomically
from ...record.layout import JsonDict
from ...record.models import Settings
from ...record.shard_file import is_shard
from ...workers.executors import Workers
from ..manifest.names import CARD, CROISSANT, MANIFEST, SCENARIO
from ..manifest.rows import listing, read_manifest, warn_if_incomplete
from ..manifest.write import json_bytes, write_json
from ..tables import has_pyarrow, remove_tables, table_names, write_tables
from .croissant import Publication, croissant_metadata, stored_publication
from .text import card_text, configs_of, default_licence

_CONFIGS = re.compile(r"^configs:\n(?:(?:- |  ).*\n)*", re.MULTILINE)  # of the front matter
_SEAL = re.compile(r"<!-- written by sonata2d, SHA-256 of the text above: ([0-9a-f]{64}) -->\n")


def write_manifest_and_card(folder: Path, manifest: JsonDict, *, licence: str | None = None) -> None:
    """Write the data card, Croissant metadata if the folder has any, and last the manifest: they always agree.

    Statements of the author about the data set (licence, date, …) stay. A card that the author edited is not replaced.

    Args:
        folder: folder of the data set.
        manifest: the new manifest.
        licence: of a data set that is derived from others; None: the one chosen for the folder, or the default.

    Raises:
        RecordError: a file cannot be written, or the file of the settings is damaged.

    Warns:
        DatasetWarning: the card was edited, or `croissant.json` states a value that is not kept.
    """
    _require_no_shard(folder)
    data, described = json_bytes(manifest), _with_settings(folder, manifest)
    stored = stored_publication(folder)
    licence = licence or _licence(folder, stored, described)
    is_edited = has_edited_card(folder)
    if not is_edited:
        _write_text(folder, card_text(described, licence, has_tables=bool(table_names(folder))))
    if (folder / CROISSANT).is_file():
        _write_metadata(folder, described, data, replace(stored, licence=licence))
    write_atomically(folder / MANIFEST, data)
    if is_edited:
        _renew_configs(folder, described)
        message = f"{folder / CARD} was edited, so its text stays as it is; write it again with `sonata2d card`"
        warnings.warn(message, DatasetWarning, stacklevel=2)


def _require_no_shard(folder: Path) -> None:
    if is_shard(folder):
        raise RecordError(f"{folder} is a shard, whose manifest and card stay; name the folder of its data set")


def write_card(
    folder: str | Path,
    *,
    licence: str | None = None,
    date: str | None = None,
    version: str | None = None,
    creator: str | None = None,
    organisation: bool | None = None,
    url: str | None = None,
    workers: int | Executor | Workers = 1,
) -> Path:
    """Write the card of a data set, Croissant metadata beside it, and tables if pyarrow is installed.

    A card that was edited is replaced as well. The tables are those of `write_tables`.

    Args:
        folder: folder of the data set.
        licence: identifier as on Hugging Face, or an https address; by default the one that was chosen before, else
            `cc-by-4.0`, or `other` for recorded pedestrians.
        date: date of publication, YYYY-MM-DD; by default, as for the following, what was stated before, else nothing.
        version: MAJOR.MINOR.PATCH; at first 1.0.0.
        creator: name of the person or organisation that made the data set.
        organisation: whether the creator is an organisation; by default, a stated creator is a person.
        url: page of the data set.
        workers: which write the tables; number of processes, or an executor, or workers that several calls share.

    Returns:
        The path of the card.

    Raises:
        ConfigError: the licence, the date, the version or the address does not have its form.
        RecordError: the folder is not a data set.

    Warns:
        DatasetWarning: the tables cannot be written, since an episode or the split is damaged.
    """
    folder = location(folder)
    _require_no_shard(folder)
    manifest = _with_settings(folder, read_manifest(folder))
    warn_if_incomplete(folder, manifest)
    if creator is not None:
        organisation = bool(organisation)  # a statement about another creator does not hold for this one
    stored = stored_publication(folder)
    chosen = licence or _licence(folder, stored, manifest)
    statements: dict[str, Any] = {
        "date": date, "version": version, "creator": creator, "organisation": organisation, "url": url,
    }  # fmt: skip
    stated = {name: value for name, value in statements.items() if value is not None}
    if has_pyarrow() and manifest["complete"]:
        try:
            write_tables(folder, workers=workers)
        except RecordError as error:  # a damaged episode or split is no reason to have no card
            warnings.warn(f"the tables of {folder} were not written: {error}", DatasetWarning, stacklevel=2)
    _write_metadata(folder, manifest, read_stored(folder / MANIFEST), replace(stored, licence=chosen, **stated))
    _write_text(folder, card_text(manifest, chosen, has_tables=bool(table_names(folder))))
    return folder / CARD


def write_tables_and_card(
    folder: Path, *, workers: int | Executor | Workers = 1, advance: Advance = lambda step: None
) -> None:
    """Write the tables of a data set, and its card again, which names them; an edited card stays.

    Args:
        folder: of the data set.
        workers, advance: as of `write_tables`.

    Raises:
        RecordError: as of `write_tables`.
    """
    write_tables(folder, workers=workers, advance=advance)
    manifest = _with_settings(folder, read_manifest(folder))
    if has_edited_card(folder):
        _renew_configs(folder, manifest)
    else:
        licence = _licence(folder, stored_publication(folder), manifest)
        _write_text(folder, card_text(manifest, licence, has_tables=True))


def _renew_configs(folder: Path, manifest: JsonDict) -> None:
    """Name the present tables in an edited card, if it names any."""
    path = folder / CARD
    text = read_text(path)
    expected = configs_of(manifest, has_tables=bool(table_names(folder)))
    if (found := _CONFIGS.search(text)) and found[0] != expected:
        write_atomically(path, text.replace(found[0], expected, 1).encode())


def write_tables_as(folder: Path, sources: Sequence[Path], workers: int | Executor | Workers = 1) -> None:
    """Write the tables of a data set if all data sets from which it comes have some; remove them without pyarrow.

    Args:
        folder: of the data set.
        sources: folders of the data sets.
        workers: as of `write_tables`.
    """
    if all(map(table_names, sources)):
        if has_pyarrow():
            write_tables_and_card(folder, workers=workers)
        else:
            remove_tables(folder)


def _write_metadata(folder: Path, manifest: JsonDict, data: bytes, publication: Publication) -> None:
    """Write Croissant metadata.

    Args:
        folder: folder of the data set.
        manifest: with the settings.
        data: bytes of the manifest file.
        publication: with a licence.
    """
    metadata = croissant_metadata(manifest, hashlib.sha256(data).hexdigest(), publication)
    write_json(folder / CROISSANT, metadata)


def _write_text(folder: Path, text: str) -> None:
    """Write the card; its last line is a hash of the others, by which `has_edited_card` recognises it."""
    digest = hashlib.sha256(text.encode()).hexdigest()
    seal = f"\n<!-- written by sonata2d, SHA-256 of the text above: {digest} -->\n"
    write_atomically(folder / CARD, (text + seal).encode())


def has_edited_card(folder: Path) -> bool:
    """Whether the card is not as sonata2d wrote it: it is edited, or was written by hand."""
    path = folder / CARD
    if not path.is_file():
        return False
    text, _, last = read_text(path).rpartition("\n<!--")
    seal = _SEAL.fullmatch(f"<!--{last}")
    return seal is None or hashlib.sha256(text.encode()).hexdigest() != seal[1]


def _licence(folder: Path, stored: Publication, manifest: JsonDict) -> str:
    """The licence for a manifest: the one that the author chose for the data set in the folder, else the default."""
    chosen = stored.licence if (folder / MANIFEST).is_file() else None
    # the stored licence may be the default before a change of the data set, after which the default may be another one
    is_default = chosen is None or chosen == default_licence(_with_settings(folder, read_manifest(folder)))
    return default_licence(manifest) if chosen is None or is_default else chosen


def licence_of(folder: Path) -> str:
    """The licence of a data set."""
    return _licence(folder, stored_publication(folder), _with_settings(folder, read_manifest(folder)))


def card_differences(folder: Path, manifest: JsonDict) -> list[tuple[str, str]]:
    """Differences between the counts and tables in a card and in a manifest: a place and a message for each.

    A card without counts or tables has none.
    """
    text = read_text(folder / CARD)
    table = re.search(r"^\| outcome \| episodes \|\n\| -.*\n((?:\|.*\n)*)", text, re.MULTILINE)
    frames = re.search(r"^(\d+) frames in (?:total|all)\.", text, re.MULTILINE)
    differences = []
    if table:
        stated = {name: int(count) for name, count in re.findall(r"^\| (.+?) \| (\d+) \|$", table[1], re.MULTILINE)}
        if stated != manifest["counts"]["outcome"]:
            differences.append(
                ("counts", f"states the outcomes {stated}, the manifest {manifest['counts']['outcome']}")
            )
    total = sum(row["ticks"] for row in listing(manifest))  # the rows of shards have the sums of their episodes
    if frames and int(frames[1]) != total:
        differences.append(("counts", f"states {frames[1]} frames, the manifest {total}"))
    configs = _CONFIGS.search(text)
    expected = configs_of(manifest, has_tables=bool(table_names(folder)))
    if configs and configs[0] != expected:
        named = ", ".join(re.findall(r"path: (.*)", expected)) or "none"
        differences.append(("tables", f"names other tables under `configs` than the data set has: {named}"))
    return differences


def _with_settings(folder: Path, manifest: JsonDict) -> JsonDict:
    """The manifest; for collected runs with the initial settings, which tell whether pedestrians are recorded.

    Raises:
        RecordError: the file of the settings is damaged.
    """
    path = folder / SCENARIO
    if not manifest.get("collected") or not path.exists():
        return manifest
    from pydantic import TypeAdapter, ValidationError

    try:
        return manifest | {"settings": TypeAdapter(Settings | None).validate_json(read_bytes(path))}
    except ValidationError as error:
        raise RecordError(f"{path} does not hold the settings of a scenario: {error.errors()[0]['msg']}") from None
