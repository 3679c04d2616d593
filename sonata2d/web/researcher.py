"""The researcher's page: progress of all participants, live view, pause, new links, agreement of ratings."""

from __future__ import annotations

import asyncio
import math
import time
from collections.abc import Callable, Container, Mapping

from ..collect.agreement import agreement as agreement_of
from ..collect.rating import ratings_of
from ..core.wording import one_line
from ..errors import RecordError, Sonata2dError
from ..study.folder import StudyFolder
from ..study.links import Links
from ..study.plan import condition_of, rows_of
from ..study.progress import Progress, progress_of_all
from ..study.texts import Json
from ..view.scene_data import scene_data
from . import messages as m
from .participant_session import ParticipantSession, driven_state

_MOST_DISPUTED = 5  # runs of a block of ratings
_QUOTA_PERIOD = 5.0  # s between two readings of the answers that take places of the quota


class Researcher:
    """Answers the messages of the researcher's pages.

    Args:
        folder: of the study.
        links: of the study.
        sessions: sessions of the participants who were connected lately, by id.
        connected: ids of the participants whose page is open.
        new_participant: adds a participant.

    Attributes:
        is_paused: whether all runs of the study are paused.
    """

    def __init__(
        self,
        folder: StudyFolder,
        links: Links,
        sessions: Mapping[str, ParticipantSession],
        connected: Container[str],
        new_participant: Callable[[], object],
    ) -> None:
        self._folder, self._links, self._sessions, self._connected = folder, links, sessions, connected
        self._new_participant = new_participant
        self.is_paused = False
        self._stored: dict[str, Progress] = {}  # of participants who are away
        self._problems: list[str] = []
        self._quota: list[tuple[str, int, int]] = []
        self._quota_time, self._quota_problem = -math.inf, ""
        self._is_read = False

    def forget(self) -> None:
        """Read the files anew with the next overview, because a session was closed."""
        self._stored, self._is_read = {}, False

    async def answer(self, message: m.Message) -> Json:
        """The answer to a message; one with a `problem` if it could not be carried out."""
        try:
            return await self._answer(message)
        except (Sonata2dError, ValueError) as error:
            return {"type": "problem", "problem": one_line(error, 300)}

    async def _answer(self, message: m.Message) -> Json:
        match message:
            case m.Look():
                return self._look(message)
            case m.Request(type="agreement"):
                return await asyncio.to_thread(self._agreement)
            case m.PauseStudy():
                self.is_paused = message.value
            case m.Add():
                await asyncio.to_thread(self._add, message.count)
        # An overview answers all other messages, so that the page shows their effect at once.
        if not self._is_read:
            self._stored, self._problems = await asyncio.to_thread(progress_of_all, self._folder)
            self._is_read = True
        if self._folder.study.config.quota is not None and time.monotonic() > self._quota_time + _QUOTA_PERIOD:
            self._quota_time, self._quota_problem = time.monotonic(), ""
            try:
                self._quota = await asyncio.to_thread(self._folder.quota)
            except RecordError as error:
                self._quota_problem = str(error)
        return self._overview()

    def _add(self, count: int) -> None:
        for _ in range(count):
            self._new_participant()

    def _overview(self) -> Json:
        tokens, config = self._links.tokens(), self._folder.study.config
        scenarios = [block.scenario for block in config.runs]
        return {
            "type": "overview",
            "isStudyPaused": self.is_paused,
            "open": self._links.open,
            "conditions": [
                *dict.fromkeys(condition_of(config.order, scenarios, row) for row in range(rows_of(config)))
            ],
            "quota": {"question": config.quota.question, "answers": self._quota} if config.quota else None,
            "problem": one_line("; ".join(filter(None, [*self._problems, self._quota_problem])), 300),
            "participants": [
                self._row(index, id, tokens.get(id))
                for index, id in enumerate(self._folder.participants)
                if id not in self._folder.withdrawn
            ],
        }

    def _row(self, index: int, id: str, token: str | None) -> Json:
        """The progress of a participant."""
        session = self._sessions.get(id)
        if session is None and id not in self._stored:
            self._stored[id] = Progress(self._folder.study, index, row=self._folder.rows.get(id))
        progress = session.participant if session else self._stored[id]
        run = session.driven_run if session else None
        return {
            "id": id,
            "token": token,
            "condition": progress.condition,
            "kind": "declined" if progress.has_declined else "full" if progress.is_full else progress.step.kind,
            "step": progress.step.id,
            "progress": progress.progress,
            "runs": progress.runs,
            "language": progress.language,
            "lastEvent": progress.last_event,
            "isOpen": id in self._connected,
            "roundTrip": session.round_trip if session else None,
            "status": run.state if run else None,
        }

    def _look(self, message: m.Look) -> Json:
        """The run that a participant drives now; its scene only if the page does not have it."""
        session = self._sessions.get(message.participant)
        run = session.driven_run if session else None
        look: Json = {"type": "look", "participant": message.participant, "drive": None}
        if session is not None and run is not None:
            key = f"{message.participant}/{session.run}/{run.scene.episode}"
            look["drive"] = {"scene": key, "ticks": run.ticks, "state": driven_state(run)}
            if message.scene != key:
                look["drive"]["data"] = scene_data(run.scene)
        return look

    def _agreement(self) -> Json:
        """The agreement of the ratings of each block."""
        blocks = []
        for k, block in enumerate(self._folder.study.config.ratings):
            ratings = ratings_of(self._folder.rated(k))
            spec = self._folder.rating_spec(k, ratings)
            agreement = agreement_of([rating for rating in ratings if rating.spec == spec], spec)
            repeated = [rater for rater in agreement.within if rater.same is not None]
            count = sum(rater.repeats for rater in repeated)
            same = sum((rater.same or 0.0) * rater.repeats for rater in repeated) / count if count else None
            disputed = [
                {"file": run.file, "labels": {rater: spec.in_words(label) for rater, label in run.labels.items()}}
                for run in agreement.disputed[:_MOST_DISPUTED]
            ]
            facts = {name: getattr(agreement, name) for name in ("ratings", "shared", "measure", "alpha")}
            facts |= {"name": block.name, "question": spec.question, "raters": len(agreement.raters)}
            blocks.append(facts | {"repeats": count, "same": same, "disputed": disputed})
        return {"type": "agreement", "blocks": blocks}
