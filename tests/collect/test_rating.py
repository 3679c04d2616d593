"""A sitting: the same order again, nothing lost, repeats far apart."""

from __future__ import annotations

import logging
from pathlib import Path

import pytest

from sonata2d.collect.rating import APART, Rating, RatingSession, path_for, planned, ratings_of
from sonata2d.core.labels import LabelSpec
from sonata2d.datasets.check import check_dataset
from sonata2d.datasets.generate import generate_dataset
from sonata2d.errors import ConfigError, RecordError
from sonata2d.record.recorder import JsonRecorder
from sonata2d.scenegen.scenario.load import load_scenario

from ..record.samples import run

SPEC = LabelSpec("slider", question="How well did it go?")


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("runs")
    for k in range(12):
        add_run(folder, k)
    return folder


@pytest.fixture
def folder(runs: Path, tmp_path: Path) -> Path:
    for path in runs.iterdir():
        if path.is_file():
            (tmp_path / path.name).write_bytes(path.read_bytes())
    return tmp_path


def add_run(folder: Path, k: int) -> None:
    with JsonRecorder(folder / f"run-{k:02d}.json") as recorder:
        run(recorder, ticks=3)


def rate(session: RatingSession, most: int = 1000) -> list[Rating]:
    """Rate what comes, so many runs at most."""
    given: list[Rating] = []
    while len(given) < most and (record := session.load()) is not None:
        given.append(session.rate(record, 0.5, seconds=1.234, whole=True))
    return given


def shown(ratings: list[Rating]) -> list[tuple[str, int]]:
    return [(rating.file, rating.showing) for rating in ratings]


def test_every_run_is_rated_once_and_a_share_of_them_again_in_the_last_third(folder: Path) -> None:
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
def test_a_repeat_comes_once_with_others_between(n: int, repeats: float) -> None:
    plan = planned([Path(f"{k}.json") for k in range(n)], repeats)
    first = {showing.path: place for place, showing in enumerate(plan) if showing.number == 1}
    again = [(place, showing.path) for place, showing in enumerate(plan) if showing.number == 2]
    assert len(first) == n
    assert len({path for _, path in again}) == len(again)
    assert all(place - first[path] > APART for place, path in again)
    assert len(again) <= n * repeats + 0.5
    if n >= 12 and repeats <= 0.5:
        assert len(again) == int(n * repeats + 0.5)


def test_the_same_person_goes_on_where_they_stopped(folder: Path) -> None:
    whole = shown(rate(RatingSession(folder, "ann", SPEC, seed=3)))
    path_for(folder, "ann").unlink()
    first = shown(rate(RatingSession(folder, "ann", SPEC, seed=3), most=5))
    session = RatingSession(folder, "ann", SPEC, seed=3)
    assert (session.done, session.total) == (5, 13)
    assert first + shown(rate(session)) == whole
    assert rate(RatingSession(folder, "ann", SPEC, seed=3)) == []


def test_person_and_seed_decide_the_order(folder: Path) -> None:
    def order(rater: str, seed: int) -> list[str]:
        session = RatingSession(folder, rater, SPEC, seed=seed)
        return [showing.path.name for showing in session._plan if showing.number == 1]

    assert order("ann", 0) == order(" ann ", 0)
    assert order("ann", 0) != order("ben", 0)
    assert order("ann", 0) != order("ann", 1)
    assert order("ann", 0) != sorted(order("ann", 0)) == sorted(order("ben", 0))


def test_added_files_leave_the_order_of_the_others(folder: Path) -> None:
    before = [s.path.name for s in RatingSession(folder, "ann", SPEC, repeats=0)._plan]
    add_run(folder, 50)
    after = [s.path.name for s in RatingSession(folder, "ann", SPEC, repeats=0)._plan]
    assert [name for name in after if name != "run-50.json"] == before


def test_a_changed_file_and_another_question_are_rated_anew(folder: Path) -> None:
    rate(RatingSession(folder, "ann", SPEC, repeats=0))
    with JsonRecorder(folder / "run-04.json") as recorder:
        run(recorder, ticks=5)
    assert shown(rate(RatingSession(folder, "ann", SPEC, repeats=0))) == [("run-04.json", 1)]
    other = LabelSpec("yes_no", question="Was it polite?")
    assert RatingSession(folder, "ann", other, repeats=0).done == 0


def test_people_whose_names_differ_by_signs_do_not_mix(folder: Path) -> None:
    rate(RatingSession(folder, "a b", SPEC), most=3)
    assert path_for(folder, "a b") != path_for(folder, "a/b")
    assert RatingSession(folder, "a/b", SPEC).done == 0


def test_a_repeat_waits_until_enough_was_rated_since(folder: Path) -> None:
    """Runs that were added after most was rated would else bring a repeat right after its first showing."""
    session = RatingSession(folder, "ann", SPEC, repeats=0.5)
    rate(session)
    for k in range(60, 63):
        add_run(folder, k)
    given = shown(rate(RatingSession(folder, "ann", SPEC, repeats=0.5)))
    everything = shown(ratings_of(folder))
    assert len(given) >= 3
    for place, (name, showing) in enumerate(everything):
        if showing == 2:
            assert place - everything.index((name, 1)) > APART


def test_a_break_is_due_after_so_many_but_not_at_the_end(folder: Path) -> None:
    session = RatingSession(folder, "ann", SPEC, repeats=0, break_after=4)
    rate(session, most=3)
    assert not session.break_due
    rate(session, most=1)
    assert session.break_due
    session.rested()
    assert not session.break_due
    rate(session)
    assert not session.break_due


def test_a_file_that_cannot_be_read_is_left_out_with_a_warning(folder: Path, caplog: pytest.LogCaptureFixture) -> None:
    (folder / "run-02.json").write_text("{")
    session = RatingSession(folder, "ann", SPEC, repeats=0)
    with caplog.at_level(logging.WARNING):
        assert len(rate(session)) == 11
    assert (session.skipped, session.done, session.total) == (("run-02.json",), 11, 11)
    assert "run-02.json is not whole JSON" in caplog.text


def test_what_was_rated_already_cannot_be_rated_by_mistake(folder: Path) -> None:
    session = RatingSession(folder, "ann", SPEC)
    record = session.load()
    assert record is not None
    with pytest.raises(ValueError, match=r"1\.5 is no label; it is How well did it go\? 0"):
        session.rate(record, 1.5, seconds=1.0, whole=True)
    session.rate(record, 1.0, seconds=1.0, whole=True)
    with pytest.raises(ValueError, match="is not the run to be rated now"):
        session.rate(record, 1.0, seconds=1.0, whole=True)


@pytest.mark.parametrize("rater", ["", "  ", "///", "two\nlines", "x" * 65])
def test_an_id_that_names_nobody_is_refused(rater: str, folder: Path) -> None:
    with pytest.raises(ConfigError, match="is no rater id; give"):
        RatingSession(folder, rater, SPEC)


def test_what_cannot_be_asked_is_refused(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> None:
    with pytest.raises(ConfigError, match="asks nothing"):
        RatingSession(folder, "ann", LabelSpec())
    with pytest.raises(ConfigError, match="1 classes are no choice"):
        RatingSession(folder, "ann", LabelSpec("classes", classes=("one",)))
    with pytest.raises(ConfigError, match=r"repeats is 10; it is a share"):
        RatingSession(folder, "ann", SPEC, repeats=10)
    with pytest.raises(RecordError, match="holds no episode files"):
        RatingSession(tmp_path_factory.mktemp("empty"), "ann", SPEC)


def test_ratings_do_not_disturb_the_check_of_a_data_set(tmp_path: Path) -> None:
    generate_dataset(tmp_path / "set", load_scenario("sonata-2020"), episodes=1, seed=1)
    rate(RatingSession(tmp_path / "set", "ann", SPEC))
    assert ratings_of(tmp_path / "set")
    assert check_dataset(tmp_path / "set") == []
