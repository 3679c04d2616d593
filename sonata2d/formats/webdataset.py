"""`webdataset`: tar files of arrays, which WebDataset and Hugging Face `datasets` stream into training.

A sample is an episode of T frames, N pedestrians, W walls, O objects and K interactions:

| file | shape | content |
| --- | --- | --- |
| `json` | | scalars: outcome, family, seed, episode, frames, dt, context, task |
| `time.npy` | T | s |
| `robot.npy` | T, 6 | x, y, theta, vx, vy, omega |
| `goal.npy` | T, 3 | x, y, theta |
| `humans.npy` | T, N, 7 | x, y, theta, vx, vy, omega, head; NaN where absent |
| `command.npy`, `executed.npy` | T, 3 | vx, vy, omega in the robot's frame |
| `walls.npy` | W, 4 | x and y of both ends |
| `objects.npy` | O, 6 | x, y, theta, length, width, 1 for a disc |
| `human_ids.npy`, `object_ids.npy` | N; O | ids, as interactions have them |
| `interactions.npy` | K, 4 | frame, id, number in `sonata2d.core.relations.RELATIONS`, id |

Numbers are float32; ids and interactions int64. Source: WebDataset, https://github.com/webdataset/webdataset.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
import orjson

from ..core.files.archives import npy_bytes
from ..core.files.locations import delete, file_names, make_folder
from ..core.geometry import Disc
from ..core.relations import RELATIONS
from ..datasets.manifest.names import part_path, shard_name, shard_number
from ..errors import RecordError
from ..metrics.words import instruction
from ..record.layout import HUMAN_NAMES
from ..record.record import EpisodeRecord
from ..record.shard_file import ShardWriter
from .format import ROBOT_OPTIONS, Format, Options, Tables, require_task

NAME = "webdataset"


@dataclass(frozen=True, slots=True)
class _Sample:
    """An episode, as workers send it: its key, and its files by their names after the key."""

    key: str
    files: dict[str, bytes]


def pack(record: EpisodeRecord, key: str, options: Options) -> _Sample:
    """The files of an episode.

    Args:
        record: the episode.
        key: its name.
        options: not used.

    Raises:
        UnsuitableEpisode: robot, commands or goal were not recorded.
    """
    require_task(record, NAME)
    scene, count = record.scene(), len(record)
    scalars = {
        "outcome": record.outcome.status, "family": record.family, "seed": record.seed,
        "episode": record.document["episode"], "frames": count, "dt": scene.rules.dt,
        "context": record.context or "", "task": instruction(scene).text,
    }  # fmt: skip
    poses = [(piece.pose, piece.shape) for piece in scene.furniture]
    arrays: dict[str, tuple[Any, tuple[int, ...]]] = {
        "time": (record.time, (-1,)), "robot": (record.robot, (-1, 6)), "goal": (record.goals[:count], (-1, 3)),
        "humans": (record.states.humans[:count], (count, len(scene.humans), len(HUMAN_NAMES))),
        "command": (record.command, (-1, 3)), "executed": (record.executed, (-1, 3)),
        "walls": ([(*wall.start, *wall.end) for wall in scene.walls], (-1, 4)),
        "objects": ([(p.x, p.y, p.theta, *shape.sides, isinstance(shape, Disc)) for p, shape in poses], (-1, 6)),
    }  # fmt: skip
    rows = [
        (tick, src, RELATIONS.index(relation), dst)
        for tick, frame in enumerate(record.document["frames"])
        for src, relation, dst in frame["interactions"]
    ]
    files = {"json": orjson.dumps(scalars)}
    files |= {
        f"{name}.npy": npy_bytes(np.array(v, dtype=np.float32).reshape(shape)) for name, (v, shape) in arrays.items()
    }
    integers: dict[str, tuple[Any, tuple[int, ...]]] = {
        "human_ids": ([human.id for human in scene.humans], (-1,)),
        "object_ids": ([piece.id for piece in scene.furniture], (-1,)), "interactions": (rows, (-1, 4)),
    }  # fmt: skip
    files |= {
        f"{name}.npy": npy_bytes(np.array(v, dtype=np.int64).reshape(shape)) for name, (v, shape) in integers.items()
    }
    return _Sample(key, files)


def write(episodes: Iterator[_Sample], out: Path, number: int | None) -> list[Path]:
    """Write a tar file with some episodes.

    Args:
        episodes: see `pack`.
        out: the folder; created if needed.
        number: of the part, whose file is `shard-000007.tar`; None: all episodes are in `shard-000000.tar`.

    Returns:
        The file; none without episodes.

    Raises:
        RecordError: the file cannot be written.
    """
    if out.exists() and not out.is_dir():
        raise RecordError(f"{out} is a file; shards need a folder, choose another name")
    first = next(episodes, None)
    if first is None:
        return []
    make_folder(out)
    path = out / shard_name(number or 0)
    with ShardWriter(path, part_path(path)) as shard:
        for episode in chain((first,), episodes):
            key = episode.key.replace("%", "%25").replace(".", "%2E").replace("/", "__")  # the first dot ends a key
            for name, data in episode.files.items():
                shard.add(f"{key}.{name}", data)
        shard.finish()
    return [path]


def finish(out: Path, parts: int) -> list[Path]:
    """Remove the shards of a former export that this one does not have."""
    kept = {shard_name(number) for number in range(max(parts, 1))}
    for name in file_names(out):
        number = shard_number(name)
        if number is not None and name == shard_name(number) and name not in kept:
            delete(out / name)
    return []


FORMAT = Format(
    "tar files of arrays, to stream into training",
    ".tar",
    tables=Tables(pack, write, finish),
    options=ROBOT_OPTIONS,
)
