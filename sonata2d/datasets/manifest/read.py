"""Reads and validates one manifest file: of a data set, or of a shard."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

import orjson

from ...core.wording import shown
from ...errors import RecordError
from ...record.files import read_bytes
from ...record.layout import JsonDict
from ...record.shard_file import is_shard, shard_manifest_path
from .models import Manifest, ManifestFile, ShardedManifest
from .names import MANIFEST

DATASET_FORMAT, DATASET_VERSION, SHARDED_VERSION = "sonata2d-dataset", 1, 2

_BLOCK = 1000  # rows of a manifest that are validated at a time
_valid: set[bytes] = set()  # hashes of the manifests that this process has validated


def _manifest_path(folder: Path) -> Path:
    """Path of the manifest of a data set or of a shard."""
    return shard_manifest_path(folder) if is_shard(folder) else folder / MANIFEST


def has_manifest(folder: Path) -> bool:
    """Whether a path is the folder of a data set, or a shard with its manifest."""
    return _manifest_path(folder).exists()


def read_document(folder: Path) -> JsonDict:
    """The content of a manifest file.

    Raises:
        RecordError: the folder has no manifest, or the manifest is damaged or was written by a newer version.
    """
    path = _manifest_path(folder)
    if not path.exists():
        raise RecordError(f"{folder} is not a data set: it has no {path.name}; name one of its episode files")
    content = read_bytes(path)
    try:
        manifest = orjson.loads(content)
    except orjson.JSONDecodeError as error:
        raise RecordError(f"{path} is not valid JSON: {error}") from error
    if not isinstance(manifest, dict) or manifest.get("format") != DATASET_FORMAT:
        raise RecordError(f"{path} is not a {DATASET_FORMAT} manifest")
    version = manifest.get("version")
    if not isinstance(version, int) or not 1 <= version <= SHARDED_VERSION:
        raise RecordError(
            f"{path} was written by version {shown(version)}, this sonata2d reads up to {SHARDED_VERSION};"
            " upgrade sonata2d"
        )
    digest = hashlib.blake2b(content, digest_size=16).digest()
    if digest not in _valid:  # the manifests of shards are read again and again
        fault = _first_fault(manifest)
        if fault is not None:
            raise RecordError(f"{path} is not a valid manifest: {fault}")
        _valid.add(digest)
    return manifest


def _first_fault(manifest: JsonDict) -> str | None:
    """The first violation of the schema in a manifest; None if there is none.

    Rows are validated in blocks: the objects that pydantic makes of a million rows take gigabytes.
    """
    from pydantic import TypeAdapter, ValidationError

    rows: Any = manifest.get("files")
    start = 0
    is_long = isinstance(rows, list) and len(rows) > _BLOCK
    try:
        model = ShardedManifest if manifest["version"] == SHARDED_VERSION else Manifest
        model.model_validate_json(orjson.dumps(manifest | {"files": []} if is_long else manifest))
        adapter = TypeAdapter(list[ManifestFile])
        for start in range(0, len(rows), _BLOCK) if is_long else ():
            adapter.validate_json(orjson.dumps(rows[start : start + _BLOCK]))
    except orjson.JSONEncodeError:
        return "its values are nested too deeply"
    except ValidationError as error:
        first = error.errors(include_url=False, include_context=False)[0]
        keys = first["loc"]
        if isinstance(keys[0], int):  # of a row in a block
            keys = "files", start + keys[0], *keys[1:]
        return f"{'.'.join(map(str, keys)):.200}: {first['msg']:.200}"
    return None
