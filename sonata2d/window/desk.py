"""What lies over the scene while a person drives: the card of the state, its question, menu, help, scene panel."""

from __future__ import annotations

from typing import Any, Literal

import pygame
import pygame_gui

from ..collect.session import Session
from ..scenegen.scenario.config import ScenarioConfig
from .actions import KEYS, Action
from .answer import Answer
from .cards import Card
from .collect_texts import ENDED, MENU, told_of_end
from .dial import Dial
from .pads import PLUGGING
from .scene_panel import ScenePanel
from .stage import Stage

Overlay = Literal["help", "menu", "scene"]
_ROOM = 96  # px at scale 1, for an answer
_COMMANDS = (pygame.K_RETURN, pygame.K_KP_ENTER, pygame.K_ESCAPE, pygame.K_F1)  # while a text is written
_TIME = (pygame.WINDOWFOCUSLOST, *PLUGGING)  # goes on under a panel


class Desk:
    """Lays widgets as the session asks for; `lay` after every change of state, stage or size.

    Args:
        session: whose state is shown.
        runs: how many are asked for.

    Attributes:
        overlay: what was asked for to lie there instead of the state's card.
        answer: where the question that must be answered before the run is kept is answered, while it is asked.
        label: what was answered of this run so far; outlives its widgets.
        notice: what else the person must know at the end of a run.
    """

    def __init__(self, session: Session, runs: int | None) -> None:
        self._session, self._runs, self._drives_on = session, runs, False
        self._label: Any = None
        self.notice = ""
        self.overlay: Overlay | None = None
        self.answer: Answer | None = None
        self._card: Card | None = None
        self._panel: ScenePanel | None = None

    @property
    def label(self) -> Any:
        return self.answer.label if self.answer is not None else self._label

    @label.setter
    def label(self, label: Any) -> None:
        if self.answer is not None:
            self.answer.kill()
        self._label, self.answer = label, None

    @property
    def is_done(self) -> bool:
        """Whether all runs that were asked for are kept, and the person was not told yet."""
        done = self._runs is not None and self._session.kept >= self._runs
        return done and self._session.state == "waiting" and not self._drives_on

    def drive_on(self) -> None:
        """The person does, though all runs are kept."""
        self._drives_on = True

    def lay(self, stage: Stage) -> None:
        """Show what goes with state and overlay; widgets that lay there before are taken away."""
        self._label = self.label
        for widget in (self._card, self._panel, self.answer):
            if widget is not None:
                widget.kill()
        self._card = self._panel = self.answer = None
        session, ui, scale = self._session, stage.ui, stage.scale
        if self.overlay == "scene":
            self._panel = ScenePanel(ui, scale, session.config)
        elif self.overlay == "help":
            self._card = Card(ui, scale, "Keys and buttons", KEYS, [("Close", Action.HELP)])
        elif self.overlay == "menu":
            self._card = Card(ui, scale, "Menu", [f"Runs kept: {session.kept}"], MENU, stacked=True)
        elif session.state == "ended":
            asks = session.label_spec.per_run
            title, lines = told_of_end(session)
            self.notice = ""
            self._card = Card(ui, scale, title, lines, ENDED, room=_ROOM if asks else 0, high_up=True)
            if asks:
                self.answer = Answer(session.label_spec, ui, self._card.free, scale, self._label)
        elif self.is_done:
            buttons = [("Close the window", Action.QUIT), ("Drive on", Action.CONFIRM)]
            lines = [f"{session.kept} runs are kept in {session.out}."]
            self._card = Card(ui, scale, "All runs are done: thank you!", lines, buttons)

    def handle(self, event: pygame.Event) -> Action | ScenarioConfig | bool | None:
        """What a widget was asked: an action, or other scenes; True: the event is taken.

        Raises:
            ConfigError: the counts in the scene panel do not go together.
        """
        if self._panel is not None:
            return self._panel.handle(event) or event.type not in _TIME
        if self.answer is not None and event.type == pygame_gui.UI_TEXT_ENTRY_FINISHED:
            return Action.CONFIRM
        if self.answer is not None and (self.answer.handle(event) or self._writes(event, self.answer)):
            return True
        if self._card is None:
            return None
        on_card = event.type == pygame.MOUSEBUTTONDOWN and self._card.box.collidepoint(event.pos)
        return self._card.pressed(event) or on_card or None

    def turn(self, stage: Stage, action: Action) -> None:
        """Answer by a wheel, trigger or button."""
        if self.answer is None or self.answer.spec.kind == "text":
            return
        dial = Dial(self.answer.spec)
        dial.set(self.answer.label)
        dial.turn(action)
        self.label = dial.label
        self.lay(stage)

    def draw(self, surface: pygame.Surface) -> None:
        """All but the widgets."""
        if self._card is not None:
            self._card.draw(surface, self.notice if self._session.state == "ended" else "")
        if self.answer is not None:
            self.answer.draw(surface)

    def _writes(self, event: pygame.Event, answer: Answer) -> bool:
        """Whether a key writes into a text, so that it shall do nothing else; the text has it, wherever was clicked."""
        if event.type not in (pygame.KEYDOWN, pygame.KEYUP, pygame.TEXTINPUT) or answer.spec.kind != "text":
            return False
        if event.type != pygame.TEXTINPUT and event.key in _COMMANDS:
            return False
        answer.write(event)
        return True
