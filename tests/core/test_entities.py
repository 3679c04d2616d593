"""The robot's drive limits the speed by its kinematics."""

from __future__ import annotations

import pytest

from sonata2d.core.entities import Limits, Robot
from sonata2d.core.geometry import Pose


def test_only_a_holonomic_robot_moves_sideways() -> None:
    limits = Limits(ahead=0.3, back=0.2, sideways=0.4)
    holonomic, unicycle = (Robot(Pose(0, 0, 0), kinematics=kind, limits=limits) for kind in ("holonomic", "unicycle"))
    assert (holonomic.sideways_limit, unicycle.sideways_limit) == (0.4, 0.0)
    assert (holonomic.top_speed, unicycle.top_speed) == pytest.approx((0.5, 0.3))
