"""The first screen: asks for the name of the driver or rater."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Literal

import pygame
import pygame_gui

from ..collect.texts import text
from ..core.labels import LabelSpec
from ..errors import Sonata2dError
from ..view.palette import FLOOR
from .actions import Action
from .answer import Answer
from .cards import Card
from .stage import Screen, Stage

_Role = Literal["driver", "rater"]
_NAME = LabelSpec("text", when="run")


class NameScreen(Screen):
    """Asks for a name and continues with the screen made from it.

    Args:
        follow: makes the next screen from the name; its errors are shown, and the question is asked again.
        role: `driver` or `rater`.

    Attributes:
        answer: field of the name, while the screen is shown.
    """

    def __init__(self, follow: Callable[[str], Screen], *, role: _Role = "driver") -> None:
        self._follow, self._role = follow, role
        self._problem = ""
        self.answer: Answer | None = None  # the field is empty at first: the next driver is another one
        self._following: Screen | None = self

    def enter(self, stage: Stage) -> None:
        self._stage = stage
        buttons = [(text("name.start"), Action.CONFIRM), (text("name.quit"), Action.QUIT)]
        self._card = Card(
            stage.ui,
            stage.scale,
            text(f"name.{self._role}"),
            [text(f"name.{self._role}_line")],
            buttons,
            warning=self._problem,
            free_height=partial(Answer.height_of, _NAME),
        )
        name = self.answer.label if self.answer is not None else None
        self.answer = Answer(_NAME, stage.ui, self._card.free, self._card.scale, name)

    def handle(self, event: pygame.Event) -> None:
        pressed = self._card.pressed(event)
        escaped = event.type == pygame.KEYDOWN and event.key == pygame.K_ESCAPE
        assert self.answer is not None
        if event.type == pygame.QUIT or pressed is Action.QUIT or escaped:
            self._following = None
        elif pressed is Action.CONFIRM or event.type == pygame_gui.UI_TEXT_ENTRY_FINISHED:
            try:
                self._following = self._follow(self.answer.label or "")
            except Sonata2dError as error:  # such as a name that cannot be used
                self._problem = str(error)
                self._stage.ui.clear_and_reset()
                self.enter(self._stage)

    def advance(self, seconds: float) -> Screen | None:
        return self._following

    def draw(self, surface: pygame.Surface) -> None:
        surface.fill(FLOOR)
        self._card.draw(surface)
