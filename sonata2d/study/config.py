"""The settings of a study: pages, consent, questions, practice, runs and ratings."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Annotated, ClassVar, Literal, Self

from pydantic import Field, NonNegativeFloat, NonNegativeInt, model_validator

from ..collect.rating import BREAK_AFTER, REPEAT_FRACTION
from ..core.bounds import Fraction
from ..core.devices import View
from ..scenegen.scenario.base import Settings, TupleOf
from ..scenegen.scenario.problems import setting_error
from .questions import AnyEntry, Classes, Entry, RatingQuestion, ScaleConfig, YesNo
from .texts import Name, Path, Text, Texts, Translations, TwoTranslations, in_language, require_distinct, texts_in

_Questionnaire = Annotated[TupleOf[AnyEntry], Field(max_length=100)]
Order = Literal["fixed", "shuffled", "latin-square", "between"]
Change = Literal["view", "zoom", "zones"]
ExternalName = Annotated[str, Field(pattern=r"^[A-Za-z_][A-Za-z0-9_]{0,39}$")]

CHECK = "practice.check"  # key of the questions before the practice
_MAX_RUNS = 500  # of one block
_MAX_TEXT = 20_000  # characters of a page


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
    """The consent that is asked before any answer or run.

    Attributes:
        title: heading.
        text: Markdown.
        statements: each has to be ticked.
    """

    translated: ClassVar[tuple[str, ...]] = ("title", "text", "statements")

    title: Text
    text: Text
    statements: Annotated[Texts, Field(max_length=20)] = ()


class LabelTexts(Settings):
    """Translations of the question that a scenario asks about each run; files hold the scenario's own texts.

    Attributes:
        question: the question.
        classes: by language, the names of the classes.
        ends: by language, the meaning of the slider's ends.
    """

    translated: ClassVar[tuple[str, ...]] = ("question",)

    question: Text | None = None
    classes: Translations = Field(default_factory=dict)
    ends: TwoTranslations = Field(default_factory=dict)


class PracticeConfig(Settings):
    """Practice runs; they are not counted, and their files are among the discarded runs.

    Attributes:
        scenario: name of a preset, or path of a file relative to the study file.
        runs: number of runs.
        text: Markdown, read before the first run.
        check: questions below the text, which can require the right answers with `until_right`.
        must_reach_goal: whether each practice run has to reach the goal.
        attempts: number of tries of a practice run after which the participant may go on without having reached the
            goal.
    """

    translated: ClassVar[tuple[str, ...]] = ("text",)

    scenario: str
    runs: Annotated[int, Field(ge=1, le=_MAX_RUNS)] = 1
    text: Text | None = None
    check: _Questionnaire = ()
    must_reach_goal: bool = False
    attempts: Annotated[int, Field(ge=1, le=100)] = 5


class RunsConfig(Settings):
    """A number of runs in one scenario.

    Attributes:
        scenario: as of `PracticeConfig`; its `label` is the question about each run.
        runs: number of runs.
        text: Markdown, read before the first run; not allowed if the runs of several blocks are shuffled.
        label: translations of the question.
    """

    translated: ClassVar[tuple[str, ...]] = ("text",)

    scenario: str
    runs: Annotated[int, Field(ge=1, le=_MAX_RUNS)] = 1
    text: Text | None = None
    label: LabelTexts = LabelTexts()


class RatingConfig(Settings):
    """Recorded runs to be watched and rated.

    Attributes:
        name: name of the block, and of its folder with copies of the runs.
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

    name: Name
    folder: str
    question: RatingQuestion
    count: Annotated[int, Field(ge=1)] | None = None
    repeats: Fraction = REPEAT_FRACTION
    break_after: Annotated[int, Field(ge=1)] = BREAK_AFTER
    view: View = "top"
    text: Text | None = None


class RecruitmentConfig(Settings):
    """Recruitment from a panel, such as Prolific, SONA or CloudResearch: arrival and way back of participants.

    Each of `complete`, `declined`, `screened_out` and `full` is an address, to which the page has a link, or a code,
    which it shows. In an address `{NAME}` stands for an id.

    Attributes:
        ids: names of the ids in the address with which the panel opens the open link, such as `PROLIFIC_PID`. The first
            one identifies a person: the same id continues as the same participant. Ids are personal answers.
        complete: for people who have finished.
        declined: for people who do not consent.
        screened_out: for people whose answer ended the study.
        full: for people who arrive when the study is full.
        minutes: a participant who does nothing for this time before the end loses the place; by default never.
    """

    ids: Annotated[tuple[ExternalName, ...], Field(max_length=10)] = ()
    complete: Annotated[str, Field(min_length=1, max_length=1000)] | None = None
    declined: Annotated[str, Field(min_length=1, max_length=1000)] | None = None
    screened_out: Annotated[str, Field(min_length=1, max_length=1000)] | None = None
    full: Annotated[str, Field(min_length=1, max_length=1000)] | None = None
    minutes: Annotated[int, Field(ge=1, le=100_000)] | None = None

    @model_validator(mode="after")
    def _check(self) -> Self:
        if len(set(self.ids)) < len(self.ids):
            raise setting_error("an id is named twice", "ids")
        for key in ("complete", "declined", "screened_out", "full"):
            for name in re.findall(r"{(.*?)}", getattr(self, key) or ""):
                if name not in self.ids:
                    raise setting_error(f"{{{name}}} is none of the ids", key)
        return self


class RequiresConfig(Settings):
    """Requirements on the device of a participant; the page names what is missing, and waits.

    Without the keyboard or the width, a visitor of the open link takes no place.

    Attributes:
        keyboard: whether phones and tablets are not enough.
        width: least width of the window, px.
        round_trip: longest median time that a message takes to the server and back, s; measured before the first step.
    """

    keyboard: bool = False
    width: Annotated[int, Field(ge=200, le=5000)] | None = None
    round_trip: Annotated[float, Field(gt=0.0, le=5.0)] | None = None


class QuotaConfig(Settings):
    """Places by the answer to a demographic question, such as 20 for women and 20 for men.

    When all places for an answer are taken, further participants with this answer see that the study is full. The rows
    of Latin squares, and the blocks of the order `between`, are balanced among the participants with the same answer.
    The researcher's page shows how many places are taken.

    Attributes:
        question: name of a question of `demographics`, of kind `yes_no` or `classes`.
        places: largest number of participants by answer: for no and yes, or for each class, in their order.
    """

    question: Name
    places: Annotated[TupleOf[NonNegativeInt], Field(min_length=2, max_length=20)]


class StudyConfig(Settings):
    """The settings of a study.

    A participant reads the pages, consents, answers the demographic questions, practises, drives the runs, rates
    recorded runs and answers the closing questions, in this order. Sections that are left out are skipped.

    Attributes:
        title: of the study.
        languages: of the texts: `en`, `de`, `es`, `zh`, or one with a table under `texts`. The first is the default.
        texts: by language, a file with the words of the page, relative to the study file; see `collect --language`.
        pages: pages to read first.
        consent: the consent; without it, participants are not asked.
        demographics: questions about the participant; their answers are personal unless a question says otherwise.
        practice: practice runs.
        runs: blocks of runs.
        order: of the blocks: `fixed`; `latin-square`, balanced over the participants; `shuffled`, all runs in random
            order, another one for each participant; or `between`, each participant drives one block only, balanced.
        after_run: questions after each run that is kept.
        ratings: blocks of recorded runs to be rated.
        end: questions at the end.
        thanks: the last page.
        minimum_length: shortest run that can be kept, s.
        minimum_distance: shortest way of the robot in a run that can be kept, m; less than from start to goal.
        must_reach_goal: whether only runs that reach the goal can be kept. Participants are told these three before.
        view: camera of the runs at first, `follow` or `top`.
        changes: what participants may change: `view`, `zoom`, `zones` (drawing of personal space).
        discard: whether participants may discard a run; another scene replaces it.
        redo: whether participants may drive a scene again instead of keeping the run.
        undo: whether participants may take back the last kept run until the next one begins, or the program ends.
        seed: of the scenes, and of random orders.
        participants: largest number of participants, including participants with links of their own, up to which the
            open link admits people. People who decline or are screened out are not counted.
        quota: places by the answer to a question about the participant.
        recruitment: how participants of a panel arrive and go back.
        requires: what the device of a participant needs.
    """

    translated: ClassVar[tuple[str, ...]] = ("title",)

    title: Text
    languages: Annotated[tuple[str, ...], Field(min_length=1, max_length=20)] = ("en",)
    texts: dict[str, str] = Field(default_factory=dict)
    pages: Annotated[TupleOf[PageConfig], Field(max_length=50)] = ()
    consent: ConsentConfig | None = None
    demographics: _Questionnaire = ()
    practice: PracticeConfig | None = None
    runs: Annotated[TupleOf[RunsConfig], Field(max_length=40)] = ()
    order: Order = "fixed"
    after_run: _Questionnaire = ()
    ratings: Annotated[TupleOf[RatingConfig], Field(max_length=20)] = ()
    end: _Questionnaire = ()
    thanks: PageConfig | None = None
    minimum_length: NonNegativeFloat = 0.0
    minimum_distance: NonNegativeFloat = 0.0
    must_reach_goal: bool = False
    view: View = "follow"
    changes: TupleOf[Change] = ()
    discard: bool = True
    redo: bool = True
    undo: bool = True
    seed: NonNegativeInt = 0
    participants: Annotated[int, Field(ge=1, le=100_000)] = 1000
    quota: QuotaConfig | None = None
    recruitment: RecruitmentConfig | None = None
    requires: RequiresConfig = RequiresConfig()

    @model_validator(mode="after")
    def _check(self) -> Self:
        if len(set(self.languages)) < len(self.languages):
            raise setting_error("a language is named twice", "languages")
        if not (self.runs or self.ratings):
            raise setting_error("a study has runs, ratings or both", "runs")
        for section, entries in self.questionnaires().items():
            require_distinct("questions", entries, *section.split("."))
        self._check_quota()
        require_distinct("blocks of ratings", self.ratings, "ratings")
        for k, block in enumerate(self.runs):
            if self.order == "shuffled" and len(self.runs) > 1 and block.text is not None:
                raise setting_error("runs of several blocks are shuffled; write the text into pages", "runs", k, "text")
        for path, text in texts_in(self):
            self._check_text(path, text)
        for path, entry in self._scales():
            for language in entry.texts:
                if language not in self.languages:
                    raise setting_error(
                        f"{language!r} is not among the languages of the study", *path, "texts", language
                    )
        return self

    def _check_text(self, path: Path, text: Text) -> None:
        """Require a text in each language, and limit its length."""
        if isinstance(text, str):
            if len(self.languages) > 1 and any(letter.isalpha() for letter in text):
                example = ", ".join(f"{language}: …" for language in self.languages)
                raise setting_error(f"a text of a study in several languages is {{{example}}}", *path)
            text = dict.fromkeys(self.languages, text)
        for language in self.languages:
            if not text.get(language, "1").strip() or (language not in text):
                raise setting_error(f"the text in the language {language!r} is missing", *path)
        for language, words in text.items():
            if language not in self.languages:
                raise setting_error(f"{language!r} is not among the languages of the study", *path, language)
            if len(words) > _MAX_TEXT:
                raise setting_error(f"the text has {len(words)} characters, more than {_MAX_TEXT}", *path, language)

    def questionnaires(self) -> dict[str, tuple[Entry, ...]]:
        """The questions of each section, by its key."""
        check = self.practice.check if self.practice is not None else ()
        return {"demographics": self.demographics, CHECK: check, "after_run": self.after_run, "end": self.end}

    def _check_quota(self) -> None:
        """Require that the quota has places for each answer to its question."""
        if (quota := self.quota) is None:
            return
        asked = next((entry for entry in self.demographics if entry.name == quota.question), None)
        if not isinstance(asked, YesNo | Classes) or not asked.required:
            reason = (
                f"{quota.question!r} is no question of demographics of kind yes_no or classes that must be answered"
            )
            raise setting_error(reason, "quota", "question")
        answers = 2 if isinstance(asked, YesNo) else len(asked.classes)
        if len(quota.places) != answers:
            reason = f"there are {len(quota.places)} numbers of places for {answers} answers"
            raise setting_error(reason, "quota", "places")

    def quota_answers(self) -> list[tuple[bool | int, str, int]]:
        """The answers of the quota as they are stored; their names: yes, no, or in the first language; and places."""
        if (quota := self.quota) is None:
            return []
        asked = next(entry for entry in self.demographics if entry.name == quota.question)
        if isinstance(asked, Classes):
            names = [in_language(text, self.languages[0]) for text in asked.classes]
            return list(zip(range(1, len(names) + 1), names, quota.places, strict=True))
        return [(False, "no", quota.places[0]), (True, "yes", quota.places[1])]

    def _scales(self) -> Iterator[tuple[Path, ScaleConfig]]:
        """The published questionnaires, each with the keys that lead to it."""
        for section, entries in self.questionnaires().items():
            for k, entry in enumerate(entries):
                if isinstance(entry, ScaleConfig):
                    yield (*section.split("."), k), entry

    def untranslated(self) -> list[str]:
        """Warnings about published questionnaires that are shown in English, because translations are missing."""
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
