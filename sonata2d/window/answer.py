"""Where a rater answers: buttons, a scale or a line of text, each by mouse and by keys."""

from __future__ import annotations

from typing import Any

import pygame
import pygame_gui
from pygame_gui.elements import UIButton, UITextEntryLine

from ..core.labels import LabelSpec
from .bars import Entry, Scale, button_row

_GAP, _HIGH = 6, 40  # pixels at scale 1, between rows and of a row
_LONGEST = 2000  # characters of a text


class Answer:
    """Widgets for one answer; nothing is chosen before the person chooses.

    Args:
        spec: what is asked.
        ui: the manager of the window's widgets.
        box: where to stand, pixels.
        scale: of texts and widgets.
        label: what was answered before the window changed its size.
    """

    def __init__(
        self, spec: LabelSpec, ui: pygame_gui.UIManager, box: pygame.Rect, scale: float, label: Any = None
    ) -> None:
        self.spec, self._label = spec, label
        self._buttons: list[UIButton] = []
        self._scale: Scale | None = None
        self._entry: UITextEntryLine | None = None
        if spec.kind == "slider":
            self._scale = Scale(box, spec.ends, scale=scale, value=label)
        elif spec.kind == "text":
            place = pygame.Rect(box.left, 0, box.width, round(_HIGH * scale))
            place.centery = box.centery
            self._entry = UITextEntryLine(place, ui, initial_text=label or "", placeholder_text="type here")
            self._entry.set_text_length_limit(_LONGEST)
            ui.set_focus_set(self._entry)
        else:
            self._buttons = self._rows(ui, box, scale)
            self._choose(label)

    @property
    def label(self) -> Any:
        """What is answered; None as long as nothing is."""
        if self._scale is not None:
            return None if self._scale.value is None else self.spec.label_at(self._scale.value)
        if self._entry is not None:
            return self._entry.get_text().strip() or None
        return self._label

    @property
    def takes_letters(self) -> bool:
        """Whether keys are the letters of a text now."""
        return self._entry is not None and self._entry.is_focused

    def handle(self, event: pygame.Event) -> bool:
        """Whether the event was for it."""
        if self._scale is not None:
            return self._scale.handle(event)
        if event.type != pygame.KEYDOWN or not self._buttons:
            return False
        label = self._label_of(event.key)
        if label is not None:
            self._choose(label)
        return label is not None

    def write(self, event: pygame.Event) -> None:
        """A key that is part of the text, wherever the focus was."""
        if self._entry is not None and not self._entry.is_focused:
            self._entry.ui_manager.set_focus_set(self._entry)
            self._entry.process_event(event)

    def kill(self) -> None:
        """Take its widgets away."""
        for button in self._buttons:
            button.kill()
        if self._entry is not None:
            self._entry.kill()

    def draw(self, surface: pygame.Surface) -> None:
        """What is no widget of its own."""
        if self._scale is not None:
            self._scale.draw(surface)

    @property
    def _labels(self) -> list[Any]:
        """All answers, in the order of their buttons: yes stands before no, classes from the first to the last."""
        if self.spec.kind == "yes_no":
            return [True, False]
        return list(range(1, self.spec.levels + 1))

    def _rows(self, ui: pygame_gui.UIManager, box: pygame.Rect, scale: float) -> list[UIButton]:
        """One row of buttons, or two where there are many."""
        labels, gap, high = self._labels, round(_GAP * scale), round(_HIGH * scale)
        width = len(labels) if len(labels) <= 5 else (len(labels) + 1) // 2
        rows = [labels[k : k + width] for k in range(0, len(labels), width)]
        high = min(high, (box.height - gap * (len(rows) - 1)) // len(rows))
        top = box.top + (box.height - len(rows) * (high + gap) + gap) // 2
        return [
            button
            for k, row in enumerate(rows)
            for button in button_row(
                ui,
                pygame.Rect(box.left, top + k * (high + gap), round(box.width * len(row) / width), high),
                [self._entry_of(label) for label in row],
                gap=gap,
                alike=True,
            )
        ]

    def _entry_of(self, label: Any) -> Entry:
        key = {True: "Y", False: "N"}[label] if self.spec.kind == "yes_no" else str(label)
        return self.spec.in_words(label), lambda: self._choose(label), f"key {key}"

    def _label_of(self, key: int) -> Any:
        """The answer that a key stands for: Y and N, digits, or arrows to go along the row; None: none."""
        labels = self._labels
        if self.spec.kind == "yes_no" and key in (pygame.K_y, pygame.K_n):
            return key == pygame.K_y
        digit = next((key - one + 1 for one in (pygame.K_1, pygame.K_KP_1) if 0 <= key - one < 9), 0)
        if digit:
            return labels[digit - 1] if digit <= len(labels) and self.spec.kind == "classes" else None
        if key not in (pygame.K_LEFT, pygame.K_RIGHT):
            return None
        step = 1 if key == pygame.K_RIGHT else -1
        if self._label is None:
            return labels[0 if step > 0 else -1]
        return labels[min(max(labels.index(self._label) + step, 0), len(labels) - 1)]

    def _choose(self, label: Any) -> None:
        """Answer, and show it."""
        self._label = label
        for button, own in zip(self._buttons, self._labels, strict=True):
            if own == label:
                button.select()
            else:
                button.unselect()
