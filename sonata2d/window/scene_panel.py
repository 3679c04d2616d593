"""The panel of scene settings: minimum and maximum of every count."""

from __future__ import annotations

from dataclasses import dataclass

import pygame
import pygame_gui
from pygame_gui.elements import UIButton, UILabel, UIPanel, UITextEntryLine

from ..collect.texts import text
from ..scenegen.scenario.base import IntRange
from ..scenegen.scenario.config import ScenarioConfig, count_keys
from .actions import Action
from .widgets import fitted

_COUNTS = (
    "humans", "standing", "wandering", "talking_pairs", "walking_pairs", "talking_groups", "walking_groups",
    "at_laptop", "at_plant", "relations",
)  # fmt: skip
_MAX_COUNT = 99
_TYPED = (pygame_gui.UI_TEXT_ENTRY_CHANGED, pygame_gui.UI_TEXT_ENTRY_FINISHED)
_ROW, _GAP, _WIDTH = 34, 12, 580  # px at scale 1
_PITCH = _ROW + 4  # px at scale 1
_COLUMNS, _FIELD = (250, 420), 52  # px at scale 1: left edges of minimum and maximum, and width of a number


@dataclass(slots=True)
class _CountRow:
    """One count: its range, and the fields that show it and take typed numbers."""

    low: int
    high: int
    fields: tuple[UITextEntryLine, UITextEntryLine]

    def change(self, end: int, value: int) -> None:
        """Set the minimum (end 0) or maximum (end 1); the other one follows if the range would be empty."""
        value = min(max(value, 0), _MAX_COUNT)
        if end == 0:
            self.low, self.high = value, max(self.high, value)
        else:
            self.low, self.high = min(self.low, value), value

    def show(self, *, except_for: UITextEntryLine | None = None) -> None:
        """Update the fields, but not the one that the driver types in."""
        for field, value in zip(self.fields, (self.low, self.high), strict=True):
            if field is not except_for and field.get_text() != str(value):
                field.set_text(str(value))


class ScenePanel:
    """Widgets that change a scenario's counts; the changes apply from the next scene.

    Args:
        ui: manager of the window's widgets.
        scale: of texts and widgets.
        config: the current scenario.

    Attributes:
        rows: by the scenario's key of the count.
    """

    def __init__(self, ui: pygame_gui.UIManager, scale: float, config: ScenarioConfig) -> None:
        self._config = config
        counts = {key: count for key in _COUNTS if (count := getattr(config, key)) is not None}
        counts |= {count_keys()[name]: count for name, count in config.counts.items()}
        width, height = ui.window_resolution
        rows = len(counts) + 4  # title, heads, problem and buttons
        self._unit = min(scale, (height - 20) / (rows * _PITCH + 2 * _GAP), (width - 20) / _WIDTH)
        box = pygame.Rect(0, 0, self._px(_WIDTH), self._px(rows * _PITCH + 2 * _GAP))
        box.center = (width // 2, height // 2)
        self.panel = UIPanel(box, starting_height=8, manager=ui)
        self._ui, self._changes = ui, dict[UIButton, tuple[_CountRow, int, int]]()
        self._typed: dict[UITextEntryLine, tuple[_CountRow, int]] = {}
        fixed = len(config.furniture)
        title = text("scene.fixed", count=fixed) if fixed else text("scene.title")
        self._label(title, 0, 0, _WIDTH - 2 * _GAP, "#title")
        for key, left in zip(("scene.at_least", "scene.at_most"), _COLUMNS, strict=True):
            self._label(text(key), left, 1, _FIELD + 2 * _ROW, "#line")
        self.rows = {key: self._row(k, key, count) for k, (key, count) in enumerate(counts.items(), 2)}
        self._problem = self._label("", 0, rows - 2, _WIDTH - 2 * _GAP, "#problem")
        half = (_WIDTH - 3 * _GAP) / 2
        self._apply, self._cancel = (
            UIButton(self._place(left, rows - 1, half), text(key), ui, container=self.panel)
            for key, left in (("scene.apply", 0), ("scene.cancel", _GAP + half))
        )

    def handle(self, event: pygame.Event) -> Action | ScenarioConfig | None:
        """Process an event.

        Returns:
            The changed scenario, `Action.SCENE` to close the panel, or None.

        Raises:
            ConfigError: the counts contradict each other.
        """
        if event.type == pygame.KEYDOWN and event.key == pygame.K_ESCAPE:
            return Action.SCENE
        if event.type == pygame.MOUSEBUTTONUP:
            for field in self._typed:
                if field.rect.collidepoint(event.pos):  # a typed number replaces the one that was clicked
                    field.select_range = [0, len(field.get_text())]
        if event.type in _TYPED and event.ui_element in self._typed:
            self._take_over(event.ui_element, is_done=event.type == pygame_gui.UI_TEXT_ENTRY_FINISHED)
        if event.type != pygame_gui.UI_BUTTON_PRESSED:
            return None
        self.show_problem("")
        if event.ui_element in self._changes:
            row, end, by = self._changes[event.ui_element]
            row.change(end, (row.low, row.high)[end] + by)
            row.show()
        elif event.ui_element is self._apply:
            for row in self.rows.values():
                row.show()
            return self._config.changed(**{key: (row.low, row.high) for key, row in self.rows.items()})
        return Action.SCENE if event.ui_element is self._cancel else None

    @property
    def problem(self) -> str:
        """Why the counts cannot be used, as it is shown; empty without a problem."""
        return str(self._problem.text)

    def kill(self) -> None:
        """Remove the widgets."""
        self.panel.kill()

    def show_problem(self, problem: str) -> None:
        """Show why the counts cannot be used, in the panel, or an empty text."""
        problem = fitted(self._ui, problem, self._px(_WIDTH - 3 * _GAP))
        if self._problem.text != problem:
            self._problem.set_text(problem)

    def _take_over(self, field: UITextEntryLine, *, is_done: bool) -> None:
        """Use a typed number; an empty field keeps the number before until the driver has finished."""
        row, end = self._typed[field]
        if field.get_text().isdigit():
            row.change(end, int(field.get_text()))
        row.show(except_for=None if is_done else field)

    def _px(self, size: float) -> int:
        return round(size * self._unit)

    def _place(self, left: float, row: int, width: float) -> pygame.Rect:
        """A box in a row of the panel, px."""
        top = self._px(_GAP + row * _PITCH)
        return pygame.Rect(self._px(_GAP + left), top, self._px(width), self._px(_ROW))

    def _label(self, words: str, left: float, row: int, width: float, style: str) -> UILabel:
        return UILabel(self._place(left, row, width), words, self._ui, container=self.panel, object_id=style)

    def _row(self, k: int, key: str, count: IntRange) -> _CountRow:
        """Line of the panel: a text, then minus, number and plus for the minimum and for the maximum."""
        self._label(text(f"scene.{key}"), 0, k, _COLUMNS[0] - _GAP, "#row")
        row = _CountRow(count.min, count.max, (self._field(k, 0), self._field(k, 1)))
        row.show()
        for end, left in enumerate(_COLUMNS):
            self._typed[row.fields[end]] = row, end
            for sign, by, offset in (("−", -1, 0), ("+", 1, _ROW + _FIELD)):
                place = self._place(left + offset, k, _ROW)
                self._changes[UIButton(place, sign, self._ui, container=self.panel)] = row, end, by
        return row

    def _field(self, k: int, end: int) -> UITextEntryLine:
        place = self._place(_COLUMNS[end] + _ROW, k, _FIELD)
        field = UITextEntryLine(place, self._ui, container=self.panel, object_id="#count")
        field.set_allowed_characters("numbers")
        field.set_text_length_limit(len(str(_MAX_COUNT)))
        return field
