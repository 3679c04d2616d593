"""The session of one participant: answers to the messages of a page."""

from __future__ import annotations

import asyncio
import logging
import secrets
import threading
import time
from collections.abc import Awaitable, Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Any

from ..core.devices import NETWORK_DEVICE, PREDICTED, ROUND_TRIP, DeviceEvent
from ..core.geometry import quantised
from ..core.wording import one_line
from ..errors import Sonata2dError
from ..study.answers import WrongAnswerError
from ..study.config import LabelTexts
from ..study.content import label_content, step_content
from ..study.texts import Json
from ..view.layers import Layers
from ..view.legend import Legend
from ..view.scene_data import UNDRAWN, legend_data, scene_data, state_data, states_data
from . import messages as m

if TYPE_CHECKING:
    from ..collect.rating import RatingSession
    from ..collect.session import Session
    from ..core.snapshot import Snapshot
    from ..record.record import EpisodeRecord
    from ..study.participant import Participant

logger = logging.getLogger(__name__)

_BURST = 20  # ticks that a page may catch up at once, after its connection stood still
_PACE = 1.1  # largest speed of a run, as a multiple of real time
_FIRST_NUMBERS = 2**30  # of runs and of runs to rate
_SEEN = 0.95  # of the duration of a recorded run, before which it cannot be rated: clocks differ a little
_SMALLEST_CHANGE = 0.001  # s, of the round-trip time: smaller ones are not recorded


class ParticipantSession:
    """Answers the messages of one participant's page, one after the other.

    Args:
        participant: the participant.
        is_paused: returns whether the researcher has paused all runs.
        is_preview: whether steps can be skipped.
        predicts: whether the page can simulate runs itself, see `page_folder`.
        clock: s.
        sleep: waits a number of s.

    Attributes:
        round_trip: latest round-trip time, s; None before the first.
        shown: number of the recorded run that the page shows for rating.
    """

    def __init__(
        self,
        participant: Participant,
        *,
        is_paused: Callable[[], bool] = lambda: False,
        is_preview: bool = False,
        predicts: bool = False,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], Awaitable[None]] = asyncio.sleep,
    ) -> None:
        self.participant, self._is_paused, self._is_preview = participant, is_paused, is_preview
        self._predicts = predicts
        self._clock, self._sleep = clock, sleep
        # Random first numbers: a page that was open before a restart of the server must not mistake a run for its own.
        self._run = self.shown = secrets.randbelow(_FIRST_NUMBERS)
        self._counting = threading.Lock()
        self._counted: tuple[Session | None, int] = (None, 0)  # session and run that `_run` is the number of
        self.round_trip: float | None = None
        self._recorded_trip: float | None = None
        self._is_predicted = False  # as recorded last in the present run
        self._is_apart = False  # whether the page may have simulated ticks that the server refused
        self._shown_record: Any = participant.record
        self._shown_at = clock()
        self._allowance, self._filled = float(_BURST), clock()
        self._last_message = clock()

    @property
    def run(self) -> int:
        """Number of the present run; messages about an earlier run are ignored."""
        session = self.participant.session
        present = (session, session.number_of_runs if session else 0)
        with self._counting:  # the thread of the researcher's page reads it too
            if present != self._counted:
                self._counted, self._run, self._recorded_trip = present, self._run + 1, None
                # A run that is taken up again goes on with what was recorded last.
                events = [event for tick in session.past_events for event in tick] if session else []
                predicted = [event.value for event in events if event.control == PREDICTED]
                self._is_predicted = predicted[-1:] == [1.0]
            return self._run

    @property
    def idle(self) -> float:
        """Time since the last message, s."""
        return self._clock() - self._last_message

    @property
    def driven_run(self) -> Session | None:
        """The runs of the participant, while the present step is a run or a practice run."""
        return self.participant.session if self.participant.is_driving else None

    async def answer(self, message: m.Message) -> Json | None:
        """The answer to a message; None for a message that needs none.

        Slow actions, such as writing a file or generating a scene, run in another thread, so that other participants do
        not wait for them.
        """
        self._last_message = self._clock()
        if isinstance(message, m.Tick):
            return await self._tick(message)
        if isinstance(message, m.Ping):
            return {"type": "pong"}
        problem, kind = "", ""
        try:
            await asyncio.to_thread(self._perform, message)
        except WrongAnswerError as error:
            problem, kind = str(error), m.WRONG
        except (ValueError, OverflowError) as error:
            problem, kind = one_line(error, 300), m.REFUSED
            logger.info("%s: %s", self.participant.id, problem)
        except Sonata2dError as error:  # it may name paths of the server, which are for the researcher only
            problem, kind = "the server cannot do this at present", m.FAILED
            logger.error("%s: %s", self.participant.id, one_line(error, 300))
        # The page is new, or was away for some ticks: what it has simulated may not be what happened.
        return await asyncio.to_thread(self.view, problem, kind, with_past=isinstance(message, m.Hello))

    async def leave(self) -> None:
        """Pause the run, because the page was closed."""
        if self.participant.session is not None:
            await asyncio.to_thread(_stand_still, self.participant.session)

    # The view

    def view(self, problem: str = "", kind: str = "", *, with_past: bool = False) -> Json:
        """The complete content of the page. A run that is being driven is paused, because the page forgets its keys.

        Args:
            problem: why the last message had no effect; empty if it had.
            kind: of the problem.
            with_past: whether a page that simulates runs itself gets the ticks that the present run has, because it may
                have simulated others.
        """
        participant = self.participant
        if participant.session is not None:
            _stand_still(participant.session)
        view: Json = {
            "type": "view",
            "language": participant.language,
            "step": step_content(participant),
            "progress": participant.progress,
            "runs": participant.runs,
            "canUndo": participant.can_undo,
            "isPreview": self._is_preview,
            "participant": participant.id,
            "problem": problem,
            "problemKind": kind,
        }
        # The page shows `drive` or `rating` in place of the step, if there is one.
        if participant.is_driving and participant.session is not None:
            view["drive"] = self._drive(participant.session)
            if self._predicts:
                view["drive"]["follow"] = self._follow(participant.session, with_past=with_past or self._is_apart)
                self._is_apart = False
        # The run to rate is missing after the last one, and where no recorded run can be read.
        if participant.step.kind == "ratings" and participant.record is not None and participant.rating is not None:
            view["rating"] = self._rating(participant.record, participant.rating)
        return view

    def _drive(self, session: Session) -> Json:
        """The content of the page for a run, or a practice run."""
        config, step, language = self.participant.study.config, self.participant.step, self.participant.language
        texts = config.runs[step.block].label if step.kind == "run" else LabelTexts()  # a practice has no translations
        return {
            **self._driving_state(session),
            "scene": scene_data(session.scene),
            "before": state_data(session.before),
            "label": label_content(session.label_spec, texts, language),
            "undoneLabel": session.undone_label,
            "isPractice": step.kind == "practice",
            "isHolonomic": session.scene.robot.moves_sideways,
            "rules": self.participant.rules,
            "limit": session.scene.rules.time_limit,
            "allowed": {key: getattr(config, key) for key in ("discard", "redo", "undo")},
            "changes": config.changes,
            "view": config.view,
            "context": session.config.context,
            "isRestarted": bool(session.notice) and session.number_of_runs == 1 and not session.ticks,
            "legend": self._legend(session.after),
        }

    def _follow(self, session: Session, *, with_past: bool) -> Json:
        """The run as a page gets it that simulates the run itself."""
        return {
            "beginning": session.beginning | {"run": self.run},
            "past": [list(map(_row, events)) for events in session.past_events] if with_past else None,
            "first": list(map(_row, session.waiting_events)),
        }

    def _rating(self, record: EpisodeRecord, rating: RatingSession) -> Json:
        """The content of the page for a recorded run to rate."""
        if record is not self._shown_record:
            self._shown_record, self.shown, self._shown_at = record, self.shown + 1, self._clock()
        block = self.participant.study.config.ratings[self.participant.step.block]
        return {
            "shown": self.shown,
            "scene": scene_data(record.scene()),
            "states": states_data(list(record.snapshots())),
            "label": block.question.content(self.participant.language) | {"required": True},
            "done": rating.done / max(rating.total, 1),
            "breakDue": rating.break_due,
            "context": record.context,
            "view": block.view,
        }

    def _legend(self, snapshot: Snapshot) -> list[dict[str, str]]:
        """The legend of the symbols in a picture, in the participant's language."""
        words = self.participant.study.tables[self.participant.language]

        def wording(name: str, **values: object) -> str:
            return words[f"legend.{name}"].format(**values)

        layers = Layers(zones="zones" in self.participant.study.config.changes, legend=True)
        entries = legend_data(Legend.of([snapshot], layers, wording=wording))
        return [entry for entry in entries if entry["name"] not in UNDRAWN]

    # Ticks

    async def _tick(self, tick: m.Tick) -> Json | None:
        """Simulate a tick, once, and in its turn."""
        session = self.driven_run
        # The page sent it before it knew that the run is over.
        if session is None or tick.run != self.run:
            return None
        # The answer says so, and the page stops its clock.
        if self._is_paused():
            self._is_apart = True
            await asyncio.to_thread(_stand_still, session)
            return self._tick_answer(session, tick)
        # The page repeats it after an interruption of the connection.
        if tick.number < session.ticks or session.state == "ended":
            return self._tick_answer(session, tick)
        # Messages before this one are lost: the page gets the present state, and goes on from there.
        if tick.number > session.ticks:
            return await asyncio.to_thread(self.view, with_past=True)
        await self._wait_for_turn(session.after.dt)
        events = [event.event() for event in tick.events]
        if tick.round_trip is not None:
            self.round_trip = tick.round_trip
            value = quantised(round(min(tick.round_trip, 1.0), 3))
            if self._recorded_trip is None or abs(value - self._recorded_trip) >= _SMALLEST_CHANGE:
                events.append(DeviceEvent(NETWORK_DEVICE, ROUND_TRIP, value))
                self._recorded_trip = value
        if tick.predicted != self._is_predicted:
            events.append(DeviceEvent(NETWORK_DEVICE, PREDICTED, float(tick.predicted)))
            self._is_predicted = tick.predicted
        last = {(event.device, event.control): event for event in events}  # one event per control and tick
        session.dropped_ticks += tick.dropped
        session.tick(tuple(last.values()))
        return self._tick_answer(session, tick)

    def _tick_answer(self, session: Session, tick: m.Tick) -> Json:
        return {"type": "tick", "asked": tick.number, **self._driving_state(session)}

    def _driving_state(self, session: Session) -> Json:
        """The part of a run's content that changes from tick to tick."""
        return {
            "run": self.run,
            "ticks": session.ticks,
            "status": session.state,
            "state": driven_state(session),
            "outcome": session.outcome.status if session.outcome else None,
            "frameLabel": session.label,
            "broken": self.participant.broken_rule,
            "isUnsaved": session.journal_error is not None,
            "isStudyPaused": self._is_paused(),
        }

    async def _wait_for_turn(self, dt: float) -> None:
        """Delay the ticks of a page that requests them faster than real time."""
        now = self._clock()
        self._allowance = min(self._allowance + (now - self._filled) * _PACE / dt, float(_BURST))
        self._filled = now
        self._allowance -= 1.0
        if self._allowance < 0.0:
            await self._sleep(-self._allowance * dt / _PACE)

    # Actions

    def _perform(self, message: m.Message) -> None:
        """Carry a message out. `Participant` checks that actions about a step are about the present one.

        Raises:
            Sonata2dError, ValueError: it cannot be carried out; nothing is changed.
        """
        participant = self.participant
        match message:
            # The first message of a page. The browser's language applies until the participant chooses one.
            case m.Hello():
                if message.protocol != m.PROTOCOL:
                    raise ValueError("the page is of another version; reload it")
                if not participant.has_chosen_language:
                    participant.choose_language(preferred(participant.study.config.languages, message.languages))
                participant.resume()  # a step may lack its run, because the disk was full when it began
                if message.screen is not None and message.window is not None:
                    screen, window = ("x".join(map(str, size)) for size in (message.screen, message.window))
                    participant.device(screen, window, touch=message.touch)
            case m.Language():
                participant.choose_language(message.language)
            # Pages, consent and questions. The page offers `skip` in a preview only, but anybody can send it.
            case m.StepAction(type="skip") if not self._is_preview:
                raise ValueError("steps can be skipped in a preview only")
            case m.StepAction(type=("read" | "decline" | "skip") as action):
                getattr(participant, action)(message.step)
            case m.Consent():
                participant.consent(message.step, message.ticked)
            case m.Answer():
                participant.answer(message.step, message.values)
            # Ratings have no step id: the number of the recorded run tells a second click from the next rating.
            case m.Rate():
                if message.shown != self.shown or participant.record is None:
                    raise ValueError("this run is rated")
                # by the clock of the server: a program can send anything
                elapsed, times = self._clock() - self._shown_at, participant.record.states.time
                if elapsed < _SEEN * float(times[-1] - times[0]):
                    raise ValueError("the run has not been shown to its end")
                seconds = round(min(message.seconds, elapsed), 2)
                participant.rate(message.label, seconds=seconds, whole=message.whole)
            case m.Action(type="rest"):
                if participant.rating is not None:
                    participant.rating.take_break()
            # Taking back is possible after the run, from another step, too.
            case m.Action(type=("reconsider" | "undo") as action):
                getattr(participant, action)()
            case m.RunAction() | m.Keep():
                session = self.driven_run
                if session is not None and message.run == self.run:  # else a second click: that run is over
                    self._perform_about_run(message, session)

    def _perform_about_run(self, message: m.RunAction | m.Keep, session: Session) -> None:
        participant = self.participant
        match message:
            case m.Keep():
                participant.keep(message.label)
            case m.RunAction(type="stop"):
                session.stop()
            case m.RunAction(type=("finish_practice" | "discard" | "redo") as action):
                getattr(participant, action)()
            case m.RunAction():  # `pause`: the view, which is the answer, pauses the run
                pass


def preferred(known: Sequence[str], wanted: Iterable[str]) -> str:
    """The first wanted language that is known, in any regional variant; the first known one if none is.

    >>> preferred(["en", "de"], ["fr", "de-AT", "en"])
    'de'
    """
    by_language = {language.lower().partition("-")[0]: language for language in reversed(known)}
    matches = (by_language.get(language.strip().lower().partition("-")[0]) for language in wanted)
    return next(filter(None, matches), known[0])


def _row(event: DeviceEvent) -> list[str | float]:
    return [event.device, event.control, event.value]


def driven_state(session: Session) -> Json:
    """The present state of a run for the page, and whether its robot waits for others at its goal."""
    return state_data(session.after) | {"hasArrived": session.has_arrived}


def _stand_still(session: Session) -> None:
    """Pause the run and release all controls; a page that continues reports pressed controls again."""
    session.pause()
    session.release()
