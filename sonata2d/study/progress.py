"""The progress of a participant: the steps that are done, and the present one."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from ..datasets.manifest import MANIFEST, read_manifest
from ..errors import RecordError
from .answers import FULL, read_answers
from .folder import StudyFolder
from .load import Study
from .plan import SCREENED_OUT, Step, condition_of, steps_of


class Progress:
    """The steps of a participant, and which of them are done.

    Args:
        study: the study.
        index: number of the participant, from 0.
        events: of the participant's file of answers.
        kept: names of the kept runs, by number of the scene.
        row: of the Latin square; None: that of the index.

    Attributes:
        study: the study.
        index: number of the participant.
        steps: all steps, in their order.
        condition: as of `condition_of`.
        language: of the participant.
        has_chosen_language: whether the language was chosen, rather than the first one of the study.
        has_declined: whether the participant did not consent.
        has_finished: whether the end of the study is stored.
        is_screened_out: whether an answer ended the study.
        is_full: whether it did so because its places were taken.
        last_event: time of the last event, ISO 8601; empty before the first.
        external: ids that a panel gave, by name.
    """

    def __init__(
        self,
        study: Study,
        index: int,
        events: Iterable[Mapping[str, Any]] = (),
        kept: Mapping[int, str] | None = None,
        row: int | None = None,
    ) -> None:
        self.study, self.index = study, index
        self.external: dict[str, str] = {}
        self.language, self.has_chosen_language = study.config.languages[0], False
        self.has_declined, self.has_finished, self.last_event = False, False, ""
        self.is_screened_out, self.is_full = False, False
        self._take_row(row)
        self._kept = dict(kept or {})
        self._done: set[str] = set()
        self._logged: set[str] = set()  # files of kept runs that have an event
        self._skipped: set[str] = set()
        self._asked: dict[str, str] = {}  # file of the run that the questions of a step were answered about
        self._replaced: dict[str, int] = {}  # scenes within their blocks that replace the scenes of runs, by step
        for event in events:
            self._apply(event)

    def _take_row(self, row: int | None) -> None:
        """Take the steps of a row of the Latin square; see `run_order`."""
        self.steps = steps_of(self.study.config, self.index, row)
        config, row = self.study.config, self.index if row is None else row
        self.condition = condition_of(config.order, [block.scenario for block in config.runs], row)
        self._runs = {step.run: step for step in self.steps if step.kind == "run"}

    @property
    def step(self) -> Step:
        """The step to do now."""
        if self.is_screened_out:
            return SCREENED_OUT
        return next(step for step in self.steps if step.kind == "thanks" or not self._is_done(step))

    @property
    def progress(self) -> tuple[int, int]:
        """Number of steps that are done, and of all steps except the last, which is a page of thanks."""
        return sum(self._is_done(step) for step in self.steps[:-1]), len(self.steps) - 1

    @property
    def runs(self) -> tuple[int, int]:
        """Number of kept runs, and of all runs."""
        return sum(self._is_done(step) for step in self._runs.values()), len(self._runs)

    @property
    def is_finished(self) -> bool:
        """Whether all steps are done, or the participant did not consent."""
        return self.has_declined or self.step.kind in ("thanks", "screened")

    def _number_of(self, step: Step) -> int:
        """Number of the scene of a run."""
        return self.study.scene_number(step.block, self._replaced.get(step.id, step.scene))

    def _file_of_run(self, run: int) -> str | None:
        """The kept file of a run."""
        return self._kept.get(self._number_of(self._runs[run]))

    def _is_done(self, step: Step) -> bool:
        if step.id in self._skipped:
            return True
        if step.kind == "run":
            assert step.run is not None
            return self._file_of_run(step.run) is not None
        if step.kind == "questions" and step.run is not None:  # a run that was driven again is asked about again
            file = self._file_of_run(step.run)
            if file is None and self._runs[step.run].id in self._skipped:
                return step.id in self._done
            return file is not None and self._asked.get(step.id) == file
        return step.id in self._done

    def _apply(self, event: Mapping[str, Any]) -> None:
        """Apply an event of the file of answers; other kinds of events, such as `begun`, change nothing."""
        kind, step = event["event"], event.get("step", "")
        self.last_event = event["time"]
        if kind == "language":
            self.language, self.has_chosen_language = event["language"], True
        # Answers about a run count for its file: a run that is driven again is asked about again.
        elif kind == "answers" and event.get("file") is not None:
            self._asked[step] = event["file"]
        elif kind in ("done", "answers", "consented"):
            self._done.add(step)
            if (end := event.get("ends")) is not None:
                self.is_screened_out, self.is_full = True, end == FULL
        # The manifest says which runs are kept; the event is stored once for each file.
        elif kind == "kept":
            self._logged.add(event["file"])
        elif kind == "screened_out":
            self.is_screened_out = True
        elif kind == "skipped":
            self._skipped.add(step)
        elif kind == "replaced":
            self._replaced[step] = event["scene"]
        # A run that is taken back makes a finished study unfinished.
        elif kind in ("finished", "undone"):
            self.has_finished = kind == "finished"
        if kind in ("declined", "reconsidered", "consented"):
            self.has_declined = kind == "declined"


def progress_of_all(folder: StudyFolder) -> tuple[dict[str, Progress], list[str]]:
    """The progress of all participants, read from the files of the study; nothing is opened for writing.

    Returns:
        The progress by id, and the error messages of the participants whose files cannot be read.

    Raises:
        RecordError: the manifest is damaged.
    """
    kept: dict[str, dict[int, str]] = {}
    if (folder.out / MANIFEST).exists():
        for row in read_manifest(folder.out)["files"]:
            if row["seed"] == folder.study.config.seed:
                kept.setdefault(row["contributor"], {})[int(row["episode"])] = row["name"]
    known, problems = {}, []
    for index, id in enumerate(folder.participants):
        try:
            events = read_answers(folder.answers_of(id))
            known[id] = Progress(folder.study, index, events, kept.get(id), folder.rows.get(id))
        except RecordError as error:
            problems.append(str(error))
    return known, problems
