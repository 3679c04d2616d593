"""A sensor: a bumper."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from sonata2d import Scene
from sonata2d.agents import Sensor


@dataclass(frozen=True)
class Bumper(Sensor):
    """Whether the robot touched something in the last tick."""

    def start(self, scene: Scene) -> Any:
        return lambda snapshot, noise: bool(snapshot.contacts)

    def mirrored_json(self, value: bool) -> bool:
        return value
