"""What the driving screen says, by state."""

from __future__ import annotations

from typing import Literal

from ..collect.run import State
from ..collect.session import Session
from .actions import Action

Light = Literal["waiting", "recording", "paused", "frozen"]

_DRIVE = ("W A S D, stick or drag", "drive")
_HELP = ("F1", "help")
KEYS: dict[State, tuple[tuple[str, str], ...]] = {
    "waiting": (_DRIVE, ("N", "another scene"), ("V", "camera"), ("G", "scene"), ("Z", "zones"), _HELP),
    "driving": (_DRIVE, ("Enter", "end the run"), ("P", "pause"), ("V", "camera"), ("H", "readings"), _HELP),
    "paused": (("P", "go on"), ("R", "redo"), ("N", "another scene"), _HELP),
    "ended": (("Enter", "keep"), ("Backspace", "discard"), ("R", "redo"), _HELP),
}
WRITING = (("Enter", "keep"), ("Esc", "menu"), ("Ctrl+Q", "close"))  # where letters are a text
LIGHTS: dict[State, Light] = {"waiting": "waiting", "driving": "recording", "paused": "paused", "ended": "frozen"}
ENDINGS = {"goal": "Goal reached", "timeout": "Time is over", "contact": "Collision", "stopped": "Run ended"}

MENU = (
    ("Go on", Action.MENU),
    ("Redo this scene", Action.REDO),
    ("Another scene", Action.NEXT),
    ("Undo the last keep", Action.UNDO),
    ("What scenes look like", Action.SCENE),
    ("Set up the controls", Action.REMAP),
    ("Keys and buttons", Action.HELP),
    ("Quit", Action.QUIT),
)


ENDED = (("Keep (Enter)", Action.CONFIRM), ("Discard (Backspace)", Action.DISCARD), ("Redo (R)", Action.REDO))


def told_of_end(session: Session) -> tuple[str, list[str]]:
    """Title and lines of the card at the end of a run."""
    assert session.outcome is not None
    spec, status = session.label_spec, session.outcome.status
    asked = (spec.question or spec.name) if spec.per_run else "Keep this run?"
    return ENDINGS.get(status, status), [f"{session.outcome.time:.1f} s driven. {asked}"]


def recovered_notice(session: Session) -> str:
    """What to know of a run that goes on."""
    assert session.recovered is not None
    told = f"Your last run was left open after {session.recovered:.1f} s; it goes on from there."
    other = session.scene.name != session.config.name
    return told + (f" It is of {session.scene.name}; {session.config.name} comes with the next scene." if other else "")


def standing_notice(session: Session) -> str:
    """What to do now, while nothing moves."""
    if session.state == "paused":
        return "Paused: drive on, or press P"
    if session.state != "waiting":
        return ""
    return "Drive to the green target: the world waits for your first move"
