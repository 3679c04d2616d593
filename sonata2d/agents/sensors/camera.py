"""A camera above the robot."""

from __future__ import annotations

from dataclasses import dataclass

from ...core.devices import ImageRequest, View
from ...core.scene import Scene
from ...errors import ControllerError
from .base import Measure, Sensor


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

    @property
    def request(self) -> ImageRequest:
        return ImageRequest(self.width, self.height, self.view, self.view_range)

    def start(self, scene: Scene) -> Measure:
        raise ControllerError("a camera needs a renderer; give Episode(renderer=sonata2d.view.image_of)")
