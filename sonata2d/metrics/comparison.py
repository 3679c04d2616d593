"""`evaluate`: runs controllers in the same scenes, or takes recorded episodes, and compares their metrics."""

from __future__ import annotations

import base64
import html
import os
import shutil
import tempfile
import weakref
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from importlib.util import find_spec
from itertools import islice
from pathlib import Path
from typing import Any, cast, overload

from ..agents.controllers.base import Controller
from ..agents.controllers.loading import ControllerSource
from ..core.arguments import whole_number
from ..core.files.locations import is_location, location, make_folder
from ..core.files.optional import optional
from ..core.notebook import ProgressBar, bar_of
from ..core.wording import counted, shown
from ..datasets.dataset import Dataset
from ..datasets.executors import Workers, shared_workers
from ..datasets.generate import generate_dataset
from ..datasets.manifest import MANIFEST, write_json
from ..datasets.processes import end_if_unguarded
from ..datasets.start import unlisted_episodes
from ..errors import ConfigError, MetricError, RecordError, RenderError, Sonata2dError
from ..record.files import safe_texts
from ..registry import did_you_mean
from ..scenegen.scenario.config import ScenarioConfig
from ..scenegen.scenario.load import scenario_of
from . import driving
from .catalogue import headline_metrics, select_metrics
from .definition import Metric
from .measurement import Evaluation, Measured, comparison_rows, comparison_table, measure_files, save_metrics
from .summary import FEW, RESAMPLES

COMPARISON = "evaluation.json"

Subject = str | Controller | type[Controller] | Dataset | Path
Scenario = str | Path | ScenarioConfig


class Comparison(Sequence[Evaluation]):
    """The evaluations of several controllers or data sets, side by side.

    `comparison[0]` and `comparison["orca"]` are evaluations; `print(comparison)` prints the table of the command
    `sonata2d evaluate`, and a notebook shows it with a plot.

    Attributes:
        evaluations: one for each controller or data set, in the given order; differences are to the first one.
        datasets: their episodes by label. Those that `evaluate` has generated without `out` are deleted when neither
            this object nor a data set of it is referred to any more.
        metrics: of the table, the plot and the page.
    """

    def __init__(self, sources: Mapping[str, Sequence[Dataset]], evaluations: Sequence[Evaluation],
                 metrics: Sequence[Metric], *, is_selected: bool) -> None:  # fmt: skip
        self._sources = {label: tuple(own) for label, own in sources.items()}
        self._is_selected = is_selected  # rather than the default metrics, to which a page adds some
        self.evaluations = tuple(evaluations)
        self.metrics = tuple(metrics)
        self.datasets = {label: _combined(own) for label, own in self._sources.items()}

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
        found = next((one for one in self.evaluations if one.label == index), None)
        if found is None:
            hint = did_you_mean(index, self.datasets) or f"; the labels are {', '.join(self.datasets)}"
            raise KeyError(f"no evaluation has the label {index!r}{hint}")
        return found

    def __repr__(self) -> str:
        own = ", ".join(f"{one.label} ({counted(len(one.episodes), 'episode')})" for one in self.evaluations)
        return f"<Comparison of {own}>"

    def __str__(self) -> str:
        """The table: a row for each metric, with mean and 95 % bootstrap interval of each evaluation, and notes."""
        return "\n".join([self.table(), *self.notes()])

    def table(self) -> str:
        """The table without notes."""
        return "\n".join(comparison_table(self.evaluations, self.metrics))

    def notes(self) -> list[str]:
        """What the reader of the table should know: numbers of episodes, scenes in common, episodes without success."""
        first, others = self.evaluations[0], self.evaluations[1:]
        counts = ", ".join(f"{counted(len(one.episodes), 'episode')} of {one.label}" for one in self.evaluations)
        mark = "; * significant difference from the first, in the common scenes" if others else ""
        notes = [f"{counts}; mean [95 % bootstrap interval]{mark}"]
        if any(one.scenes != first.scenes for one in others):
            common = ", ".join(f"{len(one.scenes & first.scenes)} of {one.label}" for one in others)
            notes.append(f"differences are over the scenes in common with {first.label}: {common}")
        for one in self.evaluations if others else ():
            failed = sum(not episode.values.get("success") for episode in one.episodes)
            if failed:
                episodes = f"{counted(failed, 'episode')} of {len(one.episodes)}"
                notes.append(f"means of {one.label} include {episodes} without success")
        few = min(len(one.episodes) for one in self.evaluations)
        if few < FEW:
            notes.append(f"intervals of fewer than {FEW} episodes are too narrow")
        for one in self.evaluations:
            stopped = sum(episode.outcome == "stopped" for episode in one.episodes)
            if stopped:
                number = counted(stopped, "episode")
                notes.append(f"{number} of {one.label} stopped before the end; counted as without success")
            # path_length and others are defined in every episode with a robot
            if not any(value is not None for episode in one.episodes for value in episode.values.values()):
                notes.append(f"{one.label}: no metric is defined, because imported tracks have no robot")
        return notes

    def to_json(self) -> dict[str, Any]:
        """All evaluations, and the differences of each from the first, as a JSON object."""
        first = self.evaluations[0]
        names = next((list(one.episodes[0].values) for one in self.evaluations if one.episodes), [])
        return {
            "evaluations": [{"label": one.label, **one.to_json()} for one in self.evaluations],
            "differences": [
                {"of": one.label, "from": first.label} | {name: one.difference(first, name).to_json() for name in names}
                for one in self.evaluations[1:]
            ],
        }

    def to_pandas(self) -> Any:
        """All metrics of every episode, as a `pandas.DataFrame` with a row for each episode.

        Its first columns are `label`, `file`, `name` and `family` of the scenario, `seed`, `episode` and `outcome`;
        metrics that are not defined are NaN.

        Raises:
            MetricError: pandas is not installed.
        """
        return optional("pandas", MetricError).DataFrame(self._columns())

    def to_polars(self) -> Any:
        """The table of `to_pandas` as a `polars.DataFrame`; metrics that are not defined are null."""
        return optional("polars", MetricError).DataFrame(self._columns(), strict=False)

    def save(self, path: str | Path, *, progress: bool | ProgressBar | None = None) -> None:
        """Write the comparison into a file, whose suffix selects the format.

        `.html` is a page with outcomes, tables, plots, and film strips of the best and the worst episodes; `.png`,
        `.pdf` and `.svg` are a plot of means and intervals, which needs matplotlib; `.json` has all numbers.

        Args:
            path: of the file.
            progress: of a page, as for `evaluate`.

        Raises:
            RenderError: the suffix is unknown, matplotlib is not installed, or the plot cannot be written.
            RecordError: an episode file cannot be read, or the page or the numbers cannot be written.
        """
        from .page import save_page
        from .plots import SUFFIXES

        path, suffix = location(path), location(path).suffix.lower()
        make_folder(path.parent)
        if suffix in (".html", ".htm"):
            with bar_of(progress)(len(self), "film strips") as advance:
                save_page(path, self.evaluations, self._files(), self._page_metrics(), advance)
        elif suffix == ".json":
            write_json(path, self.to_json())
        elif suffix in SUFFIXES:
            self._plot(path)
        else:
            raise RenderError(f"{path}: the name must end in .html, {', '.join(SUFFIXES)} or .json")

    def show(self) -> None:
        """Show the page of `save`: below a cell of a notebook, else in a browser.

        Raises:
            RenderError: there is neither a notebook nor a browser.
            RecordError: an episode file cannot be read.
        """
        from ..view.notebook_views import show_page
        from .page import page_of

        show_page(page_of(self.evaluations, self._files(), self._page_metrics()), height=800)

    def save_metrics(self, labels: Iterable[str] | None = None) -> None:
        """Write `metrics.json` into the folder of each data set; parts of data sets and other files get none.

        Args:
            labels: of the evaluations; None: all.

        Raises:
            RecordError: a file cannot be written.
        """
        wanted = set(self._sources) if labels is None else set(labels)
        for evaluation, own in zip(self.evaluations, self._sources.values(), strict=True):
            if evaluation.label not in wanted:
                continue
            remaining = iter(evaluation.episodes)  # in the order of the data sets
            for dataset in own:
                measured = list(islice(remaining, len(dataset)))
                is_whole = dataset.manifest is not None and len(dataset) == len(dataset.manifest["files"])
                if is_whole:
                    save_metrics(dataset.path, Evaluation(dataset.path.name, measured, evaluation.resamples))

    def _repr_html_(self) -> str:
        """The table, its notes and the plot, which notebooks show."""
        heading, *rows = comparison_rows(self.evaluations, self.metrics)
        lines = [_row("th", heading), *(_row("td", row) for row in rows)]
        notes = "".join(f"<li>{html.escape(note)}</li>" for note in self.notes())
        picture = ""
        if find_spec("matplotlib") is not None:
            with tempfile.TemporaryDirectory(prefix="sonata2d-") as folder:
                path = Path(folder) / "plot.png"
                try:
                    self._plot(path)
                    data = base64.b64encode(path.read_bytes()).decode()
                    picture = (
                        f'<img src="data:image/png;base64,{data}" alt="means and intervals of the metrics" '
                        'style="max-width: 100%; background: #fff"/>'
                    )
                except RenderError:  # no metric is defined, as for imported tracks; the notes say so
                    pass
        return (
            f'<strong>Comparison</strong><div style="overflow-x: auto"><table>{"".join(lines)}</table></div>'
            f"<ul>{notes}</ul>{picture}"
        )

    def _plot(self, path: Path) -> None:
        from .plots import chart

        scenarios = ", ".join(sorted({episode.name for one in self.evaluations for episode in one.episodes}))
        counts = " or ".join(map(str, sorted({len(one.episodes) for one in self.evaluations})))
        title = (
            f"{scenarios}: {counts} episodes each; shares with 95 % Wilson intervals; means with bootstrap intervals"
        )
        chart(path, self.evaluations, self.metrics, title=title)

    def _files(self) -> list[Sequence[Path]]:
        return [dataset.files for dataset in self.datasets.values()]

    def _page_metrics(self) -> tuple[Metric, ...] | None:
        return self.metrics if self._is_selected else None

    def _columns(self) -> dict[str, list[Any]]:
        columns: dict[str, list[Any]] = {}
        for evaluation in self.evaluations:
            for episode in evaluation.episodes:
                facts = {name: getattr(episode, name) for name in _FACTS}
                for name, value in ({"label": evaluation.label} | facts | episode.values).items():
                    columns.setdefault(name, []).append(value)
        return columns


_FACTS = ("file", "name", "family", "seed", "episode", "outcome")  # columns of tables, before those of the metrics


def evaluate(
    subjects: Subject | Sequence[Subject] | Mapping[str, Subject],
    scenario: Scenario | Sequence[Scenario] = "sonata-2020",
    *,
    episodes: int = 20,
    seed: int = 0,
    workers: int | Executor | Workers = 1,
    out: str | Path | None = None,
    metrics: str | Sequence[str] = (),
    rerun: bool = True,
    resamples: int = RESAMPLES,
    progress: bool | ProgressBar | None = None,
) -> Comparison:
    """Run controllers in the same scenes and compare them, or evaluate recorded episodes.

    Args:
        subjects: what is evaluated, one or several; a mapping gives them labels. A controller is a name as on the
            command line, a class, or an object; it is run. Recorded episodes are a `Dataset`, or the `pathlib.Path` of
            a data set or an episode.
        scenario: of the scenes in which controllers run: settings, the name of a preset, or the path of a scenario
            file; or several.
        episodes: number of episodes for each controller and scenario.
        seed: seed of the scenes, the same for all controllers.
        workers: number of processes; or an executor, or workers that several calls share, see `sonata2d.Workers`. With
            several processes, a script must guard its entry point by `if __name__ == "__main__":`.
        out: folder for the episodes of the controllers, a data set for each controller and scenario; the same call
            continues them. None: a temporary folder, which is deleted with the result and its data sets.
        metrics: one or several names of metrics to show, or `all`, or a program whose variants are shown, `socnavgym`;
            empty: the main metrics. All metrics are computed in any case.
        rerun: also run each seed without a robot, for the metrics of its effect on people.
        resamples: number of resamples of the bootstrap, 100 or more.
        progress: whether to show progress bars; None: in a notebook. Or a function of a number of items and their name
            that returns a context manager, which gives a callback for the number of newly finished items.

    Returns:
        The evaluations, with tables, plots and pages.

    Raises:
        ConfigError: there is no such scenario, its file is invalid, or two have the same name.
        ControllerError: a controller cannot be created, or an error ended an episode.
        MetricError: there is no such metric, or one fails.
        RecordError: there are no episodes to evaluate, a file cannot be read, or `out` cannot be used.
        SceneError: a scene cannot be generated.
        WorkerError: a worker crashed, was killed, or has other software.
        TypeError: a subject, a label or a number is something else.
        ValueError: there is no subject or no scenario, two subjects have the same label, or a number is out of range.

    Example:
        >>> import sonata2d as s2
        >>> comparison = s2.evaluate(["straight-to-goal", s2.Orca], "empty", episodes=2, metrics=["success"])
        >>> comparison["Orca"].summary("success").mean
        1.0
    """
    end_if_unguarded()
    selected = select_metrics([metrics] if isinstance(metrics, str) else metrics) if metrics else headline_metrics()
    given = _labelled(subjects)
    scenarios = scenario if isinstance(scenario, Sequence) and not isinstance(scenario, str) else [scenario]
    configs = [scenario_of(one) for one in scenarios]
    if not configs:
        raise ValueError("there is no scenario to run the controllers in")
    twice = [name for name, count in Counter(config.name for config in configs).items() if count > 1]
    if twice:
        raise ConfigError(f"two scenarios have the name {twice[0]!r}; give them different names")
    episodes, seed = whole_number("episodes", episodes, 1), whole_number("seed", seed)
    resamples = whole_number("resamples", resamples, 100)
    shared = shared_workers(workers)
    has_controllers = any(not isinstance(subject, Dataset) for subject in given.values())
    if out is not None and not has_controllers:
        raise ValueError(f"out={str(out)!r} is for the episodes of controllers, and only recorded episodes are given")
    bar = bar_of(progress)
    folder = _TemporaryFolder() if out is None and has_controllers else None
    root = folder.path if folder is not None else location(out or ".")
    with shared as pool:
        sources = _sources(given, configs, root, episodes, seed, pool, bar, folder)
        evaluations = _measured(sources, pool, bar, rerun=rerun, resamples=resamples)
    if not metrics:  # of runs that people drove in a browser, how late they saw the world
        selected += tuple(metric for metric in driving.METRICS if any(one.values(metric.name) for one in evaluations))
    comparison = Comparison(sources, evaluations, selected, is_selected=bool(metrics))
    if out is not None:
        write_json(root / COMPARISON, comparison.to_json())
        comparison.save_metrics(label for label, subject in given.items() if not isinstance(subject, Dataset))
    return comparison


class _TemporaryFolder:
    """A folder that is deleted when no data set in it is referred to any more."""

    def __init__(self) -> None:
        self.path = Path(tempfile.mkdtemp(prefix="sonata2d-"))
        weakref.finalize(self, _delete, self.path, os.getpid())


def _delete(folder: Path, process: int) -> None:
    if os.getpid() == process:  # and not in a copy of the process, which would delete what the original needs
        shutil.rmtree(folder, ignore_errors=True)


def _labelled(subjects: Subject | Sequence[Subject] | Mapping[str, Subject]) -> dict[str, Any]:
    """What is evaluated by label: data sets, and controllers, which can be created.

    Raises:
        RecordError, ControllerError, TypeError, ValueError: as for `evaluate`.
    """
    if isinstance(subjects, Mapping):
        pairs = list(subjects.items())
    else:
        is_one = isinstance(subjects, str | Dataset) or not isinstance(subjects, Sequence)
        several: Sequence[Subject] = [subjects] if is_one else subjects  # type: ignore[list-item,assignment]
        pairs = [(_label_of(subject), subject) for subject in several]
    if not pairs:
        raise ValueError("there is nothing to evaluate: give controllers or data sets")
    labels = [label for label, _ in pairs]
    wrong = next((label for label in labels if not isinstance(label, str) or not label), None)
    if wrong is not None:
        raise TypeError(f"a label is a text that is not empty, got {shown(wrong)}")
    twice = next((label for label in labels if labels.count(label) > 1), None)
    if twice is not None:
        raise ValueError(f"two subjects have the label {twice!r}; name them: evaluate({{'slow': …, 'fast': …}})")
    found = {label: Dataset(cast(Path, subject)) if is_location(subject) else subject for label, subject in pairs}
    for label, dataset in found.items():
        if isinstance(dataset, Dataset):
            _require_episodes(label, dataset)
        else:
            _create(dataset)
    return found


def _label_of(subject: Subject) -> str:
    if isinstance(subject, str):
        return subject
    if isinstance(subject, Dataset):
        return str(subject.path)
    if is_location(subject):
        return str(subject)
    return subject.__name__ if isinstance(subject, type) else type(subject).__name__


def _create(controller: Any) -> None:
    """Create a controller before any episode is generated, so that an error costs no time."""
    try:
        ControllerSource(controller).create()
    except TypeError as error:
        raise TypeError(f"{error}; recorded episodes are a sonata2d.Dataset or a pathlib.Path") from None
    except Sonata2dError as error:
        if isinstance(controller, str) and Path(controller).is_dir():
            error.add_note(f"recorded episodes are evaluated with Dataset({shown(controller)})")
        raise


def _require_episodes(label: str, dataset: Dataset) -> None:
    """Raise RecordError for a data set without episodes: there is nothing to evaluate."""
    if len(dataset):
        return
    reason = unlisted_episodes(dataset.path, dataset.manifest) if dataset.manifest else ""
    raise RecordError(f"{label} lists no episodes{reason and f': {reason}'}")


def _sources(
    given: Mapping[str, Any],
    configs: Sequence[ScenarioConfig],
    root: Path,
    episodes: int,
    seed: int,
    pool: Workers,
    bar: ProgressBar,
    folder: _TemporaryFolder | None,
) -> dict[str, list[Dataset]]:
    """The data sets by label: those that are given, and those that are generated, or continued, with the controllers.

    Raises:
        Sonata2dError: as of `generate_dataset`; its note says how to keep or continue the episodes.
    """
    labels = [label for label, subject in given.items() if not isinstance(subject, Dataset)]
    if labels and (root / MANIFEST).exists():
        raise RecordError(f"{root} is a data set; choose a folder for the data sets of the controllers")
    folders = dict(zip(labels, safe_texts(labels), strict=True))
    places = safe_texts([config.name for config in configs])
    sources: dict[str, list[Dataset]] = {}
    for label, subject in given.items():
        if isinstance(subject, Dataset):
            sources[label] = [subject]
            continue
        sources[label] = []
        for config, place in zip(configs, places, strict=True):
            path = root / folders[label] / place
            try:
                with bar(episodes, f"episodes of {label}") as advance:
                    dataset = generate_dataset(
                        path, config, subject, episodes=episodes, seed=seed, workers=pool,
                        resume=(path / MANIFEST).exists(), progress=False, advance=advance,
                    )  # fmt: skip
            except Sonata2dError as error:  # with other remedies than those of `generate_dataset`
                if isinstance(error, RecordError) and "; repeat the options" in str(error):
                    text = str(error).partition("; repeat the options")[0]
                    raise RecordError(f"{text}; choose another folder for the evaluation") from error
                is_kept = folder is None
                keep = "keep the complete episodes with --output DIR (out=DIR)"
                error.__notes__ = ["run the same evaluation again to continue" if is_kept else keep]
                raise
            dataset.keeps(folder)
            sources[label].append(dataset)
    return sources


def _measured(
    sources: Mapping[str, Sequence[Dataset]], pool: Workers, bar: ProgressBar, *, rerun: bool, resamples: int
) -> list[Evaluation]:
    """The evaluation of each label."""
    files = {label: [file for dataset in own for file in dataset.files] for label, own in sources.items()}
    every = [file for own in files.values() for file in own]
    with bar(len(every), "episodes measured") as advance:
        # all in one call: the controllers share the runs of their scenes without a robot
        results: Iterator[Measured] = iter(measure_files(every, rerun=rerun, workers=pool, advance=advance))
    return [Evaluation(label, list(islice(results, len(own))), resamples) for label, own in files.items()]


def _combined(datasets: Sequence[Dataset]) -> Dataset:
    """One data set with the episodes of several; the single one itself."""
    if len(datasets) == 1:
        return datasets[0]
    combined = Dataset.of_files(datasets[0].path.parent, (file for one in datasets for file in one.files))
    combined.keeps(tuple(datasets))
    return combined


def _row(tag: str, cells: Sequence[str]) -> str:
    style = ' style="text-align: left; white-space: nowrap; padding: 1px 12px 1px 0"'
    return "<tr>" + "".join(f"<{tag}{style}>{html.escape(cell)}</{tag}>" for cell in cells) + "</tr>"
