"""What machines read of a data set: Croissant metadata.

Source: Croissant format specification 1.0, MLCommons (2024), http://mlcommons.org/croissant/1.0.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ..record.files import suffix_of
from ..record.layout import Tree
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
_ENCODINGS = {".json": "application/json", ".json.gz": "application/gzip", ".json.zst": "application/zstd"}
_FIELDS = (  # of the manifest's list of files
    ("name", "sc:Text", "file name of the episode"),
    ("sha256", "sc:Text", "SHA-256 of the file"),
    ("bytes", "sc:Integer", "size of the file"),
    ("episode", "sc:Integer", "number of the episode"),
    ("family", "sc:Text", "scenario and kind of room; splits go by it"),
    ("outcome", "sc:Text", "how it ended"),
    ("ticks", "sc:Integer", "number of frames"),
)


def croissant(manifest: Tree, sha256: str, *, title: str, description: str, licence: str) -> dict[str, Any]:
    """Croissant metadata: the manifest as a file, the episodes as a set of files, and a record for each episode.

    Args:
        manifest: of the data set.
        sha256: of the manifest's file.
        title, description: of the data set.
        licence: as Hugging Face names it.
    """
    suffixes = sorted({suffix_of(Path(file["name"])) for file in manifest["files"]}) or [".json"]
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
                "sha256": sha256,
            },
            {
                "@type": "cr:FileSet",
                "@id": "episodes",
                "name": "episodes",
                "description": "One JSON document an episode; columns and units are named in each.",
                "encodingFormat": _ENCODINGS[suffixes[0]]
                if len(suffixes) == 1
                else list(map(_ENCODINGS.get, suffixes)),
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
                        "description": about,
                        "dataType": kind,
                        "source": {"fileObject": manifest_file, "extract": {"jsonPath": f"$.files[*].{name}"}},
                    }
                    for name, kind, about in _FIELDS
                ],
            }
        ],
    }
