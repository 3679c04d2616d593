"""Texts in messages are short, on one line, and made from the beginning of a large value only."""

from __future__ import annotations

from sonata2d.core.wording import one_line, shown


def test_a_text_is_one_line_of_limited_length() -> None:
    assert one_line(ValueError(" a\n  b\tc ")) == "a b c"
    assert one_line("x" * 300, 20) == "x" * 17 + "..."
    assert one_line("x" * 20, 20) == "x" * 20
    assert one_line("a" + " " * 10_000 + "b", 20) == "a..."


def test_a_value_is_one_line_of_limited_length() -> None:
    assert shown([1, "a", None]) == "[1, 'a', None]"
    assert shown("a\nb") == r"'a\nb'"
    for value in ("x" * 10_000, list(range(10_000)), {str(k): k for k in range(10_000)}, 10**4000):
        assert len(shown(value)) <= 60


def test_only_the_beginning_of_a_large_value_is_converted() -> None:
    class Counted:
        count = 0

        def __repr__(self) -> str:
            Counted.count += 1
            return "item"

    assert shown([Counted() for _ in range(1000)]).startswith("[item, item, ")
    assert Counted.count < 20
