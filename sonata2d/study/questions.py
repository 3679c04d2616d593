"""Kinds of questions, one class each, and published questionnaires.

A kind of question is a subclass of `Question`, and an instance is one question of a study. A kind declares its keys in
the study file as fields, checks answers in `check`, and names the function of the page that draws it, its `renderer`;
the page gets all keys, with texts in the participant's language. A kind without a renderer is answered in a text field,
and `check` decides. Other packages add kinds through the entry-point group `sonata2d.question_kinds`.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import BeforeValidator, Field, JsonValue, SerializeAsAny, model_validator

from ..core.geometry import quantised
from ..core.labels import LabelSpec
from ..core.wording import shown
from ..errors import ConfigError
from ..registry import QUESTION_KINDS
from ..scenegen.scenario.base import Settings, TupleOf
from ..scenegen.scenario.problems import setting_error
from .scales import Item, Scale, scale_named, scale_names
from .texts import Json, Name, Text, Texts, TwoTexts, in_language, no_text, require_distinct, with_texts

_MAX_TEXT_ANSWER = 5000  # characters
_MAX_NUMBER = 2**53  # largest magnitude at which JSON readers keep integers exact


class Entry(Settings):
    """Base class of the entries of a page of questions: a question, or a published questionnaire.

    Attributes:
        name: key of the answer.
        required: whether the participant has to answer.
        personal: whether the answer is stored with the personal answers, which exports leave out; by default, the
            answers to `demographics` are.
    """

    translated: ClassVar[tuple[str, ...]] = ()

    name: Name
    required: bool = True
    personal: bool | None = None

    def check(self, value: Any) -> Any:
        """The answer as it is stored.

        Args:
            value: the answer that the page sent, a JSON value that is not empty.

        Returns:
            A JSON value; of a table, the points by name of the row.

        Raises:
            ValueError: the answer does not fit; the message names question, value and the expected answers.
        """
        raise NotImplementedError

    def content(self, language: str) -> Json:
        """The entry as the page gets it, in a language.

        Returns:
            JSON with `name`, `required`, `question`, the name of a `renderer` of the page, and the keys that the
            renderer needs.
        """
        raise NotImplementedError


class Question(Entry):
    """A question; base class of the kinds of questions.

    Attributes:
        name: key of the answer.
        kind: name of the kind, which may have further keys.
        question: the question, or the heading of a table.
        required: whether the participant has to answer.
        personal: whether the answer is stored with the personal answers, which exports leave out; by default, the
            answers to `demographics` are.
        right: the right answer, as it is stored, of a question that checks attention or comprehension; the page does
            not get it. Other answers are counted in the table of participants.
        screen_out: whether another answer ends the study for the participant.
        until_right: whether the participant has to answer again after another answer.
    """

    renderer: ClassVar[str] = "text"  # key of the RENDERERS of the page
    translated: ClassVar[tuple[str, ...]] = ("question",)  # keys whose values are texts
    remedies: ClassVar[Mapping[str, str]] = {}  # error messages by key that must be set

    kind: str
    question: Text
    right: JsonValue = None
    screen_out: bool = False
    until_right: bool = False

    @model_validator(mode="after")
    def _check_right(self) -> Self:
        for key in ("screen_out", "until_right"):
            if getattr(self, key) and self.right is None:
                raise setting_error("the question needs the right answer: right", key)
        if self.screen_out and self.until_right:
            raise setting_error("an answer either ends the study or is asked for again", "until_right")
        if self.right is not None:
            try:
                self.check(self.right)
            except ValueError as error:
                raise setting_error(str(error), "right") from None
        return self

    @model_validator(mode="before")
    @classmethod
    def _require_own_keys(cls, values: Any) -> Any:
        if isinstance(values, dict):
            for key, remedy in cls.remedies.items():
                if values.get(key) is None:
                    raise setting_error(remedy, key)
            for key in values.keys() - cls.model_fields.keys():
                kinds = [kind for kind in QUESTION_KINDS.built_in if key in QUESTION_KINDS.load(kind).model_fields]
                if kinds:
                    raise setting_error(f"this key needs kind: {' or '.join(kinds)}", key)
        return values

    def check(self, value: Any) -> Any:
        """The text, if it is one; kinds with other answers override this method."""
        if not isinstance(value, str):
            raise self.refusal(value, "a text")
        if len(value) > _MAX_TEXT_ANSWER:
            raise ValueError(f"{self.name} has {len(value)} characters; up to {_MAX_TEXT_ANSWER} are stored")
        return value.encode(errors="replace").decode()  # without surrogates, which cannot be stored

    def content(self, language: str) -> Json:
        content = with_texts(self, lambda text: in_language(text, language)) | {"renderer": self.renderer}
        return {
            key: value for key, value in content.items() if key not in ("right", "screen_out", "until_right", "score")
        }

    def refusal(self, value: Any, expected: str) -> ValueError:
        """The error about an answer that does not fit.

        Args:
            value: the answer.
            expected: description of the answers that fit, such as "a date".
        """
        return ValueError(f"{self.name} is {shown(value)}; {expected} is expected")


class LabelQuestion(Question):
    """Base class of the kinds whose answers are labels of runs, so that recorded runs can be rated with them."""

    label_kind: ClassVar[Literal["yes_no", "classes", "slider", "text"]]  # in files; see `LabelSpec`

    def label(self, language: str = "") -> LabelSpec:
        """The question as files of ratings hold it, in a language; by default in the first one."""
        content = self.content(language)
        texts = {key: content[key] for key in ("name", "question", "classes", "ends") if key in content}
        return LabelSpec.from_settings({"kind": self.label_kind, "when": "run"} | texts)

    def check(self, value: Any) -> Any:
        return self.label().validate(value)


class YesNo(LabelQuestion):
    """A question that is answered with yes or no; the answer is true or false, in tables 1 or 0."""

    renderer = label_kind = "yes_no"


class Classes(LabelQuestion):
    """A choice of one of several classes; the answer is the number of the class, from 1.

    Attributes:
        classes: names of the classes, or their number; 2 to 20. Names in several languages are
            `{en: [rude, kind], de: [grob, nett]}` or `[{en: rude, de: grob}, {en: kind, de: nett}]`; the texts of all
            other lists and pairs, too.
    """

    renderer = label_kind = "classes"
    translated = ("question", "classes")
    remedies: ClassVar = {"classes": "give the names of the classes, or their number"}

    classes: Annotated[Texts, Field(min_length=2, max_length=20)]

    @model_validator(mode="before")
    @classmethod
    def _name_classes(cls, values: Any) -> Any:
        """Convert a number of classes to the names "1", "2", …"""
        count = values.get("classes") if isinstance(values, dict) else None
        if isinstance(count, int) and not isinstance(count, bool):  # 21 names are one too many: an error follows
            return values | {"classes": tuple(str(k) for k in range(1, min(count, 21) + 1))}
        return values


class Slider(LabelQuestion):
    """A slider; the answer is its position from 0 to 1.

    Attributes:
        ends: meaning of 0 and of 1.
    """

    renderer = label_kind = "slider"
    translated = ("question", "ends")
    remedies: ClassVar = {"ends": "give the meaning of both ends: [not at all, entirely]"}

    ends: TwoTexts


class FreeText(LabelQuestion):
    """A text field; the answer is a text of up to 5000 characters."""

    label_kind = "text"

    def check(self, value: Any) -> Any:
        return Question.check(self, value)


class Number(Question):
    """A number; the answer is the number as it was given, with up to four decimals.

    Attributes:
        minimum, maximum: limits of the answer, which are allowed.
        integer: whether the number is a whole one.
    """

    renderer = "number"

    minimum: float | None = None
    maximum: float | None = None
    integer: bool = False

    @model_validator(mode="after")
    def _check_limits(self) -> Self:
        if self.minimum is not None and self.maximum is not None and self.minimum > self.maximum:
            raise setting_error("the minimum is above the maximum", "minimum")
        return self

    def check(self, value: Any) -> Any:
        low, high = self.minimum, self.maximum
        is_number = isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= _MAX_NUMBER
        is_number = is_number and not (self.integer and value != int(value))
        if not is_number or (low is not None and value < low) or (high is not None and value > high):
            limits = ("" if low is None else f" from {low:g}") + ("" if high is None else f" up to {high:g}")
            raise self.refusal(value, f"a {'whole number' if self.integer else 'number'}{limits}")
        return value if isinstance(value, int) else quantised(float(value))


class Likert(Question):
    """A table of statements with one scale; the answer is a point for each row, from 1.

    Attributes:
        items: rows by name: a statement, `{text: …, reversed: true}`, or `{ends: [bad, good]}`, a pair of opposites;
            see `Item`.
        points: number of points, 2 to 11.
        ends: meaning of the first and last point.
        labels: name of each point.
        shuffle: whether the rows are in random order, another one for each participant.
        score: whether the mean of the points is a score, a row of scores.csv, as of all published questionnaires.
    """

    renderer = "likert"
    translated = ("question", "ends", "labels")
    remedies: ClassVar = {"items": "a likert table needs items"}

    items: Annotated[TupleOf[Item], Field(min_length=1, max_length=60)]
    points: Annotated[int, Field(ge=2, le=11)] = 5
    ends: TwoTexts | None = None
    labels: Annotated[Texts, Field(min_length=2, max_length=11)] | None = None
    shuffle: bool = False
    score: bool = False

    @model_validator(mode="before")
    @classmethod
    def _name_items(cls, values: Any) -> Any:
        """Convert rows by name to a list of items: `{calm: The robot was calm.}`"""
        items = values.get("items") if isinstance(values, dict) else None
        if not isinstance(items, dict):
            return values
        rows = []
        for name, row in items.items():
            if row is None:
                raise setting_error(str(no_text(name)), "items")
            # A row has settings, or is a text, in one language or by language.
            is_item = isinstance(row, dict) and not Item.model_fields.keys().isdisjoint(row)
            rows.append({"name": name} | (row if is_item else {"text": row}))
        return values | {"items": rows}

    @model_validator(mode="after")
    def _check_rows(self) -> Self:
        if self.labels is not None and len(self.labels) != self.points:
            raise setting_error(f"there are {len(self.labels)} labels for {self.points} points", "labels")
        require_distinct("items", self.items, "items")
        return self

    def check(self, value: Any) -> dict[str, int]:
        if not isinstance(value, Mapping):
            raise self.refusal(value, "a number for each item")
        names = [item.name for item in self.items]
        for name, point in value.items():
            if name not in names:
                raise ValueError(f"{self.name} has no item {shown(name)}")
            if isinstance(point, bool) or not isinstance(point, int) or not 1 <= point <= self.points:
                expected = f"a number from 1 to {self.points} is expected"
                raise ValueError(f"{self.name}.{name} is {shown(point)}; {expected}")
        missing = [name for name in names if name not in value]
        if missing and self.required:
            raise ValueError(f"{self.name}.{missing[0]} is not answered")
        return {name: value[name] for name in names if name in value}

    def content(self, language: str) -> Json:
        content = super().content(language)
        # The page must not show which rows are reversed, or what they belong to.
        rows = [{key: item[key] for key in ("name", "text", "ends")} for item in content["items"]]
        return content | {"items": rows}


class ScaleConfig(Entry):
    """A published questionnaire by its name.

    Attributes:
        scale: name of the questionnaire.
        name: key of the answers; by default the name of the questionnaire.
        subscales: the parts to ask; by default all.
        texts: translations: by language, the text of each item (of a pair of opposites, both as a list), and of
            `question`, `first` and `last`.
        shuffle: whether the items are in random order, another one for each participant.
        required, personal: as of a question.
    """

    scale: str
    subscales: TupleOf[str] = ()
    texts: dict[str, dict[str, str | tuple[str, str]]] = Field(default_factory=dict)
    shuffle: bool = False

    @model_validator(mode="before")
    @classmethod
    def _choose_name(cls, values: Any) -> Any:
        is_nameless = isinstance(values, dict) and not values.get("name")
        return values | {"name": str(values.get("scale"))} if is_nameless else values

    @model_validator(mode="after")
    def _check_scale(self) -> Self:
        if self.scale not in scale_names():
            raise setting_error(f"there is no scale {self.scale!r}; scales are {', '.join(scale_names())}", "scale")
        scale = scale_named(self.scale)
        for k, subscale in enumerate(self.subscales):
            if subscale not in scale.subscales:
                known = ", ".join(scale.subscales)
                raise setting_error(f"{self.scale} has no part {subscale!r}; it has {known}", "subscales", k)
        for language, texts in self.texts.items():
            for key, text in texts.items():
                reason = scale.problem_of_translation(key, text)
                if reason:
                    raise setting_error(reason, "texts", language, key)
        return self

    @property
    def definition(self) -> Scale:
        """The questionnaire, with the selected parts only."""
        return scale_named(self.scale).part(self.subscales)

    @cached_property
    def table(self) -> Likert:
        """The questionnaire as a table of statements, in English and in the languages of the translations."""
        scale = self.definition

        def translated(key: str, text: Any) -> dict[str, Any]:
            return {"en": text} | {language: texts[key] for language, texts in self.texts.items() if key in texts}

        def pair(texts: Mapping[str, Any]) -> list[Json]:
            return [{language: ends[k] for language, ends in texts.items()} for k in (0, 1)]

        items = [
            {"name": item.name, "ends": pair(translated(item.name, item.ends))}
            if item.ends
            else {"name": item.name, "text": translated(item.name, item.text)}
            for item in scale.items
        ]
        ends = [translated(key, end) for key, end in zip(("first", "last"), scale.ends or (), strict=False)]
        settings: Json = {"kind": "likert", "name": self.name, "required": self.required, "shuffle": self.shuffle}
        question = translated("question", scale.question)
        return Likert.model_validate(
            settings | {"question": question, "points": scale.points, "ends": ends or None, "items": items}
        )

    def check(self, value: Any) -> Any:
        return self.table.check(value)

    def content(self, language: str) -> Json:
        return self.table.content(language)


_BUILT_IN: dict[str, type[Question]] = {
    "yes_no": YesNo, "classes": Classes, "slider": Slider, "text": FreeText, "number": Number, "likert": Likert,
}  # fmt: skip
QUESTION_KINDS.built_in |= {name: f"{__name__}:{kind.__name__}" for name, kind in _BUILT_IN.items()}


def question_kind(name: str) -> type[Question]:
    """A kind of question.

    Raises:
        Sonata2dError: no kind has this name, or the plug-in that provides it cannot be loaded.
    """
    kind: type[Question] = QUESTION_KINDS.load(name, _problem_of_kind)
    return kind


def _problem_of_kind(kind: object) -> str | None:
    """The reason why an object cannot be used as a kind of question, or None."""
    is_kind = isinstance(kind, type) and issubclass(kind, Question)
    return None if is_kind else "is not a kind of question; it must be a subclass of sonata2d.study.Question"


def _parse_question(value: Any) -> Any:
    """Validate settings as a question of the kind that they name; other values are returned as they are."""
    if not isinstance(value, dict):
        return value
    name = value.get("kind")
    if not isinstance(name, str):
        raise setting_error(f"a question needs a kind: {', '.join(QUESTION_KINDS)}", "kind")
    try:
        kind = question_kind(name)
    except ConfigError as error:
        raise setting_error(str(error), "kind") from None
    return kind.model_validate(value)


def _parse_entry(value: Any) -> Any:
    """Validate settings with the key `scale` as a published questionnaire, and others as a question."""
    is_scale = isinstance(value, dict) and "scale" in value
    return ScaleConfig.model_validate(value) if is_scale else _parse_question(value)


def _parse_rating_question(value: Any) -> Any:
    question = _parse_question(value)
    if isinstance(question, Question) and not isinstance(question, LabelQuestion):
        raise setting_error("runs are rated with yes_no, classes, slider or text", "kind")
    return question


AnyEntry = Annotated[SerializeAsAny[Entry], BeforeValidator(_parse_entry)]
RatingQuestion = Annotated[SerializeAsAny[LabelQuestion], BeforeValidator(_parse_rating_question)]
