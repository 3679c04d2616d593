"""Several threads, a full disk, odd ids, damaged files."""

from __future__ import annotations

import csv
import io
import os
import signal
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import orjson
import pytest

from sonata2d.errors import ConfigError, RecordError
from sonata2d.study.answers import AnswerLog, read_answers
from sonata2d.study.folder import StudyFolder, opened_folder
from sonata2d.study.links import Links
from sonata2d.study.load import load_study
from sonata2d.study.participant import Participant
from sonata2d.study.progress import progress_of_all
from sonata2d.study.removal import remove_participant
from sonata2d.study.report import _score_rows, results_of, save_results

from .conftest import STUDY, WARMTH, drive, prepare, rate_all

Arrive = Callable[..., Participant]


def test_threads_that_ask_for_scenes_get_different_ones(study_file: Path) -> None:
    for _ in range(5):
        study = load_study(study_file)
        with ThreadPoolExecutor(4) as pool:
            numbers = list(pool.map(lambda k, study=study: study.scene_number(0, k), range(8)))
        assert numbers == list(range(8))


def test_participants_who_join_at_once_have_different_ids_and_places(study_file: Path, tmp_path: Path) -> None:
    folder = StudyFolder(tmp_path / "out", load_study(study_file))
    links = Links(tmp_path / "out" / "study")

    def join(_: int) -> str | None:
        id = folder.add_next(links.tokens(), 30)
        return None if id is None else links.add(id)

    with ThreadPoolExecutor(8) as pool:
        tokens = list(pool.map(join, range(40)))
    assert tokens.count(None) == 10
    assert len(set(tokens)) == 31
    again = StudyFolder(tmp_path / "out", load_study(study_file))
    assert again.participants == folder.participants == [f"p{k:03d}" for k in range(1, 31)]
    assert Links(tmp_path / "out" / "study").tokens() == links.tokens()


def test_an_id_that_has_a_link_is_not_given_again(study_file: Path, tmp_path: Path) -> None:
    folder = StudyFolder(tmp_path / "out", load_study(study_file))
    assert folder.add_next(["p001", "p002"]) == "p003"


@pytest.mark.skipif(os.name != "posix", reason="file sizes are limited on POSIX systems only")
def test_a_full_disk_leaves_no_half_line(tmp_path: Path) -> None:
    import resource

    log = AnswerLog(tmp_path / "p1.jsonl")
    log.append(event="begun", time="t")
    size = log.path.stat().st_size
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size + 7, limits[1]))
    try:
        with pytest.raises(RecordError, match="cannot be written"):
            log.append(event="done", time="t", step="page-1")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
        signal.signal(signal.SIGXFSZ, handler)
    assert log.path.stat().st_size == size
    log.append(event="done", time="t", step="page-1")
    assert [event["event"] for event in read_answers(log.path)] == ["begun", "done"]


@pytest.mark.parametrize("action", ["finish_practice", "discard"])
def test_a_run_that_cannot_be_put_away_is_not_counted(
    action: str, arrive: Arrive, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    participant = arrive()
    if action == "finish_practice":
        participant.read("page-1")
        participant.consent("consent", [True, True])
        participant.answer("demographics", {"age": 30})
        participant.read("practice-text")
    else:
        prepare(participant)
    drive(participant)
    session = participant.session
    assert session is not None

    def fail(*_: object, **__: object) -> None:
        raise RecordError("the disk is full")

    with monkeypatch.context() as patch:
        patch.setattr(session, "next", fail)
        with pytest.raises(RecordError):
            getattr(participant, action)()
    with pytest.raises(ValueError, match="has not ended"):
        participant.keep(0.5)
    assert participant.runs == (0, 2)
    drive(participant)
    participant.keep(0.5)
    assert participant.runs == (1, 2)
    assert len([*(tmp_path / "out" / "discarded").iterdir()]) == (1 if action == "finish_practice" else 2)


def test_a_kept_run_without_an_event_gets_one(arrive: Arrive, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    participant = arrive()
    prepare(participant)
    drive(participant)

    def fail(**_: object) -> None:
        raise RecordError("the disk is full")

    with monkeypatch.context() as patch:
        patch.setattr(participant._log, "append", fail)
        with pytest.raises(RecordError):
            participant.keep(0.5)
    participant.answer("after-run-1", {"effort": 1})
    assert [row["step"] for row in results_of(tmp_path / "out")["runs"]] == ["run-1"]


def test_removal_spares_participants_with_similar_ids(arrive: Arrive, tmp_path: Path) -> None:
    for id in ("p1", "p1.a"):
        participant = arrive(id)
        prepare(participant)
        session = participant.session
        assert session is not None
        session.tick()
        participant.close()
    remove_participant(tmp_path / "out", "p1")
    assert {path.name for path in (tmp_path / "out" / "journal").glob("*.jsonl")} == {"p1.a.jsonl"}
    again = arrive("p1.a").session
    assert again is not None
    assert again.ticks == 1


def test_spaces_around_an_id_do_not_count(arrive: Arrive, tmp_path: Path) -> None:
    participant = arrive("p9 ")
    participant.read("page-1")
    participant.close()
    assert arrive("p9").step.id == "consent"
    assert [row["participant"] for row in results_of(tmp_path / "out")["participants"]] == ["p9"]


@pytest.mark.parametrize("id", ["x" * 70, "--"])
def test_an_id_that_cannot_rate_is_refused_at_once(id: str, arrive: Arrive) -> None:
    with pytest.raises(ConfigError, match="is not a rater id"):
        arrive(id)


def test_a_damaged_file_hides_one_participant_only(arrive: Arrive, study_file: Path, tmp_path: Path) -> None:
    arrive("p1"), arrive("p2")
    (tmp_path / "out" / "study" / "answers" / "p1.jsonl").write_text("x\n")
    known, problems = progress_of_all(StudyFolder(tmp_path / "out", load_study(study_file)))
    assert list(known) == ["p2"]
    assert "p1.jsonl, line 1" in problems[0]


def test_questions_about_a_skipped_run_can_be_answered(arrive: Arrive) -> None:
    participant = arrive()
    while participant.step.id != "after-run-1":
        participant.skip(participant.step.id)
    participant.answer("after-run-1", {"effort": 1})
    assert participant.step.id == "run-2"


def test_a_large_number_is_refused(arrive: Arrive) -> None:
    participant = arrive()
    participant.read("page-1")
    participant.consent("consent", [True, True])
    for number in (10**20, 10**400):
        with pytest.raises(ValueError, match="a number from 18 up to 120 is expected"):
            participant.answer("demographics", {"age": number})


def test_a_minimum_length_that_no_run_can_have(study_file: Path) -> None:
    study_file.write_text(STUDY.replace("minimum_length: 0.5", "minimum_length: 600"))
    with pytest.raises(
        ConfigError, match=r"line 18: minimum_length is 600 s, but the runs of a scenario end after 60 s"
    ):
        load_study(study_file)


def test_scores_of_tables_with_the_same_name_in_two_sections() -> None:
    own = {"name": "felt", "kind": "likert", "points": 5, "score": True}
    items = [{"name": "calm"}, {"name": "tense", "reversed": True}]
    config = {
        "demographics": [own | {"items": [{"name": "calm", "subscale": "before"}]}],
        "after_run": [own | {"items": items}],
        "end": [{"name": "rosas", "scale": "rosas", "subscales": ["warmth"]}],
    }
    without = own | {"name": "mixed", "score": False, "items": [{"name": "easy"}, {"name": "surprised"}]}
    config["after_run"].append(without)
    answers = [
        {"participant": "p1", "step": step, "file": None, "question": question, "item": item, "value": value}
        for step, question, item, value in (
            ("demographics", "felt", "calm", 2), ("after-run-1", "felt", "calm", 5),
            ("after-run-1", "felt", "tense", 2), ("end", "rosas", "happy", 9), ("after-run-1", "mixed", "easy", 1),
        )
    ]  # fmt: skip
    rows = [(row["step"], row["part"], row["score"], row["items"]) for row in _score_rows(answers, config)]
    assert rows == [("demographics", "before", 2.0, 1), ("after-run-1", "", 4.5, 2), ("end", "warmth", 9.0, 1)]


def test_dropped_ticks_outlive_undo_and_a_crash(arrive: Arrive, tmp_path: Path) -> None:
    participant = arrive()
    prepare(participant)
    session = participant.session
    assert session is not None
    session.tick()
    session.dropped_ticks += 7
    drive(participant)
    participant.keep(0.5)
    participant.undo()
    participant.keep(0.5)
    assert [row["dropped_ticks"] for row in results_of(tmp_path / "out")["runs"]] == [7]
    participant.answer("after-run-1", {"effort": 1})
    session.tick()
    session.dropped_ticks += 3
    session.tick()
    participant.close()
    again = arrive().session
    assert again is not None
    assert again.dropped_ticks == 3


def test_a_slider_names_its_ends(study_file: Path) -> None:
    study_file.write_text(STUDY.replace("kind: text, question: Anything else", "kind: slider, question: Anything else"))
    with pytest.raises(ConfigError, match="give the meaning of both ends"):
        load_study(study_file)


def test_a_folder_with_something_else_is_refused(study_file: Path, recorded: Path, tmp_path: Path) -> None:
    study = load_study(study_file)
    with pytest.raises(RecordError, match="holds a generated data set"), opened_folder(recorded, study):
        pass
    (tmp_path / "notes").mkdir()
    (tmp_path / "notes" / "a.json").write_text("{}")
    with pytest.raises(RecordError, match=r"holds JSON files but no manifest\.json"):
        StudyFolder(tmp_path / "notes", study)
    assert not (recorded / "study").exists()
    assert not (tmp_path / "notes" / "study").exists()


def test_a_question_says_whether_its_answer_is_personal(arrive: Arrive, study_file: Path, tmp_path: Path) -> None:
    study_file.write_text(study_file.read_text().replace("maximum: 120", "maximum: 120, personal: false"))
    participant = arrive()
    prepare(participant)
    answers = {row["question"]: row["value"] for row in results_of(tmp_path / "out")["answers"]}
    assert answers == {"age": 30}
    assert "remark" in {row["question"] for row in results_of(tmp_path / "out", personal=True)["answers"]}


def test_a_whole_number(arrive: Arrive, study_file: Path) -> None:
    study_file.write_text(study_file.read_text().replace("maximum: 120", "maximum: 120, integer: true"))
    participant = arrive()
    participant.read("page-1")
    participant.consent("consent", [True, True])
    with pytest.raises(ValueError, match=r"age is 30\.5; a whole number from 18 up to 120 is expected"):
        participant.answer("demographics", {"age": 30.5})
    participant.answer("demographics", {"age": 30.0})


def test_the_state_of_a_participant_and_the_attempts_of_a_run(arrive: Arrive, tmp_path: Path) -> None:
    out = tmp_path / "out"

    def states() -> list[tuple[str, str]]:
        return [(row["state"], row["last_step"]) for row in results_of(out)["participants"]]

    participant = arrive()
    participant.read("page-1")
    participant.decline("consent")
    assert states() == [("declined", "consent")]
    participant.reconsider()
    participant.close()
    participant = arrive("p2")
    prepare(participant)
    drive(participant)
    participant.redo()
    drive(participant)
    participant.discard()
    for number in (1, 2):
        drive(participant)
        participant.keep(0.5)
        participant.answer(f"after-run-{number}", {"effort": 1})
    rate_all(participant)
    assert states() == [("begun", "consent"), ("begun", "ratings-polite")]
    participant.answer("end", {"rosas": WARMTH})
    assert states()[1] == ("finished", "end")
    assert {row["step"]: row["attempts"] for row in results_of(out)["runs"]} == {"run-1": 3, "run-2": 1}
    folder = StudyFolder(out, load_study(tmp_path / "study.yaml"))
    folder.add_next()
    assert states()[2] == ("not begun", None)


def test_the_lists_of_a_study_are_kept(study_file: Path, tmp_path: Path) -> None:
    StudyFolder(tmp_path / "out", load_study(study_file)).add("p1")
    state = orjson.loads((tmp_path / "out" / "study" / "study.json").read_bytes())
    assert (state["participants"], state["withdrawn"], len(state["versions"])) == (["p1"], [], 1)


def test_links_that_are_added_at_once_are_all_stored(tmp_path: Path) -> None:
    for round in range(10):
        links = Links(tmp_path)
        with ThreadPoolExecutor(8) as pool:
            list(pool.map(links.add, [f"r{round}p{k}" for k in range(8)]))
        assert Links(tmp_path).tokens() == links.tokens()


def test_ratings_outlast_a_correction_of_the_question(arrive: Arrive, study_file: Path, tmp_path: Path) -> None:
    participant = arrive()
    prepare(participant)
    for step in [step for step in participant.steps if step.id.startswith(("run-", "after-run-", "block-"))]:
        participant.skip(step.id)
    participant.rate(True, seconds=1.0, whole=True)
    participant.close()
    study_file.write_text(study_file.read_text().replace("Was it polite", "Was the robot polite"))
    again = arrive()
    assert again.rating is not None
    assert again.rating.done == 1
    assert again.rating.spec.question == "Was it polite"  # as the files have it; pages show the correction
    rate_all(again)
    assert len(results_of(tmp_path / "out")["ratings"]) == 3


def test_what_can_be_repeated_has_a_limit(arrive: Arrive, monkeypatch: pytest.MonkeyPatch) -> None:
    participant = arrive()
    prepare(participant)
    monkeypatch.setattr("sonata2d.study.participant._MAX_EVENTS", len(participant._log.lines) + 2)
    for _ in range(2):
        drive(participant)
        participant.redo()
    drive(participant)
    with pytest.raises(ValueError, match="reached the limit of"):
        participant.redo()
    participant.keep(0.5)  # what goes on is not limited


def test_a_line_break_begins_no_row_of_a_table(arrive: Arrive, tmp_path: Path) -> None:
    participant = arrive()
    participant.read("page-1")
    participant.consent("consent", [True, True])
    participant.answer("demographics", {"age": 30, "remark": "one\r=HYPERLINK(1)\r\nthree"})
    out = tmp_path / "out"
    counts = save_results(out, tmp_path / "tables", personal=True)
    text = (tmp_path / "tables" / "answers.csv").read_bytes().decode()
    assert '"one\n=HYPERLINK(1)\nthree"' in text
    assert counts[tmp_path / "tables" / "answers.csv"] == len(list(csv.reader(io.StringIO(text)))) - 1
    assert results_of(out)["participants"][0]["language"] == "en"


def test_a_change_of_a_study_is_named(study_file: Path, tmp_path: Path) -> None:
    StudyFolder(tmp_path / "out", load_study(study_file)).add("p1")
    study_file.write_text(study_file.read_text().replace("minimum_length: 0.5", "minimum_length: 1.5"))
    with pytest.raises(ConfigError, match=r"minimum_length was 0\.5 and is 1\.5; texts of the study file may change"):
        StudyFolder(tmp_path / "out", load_study(study_file))
