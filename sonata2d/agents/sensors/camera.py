"""A camera above the robot."""

from __future__ import annotations

from dataclasses import dataclass
from typing import get_args

from ...core.arguments import positive_number, whole_number
from ...core.devices import ImageRequest, View
from ...core.scene import Scene
from ...errors import ControllerError
from .base import Measure, Sensor

_MOST_PIXELS = 10_000  # in each direction


@dataclass(frozen=True)
class Camera(Sensor):
    """A camera that looks down, as in the window; `Controller.image` requests the same picture in every tick.

    Attributes:
        width, height: pixels.
        view: follow: moving with the robot, whose heading points up in the image; top: the whole room.
        view_range: distance from the robot to the upper edge of the follow view, m.
    """

    width: int = 160
    height: int = 120
    view: View = "follow"
    view_range: float = 5.0

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("width", "height"):
            whole_number(name, getattr(self, name), 1, _MOST_PIXELS)
        positive_number("view_range", self.view_range)
        if self.record:
            raise ValueError("files of episodes hold no pictures; leave record out, and render the file if needed")
        if self.view not in get_args(View):
            raise ValueError(f"view must be {' or '.join(get_args(View))}, got {self.view!r}")

    @property
    def request(self) -> ImageRequest:
        return ImageRequest(self.width, self.height, self.view, self.view_range)

    def start(self, scene: Scene) -> Measure:
        raise ControllerError("a camera needs a renderer; give Episode(renderer=sonata2d.view.image_of)")
