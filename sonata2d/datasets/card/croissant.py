"""Croissant metadata: a machine-readable description of a data set, computed for the template croissant.json.jinja.

Sources: Croissant format specification 1.0, MLCommons (2024), http://mlcommons.org/croissant/1.0; its vocabulary for
responsible AI, Croissant RAI 1.0, http://mlcommons.org/croissant/RAI/1.0.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import date as Date
from pathlib import Path
from typing import Any

import orjson

from ...errors import ConfigError, DatasetWarning, RecordError
from ...record.files import file_suffix, read_bytes, read_text, sha256_of
from ...record.layout import JsonDict
from ..manifest.names import CARD, CROISSANT, is_file_name
from .text import pedestrian_kinds, recorded_count, template, title_of

_LICENCES = {"cc-by-4.0": "https://creativecommons.org/licenses/by/4.0/"}
_LICENCE = re.compile(r"[a-z0-9][a-z0-9.+-]*")  # a licence identifier of Hugging Face
_ADDRESS = re.compile(r"https?://[^\s\"'<>\\^`{|}]+")  # also without characters that end a value in the card
_VERSION = re.compile(r"(0|[1-9][0-9]*)\.(0|[1-9][0-9]*)\.(0|[1-9][0-9]*)")
_MEDIA_TYPES = {".json": "application/json", ".json.gz": "application/gzip", ".json.zst": "application/zstd"}
_REMEDY = "write it again with `sonata2d card`"


def _is_date(text: str) -> bool:
    try:
        return Date.fromisoformat(text).isoformat() == text
    except ValueError:
        return False


# of the statements that are texts: a condition, and the message for others
_FORMS: dict[str, tuple[Callable[[str], object], str]] = {
    "licence": (
        lambda text: _LICENCE.fullmatch(text) or _ADDRESS.fullmatch(text),
        "is not a licence identifier; use one like cc-by-4.0, an https address, or other",
    ),
    "version": (_VERSION.fullmatch, "is not a version; use MAJOR.MINOR.PATCH, such as 1.0.0"),
    "date": (_is_date, "is not a date; use YYYY-MM-DD"),
    "creator": (str, "is not a name"),
    "url": (_ADDRESS.fullmatch, "is not a web address; use one that begins with https://"),
}


@dataclass(frozen=True, slots=True)
class Publication:
    """Statements of the author about a data set; kept in `croissant.json` and the card when the data set changes.

    Nothing is taken from the clock, so the same statements give the same bytes.

    Attributes:
        licence: identifier as on Hugging Face, or an https address; None: the default of the data set.
        date: date of publication, YYYY-MM-DD.
        version: MAJOR.MINOR.PATCH.
        creator: name of a person or an organisation.
        organisation: whether the creator is an organisation.
        url: page of the data set.

    Raises:
        ConfigError: a value does not have its form.
    """

    licence: str | None = None
    date: str | None = None
    version: str = "1.0.0"
    creator: str | None = None
    organisation: bool = False
    url: str | None = None

    def __post_init__(self) -> None:
        for name, (has_form, message) in _FORMS.items():
            value = getattr(self, name)
            if value is not None and not isinstance(value, str):  # values of an edited file may be of any type
                raise ConfigError(f"{name} must be a text, got {value!r}")
            if value and not has_form(value):
                raise ConfigError(f"{value!r} {message}")


def stored_publication(folder: Path) -> Publication:
    """The statements in `croissant.json` and the card of a data set; the defaults where they are missing or not valid.

    Warns:
        DatasetWarning: a statement is not valid, and therefore not kept.
    """
    path = folder / CROISSANT
    valid: dict[str, Any] = {"licence": _card_licence(folder)}
    try:
        stated = _statements(orjson.loads(read_bytes(path))) if path.is_file() else {}
    except (RecordError, ValueError, TypeError, AttributeError) as error:
        message = f"{path} is not valid Croissant metadata ({error}), so its statements are not kept"
        warnings.warn(message, DatasetWarning, stacklevel=2)
        stated = {}
    for name, value in stated.items():  # each by itself: a value that sonata2d cannot keep does not affect the others
        try:
            Publication(**{name: value})
            valid[name] = value
        except ConfigError as error:
            warnings.warn(f"{path}: {error}; this statement is not kept", DatasetWarning, stacklevel=2)
    return Publication(**valid)


def _statements(metadata: JsonDict) -> JsonDict:
    """The fields of `Publication` that metadata state, not yet validated."""
    creator, licence = metadata.get("creator"), metadata.get("license")
    stated = {
        "licence": next((name for name, url in _LICENCES.items() if url == licence), licence),
        "date": metadata.get("datePublished"),
        "version": metadata.get("version"),
        "creator": creator.get("name") if isinstance(creator, dict) else creator,
        "organisation": isinstance(creator, dict) and creator.get("@type") == "sc:Organization",
        "url": metadata.get("url"),
    }
    return {name: value for name, value in stated.items() if value is not None}


def _card_licence(folder: Path) -> str | None:
    """The licence in the front matter of a card: its identifier or address; None without one."""
    text = read_text(folder / CARD)
    front_matter = text.split("---\n", 2)[1] if text.startswith("---\n") and text.count("---\n") > 1 else ""
    for key, form in (("license_link", _ADDRESS), ("license", _LICENCE)):
        match = re.search(rf"^{key}: (\S+)$", front_matter, re.MULTILINE)
        if match and form.fullmatch(match[1]):
            return match[1]
    return None


def croissant_findings(folder: Path) -> Iterator[tuple[str, str]]:
    """Contradictions between `croissant.json`, the files that it describes, and the card, as place and message."""
    path = folder / CROISSANT
    if not path.is_file():
        return
    try:
        metadata = orjson.loads(read_bytes(path))
        files = [entry for entry in metadata["distribution"] if entry.get("@type") == "cr:FileObject"]
        stated = [(str(entry["contentUrl"]), entry["sha256"]) for entry in files if "sha256" in entry]
    except (RecordError, ValueError, TypeError, KeyError, AttributeError) as error:
        yield "file", f"is not valid Croissant metadata ({error}); {_REMEDY}"
        return
    for name, sha256 in stated:
        if not is_file_name(name):
            continue  # on a web page or in another folder, which is not read
        if not (folder / name).is_file():
            yield "distribution", f"describes {name}, which is not in the folder; {_REMEDY}"
        elif sha256_of(folder / name) != sha256:
            yield "distribution", f"states another SHA-256 of {name}; {_REMEDY}"
    licence = _card_licence(folder)
    if licence is not None and metadata.get("license") != _LICENCES.get(licence, licence):
        yield "license", f"is {metadata.get('license')!r}, but {CARD} says {licence}; {_REMEDY}"


def croissant_metadata(manifest: JsonDict, manifest_sha256: str, publication: Publication) -> JsonDict:
    """Croissant metadata: the manifest as a file, the episodes as a file set, and one record per episode.

    Args:
        manifest: manifest of the data set, with the settings.
        manifest_sha256: SHA-256 of the manifest file.
        publication: statements of the author, with a licence.
    """
    sources = manifest.get("sources") or [manifest]
    driven = [source for source in sources if source.get("scenario", source.get("name")) is None]
    kept = ", ".join(sorted({status for source in (manifest, *sources) for status in source.get("keep") or ()}))
    recorded, listed = recorded_count(manifest)
    suffixes = sorted({file_suffix(Path(row["name"])) for row in manifest["files"]}) or [".json"]
    title, licence = title_of(manifest), publication.licence or "other"
    people = pedestrian_kinds(manifest)
    description = f"{len(manifest['files'])} episodes of a robot among {people}, made with sonata2d."
    text = template("croissant.json.jinja").render(
        title=title,
        description=description + (f" Only episodes with these outcomes are kept: {kept}." if kept else ""),
        licence=_LICENCES.get(licence, licence),
        publication=publication,
        citation=_citation(title, manifest["software"]["sonata2d"], publication),
        generated=len(driven) < len(sources),
        driven=driven,
        keep=kept,
        recorded=recorded,
        listed=listed,
        manifest_sha256=manifest_sha256,
        is_sharded="shards" in manifest,
        media_types=[_MEDIA_TYPES[suffix] for suffix in suffixes],
        patterns=[f"*{suffix}" for suffix in suffixes],
    )
    metadata: JsonDict = orjson.loads(text)
    return metadata


def _citation(title: str, sonata2d: str, publication: Publication) -> str:
    """A BibTeX entry for the data set."""
    fields = {
        "title": title,
        "author": publication.creator,
        "year": publication.date and publication.date[:4],
        "version": publication.version,
        "url": publication.url,
        "note": f"made with sonata2d {sonata2d}",
    }
    # braces would end a field
    rows = [f"{name} = {{{re.sub('[{}]', '', value)}}}" for name, value in fields.items() if value]
    return f"@misc{{sonata2d-dataset, {', '.join(rows)}}}"
