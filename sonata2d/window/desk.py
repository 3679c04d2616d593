"""What lies over the scene while a person drives: the card of the state, its question, menu, help, scene panel."""

from __future__ import annotations

from typing import Any, Literal

import pygame
import pygame_gui

from ..scenegen import ScenarioConfig
from ..session import Session
from .actions import KEYS, Action
from .answer import Answer
from .cards import Card
from .collect_texts import ENDED, MENU, told_of_end
from .dial import Dial
from .scene_panel import ScenePanel
from .stage import Stage

Overlay = Literal["help", "menu", "scene"]
_ROOM = 96  # px at scale 1, for an answer


class Desk:
    """Lays widgets as the session asks for; `lay` after every change of state, stage or size.

    Args:
        session: whose state is shown.

    Attributes:
        overlay: what was asked for to lie there instead of the state's card.
        answer: where the question that must be answered before the run is kept is answered, while it is asked.
    """

    def __init__(self, session: Session) -> None:
        self._session = session
        self.overlay: Overlay | None = None
        self.answer: Answer | None = None
        self._card: Card | None = None
        self._panel: ScenePanel | None = None

    def lay(self, stage: Stage, label: Any = None, notice: str = "") -> None:
        """Show what goes with state and overlay; widgets that lay there before are taken away.

        Args:
            stage: where.
            label: what was answered already.
            notice: what else the person must know at the end of a run.
        """
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
            self._card = Card(ui, scale, "Menu", [f"{session.kept} runs kept"], MENU, stacked=True)
        elif session.state == "ended":
            asks = session.label_spec.per_run
            title, lines = told_of_end(session)
            lines += [notice] if notice else []
            self._card = Card(ui, scale, title, lines, ENDED, room=_ROOM if asks else 0, high_up=True)
            if asks:
                self.answer = Answer(session.label_spec, ui, self._card.free, scale, label)

    def handle(self, event: pygame.Event) -> Action | ScenarioConfig | bool | None:
        """What a widget was asked: an action, or other scenes; True: the event is taken.

        Raises:
            ConfigError: the counts in the scene panel do not go together.
        """
        if self._panel is not None:
            return self._panel.handle(event) or True
        if self.answer is not None and event.type == pygame_gui.UI_TEXT_ENTRY_FINISHED:
            return Action.CONFIRM
        if self.answer is not None and (self.answer.handle(event) or _is_letter(event, self.answer)):
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
        self.lay(stage, dial.label)

    def draw(self, surface: pygame.Surface) -> None:
        """All but the widgets."""
        if self._card is not None:
            self._card.draw(surface)
        if self.answer is not None:
            self.answer.draw(surface)


def _is_letter(event: pygame.Event, answer: Answer) -> bool:
    """Whether a key writes into a text, so that it shall do nothing else."""
    if event.type not in (pygame.KEYDOWN, pygame.KEYUP) or not answer.takes_letters:
        return False
    return event.key not in (pygame.K_RETURN, pygame.K_KP_ENTER, pygame.K_ESCAPE, pygame.K_F1)
