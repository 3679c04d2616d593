"""`Dataset`: the episodes of a folder as a sequence that reads them when they are accessed."""

from __future__ import annotations

from array import array
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from itertools import repeat
from pathlib import Path
from typing import Any, SupportsIndex, get_args, overload

from ..core.arguments import whole_number
from ..core.drawable import display
from ..core.files.locations import location
from ..core.files.optional import optional
from ..core.notebook import ProgressBar
from ..core.snapshot import Status
from ..core.wording import counted, shown
from ..errors import RecordError
from ..record.files import episode_key, file_stem
from ..record.layout import JsonDict
from ..record.reader import read_episode, read_episodes
from ..record.record import EpisodeRecord
from ..record.tables import TABLES, tables_of
from ..registry import did_you_mean
from ..workers.executors import Workers
from .manifest.read import has_manifest
from .manifest.rows import Lazy, files_in_manifest, files_of, paths_in, read_stored_manifest, selection
from .stream import BLOCK, Stream, Transform
from .summaries import totals_of
from .transforms.split import FRACTIONS, split_dataset

SHOWN, _PREVIEWED = 12, 4  # episodes of a picture, and beside a table


class Dataset(Sequence[EpisodeRecord]):
    """The episodes of a folder; each is read when it is accessed, and not kept.

    `dataset[3]` is the record of an episode, `dataset["000003"]` the record of a file, `dataset[:10]` a data set again.

    Args:
        path: folder of a data set, or of any episode files, compressed or not; a shard; or one file.

    Attributes:
        path: as given.
        files: of the episodes, in the order of the manifest, or of their names. Files in shards are paths such as
            `demo/shard-000000.tar/000007.json`, which `read_episode` reads.
        manifest: as stored in the folder; None: it has none.

    Raises:
        RecordError: the path does not exist or holds no episode, or its manifest is damaged.

    Warns:
        DatasetWarning: the data set is interrupted.

    Example:
        >>> import sonata2d as s2
        >>> dataset = s2.Dataset("demo")
        >>> len(dataset.filter(outcome="goal")) <= len(dataset)
        True
    """

    def __init__(self, path: str | Path) -> None:
        self.path = location(path)
        self.manifest: JsonDict | None = read_stored_manifest(self.path) if has_manifest(self.path) else None
        files = files_of(self.path) if self.manifest is None else files_in_manifest(self.path, self.manifest)
        self.files: Sequence[Path] = files if isinstance(files, Lazy) else tuple(files)
        self._entries: Sequence[JsonDict] | None = None if self.manifest is None else self.manifest["files"]
        self._owner: object = None  # of a temporary folder, which exists as long as this data set or a part of it

    def __len__(self) -> int:
        """Number of episodes."""
        return len(self.files)

    @overload
    def __getitem__(self, index: SupportsIndex | str) -> EpisodeRecord: ...

    @overload
    def __getitem__(self, index: slice) -> Dataset: ...

    def __getitem__(self, index: SupportsIndex | str | slice) -> EpisodeRecord | Dataset:
        """The record of an episode, by number or by the name of its file; or a part of the data set.

        Raises:
            IndexError, KeyError: there is no such episode.
            RecordError: the file cannot be read.
        """
        if isinstance(index, slice):
            return self._selected(range(len(self))[index])
        if isinstance(index, str):
            matches = [
                file for file in self.files if index in (file_stem(file), file.name, f"{file.parent.name}/{file.name}")
            ]
            if len(matches) > 1:
                raise KeyError(f"{len(matches)} episodes of {self.path} are named {index!r}; give a number")
            if not matches:
                hint = did_you_mean(index, map(file_stem, self.files))
                raise KeyError(f"{self.path} has no episode {index!r}{hint}")
            return read_episode(matches[0])
        if not hasattr(index, "__index__"):
            raise TypeError(f"a data set is indexed by a number, the name of a file, or a slice, got {shown(index)}")
        try:
            file = self.files[index.__index__()]
        except IndexError:
            numbers = f"the numbers are 0 to {len(self) - 1}" if self.files else "it is empty"
            raise IndexError(f"episode {index!r} of {self!r}: {numbers}") from None
        return read_episode(file)

    def __iter__(self) -> Iterator[EpisodeRecord]:
        """The records, each read when its turn comes."""
        for start in range(0, len(self), BLOCK):  # a generator, which refers to this data set
            yield from read_episodes(self.files[start : start + BLOCK])

    def filter(
        self,
        condition: Callable[[EpisodeRecord], object] | None = None,
        *,
        outcome: str | Iterable[str] | None = None,
        family: str | Iterable[str] | None = None,
        contact: bool | None = None,
    ) -> Dataset:
        """The episodes that fulfil all conditions.

        Args:
            condition: a function of a record; all remaining files are read for it.
            outcome: one or several, such as `goal` or `timeout`. With a manifest, no file is read.
            family: one or several; likewise.
            contact: whether the robot touched a person, an object or a wall; likewise.

        Raises:
            RecordError: a file cannot be read.
            TypeError: the condition is not a function.
            ValueError: there is no such outcome.
        """
        if condition is not None and not callable(condition):
            raise TypeError(
                f"a condition is a function of a record, got {shown(condition)}; write outcome=... or family=..."
            )
        wanted = {
            key: {values} if isinstance(values, str) else set(values)
            for key, values in (("outcome", outcome), ("family", family))
            if values is not None
        }
        unknown = wanted.get("outcome", set()) - set(get_args(Status))
        if unknown:
            name = sorted(map(str, unknown))[0]
            raise ValueError(f"no episode has the outcome {name!r}; outcomes are {', '.join(get_args(Status))}")
        numbers: Iterable[int] = range(len(self))
        if wanted or contact is not None:
            numbers = (
                number
                for number, row in enumerate(self._rows())
                if all(row[key] in wanted[key] for key in wanted) and contact in (None, bool(row["contacts"]))
            )
        if condition is not None:
            numbers = (number for number in numbers if condition(read_episode(self.files[number])))
        return self._selected(numbers)

    def split(
        self, fractions: Mapping[str, float] = FRACTIONS, *, seed: int = 0, whole_families: bool = False
    ) -> dict[str, Dataset]:
        """Split the data set by scene, as `sonata2d split`; the parts are written into its manifest.

        Args:
            fractions: relative size of each part, by name; they need not sum to 1.
            seed: seed of the assignment.
            whole_families: keep each family in one part.

        Returns:
            The parts by name, see `parts`.

        Raises:
            RecordError: the folder has no manifest, the data set is damaged, or it has fewer scenes than parts.
            ValueError: a fraction is not positive and finite.
        """
        split_dataset(self.path, fractions, seed=seed, whole_families=whole_families)
        self.manifest = read_stored_manifest(self.path)
        return self.parts

    @property
    def parts(self) -> dict[str, Dataset]:
        """The parts that `split` has written into the manifest, by name, with the episodes of this data set.

        Raises:
            RecordError: the data set is not split.
        """
        split = (self.manifest or {}).get("split")
        if not split or self._entries is None:
            raise RecordError(f"{self.path} is not split; call split()")
        part_of = {name: part for part, names in split.items() for name in names}
        numbers: dict[str, array[int]] = {part: array("q") for part in split}
        for number, row in enumerate(self._entries):
            if row["name"] in part_of:  # an edited manifest may leave episodes out
                numbers[part_of[row["name"]]].append(number)
        return {part: self._selected(members) for part, members in numbers.items()}

    def to_pandas(self, table: str = "frames") -> Any:
        """A table of all episodes as a `pandas.DataFrame`.

        Args:
            table: `episodes`, `frames`, `agents` or `interactions`; they join on `episode_id` and `tick`.

        Raises:
            RecordError: pandas is not installed, or a file cannot be read.
            ValueError: there is no such table.
        """
        return optional("pandas", RecordError).DataFrame(self._columns(table))

    def to_polars(self, table: str = "frames") -> Any:
        """A table of all episodes as a `polars.DataFrame`; see `to_pandas`."""
        return optional("polars", RecordError).DataFrame(self._columns(table), strict=False)

    def to_torch(self) -> Any:
        """A `torch.utils.data.Dataset` of dictionaries of tensors, for a `DataLoader`.

        Item k has the arrays of `dataset[k]`: `time` (T,), `robot` (T, 6), `humans` (T, N, 7), `present` (T, N),
        `activity` (T, N), `command` and `executed` (T, 3); in the world frame `goal` (3,), x, y, theta, `walls` (W, 4),
        x1, y1, x2, y2, and `objects` (O, 6), x, y, theta, length, width and whether it is a disc; `object_types` (O,),
        indices of `core.furniture_types.OBJECT_TYPES`; `sizes` (N, 2), radius and breadth of the pedestrians;
        `interactions` (K, 4), frame, source, index of `core.relations.RELATIONS`, and destination, where sources and
        destinations are the N pedestrians, then the objects; the numbers of the labels, `label` or `label.NAME` (T,) or
        (T, L), nan where a frame has none, and `run_label` or `run_label.NAME`; and `index`, k.

        T, N, W, O and K differ between episodes. The attribute `collate` of the result makes batches:
        `DataLoader(data, batch_size=8, collate_fn=data.collate)`; it fills up with nan, -1 and False.

        Raises:
            RecordError: PyTorch is not installed.
        """
        optional("torch.utils.data", RecordError)
        from .torch_data import Episodes

        return Episodes(self)

    def stream(
        self,
        transform: Transform | None = None,
        *,
        shuffle: int = 0,
        seed: int = 0,
        epoch: int = 0,
        workers: int | Executor | Workers = 1,
        part: tuple[int, int] = (0, 1),
    ) -> Stream:
        """The episodes, or what a function makes of them, read while they are iterated over; for large data sets.

        Args:
            transform: returns or yields any number of samples of an episode; None: the records themselves.
            shuffle: number of items in the buffer from which the next one is drawn; 0: the order of the data set.
            seed: of the shuffled order.
            epoch: number of the iteration: another one gives another order.
            workers: number of processes that read and transform; see `sonata2d.Workers`.
            part: (k, n), to read the k-th of n parts only.

        Returns:
            The stream; its method `to_torch` makes it a data set of PyTorch.

        Raises:
            TypeError, ValueError: an argument is not valid.
        """
        return Stream(self, transform, shuffle=shuffle, seed=seed, epoch=epoch, workers=workers, part=part)

    def save(
        self,
        path: str | Path,
        *,
        count: int = SHOWN,
        fps: float | None = None,
        speed: float | None = None,
        progress: bool | ProgressBar | None = None,
    ) -> None:
        """Draw the first episodes side by side into a file, whose suffix selects the format.

        `.png` and `.svg` are a picture of each episode at its end, with the paths up to it; `.gif` and `.mp4` a film in
        which all begin together; `.html` a page that plays the episode that is chosen, without a connection.

        Args:
            path: of the file.
            count: number of episodes.
            fps: pictures per second of a film; by default 10 for a GIF, 30 for an MP4.
            speed: seconds of the episodes per second of a film; by default 1.
            progress: of a film: whether to show a progress bar; None: in a notebook.

        Raises:
            RenderError: the suffix is unknown, an argument has no effect on the format, there is no episode, or the
                file cannot be written.
        """
        display().save_sheet(*self._sheet(count), path, fps=fps, speed=speed, progress=progress)

    def show(self, *, count: int = SHOWN) -> None:
        """Show the picture that `save` draws: below a cell of a notebook, else in a browser.

        Args:
            count: number of episodes.

        Raises:
            RenderError: there is neither a notebook nor a browser.
        """
        display().show_sheet(*self._sheet(count))

    def animate(self, *, count: int = SHOWN) -> None:
        """Show the page of `save`, which plays the episode that is chosen: below a cell of a notebook, or in a browser.

        Args:
            count: number of episodes.

        Raises:
            RenderError: there is neither a notebook nor a browser, or no episode.
        """
        display().animate_sheet(*self._sheet(count))

    def __repr__(self) -> str:
        return f"<Dataset {self.path}: {counted(len(self), 'episode')}>"

    def _repr_html_(self) -> str:
        """A table and pictures of the first episodes, which notebooks show."""
        facts: dict[str, object] = {"folder": self.path, "episodes": len(self)}
        if self.manifest:
            outcomes, families = Counter[str](), Counter[str]()

            def counted_rows() -> Iterator[Mapping[str, Any]]:
                for row in self._rows():
                    outcomes[row["outcome"]] += 1
                    families[row["family"]] += 1
                    yield row

            contacts = totals_of(counted_rows()).contacts.rows()[0][1]
            facts |= {"outcomes": _listed(outcomes), "contacts": contacts, "families": _listed(families)}
            facts["scenario"] = self.manifest["name"]
        text: str = display().card(type(self).__name__, facts, *self._sheet(_PREVIEWED))
        return text

    @classmethod
    def of_manifest(cls, path: Path, manifest: JsonDict) -> Dataset:
        """The data set of a manifest that has just been written, which is not read again."""
        return cls._of(path, paths_in(path, manifest["files"]), manifest, manifest["files"])

    @classmethod
    def of_files(cls, path: str | Path, files: Iterable[Path]) -> Dataset:
        """A data set of files, also from several folders.

        Args:
            path: a folder that stands for all of them, which is printed.
            files: of the episodes.
        """
        return cls._of(location(path), tuple(files), None, None)

    @classmethod
    def _of(
        cls, path: Path, files: Sequence[Path], manifest: JsonDict | None, entries: Sequence[JsonDict] | None
    ) -> Dataset:
        dataset = object.__new__(cls)
        dataset.path, dataset.files, dataset.manifest = path, files, manifest
        dataset._entries, dataset._owner = entries, None
        return dataset

    def _selected(self, numbers: Iterable[int]) -> Dataset:
        """A data set of some of the episodes."""
        numbers = array("q", numbers)
        files = selection(self.files, numbers)
        entries = None if self._entries is None else selection(self._entries, numbers)
        part = self._of(self.path, files if isinstance(self.files, Lazy) else tuple(files), self.manifest, entries)
        part._owner = self._owner
        return part

    def _rows(self) -> Iterator[Mapping[str, Any]]:
        """Outcome, family, number of frames and contacts of each episode, from the manifest if it lists them."""
        rows: Iterable[JsonDict | None] = repeat(None, len(self)) if self._entries is None else self._entries
        for number, row in enumerate(rows):
            if row is None or "contacts" not in row:
                record = read_episode(self.files[number])
                row = {"outcome": record.outcome.status, "family": record.family, "ticks": len(record)}
                row |= {"contacts": {}} | record.counts()  # an imported episode does not record contacts
            yield row

    def _columns(self, table: str) -> dict[str, list[Any]]:
        """The columns of a table over all episodes."""
        if table not in TABLES:
            raise ValueError(f"there is no table {shown(table)}; the tables are {', '.join(TABLES)}")
        columns: dict[str, list[Any]] = {}
        key = episode_key(self.files)
        for record in self:
            for name, values in tables_of(record, key(record.path))[table].items():
                columns.setdefault(name, []).extend(values.tolist() if hasattr(values, "tolist") else values)
        return columns

    def _sheet(self, count: int) -> tuple[Dataset, list[str]]:
        """The first episodes, and their titles in a picture."""
        whole_number("count", count, 1)
        return self[:count], [file_stem(file) for file in self.files[:count]]


def _listed(counts: Counter[str]) -> str:
    """Values with their counts, the most frequent first: `18 goal, 2 timeout`."""
    return ", ".join(f"{number} {value}" for value, number in counts.most_common())
