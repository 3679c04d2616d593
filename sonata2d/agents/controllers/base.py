"""The plug-in: a Controller sees a snapshot and answers a twist and a label."""

from __future__ import annotations

import math
import warnings
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Self

from ...core.devices import ImageRequest
from ...core.geometry import Twist
from ...core.scene import Scene
from ...core.snapshot import Snapshot


@dataclass(frozen=True, slots=True)
class Stop:
    """Answered instead of a twist: end this episode here."""

    reason: str = "the controller stopped"


@dataclass(frozen=True, slots=True)
class Regenerate:
    """Answered instead of a twist: this scene is of no use. The episode ends here, with that outcome."""

    reason: str = "the controller asked for another scene"


Answer = Twist | Stop | Regenerate


_RENAMED = {"restored": "from_settings", "overruled": "command_overridden"}  # deprecated in 0.2, removed in 0.3

# Where the stock controllers are defined now: the path that episode files record. Files of format version 1 name them
# by their first location, and new files keep those names, so that the same run gives the same bytes.
_HERE = "sonata2d.agents.controllers"
RECORDED_PATHS = {
    f"{_HERE}.reactive:StraightToGoal": "sonata2d.agents.straight:StraightToGoal",
    f"{_HERE}.reactive:SocialForce": "sonata2d.agents.social_force:SocialForce",
    f"{_HERE}.reactive:Orca": "sonata2d.agents.social_force:Orca",
    f"{_HERE}.planner:SocialPlanner": "sonata2d.agents.social_planner:SocialPlanner",
    f"{_HERE}.human_like:HumanLike": "sonata2d.agents.human_like:HumanLike",
    f"{_HERE}.labelled:Labelled": "sonata2d.agents.labelled:Labelled",
    f"{_HERE}.teleoperation:Teleoperation": "sonata2d.agents.teleoperation:Teleoperation",
    "sonata2d.learning.policy:GraphPolicy": "sonata2d.learned.graph_policy:GraphPolicy",
}
_CURRENT_PATHS = {recorded: current for current, recorded in RECORDED_PATHS.items()}


def recorded_path(kind: type[Controller]) -> str:
    """The path under which files record a controller class, `module:Class`."""
    path = f"{kind.__module__}:{kind.__qualname__}"
    return RECORDED_PATHS.get(path, path)


def current_path(recorded: str) -> str:
    """Where a class is defined now, from the path that a file records."""
    return _CURRENT_PATHS.get(recorded, recorded)


class _DeprecatedName:
    """An old name of a method: calls the method of the class that defines it, with a warning."""

    def __init__(self, owner: type, old: str, new: str) -> None:
        self._owner, self._old, self._new = owner, old, new

    def __get__(self, instance: object, kind: type | None = None) -> Any:
        warnings.warn(f"Controller.{self._old} is now {self._new}", DeprecationWarning, stacklevel=2)
        return vars(self._owner)[self._new].__get__(instance, kind)


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

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        for old, new in _RENAMED.items():
            if old in vars(cls) and new not in vars(cls):
                warnings.warn(f"{cls.__name__}.{old} is deprecated; name it {new}", DeprecationWarning, stacklevel=2)
                setattr(cls, new, vars(cls)[old])
            elif new in vars(cls):
                setattr(cls, old, _DeprecatedName(cls, old, new))

    @classmethod
    def from_settings(cls, settings: Mapping[str, Any]) -> Self:
        """Reconstruct the controller that a file records; by default it is made without arguments.

        Args:
            settings: as stored in an episode file, see `settings`.
        """
        return cls()

    def reset(self, scene: Scene) -> None:
        """A new episode begins: forget the last one."""

    @abstractmethod
    def act(self, snapshot: Snapshot) -> Answer:
        """The twist asked for until the next look, body frame; or a request (`Stop`, `Regenerate`)."""

    def command_overridden(self, twist: Twist) -> None:
        """Called when another controller's command was executed instead of yours.

        Override it if your controller uses its previous command: replace the stored one with `twist`.
        """

    def label(self, snapshot: Snapshot, twist: Twist) -> Any:
        """What to note beside this frame: anything JSON can hold. None: the command itself is the label."""

    def settings(self) -> Mapping[str, Any]:
        """What the file notes of how this controller is set: by default its public attributes, plain and finite."""
        plain = (bool, int, float, str)
        public = {k: v for k, v in vars(self).items() if not k.startswith("_") and isinstance(v, plain)}
        return {k: v for k, v in public.items() if not isinstance(v, float) or math.isfinite(v)}


for _old, _new in _RENAMED.items():
    setattr(Controller, _old, _DeprecatedName(Controller, _old, _new))
