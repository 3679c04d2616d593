"""Optional contents of a snapshot: events of input devices, and requests for a camera image."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from annotated_types import Ge, Le

from .floats import FloatFields
from .geometry import quantised

View = Literal["follow", "top"]

NETWORK_DEVICE = "network"  # device name of events that tell how late a person who drives in a browser sees the world
PREDICTED = "predicted"  # its control: 1 while a page shows ticks that it simulates itself, before the server does
ROUND_TRIP = "round_trip"  # its control: time from the request of a tick to its answer, s; 1 for a second or more


@dataclass(frozen=True, slots=True)
class DeviceEvent:
    """A change of one control of an input device since the last snapshot.

    The value is kept at the precision of files, so that a recorded event equals the one that the controller received.

    Attributes:
        device: `keyboard`, `mouse`, `touch`, `pad0`, `pad1`, ...; `label` for a label given while driving; `network`
            for what a browser shows: `round_trip`, s, and whether its ticks are `predicted`.
        control: name of the key, button, stick or axis.
        value: its new value, -1 to 1.

    Raises:
        ValueError: the value is not within -1..1.

    >>> DeviceEvent("pad0", "left_y", -0.123456)
    DeviceEvent(device='pad0', control='left_y', value=-0.1235)
    """

    device: str
    control: str
    value: Annotated[float, Ge(-1), Le(1)]

    def __post_init__(self) -> None:
        if not -1.0 <= self.value <= 1.0:
            raise ValueError(f"{self.device}/{self.control} is {self.value}; device values are within -1..1")
        object.__setattr__(self, "value", quantised(float(self.value)))

    @property
    def kind(self) -> str:
        """The device without its number: `pad` for `pad1`."""
        return self.device.rstrip("0123456789")


@dataclass(frozen=True, slots=True)
class ImageRequest(FloatFields):
    """Size and view of the camera image that a controller requests.

    Attributes:
        width, height: pixels.
        view: follow: from above, moving with the robot, whose heading points up in the image; top: the whole room.
        view_range: distance from the robot to the upper edge of the follow view, m.
    """

    width: int = 160
    height: int = 120
    view: View = "follow"
    view_range: float = 5.0
