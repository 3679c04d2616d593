"""Data sets of PyTorch, which is imported with this module."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Protocol

import torch
import torch.utils.data

from ..core.arguments import whole_number
from ..record.record import EpisodeRecord


class _Stream(Protocol):
    """A stream whose blocks the workers of a `DataLoader` share."""

    epoch: int

    def share(self, worker: int, workers: int, epoch: int) -> Iterator[Any]:
        """The items of one worker."""


class _Records(Protocol):
    """A sequence of records."""

    def __len__(self) -> int:
        """Number of records."""

    def __getitem__(self, index: int, /) -> EpisodeRecord:
        """A record."""


class Samples(torch.utils.data.IterableDataset):  # type: ignore[misc]
    """The items of a stream, see `Stream.to_torch`."""

    def __init__(self, stream: _Stream) -> None:
        self._stream = stream
        self._epoch = torch.tensor(stream.epoch).share_memory_()  # also for workers that live on

    def set_epoch(self, epoch: int) -> None:
        """Set the number of the next iteration."""
        self._epoch.fill_(whole_number("epoch", epoch))

    def __iter__(self) -> Iterator[Any]:
        info = torch.utils.data.get_worker_info()
        worker, workers = (0, 1) if info is None else (info.id, info.num_workers)
        return self._stream.share(worker, workers, int(self._epoch))


class Episodes(torch.utils.data.Dataset):  # type: ignore[misc]
    """The arrays of episodes as tensors, see `Dataset.to_torch`."""

    def __init__(self, dataset: _Records) -> None:
        self.dataset = dataset

    def __len__(self) -> int:
        return len(self.dataset)

    def __getitem__(self, index: int) -> dict[str, Any]:
        return tensors(self.dataset[index]) | {"index": index}


def tensors(record: EpisodeRecord) -> dict[str, Any]:
    """The arrays of an episode as tensors; see `Dataset.to_torch`."""
    names = ("time", "robot", "humans", "present", "activity", "command")
    return {name: torch.tensor(getattr(record, name)) for name in names}
