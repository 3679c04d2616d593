"""What a snapshot can hold besides the world: what a person did to a device, and on request a camera image."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from .geometry import quantised

View = Literal["follow", "top"]


@dataclass(frozen=True, slots=True)
class DeviceEvent:
    """What a person did to a device since the last look: which device, which control, its new value.

    Devices are `keyboard`, `mouse`, `pad0`, `pad1`, …, and `label` for the label given meanwhile. The value is kept at
    the precision of files, so that a recorded event is the one that was acted on.

    Raises:
        ValueError: the value is not within -1..1.

    >>> DeviceEvent("pad0", "left_y", -0.123456)
    DeviceEvent(device='pad0', control='left_y', value=-0.1235)
    """

    device: str
    control: str
    value: float

    def __post_init__(self) -> None:
        if not -1.0 <= self.value <= 1.0:
            raise ValueError(f"{self.device}/{self.control} is {self.value}; a device's value is within -1..1")
        object.__setattr__(self, "value", quantised(float(self.value)))

    @property
    def kind(self) -> str:
        """The device without its number: `pad` of `pad1`."""
        return self.device.rstrip("0123456789")


@dataclass(frozen=True, slots=True)
class ImageRequest:
    """The camera image that a controller asks for.

    Attributes:
        width, height: pixels.
        view: `follow`, from behind and above the robot, which looks up in the picture; or `top`, the whole room, fixed.
        reach: m, of the follow view, from the robot to the upper edge.
    """

    width: int = 160
    height: int = 120
    view: View = "follow"
    reach: float = 5.0
