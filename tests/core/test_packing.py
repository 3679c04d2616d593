"""Named tuples handed to kernels by their addresses."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import pytest

from sonata2d.core.compiled.kernel import IS_COMPILED, kernel
from sonata2d.core.compiled.packing import Bools, Floats, Floats2, pack, unpack

compiled_only = pytest.mark.skipif(not IS_COMPILED, reason="kernels are interpreted")


class Part(NamedTuple):
    values: Floats
    table: Floats2


class Whole(NamedTuple):
    scale: float
    part: Part
    flags: Bools


class Permuted(NamedTuple):
    part: Part
    scale: float
    flags: Bools


class Shorter(NamedTuple):
    scale: float


@kernel
def fill(packed: Any) -> float:
    """Fill the table, and return the sum of the flagged values."""
    whole = unpack(packed, Whole)
    total = 0.0
    for k in range(len(whole.part.values)):
        for column in range(whole.part.table.shape[1]):
            whole.part.table[k, column] = whole.scale * whole.part.values[k] + column
        if whole.flags[k]:
            total += whole.part.values[k]
    return total


def whole(**changes: Any) -> Whole:
    part = Part(np.array([1.0, 2.0, 4.0]), np.zeros((3, 2)))._replace(**changes)
    return Whole(10.0, part, np.array([True, False, True]))


def test_a_kernel_works_on_the_memory_of_the_arrays() -> None:
    value = whole()
    assert fill(pack(value)) == 5.0
    assert value.part.table.tolist() == [[10.0, 11.0], [20.0, 21.0], [40.0, 41.0]]


@compiled_only
@pytest.mark.parametrize("other", [Permuted(whole().part, 10.0, whole().flags), Shorter(10.0), whole().part])
def test_a_named_tuple_with_other_fields_is_refused(other: Any) -> None:
    with pytest.raises(TypeError, match="not a Whole"):
        fill(pack(other))


@compiled_only
@pytest.mark.parametrize(
    "changes",
    [
        {"values": np.array([1, 2, 4])},
        {"values": np.zeros((3, 1))},
        {"table": np.zeros((2, 3)).T},
        {"table": np.zeros((3, 4))[:, ::2]},
        {"values": [1.0, 2.0]},
        {"values": None},
    ],
    ids=["type", "dimensions", "order", "stride", "list", "none"],
)
def test_an_array_that_a_kernel_would_misread_is_refused(changes: dict[str, Any]) -> None:
    with pytest.raises(TypeError, match=r"Part\.\w+ must be a contiguous array of float64"):
        pack(whole(**changes))


@compiled_only
@pytest.mark.parametrize(
    ("first", "third"), [("1.0", True), (1.0, 0.5), (1.0, "no"), (1.0, np.zeros(3)), (1.0, 1 << 63), ([1.0], False)]
)
def test_a_number_of_another_kind_is_refused(first: Any, third: Any) -> None:
    with pytest.raises(TypeError, match=r"Numbers must have a .*number in place of"):
        pack(Numbers(first, 1.0, third, np.zeros((1, 2))))


class Nothing(NamedTuple):
    """No fields."""


@compiled_only
def test_a_named_tuple_without_fields_can_be_packed() -> None:
    assert len(pack(Nothing())) == 1


class Numbers(NamedTuple):
    first: float
    second: float
    is_third: bool
    table: Floats2


@kernel
def numbers_of(packed: Any) -> tuple[float, float, bool, int, int]:
    value = unpack(packed, Numbers)
    return value.first, value.second, value.is_third, value.table.shape[0], value.table.shape[1]


@pytest.mark.parametrize("second", [-0.0, math.nan, math.inf, 5e-324, 3, np.float64(0.1)])
def test_numbers_keep_their_bits(second: float) -> None:
    frozen = np.zeros((0, 3))
    frozen.flags.writeable = False
    found = numbers_of(pack(Numbers(1.5, second, True, frozen)))
    assert [float(number).hex() for number in found] == [float(n).hex() for n in (1.5, second, True, 0, 3)]
