"""Data sets of PyTorch, which is imported with this module."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import torch
import torch.utils.data

from ..core.arguments import whole_number
from ..core.entities import Furniture
from ..core.geometry import Disc
from ..core.portable_math import Array
from ..core.relations import RELATIONS
from ..errors import RecordError
from ..record.record import EpisodeRecord
from ..registry import furniture_type


def collate(items: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Make a batch of the items of `Dataset.to_torch`, for `DataLoader(..., collate_fn=...)`.

    Tensors of B episodes with other numbers of frames, pedestrians, walls, objects or interactions are filled up to the
    largest ones: floats by nan, integers by -1, and bools by False.

    Returns:
        The tensors of all items, with B as a first dimension, and `frames` (B,), numbers of frames. A label that an
        item lacks is nan.
    """
    batch = {"frames": torch.tensor([len(item["time"]) for item in items])}
    for name in dict.fromkeys(name for item in items for name in item):
        absent = torch.tensor(math.nan, dtype=torch.float64)  # as labels, which alone may be missing
        parts = [torch.as_tensor(item.get(name, absent)) for item in items]
        dimensions = max(part.ndim for part in parts)
        parts = [part.reshape(part.shape + (1,) * (dimensions - part.ndim)) for part in parts]
        dtype = parts[0].dtype
        filling = math.nan if dtype.is_floating_point else False if dtype == torch.bool else -1
        shape = [max(part.shape[axis] for part in parts) for axis in range(dimensions)]
        batch[name] = torch.full((len(parts), *shape), filling, dtype=dtype)
        for k, part in enumerate(parts):
            batch[name][(k, *map(slice, part.shape))] = part
    return batch


class Samples(torch.utils.data.IterableDataset):  # type: ignore[misc]
    """The items of a stream, see `Stream.to_torch`.

    Args:
        share: the items of one worker: a function of its number, the number of workers and the epoch.
        epoch: number of the first iteration.
    """

    def __init__(self, share: Callable[[int, int, int], Iterator[Any]], epoch: int) -> None:
        self._share = share
        self._epoch = torch.tensor(epoch).share_memory_()  # also for workers that live on

    collate = staticmethod(collate)

    def set_epoch(self, epoch: int) -> None:
        """Set the number of the next iteration."""
        self._epoch.fill_(whole_number("epoch", epoch))

    def __iter__(self) -> Iterator[Any]:
        info = torch.utils.data.get_worker_info()
        worker, workers = (0, 1) if info is None else (info.id, info.num_workers)
        return self._share(worker, workers, int(self._epoch))


class Episodes(torch.utils.data.Dataset):  # type: ignore[misc]
    """The arrays of episodes as tensors, see `Dataset.to_torch`."""

    def __init__(self, dataset: Sequence[EpisodeRecord]) -> None:
        self.dataset = dataset

    def __len__(self) -> int:
        return len(self.dataset)

    def __getitem__(self, index: int) -> dict[str, Any]:
        return tensors(self.dataset[index]) | {"index": index}

    collate = staticmethod(collate)


def tensors(record: EpisodeRecord) -> dict[str, Any]:
    """The arrays of an episode as tensors; see `Dataset.to_torch`."""
    names = ("time", "robot", "humans", "present", "activity", "command", "executed")
    scene = record.scene()
    if scene.moving_doors:
        raise RecordError(f"{record.path}: it has doors that open and close, and the walls of tensors do not move")
    leaves = [door.leaf(door.opening)[:2] for door in scene.interior_doors]
    ids = [*(human.id for human in scene.humans), *(piece.id for piece in scene.furniture)]
    index = {id: k for k, id in enumerate(ids)}
    arrays = {
        "goal": record.goals[0].tolist(),
        "walls": _rows([*((*wall.start, *wall.end) for wall in scene.walls), *((*a, *b) for a, b in leaves)], 4),
        "objects": _rows([_object_row(piece) for piece in scene.furniture], 6),
        "sizes": _rows([(human.radius, human.breadth) for human in scene.humans], 2),
    }
    types = [furniture_type(piece.type).number for piece in scene.furniture]
    links = [
        (tick, index[source], RELATIONS.index(relation), index[destination])
        for tick, frame in enumerate(record.document["frames"])
        for source, relation, destination in frame["interactions"]
    ]
    return {
        **{name: torch.tensor(getattr(record, name)) for name in names},
        **{name: torch.tensor(values, dtype=torch.float64) for name, values in arrays.items()},
        "object_types": torch.tensor(types, dtype=torch.int64),
        "interactions": torch.tensor(links, dtype=torch.int64).reshape(-1, 4),
        **{name: torch.tensor(values) for name, values in _labels(record).items()},
    }


def _rows(rows: list[tuple[float, ...]], width: int) -> Array:
    return np.array(rows, dtype=float).reshape(-1, width)


def _object_row(piece: Furniture) -> tuple[float, ...]:
    pose = piece.pose
    return pose.x, pose.y, pose.theta, *piece.shape.sides, float(isinstance(piece.shape, Disc))


def _labels(record: EpisodeRecord) -> dict[str, Array]:
    """The numbers in the labels of the frames, and in the label of the run, by name.

    A label of several numbers, such as a twist, has a last dimension. A label with texts, or with other numbers of
    values in other frames, is left out.
    """
    frames = [_flat("label", frame.get("label")) for frame in record.document["frames"]]
    found: dict[str, Array] = {}
    for name in dict.fromkeys(name for frame in frames for name in frame):
        values = [_numbers(frame[name]) for frame in frames if name in frame]
        first = values[0]
        if first is not None and all(value is not None and value.shape == first.shape for value in values):
            present, absent = iter(values), np.full(first.shape, math.nan)
            found[name] = np.array([next(present) if name in frame else absent for frame in frames])
    for name, value in _flat("run_label", record.label).items():
        if (numbers := _numbers(value)) is not None:
            found[name] = numbers
    return found


def _numbers(value: Any) -> Array | None:
    """A label as an array; None if it holds something else, or rows of unequal length."""
    try:
        array = np.asarray(value)
    except ValueError:
        return None
    return array.astype(float) if array.dtype.kind in "bfiu" else None


def _flat(name: str, label: Any) -> dict[str, Any]:
    """A label by names, with a dot before each key."""
    if isinstance(label, Mapping):
        return {inner: part for key, value in label.items() for inner, part in _flat(f"{name}.{key}", value).items()}
    return {} if label is None else {name: label}
