"""Writes shards, each with its manifest and card beside it."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import orjson

from ..record.files import write_atomically
from ..record.layout import JsonDict
from ..record.shard_file import ShardWriter, shard_manifest_path
from ..workers.tasks import stop_if_unwanted
from .card.text import card_text
from .manifest.names import part_path, shard_card_path


def write_shard(shard: Path, manifest: JsonDict, members: Iterable[tuple[JsonDict, bytes]]) -> JsonDict:
    """Write a shard of episodes that exist.

    Args:
        shard: its path.
        manifest: of the shard; `files`, and the hash and size in `shard`, are replaced.
        members: rows of the episodes, in order, and their stored bytes.

    Returns:
        The row of the shard in the manifest of its data set.

    Raises:
        RecordError: a file cannot be written; the shard does not appear.
    """
    rows = []
    with ShardWriter(shard, part_path(shard)) as writer:
        for row, data in members:
            rows.append(row | {"offset": writer.add(row["name"], data)})
        stop_if_unwanted()
        file = {"sha256": writer.finish(), "bytes": writer.size}
    manifest = manifest | {"shard": manifest["shard"] | file, "files": rows}
    write_shard_manifest(shard, manifest)
    return shard_row(shard.name, manifest)


def write_shard_manifest(shard: Path, manifest: JsonDict) -> None:
    """Write the manifest of a shard beside it, and its card.

    Raises:
        RecordError: a file cannot be written.
    """
    write_atomically(shard_card_path(shard), card_text(manifest).encode())
    write_atomically(shard_manifest_path(shard), orjson.dumps(manifest, option=orjson.OPT_APPEND_NEWLINE))


def shard_row(name: str, manifest: JsonDict) -> JsonDict:
    """The row of a shard, by its manifest, in the manifest of its data set."""
    return {
        "name": name,
        "sha256": manifest["shard"]["sha256"],
        "bytes": manifest["shard"]["bytes"],
        "episodes": len(manifest["files"]),
        "ticks": sum(row["ticks"] for row in manifest["files"]),
    }
