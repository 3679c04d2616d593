"""`LabelSpec`: what kind of label a human driver or rater gives, and when."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal, Self

from annotated_types import MinLen

from .geometry import quantised

Kind = Literal["command", "yes_no", "classes", "slider", "text"]
When = Literal["frame", "run"]

LABEL_DEVICE = "label"  # device name of events that carry a label given while driving; their value is its position


@dataclass(frozen=True, slots=True)
class LabelSpec:
    """Specification of the label that a driver or rater is asked for.

    Labels of the kinds yes_no, classes and slider have a position on a scale from 0 to 1.

    Attributes:
        kind: command: the robot's command itself, without a question; yes_no: true or false; classes: the number of a
            class, from 1; slider: a number from 0 to 1; text: text, for a whole run only.
        when: frame: for every frame while driving; run: once for a whole run, afterwards.
        name: key of the label in frames.
        question: text shown to the driver or rater.
        classes: names of the 2 to 9 classes, of which the first one has number 1; a scenario may give their number.
        ends: meaning of 0 and 1 on the slider.
    """

    kind: Kind = "command"
    when: When = "run"
    name: Annotated[str, MinLen(1)] = "label"
    question: str = ""
    classes: tuple[str, ...] = ()
    ends: tuple[str, str] = ("not at all", "entirely")

    @classmethod
    def from_settings(cls, settings: Mapping[str, Any]) -> Self:
        """The specification from its fields as a file stores them; lists become tuples."""
        fields: Any = {key: tuple(value) if isinstance(value, list) else value for key, value in settings.items()}
        return cls(**fields)

    @property
    def per_frame(self) -> bool:
        """Whether a label is given for every frame."""
        return self.kind != "command" and self.when == "frame"

    @property
    def per_run(self) -> bool:
        """Whether one label is given for the whole run."""
        return self.kind != "command" and self.when == "run"

    @property
    def levels(self) -> int:
        """Number of possible labels; 0 for continuous values and text."""
        return {"yes_no": 2, "classes": len(self.classes)}.get(self.kind, 0)

    def label_at(self, position: float) -> bool | int | float:
        """The label at a position on the scale, 0 to 1.

        >>> LabelSpec("classes", classes=("poor", "fair", "good")).label_at(0.5)
        2
        """
        if self.kind == "slider":
            return quantised(position)
        level = int(position * (self.levels - 1) + 0.5)
        return bool(level) if self.kind == "yes_no" else level + 1

    def position_of(self, label: bool | int | float) -> float:
        """Position of a label on the scale, 0 to 1; the inverse of `label_at`."""
        if self.kind == "slider":
            return float(label)
        level = int(label) - (self.kind == "classes")  # classes are numbered from 1
        return level / max(self.levels - 1, 1)

    def validate(self, label: Any) -> Any:
        """Check a label against its kind.

        Returns:
            The label; of a slider at the precision of files.

        Raises:
            ValueError: the label is not of this kind; the message describes the expected labels.
        """
        is_bool = isinstance(label, bool)  # a bool is an int, but not a class number or a slider value
        is_valid = {
            "yes_no": is_bool,
            "classes": isinstance(label, int) and not is_bool and 1 <= label <= self.levels,
            "slider": isinstance(label, int | float) and not is_bool and 0.0 <= label <= 1.0,
            "text": isinstance(label, str),
        }.get(self.kind, False)
        if not is_valid:
            raise ValueError(f"{label!r} is not a valid {self.name}; expected: {self.meaning}")
        return quantised(float(label)) if self.kind == "slider" else label

    def in_words(self, label: Any) -> str:
        """A label as text for display; empty for the kind command.

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
        """The question and the possible labels in words, as recorded in files."""
        scale = {
            "command": "the command itself",
            "yes_no": "true or false",
            "classes": ", ".join(f"{k}: {name}" for k, name in enumerate(self.classes, 1)),
            "slider": f"0 ({self.ends[0]}) to 1 ({self.ends[1]})",
            "text": "text",
        }[self.kind]
        return f"{self.question} {scale}".strip()
