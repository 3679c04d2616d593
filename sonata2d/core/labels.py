"""What a person is asked for besides the driving: `LabelSpec`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, Self

from .geometry import quantised

Kind = Literal["command", "yes_no", "classes", "slider", "text"]
When = Literal["frame", "run"]

DEVICE = "label"  # events of this device carry the label given while driving, its place on the scale as value


@dataclass(frozen=True, slots=True)
class LabelSpec:
    """What a label is, and when it is asked for.

    Attributes:
        kind: the command itself, which asks nothing; yes or no; one of so many classes; a slider from 0 to 1; text.
        when: for every frame while driving, or once for the whole run afterwards.
        name: key of the label in frames.
        question: what the person is asked.
        classes: names of the classes, the first one is number 1.
        ends: what 0 and 1 of the slider mean.
    """

    kind: Kind = "command"
    when: When = "run"
    name: str = "label"
    question: str = ""
    classes: tuple[str, ...] = ()
    ends: tuple[str, str] = ("not at all", "entirely")

    @classmethod
    def restored(cls, told: Mapping[str, Any]) -> Self:
        """The one that a file tells of."""
        known: Any = {key: tuple(value) if isinstance(value, list) else value for key, value in told.items()}
        return cls(**known)

    @property
    def per_frame(self) -> bool:
        return self.kind != "command" and self.when == "frame"

    @property
    def per_run(self) -> bool:
        return self.kind != "command" and self.when == "run"

    @property
    def levels(self) -> int:
        """How many answers there are; 0: any number, or any text."""
        return {"yes_no": 2, "classes": len(self.classes)}.get(self.kind, 0)

    def label_at(self, place: float) -> bool | int | float:
        """The label at a place on the scale, 0 to 1.

        >>> LabelSpec("classes", classes=("poor", "fair", "good")).label_at(0.5)
        2
        """
        if self.kind == "slider":
            return quantised(place)
        level = int(place * (self.levels - 1) + 0.5)
        return bool(level) if self.kind == "yes_no" else level + 1

    def place_of(self, label: bool | int | float) -> float:
        """Where on the scale a label lies, 0 to 1; the inverse of `label_at`."""
        if self.kind == "slider":
            return float(label)
        level = int(label) - (self.kind == "classes")
        return level / max(self.levels - 1, 1)

    def checked(self, label: Any) -> Any:
        """The label, if it is one of this kind.

        Raises:
            ValueError: it is none; says what one is.
        """
        fits = {
            "yes_no": isinstance(label, bool),
            "classes": isinstance(label, int) and not isinstance(label, bool) and 1 <= label <= self.levels,
            "slider": isinstance(label, int | float) and not isinstance(label, bool) and 0.0 <= label <= 1.0,
            "text": isinstance(label, str),
        }.get(self.kind, False)
        if not fits:
            raise ValueError(f"{label!r} is no {self.name}; it is {self.meaning}")
        return quantised(float(label)) if self.kind == "slider" else label

    def in_words(self, label: Any) -> str:
        """A label as people read it; empty where none is asked for.

        >>> LabelSpec("classes", classes=("poor", "fair")).in_words(2)
        '2 fair'
        """
        if self.kind == "command":
            return ""
        if label is None:
            return "not given"
        if self.kind == "yes_no":
            return "yes" if label else "no"
        if self.kind == "classes":
            name = self.classes[label - 1]
            return name if name == str(label) else f"{label} {name}"
        return f"{label:.2f}" if self.kind == "slider" else str(label)

    @property
    def meaning(self) -> str:
        """In words, for the file."""
        scale = {
            "command": "the command itself",
            "yes_no": "true or false",
            "classes": ", ".join(f"{k}: {name}" for k, name in enumerate(self.classes, 1)),
            "slider": f"0 ({self.ends[0]}) to 1 ({self.ends[1]})",
            "text": "text",
        }[self.kind]
        return f"{self.question} {scale}".strip()
