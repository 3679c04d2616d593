"""Interruptions are told apart from errors of the code of others."""

from __future__ import annotations

import pytest

from sonata2d.core.files.interruption import forget, interrupt, interruption_in, reraise


@pytest.mark.parametrize("depth", [1, 2, 3])
def test_an_interruption_of_compiled_code_is_found_in_the_errors_of_python(depth: int) -> None:
    stop = KeyboardInterrupt()
    error: BaseException = stop
    for _ in range(depth):  # one for each compiled caller
        wrapping = SystemError("returned a result with an exception set")
        wrapping.__cause__ = error
        error = wrapping
    assert interruption_in(error) is stop
    with pytest.raises(KeyboardInterrupt):
        reraise(error)


@pytest.mark.parametrize("error", [SystemError("of an extension"), SystemExit(0), GeneratorExit(), ValueError("no")])
def test_other_errors_are_no_interruptions(error: BaseException) -> None:
    assert interruption_in(error) is None
    reraise(error)


def test_errors_that_cause_themselves_are_no_interruptions() -> None:
    error = SystemError("of an extension")
    error.__cause__ = error
    assert interruption_in(error) is None


def test_errors_that_follow_a_signal_are_interruptions() -> None:
    stop = KeyboardInterrupt()
    try:
        with pytest.raises(KeyboardInterrupt):
            interrupt(stop)
        with pytest.raises(KeyboardInterrupt) as raised:
            reraise(ValueError("of a library"))
        assert raised.value is stop
    finally:
        forget()
    reraise(ValueError("of a library"))
