"""Reads the episodes of a data set one after another, in a shuffled order that a seed determines."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Executor
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any, Protocol

from ..core.arguments import whole_number
from ..core.files.optional import optional
from ..core.garbage import without_garbage_collection
from ..core.rng import RandomStream
from ..core.wording import shown
from ..errors import DatasetWarning, RecordError
from ..record.reader import read_episodes
from ..record.record import EpisodeRecord
from ..workers.executors import Workers, parallel_map
from ..workers.processes import end_if_unguarded

BLOCK = 64  # episodes that are read together

Transform = Callable[[EpisodeRecord], Iterable[Any]]


class _Episodes(Protocol):
    """A data set, as far as a stream reads it."""

    path: Path
    files: Sequence[Path]


class Stream(Iterable[Any]):
    """The episodes of a data set, or what a function makes of them, read while they are iterated over.

    Only the episodes of a few blocks and the items of the buffer are in memory. Each iteration begins again; its order
    depends on the data set, the buffer, seed, epoch and part, and not on the number of workers.

    Args:
        dataset: its episodes are read, 64 at a time.
        transform: returns or yields any number of samples of an episode, such as `sonata2d.learning.GraphSamples` and
            `sonata2d.gym.EnvSamples`; None: the records themselves.
        shuffle: number of items in the buffer from which the next one is drawn, after the blocks have been shuffled; 0:
            the order of the data set.
        seed: of the shuffled order.
        epoch: number of the iteration over the data set: another one gives another order.
        workers: number of processes that read and transform; or an executor, or workers that several calls share, see
            `sonata2d.Workers`.
        part: (k, n), to read the k-th of n parts of the blocks only, as each of n machines does.

    Attributes:
        epoch: may be set between iterations.

    Raises:
        TypeError, ValueError: an argument is not valid.
    """

    def __init__(
        self,
        dataset: _Episodes,
        transform: Transform | None = None,
        *,
        shuffle: int = 0,
        seed: int = 0,
        epoch: int = 0,
        workers: int | Executor | Workers = 1,
        part: tuple[int, int] = (0, 1),
    ) -> None:
        if transform is not None and not callable(transform):
            raise TypeError(f"transform is a function of a record, got {shown(transform)}")
        self._dataset, self._transform, self._workers = dataset, transform, workers
        self._shuffle, self._seed = whole_number("shuffle", shuffle), whole_number("seed", seed)
        self.epoch = whole_number("epoch", epoch)
        self._part = _valid_part(part)

    def __iter__(self) -> Iterator[Any]:
        """The items of one epoch."""
        blocks = -(-len(self._dataset.files) // BLOCK)
        if self._part[0] >= blocks:
            message = f"part {self._part} is empty: {len(self._dataset.files)} episodes are {blocks} blocks of {BLOCK}"
            warnings.warn(f"{message}; use fewer parts", DatasetWarning, stacklevel=2)
        return self._items(*self._part, self._workers, self.epoch)

    def to_torch(self) -> Any:
        """A `torch.utils.data.IterableDataset`, whose items a `DataLoader` collates.

        The workers of the `DataLoader` share the blocks; the order of the items depends on their number as well, and is
        the same each time. Records become dictionaries of tensors, as of `Dataset.to_torch`.

        Raises:
            RecordError: PyTorch is not installed.
        """
        optional("torch.utils.data", RecordError)
        from .torch_data import Samples

        return Samples(self._worker_items, self.epoch)

    def _worker_items(self, worker: int, workers: int, epoch: int) -> Iterator[Any]:
        """The items of one of several workers of a `DataLoader`, which share the blocks; records as tensors.

        Args:
            worker: number of the worker.
            workers: number of workers.
            epoch: in place of the stream's own.
        """
        number, count = self._part
        items = self._items(number * workers + worker, count * workers, 1, epoch)
        if self._transform is not None:
            return items
        from .torch_data import tensors

        return map(tensors, items)

    def _items(self, number: int, count: int, workers: int | Executor | Workers, epoch: int) -> Iterator[Any]:
        """The items of a part of the blocks, in the order of the epoch."""
        total = len(self._dataset.files)
        starts: Sequence[int] = range(0, total, BLOCK)
        if self._shuffle:
            starts = RandomStream(self._seed, epoch, "order").shuffled(starts)
        part = starts[number::count]
        blocks = (self._dataset.files[start : start + BLOCK] for start in part)
        read = partial(_samples, self._transform)
        end_if_unguarded()
        if workers == 1:  # one episode at a time
            items: Iterator[Any] = chain.from_iterable(map(read, blocks))
        else:
            absolute = ([path.absolute() for path in block] for block in blocks)
            reads = self._dataset.path.absolute()
            results = parallel_map(partial(_listed, read), absolute, workers=workers, total=len(part), reads=reads)
            items = chain.from_iterable(results)
        return self._shuffled(items, RandomStream(self._seed, epoch, "order", number))

    def _shuffled(self, items: Iterator[Any], random: RandomStream) -> Iterator[Any]:
        """The items, each drawn from a buffer of the following items."""
        if self._shuffle < 2:
            yield from items
            return
        buffer: list[Any] = []
        for item in items:
            if len(buffer) < self._shuffle:
                buffer.append(item)
                continue
            k = random.integer(0, len(buffer) - 1)
            yield buffer[k]
            buffer[k] = item
        yield from random.shuffled(buffer)


def _valid_part(part: tuple[int, int]) -> tuple[int, int]:
    try:
        number, count = part
    except (TypeError, ValueError):
        raise TypeError(f"part is a pair (k, n), got {shown(part)}") from None
    whole_number("the number of parts", count, 1)
    if not 0 <= whole_number("the number of the part", number) < count:
        raise ValueError(f"the parts are (0, {count}) to ({count - 1}, {count}), got {part}")
    return number, count


def _samples(transform: Transform | None, files: Sequence[Path]) -> Iterator[Any]:
    """The samples of the episodes of a block, or their records."""
    records = read_episodes(files)
    if transform is None:
        yield from records
        return
    for _ in files:
        with without_garbage_collection():  # until the record is freed, whose many lists would be searched for cycles
            samples = list(transform(next(records)))
        yield from samples


def _listed(read: Callable[[Sequence[Path]], Iterator[Any]], files: Sequence[Path]) -> list[Any]:
    return list(read(files))
