"""Data sets of PyTorch, which is imported with this module."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import torch
import torch.utils.data

from ..core.arguments import whole_number
from ..record.record import EpisodeRecord


class Samples(torch.utils.data.IterableDataset):  # type: ignore[misc]
    """The items of a stream, see `Stream.to_torch`.

    Args:
        share: the items of one worker: a function of its number, the number of workers and the epoch.
        epoch: number of the first iteration.
    """

    def __init__(self, share: Callable[[int, int, int], Iterator[Any]], epoch: int) -> None:
        self._share = share
        self._epoch = torch.tensor(epoch).share_memory_()  # also for workers that live on

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


def tensors(record: EpisodeRecord) -> dict[str, Any]:
    """The arrays of an episode as tensors; see `Dataset.to_torch`."""
    names = ("time", "robot", "humans", "present", "activity", "command")
    return {name: torch.tensor(getattr(record, name)) for name in names}
