"""The panel that says what scenes may look like: least and most of every count."""

from __future__ import annotations

from dataclasses import dataclass

import pygame
import pygame_gui
from pygame_gui.elements import UIButton, UILabel, UIPanel

from ..scenegen.scenario.config import ScenarioConfig
from .actions import Action

COUNTS = (
    ("humans", "People"),
    ("standing", "People who stand"),
    ("wandering", "People who walk"),
    ("talking_pairs", "Pairs who talk"),
    ("walking_pairs", "Pairs who walk"),
    ("talking_groups", "Groups who talk"),
    ("walking_groups", "Groups who walk"),
    ("at_laptop", "People at a laptop"),
    ("at_plant", "People at a plant"),
    ("relations", "Relations among them"),
    ("tables", "Tables"),
    ("plants", "Plants"),
    ("chairs", "Chairs"),
    ("shelves", "Shelves"),
    ("tvs", "TVs"),
)
MOST = 99
_ROW, _GAP, _WIDTH = 30, 10, 480  # px at scale 1


@dataclass(slots=True)
class Row:
    """One count: its range, and where it is shown."""

    low: int
    high: int
    shown: tuple[UILabel, UILabel]

    def change(self, which: int, by: int) -> None:
        """Raise or lower the least (0) or the most (1); the other one gives way."""
        if which == 0:
            self.low = min(max(self.low + by, 0), MOST)
            self.high = max(self.high, self.low)
        else:
            self.high = min(max(self.high + by, 0), MOST)
            self.low = min(self.low, self.high)
        self.tell()

    def tell(self) -> None:
        for label, value in zip(self.shown, (self.low, self.high), strict=True):
            label.set_text(str(value))


class ScenePanel:
    """Widgets to change a scenario's counts; they apply from the next scene on.

    Args:
        ui: the manager of the window's widgets.
        scale: of texts and widgets.
        config: what is changed.
    """

    def __init__(self, ui: pygame_gui.UIManager, scale: float, config: ScenarioConfig) -> None:
        self._config = config
        counts = [(key, text) for key, text in COUNTS if getattr(config, key) is not None]
        width, height = ui.window_resolution
        rows = len(counts) + 2
        self._unit = min(scale, (height - 20) / ((rows + 1) * (_ROW + 4) + 3 * _GAP), (width - 20) / _WIDTH)
        box = pygame.Rect(0, 0, self._px(_WIDTH), self._px(rows * (_ROW + 4) + 3 * _GAP))
        box.center = (width // 2, height // 2)
        self.panel = UIPanel(box, starting_height=8, manager=ui)
        self._ui, self._changes = ui, dict[UIButton, tuple[Row, int, int]]()
        fixed = f" (besides {len(config.furniture)} fixed things)" if config.furniture else ""
        self._label(f"Scenes{fixed}", 0, 0, _WIDTH - 2 * _GAP, "#title")
        for text, left in (("least", 220), ("most", 350)):
            self._label(text, left, 1, 100, "#line")
        self._rows = {key: self._row(k, key, text) for k, (key, text) in enumerate(counts, 2)}
        low = self._px(_GAP + (rows - 1) * (_ROW + 4)) + self._px(_ROW + 4)
        half = self._px((_WIDTH - 3 * _GAP) / 2)
        self.panel.set_dimensions((box.width, low + self._px(_ROW + 2 * _GAP)))
        self.panel.set_position((box.left, max((height - self.panel.rect.height) // 2, 0)))
        self._apply, self._cancel = (
            UIButton(pygame.Rect(left, low, half, self._px(_ROW)), text, ui, container=self.panel)
            for text, left in (("Regenerate", self._px(_GAP)), ("Cancel", 2 * self._px(_GAP) + half))
        )

    def handle(self, event: pygame.Event) -> Action | ScenarioConfig | None:
        """What was asked: other scenes, or to close the panel.

        Raises:
            ConfigError: the counts do not go together.
        """
        if event.type == pygame.KEYDOWN and event.key == pygame.K_ESCAPE:
            return Action.SCENE
        if event.type != pygame_gui.UI_BUTTON_PRESSED:
            return None
        if event.ui_element in self._changes:
            row, which, by = self._changes[event.ui_element]
            row.change(which, by)
        elif event.ui_element is self._apply:
            return self._config.changed(**{key: (row.low, row.high) for key, row in self._rows.items()})
        return Action.SCENE if event.ui_element is self._cancel else None

    def kill(self) -> None:
        """Take it away."""
        self.panel.kill()

    def _px(self, size: float) -> int:
        return round(size * self._unit)

    def _label(self, text: str, left: float, row: int, width: float, kind: str) -> UILabel:
        place = pygame.Rect(self._px(_GAP + left), self._px(_GAP + row * (_ROW + 4)), self._px(width), self._px(_ROW))
        return UILabel(place, text, self._ui, container=self.panel, object_id=kind)

    def _row(self, k: int, key: str, text: str) -> Row:
        """A line of the panel: name, and minus, value, plus for least and most."""
        given = getattr(self._config, key)
        self._label(text, 0, k, 200, "#row")
        shown = self._label("", 250, k, 40, "#line"), self._label("", 380, k, 40, "#line")
        row = Row(given.min, given.max, shown)
        row.tell()
        for which, left in enumerate((220, 350)):
            for sign, by, off in (("-", -1, 0), ("+", 1, 70)):
                top = self._px(_GAP + k * (_ROW + 4))
                place = pygame.Rect(self._px(_GAP + left + off), top, self._px(_ROW), self._px(_ROW))
                self._changes[UIButton(place, sign, self._ui, container=self.panel)] = row, which, by
        return row
