"""One participant's place at the server: answers the messages of a page."""

from __future__ import annotations

import asyncio
import logging
import secrets
import threading
import time
from collections.abc import Awaitable, Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Any

from ..core.devices import NETWORK_DEVICE, ROUND_TRIP, DeviceEvent
from ..core.geometry import quantised
from ..core.wording import one_line
from ..errors import Sonata2dError
from ..study.content import Json, shown_label
from ..study.load import spec_of
from ..view.layers import Layers
from ..view.legend import Legend
from ..view.scene_data import UNDRAWN, legend_data, scene_data, state_data, states_data
from . import messages as m
from .content import label_json, step_json

if TYPE_CHECKING:
    from ..collect.session import Session
    from ..core.snapshot import Snapshot
    from ..study.participant import Participant

logger = logging.getLogger(__name__)

_BURST = 20  # ticks that a page may catch up at once, after its connection stood still
_PACE = 1.1  # largest speed of a run, as a multiple of real time
_FIRST_NUMBERS = 2**30  # of runs and of runs to rate
_SMALLEST_CHANGE = 0.001  # s, of the round-trip time: smaller ones are not recorded


class Seat:
    """Answers the messages of one participant's page, one after the other.

    Args:
        participant: the participant.
        is_held: whether the researcher has stopped the study for a while.
        is_preview: whether steps can be skipped.
        clock: s.
        sleep: waits a number of s.

    Attributes:
        round_trip: latest round-trip time, s; None before the first.
    """

    def __init__(
        self,
        participant: Participant,
        *,
        is_held: Callable[[], bool] = lambda: False,
        is_preview: bool = False,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], Awaitable[None]] = asyncio.sleep,
    ) -> None:
        self.participant, self._is_held, self._is_preview, self._clock = participant, is_held, is_preview, clock
        self._sleep = sleep
        # A page that was open before the server started again must not take another run for the one that it shows.
        self._run = self.shown = secrets.randbelow(_FIRST_NUMBERS)
        self._counting = threading.Lock()
        self._counted: tuple[Session | None, int] = (None, 0)  # what the present number of a run belongs to
        self.round_trip: float | None = None
        self._recorded_trip: float | None = None
        self._shown_record: Any = participant.record
        self._allowance, self._filled = float(_BURST), clock()
        self._seen = clock()

    @property
    def run(self) -> int:
        """Number of the present run: messages about an earlier one are ignored."""
        session = self.participant.session
        present = (session, session.number_of_runs if session else 0)
        with self._counting:  # the researcher's page asks, too
            if present != self._counted:
                self._counted, self._run, self._recorded_trip = present, self._run + 1, None
            return self._run

    @property
    def idle(self) -> float:
        """Time since the last message, s."""
        return self._clock() - self._seen

    async def answer(self, message: m.Message) -> Json | None:
        """The answer to a message; None for one that needs none.

        What takes long, such as writing a file or generating a scene, runs in another thread, so that other
        participants do not wait for it.
        """
        self._seen = self._clock()
        if isinstance(message, m.Tick):
            return await self._tick(message)
        problem, kind = "", ""
        try:
            await asyncio.to_thread(self._perform, message)
        except (ValueError, OverflowError) as error:
            problem, kind = one_line(error, 300), m.REFUSED
            logger.info("%s: %s", self.participant.id, problem)
        except Sonata2dError as error:  # paths of the server are for the researcher
            problem, kind = "the server cannot do this at present", m.FAILED
            logger.error("%s: %s", self.participant.id, one_line(error, 300))
        return await asyncio.to_thread(self.view, problem, kind, whole=isinstance(message, m.Hello))

    async def leave(self) -> None:
        """Pause the run, because the page was closed."""
        if self.participant.session is not None:
            await asyncio.to_thread(_stand_still, self.participant.session)

    def view(self, problem: str = "", kind: str = "", *, whole: bool = False) -> Json:
        """All that the page shows. A run that is driven stands still, because the page forgets what is pressed.

        Args:
            problem: why the last message had no effect; empty if it had.
            kind: of the problem.
            whole: whether the page has nothing yet.
        """
        participant = self.participant
        if participant.session is not None:
            _stand_still(participant.session)
        config, step = participant.study.config, participant.step
        view: Json = {
            "type": "view",
            "language": participant.language,
            "step": step_json(participant),
            "progress": participant.progress,
            "runs": participant.runs,
            "canUndo": participant.can_undo,
            "isHeld": self._is_held(),
            "isPreview": self._is_preview,
            "participant": participant.id,
            "problem": problem,
            "problemKind": kind,
        }
        if participant.is_driving and participant.session is not None:
            session = participant.session
            block = config.runs[step.block] if step.kind == "run" else None
            view["drive"] = {
                **self._driving_state(session),
                "scene": scene_data(session.scene),
                "before": state_data(session.before),
                "label": label_json(shown_label(session.label_spec, block, participant.language)),
                "undoneLabel": session.undone_label,
                "isPractice": step.kind == "practice",
                "isHolonomic": session.scene.robot.kinematics == "holonomic",
                "minimum": config.minimum_length,
                "allowed": {key: getattr(config, key) for key in ("discard", "redo", "undo")},
                "changes": config.changes,
                "view": config.view,
                "context": session.config.context,
                "isRestarted": bool(session.notice) and session.number_of_runs == 1 and not session.ticks,
                "legend": self._legend(session.after),
            }
        if step.kind == "ratings" and participant.record is not None and participant.rating is not None:
            if participant.record is not self._shown_record:
                self._shown_record, self.shown = participant.record, self.shown + 1
            record, rating = participant.record, participant.rating
            rated = config.ratings[step.block]
            view["rating"] = {
                "shown": self.shown,
                "scene": scene_data(record.scene()),
                "states": states_data(list(record.snapshots())),
                "label": label_json(spec_of(rated.question, participant.language)),
                "done": rating.done / max(rating.total, 1),
                "breakDue": rating.break_due,
                "context": record.context,
                "view": rated.view,
            }
        return view

    def _legend(self, snapshot: Snapshot) -> list[dict[str, str]]:
        """The meaning of the symbols in a picture, in the participant's language."""
        words = self.participant.study.tables[self.participant.language]

        def wording(name: str, **values: object) -> str:
            return words[f"legend.{name}"].format(**values)

        layers = Layers(zones="zones" in self.participant.study.config.changes, legend=True)
        entries = legend_data(Legend.of([snapshot], layers, wording=wording))
        return [entry for entry in entries if entry["name"] not in UNDRAWN]

    # Driving

    async def _tick(self, tick: m.Tick) -> Json | None:
        """Simulate a tick, once, and in its turn."""
        session = self._session()
        if session is None or tick.run != self.run:
            return None  # sent before the page knew that the run is over
        if self._is_held():
            await asyncio.to_thread(_stand_still, session)
            return self._answered(session, tick)
        if tick.number < session.ticks or session.state == "ended":  # it is repeated after an interruption
            return self._answered(session, tick)
        if tick.number > session.ticks:  # messages are missing between the last tick and this one
            return await asyncio.to_thread(self.view)
        await self._wait_for_turn(session.after.dt)
        events = [event.event() for event in tick.events]
        if tick.round_trip is not None:
            self.round_trip = tick.round_trip
            value = quantised(round(min(tick.round_trip, 1.0), 3))
            if self._recorded_trip is None or abs(value - self._recorded_trip) >= _SMALLEST_CHANGE:
                events.append(DeviceEvent(NETWORK_DEVICE, ROUND_TRIP, value))
                self._recorded_trip = value
        last = {(event.device, event.control): event for event in events}  # one event per control and tick
        session.dropped_ticks += tick.dropped
        session.tick(tuple(last.values()))
        return self._answered(session, tick)

    def _answered(self, session: Session, tick: m.Tick) -> Json:
        return {"type": "tick", "asked": tick.number, **self._driving_state(session)}

    def _driving_state(self, session: Session) -> Json:
        """What changes from tick to tick."""
        return {
            "run": self.run,
            "ticks": session.ticks,
            "status": session.state,
            "state": state_data(session.after),
            "outcome": session.outcome.status if session.outcome else None,
            "given": session.label,
            "isUnsaved": session.journal_error is not None,
            "isHeld": self._is_held(),
        }

    async def _wait_for_turn(self, dt: float) -> None:
        """Wait until a run may go on: a page that sends ticks faster than real time has to wait for its answers."""
        now = self._clock()
        self._allowance = min(self._allowance + (now - self._filled) * _PACE / dt, float(_BURST))
        self._filled = now
        self._allowance -= 1.0
        if self._allowance < 0.0:
            await self._sleep(-self._allowance * dt / _PACE)

    def _session(self) -> Session | None:
        return self.participant.session if self.participant.is_driving else None

    # Everything else

    def _perform(self, message: m.Message) -> None:
        """Carry a message out.

        Raises:
            Sonata2dError, ValueError: it cannot be carried out; nothing is changed.
        """
        participant = self.participant
        match message:
            case m.Hello():
                if message.protocol != m.PROTOCOL:
                    raise ValueError("the page is of another version; reload it")
                if not participant.has_chosen_language:
                    participant.choose_language(preferred(participant.study.config.languages, message.languages))
            case m.Language():
                participant.choose_language(message.language)
            case m.Read():
                participant.read(message.step)
            case m.Consent():
                participant.consent(message.step, message.ticked)
            case m.Decline():
                participant.decline(message.step)
            case m.Reconsider():
                participant.reconsider()
            case m.Answer():
                participant.answer(message.step, message.values)
            case m.Rate():
                if message.shown != self.shown:
                    raise ValueError("this run is rated")
                participant.rate(message.label, seconds=message.seconds, whole=message.whole)
            case m.Rest():
                if participant.rating is not None:
                    participant.rating.take_break()
            case m.Skip():
                if not self._is_preview:
                    raise ValueError("steps can be skipped in a preview only")
                participant.skip(message.step)
            case m.Undo():
                participant.undo()
            case m.Pause() | m.Stop() | m.Keep() | m.FinishPractice() | m.Discard() | m.Redo():
                self._perform_about_run(message)

    def _perform_about_run(self, message: m.Pause | m.Stop | m.Keep | m.FinishPractice | m.Discard | m.Redo) -> None:
        session = self._session()
        if session is None or message.run != self.run:
            return  # a second click
        participant = self.participant
        match message:
            case m.Pause():
                return  # the view stands still
            case m.Stop():
                session.stop()
                return
            case m.Keep():
                participant.keep(message.label)
            case m.FinishPractice():
                participant.finish_practice()
            case m.Discard():
                participant.discard()
            case m.Redo():
                participant.redo()


def preferred(known: Sequence[str], wanted: Iterable[str]) -> str:
    """The first language that is known and wanted, whatever its region; the first known one if there is none.

    >>> preferred(["en", "de"], ["fr", "de-AT", "en"])
    'de'
    """
    by_language = {language.lower().partition("-")[0]: language for language in reversed(known)}
    matches = (by_language.get(language.strip().lower().partition("-")[0]) for language in wanted)
    return next(filter(None, matches), known[0])


def _stand_still(session: Session) -> None:
    """Pause, and release all controls: a page that continues reports anew what is pressed."""
    session.pause()
    session.release()
