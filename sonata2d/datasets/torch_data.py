"""Data sets of PyTorch, which is imported with this module."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import torch
import torch.utils.data

from ..core.arguments import whole_number
from .stream import Stream, tensors

if TYPE_CHECKING:
    from .dataset import Dataset


class Samples(torch.utils.data.IterableDataset):  # type: ignore[misc]
    """The items of a stream, see `Stream.to_torch`.

    Args:
        stream: whose blocks the workers of the `DataLoader` share.
    """

    def __init__(self, stream: Stream) -> None:
        self._stream = stream
        self._epoch = torch.tensor(stream.epoch).share_memory_()  # also that of workers that live on

    def set_epoch(self, epoch: int) -> None:
        """Set the number of the next iteration."""
        self._epoch.fill_(whole_number("epoch", epoch))

    def __iter__(self) -> Iterator[Any]:
        info = torch.utils.data.get_worker_info()
        own, of_all = (0, 1) if info is None else (info.id, info.num_workers)
        return self._stream.share(own, of_all, int(self._epoch))


class Episodes(torch.utils.data.Dataset):  # type: ignore[misc]
    """The arrays of episodes as tensors, see `Dataset.to_torch`.

    Args:
        dataset: the episodes.
    """

    def __init__(self, dataset: Dataset) -> None:
        self.dataset = dataset

    def __len__(self) -> int:
        return len(self.dataset)

    def __getitem__(self, index: int) -> dict[str, Any]:
        return tensors(self.dataset[index]) | {"index": index}
