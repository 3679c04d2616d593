"""Names of the files of a data set."""

from __future__ import annotations

import re
from pathlib import Path
from uuid import uuid4

from ...core.files.locations import file_names
from ...core.files.whole_file import TEMPORARY_PREFIX
from ...record.shard_file import SHARD_SUFFIX

MANIFEST, SCENARIO, CARD = "manifest.json", "scenario.json", "README.md"
CROISSANT = "croissant.json"  # written by `sonata2d card`
PREVIEW = "preview.png"  # drawn by `sonata2d generate`
METRICS = "metrics.json"  # written by `sonata2d evaluate`
LOG = "run.jsonl"  # of generation runs
LOCK = f"{TEMPORARY_PREFIX}lock"  # held while a data set is generated
FAILED = "failed"  # subfolder for the frames of episodes that ended in an error
PART = ".part-"  # beginning of the names of unfinished shards

_EPISODE = re.compile(r"([0-9]{6,})\.json(?:\.gz|\.zst)?")
_SHARD = re.compile(r"shard-([0-9]{6,})\.(?:tar|manifest\.json|README\.md)")


def is_file_name(name: str) -> bool:
    """Whether a name can be the name of a file in a folder, and does not lead out of it."""
    return name not in ("", ".", "..") and not any(letter in name for letter in "/\\\0")


def episode_number(name: str) -> int | None:
    """The number in the name of a generated episode file; None for other names.

    >>> episode_number("000007.json.gz"), episode_number("0000007.json")
    (7, None)
    """
    return _number(_EPISODE, name)


def shard_number(name: str) -> int | None:
    """The number in the name of a generated shard, or of its manifest or card; None for other names.

    >>> shard_number("shard-000007.tar"), shard_number("shard-7.tar")
    (7, None)
    """
    return _number(_SHARD, name)


def _number(form: re.Pattern[str], name: str) -> int | None:
    match = form.fullmatch(name)
    return int(match[1]) if match and match[1] == f"{int(match[1]):06d}" else None


def shard_name(number: int) -> str:
    """The name of a shard.

    >>> shard_name(7)
    'shard-000007.tar'
    """
    return f"shard-{number:06d}{SHARD_SUFFIX}"


def shard_card_path(shard: Path) -> Path:
    """Path of the card beside a shard."""
    return shard.with_name(f"{shard.name.removesuffix(SHARD_SUFFIX)}.README.md")


def part_path(shard: Path) -> Path:
    """A new path for a shard that is being written: several programs may try to write one shard."""
    return shard.with_name(f"{PART}{uuid4().hex[:8]}-{shard.name}")


def parts_in(folder: Path, shard: str = "") -> list[Path]:
    """The unfinished shards of a folder: all, or only the parts of the named one."""
    return [folder / name for name in file_names(folder) if name.startswith(PART) and name.endswith(shard)]
