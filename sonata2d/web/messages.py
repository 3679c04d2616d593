"""What a page may send: one JSON object per message, checked before anything else looks at it.

The page drives the simulation: it asks for each tick by number, with the device events since the last one, and gets the
next state. A message that arrives twice changes nothing. Nothing here depends on a network.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, JsonValue, TypeAdapter, ValidationError

from ..core.devices import DeviceEvent
from ..core.wording import one_line

PROTOCOL = 1
MAX_MESSAGE = 65_536  # bytes
MAX_EVENTS = 64  # of one tick: each control at most once
REFUSED, FAILED = "refused", "failed"  # kinds of problems: of a message, and of the server
_DEVICES = r"^(keyboard|mouse|touch|pad[0-7]|label)$"

Name = Annotated[str, Field(min_length=1, max_length=80)]
Step = Annotated[str, Field(min_length=1, max_length=120)]


class Message(BaseModel):
    """Base class of all messages."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)


class Hello(Message):
    """The page is ready, for the first time or again.

    Attributes:
        protocol: version of these messages.
        languages: of the browser, the preferred one first.
    """

    type: Literal["hello"]
    protocol: int
    languages: Annotated[list[Annotated[str, Field(max_length=40)]], Field(max_length=40)] = []


class Language(Message):
    """The participant chose a language."""

    type: Literal["language"]
    language: Annotated[str, Field(max_length=20)]


class Read(Message):
    """The participant has read a page."""

    type: Literal["read"]
    step: Step


class Consent(Message):
    """The participant ticked the statements and takes part."""

    type: Literal["consent"]
    step: Step
    ticked: Annotated[list[bool], Field(max_length=20)]


class Decline(Message):
    """The participant does not take part."""

    type: Literal["decline"]
    step: Step


class Reconsider(Message):
    """The participant wants to see the consent again."""

    type: Literal["reconsider"]


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
    """Simulate the next tick.

    Attributes:
        run: number of the run, as the server gave it.
        number: of ticks before this one.
        events: since the last tick.
        round_trip: the latest time from the request of a tick to its answer, s; None before the first answer.
        dropped: number of ticks of real time that the page was too slow for since the last tick.
    """

    type: Literal["tick"]
    run: int
    number: Annotated[int, Field(ge=0)]
    events: Annotated[list[Event], Field(max_length=MAX_EVENTS)] = []
    round_trip: Annotated[float, Field(ge=0.0, le=3600.0)] | None = None
    dropped: Annotated[int, Field(ge=0, le=1_000_000)] = 0


class Skip(Message):
    """Go on without doing the step, in a preview."""

    type: Literal["skip"]
    step: Step


class Pause(Message):
    """Stand still."""

    type: Literal["pause"]
    run: int


class Stop(Message):
    """End the run."""

    type: Literal["stop"]
    run: int


class Keep(Message):
    """Keep the run that ended."""

    type: Literal["keep"]
    run: int
    label: bool | int | float | Annotated[str, Field(max_length=5000)] | None = None


class FinishPractice(Message):
    """Go on after a practice run."""

    type: Literal["finish_practice"]
    run: int


class Discard(Message):
    """Discard the run, and drive in another scene."""

    type: Literal["discard"]
    run: int


class Redo(Message):
    """Drive in the same scene again."""

    type: Literal["redo"]
    run: int


class Undo(Message):
    """Take back the last run that was kept."""

    type: Literal["undo"]


class Rate(Message):
    """Rate the run on show.

    Attributes:
        shown: number of the run on show, as the server gave it.
        label: the answer.
        seconds: playing time, s.
        whole: whether the run was watched to its end.
    """

    type: Literal["rate"]
    shown: int
    label: bool | int | float | Annotated[str, Field(max_length=5000)]
    seconds: Annotated[float, Field(ge=0.0, le=1e6)]
    whole: bool


class Rest(Message):
    """The participant had a break between ratings."""

    type: Literal["rest"]


class Overview(Message):
    """How far are all participants."""

    type: Literal["overview"]


class Hold(Message):
    """Stop all runs for a while, or let them go on."""

    type: Literal["hold"]
    value: bool


class Add(Message):
    """Make links for new participants."""

    type: Literal["add"]
    count: Annotated[int, Field(ge=1, le=1000)]


class Look(Message):
    """Show what a participant does now.

    Attributes:
        participant: id of the participant.
        scene: key of the scene that the page has; empty before the first.
    """

    type: Literal["look"]
    participant: Name
    scene: Annotated[str, Field(max_length=120)] = ""


class Agreement(Message):
    """How well the ratings agree."""

    type: Literal["agreement"]


AnyMessage = Annotated[
    Hello | Language | Read | Consent | Decline | Reconsider | Answer | Tick | Pause | Stop | Keep | FinishPractice
    | Discard | Redo | Undo | Rate | Rest | Skip,
    Field(discriminator="type"),
]  # fmt: skip
ResearcherMessage = Annotated[Overview | Hold | Add | Look | Agreement, Field(discriminator="type")]
_participant: TypeAdapter[Any] = TypeAdapter(AnyMessage)
_researcher: TypeAdapter[Any] = TypeAdapter(ResearcherMessage)


def parse_message(data: str | bytes, *, of_researcher: bool = False) -> Message:
    """A message of a participant's page, or of the researcher's page.

    Raises:
        ValueError: it is none; one line.
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
