"""Ratings are stored before the next run is shown; a session has a stable order with widely spaced repeats."""

from __future__ import annotations

import logging
import os
import re
import subprocess
import sys
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import orjson
import pytest

from sonata2d.collect.rating import (
    MINIMUM_SPACING,
    Rating,
    RatingSession,
    append_rating,
    path_for,
    plan_showings,
    questions,
    ratings_of,
    read_ratings,
)
from sonata2d.core.labels import LabelSpec
from sonata2d.datasets import generate_dataset, verify
from sonata2d.errors import ConfigError, NewerFormatError, RecordError
from sonata2d.record.files import sha256_of
from sonata2d.record.recorder import JsonRecorder
from sonata2d.scenegen.scenario.load import load_scenario

from ..record.samples import run

CLASSES = LabelSpec("classes", question="How polite?", classes=("poor", "fair", "good"))
RATING = Rating("Zoë / lab", "000003.json", "run-3", "ab" * 32, 2, 1, "2026-01-02T03:04:05Z", 12.5, True, CLASSES)
LABELS = {
    "yes_no": (LabelSpec("yes_no"), True),
    "classes": (CLASSES, 3),
    "slider": (LabelSpec("slider", ends=("rude", "kind")), 0.1235),
    "text": (LabelSpec("text"), "it waited,\nthen passed „left“"),
}


# The file of ratings


@pytest.mark.parametrize("kind", LABELS)
def test_ratings_read_back_equal(kind: str, tmp_path: Path) -> None:
    spec, label = LABELS[kind]
    first = replace(RATING, spec=spec, label=label)
    ratings = [first, replace(first, showing=2, whole=False)]
    for rating in ratings:
        append_rating(tmp_path / "ratings" / "a.jsonl", rating)
    assert read_ratings(tmp_path / "ratings" / "a.jsonl") == ratings


def test_a_rating_is_one_line_of_json(tmp_path: Path) -> None:
    append_rating(tmp_path / "a.jsonl", RATING)
    (line,) = (tmp_path / "a.jsonl").read_bytes().splitlines()
    row = orjson.loads(line)
    assert (row["rater"], row["label"], row["spec"]["question"]) == ("Zoë / lab", 2, "How polite?")


def test_each_rating_is_synced_before_the_call_returns(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, synced = tmp_path / "a.jsonl", []
    monkeypatch.setattr(os, "fsync", lambda handle: synced.append(path.read_bytes().count(b"\n")))
    for number in (1, 2):
        append_rating(path, RATING)
        assert synced[-1] == number


@pytest.mark.parametrize("rest", [b'{"version":1,"rater":"A', b"{", b'{"version":1,"label":2.'])
def test_an_incomplete_last_line_is_ignored_with_a_warning_and_removed_by_the_next_rating(
    rest: bytes, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = tmp_path / "a.jsonl"
    append_rating(path, RATING)
    path.write_bytes(path.read_bytes() + rest)
    with caplog.at_level(logging.WARNING):
        assert read_ratings(path) == [RATING]
    assert "line 2 is incomplete" in caplog.text
    append_rating(path, replace(RATING, label=3))
    assert [rating.label for rating in read_ratings(path)] == [2, 3]


def test_a_last_line_without_line_end_is_kept(tmp_path: Path) -> None:
    path = tmp_path / "a.jsonl"
    append_rating(path, RATING)
    path.write_bytes(path.read_bytes().rstrip(b"\n"))
    assert read_ratings(path) == [RATING]
    append_rating(path, RATING)
    assert read_ratings(path) == [RATING, RATING]


def test_ratings_survive_a_killed_program(tmp_path: Path) -> None:
    code = (
        "import dataclasses, sys, time\n"
        "from pathlib import Path\n"
        "from sonata2d.core.labels import LabelSpec\n"
        "from sonata2d.collect.rating import Rating, append_rating\n"
        "rating = Rating('ann', 'a.json', 'a', '00', 0.0, 1, '2026-01-02T03:04:05Z', 1.0, True, LabelSpec('slider'))\n"
        "for k in range(1000):\n"
        "    append_rating(Path(sys.argv[1]), dataclasses.replace(rating, label=k / 1000))\n"
        "    print(k, flush=True)\n"
    )
    path = tmp_path / "ann.jsonl"
    with subprocess.Popen([sys.executable, "-c", code, str(path)], stdout=subprocess.PIPE, text=True) as program:
        assert program.stdout is not None
        printed = [int(program.stdout.readline()) for _ in range(20)]
        program.kill()
        printed += [int(line) for line in program.stdout.read().splitlines() if line.isdigit()]
    labels = [rating.label for rating in read_ratings(path)]
    assert labels == [k / 1000 for k in range(len(labels))]
    assert len(labels) >= len(printed) >= 20


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"label": 4}, "4 is not a valid label; expected: How polite? 1: poor, 2: fair, 3: good"),
        ({"showing": "first"}, "showing: Input should be a valid integer, got 'first'"),
        ({"spec": {"kind": "slider"}}, "spec.when: is missing"),
        ({"spec": asdict(RATING.spec) | {"colour": "red"}}, "colour"),
        ({"spec": asdict(RATING.spec) | {"when": ["run"]}}, "spec.when: Input should be 'frame' or 'run'"),
        ({"version": "1"}, "version is '1'"),
    ],
)
def test_a_damaged_line_is_named_by_its_number(changes: dict[str, Any], reason: str, tmp_path: Path) -> None:
    path = tmp_path / "a.jsonl"
    append_rating(path, RATING)
    line = orjson.loads(path.read_bytes())
    path.write_bytes(path.read_bytes() + orjson.dumps(line | changes) + b"\n" + path.read_bytes())
    message = rf"a\.jsonl, line 2 is not a rating: .*{re.escape(reason)}.*correct or remove"
    with pytest.raises(RecordError, match=message):
        read_ratings(path)


@pytest.mark.parametrize(
    ("text", "reason"),
    [(b'{"version": 1}\n', "rater: is missing"), (b"[1]\n", "JSON list"), (b"{oh\n\n", "line 1")],
)
def test_a_line_that_is_not_a_rating_is_refused(text: bytes, reason: str, tmp_path: Path) -> None:
    (tmp_path / "a.jsonl").write_bytes(text)
    with pytest.raises(RecordError, match=reason):
        read_ratings(tmp_path / "a.jsonl")


def test_a_line_of_a_newer_version_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.jsonl").write_bytes(b'{"version":2}\n')
    with pytest.raises(NewerFormatError, match=r"line 1 was written by version 2.*upgrade"):
        read_ratings(tmp_path / "a.jsonl")


def test_the_ratings_of_a_folder_are_found_with_their_questions(tmp_path: Path) -> None:
    other = replace(RATING, rater="Ann", spec=LabelSpec("yes_no"), label=False)
    append_rating(path_for(tmp_path, RATING.rater), RATING)
    append_rating(path_for(tmp_path, "Ann"), other)
    assert ratings_of(tmp_path) == [other, RATING]
    assert questions(ratings_of(tmp_path)) == [LabelSpec("yes_no"), CLASSES]
    assert ratings_of(tmp_path / "nowhere") == []


@pytest.mark.parametrize("rater", ["../../etc", "a/b", "con", "..", "x" * 300])
def test_the_file_of_any_rater_is_in_the_folder(tmp_path: Path, rater: str) -> None:
    path = path_for(tmp_path, rater)
    assert path.parent == tmp_path / "ratings"
    assert len(path.name.encode()) < 100


def test_the_hash_is_that_of_the_stored_bytes(tmp_path: Path) -> None:
    """FIPS 180-2, appendix B.1: SHA-256 of 'abc'."""
    (tmp_path / "abc").write_bytes(b"abc")
    assert sha256_of(tmp_path / "abc") == "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"


# The rating session

SPEC = LabelSpec("slider", question="How well did it go?")


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("runs")
    for k in range(12):
        add_run(folder, k)
    return folder


@pytest.fixture
def folder(runs: Path, tmp_path: Path) -> Path:
    """A copy of twelve runs."""
    for path in runs.iterdir():
        if path.is_file():
            (tmp_path / path.name).write_bytes(path.read_bytes())
    return tmp_path


def add_run(folder: Path, k: int) -> None:
    with JsonRecorder(folder / f"run-{k:02d}.json") as recorder:
        run(recorder, ticks=3)


def rate(session: RatingSession, maximum: int = 1000) -> list[Rating]:
    """Rate the upcoming runs."""
    ratings: list[Rating] = []
    while len(ratings) < maximum and (record := session.load()) is not None:
        ratings.append(session.rate(record, 0.5, seconds=1.234, whole=True))
    return ratings


def shown(ratings: list[Rating]) -> list[tuple[str, int]]:
    return [(rating.file, rating.showing) for rating in ratings]


def test_every_run_is_rated_once_and_a_fraction_again_in_the_last_third(folder: Path) -> None:
    session = RatingSession(folder, "ann", SPEC, repeats=0.25)
    assert (session.done, session.total) == (0, 15)
    ratings = rate(session)
    assert sorted(name for name, showing in shown(ratings) if showing == 1) == [f"run-{k:02d}.json" for k in range(12)]
    assert next(place for place, (_, showing) in enumerate(shown(ratings)) if showing == 2) >= 8
    assert sum(showing == 2 for _, showing in shown(ratings)) == 3
    assert (session.done, session.upcoming) == (15, None)
    assert ratings_of(folder) == ratings


@pytest.mark.parametrize("n", [1, 5, 6, 7, 11, 12, 40, 101])
@pytest.mark.parametrize("repeats", [0.0, 0.1, 0.5, 1.0])
def test_a_run_is_repeated_at_most_once_and_after_enough_others(n: int, repeats: float) -> None:
    plan = plan_showings([Path(f"{k}.json") for k in range(n)], repeats)
    first = {showing.path: place for place, showing in enumerate(plan) if showing.number == 1}
    repeated = [(place, showing.path) for place, showing in enumerate(plan) if showing.number == 2]
    assert len(first) == n
    assert len({path for _, path in repeated}) == len(repeated)
    assert all(place - first[path] > MINIMUM_SPACING for place, path in repeated)
    assert len(repeated) <= n * repeats + 0.5
    if n >= 12 and repeats <= 0.5:
        assert len(repeated) == int(n * repeats + 0.5)


def test_a_rater_continues_in_the_same_order(folder: Path) -> None:
    whole = shown(rate(RatingSession(folder, "ann", SPEC, seed=3)))
    path_for(folder, "ann").unlink()
    first = shown(rate(RatingSession(folder, "ann", SPEC, seed=3), maximum=5))
    session = RatingSession(folder, "ann", SPEC, seed=3)
    assert (session.done, session.total) == (5, 13)
    assert first + shown(rate(session)) == whole
    assert rate(RatingSession(folder, "ann", SPEC, seed=3)) == []


def test_rater_and_seed_determine_the_order(folder: Path) -> None:
    def order(rater: str, seed: int) -> list[str]:
        session = RatingSession(folder, rater, SPEC, seed=seed)
        return [showing.path.name for showing in session._plan if showing.number == 1]

    assert order("ann", 0) == order(" ann ", 0)
    assert order("ann", 0) != order("ben", 0)
    assert order("ann", 0) != order("ann", 1)
    assert order("ann", 0) != sorted(order("ann", 0)) == sorted(order("ben", 0))


def test_added_files_keep_the_order_of_the_others(folder: Path) -> None:
    before = [s.path.name for s in RatingSession(folder, "ann", SPEC, repeats=0)._plan]
    add_run(folder, 50)
    after = [s.path.name for s in RatingSession(folder, "ann", SPEC, repeats=0)._plan]
    assert [name for name in after if name != "run-50.json"] == before


def test_changed_files_and_other_questions_are_rated_again(folder: Path) -> None:
    rate(RatingSession(folder, "ann", SPEC, repeats=0))
    with JsonRecorder(folder / "run-04.json") as recorder:
        run(recorder, ticks=5)
    assert shown(rate(RatingSession(folder, "ann", SPEC, repeats=0))) == [("run-04.json", 1)]
    other = LabelSpec("yes_no", question="Was it polite?")
    assert RatingSession(folder, "ann", other, repeats=0).done == 0


def test_raters_with_similar_ids_have_separate_files(folder: Path) -> None:
    rate(RatingSession(folder, "a b", SPEC), maximum=3)
    assert path_for(folder, "a b") != path_for(folder, "a/b")
    assert RatingSession(folder, "a/b", SPEC).done == 0


def test_repeats_keep_their_spacing_when_runs_are_added(folder: Path) -> None:
    """Without a check, runs added after most ratings would move a repeat next to its first showing."""
    session = RatingSession(folder, "ann", SPEC, repeats=0.5)
    rate(session)
    for k in range(60, 63):
        add_run(folder, k)
    added = shown(rate(RatingSession(folder, "ann", SPEC, repeats=0.5)))
    showings = shown(ratings_of(folder))
    assert len(added) >= 3
    for place, (name, showing) in enumerate(showings):
        if showing == 2:
            assert place - showings.index((name, 1)) > MINIMUM_SPACING


def test_a_break_is_due_after_a_number_of_ratings_but_not_at_the_end(folder: Path) -> None:
    session = RatingSession(folder, "ann", SPEC, repeats=0, break_after=4)
    rate(session, maximum=3)
    assert not session.break_due
    rate(session, maximum=1)
    assert session.break_due
    session.take_break()
    assert not session.break_due
    rate(session)
    assert not session.break_due


def test_an_unreadable_file_is_skipped_with_a_warning(folder: Path, caplog: pytest.LogCaptureFixture) -> None:
    (folder / "run-02.json").write_text("{")
    session = RatingSession(folder, "ann", SPEC, repeats=0)
    with caplog.at_level(logging.WARNING):
        assert len(rate(session)) == 11
    assert (session.skipped, session.done, session.total) == (("run-02.json",), 11, 11)
    assert "run-02.json is not valid JSON" in caplog.text


def test_only_the_present_run_can_be_rated_with_a_valid_label(folder: Path) -> None:
    session = RatingSession(folder, "ann", SPEC)
    record = session.load()
    assert record is not None
    with pytest.raises(ValueError, match=r"1\.5 is not a valid label; expected: How well did it go\? 0"):
        session.rate(record, 1.5, seconds=1.0, whole=True)
    session.rate(record, 1.0, seconds=1.0, whole=True)
    with pytest.raises(ValueError, match="is not the run to rate now"):
        session.rate(record, 1.0, seconds=1.0, whole=True)


@pytest.mark.parametrize("rater", ["", "  ", "///", "two\nlines", "x" * 65])
def test_an_unusable_rater_id_is_refused(rater: str, folder: Path) -> None:
    with pytest.raises(ConfigError, match="is not a rater id; give"):
        RatingSession(folder, rater, SPEC)


def test_unusable_specifications_fractions_and_folders_are_refused(
    folder: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    with pytest.raises(ConfigError, match=r"asks nothing; give a scenario with a label .* --scenario FILE"):
        RatingSession(folder, "ann", LabelSpec())
    with pytest.raises(ConfigError, match="needs two or more classes, got 1"):
        RatingSession(folder, "ann", LabelSpec("classes", classes=("one",)))
    with pytest.raises(ConfigError, match=r"repeats is 10; give a fraction"):
        RatingSession(folder, "ann", SPEC, repeats=10)
    with pytest.raises(RecordError, match="holds no episode files"):
        RatingSession(tmp_path_factory.mktemp("empty"), "ann", SPEC)


def test_a_rated_data_set_still_passes_the_check(tmp_path: Path) -> None:
    generate_dataset(tmp_path / "set", load_scenario("sonata-2020"), episodes=1, seed=1)
    rate(RatingSession(tmp_path / "set", "ann", SPEC))
    assert ratings_of(tmp_path / "set")
    assert verify(tmp_path / "set") == []
