"""Calls of kernels from kernels by address."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pytest

from sonata2d.core.compiled.calls import FLOAT, FLOATS, INT, PACKED, address_of, call, call_for_flag, call_for_int
from sonata2d.core.compiled.kernel import IS_COMPILED, kernel
from sonata2d.core.compiled.packing import Floats, Ints, pack, unpack
from sonata2d.core.portable_math import Array, IntArray


class Inner(NamedTuple):
    values: Floats


class Outer(NamedTuple):
    number: float
    inner: Inner
    function: Ints


@kernel
def scaled(packed: Any, factor: int, values: Array) -> int:
    """Multiply the values; the number of values."""
    outer = unpack(packed, Outer)
    for k in range(len(values)):
        values[k] = values[k] * factor + outer.number
    if factor == 0:
        raise ValueError("the factor is zero")
    return len(values)


@kernel
def is_above(limit: float, values: Array) -> bool:
    return bool(values.min() > limit)


@kernel
def through_address(packed: Any, factor: int) -> int:
    """`scaled`, on the values of the inner tuple."""
    outer = unpack(packed, Outer)
    return call_for_int(outer.function, (outer, factor, outer.inner.values))


@kernel
def flag_through_address(function: IntArray, limit: float, values: Array) -> bool:
    return call_for_flag(function, (limit, values))


@kernel
def with_other_types(function: IntArray, values: Array) -> None:
    call(function, (values,))


@kernel
def with_a_part(packed: Any) -> int:
    """Pass a part of a packed tuple where the whole is expected."""
    outer = unpack(packed, Outer)
    return call_for_int(outer.function, (outer.inner, 2, outer.inner.values))


def outer() -> Outer:
    return Outer(0.5, Inner(np.array([1.0, 2.0])), address_of(scaled, PACKED, INT, FLOATS))


def test_a_kernel_is_called_by_its_address() -> None:
    value = outer()
    assert through_address(pack(value), 3) == 2
    assert value.inner.values.tolist() == [3.5, 6.5]


def test_a_flag_is_returned() -> None:
    address, values = address_of(is_above, FLOAT, FLOATS), np.array([2.0, 3.0])
    assert flag_through_address(address, 1.0, values)
    assert not flag_through_address(address, 2.5, values)


def test_an_exception_reaches_the_caller() -> None:
    with pytest.raises(ValueError, match="the factor is zero"):
        through_address(pack(outer()), 0)


@pytest.mark.skipif(not IS_COMPILED, reason="the interpreter has no types of arguments")
def test_other_types_and_parts_are_refused() -> None:
    with pytest.raises(TypeError, match="other types than it was compiled for"):
        with_other_types(outer().function, np.zeros(2))
    with pytest.raises(TypeError, match="not a Outer"):
        with_a_part(pack(outer()))
