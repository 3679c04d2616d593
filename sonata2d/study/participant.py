"""The actions of a participant, without a server."""

from __future__ import annotations

import logging
from collections.abc import Callable, Container, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from ..agents.controllers.teleoperation import DEFAULT_MAPPINGS, DeviceMapping
from ..collect.collection import checked_name
from ..collect.rating import RatingSession, ratings_of
from ..collect.session import Session
from ..record.record import EpisodeRecord
from ..scenegen.scenario.config import ScenarioConfig
from .answers import FULL, SCREENED, AnswerLog, WrongAnswerError, checked_answers, event_time
from .folder import StudyFolder, external_ids
from .plan import Step
from .progress import Progress
from .questions import Question

logger = logging.getLogger(__name__)

_MAX_EVENTS = 5000  # of one participant
_PRACTICE = "practice"  # why a run is not kept


class Participant(Progress):
    """A participant, who goes through a study step by step, and continues after an interruption.

    The steps that are done follow from the participant's file of answers and from the kept runs, so that nothing is
    lost or repeated if the program ends at any moment.

    Args:
        folder: of the study.
        id: of the participant, a pseudonym.
        mappings: device mappings by kind of device.
        suffix: of episode files.
        now: clock.

    Attributes:
        session: the runs; None before the first one, and after the last.
        rating: the runs to rate, while they are rated.
        record: the run to rate now.

    Raises:
        ConfigError: the id is not usable.
        RecordError: a file of the participant is damaged, or cannot be written.
    """

    def __init__(
        self,
        folder: StudyFolder,
        id: str,
        *,
        mappings: Mapping[str, DeviceMapping] = DEFAULT_MAPPINGS,
        suffix: str = ".json",
        now: Callable[[], datetime] = lambda: datetime.now(UTC),
    ) -> None:
        id = checked_name(id)
        self._folder, self.id, self._mappings, self._suffix, self._now = folder, id, mappings, suffix, now
        self._log, self._personal = AnswerLog(folder.answers_of(id)), AnswerLog(folder.personal_of(id))
        super().__init__(folder.study, folder.add(id), self._log.lines, row=folder.rows.get(id))
        self.external = external_ids(self._personal.lines)
        self.session: Session | None = None
        self.rating: RatingSession | None = None
        self.record: EpisodeRecord | None = None
        self._may_undo = False
        self._since, self._on_show = now(), ""  # time at which the present step began, and its id
        if not self._log.lines:
            self._append(event="begun")
        self.resume()

    @property
    def is_driving(self) -> bool:
        """Whether the present step is a run, or a practice run."""
        return self.step.kind in ("run", "practice") and not self.has_declined

    @property
    def can_undo(self) -> bool:
        """Whether the last kept run can be taken back; only questions about it may have been answered since."""
        return self._may_undo and self.study.config.undo and self.session is not None and self.session.can_undo

    @property
    def rules(self) -> dict[str, float | bool]:
        """The rules for the present run that the participant is told: those of the study that ask for something.

        Of practice runs, `must_reach_goal` holds until the participant has tried often enough.
        """
        config, practice = self.study.config, self.study.config.practice
        if self.step.kind == _PRACTICE:
            is_due = practice is not None and practice.must_reach_goal and self._tries < practice.attempts
            return {"must_reach_goal": True} if is_due else {}
        rules = {key: getattr(config, key) for key in ("minimum_length", "minimum_distance", "must_reach_goal")}
        return {key: value for key, value in rules.items() if value}

    @property
    def broken_rule(self) -> str | None:
        """The first of the rules that the present run, which ended, does not keep; None if it keeps all."""
        session = self.session
        if session is None or session.state != "ended" or not self.is_driving:
            return None
        reached = {
            "minimum_length": session.after.time,
            "minimum_distance": session.path_length,
            "must_reach_goal": _is_at_goal(session),
        }
        return next((rule for rule, least in self.rules.items() if reached[rule] < least), None)

    @property
    def _tries(self) -> int:
        """Number of times that the present run was begun."""
        return 1 + [(event["event"], event.get("step")) for event in self._log.lines].count(("redone", self.step.id))

    # Actions

    def device(self, screen: str, window: str, *, touch: bool) -> None:
        """Note the device that the page is opened on.

        Args:
            screen, window: width and height in pixels of the page, such as `1440x900`.
            touch: whether the page is touched first of all.
        """
        facts = {"screen": screen, "window": window, "touch": touch}
        last = next((event["device"] for event in reversed(self._log.lines) if event["event"] == "device"), None)
        if facts != last and len(self._log.lines) < _MAX_EVENTS:
            self._append(event="device", device=facts)

    def choose_language(self, language: str) -> None:
        """Use one of the languages of the study.

        Raises:
            ValueError: the study has no such language.
        """
        if language not in self.study.config.languages:
            raise ValueError(f"the study has no language {language!r}")
        if language != self.language:
            self._require_room()
            self._append(event="language", language=language)

    def read(self, step: str) -> None:
        """Go on after a page.

        Raises:
            ValueError: the present step is another one.
        """
        self._require(step, "page")
        self._append(event="done", step=step, seconds=self._seconds())
        self.resume()

    def consent(self, step: str, ticked: Sequence[bool]) -> None:
        """Agree to take part.

        Raises:
            ValueError: the present step is another one, or a statement is not ticked.
        """
        present = self._require(step, "consent")
        if len(ticked) != len(present.statements) or not all(tick is True for tick in ticked):
            raise ValueError("every statement has to be ticked")
        facts = {"study": self.study.sha256, "language": self.language, "seconds": self._seconds()}
        self._append(event="consented", step=step, **facts)
        self.resume()

    def decline(self, step: str) -> None:
        """Do not take part; the participant can change their mind later."""
        self._require(step, "consent")
        self._require_room()
        self._append(event="declined", step=step)

    def reconsider(self) -> None:
        """Show the consent again after it was declined."""
        if self.has_declined:
            self._append(event="reconsidered")

    def answer(self, step: str, values: Mapping[str, Any]) -> None:
        """Answer the questions of a page.

        Args:
            step: id of the step.
            values: as of `answers.checked_answers`.

        Raises:
            ValueError: the present step is another one, or an answer is missing or does not fit.
            RecordError: the answers cannot be written.
        """
        present = self._require(step, "questions")
        answers = checked_answers(present.entries, values)
        personal = {
            entry.name
            for entry in present.entries
            if (present.is_personal if entry.personal is None else entry.personal)
        }
        facts: dict[str, Any] = {"event": "answers", "step": step}
        if present.run is not None:
            facts["file"] = self._file_of_run(present.run)
        checks = [entry for entry in present.entries if isinstance(entry, Question) and entry.right is not None]
        wrong = [entry for entry in checks if answers.get(entry.name) != entry.check(entry.right)]
        if wrong:
            facts["wrong"] = [entry.name for entry in wrong]
        is_out = any(entry.screen_out for entry in wrong)
        if any(entry.until_right for entry in wrong) and not is_out:
            self._require_room()
            self._append(event="wrong", step=step, wrong=facts["wrong"])
            raise WrongAnswerError("not all answers are right")
        quota = self.study.config.quota
        if is_out:
            facts["ends"] = SCREENED
        if quota is None or step != "demographics" or is_out:
            self._store_answers(facts, answers, personal)
        else:
            with self._folder.admission(self.id, answers[quota.question]) as is_admitted:
                self._store_answers(facts if is_admitted else facts | {"ends": FULL}, answers, personal)
            self._take_row(self._folder.rows.get(self.id))
        self._may_undo = self._may_undo and present.run is not None
        self.resume()

    def keep(self, label: Any = None) -> Path:
        """Keep the run that ended, and go on.

        Raises:
            ValueError: the run has not ended or is too short, or the label does not fit.
            RecordError: the file cannot be written; nothing is lost.
        """
        session = self._driving("run")
        self._require_rules()
        path = session.keep(label)
        self._kept, self._may_undo = dict(session.kept_runs), True
        self.resume()
        return path

    def finish_practice(self) -> None:
        """Go on after a practice run that ended.

        Raises:
            ValueError: no practice run has ended, or it has to be driven again.
        """
        session = self._driving(_PRACTICE)
        if session.state != "ended":
            raise ValueError("the run has not ended")
        self._require_rules()
        practice = self.study.config.practice
        is_failed = (
            practice is not None and practice.must_reach_goal and not _is_at_goal(session)
        )  # after the last attempt
        self._append(event="done", step=self.step.id, **({"failed": True} if is_failed else {}))
        session.next(reason=_PRACTICE)
        self.resume()

    def discard(self) -> None:
        """Discard the run; another scene replaces it.

        Raises:
            ValueError: the study does not allow it, or no run has begun.
        """
        session = self._driving("run")
        if not self.study.config.discard:
            raise ValueError("runs of this study cannot be discarded")
        if not session.ticks:
            raise ValueError("no run has begun")
        self._require_room()
        step = self.step
        block = [other for other in self._runs.values() if other.block == step.block]
        used = [scene for other in block for scene in (other.scene, self._replaced.get(other.id, 0))]
        self._append(event="replaced", step=step.id, scene=max(used) + 1)
        session.next(reason="discarded")

    def redo(self) -> Path | None:
        """Drive the same scene again; a run that has begun is discarded.

        Returns:
            The path of the discarded run; None if the run had not begun.

        Raises:
            ValueError: the study does not allow it, and the run is long enough to be kept.
        """
        session = self._driving("run", _PRACTICE)
        if not self.study.config.redo and self.step.kind == "run" and self.broken_rule is None:
            raise ValueError("runs of this study cannot be driven again")
        self._require_room()
        path = session.redo()
        if path is not None:
            self._append(event="redone", step=self.step.id, file=path.name)
        return path

    def skip(self, step: str) -> None:
        """Go on without doing the present step, in a preview of the study.

        Raises:
            ValueError: the present step is another one, or the last.
        """
        if self.step.id != step or self.is_finished:
            raise ValueError(f"the present step is {self.step.id}, not {step}")
        self._append(event="skipped", step=step)
        self.record, self.rating, self._may_undo = None, None, False
        if self.session is not None:
            self.session.next(reason="skipped")
        self.resume()

    def undo(self) -> None:
        """Take back the last run that was kept.

        Raises:
            ValueError: the study does not allow it, another run has begun, or nothing was kept in this session.
        """
        if self.session is None or not self.can_undo:
            raise ValueError("the last run cannot be taken back")
        self._require_room()
        try:
            self.session.undo()
        finally:
            self._kept = dict(self.session.kept_runs)
        self._may_undo = False
        self._append(event="undone")

    def rate(self, label: Any, *, seconds: float, whole: bool) -> None:
        """Rate the run on show, and go on.

        Raises:
            ValueError: there is no run to rate, or the label does not fit.
            RecordError: the rating cannot be written.
        """
        if self.rating is None or self.record is None:
            raise ValueError("there is no run to rate")
        label = self.study.config.ratings[self.step.block].question.check(label)
        self.rating.rate(self.record, label, seconds=seconds, whole=whole)
        self.record, self._may_undo = None, False
        self.resume()

    def resume(self) -> None:
        """Prepare the run to drive, or the run to rate, if the present step needs one."""
        step = self.step
        if self.has_declined:
            return
        if step.kind in ("run", "practice") and self.session is None:
            self.session = Session(
                self._folder.out,
                self.id,
                self.study.config_of(step.block),
                seed=self.study.config.seed,
                mappings=self._mappings,
                suffix=self._suffix,
                schedule=self._schedule,
                now=self._now,
            )
            self._kept = dict(self.session.kept_runs)
            self._leave_other_step()
        self._log_kept_runs()
        step = self.step  # again, because the session knows the kept runs
        if step.kind == "ratings":
            self._resume_rating(step)
        if step.kind == "thanks" and not self.has_finished:
            self._append(event="finished")
        if self.step.id != self._on_show:
            self._since, self._on_show = self._now(), self.step.id
        has_runs = any(step.kind in ("run", _PRACTICE) and not self._is_done(step) for step in self.steps)
        if not has_runs and not self.can_undo:
            self.close()

    def close(self) -> None:
        """Close the files; another `Participant` of this id continues."""
        if self.session is not None:
            self.session.close()
            self.session = None

    # Internals

    def _store_answers(self, facts: dict[str, Any], answers: Mapping[str, Any], personal: Container[str]) -> None:
        """Store the answers to the questions of a page, the personal ones apart."""
        secret = {name: value for name, value in answers.items() if name in personal}
        if secret:
            self._personal.append(time=self._time(), **facts, values=secret)
        values = {name: value for name, value in answers.items() if name not in personal}
        self._append(**facts, values=values, language=self.language, seconds=self._seconds())

    def _log_kept_runs(self) -> None:
        """Store the events of kept runs that have none: the program may end between a run's file and its event."""
        for step in self._runs.values():
            assert step.run is not None
            file = self._file_of_run(step.run)
            if file is not None and file not in self._logged:
                scene = self._number_of(step)
                self._append(event="kept", step=step.id, file=file, block=step.block, scene=scene)

    def _leave_other_step(self) -> None:
        """Discard an open run that does not belong to the present step: a finished practice run, or a discarded run.

        Such a run is left if the program ended, or the disk was full, between the event of a step and the end of its
        run.
        """
        if self.session is not None and self.is_driving and self.session.scene.episode != self._number_of(self.step):
            self.session.next(reason="belongs to another step")

    def _resume_rating(self, step: Step) -> None:
        block = self.study.config.ratings[step.block]
        if self.rating is None or self.rating.folder != self._folder.rated(step.block):
            folder = self._folder.rated(step.block)
            self.rating = RatingSession(
                folder,
                self.id,
                self._folder.rating_spec(step.block, ratings_of(folder)),
                seed=self.study.config.seed,
                repeats=block.repeats,
                break_after=block.break_after,
            )
            self.record = None
        upcoming = self.rating.upcoming
        if self.record is None or upcoming is None or upcoming.path != self.record.path:
            self.record = self.rating.load()
        if self.record is None:
            self.rating = None
            self._append(event="done", step=step.id)
            self.resume()

    def _schedule(self, kept: Mapping[int, str]) -> tuple[ScenarioConfig, int]:
        """The scene of the next run; after the last run, its scene again, which is not driven."""
        self._kept = dict(kept)
        runs = [step for step in self.steps if step.kind in ("run", _PRACTICE)]
        step = next((step for step in runs if not self._is_done(step)), runs[-1])
        return self.study.config_of(step.block), self._number_of(step)

    def _require(self, step: str, kind: str) -> Step:
        """The present step, if it is the expected one; a click may arrive twice, or from an outdated page."""
        present = self.step
        if present.id != step or present.kind != kind or (self.has_declined and kind != "consent"):
            raise ValueError(f"the present step is {present.id}, not {step}")
        return present

    def _require_room(self) -> None:
        """Limit the number of events, because some actions can be repeated for ever."""
        if len(self._log.lines) >= _MAX_EVENTS:
            raise ValueError(f"the participant has reached the limit of {_MAX_EVENTS} events")

    def _driving(self, *kinds: str) -> Session:
        if self.session is None or self.step.kind not in kinds or self.has_declined:
            raise ValueError(f"the present step is {self.step.id}, not a run")
        self._leave_other_step()
        return self.session

    def _require_rules(self) -> None:
        """Refuse a run that does not keep the rules."""
        session, rule = self.session, self.broken_rule
        assert session is not None
        if rule is not None:
            least = self.rules[rule]
            raise ValueError(
                {
                    "minimum_length": f"the run is {session.after.time:.1f} s long; it has to last {least:g} s or more",
                    "minimum_distance": f"the robot went {session.path_length:.2f} m; it has to go {least:g} m or more",
                    "must_reach_goal": "the run has to reach the goal",
                }[rule]
            )

    def _append(self, **facts: Any) -> None:
        """Store an event, and apply it."""
        facts = {"time": self._time()} | facts
        self._log.append(**facts)
        self._apply(facts)

    def _seconds(self) -> float:
        """Time since the present step began, or since the program began, s."""
        return round((self._now() - self._since).total_seconds(), 1)

    def _time(self) -> str:
        return event_time(self._now())


def _is_at_goal(session: Session) -> bool:
    """Whether the present run ended at its goal."""
    return session.outcome is not None and session.outcome.status == "goal"
