"""Croissant metadata: a machine-readable description of a data set.

Source: Croissant format specification 1.0, MLCommons (2024), http://mlcommons.org/croissant/1.0.
"""

from __future__ import annotations

from pathlib import Path

from ..record.files import file_suffix
from ..record.layout import JsonDict
from .manifest import CROISSANT, MANIFEST, METRICS, SCENARIO

LICENCES = {"cc-by-4.0": "https://creativecommons.org/licenses/by/4.0/"}
_CONTEXT = {
    "@language": "en",
    "@vocab": "https://schema.org/",
    "citeAs": "cr:citeAs",
    "column": "cr:column",
    "conformsTo": "dct:conformsTo",
    "cr": "http://mlcommons.org/croissant/",
    "dct": "http://purl.org/dc/terms/",
    "data": {"@id": "cr:data", "@type": "@json"},
    "dataType": {"@id": "cr:dataType", "@type": "@vocab"},
    "excludes": "cr:excludes",
    "extract": "cr:extract",
    "field": "cr:field",
    "fileObject": "cr:fileObject",
    "fileSet": "cr:fileSet",
    "format": "cr:format",
    "includes": "cr:includes",
    "jsonPath": "cr:jsonPath",
    "md5": "cr:md5",
    "recordSet": "cr:recordSet",
    "sc": "https://schema.org/",
    "source": "cr:source",
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


def croissant_metadata(
    manifest: JsonDict, manifest_sha256: str, *, title: str, description: str, licence: str
) -> JsonDict:
    """Croissant metadata: the manifest as a file, the episodes as a file set, and one record per episode.

    Args:
        manifest: manifest of the data set.
        manifest_sha256: SHA-256 of the manifest file.
        title: title of the data set.
        description: description of the data set.
        licence: identifier as on Hugging Face.
    """
    suffixes = sorted({file_suffix(Path(file["name"])) for file in manifest["files"]}) or [".json"]
    media_types = [_MEDIA_TYPES[suffix] for suffix in suffixes]
    manifest_file = {"@id": "manifest.json"}
    return {
        "@context": _CONTEXT,
        "@type": "sc:Dataset",
        "name": title,
        "description": description,
        "conformsTo": "http://mlcommons.org/croissant/1.0",
        "license": LICENCES.get(licence, licence),
        "keywords": ["social navigation", "robotics", "pedestrians", "simulation", "sonata2d"],
        "distribution": [
            {
                "@type": "cr:FileObject",
                "@id": "manifest.json",
                "name": "manifest.json",
                "contentUrl": "manifest.json",
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
                "excludes": [MANIFEST, SCENARIO, METRICS, CROISSANT],
            },
        ],
        "recordSet": [
            {
                "@type": "cr:RecordSet",
                "@id": "episode",
                "name": "episode",
                "field": [
                    {
                        "@type": "cr:Field",
                        "@id": f"episode/{name}",
                        "name": name,
                        "description": description_of_field,
                        "dataType": kind,
                        "source": {"fileObject": manifest_file, "extract": {"jsonPath": f"$.files[*].{name}"}},
                    }
                    for name, kind, description_of_field in _FIELDS
                ],
            }
        ],
    }
