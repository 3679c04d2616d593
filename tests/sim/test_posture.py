"""Bodies and heads turn smoothly, within the limits of turn rates and neck."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sonata2d.core import humans
from sonata2d.core.portable_math import Array, unit_vectors
from sonata2d.core.turning import BODY_TURN, LATERAL_ACCELERATION
from sonata2d.sim.kernel import posture
from sonata2d.sim.kernel.posture import HEAD_LIMIT, HEAD_TURN

THETA, OMEGA, GAZE = range(3)  # columns of `turn`


def turn(
    target: float,
    *,
    speed: float = 1.3,
    gaze: float | None = None,
    ticks: int = 30,
    side: float = 1.0,
    dt: float = 0.1,
) -> Array:
    """Heading, turn rate and gaze of a pedestrian that turns from heading 0; (ticks + 1, 3), rad and rad/s.

    Args:
        target: heading to turn to, rad.
        speed: of the pedestrian, m/s.
        gaze: angle to look at, rad; by default the target.
    """
    state, memory = np.zeros((1, 9)), np.zeros((1, 3))
    state[0, [humans.VX, humans.BODY_X, humans.GAZE_X]] = speed, 1.0, 1.0
    facing, gazing = (unit_vectors(np.array([angle])) for angle in (target, target if gaze is None else gaze))
    rows = []
    for _ in range(ticks + 1):
        theta = math.atan2(state[0, humans.BODY_Y], state[0, humans.BODY_X])
        rows.append((theta, state[0, humans.OMEGA], math.atan2(state[0, humans.GAZE_Y], state[0, humans.GAZE_X])))
        posture.turn(state, memory, 0, facing, gazing, float(side), dt)
    return np.array(rows)


def test_a_body_reaches_its_target_heading_without_overshoot() -> None:
    theta = turn(2.0)[:, THETA]
    assert theta[-1] == pytest.approx(2.0, abs=0.01)
    assert theta.max() < 2.0 + 1e-9
    assert (np.diff(theta) > -1e-9).all()


def test_the_turn_rate_is_limited_and_equals_the_change_of_heading() -> None:
    rows = turn(3.0)
    assert np.abs(rows[:, OMEGA]).max() <= BODY_TURN + 1e-9 < math.pi
    assert rows[1:, OMEGA] == pytest.approx(np.diff(rows[:, THETA]) / 0.1, abs=1e-6)


def test_slow_walkers_follow_a_short_change_less_than_fast_ones() -> None:
    slow, fast = (turn(0.1, speed=speed, ticks=2)[-1, THETA] for speed in (0.1, 1.3))
    assert slow < 0.4 * fast


@pytest.mark.parametrize("speed", [0.8, 1.3])
def test_walkers_turn_in_arcs(speed: float) -> None:
    fastest = np.abs(turn(2.0, speed=speed)[:, OMEGA]).max()
    assert fastest == pytest.approx(LATERAL_ACCELERATION / speed)
    assert fastest < 0.8 * BODY_TURN


def test_a_head_turns_faster_than_its_body_and_stops_at_the_limit_of_the_neck() -> None:
    rows = turn(1.0)
    assert rows[3, GAZE] > rows[3, THETA] + 0.1
    aside = turn(0.0, gaze=2.5)
    assert aside[-1, GAZE] == pytest.approx(HEAD_LIMIT, abs=1e-6)
    assert np.abs(np.diff(aside[:, GAZE])).max() <= HEAD_TURN * 0.1 + 1e-9


def test_the_gaze_stays_on_its_target_while_the_body_turns() -> None:
    gaze = turn(0.9, gaze=0.0)[:, GAZE]
    assert np.abs(gaze).max() < 0.1


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_an_about_turn_is_to_the_side_of_the_rules(side: float) -> None:
    assert np.sign(turn(math.pi, side=side)[5, THETA]) == -side


def test_mirrored_targets_give_mirrored_turns() -> None:
    left, right = (turn(angle, gaze=2 * angle, side=side) for angle, side in ((1.2, 1), (-1.2, -1)))
    assert left == pytest.approx(-right, abs=1e-12)


def test_a_turn_hardly_depends_on_the_tick() -> None:
    whole, half = turn(0.3, ticks=10), turn(0.3, ticks=20, dt=0.05)  # too small a turn to reach the limit
    assert whole[:, THETA] == pytest.approx(half[::2, THETA], abs=1e-6)
