"""The panel with the question that is asked while driving."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import pygame

from ..view.fonts import wrapped
from ..view.palette import FAINT, PAPER
from .widgets import EDGE, LARGE, SMALL, Choices, Scale, line_height, text_size, write, write_lines

_WIDTH, _PADDING, _GAP, _MARGIN = 760, 14, 6, 8  # px at scale 1; the margin is beside a panel in a narrow window


@dataclass(frozen=True, slots=True)
class FrameQuestion:
    """A question that is answered while driving.

    Attributes:
        text: the question.
        choices: names of the answers, from position 0 to 1; empty for a continuous scale.
        ends: meanings of 0 and 1 on a continuous scale.
        keys: the controls that answer it.
        position: of the current answer, 0 to 1; None before the first answer.
    """

    text: str
    choices: tuple[str, ...] = ()
    ends: tuple[str, str] = ("", "")
    keys: str = ""
    position: float | None = None


class QuestionPanel:
    """The question with its answers and the current one, drawn as at the end of a run but without the mouse.

    Args:
        window: size of the surface, px.
        question: the question.
        scale: of texts and widgets.

    Attributes:
        height: of the panel, px.
    """

    def __init__(self, window: tuple[int, int], question: FrameQuestion, scale: float) -> None:
        self._question, self._scale = question, scale
        self._padding, self._gap, margin = (round(length * scale) for length in (_PADDING, _GAP, _MARGIN))
        self._width = min(round(_WIDTH * scale), window[0] - 2 * margin)
        self._inner = self._width - 2 * self._padding
        self._size, self._key_size = text_size(LARGE, scale), text_size(SMALL, scale)
        self._head = wrapped(question.text, self._inner, self._size)
        self._head_height = len(self._head) * line_height(self._size)
        if question.choices:
            self._answer_height = Choices.height_of(question.choices, self._inner, scale)
        else:
            self._answer_height = Scale.height_of(question.ends, self._inner, scale)
        self.height = 2 * self._padding + self._head_height + self._gap + self._answer_height
        if question.keys:
            self.height += self._gap + line_height(self._key_size)

    def draw(self, surface: pygame.Surface, bottom: int) -> pygame.Rect:
        """Draw the panel above a y coordinate; returns its box, px."""
        box = pygame.Rect(0, 0, self._width, self.height)
        box.midbottom = surface.get_width() // 2, bottom
        radius = round(10 * self._scale)
        pygame.draw.rect(surface, PAPER, box, border_radius=radius)
        pygame.draw.rect(surface, EDGE, box, width=1, border_radius=radius)
        place = pygame.Rect(box.left + self._padding, box.top + self._padding, self._inner, self._head_height)
        write_lines(surface, self._head, place.center, size=self._size)
        place.top, place.height = place.bottom + self._gap, self._answer_height
        self._draw_answers(surface, place)
        if self._question.keys:
            middle = place.bottom + self._gap + line_height(self._key_size) / 2
            keys, width = self._question.keys, self._inner
            write(surface, keys, (box.centerx, middle), size=self._key_size, colour=FAINT, anchor="center",
                  max_width=width)  # fmt: skip
        return box

    def _draw_answers(self, surface: pygame.Surface, place: pygame.Rect) -> None:
        choices, position = self._question.choices, self._question.position
        if choices:
            chosen = None if position is None else round(position * (len(choices) - 1))
            Choices(place, choices, self._scale, chosen).draw(surface)
        else:
            Scale(place, self._question.ends, scale=self._scale, value=position, shows_value=False).draw(surface)


@lru_cache(maxsize=8)
def question_panel(window: tuple[int, int], question: FrameQuestion, scale: float) -> QuestionPanel:
    """The panel for a window size; kept, because its layout is needed for every frame."""
    return QuestionPanel(window, question, scale)
