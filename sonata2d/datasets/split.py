"""Train, dev and test: a data set in parts between which no scene is shared."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from pathlib import Path

import orjson

from ..errors import RecordError
from ..record.layout import layout_of
from ..record.reader import read_episode
from ..record.record import EpisodeRecord
from .derived import Advance, listed_bytes, manifest_as_it_stands
from .manifest import MANIFEST, write_tree
from .mirror import mirrored

SHARES = {"train": 0.8, "dev": 0.1, "test": 0.1}
Split = dict[str, list[str]]
Unit = tuple[str, ...]  # names of files that stay together


def split_dataset(
    folder: str | Path,
    shares: Mapping[str, float] = SHARES,
    *,
    seed: int = 0,
    whole_families: bool = False,
    advance: Advance = lambda step: None,
) -> Split:
    """Part a data set by scene family, and write the parts into its manifest.

    Runs of one scene stay together: mirror images, branches, other controllers and other people in it. Each family is
    shared out in the same proportions, or stays whole, so that the test has rooms that training never saw.

    Args:
        folder: a data set.
        shares: how much of the files each part shall have, by name; they are taken as proportions.
        seed: another one gives another split.
        whole_families: keep each family in one part.
        advance: is told how many files are read, as they are.

    Returns:
        Names of files by part, in the order of the manifest.

    Raises:
        RecordError: the data set is damaged, or has too few scenes or families for so many parts.
        ValueError: a share is not positive.
    """
    folder = Path(folder)
    if not shares or any(not 0.0 < share < float("inf") for share in shares.values()):
        raise ValueError(f"shares must be positive, got {dict(shares)}")
    manifest = manifest_as_it_stands(folder)
    families: dict[str, dict[str, list[str]]] = {}
    home: dict[str, str] = {}  # family of each scene: the first one that it is met in
    for row in manifest["files"]:
        listed_bytes(folder, row)
        scene = scene_key(read_episode(folder / row["name"]))
        families.setdefault(home.setdefault(scene, row["family"]), {}).setdefault(scene, []).append(row["name"])
        advance(1)
    units = _units(families, seed, whole_families)
    if len(units) < len(shares):
        what = "families" if whole_families else "scenes"
        raise RecordError(f"{folder} has {len(units)} {what}, too few for {len(shares)} parts; ask for fewer parts")
    place = dealt(units, shares)
    split: Split = {part: [row["name"] for row in manifest["files"] if place[row["name"]] == part] for part in shares}
    write_tree(folder / MANIFEST, manifest | {"split": split})
    return split


def scene_key(record: EpisodeRecord) -> str:
    """The same for all episodes that start from one scene, mirrored or not: whoever drives, which robot, what rules."""
    original = mirrored(record) if record.document.get("mirrored_from") else record
    layout = layout_of(original.scene())
    places = [[row["x"], row["y"], row["theta"]] for row in (*layout["humans"], layout["robot"])]
    goal = [layout["goal"]["x"], layout["goal"]["y"]]
    return hashlib.sha256(orjson.dumps([layout["room"], layout["walls"], layout["objects"], places, goal])).hexdigest()


def dealt(units: Sequence[Unit], shares: Mapping[str, float]) -> dict[str, str]:
    """The part of each file: each unit goes where most is missing, so far; each part gets one at least.

    Args:
        units: names of files that stay together; at least as many as parts.
        shares: of each part.
    """
    whole = sum(shares.values())
    has, seen = dict.fromkeys(shares, 0), 0
    place: dict[str, str] = {}
    for k, unit in enumerate(units):
        seen += len(unit)
        empty = [part for part in shares if has[part] == 0]
        open_to = empty if len(units) - k <= len(empty) else list(shares)
        part = max(open_to, key=lambda name: shares[name] / whole * seen - has[name])
        has[part] += len(unit)
        place |= dict.fromkeys(unit, part)
    return place


def _units(families: dict[str, dict[str, list[str]]], seed: int, whole_families: bool) -> list[Unit]:
    """What is dealt out, family by family, shuffled by the seed and by nothing else."""
    if whole_families:
        whole = {
            family: tuple(name for names in scenes.values() for name in names) for family, scenes in families.items()
        }
        return [
            whole[family] for family in sorted(whole, key=lambda family: (-len(whole[family]), _draw(seed, family)))
        ]
    return [
        tuple(families[family][scene])
        for family in sorted(families)
        for scene in sorted(families[family], key=lambda scene: _draw(seed, scene))
    ]


def _draw(seed: int, key: str) -> bytes:
    """A number as good as random, which adding other files does not change."""
    return hashlib.sha256(f"{seed}:{key}".encode()).digest()
