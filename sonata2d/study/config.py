"""The settings of a study: pages, consent, questions, practice, runs and ratings."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import Discriminator, Field, NonNegativeFloat, NonNegativeInt, Tag, model_validator
from pydantic_core import PydanticCustomError

from ..collect.rating import BREAK_AFTER, REPEAT_FRACTION
from ..core.bounds import Fraction
from ..core.devices import View
from ..scenegen.scenario.base import Settings, TupleOf
from .scales import Item, Scale, Text, scale_named, scale_names

Texts = TupleOf[Text]
QuestionKind = Literal["yes_no", "classes", "slider", "text", "number", "likert"]
Order = Literal["fixed", "shuffled", "latin-square"]
Change = Literal["view", "zoom", "zones"]
Path = tuple[str | int, ...]  # keys that lead to a setting

MAX_RUNS = 500  # of one block
MAX_TEXT = 20_000  # characters of a page
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]{0,39}")


def in_language(text: Text, language: str) -> str:
    """A text in a language; in the first one that it has if it lacks that language.

    >>> in_language({"en": "yes", "de": "ja"}, "de")
    'ja'
    """
    if isinstance(text, str):
        return text
    return text.get(language) or next(iter(text.values()), "")


class PageConfig(Settings):
    """A page to read.

    Attributes:
        title: heading.
        text: Markdown; HTML in it is shown as text.
    """

    translated: ClassVar[tuple[str, ...]] = ("title", "text")

    title: Text
    text: Text


class ConsentConfig(Settings):
    """What a participant agrees to before anything is answered or driven.

    Attributes:
        title: heading.
        text: Markdown.
        statements: each has to be ticked.
    """

    translated: ClassVar[tuple[str, ...]] = ("title", "text", "statements")

    title: Text
    text: Text
    statements: Annotated[Texts, Field(max_length=20)] = ()


class QuestionConfig(Settings):
    """One question, or a table of statements with one scale.

    Attributes:
        name: key of the answer.
        kind: `yes_no`, `classes`, `slider` and `text` as in `LabelSpec`; `number`; or `likert`, a table with one row
            for each of the `items`.
        question: the question, or what stands above the table.
        classes: names of the classes, or their number; 2 to 20.
        ends: meaning of the two ends of a slider, or of the first and last point of a `likert` table.
        points: number of points of a `likert` table, 2 to 11; the answer is 1 to `points`.
        labels: name of each point of a `likert` table.
        items: rows of a `likert` table by name: a statement, `{text: …, reversed: true}`, or `{ends: [bad, good]}`,
            a pair of opposites; see `Item`.
        minimum, maximum: of a number.
        integer: whether a number is a whole one.
        required: whether the participant has to answer.
        personal: whether the answer is stored with the personal answers, which exports leave out; by default, those of
            `demographics` are.
    """

    translated: ClassVar[tuple[str, ...]] = ("question", "classes", "ends", "labels")

    name: str
    kind: QuestionKind
    question: Text
    classes: Annotated[Texts, Field(min_length=2, max_length=20)] | None = None
    ends: tuple[Text, Text] | None = None
    points: Annotated[int, Field(ge=2, le=11)] = 5
    labels: Annotated[Texts, Field(min_length=2, max_length=11)] | None = None
    items: Annotated[TupleOf[Item], Field(min_length=1, max_length=60)] | None = None
    minimum: float | None = None
    maximum: float | None = None
    integer: bool = False
    required: bool = True
    personal: bool | None = None

    @model_validator(mode="before")
    @classmethod
    def _name_classes(cls, values: Any) -> Any:
        """Convert a number of classes to the names "1", "2", …, and texts of items to items."""
        if not isinstance(values, dict):
            return values
        count, items = values.get("classes"), values.get("items")
        if isinstance(count, int) and not isinstance(count, bool):
            values = values | {"classes": tuple(str(k) for k in range(1, min(count, 21) + 1))}
        if isinstance(items, dict):  # {calm: The robot was calm.}
            for name, row in items.items():
                if row is None:
                    raise _problem(f"{name!r} has no text; a text with a comma needs quotes within braces", "items")
            rows = [row if _is_item(row) else {"text": row} for row in items.values()]
            values = values | {"items": [{"name": name} | row for name, row in zip(items, rows, strict=True)]}
        return values

    @model_validator(mode="after")
    def _check_keys(self) -> Self:
        _require_name(self.name, ("name",))
        is_table = self.kind == "likert"
        if (self.kind == "classes") != (self.classes is not None):
            hint = "give the names of the classes, or their number" if self.kind == "classes" else "write kind: classes"
            raise _problem(hint, "classes")
        if is_table and self.items is None:
            raise _problem("a likert table needs items", "items")
        for key in ("items", "labels"):
            if not is_table and getattr(self, key) is not None:
                raise _problem("this key needs kind: likert", key)
        for key in ("minimum", "maximum"):
            if self.kind != "number" and getattr(self, key) is not None:
                raise _problem("this key needs kind: number", key)
        if self.kind != "number" and self.integer:
            raise _problem("this key needs kind: number", "integer")
        if self.kind == "slider" and self.ends is None:
            raise _problem("give the meaning of both ends: [not at all, entirely]", "ends")
        if self.ends is not None and not is_table and self.kind != "slider":
            raise _problem("ends need kind: slider or likert", "ends")
        if self.labels is not None and len(self.labels) != self.points:
            raise _problem(f"there are {len(self.labels)} labels for {self.points} points", "labels")
        if self.minimum is not None and self.maximum is not None and self.minimum > self.maximum:
            raise _problem("the minimum is above the maximum", "minimum")
        for k, item in enumerate(self.items or ()):
            if item.name in [other.name for other in (self.items or ())[:k]]:
                raise _problem(f"two items have the name {item.name!r}", "items", k, "name")
        return self


class ScaleConfig(Settings):
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
    name: str = ""
    subscales: TupleOf[str] = ()
    texts: dict[str, dict[str, str | tuple[str, str]]] = Field(default_factory=dict)
    shuffle: bool = False
    required: bool = True
    personal: bool | None = None

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.scale not in scale_names():
            raise _problem(f"there is no scale {self.scale!r}; scales are {', '.join(scale_names())}", "scale")
        if self.name:
            _require_name(self.name, ("name",))
        scale = scale_named(self.scale)
        for k, subscale in enumerate(self.subscales):
            if subscale not in scale.subscales:
                known = ", ".join(scale.subscales)
                raise _problem(f"{self.scale} has no part {subscale!r}; it has {known}", "subscales", k)
        for language, texts in self.texts.items():
            for key, text in texts.items():
                problem = scale.problem_of_translation(key, text)
                if problem:
                    raise _problem(problem, "texts", language, key)
        return self

    @property
    def definition(self) -> Scale:
        """The questionnaire, with the selected parts only."""
        return scale_named(self.scale).part(self.subscales)


def _kind_of_entry(value: Any) -> str:
    """Which of the two an entry is; the names are no keys of settings, among which errors would look for them."""
    is_scale = "scale" in value if isinstance(value, dict) else isinstance(value, ScaleConfig)
    return "a scale" if is_scale else "a question"


Entry = Annotated[
    Annotated[QuestionConfig, Tag("a question")] | Annotated[ScaleConfig, Tag("a scale")], Discriminator(_kind_of_entry)
]
Questionnaire = Annotated[TupleOf[Entry], Field(max_length=100)]


def name_of_entry(entry: QuestionConfig | ScaleConfig) -> str:
    """Name of a question; a published questionnaire has its own name unless the study gives another."""
    return entry.name or (entry.scale if isinstance(entry, ScaleConfig) else "")


class LabelTexts(Settings):
    """The question that a scenario asks about each run, in the languages of the study; files hold the scenario's own.

    Attributes:
        question: the question.
        classes: by language, the names of the classes.
        ends: by language, the meaning of the slider's ends.
    """

    translated: ClassVar[tuple[str, ...]] = ("question",)

    question: Text | None = None
    classes: dict[str, tuple[str, ...]] = Field(default_factory=dict)
    ends: dict[str, tuple[str, str]] = Field(default_factory=dict)


class PracticeConfig(Settings):
    """Runs that are not counted; their files are among the discarded ones.

    Attributes:
        scenario: name of a preset, or path of a file relative to that of the study.
        runs: number of runs.
        text: Markdown, read before the first of them.
    """

    translated: ClassVar[tuple[str, ...]] = ("text",)

    scenario: str
    runs: Annotated[int, Field(ge=1, le=MAX_RUNS)] = 1
    text: Text | None = None


class RunsConfig(Settings):
    """A number of runs in one scenario.

    Attributes:
        scenario: as of `PracticeConfig`; also the question asked about each run, its `label`.
        runs: number of runs.
        text: Markdown, read before the first of them; not if the runs of several blocks are shuffled.
        label: translations of the question.
    """

    translated: ClassVar[tuple[str, ...]] = ("text",)

    scenario: str
    runs: Annotated[int, Field(ge=1, le=MAX_RUNS)] = 1
    text: Text | None = None
    label: LabelTexts = LabelTexts()


class RatingConfig(Settings):
    """Recorded runs to be watched and rated.

    Attributes:
        name: of the folder with copies of the runs in the study's folder.
        folder: data set, or episode file, relative to the study file.
        question: the question; of kind `yes_no`, `classes`, `slider` or `text`.
        count: number of runs to show, the first ones of the folder; by default all.
        repeats: fraction of the runs shown again, unannounced, to measure each participant's consistency. At least five
            others are between the two showings, so fewer than six runs have no repeats; `study check` names the number.
        break_after: number of ratings after which a break is suggested.
        view: camera, `follow` or `top`.
        text: Markdown, read before.
    """

    translated: ClassVar[tuple[str, ...]] = ("text",)

    name: str
    folder: str
    question: QuestionConfig
    count: Annotated[int, Field(ge=1)] | None = None
    repeats: Fraction = REPEAT_FRACTION
    break_after: Annotated[int, Field(ge=1)] = BREAK_AFTER
    view: View = "top"
    text: Text | None = None

    @model_validator(mode="after")
    def _check(self) -> Self:
        _require_name(self.name, ("name",))
        if self.question.kind in ("number", "likert"):
            raise _problem("runs are rated with yes_no, classes, slider or text", "question", "kind")
        return self


class StudyConfig(Settings):
    """The settings of a study.

    A participant reads the pages, consents, answers the demographic questions, practises, drives the runs, rates
    recorded runs and answers the closing questions, in this order. What is left out is skipped.

    Attributes:
        title: of the study.
        languages: of the texts: `en`, `de`, `es`, `zh`, or one with a table under `texts`. The first is the default.
        texts: by language, a table of the page's own words, relative to the study file; see `collect --language`.
        pages: to read first.
        consent: what to agree to; without it, participants are not asked.
        demographics: questions about the participant; their answers are personal unless a question says otherwise.
        practice: runs that are not counted.
        runs: blocks of runs.
        order: of the blocks: `fixed`; `latin-square`, balanced over the participants; or `shuffled`, all runs in random
            order, another one for each participant.
        after_run: questions after each run that is kept.
        ratings: blocks of recorded runs to be rated.
        end: questions at the end.
        thanks: the last page.
        minimum_length: shortest run that can be kept, s.
        view: camera of the runs at first, `follow` or `top`.
        changes: what participants may change: `view`, `zoom`, `zones` (drawing of personal space).
        discard: whether participants may discard a run; another scene replaces it.
        redo: whether participants may drive a scene again instead of keeping the run.
        undo: whether participants may take back the last kept run until the next one begins, or the program ends.
        seed: of the scenes, and of random orders.
        participants: number of participants, those with links of their own included, at which the open link admits no
            more.
    """

    translated: ClassVar[tuple[str, ...]] = ("title",)

    title: Text
    languages: Annotated[tuple[str, ...], Field(min_length=1, max_length=20)] = ("en",)
    texts: dict[str, str] = Field(default_factory=dict)
    pages: Annotated[TupleOf[PageConfig], Field(max_length=50)] = ()
    consent: ConsentConfig | None = None
    demographics: Questionnaire = ()
    practice: PracticeConfig | None = None
    runs: Annotated[TupleOf[RunsConfig], Field(max_length=40)] = ()
    order: Order = "fixed"
    after_run: Questionnaire = ()
    ratings: Annotated[TupleOf[RatingConfig], Field(max_length=20)] = ()
    end: Questionnaire = ()
    thanks: PageConfig | None = None
    minimum_length: NonNegativeFloat = 0.0
    view: View = "follow"
    changes: TupleOf[Change] = ()
    discard: bool = True
    redo: bool = True
    undo: bool = True
    seed: NonNegativeInt = 0
    participants: Annotated[int, Field(ge=1, le=100_000)] = 1000

    @model_validator(mode="after")
    def _check(self) -> Self:
        if len(set(self.languages)) < len(self.languages):
            raise _problem("a language is named twice", "languages")
        if not (self.runs or self.ratings):
            raise _problem("a study has runs, ratings or both", "runs")
        for section in ("demographics", "after_run", "end"):
            _require_distinct(getattr(self, section), section)
        for k, block in enumerate(self.runs):
            if self.order == "shuffled" and len(self.runs) > 1 and block.text is not None:
                raise _problem("runs of several blocks are shuffled; write the text into pages", "runs", k, "text")
        names = [block.name for block in self.ratings]
        for k, name in enumerate(names):
            if name in names[:k]:
                raise _problem(f"two blocks of ratings have the name {name!r}", "ratings", k, "name")
        for path, text in texts_in(self):
            self._check_text(path, text)
        for path, entry in self._scales():
            for language in entry.texts:
                if language not in self.languages:
                    raise _problem(f"{language!r} is not among the languages of the study", *path, "texts", language)
        return self

    def _check_text(self, path: Path, text: Text) -> None:
        """Require a text in each language, and of a length that can be read."""
        if isinstance(text, str):
            if len(self.languages) > 1 and any(letter.isalpha() for letter in text):
                example = ", ".join(f"{language}: …" for language in self.languages)
                raise _problem(f"a text of a study in several languages is {{{example}}}", *path)
            text = dict.fromkeys(self.languages, text)
        for language in self.languages:
            if not text.get(language, "1").strip() or (language not in text):
                raise _problem(f"the text in the language {language!r} is missing", *path)
        for language, words in text.items():
            if language not in self.languages:
                raise _problem(f"{language!r} is not among the languages of the study", *path, language)
            if len(words) > MAX_TEXT:
                raise _problem(f"the text has {len(words)} characters, more than {MAX_TEXT}", *path, language)

    def _scales(self) -> Iterator[tuple[Path, ScaleConfig]]:
        """The published questionnaires, and where each is asked."""
        for section in ("demographics", "after_run", "end"):
            for k, entry in enumerate(getattr(self, section)):
                if isinstance(entry, ScaleConfig):
                    yield (section, k), entry

    def untranslated(self) -> list[str]:
        """Sentences about published questionnaires that are shown in English, because translations are missing."""
        sentences = []
        for path, entry in self._scales():
            for language in self.languages:
                missing = entry.definition.untranslated(entry.texts.get(language, {}), language)
                if missing:
                    where = ".".join(map(str, path))
                    sentences.append(
                        f"{where}: {entry.scale} is shown in English to participants who read {language!r}; translate"
                        f" {', '.join(missing[:3])}{' …' if len(missing) > 3 else ''} under texts: {{{language}: …}}"
                    )
        return sentences


def texts_in(settings: Settings, path: Path = ()) -> Iterator[tuple[Path, Text]]:
    """All texts that participants read, and where they are."""
    translated = getattr(settings, "translated", ())
    for name in type(settings).model_fields:
        value, place = getattr(settings, name), (*path, name)
        for k, item in enumerate(value) if isinstance(value, tuple) else ((None, value),):
            where = place if k is None else (*place, k)
            if isinstance(item, Settings):
                yield from texts_in(item, where)
            elif name in translated and item is not None and not (item == "" and isinstance(settings, Item)):
                yield where, item  # an item that is a pair of opposites needs no text


def _is_item(row: Any) -> bool:
    """Whether a row of a table has settings, rather than one text, or one for each language."""
    return isinstance(row, dict) and not Item.model_fields.keys().isdisjoint(row)


def _require_name(name: str, path: Path) -> None:
    if not _NAME.fullmatch(name):
        raise _problem("a name begins with a letter and has up to 40 letters, digits, dashes and underscores", *path)


def _require_distinct(entries: tuple[QuestionConfig | ScaleConfig, ...], section: str) -> None:
    """Require different names of the questions on one page."""
    names: dict[str, int] = {}
    for k, entry in enumerate(entries):
        name = name_of_entry(entry)
        if name in names:
            raise _problem(f"two questions have the name {name!r}", section, k)
        names[name] = k


def _problem(message: str, *path: str | int) -> PydanticCustomError:
    context: Mapping[str, Any] = {"message": message, "path": path}
    return PydanticCustomError("study", "{message}", dict(context))
