"""The panel of scene settings: minimum and maximum of every count."""

from __future__ import annotations

from dataclasses import dataclass

import pygame
import pygame_gui
from pygame_gui.elements import UIButton, UILabel, UIPanel

from ..scenegen.scenario.config import ScenarioConfig
from .actions import Action

_COUNTS = (
    ("humans", "People"),
    ("standing", "People standing"),
    ("wandering", "People walking"),
    ("talking_pairs", "Pairs talking"),
    ("walking_pairs", "Pairs walking"),
    ("talking_groups", "Groups talking"),
    ("walking_groups", "Groups walking"),
    ("at_laptop", "People at a laptop"),
    ("at_plant", "People at a plant"),
    ("relations", "Relations"),
    ("tables", "Tables"),
    ("plants", "Plants"),
    ("chairs", "Chairs"),
    ("shelves", "Shelves"),
    ("tvs", "TVs"),
)
_MAX_COUNT = 99
_ROW, _GAP, _WIDTH = 30, 10, 480  # px at scale 1
_PITCH = _ROW + 4  # px at scale 1


@dataclass(slots=True)
class CountRow:
    """One count: its range, and the labels that show it."""

    low: int
    high: int
    labels: tuple[UILabel, UILabel]

    def change(self, end: int, by: int) -> None:
        """Change the minimum (end 0) or maximum (end 1); the other one follows if the range would be empty."""
        if end == 0:
            self.low = min(max(self.low + by, 0), _MAX_COUNT)
            self.high = max(self.high, self.low)
        else:
            self.high = min(max(self.high + by, 0), _MAX_COUNT)
            self.low = min(self.low, self.high)
        self.show()

    def show(self) -> None:
        """Update the labels."""
        for label, value in zip(self.labels, (self.low, self.high), strict=True):
            label.set_text(str(value))


class ScenePanel:
    """Widgets that change a scenario's counts; the changes apply from the next scene.

    Args:
        ui: manager of the window's widgets.
        scale: of texts and widgets.
        config: the current scenario.
    """

    def __init__(self, ui: pygame_gui.UIManager, scale: float, config: ScenarioConfig) -> None:
        self._config = config
        counts = [(key, text) for key, text in _COUNTS if getattr(config, key) is not None]
        width, height = ui.window_resolution
        rows = len(counts) + 2
        self._unit = min(scale, (height - 20) / ((rows + 1) * _PITCH + 3 * _GAP), (width - 20) / _WIDTH)
        box = pygame.Rect(0, 0, self._px(_WIDTH), self._px(rows * _PITCH + 3 * _GAP))
        box.center = (width // 2, height // 2)
        self.panel = UIPanel(box, starting_height=8, manager=ui)
        self._ui, self._changes = ui, dict[UIButton, tuple[CountRow, int, int]]()
        fixed = f" (plus {len(config.furniture)} fixed objects)" if config.furniture else ""
        self._label(f"Scene settings{fixed}", 0, 0, _WIDTH - 2 * _GAP, "#title")
        for text, left in (("at least", 220), ("at most", 350)):
            self._label(text, left, 1, 100, "#line")
        self._rows = {key: self._row(k, key, text) for k, (key, text) in enumerate(counts, 2)}
        bottom = self._px(_GAP + (rows - 1) * _PITCH) + self._px(_PITCH)
        half = self._px((_WIDTH - 3 * _GAP) / 2)
        self.panel.set_dimensions((box.width, bottom + self._px(_ROW + 2 * _GAP)))
        self.panel.set_position((box.left, max((height - self.panel.rect.height) // 2, 0)))
        self._apply, self._cancel = (
            UIButton(pygame.Rect(left, bottom, half, self._px(_ROW)), text, ui, container=self.panel)
            for text, left in (("New scene", self._px(_GAP)), ("Cancel", 2 * self._px(_GAP) + half))
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
        if event.type != pygame_gui.UI_BUTTON_PRESSED:
            return None
        if event.ui_element in self._changes:
            row, end, by = self._changes[event.ui_element]
            row.change(end, by)
        elif event.ui_element is self._apply:
            return self._config.changed(**{key: (row.low, row.high) for key, row in self._rows.items()})
        return Action.SCENE if event.ui_element is self._cancel else None

    def kill(self) -> None:
        """Remove the widgets."""
        self.panel.kill()

    def _px(self, size: float) -> int:
        return round(size * self._unit)

    def _label(self, text: str, left: float, row: int, width: float, style: str) -> UILabel:
        place = pygame.Rect(self._px(_GAP + left), self._px(_GAP + row * _PITCH), self._px(width), self._px(_ROW))
        return UILabel(place, text, self._ui, container=self.panel, object_id=style)

    def _row(self, k: int, key: str, text: str) -> CountRow:
        """Line of the panel: a text, then minus, value and plus for the minimum and for the maximum."""
        count = getattr(self._config, key)
        self._label(text, 0, k, 200, "#row")
        row = CountRow(
            count.min, count.max, (self._label("", 250, k, 40, "#line"), self._label("", 380, k, 40, "#line"))
        )
        row.show()
        for end, left in enumerate((220, 350)):
            for sign, by, offset in (("-", -1, 0), ("+", 1, 70)):
                top = self._px(_GAP + k * _PITCH)
                place = pygame.Rect(self._px(_GAP + left + offset), top, self._px(_ROW), self._px(_ROW))
                self._changes[UIButton(place, sign, self._ui, container=self.panel)] = row, end, by
        return row
