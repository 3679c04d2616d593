"""Ratings are on the disk before the next run is shown, and come back as they were given."""

from __future__ import annotations

import logging
import os
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import orjson
import pytest

from sonata2d.collect.rating import Rating, append_rating, path_for, questions, ratings_of, read_ratings, sha256_of
from sonata2d.core.labels import LabelSpec
from sonata2d.errors import NewerFormatError, RecordError

CLASSES = LabelSpec("classes", question="How polite?", classes=("poor", "fair", "good"))
RATING = Rating("Zoë / lab", "000003.json", "run-3", "ab" * 32, 2, 1, "2026-01-02T03:04:05Z", 12.5, True, CLASSES)
SPECS = {
    "yes_no": (LabelSpec("yes_no"), True),
    "classes": (CLASSES, 3),
    "slider": (LabelSpec("slider", ends=("rude", "kind")), 0.1235),
    "text": (LabelSpec("text"), "it waited,\nthen passed „left“"),
}


@pytest.mark.parametrize("kind", SPECS)
def test_a_rating_comes_back_as_it_was_given(kind: str, tmp_path: Path) -> None:
    spec, label = SPECS[kind]
    given = [replace(RATING, spec=spec, label=label), replace(RATING, spec=spec, label=label, showing=2, whole=False)]
    for rating in given:
        append_rating(tmp_path / "ratings" / "a.jsonl", rating)
    assert read_ratings(tmp_path / "ratings" / "a.jsonl") == given


def test_a_rating_is_one_line_that_json_alone_reads(tmp_path: Path) -> None:
    append_rating(tmp_path / "a.jsonl", RATING)
    (line,) = (tmp_path / "a.jsonl").read_bytes().splitlines()
    told = orjson.loads(line)
    assert (told["rater"], told["label"], told["spec"]["question"]) == ("Zoë / lab", 2, "How polite?")


def test_each_rating_is_on_the_disk_before_the_call_returns(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, synced = tmp_path / "a.jsonl", []
    monkeypatch.setattr(os, "fsync", lambda handle: synced.append(path.read_bytes().count(b"\n")))
    append_rating(path, RATING)
    append_rating(path, RATING)
    assert synced == [1, 2]


@pytest.mark.parametrize("rest", [b'{"version":1,"rater":"A', b"{", b'{"version":1,"label":2.'])
def test_a_torn_last_line_is_dropped_with_a_warning_and_cut_off_by_the_next_rating(
    rest: bytes, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = tmp_path / "a.jsonl"
    append_rating(path, RATING)
    path.write_bytes(path.read_bytes() + rest)
    with caplog.at_level(logging.WARNING):
        assert read_ratings(path) == [RATING]
    assert "line 2 was cut short" in caplog.text
    append_rating(path, replace(RATING, label=3))
    assert [rating.label for rating in read_ratings(path)] == [2, 3]


def test_a_last_line_that_lost_only_its_end_mark_is_kept(tmp_path: Path) -> None:
    path = tmp_path / "a.jsonl"
    append_rating(path, RATING)
    path.write_bytes(path.read_bytes().rstrip(b"\n"))
    assert read_ratings(path) == [RATING]
    append_rating(path, RATING)
    assert read_ratings(path) == [RATING, RATING]


def test_what_was_rated_outlives_a_killed_program(tmp_path: Path) -> None:
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
        told = [int(program.stdout.readline()) for _ in range(20)]
        program.kill()
        told += [int(line) for line in program.stdout.read().splitlines() if line.isdigit()]
    labels = [rating.label for rating in read_ratings(path)]
    assert labels == [k / 1000 for k in range(len(labels))]
    assert len(labels) >= len(told) >= 20


DAMAGES: dict[str, tuple[dict[str, Any], str]] = {
    "label": ({"label": 4}, "4 is no label; it is How polite? 1: poor, 2: fair, 3: good"),
    "showing": ({"showing": "first"}, "showing is 'first'"),
    "spec": ({"spec": {"kind": "slider", "colour": "red"}}, "colour"),
    "version": ({"version": "1"}, "version is '1'"),
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_line_is_named_with_its_number(damage: str, tmp_path: Path) -> None:
    changes, reason = DAMAGES[damage]
    path = tmp_path / "a.jsonl"
    append_rating(path, RATING)
    line = orjson.loads(path.read_bytes())
    path.write_bytes(path.read_bytes() + orjson.dumps(line | changes) + b"\n" + path.read_bytes())
    with pytest.raises(RecordError, match=rf"a\.jsonl, line 2 is no rating: .*{re.escape(reason)}.*mend or remove"):
        read_ratings(path)


def test_a_missing_key_and_a_damaged_line_in_the_middle_are_named(tmp_path: Path) -> None:
    path = tmp_path / "a.jsonl"
    for text, reason in ((b'{"version": 1}\n', "'rater' is missing"), (b"[1]\n", "JSON list"), (b"{oh\n\n", "line 1")):
        path.write_bytes(text)
        with pytest.raises(RecordError, match=reason):
            read_ratings(path)


def test_a_newer_line_is_refused_by_its_version(tmp_path: Path) -> None:
    (tmp_path / "a.jsonl").write_bytes(b'{"version":2}\n')
    with pytest.raises(NewerFormatError, match=r"line 1 was written by version 2.*upgrade"):
        read_ratings(tmp_path / "a.jsonl")


def test_all_ratings_of_a_folder_are_found_question_by_question(tmp_path: Path) -> None:
    other = replace(RATING, rater="Ann", spec=LabelSpec("yes_no"), label=False)
    append_rating(path_for(tmp_path, RATING.rater), RATING)
    append_rating(path_for(tmp_path, "Ann"), other)
    assert ratings_of(tmp_path) == [other, RATING]
    assert questions(ratings_of(tmp_path)) == [LabelSpec("yes_no"), CLASSES]
    assert ratings_of(tmp_path / "nowhere") == []


def test_no_rater_id_leaves_the_folder(tmp_path: Path) -> None:
    for rater in ("../../etc", "a/b", "con", "..", "x" * 300):
        path = path_for(tmp_path, rater)
        assert path.parent == tmp_path / "ratings"
        assert len(path.name.encode()) < 100


def test_the_hash_is_of_the_bytes_on_the_disk(tmp_path: Path) -> None:
    """FIPS 180-2, appendix B.1: SHA-256 of 'abc'."""
    (tmp_path / "abc").write_bytes(b"abc")
    assert sha256_of(tmp_path / "abc") == "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"
