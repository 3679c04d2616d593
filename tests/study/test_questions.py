"""Kinds of questions: keys, answers, the content of the page, and kinds of other packages."""

from __future__ import annotations

import re
from collections.abc import Iterator
from importlib.resources import files
from pathlib import Path
from typing import Any

import pytest

from sonata2d.core.labels import LabelSpec
from sonata2d.errors import ConfigError
from sonata2d.registry import QUESTION_KINDS
from sonata2d.study import Question, StudyConfig, load_study
from sonata2d.study.answers import checked_answers
from sonata2d.study.questions import LabelQuestion, question_kind

from .conftest import STUDY

KEYS: dict[str, dict[str, Any]] = {
    "yes_no": {},
    "classes": {"classes": ["poor", "good"]},
    "slider": {"ends": ["poor", "good"]},
    "text": {},
    "number": {"minimum": 1, "maximum": 9, "integer": True},
    "likert": {"items": {"calm": "It was calm.", "pair": {"ends": ["bad", "good"]}}, "points": 7},
}
FITTING = [
    ("yes_no", True, True), ("classes", 2, 2), ("slider", 0.123456, 0.1235), ("text", "fine", "fine"),
    ("number", 3, 3), ("number", 3.0, 3.0), ("likert", {"pair": 7, "calm": 1}, {"calm": 1, "pair": 7}),
]  # fmt: skip
REFUSED = [
    ("yes_no", 1, "1 is not a valid q; expected: Q true or false"),
    ("classes", 3, "3 is not a valid q; expected: Q 1: poor, 2: good"),
    ("slider", 1.5, "1.5 is not a valid q; expected: Q 0 (poor) to 1 (good)"),
    ("text", ["a"], "q is ['a']; a text is expected"),
    ("number", 3.5, "q is 3.5; a whole number from 1 up to 9 is expected"),
    ("likert", {"calm": 8, "pair": 1}, "q.calm is 8; a number from 1 to 7 is expected"),
    ("likert", {"calm": 1}, "q.pair is not answered"),
]  # fmt: skip


def question_of(kind: str, **keys: Any) -> Question:
    settings = {"name": "q", "kind": kind, "question": "Q"} | KEYS.get(kind, {}) | keys
    return question_kind(kind).model_validate(settings)


def test_every_kind_is_tested() -> None:
    assert (
        set(QUESTION_KINDS.built_in)
        == set(KEYS)
        == {kind for kind, _, _ in FITTING}
        == {kind for kind, _, _ in REFUSED}
    )


@pytest.mark.parametrize(("kind", "answer", "stored"), FITTING)
def test_an_answer_that_fits_is_stored(kind: str, answer: Any, stored: Any) -> None:
    assert checked_answers([question_of(kind)], {"q": answer}) == {"q": stored}


@pytest.mark.parametrize(("kind", "answer", "problem"), REFUSED)
def test_an_answer_that_does_not_fit_is_named(kind: str, answer: Any, problem: str) -> None:
    with pytest.raises(ValueError, match=re.escape(problem)):
        checked_answers([question_of(kind)], {"q": answer})


@pytest.mark.parametrize("kind", KEYS)
def test_the_page_draws_every_kind(kind: str) -> None:
    script = files("sonata2d.web").joinpath("static/questions.js").read_text(encoding="utf-8")
    renderers = set(
        re.findall(r"^  (\w+): ", script[script.index("const RENDERERS") : script.index("const DEFAULTS")], re.M)
    )
    assert question_of(kind).content("en")["renderer"] in renderers


def test_content_is_in_a_language_and_hides_reversed_rows() -> None:
    items = {"calm": {"text": {"en": "calm", "de": "ruhig"}, "reversed": True}, "pair": {"ends": [{"de": "a"}, "b"]}}
    content = question_of("likert", question={"en": "C", "de": "D"}, items=items).content("de")
    assert (content["question"], content["points"]) == ("D", 7)
    assert content["items"] == [
        {"name": "calm", "text": "ruhig", "ends": None}, {"name": "pair", "text": None, "ends": ["a", "b"]}
    ]  # fmt: skip


@pytest.mark.parametrize("form", ["texts by language", "lists by language"])
def test_lists_of_texts_have_two_forms(form: str) -> None:
    is_lists = form == "lists by language"
    texts: Any = {"en": ["rude", "kind"], "de": ["grob", "nett"]}
    listed = texts if is_lists else [{"en": "rude", "de": "grob"}, {"en": "kind", "de": "nett"}]
    items = {"pair": {"ends": listed}}
    for language, words in texts.items():
        assert question_of("classes", classes=listed).content(language)["classes"] == words
        assert question_of("slider", ends=listed).content(language)["ends"] == words
        content = question_of("likert", items=items, points=2, ends=listed, labels=listed).content(language)
        assert content["ends"] == content["labels"] == content["items"][0]["ends"] == words
    config = StudyConfig.model_validate(
        {
            "title": {"en": "A", "de": "B"},
            "languages": ["en", "de"],
            "consent": {"title": {"en": "C", "de": "D"}, "text": {"en": "E", "de": "F"}, "statements": listed},
            "runs": [{"scenario": "empty", "label": {"classes": listed, "ends": listed}}],
        }
    )
    assert config.consent is not None
    assert config.consent.statements == ({"en": "rude", "de": "grob"}, {"en": "kind", "de": "nett"})
    assert config.runs[0].label.classes == config.runs[0].label.ends == {k: tuple(v) for k, v in texts.items()}


@pytest.mark.parametrize(
    ("classes", "problem"),
    [
        ("{en: [a, b], de: [c]}", r"end\.0\.classes: each language needs as many texts, got 2 in 'en', 1 in 'de'"),
        ("{en: [a, b], de: c}", r"end\.0\.classes: 'de' has no list of texts; write \{en: \[a, b\], de: \[c, d\]\}"),
        ("{en: [a, b]}", r"end\.0\.classes\.en: the text in the language 'de' is missing"),
        (
            "{en: [a, yes], de: [c, d]}",
            r"end\.0\.classes: yes, no, on, off, true and false are texts in quotes only",
        ),
        ("{}", r"end\.0\.classes"),
    ],
)
def test_lists_of_texts_that_do_not_fit_are_named(study_file: Path, classes: str, problem: str) -> None:
    start = "title: {en: A, de: B}\nlanguages: [en, de]\nruns: [{scenario: empty}]\n"
    question = f"end: [{{name: a, kind: classes, classes: {classes}, question: {{en: C, de: D}}}}]\n"
    study_file.write_text(start + question)
    with pytest.raises(ConfigError, match=problem):
        load_study(study_file)


@pytest.mark.parametrize("kind", KEYS)
def test_ratings_are_labels_of_the_same_kind(kind: str) -> None:
    question = question_of(kind)
    if isinstance(question, LabelQuestion):
        label = question.label()
        assert (label.kind, label.when, label.name, label.question) == (kind, "run", "q", "Q")
        assert label.classes == tuple(KEYS[kind].get("classes", ()))
    else:
        rating = {"name": "a", "folder": ".", "question": question.model_dump()}
        with pytest.raises(ConfigError, match="runs are rated with yes_no, classes, slider or text"):
            StudyConfig(title="T", ratings=[rating])


def test_labels_and_questions_have_the_same_kinds() -> None:
    kinds = [kind for kind in QUESTION_KINDS.built_in if issubclass(question_kind(kind), LabelQuestion)]
    assert {"command", *kinds} == {"command", "yes_no", "classes", "slider", "text"}
    assert all(LabelSpec(kind=question_kind(kind).label_kind).per_run for kind in kinds)  # type: ignore[attr-defined]


class Colour(Question):
    """A colour such as `#ff8800`."""

    shade: str = "any"

    def check(self, value: Any) -> str:
        if not re.fullmatch("#[0-9a-f]{6}", str(value)):
            raise self.refusal(value, "a colour such as #ff8800")
        return str(value)


@pytest.fixture
def colour() -> Iterator[None]:
    """The kind `colour` of this program."""
    QUESTION_KINDS.register("colour", Colour)
    yield
    del QUESTION_KINDS.registered["colour"]


@pytest.mark.usefixtures("colour")
def test_another_package_can_add_a_kind(study_file: Path) -> None:
    text = STUDY.replace("kind: text, question: Anything else", "kind: colour, shade: dark, question: Your colour")
    study_file.write_text(text)
    question = load_study(study_file).config.demographics[1]
    assert question.content("en") == {
        "name": "remark", "kind": "colour", "question": "Your colour", "shade": "dark", "required": False,
        "personal": None, "renderer": "text",
    }  # fmt: skip
    assert checked_answers([question], {"remark": "#ff8800"}) == {"remark": "#ff8800"}
    with pytest.raises(ValueError, match="remark is 'red'; a colour such as #ff8800 is expected"):
        checked_answers([question], {"remark": "red"})
    study_file.write_text(STUDY.replace("kind: yes_no", "kind: colour"))
    with pytest.raises(ConfigError, match=r"line 15: ratings\.0\.question\.kind: runs are rated with yes_no"):
        load_study(study_file)


def test_a_kind_that_is_unknown_or_wrong_is_named(study_file: Path) -> None:
    study_file.write_text(STUDY.replace("kind: text, question: Anything", "kind: txt, question: Anything"))
    with pytest.raises(
        ConfigError, match=r"line 7: demographics\.1\.kind: no question kind is named 'txt'; did you mean"
    ):
        load_study(study_file)
    study_file.write_text(STUDY.replace("kind: text, question: Anything", "question: Anything"))
    with pytest.raises(ConfigError, match=r"demographics\.1\.kind: a question needs a kind: yes_no, classes, slider"):
        load_study(study_file)
    QUESTION_KINDS.register("wrong", dict)
    try:
        with pytest.raises(ConfigError, match=r"must be a subclass of sonata2d\.study\.Question"):
            question_kind("wrong")
    finally:
        del QUESTION_KINDS.registered["wrong"]
