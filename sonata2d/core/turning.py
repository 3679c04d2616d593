"""The dynamics of turns: towards a target angle, with critical damping and a limited turn rate.

The angle x to the target obeys x″ = −2 r x′ − r² x, solved in closed form over a tick. The rate r of a body grows with
the walking speed, so that fast walkers face the direction in which they walk and slow ones turn calmly. The turn rate
of a body is limited to a / v at speed v, with the lateral acceleration a, so that walkers turn in arcs.

Source: Farina et al., Walking ahead: the headed social force model, PLoS ONE 12(1) (2017) e0169734. Its torque is
−k_θ (θ − θ₀) − k_ω ω, with critical damping for α = 1; r² is its k_λ |f₀|.
"""

from __future__ import annotations

from .compiled.kernel import subroutine
from .compiled.scalar import Vector, clipped, exp

BODY_TURN = 2.1  # rad/s, maximum turn rate of a body
LATERAL_ACCELERATION = 1.2  # m/s^2, maximum of a walker; recorded ones exceed 0.8 to 1.0 in 1 % of the time
_WALKING_RATE, _STANDING_RATE = 8.0, 3.0  # 1/s, rate of a body that walks at `_BRISK_SPEED` or more, and that stands
_BRISK_SPEED = 1.0  # m/s


@subroutine
def turn_limits(speed: float) -> Vector:
    """Rate, 1/s, and maximum turn rate, rad/s, with which the body of a pedestrian turns at a walking speed, m/s."""
    rate = _STANDING_RATE + (_WALKING_RATE - _STANDING_RATE) * min(speed / _BRISK_SPEED, 1.0)
    return rate, min(BODY_TURN, LATERAL_ACCELERATION / max(speed, 0.1))


@subroutine
def critically_damped(remaining: float, turn_rate: float, rate: float, maximum: float, dt: float) -> Vector:
    """Turn towards a target for one tick by the closed-form solution of a critically damped oscillator.

    Args:
        remaining: angle to the target, rad.
        turn_rate: at the start, rad/s.
        rate: 1/s.
        maximum: turn rate that the result is limited to, rad/s.
        dt: s.

    Returns:
        Angle turned, rad, and turn rate at the end, rad/s.
    """
    slope = (turn_rate - rate * remaining) * dt
    decay = exp(-(rate * dt))
    turned = remaining + (slope - remaining) * decay
    after = (turn_rate - rate * slope) * decay
    return clipped(turned, -(maximum * dt), maximum * dt), clipped(after, -maximum, maximum)
