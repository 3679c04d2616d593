"""Splits a data set into train, dev and test parts that share no scene."""

from __future__ import annotations

import hashlib
from collections import deque
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from functools import partial
from pathlib import Path

import orjson

from ...core.files.locations import location
from ...core.notebook import Advance
from ...errors import RecordError
from ...record.layout import JsonDict, scene_to_json
from ...record.reader import read_episode
from ...record.record import EpisodeRecord
from ...workers.executors import Workers, parallel_map, shared_workers
from ..card.write import write_manifest_and_card, write_tables_as
from ..manifest.rows import ShardRows, read_listed_file, read_shard, read_stored_manifest, warn_if_incomplete
from ..shards import write_shard_manifest
from ..tables import table_name
from .mirror import mirrored

FRACTIONS = {"train": 0.8, "dev": 0.1, "test": 0.1}
Split = dict[str, list[str]]  # file names by part
Unit = tuple[int, ...]  # numbers of episodes, in the manifest, that stay together


def split_dataset(
    folder: str | Path,
    fractions: Mapping[str, float] = FRACTIONS,
    *,
    seed: int = 0,
    whole_families: bool = False,
    workers: int | Executor | Workers = 1,
    advance: Advance = lambda step: None,
) -> Split:
    """Split a data set by scene and scene family, and write the parts into its manifest; the metadata follow.

    All episodes of one scene stay together: mirror images, branches, other controllers and other drivers. By default
    the scenes of each family are distributed in the same proportions; with `whole_families` a family stays in one part,
    so that the test part has rooms that the training part does not contain.

    Args:
        folder: folder of the data set.
        fractions: relative size of each part, by name; they need not sum to 1.
        seed: seed of the assignment.
        whole_families: keep each family in one part.
        workers: number of processes; or an executor, or workers that several calls share, see `sonata2d.Workers`.
        advance: progress callback; its argument is the number of files read.

    Returns:
        File names by part, in the order of the manifest.

    Raises:
        RecordError: the data set is damaged, or it has fewer scenes (or families) than parts.
        ValueError: a fraction is not positive and finite, or the names of two parts differ in punctuation only.
    """
    folder = location(folder)
    if not fractions or any(not 0.0 < fraction < float("inf") for fraction in fractions.values()):
        raise ValueError(f"fractions must be positive, got {dict(fractions)}")
    if len({table_name(part) for part in fractions}) < len(fractions):
        raise ValueError(f"the parts {', '.join(fractions)} would have tables of the same names; rename one")
    manifest = read_stored_manifest(folder)
    warn_if_incomplete(folder, manifest)
    families: dict[str, dict[bytes, list[int]]] = {}  # episodes by family and scene
    family_of_scene: dict[bytes, str] = {}  # a scene of several families counts for the first one
    rows = manifest["files"]
    with shared_workers(workers) as pool:
        place = pool.place(folder)
        scenes = parallel_map(partial(_listed_scene, place), rows, workers=pool, reads=place)
        for number, (scene, row) in enumerate(zip(scenes, rows, strict=True)):
            family = family_of_scene.setdefault(scene, row["family"])
            families.setdefault(family, {}).setdefault(scene, []).append(number)
            advance(1)
    units = _units(families, seed, whole_families)
    if len(units) < len(fractions):
        what = "families" if whole_families else "scenes"
        raise RecordError(f"{folder} has {len(units)} {what}, too few for {len(fractions)} parts; use fewer parts")
    part_of = assign_parts(units, fractions)
    split: Split = {part: [] for part in fractions}
    for number, row in enumerate(rows):
        split[part_of[number]].append(row["name"])
    if isinstance(rows, ShardRows):
        _write_to_shards(folder, rows, split)
    write_manifest_and_card(folder, manifest | {"split": split})
    write_tables_as(folder, [folder], workers)
    return split


def _listed_scene(folder: Path, row: JsonDict) -> bytes:
    """The scene of a listed file."""
    read_listed_file(folder, row)
    return bytes.fromhex(scene_key(read_episode(folder / row["name"])))


def _write_to_shards(folder: Path, rows: ShardRows, split: Split) -> None:
    """Write the parts into the manifests of the shards: each manifest gets the names of its own episodes."""
    waiting = {part: deque(names) for part, names in split.items()}  # in the order of the shards
    for shard in rows.shards:
        prefix = f"{shard['name']}/"
        parts: Split = {part: [] for part in split}
        for part, names in waiting.items():
            while names and names[0].startswith(prefix):
                parts[part].append(names.popleft().removeprefix(prefix))
        write_shard_manifest(folder / shard["name"], read_shard(folder, shard) | {"split": parts})


def scene_key(record: EpisodeRecord) -> str:
    """A hash of the initial scene; independent of mirroring, controller, type of robot and rules."""
    original = mirrored(record) if record.document.get("mirrored_from") else record
    layout = scene_to_json(original.scene())
    poses = [[row["x"], row["y"], row["theta"]] for row in (*layout["humans"], layout["robot"])]
    goal = [layout["goal"]["x"], layout["goal"]["y"]]
    return hashlib.sha256(orjson.dumps([layout["room"], layout["walls"], layout["objects"], poses, goal])).hexdigest()


def assign_parts(units: Sequence[Unit], fractions: Mapping[str, float]) -> dict[int, str]:
    """Assign units one by one to the part that lacks the most files so far; each part gets at least one unit.

    Args:
        units: numbers of episodes that stay together; at least as many units as parts.
        fractions: relative size of each part, by name.

    Returns:
        The part of each episode.
    """
    total = sum(fractions.values())
    assigned, seen = dict.fromkeys(fractions, 0), 0  # number of files per part, and in total
    part_of: dict[int, str] = {}
    for k, unit in enumerate(units):
        seen += len(unit)
        empty = [part for part in fractions if assigned[part] == 0]
        # The last units are reserved for parts that are still empty.
        candidates = empty if len(units) - k <= len(empty) else list(fractions)
        part = max(candidates, key=lambda name: fractions[name] / total * seen - assigned[name])
        assigned[part] += len(unit)
        part_of |= dict.fromkeys(unit, part)
    return part_of


def _units(families: dict[str, dict[bytes, list[int]]], seed: int, whole_families: bool) -> list[Unit]:
    """The units to assign, in an order that depends on the seed, the scenes and the families only."""
    if whole_families:
        files = {
            family: tuple(number for numbers in scenes.values() for number in numbers)
            for family, scenes in families.items()
        }
        # Large families first, so that small ones can even out the sizes of the parts.
        return [
            files[family] for family in sorted(files, key=lambda family: (-len(files[family]), _rank(seed, family)))
        ]
    return [
        tuple(families[family][scene])
        for family in sorted(families)
        for scene in sorted(families[family], key=lambda scene: _rank(seed, scene.hex()))
    ]


def _rank(seed: int, key: str) -> bytes:
    """A pseudo-random sort key, unaffected by other keys."""
    return hashlib.sha256(f"{seed}:{key}".encode()).digest()
