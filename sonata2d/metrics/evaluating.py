"""`evaluate`: runs controllers in the same scenes, or takes recorded episodes, and compares their metrics."""

from __future__ import annotations

import os
import shutil
import tempfile
import weakref
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Executor
from itertools import islice
from pathlib import Path
from typing import Any, cast

from ..agents.controllers.base import Controller
from ..agents.controllers.loading import ControllerSource
from ..core.arguments import whole_number
from ..core.files.locations import is_location, location
from ..core.notebook import ProgressBar, bar_of
from ..core.wording import shown
from ..datasets.dataset import Dataset
from ..datasets.generate.run import generate_dataset
from ..datasets.manifest import MANIFEST, unlisted_episodes, write_json
from ..errors import ConfigError, RecordError, Sonata2dError
from ..record.files import safe_texts
from ..scenegen.scenario.config import ScenarioConfig
from ..scenegen.scenario.load import scenario_of
from ..workers.executors import Workers, shared_workers
from ..workers.processes import end_if_unguarded
from . import driving, fleet
from .catalogue import headline_metrics, select_metrics
from .comparison import Comparison
from .evaluation import Evaluation, Measured
from .measurement import measure_files
from .summary import RESAMPLES

COMPARISON = "evaluation.json"

Subject = str | Controller | type[Controller] | Dataset | Path
Scenario = str | Path | ScenarioConfig


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
    labelled = _labelled(subjects)
    configs = _configs(scenario)
    episodes, seed = whole_number("episodes", episodes, 1), whole_number("seed", seed)
    resamples = whole_number("resamples", resamples, 100)
    shared = shared_workers(workers)
    controllers = {label: subject for label, subject in labelled.items() if not isinstance(subject, Dataset)}
    if out is not None and not controllers:
        raise ValueError(f"out={str(out)!r} is for the episodes of controllers, but all subjects are recorded episodes")
    bar = bar_of(progress)
    folder = _TemporaryFolder() if out is None and controllers else None
    root = folder.path if folder is not None else location(out or ".")
    with shared as pool:
        generated = _generated(controllers, configs, root, episodes, seed, pool, bar, folder)
        sources = {label: generated.get(label, [subject]) for label, subject in labelled.items()}
        evaluations = _measured(sources, pool, bar, rerun=rerun, resamples=resamples)
    if not metrics:  # of several robots; and of runs that people drove in a browser, how late they saw the world
        rare = (*fleet.METRICS, *driving.METRICS)
        selected += tuple(m for m in rare if any(evaluation.values(m.name) for evaluation in evaluations))
    comparison = Comparison(sources, evaluations, selected, is_selected=bool(metrics))
    if out is not None:
        write_json(root / COMPARISON, comparison.to_json())
        comparison.save_metrics(controllers)
    return comparison


class _TemporaryFolder:
    """A folder that is deleted when no data set in it is referred to any more."""

    def __init__(self) -> None:
        self.path = Path(tempfile.mkdtemp(prefix="sonata2d-"))
        weakref.finalize(self, _delete, self.path, os.getpid())


def _delete(folder: Path, process: int) -> None:
    if os.getpid() == process:  # and not in a copy of the process, which would delete what the original needs
        shutil.rmtree(folder, ignore_errors=True)


def _configs(scenario: Scenario | Sequence[Scenario]) -> list[ScenarioConfig]:
    """The scenarios in which controllers run.

    Raises:
        ConfigError, ValueError: as for `evaluate`.
    """
    scenarios = scenario if isinstance(scenario, Sequence) and not isinstance(scenario, str) else [scenario]
    configs = [scenario_of(each) for each in scenarios]
    if not configs:
        raise ValueError("there is no scenario to run the controllers in")
    if twice := _first_repeated([config.name for config in configs]):
        raise ConfigError(f"two scenarios have the name {twice!r}; give them different names")
    return configs


def _labelled(subjects: Subject | Sequence[Subject] | Mapping[str, Subject]) -> dict[str, Any]:
    """The subjects by label: data sets with episodes, and controllers that can be created.

    Raises:
        RecordError, ControllerError, TypeError, ValueError: as for `evaluate`.
    """
    if isinstance(subjects, Mapping):
        pairs = list(subjects.items())
    else:
        is_single = isinstance(subjects, str | Dataset) or not isinstance(subjects, Sequence)
        several: Sequence[Subject] = [subjects] if is_single else subjects  # type: ignore[list-item,assignment]
        pairs = [(_label_of(subject), subject) for subject in several]
    if not pairs:
        raise ValueError("there is nothing to evaluate: give controllers or data sets")
    labels = [label for label, _ in pairs]
    wrong = next((label for label in labels if not isinstance(label, str) or not label), None)
    if wrong is not None:
        raise TypeError(f"a label is a text that is not empty, got {shown(wrong)}")
    if twice := _first_repeated(labels):
        raise ValueError(f"two subjects have the label {twice!r}; name them: evaluate({{'slow': …, 'fast': …}})")
    labelled = {label: Dataset(cast(Path, subject)) if is_location(subject) else subject for label, subject in pairs}
    for label, subject in labelled.items():
        if isinstance(subject, Dataset):
            _require_episodes(label, subject)
        else:
            _create(subject)
    return labelled


def _first_repeated(names: Sequence[str]) -> str | None:
    return next((name for name in names if names.count(name) > 1), None)


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


def _generated(
    controllers: Mapping[str, Any],
    configs: Sequence[ScenarioConfig],
    root: Path,
    episodes: int,
    seed: int,
    pool: Workers,
    bar: ProgressBar,
    folder: _TemporaryFolder | None,
) -> dict[str, list[Dataset]]:
    """The data sets by label of the controller, one for each scenario; complete ones are kept, others continued.

    Raises:
        Sonata2dError: as of `generate_dataset`; its note says how to keep or continue the episodes.
    """
    if controllers and (root / MANIFEST).exists():
        raise RecordError(f"{root} is a data set; choose a folder for the data sets of the controllers")
    places = safe_texts([config.name for config in configs])
    datasets: dict[str, list[Dataset]] = {}
    for (label, controller), name in zip(controllers.items(), safe_texts(list(controllers)), strict=True):
        datasets[label] = []
        for config, place in zip(configs, places, strict=True):
            path = root / name / place
            try:
                with bar(episodes, f"episodes of {label}") as advance:
                    dataset = generate_dataset(
                        path, config, controller, episodes=episodes, seed=seed, workers=pool,
                        resume=(path / MANIFEST).exists(), progress=False, advance=advance,
                    )  # fmt: skip
            except Sonata2dError as error:  # the remedies of `generate_dataset` do not apply
                text, other_options, _ = str(error).partition("; repeat the options")
                if isinstance(error, RecordError) and other_options:
                    raise RecordError(f"{text}; choose another folder for the evaluation") from error
                keep = "keep the complete episodes with --output DIR (out=DIR)"
                error.__notes__ = [keep if folder else "run the same evaluation again to continue"]
                raise
            dataset._owner = folder
            datasets[label].append(dataset)
    return datasets


def _measured(
    sources: Mapping[str, Sequence[Dataset]], pool: Workers, bar: ProgressBar, *, rerun: bool, resamples: int
) -> list[Evaluation]:
    """The evaluation of each label."""
    files = {label: [file for dataset in datasets for file in dataset.files] for label, datasets in sources.items()}
    all_files = [file for label_files in files.values() for file in label_files]
    with bar(len(all_files), "episodes measured") as advance:
        # all in one call: the controllers share the runs of their scenes without a robot
        results: Iterator[Measured] = iter(measure_files(all_files, rerun=rerun, workers=pool, advance=advance))
    return [
        Evaluation(label, list(islice(results, len(label_files))), resamples) for label, label_files in files.items()
    ]
