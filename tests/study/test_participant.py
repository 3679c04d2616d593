"""A participant goes from step to step, and continues where the program ended."""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Callable
from pathlib import Path

import pytest

from sonata2d.agents.controllers.teleoperation import DEFAULT_MAPPINGS
from sonata2d.collect.session import Session
from sonata2d.datasets import verify
from sonata2d.errors import ConfigError, RecordError
from sonata2d.metrics import evaluate
from sonata2d.record.reader import read_episode
from sonata2d.scenegen.scenario.load import load_scenario
from sonata2d.study.answers import checked_answers
from sonata2d.study.folder import StudyFolder
from sonata2d.study.load import load_study
from sonata2d.study.participant import Participant
from sonata2d.study.questions import Number
from sonata2d.study.removal import remove_participant
from sonata2d.study.report import _score_rows, results_of, save_results, table_of

from .conftest import NOW, STUDY, WARMTH, drive, prepare, rate_all, take_part

Arrive = Callable[..., Participant]


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def test_a_whole_study(arrive: Arrive, tmp_path: Path) -> None:
    participant = arrive()
    assert [step.id for step in participant.steps] == [
        "page-1", "consent", "demographics", "practice-text", "practice-1", "run-1", "after-run-1", "run-2",
        "after-run-2", "ratings-polite", "end", "thanks",
    ]  # fmt: skip
    prepare(participant)
    for number in (1, 2):
        assert participant.step.id == f"run-{number}"
        drive(participant, ticks=6 + number)
        participant.keep(0.25 * number)
        participant.answer(f"after-run-{number}", {"effort": number, "driver": "Zoe"})
    assert participant.runs == (2, 2)
    assert rate_all(participant) == 3
    participant.answer("end", {"rosas": WARMTH})
    assert participant.is_finished
    assert participant.progress == (11, 11)
    assert participant.session is None

    out = tmp_path / "out"
    assert verify(out, replay=True, rerun=True) == []
    assert {path.name for path in out.glob("p1__*.json")} == {
        "p1__20260304T050607Z__000000.json", "p1__20260304T050607Z__000001.json"
    }  # fmt: skip
    assert len(list((out / "discarded").iterdir())) == 1  # the practice
    tables = tmp_path / "tables"
    save_results(out, tables)
    (only,) = rows(tmp_path / "tables" / "participants.csv")
    assert (only["participant"], only["runs"], only["ratings"]) == ("p1", "2", "3")
    runs = rows(tmp_path / "tables" / "runs.csv")
    assert [(row["step"], row["scenario"], row["seconds"], row["label"], row["round_trip_median"]) for row in runs] == [
        ("run-1", "room", "0.7", "0.25", "0.05"), ("run-2", "room", "0.8", "0.5", "0.05")
    ]  # fmt: skip
    answers = {
        (row["step"], row["question"], row["item"]): row["value"] for row in rows(tmp_path / "tables/answers.csv")
    }
    assert answers["after-run-2", "effort", ""] == "2"
    assert answers["end", "rosas", "social"] == "4"
    scores = rows(tmp_path / "tables" / "scores.csv")
    assert [(row["step"], row["table"], row["part"], row["score"], row["items"]) for row in scores] == [
        ("end", "rosas", "warmth", "4.0", "6")
    ]
    assert not any(question in ("age", "remark", "driver") for _, question, _ in answers)
    assert [row["label"] for row in rows(tmp_path / "tables" / "ratings.csv")] == ["1", "1", "1"]


def test_personal_answers_are_kept_apart(arrive: Arrive, tmp_path: Path) -> None:
    participant = arrive()
    prepare(participant)
    drive(participant)
    participant.keep(0.5)
    participant.answer("after-run-1", {"effort": 1, "driver": "=HYPERLINK(1)"})
    out, personal = tmp_path / "out", tmp_path / "out" / "study" / "personal" / "p1.jsonl"
    assert b"left-handed" in personal.read_bytes()
    others = [path for path in out.rglob("*") if path.is_file() and path != personal]
    assert not any(b"left-handed" in path.read_bytes() or b"HYPERLINK" in path.read_bytes() for path in others)
    if os.name == "posix":
        assert personal.stat().st_mode & 0o077 == 0
    save_results(out, tmp_path / "tables", personal=True)
    answers = {row["question"]: row["value"] for row in rows(tmp_path / "tables" / "answers.csv")}
    assert answers == {"age": "30", "remark": "left-handed", "effort": "1", "driver": "'=HYPERLINK(1)"}


def test_texts_of_tables_can_be_restored() -> None:
    texts = ["=1+1", "'=1+1", "''=1+1", "+1", "-1", "@a", "\ta", "\n=1", "'", "'tis", "a'b", "=", 'say "=1"', "a,b\nc"]
    table = table_of(["text"], [{"text": text} for text in texts]).decode()
    cells = [row["text"] for row in csv.DictReader(io.StringIO(table, newline=""))]
    assert cells[:4] == ["'=1+1", "''=1+1", "'''=1+1", "'+1"]
    assert not any(cell.startswith(("=", "+", "-", "@", "\t", "\n")) for cell in cells)
    assert [cell.removeprefix("'") for cell in cells] == texts


def test_a_run_equals_that_of_a_session_with_the_same_events(arrive: Arrive, tmp_path: Path) -> None:
    participant = arrive()
    prepare(participant)
    drive(participant, ticks=12)
    record = read_episode(participant.keep(0.75))
    number = record.episode
    config = load_scenario(tmp_path / "room.yaml")
    session = Session(
        tmp_path / "plain", "p1", config, seed=3, now=lambda: NOW, schedule=lambda kept: (config, number),
        mappings=DEFAULT_MAPPINGS,
    )  # fmt: skip
    for snapshot in record.snapshots():
        session.tick(snapshot.events)
    assert session.keep(0.75).read_bytes() == record.path.read_bytes()
    session.close()


@pytest.mark.parametrize("is_closed", [True, False])
def test_a_participant_continues_after_the_program_has_ended(arrive: Arrive, is_closed: bool) -> None:
    """Without `close`, the lock is released as at the end of a process, and nothing else is done."""

    def end(participant: Participant) -> None:
        if is_closed:
            participant.close()
        elif participant.session is not None:
            participant.session._collection.close()
            participant.session._journal.shut()

    participant = arrive()
    participant.read("page-1")
    end(participant)
    participant = arrive()
    participant.consent("consent", [True, True])
    participant.answer("demographics", {"age": 30})
    participant.read("practice-text")
    drive(participant)
    end(participant)
    participant = arrive()
    assert participant.step.id == "practice-1"
    assert participant.session is not None
    assert participant.session.state == "ended"
    participant.finish_practice()
    drive(participant)
    participant.keep(0.5)
    end(participant)
    participant = arrive()
    assert participant.step.id == "after-run-1"
    participant.answer("after-run-1", {"effort": 2})
    assert participant.session is not None
    participant.session.tick()
    end(participant)
    participant = arrive()
    assert participant.step.id == "run-2"
    assert participant.session is not None
    assert (participant.session.state, participant.session.ticks) == ("paused", 1)
    drive(participant)
    participant.keep(0.5)
    participant.answer("after-run-2", {"effort": 2})
    end(participant)
    participant = arrive()
    participant.rate(False, seconds=1.0, whole=True)
    participant = arrive()
    assert rate_all(participant) == 2
    participant = arrive()
    assert participant.step.id == "end"
    assert participant.progress == (10, 11)


def test_a_practice_run_that_was_finished_is_not_shown_again(arrive: Arrive, monkeypatch: pytest.MonkeyPatch) -> None:
    """The program may end after the step was stored and before the run was put away."""
    participant = arrive()
    participant.read("page-1")
    participant.consent("consent", [True, True])
    participant.answer("demographics", {"age": 30})
    participant.read("practice-text")
    drive(participant)
    assert participant.session is not None

    def fail(**_: object) -> None:
        raise RecordError("the disk is full")

    monkeypatch.setattr(participant.session, "next", fail)
    with pytest.raises(RecordError):
        participant.finish_practice()
    participant.close()
    participant = arrive()
    assert participant.step.id == "run-1"
    assert participant.session is not None
    assert (participant.session.state, participant.session.scene.episode) == ("waiting", 0)


def test_a_discarded_run_is_replaced_by_another_scene(arrive: Arrive) -> None:
    participant = arrive()
    prepare(participant)
    with pytest.raises(ValueError, match="no run has begun"):
        participant.discard()
    scenes = []
    for _ in range(2):
        drive(participant)
        participant.discard()
        assert participant.session is not None
        scenes.append(participant.session.scene.episode)
    assert scenes == [2, 3]  # 0 and 1 are those of the two runs
    participant.close()
    participant = arrive()
    assert participant.session is not None
    assert participant.session.scene.episode == 3
    drive(participant)
    participant.redo()
    assert participant.session.scene.episode == 3
    drive(participant)
    participant.keep(0.0)
    participant.answer("after-run-1", {"effort": 1})
    assert participant.session.scene.episode == 1


def test_a_kept_run_can_be_taken_back_until_the_next_one_begins(arrive: Arrive, tmp_path: Path) -> None:
    participant = arrive()
    prepare(participant)
    assert not participant.can_undo
    drive(participant)
    participant.keep(0.5)
    participant.answer("after-run-1", {"effort": 5})
    assert participant.can_undo
    participant.undo()
    assert participant.step.id == "run-1"
    assert participant.session is not None
    assert participant.session.undone_label == 0.5
    participant.keep(0.25)
    assert participant.step.id == "after-run-1"  # the answers were about the run that was taken back
    save_results(tmp_path / "out", tmp_path / "tables")
    assert rows(tmp_path / "tables" / "answers.csv") == []
    participant.answer("after-run-1", {"effort": 1})
    assert participant.session is not None
    participant.session.tick()
    with pytest.raises(ValueError, match="cannot be taken back"):
        participant.undo()


def test_the_last_run_can_be_taken_back_until_the_ratings(arrive: Arrive) -> None:
    participant = arrive()
    prepare(participant)
    for number in (1, 2):
        drive(participant)
        participant.keep(0.5)
        participant.answer(f"after-run-{number}", {"effort": 1})
    assert participant.step.kind == "ratings"
    assert participant.can_undo
    participant.rate(True, seconds=1.0, whole=True)
    assert not participant.can_undo


def test_a_short_run_is_not_kept(arrive: Arrive) -> None:
    participant = arrive()
    prepare(participant)
    drive(participant, ticks=3)
    with pytest.raises(ValueError, match=r"the run is 0\.3 s long; it has to last 0\.5 s or more"):
        participant.keep(0.5)
    participant.redo()
    drive(participant, ticks=5)
    participant.keep(0.5)


def test_only_the_present_step_can_be_done(arrive: Arrive) -> None:
    participant = arrive()
    participant.read("page-1")
    for call in (
        lambda: participant.read("page-1"),
        lambda: participant.answer("demographics", {"age": 30}),
        lambda: participant.keep(),
        lambda: participant.finish_practice(),
        lambda: participant.undo(),
        lambda: participant.rate(True, seconds=0.0, whole=True),
    ):
        with pytest.raises(ValueError, match=r"the present step is consent|cannot be taken back|no run to rate"):
            call()
    assert participant.progress == (1, 11)


def test_consent_can_be_declined_and_reconsidered(arrive: Arrive) -> None:
    participant = arrive()
    participant.read("page-1")
    with pytest.raises(ValueError, match="every statement"):
        participant.consent("consent", [True, False])
    with pytest.raises(ValueError, match="every statement"):
        participant.consent("consent", [])
    participant.decline("consent")
    assert participant.is_finished
    participant = arrive()
    assert participant.has_declined
    participant.reconsider()
    participant.consent("consent", [True, True])
    assert participant.step.id == "demographics"


@pytest.mark.parametrize(
    ("values", "problem"),
    [
        ({}, "age is not answered"),
        ({"age": 3}, "age is 3; a number from 18 up to 120 is expected"),
        ({"age": True}, "age is True; a number"),
        ({"age": float("nan")}, "age is nan; a number"),
        ({"age": "30"}, "age is '30'; a number"),
        ({"age": 30, "remark": 4}, "remark is 4; a text is expected"),
        ({"age": 30, "remark": "x" * 5001}, "remark has 5001 characters"),
        ({"age": 30, "hobby": 1}, "there is no question 'hobby'"),
    ],
)
def test_an_answer_that_does_not_fit_is_refused(arrive: Arrive, values: dict[str, object], problem: str) -> None:
    participant = arrive()
    participant.read("page-1")
    participant.consent("consent", [True, True])
    with pytest.raises(ValueError, match=problem):
        participant.answer("demographics", values)
    assert participant.step.id == "demographics"


def test_a_number_without_limits_is_a_number() -> None:
    question = Number(name="height", kind="number", question="Your height")
    assert checked_answers([question], {"height": 1.7}) == {"height": 1.7}
    with pytest.raises(ValueError, match="height is 'tall'; a number is expected"):
        checked_answers([question], {"height": "tall"})


@pytest.mark.parametrize(
    ("value", "problem"),
    [
        (3, "a number for each item"),
        (WARMTH | {"happy": 10}, "rosas.happy is 10; a number from 1 to 9"),
        (WARMTH | {"capable": 1}, "rosas has no item 'capable'"),
        ({"happy": 1}, "rosas.feeling is not answered"),
    ],
)
def test_a_table_is_answered_in_each_row(arrive: Arrive, value: object, problem: str) -> None:
    from sonata2d.study.answers import checked_answers

    end = arrive().study.config.end
    with pytest.raises(ValueError, match=problem):
        checked_answers(end, {"rosas": value})


def test_participants_get_the_same_scenes(arrive: Arrive) -> None:
    scenes = []
    for id in ("p1", "p2"):
        participant = arrive(id)
        prepare(participant)
        assert participant.session is not None
        scenes.append(participant.session.scene)
        participant.close()
    assert scenes[0] == scenes[1]


def test_a_cut_line_is_repaired_and_a_damaged_one_refused(arrive: Arrive, tmp_path: Path) -> None:
    arrive().read("page-1")
    path = tmp_path / "out" / "study" / "answers" / "p1.jsonl"
    with path.open("ab") as file:
        file.write(b'{"version":1,"event":"cons')
    participant = arrive()
    assert participant.step.id == "consent"
    participant.consent("consent", [True, True])
    assert arrive().step.id == "demographics"
    path.write_bytes(b"{}\n" + path.read_bytes())
    with pytest.raises(RecordError, match=r"p1\.jsonl, line 1 is not an event"):
        arrive()


def test_texts_of_a_study_may_change_and_the_rest_may_not(arrive: Arrive, study_file: Path, tmp_path: Path) -> None:
    arrive().read("page-1")
    study_file.write_text(STUDY.replace("Your age", "How old are you"))
    assert arrive().step.id == "consent"
    assert len(list((tmp_path / "out" / "study").glob("study-*.yaml"))) == 2
    for before, after in (("runs: 2", "runs: 3"), ("classes: 5", "classes: 7"), ("seed: 3", "seed: 4")):
        study_file.write_text(STUDY.replace(before, after))
        with pytest.raises(ConfigError, match="belongs to another study, or to an earlier version"):
            StudyFolder(tmp_path / "out", load_study(study_file))
    study_file.write_text(STUDY)
    (tmp_path / "room.yaml").write_text("extends: empty\n")
    with pytest.raises(ConfigError, match="belongs to another study"):
        StudyFolder(tmp_path / "out", load_study(study_file))


def test_a_study_may_change_until_somebody_comes(arrive: Arrive, study_file: Path, tmp_path: Path) -> None:
    StudyFolder(tmp_path / "out", load_study(study_file))
    assert len([*(tmp_path / "out/rated/polite").glob("0*.json")]) == 3
    study_file.write_text(STUDY.replace("count: 3", "count: 1"))
    (tmp_path / "room.yaml").write_text("extends: empty\n")
    arrive().read("page-1")
    assert len([*(tmp_path / "out/rated/polite").glob("0*.json")]) == 1
    study_file.write_text(STUDY)
    with pytest.raises(ConfigError, match="belongs to another study"):
        StudyFolder(tmp_path / "out", load_study(study_file))


def test_a_score_is_a_mean_with_opposite_items_reversed() -> None:
    config = {
        "demographics": [],
        "after_run": [],
        "end": [{"name": "felt", "scale": "godspeed", "subscales": ["safety"]}],
    }
    base = {"participant": "p1", "step": "end", "file": None, "question": "felt"}
    values = {"anxious-relaxed": 5, "agitated-calm": 4, "quiescent-surprised": 1}
    answers = [base | {"item": item, "value": value} for item, value in values.items()]
    (row,) = _score_rows(answers, config)
    assert (row["part"], row["score"], row["items"]) == ("safety", 4.6667, 3)


def test_a_participant_who_withdraws_is_deleted(arrive: Arrive, tmp_path: Path) -> None:
    out, kept = tmp_path / "out", {}
    for id in ("p1", "p1__2"):
        participant = arrive(id)
        take_part(participant)
        participant.close()
        kept[id] = {path for path in out.rglob("*") if path.is_file()} - {*kept.get("p1", ())}
    evaluate([out]).save_metrics()
    assert b"p1__2026" in (out / "metrics.json").read_bytes()
    deleted = remove_participant(out, "p1")
    # runs, practice, answers, personal answers, ratings; the lock of the runs, and metrics, which name them
    assert len(deleted) == 2 + 1 + 1 + 1 + 1 + 1 + 1
    assert not any(b"p1__2026" in path.read_bytes() for path in out.rglob("*") if path.is_file())
    assert verify(out, replay=True) == []
    left = results_of(out, personal=True)
    assert {row["participant"] for name in ("runs", "answers", "ratings") for row in left[name]} == {"p1__2"}
    assert not any(path.exists() for path in deleted)
    assert b'"p1"' not in (out / "run.jsonl").read_bytes()
    with pytest.raises(ConfigError, match="no participant 'p1'; it has p1__2"):
        remove_participant(out, "p1")
    with pytest.raises(ConfigError, match="p1 has withdrawn from the study"):
        arrive("p1")
    assert [row["participant"] for row in left["participants"]] == ["p1__2"]
