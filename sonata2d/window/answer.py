"""Answers to a label question: widgets for the mouse and keys, and a value changed by label actions."""

from __future__ import annotations

from typing import Any

import pygame
import pygame_gui
from pygame_gui.elements import UIButton, UITextEntryLine

from ..core.devices import DeviceEvent
from ..core.labels import LABEL_DEVICE, LabelSpec
from .actions import Action
from .widgets import ButtonSpec, Scale, button_row

_GAP, _ROW = 6, 40  # px at scale 1: between rows of buttons, and height of a row
_MAX_LENGTH = 2000  # characters of a text
_STEP = 0.05  # change of a slider label per action


class LabelSlider:
    """Position on a label's scale, changed by actions (keys, wheel, triggers); undefined before the first action.

    Args:
        spec: the question.

    Attributes:
        position: 0 to 1; None before the first action.
    """

    def __init__(self, spec: LabelSpec) -> None:
        self.spec = spec
        self.position: float | None = None

    @property
    def label(self) -> Any:
        """The label at the position; None before the first action."""
        return None if self.position is None else self.spec.label_at(self.position)

    @property
    def event(self) -> DeviceEvent | None:
        """The position as a device event of an episode."""
        return None if self.position is None else DeviceEvent(LABEL_DEVICE, "value", self.position)

    def apply(self, action: Action) -> bool:
        """Move the position; returns False if the action is not about labels."""
        levels = self.spec.levels
        if action.level:
            if self.spec.kind == "slider":
                self.position = (action.level - 1) / 8
            elif action.level <= levels:
                position = (action.level - 1) / (levels - 1)
                self.position = 1.0 - position if self.spec.kind == "yes_no" else position  # yes is the first answer
        elif action in (Action.LABEL_UP, Action.LABEL_DOWN):
            step = 1.0 / (levels - 1) if levels else _STEP
            sign = 1.0 if action is Action.LABEL_UP else -1.0
            # The first step starts at the middle of a slider, and just outside the end of a scale of classes.
            first = 0.5 if not levels else (-step if sign > 0 else 1.0 + step)
            start = self.position if self.position is not None else first
            self.position = min(max(start + sign * step, 0.0), 1.0)
        return bool(action.level) or action in (Action.LABEL_UP, Action.LABEL_DOWN)

    def set(self, label: Any) -> None:
        """Move to a label; None clears the position."""
        self.position = None if label is None else self.spec.position_of(label)


class Answer:
    """Widgets for one answer; there is no default answer.

    Args:
        spec: the question.
        ui: manager of the window's widgets.
        box: place of the widgets, px.
        scale: of texts and widgets.
        label: answer given before the widgets were rebuilt.
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
            place = pygame.Rect(box.left, 0, box.width, round(_ROW * scale))
            place.centery = box.centery
            self._entry = UITextEntryLine(place, ui, initial_text=label or "", placeholder_text="type here")
            self._entry.set_text_length_limit(_MAX_LENGTH)
            ui.set_focus_set(self._entry)
        else:
            self._buttons = self._button_rows(ui, box, scale)
            self._choose(label)

    @property
    def label(self) -> Any:
        """The answer; None before it is given."""
        if self._scale is not None:
            return None if self._scale.value is None else self.spec.label_at(self._scale.value)
        if self._entry is not None:
            return self._entry.get_text().strip() or None
        return self._label

    @property
    def is_typing(self) -> bool:
        """Whether keys currently type letters of a text."""
        return self._entry is not None and self._entry.is_focused

    def handle(self, event: pygame.Event) -> bool:
        """Process an event; returns True if the answer has used it."""
        if self._scale is not None:
            return self._scale.handle(event)
        if event.type != pygame.KEYDOWN or not self._buttons:
            return False
        label = self._label_of_key(event.key)
        if label is not None:
            self._choose(label)
        return label is not None

    def type_key(self, event: pygame.Event) -> None:
        """Pass a key to the text field if the focus was elsewhere."""
        if self._entry is not None and not self._entry.is_focused:
            self._entry.ui_manager.set_focus_set(self._entry)
            self._entry.process_event(event)

    def kill(self) -> None:
        """Remove the widgets."""
        for button in self._buttons:
            button.kill()
        if self._entry is not None:
            self._entry.kill()

    def draw(self, surface: pygame.Surface) -> None:
        """Draw what is not a widget of pygame_gui."""
        if self._scale is not None:
            self._scale.draw(surface)

    @property
    def _labels(self) -> list[Any]:
        """All labels in the order of their buttons: yes before no, classes in ascending order."""
        if self.spec.kind == "yes_no":
            return [True, False]
        return list(range(1, self.spec.levels + 1))

    def _button_rows(self, ui: pygame_gui.UIManager, box: pygame.Rect, scale: float) -> list[UIButton]:
        """One row of buttons for up to five labels, otherwise two."""
        labels, gap = self._labels, round(_GAP * scale)
        columns = len(labels) if len(labels) <= 5 else (len(labels) + 1) // 2
        rows = [labels[k : k + columns] for k in range(0, len(labels), columns)]
        height = min(round(_ROW * scale), (box.height - gap * (len(rows) - 1)) // len(rows))
        top = box.top + (box.height - len(rows) * (height + gap) + gap) // 2
        buttons = []
        for k, row in enumerate(rows):
            place = pygame.Rect(box.left, top + k * (height + gap), round(box.width * len(row) / columns), height)
            buttons += button_row(ui, place, [self._button(label) for label in row], gap=gap, equal=True)
        return buttons

    def _button(self, label: Any) -> ButtonSpec:
        key = {True: "Y", False: "N"}[label] if self.spec.kind == "yes_no" else str(label)
        return self.spec.in_words(label), lambda: self._choose(label), f"key {key}"

    def _label_of_key(self, key: int) -> Any:
        """Label of a key: Y and N, digits, or the arrows to move along the row; None for other keys."""
        labels = self._labels
        if self.spec.kind == "yes_no" and key in (pygame.K_y, pygame.K_n):
            return key == pygame.K_y
        digit = next((key - first + 1 for first in (pygame.K_1, pygame.K_KP_1) if 0 <= key - first < 9), 0)
        if digit:
            return labels[digit - 1] if digit <= len(labels) and self.spec.kind == "classes" else None
        if key not in (pygame.K_LEFT, pygame.K_RIGHT):
            return None
        step = 1 if key == pygame.K_RIGHT else -1
        if self._label is None:
            return labels[0 if step > 0 else -1]
        return labels[min(max(labels.index(self._label) + step, 0), len(labels) - 1)]

    def _choose(self, label: Any) -> None:
        """Store the answer and highlight its button."""
        self._label = label
        for button, own in zip(self._buttons, self._labels, strict=True):
            if own == label:
                button.select()
            else:
                button.unselect()
