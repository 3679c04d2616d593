"""A simulated driver at the driving screen, with a session and pads that can be connected."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pygame

from sonata2d.collect.session import Session
from sonata2d.scenegen.scenario.config import ScenarioConfig
from sonata2d.window.collect_screen import CollectScreen
from sonata2d.window.input import InputDevices

from .fake_devices import FakePads, axis, plugged_in
from .volunteer import Person

SCENE: dict[str, Any] = {"room": {"kinds": "square", "side": 6}, "humans": [1, 2], "relations": 0, "tables": 0}
PASSERS = [  # people who enter or leave during a run
    {"x": -2.0, "y": 1.5, "goals": [[2.0, 1.5]], "exits": True},
    {"x": -2.0, "y": 2.0, "goals": [[2.0, 2.0]], "exits": True, "enters": 0.5},
    {"track": [[0.8, 2.2, -1.0], [1.2, 0.5, -1.5], [2.0, -2.0, -1.5]]},
]


class Driver(Person):
    """A person at the driving screen, with the session and pads that can be connected."""

    def __init__(self, folder: Path, size: tuple[int, int] = (1000, 700), **scene: Any) -> None:
        self.pads = FakePads()
        self.folder, self._scene = folder, SCENE | scene
        super().__init__(self._make, size)

    def _make(self) -> CollectScreen:
        devices = InputDevices(pads=self.pads)
        self.session = Session(self.folder, "zoe", ScenarioConfig(**self._scene), mappings=devices.mappings)
        self.collect = CollectScreen(self.session, devices, runs=3, scene_changes=True)
        return self.collect

    def drive_briefly(self, seconds: float = 0.4) -> None:
        """Drive ahead, then release the key."""
        self.hold(pygame.K_w)
        self.wait(seconds)
        self.hold()

    def plug_in(self) -> int:
        """Connect a pad; returns its instance."""
        pad = self.pads.plug()
        pygame.event.post(plugged_in())
        self.wait()
        return pad

    def tilt(self, pad: int, value: float, seconds: float) -> None:
        """Tilt the left stick and wait."""
        pygame.event.post(axis(pad, "left_y", value))
        self.wait(seconds)

    def kept_file(self) -> Path:
        """The only kept file."""
        (path,) = self.folder.glob("zoe__*.json")
        return path
