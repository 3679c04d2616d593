"""A kind of question of a study: a date."""

from __future__ import annotations

from datetime import date
from typing import Any

from sonata2d.study import Question


class DateQuestion(Question):
    """A date; the answer is a text such as `2026-05-17`.

    Attributes:
        earliest, latest: limits of the answer, which are allowed.
        input: type of the browser's field, for the renderer `input`.
    """

    renderer = "input"

    earliest: date | None = None
    latest: date | None = None
    input: str = "date"

    def check(self, value: Any) -> str:
        try:
            day = date.fromisoformat(value)
        except (TypeError, ValueError):
            raise self.refusal(value, "a date such as 2026-05-17") from None
        if self.earliest is not None and day < self.earliest:
            raise self.refusal(value, f"a date from {self.earliest} on")
        if self.latest is not None and day > self.latest:
            raise self.refusal(value, f"a date up to {self.latest}")
        return day.isoformat()
