"""Attributes of people, objects, areas and the episode: declared once with a type, drawn by weight or given."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any, Literal, get_args

from .bounds import ADDITIVE, MAX_MAGNITUDE

Holder = Literal["people", "objects", "areas", "episode"]
AttributeType = Literal["classes", "yes_no", "number", "text"]
AttributeValue = bool | float | str
Attributes = dict[str, AttributeValue]  # values by name

_SURROGATE = re.compile("[\ud800-\udfff]")
HOLDERS: tuple[Holder, ...] = get_args(Holder)


@dataclass(frozen=True, slots=True)
class AttributeSpec:
    """Declaration of an attribute.

    Attributes:
        of: holders of the attribute: people, objects, areas, or the episode.
        name: unique among the attributes of these holders.
        type: classes: one of `values`; yes_no: true or false; number: any number; text: any text.
        values: names of the classes.
        value: of an attribute of the episode; None for people, objects and areas, which hold their own values.
    """

    of: Holder
    name: str
    type: AttributeType
    values: tuple[str, ...] = ()
    value: AttributeValue | None = field(default=None, metadata=ADDITIVE)

    def problem(self, value: Any) -> str | None:
        """Why a value does not fit the declaration, or None.

        >>> AttributeSpec("people", "emotion", "classes", ("calm", "angry")).problem("happy")
        'must be one of calm, angry'
        """
        is_number = isinstance(value, int | float) and not isinstance(value, bool)
        if self.type == "classes":
            return None if value in self.values else f"must be one of {', '.join(self.values)}"
        if self.type == "yes_no":
            return None if isinstance(value, bool) else "must be true or false"
        if self.type == "number":
            if not is_number:
                return "must be a number"
            return None if abs(value) <= MAX_MAGNITUDE else f"must have a magnitude of at most {MAX_MAGNITUDE:g}"
        if not isinstance(value, str):
            return "must be a text"
        return "must be a text that UTF-8 can encode" if _SURROGATE.search(value) else None


def attribute_text(attributes: Attributes | None) -> str:
    """The values of attributes as words, for labels in pictures: texts, names of those that are true, numbers by name.

    >>> attribute_text({"emotion": "angry", "hurried": True, "fragile": False, "age": 71.0})
    'angry, hurried, age 71'
    """
    words = []
    for name, value in (attributes or {}).items():
        if value is True:
            words.append(name.replace("_", " "))
        elif isinstance(value, str):
            words.append(value)
        elif not isinstance(value, bool):
            words.append(f"{name.replace('_', ' ')} {value:.3g}")
    return ", ".join(words)


@dataclass(frozen=True, slots=True)
class AttributeColumn:
    """A numeric column of an attribute, for observations and graphs: one for each class, or for a flag or a number.

    Attributes:
        spec: declaration of the attribute.
        value: the class for which the column is 1; None: the column is the flag, 1 or 0, or the number.
    """

    spec: AttributeSpec
    value: str | None = None

    @property
    def name(self) -> str:
        """Name of the column, such as `emotion=angry`, `hurried` or `age`."""
        return self.spec.name if self.value is None else f"{self.spec.name}={self.value}"

    def number(self, attributes: Attributes | None) -> float:
        """The number in the column of a holder; 0 without a value."""
        value = (attributes or {}).get(self.spec.name, 0.0)
        return float(value == self.value if self.value is not None else value)


def attribute_columns(specs: Iterable[AttributeSpec], of: Holder) -> tuple[AttributeColumn, ...]:
    """The numeric columns of the attributes of some holders; texts have none."""
    columns: list[AttributeColumn] = []
    for spec in specs:
        if spec.of == of and spec.type != "text":
            columns += [AttributeColumn(spec, value) for value in spec.values or (None,)]
    return tuple(columns)
