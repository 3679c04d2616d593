import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sonata2d.core import portable_math as exact

angles = st.floats(-20.0, 20.0)
numbers = st.floats(-1e3, 1e3)


def test_exp_is_near_the_real_one_and_ends_at_zero() -> None:
    x = np.linspace(-20.0, 0.0, 20_001)
    assert np.abs(exact.exp(x) / np.exp(x) - 1.0).max() < 2e-7
    assert exact.exp(np.array([-61.0, -1e9])).tolist() == [0.0, 0.0]


@given(numbers, numbers)
def test_arctan2_agrees_with_the_real_one(y: float, x: float) -> None:
    real = math.atan2(y, x) if (x, y) != (0.0, 0.0) else 0.0
    assert exact.angle_of(y, x) == pytest.approx(abs(real) if y == 0 else real, abs=1e-10)


@given(numbers, numbers)
def test_one_angle_and_many_give_the_same_bits(y: float, x: float) -> None:
    assert exact.angle_of(y, x) == float(exact.arctan2(np.array([y]), np.array([x]))[0])


@given(angles)
def test_heading_is_the_unit_vector_along_theta(theta: float) -> None:
    assert exact.unit_vector(theta) == pytest.approx((math.cos(theta), math.sin(theta)), abs=1e-12)


@given(st.floats(-0.5, 0.5))
def test_rotation_turns_by_the_angle_and_keeps_length(angle: float) -> None:
    c, s = exact.rotation(angle)
    assert (c, s) == pytest.approx((math.cos(angle), math.sin(angle)), abs=2e-7)
    assert c * c + s * s == pytest.approx(1.0, abs=1e-15)
