"""The first screen: asks for the name of the driver or rater."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import pygame
import pygame_gui
from pygame_gui.elements import UITextEntryLine

from ..collect.texts import text
from ..errors import Sonata2dError
from ..view.palette import FLOOR
from .actions import Action
from .cards import Card
from .stage import Screen, Stage

Role = Literal["driver", "rater"]
_ENTRY = 42  # height of the text field, px at scale 1


class NameScreen:
    """Asks for a name and continues with the screen made from it.

    Args:
        follow: makes the next screen from the name; its errors are shown, and the question is asked again.
        role: `driver` or `rater`.

    Attributes:
        entry: field of the name, while the screen is shown.
    """

    def __init__(self, follow: Callable[[str], Screen], *, role: Role = "driver") -> None:
        self._follow, self._role = follow, role
        self._name = self._problem = ""  # the field is empty at first: the next driver is another one
        self.entry: UITextEntryLine | None = None
        self._following: Screen | None = self

    def enter(self, stage: Stage) -> None:
        self._stage = stage
        if self.entry is not None:
            self._name = self.entry.get_text()
        buttons = [(text("name.start"), Action.CONFIRM), (text("name.quit"), Action.QUIT)]
        self._card = Card(
            stage.ui,
            stage.scale,
            text(f"name.{self._role}"),
            [text(f"name.{self._role}_line")],
            buttons,
            warning=self._problem,
            free_height=lambda _, scale: round(_ENTRY * scale),
        )
        self.entry = UITextEntryLine(self._card.free, stage.ui, initial_text=self._name)
        stage.ui.set_focus_set(self.entry)

    def handle(self, event: pygame.Event) -> None:
        pressed = self._card.pressed(event)
        escaped = event.type == pygame.KEYDOWN and event.key == pygame.K_ESCAPE
        assert self.entry is not None
        if event.type == pygame.QUIT or pressed is Action.QUIT or escaped:
            self._following = None
        elif pressed is Action.CONFIRM or event.type == pygame_gui.UI_TEXT_ENTRY_FINISHED:
            self._name = self.entry.get_text()
            try:
                self._following = self._follow(self._name)
            except Sonata2dError as error:
                self._problem = str(error)
                self._card.kill()
                self.entry.kill()
                self.enter(self._stage)

    def advance(self, seconds: float) -> Screen | None:
        return self._following

    def draw(self, surface: pygame.Surface) -> None:
        surface.fill(FLOOR)
        self._card.draw(surface)

    def leave(self) -> None:
        """Nothing needs to be saved."""
