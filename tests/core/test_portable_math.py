"""The elementary functions agree with the C library's, within the errors that they promise."""

import math

import numpy as np
import pytest
from hypothesis import given, strategies as st

from sonata2d.core import portable_math

angles = st.floats(-20.0, 20.0)
numbers = st.floats(-1e3, 1e3)


def test_exp_agrees_with_numpy_and_is_zero_far_below() -> None:
    x = np.linspace(-20.0, 0.0, 20_001)
    assert np.abs(portable_math.exp(x) / np.exp(x) - 1.0).max() < 2e-7
    assert portable_math.exp(np.array([-61.0, -1e9])).tolist() == [0.0, 0.0]


@given(numbers, numbers)
def test_angle_of_agrees_with_atan2(y: float, x: float) -> None:
    expected = math.atan2(y, x) if (x, y) != (0.0, 0.0) else 0.0
    assert portable_math.angle_of(y, x) == pytest.approx(abs(expected) if y == 0 else expected, abs=1e-10)


@given(numbers, numbers)
def test_angle_of_and_arctan2_give_the_same_bits(y: float, x: float) -> None:
    assert portable_math.angle_of(y, x) == float(portable_math.arctan2(np.array([y]), np.array([x]))[0])


@given(angles)
def test_unit_vector_is_cosine_and_sine(theta: float) -> None:
    assert portable_math.unit_vector(theta) == pytest.approx((math.cos(theta), math.sin(theta)), abs=1e-12)


@given(st.floats(-0.5, 0.5))
def test_rotation_is_cosine_and_sine_of_unit_length(angle: float) -> None:
    c, s = portable_math.rotation(angle)
    assert (c, s) == pytest.approx((math.cos(angle), math.sin(angle)), abs=2e-7)
    assert c * c + s * s == pytest.approx(1.0, abs=1e-15)
