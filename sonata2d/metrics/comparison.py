"""Evaluations side by side: their table, notes, numbers and page."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import islice
from pathlib import Path
from typing import Any, overload

from ..core.files.locations import is_read_only, location, make_folder
from ..core.files.optional import optional
from ..core.notebook import Advance, ProgressBar, bar_of
from ..core.wording import counted
from ..datasets.dataset import Dataset
from ..datasets.manifest import write_json
from ..errors import MetricError, RenderError
from ..record.files import write_atomically
from ..registry import did_you_mean
from .definition import ARROWS, Metric
from .evaluation import MARK, VERSIONS, Evaluation
from .measurement import save_metrics
from .summary import FEW
from .templates import render

_FACTS = ("file", "name", "family", "seed", "episode", "outcome")  # columns of tables, before the metrics


class Comparison(Sequence[Evaluation]):
    """The evaluations of several controllers or data sets, side by side.

    `comparison[0]` and `comparison["orca"]` are evaluations; `print(comparison)` prints the table of the command
    `sonata2d evaluate`, and a notebook shows it with a plot.

    Attributes:
        evaluations: one for each controller or data set, in the given order; differences are to the first one.
        datasets: their episodes by label. Data sets that `evaluate` has generated without `out` are deleted when
            neither this object nor a data set of it is referred to any more.
        metrics: of the table, the plot and the page.
    """

    def __init__(self, sources: Mapping[str, Sequence[Dataset]], evaluations: Sequence[Evaluation],
                 metrics: Sequence[Metric], *, is_selected: bool) -> None:  # fmt: skip
        self._sources = {label: tuple(datasets) for label, datasets in sources.items()}
        self._is_selected = is_selected  # rather than the default metrics, to which a page adds some
        self.evaluations = tuple(evaluations)
        self.metrics = tuple(metrics)
        self.datasets = {label: _combined(datasets) for label, datasets in self._sources.items()}

    def __len__(self) -> int:
        """Number of evaluations."""
        return len(self.evaluations)

    @overload
    def __getitem__(self, index: int | str) -> Evaluation: ...

    @overload
    def __getitem__(self, index: slice) -> tuple[Evaluation, ...]: ...

    def __getitem__(self, index: int | str | slice) -> Evaluation | tuple[Evaluation, ...]:
        """An evaluation, by number or label, or several.

        Raises:
            IndexError, KeyError: there is no such evaluation.
        """
        if not isinstance(index, str):
            return self.evaluations[index]
        for evaluation in self.evaluations:
            if evaluation.label == index:
                return evaluation
        hint = did_you_mean(index, self.datasets) or f"; the labels are {', '.join(self.datasets)}"
        raise KeyError(f"no evaluation has the label {index!r}{hint}")

    def __repr__(self) -> str:
        counts = (f"{each.label} ({counted(len(each.episodes), 'episode')})" for each in self.evaluations)
        return f"<Comparison of {', '.join(counts)}>"

    def __str__(self) -> str:
        """The table: a row for each metric, with mean and 95 % bootstrap interval of each evaluation, and notes."""
        return "\n".join([self.table(), *self.notes()])

    def rows(self) -> list[tuple[str, ...]]:
        """The cells of the table.

        Returns:
            A row of headings, then a row for each metric: name, arrow (which direction is better), unit, and mean with
            confidence interval of each evaluation. `(n=12)` follows where the metric is defined in 12 episodes only,
            and `*` where the value differs significantly from the first evaluation in the common scenes.
        """
        first = self.evaluations[0]
        rows = [("metric", "", "unit", *(each.label for each in self.evaluations))]
        for metric in self.metrics:
            name = metric.name
            cells = (each.text(name) + (MARK if each.differs(first, name) else "") for each in self.evaluations)
            rows.append((name, ARROWS[metric.better], metric.unit, *cells))
        return rows

    def table(self) -> str:
        """The table without notes."""
        rows = self.rows()
        widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
        lines = ("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)) for row in rows)
        return "\n".join(line.rstrip() for line in lines)

    def notes(self) -> list[str]:
        """Remarks on the table: numbers of episodes, scenes in common, episodes without success."""
        first, others = self.evaluations[0], self.evaluations[1:]
        counts = ", ".join(f"{counted(len(each.episodes), 'episode')} of {each.label}" for each in self.evaluations)
        mark = f"; {MARK} significant difference from the first, in the common scenes" if others else ""
        notes = [f"{counts}; mean [95 % bootstrap interval]{mark}"]
        if any(each.scenes != first.scenes for each in others):
            common = ", ".join(f"{len(each.scenes & first.scenes)} of {each.label}" for each in others)
            notes.append(f"differences are over the scenes in common with {first.label}: {common}")
        for each in self.evaluations if others else ():
            failed = sum(not episode.values.get("success") for episode in each.episodes)
            if failed and not each.lacking("success"):
                episodes = f"{counted(failed, 'episode')} of {len(each.episodes)}"
                notes.append(f"means of {each.label} include {episodes} without success")
        if min(len(each.episodes) for each in self.evaluations) < FEW:
            notes.append(f"intervals of fewer than {FEW} episodes are too narrow")
        for each in self.evaluations:
            # the outcome of an imported episode is a placeholder
            stopped = sum(episode.outcome == "stopped" for episode in each.episodes if "outcome" not in episode.lacks)
            if stopped:
                number = counted(stopped, "episode")
                notes.append(f"{number} of {each.label} stopped before the end; counted as without success")
            if "robot" in each.lacking("path_length"):
                notes.append(f"{each.label}: no metric is defined, because imported tracks have no robot")
        return notes

    def to_json(self) -> dict[str, Any]:
        """Versions, all evaluations, and the differences of each from the first, as a JSON object."""
        first, others = self.evaluations[0], self.evaluations[1:]
        names = next((list(each.episodes[0].values) for each in self.evaluations if each.episodes), [])
        return {
            **VERSIONS,
            "evaluations": [{"label": each.label, **each.to_json()} for each in self.evaluations],
            "differences": [
                {"of": each.label, "from": first.label}
                | {name: each.difference(first, name).to_json() for name in names}
                for each in others
            ],
        }

    def to_pandas(self) -> Any:
        """All metrics of every episode, as a `pandas.DataFrame` with a row for each episode.

        Its first columns are `label`, `file`, `name` and `family` of the scenario, `seed`, `episode` and `outcome`;
        metrics that are not defined are NaN.

        Raises:
            MetricError: pandas is not installed.
        """
        return optional("pandas", MetricError).DataFrame(self._records())

    def to_polars(self) -> Any:
        """The table of `to_pandas` as a `polars.DataFrame`; metrics that are not defined are null."""
        return optional("polars", MetricError).DataFrame(self._records(), infer_schema_length=None)

    def save(self, path: str | Path, *, progress: bool | ProgressBar | None = None) -> None:
        """Write the comparison into a file, whose suffix selects the format.

        `.html` is a page with outcomes, tables, plots, and film strips of the best and the worst episodes; `.json` has
        all numbers.

        Args:
            path: of the file.
            progress: of a page, as for `evaluate`.

        Raises:
            RenderError: the suffix is unknown.
            RecordError: an episode file cannot be read, or the page or the numbers cannot be written.
        """
        path, suffix = location(path), location(path).suffix.lower()
        make_folder(path.parent)
        if suffix in (".html", ".htm"):
            with bar_of(progress)(len(self), "film strips") as advance:
                page = self._page(advance)
            write_atomically(path, page.encode())
        elif suffix == ".json":
            write_json(path, self.to_json())
        else:
            raise RenderError(f"{path}: the name must end in .html or .json")

    def show(self) -> None:
        """Show the page of `save`: below a cell of a notebook, else in a browser.

        Raises:
            RenderError: there is neither a notebook nor a browser.
            RecordError: an episode file cannot be read.
        """
        from ..view.notebook_views import show_page

        show_page(self._page(), height=800)

    def save_metrics(self, labels: Iterable[str] | None = None) -> None:
        """Write `metrics.json` into the folder of each data set; parts of data sets and other files get none.

        Data sets in repositories of Hugging Face get none, either.

        Args:
            labels: of the evaluations; None: all.

        Raises:
            RecordError: a file cannot be written.
        """
        wanted = set(self._sources) if labels is None else set(labels)
        for evaluation, datasets in zip(self.evaluations, self._sources.values(), strict=True):
            remaining = iter(evaluation.episodes)  # in the order of the data sets
            for dataset in datasets if evaluation.label in wanted else ():
                measured = list(islice(remaining, len(dataset)))
                is_whole = dataset.manifest is not None and len(dataset) == len(dataset.manifest["files"])
                if is_whole and not is_read_only(dataset.path):
                    save_metrics(dataset.path, Evaluation(dataset.path.name, measured, evaluation.resamples))

    def _repr_html_(self) -> str:
        """The table and its notes, which notebooks show."""
        return render("comparison.html", rows=self.rows(), notes=self.notes())

    def _page(self, advance: Advance = lambda step: None) -> str:
        from .evaluation_page import page_of  # loads pygame

        files = [dataset.files for dataset in self.datasets.values()]
        return page_of(self.evaluations, files, self.metrics if self._is_selected else None, advance)

    def _records(self) -> list[dict[str, Any]]:
        """The label, the facts and the metrics of each episode."""
        return [
            {"label": each.label} | {name: getattr(episode, name) for name in _FACTS} | episode.values
            for each in self.evaluations
            for episode in each.episodes
        ]


def _combined(datasets: Sequence[Dataset]) -> Dataset:
    """One data set with the episodes of several; the single one itself."""
    if len(datasets) == 1:
        return datasets[0]
    combined = Dataset.of_files(datasets[0].path.parent, (file for dataset in datasets for file in dataset.files))
    combined._owner = tuple(datasets)
    return combined
