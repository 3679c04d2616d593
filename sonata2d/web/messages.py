"""The messages of a page: one JSON object each, validated before it is used.

The page drives the simulation: it requests each tick by number, with the device events since the last one, and gets the
next state. A message that arrives twice changes nothing. Nothing here depends on a network.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, JsonValue, TypeAdapter, ValidationError

from ..core.devices import DeviceEvent
from ..core.files.limits import MAX_ID
from ..core.wording import one_line

PROTOCOL = 2
MAX_MESSAGE = 65_536  # bytes
_MAX_EVENTS = 64  # of one tick: each control at most once
REFUSED, FAILED, WRONG = "refused", "failed", "wrong"  # kinds of problems: of the message, the server, an answer
_DEVICES = r"^(keyboard|mouse|touch|pad[0-7]|label)$"

Name = Annotated[str, Field(min_length=1, max_length=80)]
Step = Annotated[str, Field(min_length=1, max_length=120)]
Pixels = Annotated[int, Field(ge=0, le=100_000)]
Whole = Annotated[int, Field(ge=-MAX_ID, le=MAX_ID)]  # others cannot be sent back
Label = bool | Whole | float | Annotated[str, Field(max_length=5000)]


class Message(BaseModel):
    """Base class of all messages."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)


class Hello(Message):
    """The page is ready, for the first time or again.

    Attributes:
        protocol: version of these messages.
        languages: of the browser, the preferred one first.
        screen, window: width and height of the screen and of the window, px of the page.
        touch: whether the page is touched first of all.
    """

    type: Literal["hello"]
    protocol: Whole
    languages: Annotated[list[Annotated[str, Field(max_length=40)]], Field(max_length=40)] = []
    screen: Annotated[list[Pixels], Field(min_length=2, max_length=2)] | None = None
    window: Annotated[list[Pixels], Field(min_length=2, max_length=2)] | None = None
    touch: bool = False


class Ping(Message):
    """A request for an answer, by which the page measures the round-trip time."""

    type: Literal["ping"]


class Language(Message):
    """The participant chose a language."""

    type: Literal["language"]
    language: Annotated[str, Field(max_length=20)]


class Action(Message):
    """An action of the participant that needs no details.

    Attributes:
        type: `reconsider`, show the consent again; `undo`, take back the last run that was kept; `rest`, the break
            between ratings is over.
    """

    type: Literal["reconsider", "undo", "rest"]


class StepAction(Message):
    """An action about a step.

    Attributes:
        type: `read`, the participant has read the page; `decline`, the participant does not consent; `skip`, go on
            without doing the step, in a preview.
        step: id of the step that the page shows.
    """

    type: Literal["read", "decline", "skip"]
    step: Step


class Consent(Message):
    """The participant ticked the statements and takes part."""

    type: Literal["consent"]
    step: Step
    ticked: Annotated[list[bool], Field(max_length=20)]


class Answer(Message):
    """Answers to the questions of a step."""

    type: Literal["answer"]
    step: Step
    values: Annotated[dict[str, JsonValue], Field(max_length=200)]


class Event(Message):
    """A change of one control; see `DeviceEvent`."""

    device: Annotated[str, Field(pattern=_DEVICES)]
    control: Name
    value: Annotated[float, Field(ge=-1.0, le=1.0)]

    def event(self) -> DeviceEvent:
        """The event as the simulation gets it."""
        return DeviceEvent(self.device, self.control, self.value)


class Tick(Message):
    """A request to simulate the next tick.

    Attributes:
        run: number of the run, as the server sent it.
        number: number of ticks before this one.
        events: device events since the last tick.
        round_trip: the latest time from the request of a tick to its answer, s; None before the first answer.
        dropped: number of ticks of real time that the page was too slow for since the last tick.
        predicted: whether the page shows ticks that it simulates itself, before the server answers.
    """

    type: Literal["tick"]
    run: Whole
    number: Annotated[int, Field(ge=0, le=MAX_ID)]
    events: Annotated[list[Event], Field(max_length=_MAX_EVENTS)] = []
    round_trip: Annotated[float, Field(ge=0.0, le=3600.0)] | None = None
    dropped: Annotated[int, Field(ge=0, le=1_000_000)] = 0
    predicted: bool = False


class RunAction(Message):
    """An action about a run.

    Attributes:
        type: `pause`, stand still; `stop`, end the run; `finish_practice`, go on after a practice run; `discard`,
            another scene replaces it; `redo`, drive in the same scene again.
        run: number of the run, as the server sent it.
    """

    type: Literal["pause", "stop", "finish_practice", "discard", "redo"]
    run: Whole


class Keep(Message):
    """Keep the run that ended."""

    type: Literal["keep"]
    run: Whole
    label: Label | None = None


class Rate(Message):
    """The rating of a recorded run.

    Attributes:
        shown: number of the recorded run, as the server sent it.
        label: the answer.
        seconds: playing time, s.
        whole: whether the run was watched to its end.
    """

    type: Literal["rate"]
    shown: Whole
    label: Label
    seconds: Annotated[float, Field(ge=0.0, le=1e6)]
    whole: bool


class Request(Message):
    """A request of the researcher's page for data.

    Attributes:
        type: `overview`, the progress of all participants; `agreement`, the agreement of the ratings.
    """

    type: Literal["overview", "agreement"]


class PauseStudy(Message):
    """Pause all runs of the study, or let them go on.

    Attributes:
        value: True to pause.
    """

    type: Literal["pause_study"]
    value: bool


class Add(Message):
    """Add participants, each with a link of their own."""

    type: Literal["add"]
    count: Annotated[int, Field(ge=1, le=1000)]


class Look(Message):
    """A request for the live view of one participant.

    Attributes:
        participant: id of the participant.
        scene: key of the scene that the page has; empty before the first.
    """

    type: Literal["look"]
    participant: Name
    scene: Annotated[str, Field(max_length=120)] = ""


_ParticipantMessage = Annotated[
    Hello | Ping | Language | Action | StepAction | Consent | Answer | Tick | RunAction | Keep | Rate,
    Field(discriminator="type"),
]
_ResearcherMessage = Annotated[Request | PauseStudy | Add | Look, Field(discriminator="type")]
_participant: TypeAdapter[Any] = TypeAdapter(_ParticipantMessage)
_researcher: TypeAdapter[Any] = TypeAdapter(_ResearcherMessage)


def parse_message(data: str | bytes, *, of_researcher: bool = False) -> Message:
    """A message of a participant's page, or of the researcher's page.

    Raises:
        ValueError: the data is not a valid message; one line.
    """
    if len(data) > MAX_MESSAGE:
        raise ValueError(f"the message has {len(data)} bytes; up to {MAX_MESSAGE} are read")
    try:
        message: Message = (_researcher if of_researcher else _participant).validate_json(data)
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False, include_context=False)[0]
        place = ".".join(map(str, first["loc"]))
        raise ValueError(one_line(f"{place}: {first['msg']}" if place else first["msg"], 200)) from None
    except RecursionError:
        raise ValueError("the message is nested too deeply") from None
    return message
