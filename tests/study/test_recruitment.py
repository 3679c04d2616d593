"""Recruitment from a panel: ids, places, balanced orders, and what makes data doubtful."""

from __future__ import annotations

import csv
import json
from collections import Counter
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from sonata2d.errors import ConfigError
from sonata2d.study.answers import WrongAnswerError
from sonata2d.study.content import step_content, way_back
from sonata2d.study.folder import StudyFolder
from sonata2d.study.load import load_study
from sonata2d.study.participant import Participant
from sonata2d.study.removal import remove_participant
from sonata2d.study.report import _flags, results_of, save_results

from .conftest import ROOM, STUDY, drive, prepare, take_part

PANEL = """\
recruitment:
  ids: [PROLIFIC_PID, STUDY_ID]
  complete: https://panel.example/done?cc=C1&pid={PROLIFIC_PID}
  declined: NO-CONSENT
  full: https://panel.example/full
  minutes: 60
"""
BLOCKS = """\
title: Doors
consent: {title: Consent, text: Runs are stored.}
runs:
  - {scenario: room.yaml}
  - {scenario: wide.yaml}
  - {scenario: dark.yaml}
order: latin-square
participants: 12
recruitment: {minutes: 30}
"""


@pytest.fixture
def panel(study_file: Path, tmp_path: Path) -> StudyFolder:
    study_file.write_text(STUDY + PANEL)
    return StudyFolder(tmp_path / "out", load_study(study_file))


def test_the_same_id_is_the_same_participant(panel: StudyFolder, study_file: Path, tmp_path: Path) -> None:
    first = panel.recruit({"PROLIFIC_PID": "5f1", "STUDY_ID": "s"})
    assert first == "p001"
    assert panel.recruit({"PROLIFIC_PID": "7a2", "STUDY_ID": "s"}) == "p002"
    assert panel.recruit({"PROLIFIC_PID": "5f1", "STUDY_ID": "other"}) == first
    again = StudyFolder(tmp_path / "out", load_study(study_file))  # after a restart
    assert again.recruit({"PROLIFIC_PID": "7a2", "STUDY_ID": "s"}) == "p002"
    assert again.recruit({"PROLIFIC_PID": "", "STUDY_ID": ""}) == "p003"
    assert again.recruit({"PROLIFIC_PID": "", "STUDY_ID": ""}) == "p004"


def test_ids_are_personal_answers(panel: StudyFolder, tmp_path: Path) -> None:
    id = panel.recruit({"PROLIFIC_PID": "5f1", "STUDY_ID": "s"})
    assert id is not None
    Participant(panel, id).close()
    assert [row for row in results_of(tmp_path / "out")["answers"] if row["step"] == "recruitment"] == []
    rows = results_of(tmp_path / "out", personal=True)["answers"]
    assert [(row["question"], row["value"]) for row in rows] == [("PROLIFIC_PID", "5f1"), ("STUDY_ID", "s")]


def test_the_way_back_is_an_address_with_the_id_or_a_code(panel: StudyFolder) -> None:
    id = panel.recruit({"PROLIFIC_PID": "a b&c", "STUDY_ID": "s"})
    assert id is not None
    participant = Participant(panel, id)
    participant.read("page-1")
    participant.decline("consent")
    assert step_content(participant)["leave"] == {"code": "NO-CONSENT"}
    participant.reconsider()
    participant.consent("consent", [True, True])
    while participant.step.kind != "thanks":
        assert "leave" not in step_content(participant)
        participant.skip(participant.step.id)
    assert step_content(participant)["leave"] == {"address": "https://panel.example/done?cc=C1&pid=a%20b%26c"}
    participant.close()
    assert way_back("C42", {}) == {"code": "C42"}


@pytest.mark.parametrize(
    ("text", "problem"),
    [("recruitment: {ids: [A, A]}", "an id is named twice"), ("recruitment: {ids: [a-b]}", "ids"),
     ("recruitment: {complete: 'https://x.example/{PID}'}", r"\{PID\} is none of the ids")],
)  # fmt: skip
def test_settings_of_the_recruitment_are_checked(study_file: Path, text: str, problem: str) -> None:
    study_file.write_text(f"{STUDY}{text}\n")
    with pytest.raises(ConfigError, match=problem):
        load_study(study_file)


def test_the_recruitment_may_change_while_the_study_runs(panel: StudyFolder, study_file: Path, tmp_path: Path) -> None:
    panel.recruit({"PROLIFIC_PID": "5f1"})
    study_file.write_text(STUDY + PANEL.replace("C1", "C2"))
    assert StudyFolder(tmp_path / "out", load_study(study_file)).participants == ["p001"]


@pytest.fixture
def doors(tmp_path: Path) -> StudyFolder:
    for name in ("room", "wide", "dark"):
        (tmp_path / f"{name}.yaml").write_text(f"{ROOM}name: {name}\n")
    (tmp_path / "doors.yaml").write_text(BLOCKS)
    return StudyFolder(tmp_path / "out", load_study(tmp_path / "doors.yaml"))


def finished(folder: StudyFolder, id: str, now: datetime) -> None:
    participant = Participant(folder, id, now=lambda: now)
    participant.consent("consent", [])
    while participant.step.kind == "run":
        drive(participant)
        participant.keep(0.5)
    participant.close()


def test_places_and_rows_count_those_who_finish_or_may_finish(doors: StudyFolder) -> None:
    """Of 40 who arrive one after the other, some decline and some leave; 12 finish, in balanced orders."""
    now, kept, refused = datetime.now(UTC), list[str](), 0
    for number in range(40):
        id = doors.recruit({}, limit=12)
        if id is None:
            refused += 1
        elif number % 3 == 1:
            participant = Participant(doors, id, now=lambda: now)
            participant.decline("consent")
            participant.close()
        elif number % 4 == 2:  # has left an hour ago
            participant = Participant(doors, id, now=lambda: now - timedelta(hours=1))
            participant.consent("consent", [])
            participant.close()
        else:
            finished(doors, id, now)
            kept.append(id)
    assert len(kept) == 12
    assert refused > 0
    rows = Counter(doors.rows[id] for id in kept)
    assert sorted(rows) == list(range(6))  # of two squares of three
    assert set(rows.values()) == {2}
    first = {doors.rows[id]: Participant(doors, id).steps[1].block for id in kept}
    assert sorted(first.values()) == [0, 0, 1, 1, 2, 2]


def test_each_participant_drives_one_block_in_a_design_between_subjects(doors: StudyFolder, tmp_path: Path) -> None:
    (tmp_path / "doors.yaml").write_text(BLOCKS.replace("latin-square", "between"))
    folder, now = StudyFolder(tmp_path / "between", load_study(tmp_path / "doors.yaml")), datetime.now(UTC)
    kept = []
    for number in range(40):
        id = folder.recruit({}, limit=12)
        if id is None:
            break
        participant = Participant(folder, id, now=lambda: now)
        if number % 3 == 1:
            participant.decline("consent")
        else:
            kept.append([step.block for step in participant.steps if step.kind == "run"])
        participant.close()
    assert all(len(blocks) == 1 for blocks in kept)
    assert Counter(block for (block,) in kept) == {0: 4, 1: 4, 2: 4}


def test_an_active_participant_holds_a_place(doors: StudyFolder) -> None:
    id = doors.recruit({}, limit=1)
    assert id is not None
    assert doors.recruit({}, limit=1) is None
    participant = Participant(doors, id)
    assert doors.recruit({}, limit=1) is None
    participant.decline("consent")
    assert doors.recruit({}, limit=1) == "p002"
    participant.close()


def test_only_runs_that_reach_the_goal_can_be_kept(study_file: Path, tmp_path: Path) -> None:
    study_file.write_text(f"{STUDY}must_reach_goal: true\nredo: false\n")
    participant = Participant(StudyFolder(tmp_path / "out", load_study(study_file)), "p1")
    prepare(participant)
    drive(participant)
    with pytest.raises(ValueError, match="the run has to reach the goal"):
        participant.keep(0.5)
    participant.redo()  # allowed, since there is no other way on
    session = participant.session
    assert session is not None
    session.stop()
    participant.close()


def test_tables_have_times_of_pages_ways_devices_and_flags(study_file: Path, tmp_path: Path) -> None:
    moments = iter(datetime(2026, 1, 1, tzinfo=UTC) + timedelta(seconds=0.4 * k) for k in range(10_000))
    folder = StudyFolder(tmp_path / "out", load_study(study_file))
    hasty = Participant(folder, "hasty", now=lambda: next(moments))
    take_part(hasty)
    hasty.close()
    save_results(tmp_path / "out", tmp_path / "tables")

    def rows(name: str) -> list[dict[str, str]]:
        with (tmp_path / "tables" / f"{name}.csv").open() as file:
            return list(csv.DictReader(file))

    pages = {row["step"]: float(row["seconds"]) for row in rows("pages")}
    assert {"page-1", "consent", "demographics", "after-run-2"} <= set(pages)
    assert all(0.0 < seconds < 60.0 for seconds in pages.values())
    for row in rows("runs"):
        assert row["device"] == "keyboard"
        assert 0.0 < float(row["path_length"]) < 1.0
    (person,) = rows("participants")
    assert person["flags"] == "6 pages under 1 s"


CHECKS = """\
title: Checks
demographics:
  - {name: attention, kind: classes, classes: [left, right, both], question: Choose both, right: 3}
  - {name: task, kind: yes_no, question: Must the robot reach the target, right: true, screen_out: true}
runs:
  - {scenario: empty}
recruitment: {screened_out: FAILED}
participants: 1
"""


def test_wrong_answers_to_checks_are_flagged_or_end_the_study(tmp_path: Path) -> None:
    (tmp_path / "checks.yaml").write_text(CHECKS)
    folder = StudyFolder(tmp_path / "out", load_study(tmp_path / "checks.yaml"))
    id = folder.recruit({}, limit=1)
    assert id is not None
    first = Participant(folder, id)
    shown = step_content(first)["questions"]
    assert all("right" not in question and "screen_out" not in question for question in shown)
    first.answer("demographics", {"attention": 3, "task": False})
    assert step_content(first) == {"id": "screened-out", "kind": "screened", "leave": {"code": "FAILED"}}
    assert first.is_finished
    with pytest.raises(ValueError, match="the present step is screened-out"):
        first.answer("demographics", {"attention": 3, "task": True})
    first.close()
    assert Participant(folder, id).step.kind == "screened"  # after a restart
    other = folder.recruit({}, limit=1)  # the place is free
    assert other == "p002"
    second = Participant(folder, other)
    second.answer("demographics", {"attention": 1, "task": True})
    assert second.step.kind == "run"
    second.close()
    rows = {row["participant"]: row for row in results_of(tmp_path / "out")["participants"]}
    assert rows["p001"]["state"] == "screened out"
    assert "1 wrong check" in rows["p002"]["flags"]


@pytest.mark.parametrize(
    ("keys", "problem"),
    [
        ("right: 4", r"attention is 4|right"),
        ("screen_out: true", "needs the right answer: right"),
        ("until_right: true", "needs the right answer: right"),
        ("right: 3, until_right: true, screen_out: true", "either ends the study or is asked for again"),
    ],
)
def test_checks_have_a_right_answer_that_fits(tmp_path: Path, keys: str, problem: str) -> None:
    (tmp_path / "checks.yaml").write_text(CHECKS.replace("right: 3", keys))
    with pytest.raises(ConfigError, match=problem):
        load_study(tmp_path / "checks.yaml")


@pytest.mark.parametrize(
    ("events", "ways", "labels", "expected"),
    [
        ([("done", 20.0), ("answers", 8.0)], [3.0, 4.0], [1, 0, 1, 1, 1], []),
        ([("done", 0.2), ("answers", 0.9), ("done", 30.0)], [3.0], [1, 0], ["2 pages under 1 s"]),
        ([("done", 20.0)], [0.0, 0.4, 3.0], [], ["2 runs without driving"]),
        ([], [], [1, 1, 1, 1, 1], ["all ratings are equal"]),
        ([], [], [1, 1, 1, 1], []),  # too few to tell
        ([("kept", None)], [3.0], [], []),
    ],
)
def test_flags_name_what_is_doubtful(
    events: list[tuple[str, float | None]], ways: list[float], labels: list[int], expected: list[str]
) -> None:
    rows = [{"event": kind} | ({} if seconds is None else {"seconds": seconds}) for kind, seconds in events]
    runs, ratings = [{"path_length": way} for way in ways], [{"label": label} for label in labels]
    assert [*_flags(rows, runs, ratings)] == expected


RULES = """\
title: Rules
practice:
  scenario: empty
  text: Reach the target.
  check: [{name: task, kind: yes_no, question: Must the robot reach the target, right: true, until_right: true}]
  must_reach_goal: true
  attempts: 3
runs:
  - {scenario: empty}
minimum_distance: 0.4
"""


def ruled(tmp_path: Path) -> Participant:
    (tmp_path / "rules.yaml").write_text(RULES)
    return Participant(StudyFolder(tmp_path / "out", load_study(tmp_path / "rules.yaml")), "p1")


def test_practice_and_comprehension_are_repeated_until_passed(tmp_path: Path) -> None:
    participant = ruled(tmp_path)
    content = step_content(participant)
    assert (content["id"], content["kind"], content["html"]) == (
        "practice-check", "questions", "<p>Reach the target.</p>\n"
    )  # fmt: skip
    assert "right" not in content["questions"][0]
    assert "until_right" not in content["questions"][0]
    for _ in range(2):
        with pytest.raises(WrongAnswerError):
            participant.answer("practice-check", {"task": False})
    assert participant.step.id == "practice-check"
    participant.answer("practice-check", {"task": True})
    for attempt in range(3):
        assert participant.step.kind == "practice"
        drive(participant)
        assert participant.broken_rule == ("must_reach_goal" if attempt < 2 else None)  # the third try may fail
        if attempt < 2:
            with pytest.raises(ValueError, match="the run has to reach the goal"):
                participant.finish_practice()
            participant.redo()
    participant.finish_practice()
    assert participant.step.kind == "run"
    participant.close()
    (row,) = results_of(tmp_path / "out")["participants"]
    assert "2 wrong checks (task 2); 1 practice run without reaching the goal" in row["flags"]


def test_a_run_without_enough_way_is_not_kept(tmp_path: Path) -> None:
    participant = ruled(tmp_path)
    participant.answer("practice-check", {"task": True})
    for _ in range(2):
        drive(participant)
        participant.redo()
    drive(participant)
    participant.finish_practice()
    assert participant.rules == {"minimum_distance": 0.4}
    drive(participant, ticks=6)
    with pytest.raises(ValueError, match=r"the robot went 0\.\d+ m; it has to go 0\.4 m or more"):
        participant.keep()
    participant.close()
    again = Participant(StudyFolder(tmp_path / "out", load_study(tmp_path / "rules.yaml")), "p1")
    assert again.broken_rule == "minimum_distance"  # the way of a run that is taken up again is known
    again.redo()
    drive(again, ticks=16)
    again.keep()
    again.close()
    (row,) = results_of(tmp_path / "out")["runs"]
    assert row["path_length"] >= 0.4


QUOTA = (
    BLOCKS.replace("latin-square", "between").replace("participants: 12", "participants: 100")
    + """\
demographics: [{name: gender, kind: classes, classes: [woman, man], question: Gender}]
quota: {question: gender, places: [12, 6]}
"""
)


def test_forty_participants_by_answer_and_condition_with_some_who_leave(doors: StudyFolder, tmp_path: Path) -> None:
    """Twice as many men arrive as women; a third declines, and every fifth leaves after the consent or a run."""
    (tmp_path / "doors.yaml").write_text(QUOTA)
    folder, now = StudyFolder(tmp_path / "quota", load_study(tmp_path / "doors.yaml")), datetime.now(UTC)
    kept, full, number = dict[str, int](), 0, 0
    while len(kept) < 18 or number < 40:
        id = folder.recruit({})
        assert id is not None
        stratum, number = int(number % 3 > 0), number + 1
        leaves = number % 5 == 0
        at = now - timedelta(hours=leaves)
        participant = Participant(folder, id, now=lambda at=at: at)  # type: ignore[misc]
        if number % 3 == 2 and number % 2:
            participant.decline("consent")
        else:
            participant.consent("consent", [])
            participant.answer("demographics", {"gender": stratum + 1})
            if participant.step.kind == "screened":
                full += 1
                assert step_content(participant)["isFull"]
            elif not leaves:
                while participant.step.kind == "run":
                    drive(participant)
                    participant.keep(0.5)
                kept[id] = stratum
        participant.close()
        assert number < 200
    assert Counter(kept.values()) == {0: 12, 1: 6}
    assert folder.quota() == [("woman", 12, 12), ("man", 6, 6)]
    assert full > 5
    again = StudyFolder(tmp_path / "quota", load_study(tmp_path / "doors.yaml"))
    assert again.rows == folder.rows
    stored = json.loads((tmp_path / "quota" / "study" / "study.json").read_text())
    assert "strata" not in stored  # answers are stored in one place only, which exports leave out
    states = Counter(row["state"] for row in results_of(tmp_path / "quota")["participants"])
    assert states["full"] == full
    conditions = {row["participant"]: row["condition"] for row in results_of(tmp_path / "quota")["participants"]}
    counts = Counter((stratum, conditions[id]) for id, stratum in kept.items())
    assert counts == {(0, name): 4 for name in ("0: room", "1: wide", "2: dark")} | {
        (1, name): 2 for name in ("0: room", "1: wide", "2: dark")
    }


@pytest.mark.parametrize(
    ("quota", "problem"),
    [
        ("{question: age, places: [1, 2]}", "'age' is no question of demographics of kind yes_no or classes"),
        ("{question: gender, places: [1, 2, 3]}", "3 numbers of places for 2 answers"),
    ],
)
def test_a_quota_needs_a_question_with_as_many_answers(tmp_path: Path, quota: str, problem: str) -> None:
    for name in ("room", "wide", "dark"):
        (tmp_path / f"{name}.yaml").write_text(ROOM)
    text = QUOTA[: QUOTA.index("quota:")] + f"quota: {quota}\n"
    (tmp_path / "study.yaml").write_text(text)
    with pytest.raises(ConfigError, match=problem):
        load_study(tmp_path / "study.yaml")


def test_devices_are_in_the_table_of_participants(panel: StudyFolder, tmp_path: Path) -> None:
    id = panel.recruit({})
    assert id is not None
    participant = Participant(panel, id)
    participant.device("1440x900", "1200x700", touch=False)
    participant.device("1440x900", "1200x700", touch=False)  # the page is loaded again
    participant.device("360x740", "360x600", touch=True)
    participant.close()
    (row,) = results_of(tmp_path / "out")["participants"]
    assert (row["screen"], row["window"], row["touch"]) == ("360x740", "360x600", True)
    assert sum(line["event"] == "device" for line in participant._log.lines) == 2


def test_a_study_that_began_before_a_setting_existed_goes_on(study_file: Path, tmp_path: Path) -> None:
    folder = StudyFolder(tmp_path / "out", load_study(study_file))
    folder.add("p1")
    path = tmp_path / "out" / "study" / "study.json"
    state = json.loads(path.read_text())
    practice, end = state["structure"]["config"]["practice"], state["structure"]["config"]["demographics"]
    assert not {"check", "must_reach_goal", "attempts"} & set(practice)
    end[0] |= {"screen_out": False}  # as of 0.4.0.dev, which stored it
    path.write_text(json.dumps(state))
    assert StudyFolder(tmp_path / "out", load_study(study_file)).participants == ["p1"]


def test_a_person_who_withdraws_leaves_a_place_and_no_answer(doors: StudyFolder, tmp_path: Path) -> None:
    (tmp_path / "doors.yaml").write_text(QUOTA.replace("[12, 6]", "[12, 1]"))
    folder = StudyFolder(tmp_path / "quota", load_study(tmp_path / "doors.yaml"))

    def arrive() -> str:
        id = folder.recruit({})
        assert id is not None
        participant = Participant(folder, id)
        participant.consent("consent", [])
        participant.answer("demographics", {"gender": 2})
        participant.close()
        return participant.step.kind

    assert [arrive(), arrive()] == ["run", "screened"]
    remove_participant(tmp_path / "quota", "p001")
    folder = StudyFolder(tmp_path / "quota", load_study(tmp_path / "doors.yaml"))
    assert arrive() == "run"
    files = [path.read_text() for path in (tmp_path / "quota" / "study").rglob("*.json*")]
    assert not any('"p001": 1' in text for text in files)


def test_among_equal_rows_of_an_answer_the_least_used_of_all_is_taken(doors: StudyFolder, tmp_path: Path) -> None:
    (tmp_path / "doors.yaml").write_text(QUOTA)
    folder, blocks = StudyFolder(tmp_path / "quota", load_study(tmp_path / "doors.yaml")), []
    for gender in (1, 2, 1):
        id = folder.recruit({})
        assert id is not None
        participant = Participant(folder, id)
        participant.consent("consent", [])
        participant.answer("demographics", {"gender": gender})
        blocks.append(participant.step.block)
        participant.close()
    assert sorted(blocks) == [0, 1, 2]


def test_a_wrong_answer_that_ends_the_study_is_not_asked_for_again(tmp_path: Path) -> None:
    (tmp_path / "both.yaml").write_text(CHECKS.replace("right: 3", "right: 3, until_right: true"))
    participant = Participant(StudyFolder(tmp_path / "out", load_study(tmp_path / "both.yaml")), "p1")
    participant.answer("demographics", {"attention": 1, "task": False})
    assert participant.step.kind == "screened"
    participant.close()


def test_scores_can_be_asked_for_while_a_study_runs(study_file: Path, tmp_path: Path) -> None:
    table = "  - {name: felt, kind: likert, question: Q, items: {a: A, b: B}}\n"
    study_file.write_text(STUDY.replace("end:\n", "end:\n" + table))
    StudyFolder(tmp_path / "out", load_study(study_file)).add("p1")
    study_file.write_text(STUDY.replace("end:\n", "end:\n" + table.replace("}}", "}, score: true}")))
    StudyFolder(tmp_path / "out", load_study(study_file))
    state = json.loads((tmp_path / "out" / "study" / "study.json").read_text())
    assert state["structure"]["config"]["end"][0]["score"] is True


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        (
            RULES.replace("minimum_distance: 0.4", "minimum_distance: 1000"),
            "minimum_distance is 1000 m, but the robot of",
        ),
        (
            RULES.replace("until_right: true}]", "until_right: true}, {name: task, kind: text, question: Q}]"),
            r"practice.check.1.name: two questions have the name 'task'",
        ),
    ],
)
def test_rules_that_cannot_be_met_are_refused(tmp_path: Path, text: str, problem: str) -> None:
    (tmp_path / "rules.yaml").write_text(text)
    with pytest.raises(ConfigError, match=problem):
        load_study(tmp_path / "rules.yaml")
