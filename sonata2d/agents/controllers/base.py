"""The controller interface: `Controller`, and its requests `Stop` and `Regenerate`."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Self

from ...core.devices import ImageRequest
from ...core.geometry import Twist
from ...core.scene import Scene
from ...core.snapshot import Snapshot
from ...core.wording import one_line, shown
from ...errors import ControllerError
from ..sensors.base import Sensor


@dataclass(frozen=True, slots=True)
class Stop:
    """Returned instead of a twist: the episode ends here with the outcome `stopped`.

    Attributes:
        reason: recorded with the outcome.
    """

    reason: str = "the controller stopped"

    def __post_init__(self) -> None:
        _require_text(self.reason, "Stop")


@dataclass(frozen=True, slots=True)
class Regenerate:
    """Returned instead of a twist: the scene is unusable. The episode ends here with the outcome `regenerate`.

    Attributes:
        reason: recorded with the outcome.
    """

    reason: str = "the controller asked for another scene"

    def __post_init__(self) -> None:
        _require_text(self.reason, "Regenerate")


def _require_text(reason: object, name: str) -> None:
    """Require text: files and tables hold the reason."""
    if not isinstance(reason, str):
        raise TypeError(f"the reason of {name} must be text, got {shown(reason)}; write {name}(str(reason))")


Answer = Twist | Stop | Regenerate


def recorded_path(controller_class: type[Controller]) -> str:
    """The path under which files record a controller class, `module:Class`."""
    return f"{controller_class.__module__}:{controller_class.__qualname__}"


def require_controller(value: object) -> Controller:
    """Return a controller as given.

    Raises:
        TypeError: it is a class, a name or another object that is not a controller.
    """
    if isinstance(value, Controller):
        return value
    if isinstance(value, str):
        remedy = f"pass sonata2d.load_controller({value!r})"
        raise TypeError(f"a controller is an object, got the name {value!r}; {remedy}")
    if isinstance(value, type):
        raise TypeError(f"a controller is an object, got the class {value.__name__}; pass {value.__name__}()")
    raise TypeError(f"a controller is an object of a class derived from sonata2d.Controller, got {value!r:.100}")


class Controller(ABC):
    """Base class of robot controllers. Only `act` is required.

    Keep state in attributes whose names begin with `_`; public attributes are recorded as settings.

    Attributes:
        version: recorded in every file; raise it when the behaviour changes.
        labels: meaning of each key that `label` returns, recorded in every file.
        image: the camera image to render into every snapshot; None renders nothing and costs nothing.
        sensors: of the robot, such as `Lidar()`; `act` and `label` read them as `snapshot.sensors`.
        partial: whether `act` gets no more than the robot knows: the readings of its sensors, its goal, and what its
            drive executed. `label` gets the whole snapshot.
        robots_as_people: whether `reset` and `act` get the other robots of a scene as people that walk, in the place of
            `scene.robots` and `snapshot.robots`; for controllers that know one robot only.
        drives_several: whether one object may drive several robots of an episode. `reset` is called with the scene in
            the view of each, and `act` with its snapshot; `scene.robot_id` and `snapshot.robot.id` tell them apart.
        answers_after_arrival: whether `act` and `label` are called, among several robots, after the robot has reached
            its goal; it stands whatever the command is, and `Stop` ends the episode.
        deterministic: True if equal snapshots always give equal answers; `check --rerun` then verifies recorded runs.

    >>> class Forward(Controller):
    ...     def act(self, snapshot):
    ...         return Twist(vx=0.5)
    """

    version: ClassVar[str | None] = None
    labels: Mapping[str, str] = {}
    image: ImageRequest | None = None
    sensors: Sequence[Sensor] = ()
    partial: bool = False
    robots_as_people: bool = False
    drives_several: bool = False
    answers_after_arrival: bool = False
    deterministic: bool = True

    @classmethod
    def from_settings(cls, settings: Mapping[str, Any]) -> Self:
        """Reconstruct a recorded controller; by default, create one without arguments.

        Args:
            settings: as stored in an episode file, see `settings`.
        """
        return cls()

    def reset(self, scene: Scene) -> None:
        """Start a new episode: clear the state of the previous one."""

    @abstractmethod
    def act(self, snapshot: Snapshot) -> Answer:
        """Choose the command for the next tick.

        Returns:
            A twist in the body frame (m/s, m/s, rad/s), or a request that ends the episode (`Stop`, `Regenerate`).
        """

    def command_overridden(self, twist: Twist) -> None:
        """Called when another controller's command was executed instead of yours.

        Override it if your controller uses its previous command: replace the stored one with `twist`.
        """

    def label(self, snapshot: Snapshot, twist: Twist) -> Any:
        """The label to record with this frame, any value that JSON can hold; None: the command itself is the label."""

    def settings(self) -> Mapping[str, Any]:
        """The settings to record in the file: by default all public attributes that are finite numbers or strings."""
        plain = (bool, int, float, str)
        public = {k: v for k, v in vars(self).items() if not k.startswith("_") and isinstance(v, plain)}
        return {k: v for k, v in public.items() if not isinstance(v, float) or math.isfinite(v)}

    def __repr__(self) -> str:
        """Class and settings, on one line."""
        try:
            texts = [f"{name}={shown(value, 30)}" for name, value in self.settings().items()]
        except Exception:  # as of an object that is not initialised yet; what is printed must not hide that
            texts = ["..."]
        return one_line(f"{type(self).__name__}({', '.join(texts)})", 200)


class External(Controller):
    """Stands for a client that gives the commands through `Episode.apply`; it cannot be asked for one."""

    deterministic = False
    drives_several = True

    def act(self, snapshot: Snapshot) -> Answer:
        raise ControllerError("this episode has no controller; give its commands to Episode.apply")
