"""Published questionnaires by name, with their sources; their items are in `scales/`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import ClassVar, Self

from pydantic import model_validator

from ..scenegen.scenario.base import Settings
from ..scenegen.scenario.parse import parse_settings
from ..scenegen.scenario.problems import setting_error
from .texts import Text, TwoTexts

_FOLDER = Path(__file__).with_name("scales")
_FRAME = ("question", "first", "last")  # texts of a scale besides its items


class Item(Settings):
    """A row of a table: a statement, or a pair of opposites.

    Attributes:
        name: key of the answer.
        text: the statement; none for a pair of opposites.
        ends: the opposites.
        reversed: whether agreement means the opposite of what the table measures; stored values are not changed.
        subscale: part of the questionnaire that the item belongs to.
    """

    translated: ClassVar[tuple[str, ...]] = ("text", "ends")

    name: str
    text: Text | None = None
    ends: TwoTexts | None = None
    reversed: bool = False
    subscale: str = ""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if not self.name:
            raise setting_error("an item needs a name", "name")
        if not self.text and self.ends is None:
            raise setting_error("an item needs a text, or the two ends of a pair of opposites")
        return self


@dataclass(frozen=True, slots=True)
class Scale:
    """A published questionnaire.

    Attributes:
        name: by which studies refer to it.
        title: its name in the literature.
        source: publication.
        question: what stands above the table.
        points: number of points of each item.
        ends: meaning of the first and last point; empty for pairs of opposites.
        items: the rows, in English.
    """

    name: str
    title: str
    source: str
    question: str
    points: int
    ends: tuple[str, str] | None
    items: tuple[Item, ...]

    @property
    def subscales(self) -> tuple[str, ...]:
        """Names of its parts."""
        return tuple(dict.fromkeys(item.subscale for item in self.items))

    def part(self, subscales: Sequence[str]) -> Scale:
        """The questionnaire reduced to some of its parts; without names, the whole questionnaire."""
        return replace(self, items=tuple(item for item in self.items if item.subscale in (subscales or self.subscales)))

    def problem_of_translation(self, key: str, text: object) -> str:
        """The reason why a translation of an item does not fit; empty if it fits."""
        if key in _FRAME:
            return "" if isinstance(text, str) else f"{key} is one text"
        item = next((item for item in self.items if item.name == key), None)
        if item is None:
            return f"{self.name} has no item {key!r}; items are {', '.join(item.name for item in self.items)}"
        if isinstance(text, str) is (item.ends is not None):
            return "this item is a pair of opposites: [first, last]" if item.ends else "this item is one text"
        return ""

    def untranslated(self, texts: Mapping[str, object], language: str) -> list[str]:
        """Keys of the texts that have no translation in a language."""
        if language == "en":
            return []
        frame = _FRAME if self.ends else _FRAME[:1]
        return [key for key in (*frame, *(item.name for item in self.items)) if key not in texts]


def scale_names() -> list[str]:
    """Names of the questionnaires that come with sonata2d."""
    return sorted(path.stem for path in _FOLDER.glob("*.yaml"))


@cache
def scale_named(name: str) -> Scale:
    """A questionnaire.

    >>> [scale_named("rosas").points, len(scale_named("rosas").items)]
    [9, 18]
    """
    content = parse_settings(_FOLDER / f"{name}.yaml")
    items = []
    for subscale, rows in content["items"].items():
        for key, text in rows.items():
            is_reversed = key in content.get("reversed", ())
            pair = {"ends": tuple(text)} if isinstance(text, list) else {"text": text}
            items.append(Item(name=key, subscale=subscale, reversed=is_reversed, **pair))
    ends = (content["first"], content["last"]) if "first" in content else None
    return Scale(name, content["title"], content["source"], content["question"], content["points"], ends, tuple(items))
