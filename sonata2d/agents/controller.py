"""The plug-in: a Controller sees a snapshot and answers a twist and a label."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Self

from ..frame import Snapshot
from ..geometry import Twist
from ..scene import Scene
from ..topics import ImageRequest


@dataclass(frozen=True, slots=True)
class Stop:
    """Answered instead of a twist: end this episode here."""

    reason: str = "the controller stopped"


@dataclass(frozen=True, slots=True)
class Regenerate:
    """Answered instead of a twist: this scene is of no use. The episode ends here, with that outcome."""

    reason: str = "the controller asked for another scene"


Answer = Twist | Stop | Regenerate


class Controller(ABC):
    """Drives the robot. Only `act` must be written.

    Attributes:
        version: noted in every file; raise it when the controller changes.
        labels: what the keys of `label`'s answer mean, noted in every file.
        image: the camera image that it wants in every snapshot; None costs nothing.
        deterministic: claims that the same snapshots bring the same answers, so that `check --rerun` may hold it to it.
    """

    version: ClassVar[str | None] = None
    labels: Mapping[str, str] = {}
    image: ImageRequest | None = None
    deterministic: bool = True

    @classmethod
    def restored(cls, settings: Mapping[str, Any]) -> Self:
        """The controller that a file tells of, to be run again: made without arguments, unless written otherwise."""
        return cls()

    def reset(self, scene: Scene) -> None:
        """A new episode begins: forget the last one."""

    @abstractmethod
    def act(self, snapshot: Snapshot) -> Answer:
        """The twist asked for until the next look, body frame; or a request (`Stop`, `Regenerate`)."""

    def overruled(self, twist: Twist) -> None:
        """Something else was done than it answered last: whoever minds what they asked for takes this for it."""

    def label(self, snapshot: Snapshot, twist: Twist) -> Any:
        """What to note beside this frame: anything JSON can hold. None: the command itself is the label."""

    def settings(self) -> Mapping[str, Any]:
        """What the file notes of how this controller is set: by default its public attributes, plain and finite."""
        plain = (bool, int, float, str)
        public = {k: v for k, v in vars(self).items() if not k.startswith("_") and isinstance(v, plain)}
        return {k: v for k, v in public.items() if not isinstance(v, float) or math.isfinite(v)}
