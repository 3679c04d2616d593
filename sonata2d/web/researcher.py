"""What the researcher's page shows and does: progress, live view, break, new links, agreement."""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING

from ..collect.agreement import agreement as agreement_of
from ..collect.rating import ratings_of
from ..core.wording import one_line
from ..errors import Sonata2dError
from ..study.content import Json
from ..study.progress import Progress, progress_of_all
from ..view.scene_data import scene_data, state_data
from . import messages as m

if TYPE_CHECKING:
    from .server import StudyServer

_MOST_DISPUTED = 5  # runs of a block of ratings


class Researcher:
    """Answers the messages of the researcher's pages.

    Args:
        server: of the study.
    """

    def __init__(self, server: StudyServer) -> None:
        self._server = server
        self._stored: dict[str, Progress] = {}  # of participants who are away
        self._problems: list[str] = []
        self._is_read = False

    def forget(self) -> None:
        """Read the files anew: a participant has left, and what was read of them is old."""
        self._stored, self._is_read = {}, False

    async def answer(self, message: m.Message) -> Json:
        """The answer to a message; one with a `problem` if it could not be carried out."""
        try:
            return await self._answer(message)
        except (Sonata2dError, ValueError) as error:
            return {"type": "problem", "problem": one_line(error, 300)}

    async def _answer(self, message: m.Message) -> Json:
        server = self._server
        match message:
            case m.Look():
                return self._look(message)
            case m.Agreement():
                return await asyncio.to_thread(self._agreement)
            case m.Hold():
                server.is_held = message.value
            case m.Add():
                await asyncio.to_thread(self._add, message.count)
        if not self._is_read:
            self._stored, self._problems = await asyncio.to_thread(progress_of_all, server.folder)
            self._is_read = True
        return self._overview()

    def _add(self, count: int) -> None:
        for _ in range(count):
            self._server.new_participant()

    def _overview(self) -> Json:
        server = self._server
        tokens = server.links.tokens()
        return {
            "type": "overview",
            "isHeld": server.is_held,
            "open": server.links.open,
            "problem": one_line("; ".join(self._problems), 300),
            "participants": [
                self._row(index, id, tokens.get(id))
                for index, id in enumerate(server.folder.participants)
                if id not in server.folder.withdrawn
            ],
        }

    def _row(self, index: int, id: str, token: str | None) -> Json:
        """How far a participant is."""
        server = self._server
        seat = server.seats.get(id)
        if seat is None and id not in self._stored:
            self._stored[id] = Progress(server.folder.study, index)
        progress = seat.participant if seat else self._stored[id]
        row: Json = {
            "id": id,
            "token": token,
            "kind": "declined" if progress.has_declined else progress.step.kind,
            "step": progress.step.id,
            "progress": progress.progress,
            "runs": progress.runs,
            "language": progress.language,
            "lastEvent": progress.last_event,
            "isOpen": id in server.connected,
            "roundTrip": seat.round_trip if seat else None,
            "status": None,
        }
        session = seat.participant.session if seat and seat.participant.is_driving else None
        if session is not None:
            row["status"] = session.state
        return row

    def _look(self, message: m.Look) -> Json:
        """What a participant does now; the scene only if the page does not have it."""
        seat = self._server.seats.get(message.participant)
        look: Json = {"type": "look", "participant": message.participant, "drive": None}
        session = seat.participant.session if seat and seat.participant.is_driving else None
        if seat is not None and session is not None:
            key = f"{message.participant}/{seat.run}/{session.scene.episode}"
            look["drive"] = {"scene": key, "ticks": session.ticks, "state": state_data(session.after)}
            if message.scene != key:
                look["drive"]["data"] = scene_data(session.scene)
        return look

    def _agreement(self) -> Json:
        """How well the ratings of each block agree."""
        folder, blocks = self._server.folder, []
        for k, block in enumerate(folder.study.config.ratings):
            ratings = ratings_of(folder.rated(k))
            spec = folder.rating_spec(k, ratings)
            found = agreement_of([rating for rating in ratings if rating.spec == spec], spec)
            repeated = [rater for rater in found.within if rater.repeats]
            count = sum(rater.repeats for rater in repeated)
            blocks.append(
                {
                    "name": block.name,
                    "question": spec.question,
                    "raters": len(found.raters),
                    "ratings": found.ratings,
                    "shared": found.shared,
                    "measure": found.measure,
                    "alpha": found.alpha,
                    "repeats": count,
                    "same": sum(r.same * r.repeats for r in repeated if r.same is not None) / count if count else None,
                    "disputed": [{"file": run.file, "labels": run.labels} for run in found.disputed[:_MOST_DISPUTED]],
                }
            )
        return {"type": "agreement", "blocks": blocks}
