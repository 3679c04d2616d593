"""Drives of robots: what a drive can execute of a commanded twist in a tick."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any, ClassVar, NamedTuple

import numpy as np

from ...core.compiled.calls import FLOAT, FLOATS, address_of
from ...core.compiled.kernel import IS_COMPILED, subroutine
from ...core.compiled.packing import Floats
from ...core.compiled.scalar import clipped, length
from ...core.entities import Limits, Robot
from ...core.floats import FloatFields
from ...core.portable_math import Array, IntArray
from ...registry import drive_class

MEMORY = 4  # numbers that a drive can keep from tick to tick
AHEAD, BACK, SIDEWAYS, TURN, ACCELERATION, TURN_ACCELERATION = range(6)  # columns of `DriveState.limits`


class DriveState(NamedTuple):
    """A drive for kernels.

    Attributes:
        parameters: the fields of the `Drive`, in their order.
        limits: (6,), `Limits`: ahead, back, sideways (m/s), turn (rad/s), acceleration (m/s²), turn_acceleration
            (rad/s²).
        memory: (4,), numbers that the drive keeps from tick to tick, such as the steering angle; 0 at the start.
    """

    parameters: Floats
    limits: Floats
    memory: Floats


@dataclass(frozen=True)
class Drive(FloatFields):
    """Base class of drives. The fields of a subclass, a frozen dataclass, are its parameters: floats, SI units.

    Other packages publish drives as entry points of the group `sonata2d.drives`.

    Attributes:
        moves_sideways: whether a command may have a sideways velocity.
        is_coupled: whether the drive turns only as it moves, so that the guard slows down both together.
        kernel: a function with the decorator `kernel`. Its arguments are parameters, limits and memory of the
            `DriveState`, the twist that was executed in the last tick (3,), the command (3,), which it replaces by what
            the drive can execute, and the duration of the tick, s; twists are vx, vy (m/s) and omega (rad/s) in the
            body frame.

    >>> from sonata2d import ScenarioConfig
    >>> ScenarioConfig(robot={"kinematics": "differential", "drive": {"track": 0.5}}).robot.drive["wheel_speed"]
    1.0
    """

    moves_sideways: ClassVar[bool] = False
    is_coupled: ClassVar[bool] = False
    kernel: ClassVar[Callable[..., None]]

    @property
    def parameters(self) -> dict[str, float]:
        """The parameters by name."""
        return {field.name: float(getattr(self, field.name)) for field in fields(self)}

    @classmethod
    def address(cls) -> IntArray:
        """The address of the kernel.

        Raises:
            TypeError: the drive has no kernel, or it is an ordinary function.
        """
        kernel: Any = vars(cls).get("kernel") or getattr(cls, "kernel", None)
        if kernel is None or (IS_COMPILED and not hasattr(kernel, "overloads")):
            raise TypeError(f"{cls.__name__}.kernel must be a function with the decorator `kernel`")
        return address_of(kernel, FLOATS, FLOATS, FLOATS, FLOATS, FLOATS, FLOAT)

    @classmethod
    def memory_of(cls, parameters: Array, twist: Array) -> Array | None:
        """The memory of the drive while it executes a twist, (4,); None where the twist does not determine it.

        Args:
            parameters: (P,), in the order of the fields.
            twist: (3,), body frame.
        """
        return None


def drive_of(robot: Robot) -> Drive:
    """The drive of a robot; parameters that it does not have are ignored."""
    kind = drive_class(robot.kinematics)
    names = {field.name for field in fields(kind)}
    drive: Drive = kind(**{name: value for name, value in (robot.drive or {}).items() if name in names})
    return drive


def drive_state(drive: Drive, limits: Limits) -> DriveState:
    """A drive for its kernel."""
    of_limits = (limits.ahead, limits.back, limits.sideways, limits.turn)
    of_changes = (limits.acceleration, limits.turn_acceleration)
    numbers = np.array(list(drive.parameters.values()), dtype=float)
    return DriveState(numbers, np.array([*of_limits, *of_changes], dtype=float), np.zeros(MEMORY))


@subroutine
def limit_speeds(limits: Array, now: Array, command: Array, dt: float) -> None:
    """Limit a command to the speeds and accelerations of `Limits`, in the order of `DriveState.limits`.

    Args:
        limits: (6,).
        now: (3,), the twist that was executed in the last tick.
        command: (3,), is replaced.
        dt: s.
    """
    vx = clipped(command[0], -limits[BACK], limits[AHEAD])
    vy = clipped(command[1], -limits[SIDEWAYS], limits[SIDEWAYS])
    omega = clipped(command[2], -limits[TURN], limits[TURN])
    dx, dy, maximum = vx - now[0], vy - now[1], limits[ACCELERATION] * dt
    change = length(dx, dy)
    if change > maximum:
        vx, vy = now[0] + dx * (maximum / change), now[1] + dy * (maximum / change)
    turn = limits[TURN_ACCELERATION] * dt
    command[0], command[1], command[2] = vx, vy, now[2] + clipped(omega - now[2], -turn, turn)
