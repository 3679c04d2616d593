"""Bodies and heads turn with inertia: never in a jerk, and no further than a neck allows."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
import pytest

from sonata2d.core.portable_math import Array, unit_vectors
from sonata2d.core.scene import Rules
from sonata2d.sim.posture import BODY_TURN, HEAD_LIMIT, HEAD_TURN, Posture

from ..conftest import room, walker


def turned(target: float, *, speed: float = 1.3, look: float | None = None, ticks: int = 30, **rules: object) -> Array:
    """(ticks + 1, 3): theta, omega and head of one who faces x, and wants to face and look elsewhere."""
    posture = Posture(room([walker(1, 0.0, 0.0)], rules=Rules(**rules)))  # type: ignore[arg-type]
    bodies = np.array([[0.0, 0.0, speed, 0.0]])
    rows = []
    for _ in range(ticks + 1):
        angles = [math.atan2(one[0, 1], one[0, 0]) for one in (posture.faces, posture.looks)]
        rows.append((angles[0], posture.omega[0], angles[1]))
        posture.turn(
            bodies, unit_vectors(np.array([target])), unit_vectors(np.array([target if look is None else look]))
        )
    return np.array(rows)


def test_a_body_gets_to_where_it_turns_without_swinging_past() -> None:
    theta = turned(2.0)[:, 0]
    assert theta[-1] == pytest.approx(2.0, abs=0.01)
    assert theta.max() < 2.0 + 1e-9
    assert (np.diff(theta) > -1e-9).all()


def test_nobody_turns_faster_than_the_limit_and_omega_is_the_change_of_theta() -> None:
    rows = turned(3.0)
    assert np.abs(rows[:, 1]).max() <= BODY_TURN + 1e-9 < math.pi
    assert rows[1:, 1] == pytest.approx(np.diff(rows[:, 0]) / 0.1, abs=1e-6)


def test_slow_walkers_keep_calm_where_brisk_ones_follow_a_passing_jerk() -> None:
    jerk = [turned(0.6, speed=speed, ticks=2)[-1, 0] for speed in (0.1, 1.3)]
    assert jerk[0] < 0.4 * jerk[1]


def test_a_head_is_there_before_its_body_and_stops_at_the_neck() -> None:
    rows = turned(1.0)
    assert rows[3, 2] > rows[3, 0] + 0.1
    aside = turned(0.0, look=2.5)
    assert aside[-1, 2] == pytest.approx(HEAD_LIMIT, abs=1e-6)
    assert np.abs(np.diff(aside[:, 2])).max() <= HEAD_TURN * 0.1 + 1e-9


def test_a_look_stays_where_it_is_while_the_body_turns() -> None:
    head = turned(0.9, look=0.0)[:, 2]
    assert np.abs(head).max() < 0.1


@pytest.mark.parametrize("side", [1, -1])
def test_right_about_is_to_the_side_of_the_rules(side: Literal[-1, 1]) -> None:
    assert np.sign(turned(math.pi, side=side)[5, 0]) == -side


def test_a_mirrored_wish_turns_the_mirrored_way() -> None:
    one, other = (turned(angle, look=2 * angle, side=side) for angle, side in ((1.2, 1), (-1.2, -1)))
    assert one == pytest.approx(-other, abs=1e-12)


def test_halving_the_tick_hardly_changes_a_turn() -> None:
    whole, half = turned(0.3, ticks=10), turned(0.3, ticks=20, dt=0.05)  # the limit is not met
    assert whole[:, 0] == pytest.approx(half[::2, 0], abs=1e-6)
