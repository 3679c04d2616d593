"""The panel with the question that is asked while driving."""

from __future__ import annotations

from functools import lru_cache

import pygame

from ..collect.texts import text
from ..view.fonts import wrapped
from ..view.palette import FAINT, PAPER
from .answer import Answer, FrameQuestion, answers_of, labels_of, question_of
from .widgets import EDGE, LARGE, SMALL, Choices, Scale, line_height, text_size, write, write_lines

_WIDTH, _PADDING, _GAP, _MARGIN = 760, 14, 6, 8  # px at scale 1; the margin is beside a panel in a narrow window


class _QuestionPanel:
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
        self._head = wrapped(question_of(question.spec), self._inner, self._size)
        self._head_height = len(self._head) * line_height(self._size)
        self._answer_height = Answer.height_of(question.spec, self._inner, scale)
        self.height = 2 * (self._padding + self._gap) + self._head_height + self._answer_height
        self.height += line_height(self._key_size)

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
        middle = place.bottom + self._gap + line_height(self._key_size) / 2
        levels = self._question.spec.levels
        keys = text("question.number_keys", count=levels) if levels else text("question.frame_keys")
        write(surface, keys, (box.centerx, middle), size=self._key_size, colour=FAINT, anchor="center",
              max_width=self._inner)  # fmt: skip
        return box

    def _draw_answers(self, surface: pygame.Surface, place: pygame.Rect) -> None:
        spec, position = self._question.spec, self._question.position
        if spec.kind == "slider":
            Scale(place, spec.ends, scale=self._scale, value=position, shows_value=False).draw(surface)
        else:
            chosen = None if position is None else labels_of(spec).index(spec.label_at(position))
            Choices(place, answers_of(spec), self._scale, chosen).draw(surface)


@lru_cache(maxsize=8)
def question_panel(window: tuple[int, int], question: FrameQuestion, scale: float) -> _QuestionPanel:
    """The panel for a window size; kept, because its layout is needed for every frame."""
    return _QuestionPanel(window, question, scale)
