"""Answers to a label question: widgets for the mouse and keys, and a value changed by label actions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import pygame
import pygame_gui
from pygame_gui.elements import UITextEntryLine

from ..collect.texts import text
from ..core.devices import DeviceEvent
from ..core.labels import LABEL_DEVICE, LabelSpec
from .actions import Action
from .widgets import Choices, Scale

_ROW = 42  # height of a text field, px at scale 1
_MAX_LENGTH = 2000  # characters of a text
_STEP = 0.05  # change of a slider label per action


def question_of(spec: LabelSpec) -> str:
    """The question of a label, or its name if the scenario asks no question."""
    return spec.question or text("question.nameless", name=spec.name)


def answer_text(label: Any, spec: LabelSpec) -> str:
    """A label as text in the window's language."""
    if spec.kind == "yes_no":
        return text("question.not_given") if label is None else text("question.yes" if label else "question.no")
    return text("question.not_given") if label is None else spec.in_words(label)


def labels_of(spec: LabelSpec) -> list[Any]:
    """All labels of a discrete question in the order of their buttons: yes before no, classes in ascending order."""
    return [True, False] if spec.kind == "yes_no" else list(range(1, spec.levels + 1))


def answers_of(spec: LabelSpec) -> list[str]:
    """Texts of the buttons of a discrete question."""
    return [answer_text(label, spec) for label in labels_of(spec)]


@dataclass(frozen=True, slots=True)
class FrameQuestion:
    """A question that is answered while driving.

    Attributes:
        spec: the question.
        position: of the current answer on the scale of the label, 0 to 1; None before the first answer.
    """

    spec: LabelSpec
    position: float | None = None


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

    def shown(self, label: Any) -> FrameQuestion | None:
        """The question as the driver sees it while driving; None for a label that is not asked for while driving.

        Args:
            label: answer in use, if the position is undefined.
        """
        if not self.spec.per_frame:
            return None
        is_unanswered = self.position is None and label is not None
        return FrameQuestion(self.spec, self.spec.position_of(label) if is_unanswered else self.position)

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

    Attributes:
        choices: buttons of a discrete question.
        scale: slider of a continuous one.
    """

    def __init__(
        self, spec: LabelSpec, ui: pygame_gui.UIManager, box: pygame.Rect, scale: float, label: Any = None
    ) -> None:
        self.spec = spec
        self.choices: Choices | None = None
        self.scale: Scale | None = None
        self._entry: UITextEntryLine | None = None
        if spec.kind == "slider":
            self.scale = Scale(box, spec.ends, scale=scale, value=label)
        elif spec.kind == "text":
            place = pygame.Rect(box.left, 0, box.width, round(_ROW * scale))
            place.centery = box.centery
            hint = text("question.type_here")
            self._entry = UITextEntryLine(place, ui, initial_text=label or "", placeholder_text=hint)
            self._entry.set_text_length_limit(_MAX_LENGTH)
            self._entry.edit_position = len(self._entry.get_text())
            ui.set_focus_set(self._entry)
        else:
            chosen = None if label is None else labels_of(spec).index(label)
            self.choices = Choices(box, answers_of(spec), scale, chosen)

    @staticmethod
    def height_of(spec: LabelSpec, width: int, scale: float) -> int:
        """Height that the widgets need in a width, px."""
        if spec.kind == "slider":
            return Scale.height_of(spec.ends, width, scale)
        return round(_ROW * scale) if spec.kind == "text" else Choices.height_of(answers_of(spec), width, scale)

    @property
    def label(self) -> Any:
        """The answer; None before it is given."""
        if self.scale is not None:
            return None if self.scale.value is None else self.spec.label_at(self.scale.value)
        if self._entry is not None:
            return self._entry.get_text().strip() or None
        if self.choices is None or self.choices.chosen is None:
            return None
        return labels_of(self.spec)[self.choices.chosen]

    @property
    def is_typing(self) -> bool:
        """Whether keys currently type letters of a text."""
        return self._entry is not None and self._entry.is_focused

    def handle(self, event: pygame.Event) -> bool:
        """Process an event; returns True if the answer has used it."""
        if self.scale is not None:
            return self.scale.handle(event)
        if self.choices is None:
            return False
        if event.type != pygame.KEYDOWN:
            return self.choices.handle(event)
        chosen = self._choice_of_key(event.key, self.choices.chosen)
        if chosen is not None:
            self.choices.chosen = chosen
        return chosen is not None

    def type_key(self, event: pygame.Event) -> None:
        """Pass a key to the text field if the focus was elsewhere."""
        if self._entry is not None and not self._entry.is_focused:
            self._entry.ui_manager.set_focus_set(self._entry)
            self._entry.process_event(event)

    def kill(self) -> None:
        """Remove the widgets."""
        if self._entry is not None:
            self._entry.kill()

    def draw(self, surface: pygame.Surface) -> None:
        """Draw buttons and slider, which are not widgets of pygame_gui."""
        if part := self.scale or self.choices:
            part.draw(surface)

    def _choice_of_key(self, key: int, chosen: int | None) -> int | None:
        """Button of a key: Y and N, digits, or the arrows to move along the buttons; None for other keys."""
        labels = labels_of(self.spec)
        if self.spec.kind == "yes_no" and key in (pygame.K_y, pygame.K_n):
            return int(key == pygame.K_n)
        digit = next((key - first + 1 for first in (pygame.K_1, pygame.K_KP_1) if 0 <= key - first < 9), 0)
        if digit:
            return digit - 1 if digit <= len(labels) and self.spec.kind == "classes" else None
        if key not in (pygame.K_LEFT, pygame.K_RIGHT):
            return None
        step = 1 if key == pygame.K_RIGHT else -1
        if chosen is None:
            return 0 if step > 0 else len(labels) - 1
        return min(max(chosen + step, 0), len(labels) - 1)
