"""Croissant metadata: a machine-readable description of a data set.

Sources: Croissant format specification 1.0, MLCommons (2024), http://mlcommons.org/croissant/1.0; its vocabulary for
responsible AI, Croissant RAI 1.0, http://mlcommons.org/croissant/RAI/1.0.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator
from dataclasses import dataclass, fields
from datetime import date as Date
from pathlib import Path
from typing import Any

import orjson

from ...errors import ConfigError, DatasetWarning, RecordError
from ...record.files import file_suffix, read_bytes, read_text, sha256_of
from ...record.layout import JsonDict
from ...record.shard_file import SHARD_MANIFEST_SUFFIX, SHARD_SUFFIX
from ..check.plausibility import Finding
from ..manifest.models import is_file_name
from ..manifest.read import CARD, CROISSANT, MANIFEST, METRICS, SCENARIO

LICENCES = {"cc-by-4.0": "https://creativecommons.org/licenses/by/4.0/"}
DEFAULT_VERSION = "1.0.0"
_PERSON, _ORGANISATION = "sc:Person", "sc:Organization"
CONFORMS_TO = ["http://mlcommons.org/croissant/1.0", "http://mlcommons.org/croissant/RAI/1.0"]
_LICENCE = re.compile(r"[a-z0-9][a-z0-9.+-]*")  # a licence identifier of Hugging Face
_ADDRESS = re.compile(r"https?://[^\s\"'<>\\^`{|}]+")  # also without characters that end a value in the card
_VERSION = re.compile(r"(0|[1-9][0-9]*)\.(0|[1-9][0-9]*)\.(0|[1-9][0-9]*)")
_CONTEXT = {  # as the specification gives it
    "@language": "en",
    "@vocab": "https://schema.org/",
    "citeAs": "cr:citeAs",
    "column": "cr:column",
    "conformsTo": "dct:conformsTo",
    "cr": "http://mlcommons.org/croissant/",
    "data": {"@id": "cr:data", "@type": "@json"},
    "dataType": {"@id": "cr:dataType", "@type": "@vocab"},
    "dct": "http://purl.org/dc/terms/",
    "equivalentProperty": "cr:equivalentProperty",
    "examples": {"@id": "cr:examples", "@type": "@json"},
    "excludes": "cr:excludes",
    "extract": "cr:extract",
    "field": "cr:field",
    "fileObject": "cr:fileObject",
    "fileProperty": "cr:fileProperty",
    "fileSet": "cr:fileSet",
    "format": "cr:format",
    "includes": "cr:includes",
    "isLiveDataset": "cr:isLiveDataset",
    "jsonPath": "cr:jsonPath",
    "key": "cr:key",
    "md5": "cr:md5",
    "parentField": "cr:parentField",
    "path": "cr:path",
    "rai": "http://mlcommons.org/croissant/RAI/",
    "recordSet": "cr:recordSet",
    "references": "cr:references",
    "regex": "cr:regex",
    "repeated": "cr:repeated",
    "replace": "cr:replace",
    "samplingRate": "cr:samplingRate",
    "sc": "https://schema.org/",
    "separator": "cr:separator",
    "source": "cr:source",
    "subField": "cr:subField",
    "transform": "cr:transform",
}
_MEDIA_TYPES = {".json": "application/json", ".json.gz": "application/gzip", ".json.zst": "application/zstd"}
_FIELDS = (  # keys of the rows in the manifest's `files`: name, type, description
    ("name", "sc:Text", "file name of the episode"),
    ("sha256", "sc:Text", "SHA-256 of the file"),
    ("bytes", "sc:Integer", "size of the file"),
    ("episode", "sc:Integer", "number of the episode"),
    ("family", "sc:Text", "scenario and kind of room; used for splits"),
    ("outcome", "sc:Text", "outcome of the episode"),
    ("ticks", "sc:Integer", "number of frames"),
)


_SHARDS: tuple[JsonDict, ...] = (
    {
        "@type": "cr:FileSet",
        "@id": "shards",
        "name": "shards",
        "description": "Tar files in the layout of WebDataset, with some episodes each.",
        "encodingFormat": "application/x-tar",
        "includes": [f"*{SHARD_SUFFIX}"],
    },
    {
        "@type": "cr:FileSet",
        "@id": "shard-manifests",
        "name": "shard-manifests",
        "description": "A manifest of the episodes in each shard.",
        "encodingFormat": "application/json",
        "includes": [f"*{SHARD_MANIFEST_SUFFIX}"],
    },
)


@dataclass(frozen=True, slots=True)
class Publication:
    """What the author of a data set states about it; kept in `croissant.json` and the card when the data set changes.

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
    version: str = DEFAULT_VERSION
    creator: str | None = None
    organisation: bool = False
    url: str | None = None

    def __post_init__(self) -> None:
        for field in fields(self):  # values of a file that was edited may be of any type
            value = getattr(self, field.name)
            if field.name != "organisation" and value is not None and not isinstance(value, str):
                raise ConfigError(f"{field.name} must be a text, got {value!r}")
        if self.licence is not None and not (_LICENCE.fullmatch(self.licence) or _is_web_page(self.licence)):
            raise ConfigError(
                f"{self.licence!r} is not a licence identifier; use one like cc-by-4.0, an https address, or other"
            )
        if not _VERSION.fullmatch(self.version):
            raise ConfigError(f"{self.version!r} is not a version; use MAJOR.MINOR.PATCH, such as 1.0.0")
        if self.date is not None and not _is_date(self.date):
            raise ConfigError(f"{self.date!r} is not a date; use YYYY-MM-DD")
        if self.url is not None and not _is_web_page(self.url):
            raise ConfigError(f"{self.url!r} is not a web address; use one that begins with https://")


def _is_web_page(text: str) -> bool:
    return _ADDRESS.fullmatch(text) is not None


def _is_date(text: str) -> bool:
    try:
        return Date.fromisoformat(text).isoformat() == text
    except ValueError:
        return False


def stored_publication(folder: Path) -> Publication:
    """What `croissant.json` and the card of a data set state; the defaults where they are missing or not valid."""
    path = folder / CROISSANT
    if not path.is_file():
        return Publication(card_licence(folder))
    try:
        metadata = orjson.loads(read_bytes(path))
        stated = _statements(metadata)
    except (RecordError, ValueError, TypeError, AttributeError) as error:
        message = f"{path} is not valid Croissant metadata ({error}), so its statements are not kept"
        warnings.warn(message, DatasetWarning, stacklevel=2)
        return Publication(card_licence(folder))
    valid: dict[str, Any] = {"licence": card_licence(folder)}
    for name, value in stated.items():  # each by itself: a value that sonata2d cannot keep does not affect the others
        try:
            Publication(**{name: value})
            valid[name] = value
        except (ConfigError, TypeError) as error:
            warnings.warn(f"{path}: {error}; this statement is not kept", DatasetWarning, stacklevel=2)
    return Publication(**valid)


def _statements(metadata: JsonDict) -> JsonDict:
    """The fields of `Publication` that metadata state, not yet validated."""
    creator, licence = metadata.get("creator"), metadata.get("license")
    stated = {
        "licence": next((name for name, url in LICENCES.items() if url == licence), licence),
        "date": metadata.get("datePublished"),
        "version": metadata.get("version"),
        "creator": creator.get("name") if isinstance(creator, dict) else creator,
        "organisation": isinstance(creator, dict) and creator.get("@type") == _ORGANISATION,
        "url": metadata.get("url"),
    }
    return {name: value for name, value in stated.items() if value is not None}


def licence_lines(licence: str) -> str:
    """A licence as lines of the front matter: Hugging Face knows identifiers, and others by their address."""
    return f"license: other\nlicense_link: {licence}" if _is_web_page(licence) else f"license: {licence}"


def card_licence(folder: Path) -> str | None:
    """The licence in the front matter of a card: its identifier or address; None without one."""
    path = folder / CARD
    text = read_text(path)
    front_matter = text.split("---\n", 2)[1] if text.startswith("---\n") and text.count("---\n") > 1 else ""
    for key, form in (("license_link", _ADDRESS), ("license", _LICENCE)):
        found = re.search(rf"^{key}: (\S+)$", front_matter, re.MULTILINE)
        if found and form.fullmatch(found[1]):
            return found[1]
    return None


def croissant_findings(folder: Path) -> Iterator[Finding]:
    """Contradictions between `croissant.json`, the files that it describes, and the card."""
    path, remedy = folder / CROISSANT, "write it again with `sonata2d card`"
    if not path.is_file():
        return
    try:
        metadata = orjson.loads(read_bytes(path))
        files = [entry for entry in metadata["distribution"] if entry.get("@type") == "cr:FileObject"]
        stated = [(str(entry["contentUrl"]), entry["sha256"]) for entry in files if "sha256" in entry]
    except (RecordError, ValueError, TypeError, KeyError, AttributeError) as error:
        yield "file", f"is not valid Croissant metadata ({error}); {remedy}"
        return
    for name, sha256 in stated:
        if not is_file_name(name):
            continue  # on a web page or in another folder, which is not read
        if not (folder / name).is_file():
            yield "distribution", f"describes {name}, which is not in the folder; {remedy}"
        elif sha256_of(folder / name) != sha256:
            yield "distribution", f"states another SHA-256 of {name}; {remedy}"
    licence = card_licence(folder)
    if licence is not None and metadata.get("license") != LICENCES.get(licence, licence):
        yield "license", f"is {metadata.get('license')!r}, but {CARD} says {licence}; {remedy}"


def croissant_metadata(
    manifest: JsonDict,
    manifest_sha256: str,
    *,
    title: str,
    description: str,
    publication: Publication,
    responsible_ai: JsonDict,
) -> JsonDict:
    """Croissant metadata: the manifest as a file, the episodes as a file set, and one record per episode.

    Args:
        manifest: manifest of the data set.
        manifest_sha256: SHA-256 of the manifest file.
        title: title of the data set.
        description: description of the data set.
        publication: with a licence.
        responsible_ai: properties of the Croissant RAI vocabulary.
    """
    licence = publication.licence or "other"
    return {
        "@context": _CONTEXT,
        "@type": "sc:Dataset",
        "name": title,
        "description": description,
        "conformsTo": CONFORMS_TO,
        "license": LICENCES.get(licence, licence),
        "version": publication.version,
        **({"datePublished": publication.date} if publication.date else {}),
        **_creator(publication),
        **({"url": publication.url} if publication.url else {}),
        "citeAs": _citation(title, manifest["software"]["sonata2d"], publication),
        "isLiveDataset": False,
        **{f"rai:{name}": value for name, value in responsible_ai.items()},
        "keywords": ["social navigation", "robotics", "pedestrians", "simulation", "sonata2d"],
        "distribution": _distribution(manifest, manifest_sha256),
        "recordSet": [_record_set("shards" in manifest)],
    }


def _distribution(manifest: JsonDict, manifest_sha256: str) -> list[JsonDict]:
    """The files: the manifest, and the set of episode files."""
    suffixes = sorted({file_suffix(Path(file["name"])) for file in manifest["files"]}) or [".json"]
    media_types = [_MEDIA_TYPES[suffix] for suffix in suffixes]
    is_sharded = "shards" in manifest
    return [
        {
            "@type": "cr:FileObject",
            "@id": MANIFEST,
            "name": MANIFEST,
            "contentUrl": MANIFEST,
            "encodingFormat": "application/json",
            "sha256": manifest_sha256,
        },
        {
            "@type": "cr:FileSet",
            "@id": "episodes",
            "name": "episodes",
            "description": "One JSON document per episode; each document names its columns and units.",
            "encodingFormat": media_types[0] if len(media_types) == 1 else media_types,
            "includes": [f"*{suffix}" for suffix in suffixes],
            **({"containedIn": {"@id": "shards"}} if is_sharded else {}),
            **({} if is_sharded else {"excludes": [MANIFEST, SCENARIO, METRICS, CROISSANT]}),
        },
        *(_SHARDS if is_sharded else ()),
    ]


def _record_set(is_sharded: bool) -> JsonDict:
    """One record for each episode, with the keys of its row in the manifest, or in that of its shard."""
    files = {"fileSet": {"@id": "shard-manifests"}} if is_sharded else {"fileObject": {"@id": MANIFEST}}
    return {
        "@type": "cr:RecordSet",
        "@id": "episode",
        "name": "episode",
        "field": [
            {
                "@type": "cr:Field",
                "@id": f"episode/{name}",
                "name": name,
                "description": description,
                "dataType": kind,
                "source": {**files, "extract": {"jsonPath": f"$.files[*].{name}"}},
            }
            for name, kind, description in _FIELDS
        ],
    }


def _creator(publication: Publication) -> JsonDict:
    if not publication.creator:
        return {}
    return {"creator": {"@type": _ORGANISATION if publication.organisation else _PERSON, "name": publication.creator}}


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
