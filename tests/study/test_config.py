"""Study files: settings, errors, orders, questionnaires."""

from __future__ import annotations

import hashlib
from collections import Counter
from itertools import pairwise
from pathlib import Path

import pytest
from click.testing import CliRunner
from sonata2d_cli.main import main

from sonata2d.errors import ConfigError
from sonata2d.study.config import StudyConfig
from sonata2d.study.content import question_content
from sonata2d.study.folder import StudyFolder
from sonata2d.study.load import load_study
from sonata2d.study.markdown import html_of
from sonata2d.study.plan import latin_square_row, run_order
from sonata2d.study.progress import Progress
from sonata2d.study.questions import Likert
from sonata2d.study.scales import scale_named, scale_names

from .conftest import STUDY

PNG = b"\x89PNG\r\n\x1a\n"


@pytest.mark.parametrize(
    ("before", "after", "problem"),
    [
        ("runs: 2", "runs: two", "line 10: runs.0.runs: Input should be a valid integer"),
        ("minimum_length", "minimal_length", "line 18: minimal_length: unknown key 'minimal_length'; did you mean"),
        ("room.yaml", "rom.yaml", "line 10: runs.0.scenario: no scenario file or preset '"),
        ("folder: recorded", "folder: elsewhere", "line 15: ratings.0.folder: "),
        ("count: 3", "count: 30", "line 15: ratings.0.folder: count is 30, but recorded has 4 episodes"),
        ("scale: rosas", "scale: rosa", "line 17: end.0.scale: there is no scale 'rosa'; scales are godspeed, "),
        ("[warmth]", "[warm]", "line 17: end.0.subscales.0: rosas has no part 'warm'; it has warmth, comp"),
        ("classes: 5", "points: 5", "line 12: after_run.0.classes: give the names of the classes"),
        ("name: effort", "name: 1st", "line 12: after_run.0.name: a name begins with a letter"),
        ("name: effort", "name: driver", "line 13: after_run.1.name: two questions have the name 'driver'"),
        ("minimum: 18", "minimum: 180", "line 6: demographics.0.minimum: the minimum is above"),
        ("kind: yes_no", "kind: number", "line 15: ratings.0.question.kind: runs are rated with"),
        ("title: Passing", "languages: [en, de]\ntitle: Passing", "line 2: title: a text of a study in several lang"),
        ("title: Passing", "languages: [fr]\ntitle: Passing", "line 1: languages: sonata2d has no words in 'fr'"),
        ("title: Passing people", "title: {de: Hallo}", "line 1: title: the text in the language 'en' is missing"),
        ("title: Passing people", "title: {en: Hi, de: Hallo}", "line 1: title.de: 'de' is not among the languages"),
        (
            "runs: 2}",
            "runs: 2, text: Go}\n  - {scenario: empty}\norder: shuffled",
            "line 10: runs.0.text: runs of",
        ),
        (
            "kind: classes, classes: 5",
            "kind: yes_no, integer: true",
            "line 12: after_run.0.integer: this key needs",
        ),
        (
            "title: Passing people",
            "title: {en: Hi, all}",
            "line 1: title: 'all' has no text; a text with a comma needs quotes within braces",
        ),
        ("title: Passing people", "title: ''", "line 1: title: the text in the language 'en' is missing"),
    ],
)
def test_an_error_names_line_key_value_and_remedy(study_file: Path, before: str, after: str, problem: str) -> None:
    study_file.write_text(STUDY.replace(before, after))
    with pytest.raises(ConfigError) as caught:
        load_study(study_file)
    assert f"study.yaml, {problem}" in str(caught.value)


def test_an_error_in_a_row_of_a_table_names_the_row(tmp_path: Path) -> None:
    start = "title: {en: A, de: B}\nlanguages: [en, de]\nruns: [{scenario: empty}]\nend:\n"
    table = "  - name: felt\n    kind: likert\n    question: {en: C, de: D}\n    items:\n"
    items = "      calm: {en: calm, de: ruhig}\n      fast: fast\n"
    (tmp_path / "study.yaml").write_text(start + table + items)
    with pytest.raises(ConfigError, match=r"line 10: end\.0\.items\.fast: a text of a study in several languages"):
        load_study(tmp_path / "study.yaml")


def test_pictures_of_texts_are_copied_into_the_study(tmp_path: Path) -> None:
    (tmp_path / "my logo.PNG").write_bytes(PNG)
    (tmp_path / "plan.svg").write_text('<svg xmlns="http://www.w3.org/2000/svg"/>')
    text = "![Our logo](my%20logo.PNG) [![](plan.svg)](https://example.org) ![other](https://example.org/a.png)"
    path = tmp_path / "study.yaml"
    path.write_text(f"title: A\npages: [{{title: B, text: {text!r}}}]\nruns: [{{scenario: empty}}]\n")
    study = load_study(path)
    names = {source: picture.name for source, picture in study.pictures.items()}
    assert names == {
        "my%20logo.PNG": f"{hashlib.sha256(PNG).hexdigest()[:16]}.png",
        "plan.svg": f"{hashlib.sha256((tmp_path / 'plan.svg').read_bytes()).hexdigest()[:16]}.svg",
    }
    folder = StudyFolder(tmp_path / "out", study)
    (tmp_path / "my logo.PNG").unlink()
    assert folder.picture(names["my%20logo.PNG"]).read_bytes() == PNG
    html = html_of(text, study.pictures)
    assert f'<img src="../pictures/{names["my%20logo.PNG"]}" alt="Our logo" />' in html
    assert f'<img src="../pictures/{names["plan.svg"]}" alt="" /></a>' in html
    assert '<a href="https://example.org/a.png" target="_blank" rel="noopener noreferrer">other</a>' in html
    assert html.count("<img") == 2
    with pytest.raises(ConfigError, match=r"study\.yaml, line 2: pages\.0\.text: .*my logo\.PNG does not exist"):
        load_study(path)


@pytest.mark.parametrize(
    ("name", "content", "problem"),
    [
        ("a.png", b"<script>", "a.png does not begin as a .png file does"),
        ("a.png", PNG + bytes(5_000_000), "a.png has 5000008 bytes; a picture has up to 5000000"),
        ("a.txt", PNG, "a.txt is no picture; its name ends with .png, .jpg"),
        ("a", PNG, "a is no picture"),
    ],
)
def test_a_file_that_is_no_picture_is_refused(tmp_path: Path, name: str, content: bytes, problem: str) -> None:
    (tmp_path / name).write_bytes(content)
    study = f"title: A\nconsent: {{title: B, text: C, statements: ['![]({name})']}}\nruns: [{{scenario: empty}}]\n"
    (tmp_path / "study.yaml").write_text(study)
    with pytest.raises(ConfigError, match=f"line 2: consent.statements.0: {problem}"):
        load_study(tmp_path / "study.yaml")


def test_a_study_needs_something_to_do(tmp_path: Path) -> None:
    (tmp_path / "study.yaml").write_text("title: Nothing\n")
    with pytest.raises(ConfigError, match="a study has runs, ratings or both"):
        load_study(tmp_path / "study.yaml")
    (tmp_path / "study.yaml").write_text("- title\n")
    with pytest.raises(ConfigError, match="a study is a mapping of settings, not list"):
        load_study(tmp_path / "study.yaml")


def test_numbers_are_the_same_in_all_languages(tmp_path: Path) -> None:
    start = "title: {en: A, de: B}\nlanguages: [en, de]\nruns: [{scenario: empty}]\n"
    question = "end: [{name: a, kind: classes, classes: 3, question: {en: C, de: D}}]\n"
    (tmp_path / "study.yaml").write_text(start + question)
    (entry,) = load_study(tmp_path / "study.yaml").config.end
    assert entry.classes == ("1", "2", "3")  # type: ignore[union-attr]


def test_a_question_mark_in_braces_needs_quotes(tmp_path: Path) -> None:
    (tmp_path / "study.yaml").write_text("title: A\nend: [{name: a, kind: yes_no, question: Good?}]\n")
    with pytest.raises(ConfigError, match=r"line 2: .* put a text with a question mark in quotes"):
        load_study(tmp_path / "study.yaml")


LABELLED = """\
title: {{en: Robots, de: Roboter}}
languages: [en, de]
runs:
  - scenario: room.yaml
    label: {label}
"""


@pytest.mark.parametrize(
    ("label", "problem"),
    [
        ("{}", "line 5: runs.0.label: the scenario asks its question in one language; give question, classes in each"),
        (
            "{question: {en: Good, de: Gut}, classes: {en: [a, b], de: [c]}}",
            "1 classes in 'de' for 2 of the scenario",
        ),
        ("{question: {en: Good, de: Gut}, classes: {en: [a, b]}}", "give classes in each"),
        ("{question: {en: Good, de: Gut}, classes: {en: [a, b], de: [c, d]}, ends: {en: [a, b]}}", "remove ends"),
        ("{question: {en: Good, de: Gut}, classes: {en: [a, b], de: [c, d]}}", ""),
    ],
)
def test_the_question_of_a_scenario_is_translated(tmp_path: Path, label: str, problem: str) -> None:
    (tmp_path / "room.yaml").write_text("extends: empty\nlabel: {kind: classes, classes: [poor, good], question: Ok}\n")
    (tmp_path / "study.yaml").write_text(LABELLED.format(label=label))
    if not problem:
        assert load_study(tmp_path / "study.yaml").config.runs[0].label.classes["de"] == ("c", "d")
        return
    with pytest.raises(ConfigError, match=problem):
        load_study(tmp_path / "study.yaml")


def test_words_of_another_language_are_in_a_table(tmp_path: Path) -> None:
    (tmp_path / "fr.toml").write_text('[menu]\ntitle = "Menu principal"\n')
    (tmp_path / "study.yaml").write_text(
        "title: Robots\nlanguages: [fr]\ntexts: {fr: fr.toml}\nruns: [{scenario: empty}]"
    )
    words = load_study(tmp_path / "study.yaml").tables["fr"]
    assert (words["menu.title"], words["menu.continue"]) == ("Menu principal", "Continue")


@pytest.mark.parametrize("name", scale_names())
def test_a_questionnaire_has_its_source_and_distinct_items(name: str) -> None:
    scale = scale_named(name)
    assert "20" in scale.source
    names = [item.name for item in scale.items]
    assert len(set(names)) == len(names)
    assert all(bool(item.text) is (item.ends is None) for item in scale.items)
    assert (scale.ends is None) is all(item.ends is not None for item in scale.items)


def test_questionnaires_have_their_published_size() -> None:
    """RoSAS: 18 items of nine points in three parts; Godspeed: 24 of five points in five parts."""
    rosas, godspeed = scale_named("rosas"), scale_named("godspeed")
    assert (rosas.points, Counter(item.subscale for item in rosas.items)) == (
        9, {"warmth": 6, "competence": 6, "discomfort": 6}
    )  # fmt: skip
    sizes = {"anthropomorphism": 5, "animacy": 6, "likeability": 5, "intelligence": 5, "safety": 3}
    assert (godspeed.points, Counter(item.subscale for item in godspeed.items)) == (5, sizes)


def test_a_translation_of_a_questionnaire_is_checked(tmp_path: Path) -> None:
    path = tmp_path / "study.yaml"
    start = "title: {en: A, de: B}\nlanguages: [en, de]\nruns: [{scenario: empty}]\nend:\n  - scale: godspeed\n"
    path.write_text(start + "    subscales: [safety]\n    texts: {de: {anxious-relaxed: [unruhig, entspannt]}}\n")
    (warning,) = load_study(path).config.untranslated()
    assert warning.startswith("end.0: godspeed is shown in English to participants who read 'de'; translate question, ")
    for text, problem in (
        ("{de: {calm: [a, b]}}", "godspeed has no item 'calm'"),
        ("{de: {anxious-relaxed: unruhig}}", "this item is a pair of opposites"),
        ("{fr: {anxious-relaxed: [a, b]}}", "'fr' is not among the languages"),
    ):
        path.write_text(f"{start}    texts: {text}\n")
        with pytest.raises(ConfigError, match=problem):
            load_study(path)


@pytest.mark.parametrize("n", [1, 2, 3, 4, 5, 6])
def test_a_latin_square_is_balanced(n: int) -> None:
    """Each condition is at each place, and follows each other one, equally often."""
    rows = [latin_square_row(n, k) for k in range(2 * n)]
    assert all(sorted(row) == list(range(n)) for row in rows)
    for place in range(n):
        assert set(Counter(row[place] for row in rows).values()) == {2}
    pairs = Counter(pair for row in rows for pair in pairwise(row))
    assert len(pairs) == n * (n - 1)
    assert len(set(pairs.values())) <= 1


def config_with(**settings: object) -> StudyConfig:
    runs = [{"scenario": "empty", "runs": 3}, {"scenario": "sonata-2020", "runs": 2}]
    return StudyConfig.model_validate({"title": "t", "runs": runs, **settings})


def test_orders_of_runs() -> None:
    fixed = [(0, 0), (0, 1), (0, 2), (1, 0), (1, 1)]
    assert run_order(config_with(), 5) == fixed
    assert run_order(config_with(order="latin-square"), 0) == fixed
    assert run_order(config_with(order="latin-square"), 1) == [(1, 0), (1, 1), (0, 0), (0, 1), (0, 2)]
    orders = [tuple(run_order(config_with(order="shuffled"), k)) for k in range(20)]
    assert len(set(orders)) > 10
    assert all(sorted(order) == fixed for order in orders)
    assert orders[3] == tuple(run_order(config_with(order="shuffled"), 3))
    assert orders[3] != tuple(run_order(config_with(order="shuffled", seed=1), 3))


def test_items_are_shuffled_for_each_participant(tmp_path: Path) -> None:
    likert = "{name: felt, kind: likert, question: Q, items: {a: A, b: B, c: C, d: D, e: E, f: F}, shuffle: true}"
    end = f"end:\n  - {{scale: rosas, shuffle: true}}\n  - {{scale: godspeed}}\n  - {likert}\n"
    (tmp_path / "study.yaml").write_text(f"title: t\nruns: [{{scenario: empty}}]\n{end}")
    study = load_study(tmp_path / "study.yaml")

    def order_of(k: int, participant: int) -> tuple[str, ...]:
        content = question_content(study.config.end[k], Progress(study, participant))
        return tuple(item["name"] for item in content["items"])

    orders = {order_of(0, participant) for participant in range(5)}
    assert len(orders) == 5
    assert {frozenset(order) for order in orders} == {frozenset(item.name for item in scale_named("rosas").items)}
    assert {order_of(1, participant) for participant in range(5)} == {
        tuple(item.name for item in scale_named("godspeed").items)
    }
    assert len({order_of(2, participant) for participant in range(5)}) > 1


def test_scenes_of_blocks_have_different_numbers(tmp_path: Path) -> None:
    (tmp_path / "study.yaml").write_text(
        "title: t\nruns: [{scenario: empty}, {scenario: empty}]\npractice: {scenario: empty}"
    )
    study = load_study(tmp_path / "study.yaml")
    assert [study.scene_number(block, 1) for block in (0, 1, 2)] == [1, 10_001, 20_001]


def test_the_command_shows_the_steps(study_file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    result = CliRunner().invoke(main, ["study", "check", str(study_file)])
    assert result.exit_code == 0, result.output
    assert "run-2           drives: room, scene 1\n" in result.stdout
    assert "ratings-polite  rates: 3 runs of recorded, none of them twice\n" in result.stdout
    study_file.write_text(STUDY.replace("rosas", "rosa"))
    result = CliRunner().invoke(main, ["study", "check", str(study_file)])
    assert result.exit_code != 0
    assert "line 17" in result.output


def test_rows_of_a_table_can_be_reversed_or_pairs_of_opposites(tmp_path: Path) -> None:
    (tmp_path / "study.yaml").write_text(
        "title: T\nlanguages: [en, de]\ntitle: {en: A, de: B}\nruns: [{scenario: empty}]\nend:\n".replace(
            "title: T\n", ""
        )
        + "  - name: felt\n    kind: likert\n    question: {en: C, de: D}\n    items:\n"
        "      calm: {en: calm, de: ruhig}\n      tense: {text: {en: tense, de: angespannt}, reversed: true}\n"
        "      pair: {ends: [{en: bad, de: schlecht}, {en: good, de: gut}]}\n"
    )
    (table,) = load_study(tmp_path / "study.yaml").config.end
    assert isinstance(table, Likert)
    assert [(item.name, item.reversed, item.ends is not None) for item in table.items] == [
        ("calm", False, False), ("tense", True, False), ("pair", False, True)
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        (
            "classes: [yes, no]",
            "line 3: demographics.0.classes.0: yes, no, on, off, true and false are texts in quotes",
        ),
        ("items: {a: {reversed: true, ends: [b, c]}, '': d}", "an item needs a name"),
        ("classes: [1.50, 2]", "line 3: demographics.0.classes.0: a number is a text in quotes only"),
        (
            "items: {calm: The robot, was calm}",
            "'was calm' has no text; a text with a comma needs quotes within braces",
        ),
        ("items: {calm: {reversed: true}}", "an item needs a text, or the two ends of a pair of opposites"),
        ("items: [{name: a}]", "an item needs a text, or the two ends of a pair of opposites"),
    ],
)
def test_what_yaml_reads_otherwise_is_explained(text: str, problem: str, tmp_path: Path) -> None:
    kind = "likert" if "items" in text else "classes"
    question = f"demographics:\n  - {{name: q, kind: {kind}, question: Q, {text}}}\n"
    (tmp_path / "study.yaml").write_text(f"title: T\n{question}runs: [{{scenario: empty}}]\n")
    with pytest.raises(ConfigError) as caught:
        load_study(tmp_path / "study.yaml")
    assert problem in str(caught.value)


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        (
            "question: a: b",
            "line 1: mapping values are not allowed here; correct the indentation, or put a text with a",
        ),
        ("runs:\n\t- a", "line 2: found character '\\t' that cannot start any token; indent with spaces"),
        ("title: {en: a: b}", "line 1: expected ',' or '}', but got ':'; put a text with a colon in quotes"),
    ],
)
def test_errors_of_yaml_name_a_remedy(text: str, problem: str, tmp_path: Path) -> None:
    (tmp_path / "study.yaml").write_text(text)
    with pytest.raises(ConfigError) as caught:
        load_study(tmp_path / "study.yaml")
    assert problem in str(caught.value)
