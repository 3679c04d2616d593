"""A drive: a unicycle that is slow on curves."""

from __future__ import annotations

from dataclasses import dataclass

from sonata2d.agents.drives.base import Drive, limit_speeds
from sonata2d.core.compiled.kernel import kernel


@kernel
def _slow_on_curves(parameters, limits, memory, now, command, dt):  # type: ignore[no-untyped-def]
    limit_speeds(limits, now, command, dt)
    command[1] = 0.0
    most = parameters[0] / max(abs(command[2]), 1e-6)  # the lateral acceleration is vx * omega
    command[0] = min(max(command[0], -most), most)


@dataclass(frozen=True)
class Gentle(Drive):
    """A unicycle that limits its lateral acceleration.

    Attributes:
        lateral_acceleration: its largest value, m/s².
    """

    lateral_acceleration: float = 0.5
    kernel = _slow_on_curves
