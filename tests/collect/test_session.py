"""A sitting at the controls: nothing that a person did is lost, and what is kept can be proven."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import textwrap
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest

from sonata2d.agents.controllers.teleoperation import Hand
from sonata2d.collect.session import Session
from sonata2d.core.devices import DeviceEvent
from sonata2d.datasets.manifest import read_manifest
from sonata2d.datasets.verification import verify
from sonata2d.errors import ConfigError, RecordError, SceneError
from sonata2d.record.reader import read_episode
from sonata2d.scenegen.scenario.config import ScenarioConfig

HANDS = {"pad": Hand({"left_y": ("ahead", -1.0), "right_x": ("turn", -1.0)})}
SCENE: dict[str, Any] = {
    "room": {"kinds": "square", "side": 8},
    "humans": [2, 3],
    "relations": 0,
    "tables": 0,
    "plants": 1,
    "rules": {"time_limit": 3.0},
}


def sitting(folder: Path, contributor: str = "zoe", label: dict[str, Any] | None = None, **more: Any) -> Session:
    config = ScenarioConfig(**SCENE, **({"label": label} if label else {}))
    session = Session(folder, contributor, config, hands=HANDS, **more)
    OPENED.append(session)
    return session


OPENED: list[Session] = []


@pytest.fixture(autouse=True)
def _shut() -> Iterator[None]:
    """What a test leaves open."""
    yield
    for session in OPENED:
        session._journal.shut()
        abandon(session)
    OPENED.clear()


def drive(session: Session, ticks: int = 1000) -> None:
    """Push the stick, then hold it."""
    session.tick((DeviceEvent("pad0", "left_y", -0.8), DeviceEvent("pad0", "right_x", 0.1)))
    for _ in range(ticks - 1):
        if session.state == "ended":
            break
        session.tick()


def abandon(session: Session) -> None:
    """As if its program had been killed: nothing is closed, only the system lets go of the lock."""
    session._folder._lock.release()


def assert_sound(folder: Path, files: int) -> None:
    assert verify(folder, replay=True, rerun=True) == []
    assert len([path for path in folder.glob("*.json") if "__" in path.name]) == files


def test_kept_runs_pass_check_replay_and_rerun(tmp_path: Path) -> None:
    session = sitting(tmp_path)
    drive(session)
    first = session.keep()
    drive(session, ticks=10)
    session.stop()
    second = session.keep()
    session.close()
    assert_sound(tmp_path, files=2)
    assert [read_episode(path).outcome.status for path in (first, second)] == ["timeout", "stopped"]
    assert [read_episode(path).episode for path in (first, second)] == [0, 1]
    assert read_episode(first).contributor == "zoe"
    manifest = read_manifest(tmp_path)
    assert manifest["counts"]["contributor"] == {"zoe": 2}
    assert [file["name"] for file in manifest["files"]] == sorted([first.name, second.name])


def test_the_world_waits_for_the_first_tick(tmp_path: Path) -> None:
    session = sitting(tmp_path)
    assert (session.state, session.ticks, session.after.tick) == ("waiting", 0, 0)
    assert session.before is session.after
    drive(session, ticks=1)
    assert (session.state, session.ticks, session.after.tick) == ("driving", 1, 1)


def test_the_window_draws_between_the_last_two_looks(tmp_path: Path) -> None:
    session = sitting(tmp_path)
    drive(session, ticks=5)
    assert (session.before.tick, session.after.tick) == (4, 5)
    session.pause()
    assert (session.state, session.before.tick, session.after.tick) == ("paused", 5, 5)


def test_discarded_runs_go_to_the_bin_and_redo_brings_the_same_scene(tmp_path: Path) -> None:
    session = sitting(tmp_path)
    scene = session.scene
    drive(session, ticks=5)
    binned = session.redo()
    assert binned is not None
    assert binned.parent == tmp_path / "discarded"
    assert session.scene == scene
    assert (session.state, session.ticks) == ("waiting", 0)
    drive(session)
    discarded = session.next(reason="discarded")
    assert discarded is not None
    assert session.scene != scene
    assert session.kept == 0
    session.close()
    assert verify(tmp_path / "discarded", replay=True, rerun=True) == []
    reasons = [json.loads(line).get("reason") for line in (tmp_path / "run.jsonl").read_text().splitlines()]
    assert {"driven again", "discarded"} <= set(reasons)


def test_a_scene_that_was_not_driven_leaves_nothing(tmp_path: Path) -> None:
    session = sitting(tmp_path)
    assert session.next() is None
    assert session.redo() is None
    session.close()
    assert not (tmp_path / "discarded").exists()
    assert [path.name for path in (tmp_path / "journal").glob("*.jsonl*")] == []


def test_undo_takes_the_last_keep_back(tmp_path: Path) -> None:
    session = sitting(tmp_path)
    drive(session)
    path = session.keep()
    scene = session.scene
    place = session.undo()
    assert not path.exists()
    assert place.exists()
    assert session.kept == 0
    assert read_manifest(tmp_path)["files"] == []
    assert (session.state, session.scene.episode) == ("ended", 0)
    again = session.keep()
    assert session.scene == scene
    assert [frame.snapshot.robot for frame in read_episode(again).frames()] == [
        frame.snapshot.robot for frame in read_episode(place).frames()
    ]
    session.close()
    assert_sound(tmp_path, files=1)


def test_undo_brings_back_the_answer_and_survives_a_crash(tmp_path: Path) -> None:
    session = sitting(tmp_path, label={"kind": "slider"})
    with pytest.raises(ValueError, match="nothing was kept"):
        session.undo()
    drive(session)
    session.keep(0.25)
    drive(session, ticks=2)
    with pytest.raises(ValueError, match="under way"):
        session.undo()
    session.redo()
    session.undo()
    assert session.answered == 0.25
    abandon(session)
    again = sitting(tmp_path, label={"kind": "slider"})
    assert again.state == "ended"
    assert read_episode(again.keep(0.75)).label == 0.75
    assert_sound(tmp_path, files=1)


def test_a_crash_between_writing_a_run_and_putting_it_away_does_not_double_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for put in ("keep", "redo"):
        session = sitting(tmp_path / put)
        drive(session)
        with monkeypatch.context() as patch:
            patch.setattr(session, "_put_away", _crash)
            with pytest.raises(KeyboardInterrupt):
                getattr(session, put)()
        abandon(session)
        again = sitting(tmp_path / put)
        assert (again.state, again.ticks, again.recovered) == ("waiting", 0, None)
        assert again.kept == (put == "keep")


def _crash(*_: object, **__: object) -> None:
    raise KeyboardInterrupt


def test_a_run_ended_by_a_key_is_still_ended_after_a_crash(tmp_path: Path) -> None:
    session = sitting(tmp_path)
    drive(session, ticks=4)
    session.stop()
    abandon(session)
    again = sitting(tmp_path)
    assert (again.state, again.outcome) == (session.state, session.outcome)
    again.keep()
    assert_sound(tmp_path, files=1)


@pytest.mark.parametrize("names", [("zoe lab", "zoe_lab"), ("!!!", "???"), ("🦊", "🐻"), ("Zoe", "zoe")])
def test_nobody_is_given_somebody_else_s_run(tmp_path: Path, names: tuple[str, str]) -> None:
    drive(one := sitting(tmp_path, names[0]), ticks=5)
    other = sitting(tmp_path, names[1])
    assert (other.ticks, other.recovered) == (0, None)
    abandon(one)
    assert sitting(tmp_path, names[0]).ticks == 5


def test_two_people_at_once_leave_one_true_manifest(tmp_path: Path) -> None:
    ann, bob = sitting(tmp_path, "ann"), sitting(tmp_path, "bob")
    for session in (ann, bob):
        drive(session)
        session.keep()
    ann.undo()
    drive(bob)
    bob.keep()
    assert_sound(tmp_path, files=2)


def test_a_disk_that_was_full_for_a_while_leaves_no_gap(tmp_path: Path) -> None:
    session = sitting(tmp_path)
    drive(session, ticks=3)
    whole, session._journal._file = session._journal._file, FullFile()  # type: ignore[assignment]
    drive(session, ticks=3)
    assert session.trouble is not None
    session._journal._file = whole
    drive(session, ticks=2)
    assert session.trouble is None
    abandon(session)
    assert sitting(tmp_path).ticks == 8


class FullFile:
    """Takes half of what is written."""

    def seek(self, place: int) -> None: ...
    def truncate(self, size: int) -> None: ...
    def fileno(self) -> int:
        raise OSError(28, "No space left on device")

    def write(self, data: bytes) -> int:
        return len(data) // 2


@pytest.mark.parametrize("damage", ["settings", "physics", "lines", "head"])
def test_a_journal_that_cannot_go_on_is_moved_aside_and_told(tmp_path: Path, damage: str) -> None:
    session = sitting(tmp_path)
    drive(session, ticks=5)
    abandon(session)
    path = tmp_path / "journal" / "zoe.jsonl"
    head, *ticks = path.read_text().splitlines()
    if damage == "settings":
        head = head.replace('"standing"', '"stending"')
    elif damage == "physics":
        head = head.replace('"physics":', '"physics":9')
    elif damage == "lines":
        ticks[1] = ticks[1][:-5]
    path.write_text("\n".join(ticks if damage == "head" else [head, *ticks]) + "\n")
    for _ in range(2):
        again = sitting(tmp_path)
        assert (again.state, again.ticks) == ("waiting", 0)
        abandon(again)
    assert len(list((tmp_path / "journal").glob("*.aside"))) == 1


def test_an_error_at_the_start_lets_the_person_try_again(tmp_path: Path) -> None:
    packed = ScenarioConfig(room={"kinds": "square", "side": 3}, humans=40, max_layouts=1, max_attempts=2)
    with pytest.raises(SceneError):
        Session(tmp_path, "zoe", packed)
    assert sitting(tmp_path).state == "waiting"


def test_a_scene_that_cannot_be_laid_out_after_a_keep_does_not_double_the_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    session = sitting(tmp_path)
    scene = session.scene
    drive(session)

    def never(*_: object) -> None:
        raise SceneError("no free spot for table 3")

    monkeypatch.setattr("sonata2d.collect.session.generate", never)
    session.keep()
    assert (session.state, session.scene, session.kept) == ("waiting", scene, 1)
    assert "no free spot" in session.notice


def test_each_seed_is_counted_for_itself(tmp_path: Path) -> None:
    session = sitting(tmp_path)
    drive(session)
    session.keep()
    drive(session)
    session.next()
    session.close()
    other = sitting(tmp_path, seed=5)
    assert other.scene.episode == 0
    other.close()
    assert sitting(tmp_path).scene.episode == 2


def test_counters_come_from_the_files(tmp_path: Path) -> None:
    session = sitting(tmp_path)
    drive(session)
    session.keep()
    drive(session)
    session.next(reason="discarded")
    session.close()
    again = sitting(tmp_path)
    assert (again.kept, again.scene.episode) == (1, 2)
    again.close()
    other = sitting(tmp_path, "bo")
    assert (other.kept, other.scene.episode) == (0, 0)
    other.close()


def test_a_run_that_was_killed_goes_on_to_the_bit(tmp_path: Path) -> None:
    whole = sitting(tmp_path / "whole")
    drive(whole)
    expected = [frame.snapshot.robot.position for frame in read_episode(whole.keep()).frames()]
    session = sitting(tmp_path / "cut")
    drive(session, ticks=12)
    abandon(session)
    again = sitting(tmp_path / "cut")
    assert again.recovered == pytest.approx(1.2)
    assert (again.state, again.ticks) == ("paused", 12)
    drive(again)
    record = read_episode(again.keep())
    again.close()
    assert [frame.snapshot.robot.position for frame in record.frames()][:13] == expected[:13]
    assert len(record) == len(expected)
    assert_sound(tmp_path / "cut", files=1)


def test_hands_are_off_the_controls_where_a_killed_run_goes_on(tmp_path: Path) -> None:
    session = sitting(tmp_path)
    drive(session, ticks=8)
    abandon(session)
    again = sitting(tmp_path)
    again.tick()
    again.stop()
    record = read_episode(again.keep())
    assert {(e.control, e.value) for e in record.snapshot(8).events} == {("left_y", 0.0), ("right_x", 0.0)}
    assert record.command[8].tolist() == [0.0, 0.0, 0.0]
    assert_sound(tmp_path, files=1)


def test_a_journal_cut_in_mid_line_loses_that_tick_only(tmp_path: Path) -> None:
    session = sitting(tmp_path)
    drive(session, ticks=8)
    abandon(session)
    journal = tmp_path / "journal" / "zoe.jsonl"
    journal.write_bytes(journal.read_bytes()[:-10])
    again = sitting(tmp_path)
    assert again.ticks == 7
    drive(again, ticks=3)
    abandon(again)
    assert sitting(tmp_path).ticks == 10


def test_kill_9_loses_nothing(tmp_path: Path) -> None:
    code = f"""
        import sys
        from pathlib import Path
        from tests.collect.test_session import drive, sitting
        session = sitting(Path({str(tmp_path)!r}))
        drive(session, ticks=15)
        print("driven", flush=True)
        sys.stdin.read()
    """
    root = Path(__file__).parents[2]
    with subprocess.Popen(
        [sys.executable, "-c", textwrap.dedent(code)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, cwd=root
    ) as program:
        assert program.stdout is not None
        assert program.stdout.readline() == b"driven\n"
        with pytest.raises(RecordError, match="another window of zoe"):
            sitting(tmp_path)
        os.kill(program.pid, getattr(signal, "SIGKILL", signal.SIGTERM))
    again = sitting(tmp_path)
    assert again.ticks == 15
    again.stop()
    again.keep()
    assert_sound(tmp_path, files=1)


def test_labels_per_frame_are_events_that_replay(tmp_path: Path) -> None:
    asked = {"kind": "classes", "classes": ["rude", "fine", "kind"], "when": "frame", "name": "manners"}
    session = sitting(tmp_path, label=asked)
    drive(session, ticks=3)
    session.tick((DeviceEvent("label", "value", 1.0),))
    assert session.label == 3
    session.tick()
    abandon(session)
    again = sitting(tmp_path, label=asked)
    assert again.label == 3
    again.tick()
    again.stop()
    record = read_episode(again.keep())
    assert [frame.label for frame in record.frames()] == [{"manners": None}] * 3 + [{"manners": 3}] * 3
    assert record.author.labels == {"manners": "1: rude, 2: fine, 3: kind"}
    assert_sound(tmp_path, files=1)


def test_a_label_of_the_run_is_checked_and_written(tmp_path: Path) -> None:
    session = sitting(tmp_path, label={"kind": "slider", "question": "How comfortable?"})
    drive(session)
    with pytest.raises(ValueError, match="is no label"):
        session.keep()
    with pytest.raises(ValueError, match=r"1\.5 is no label"):
        session.keep(1.5)
    record = read_episode(session.keep(0.65432))
    assert record.label == 0.6543
    assert record.label_spec.question == "How comfortable?"
    assert_sound(tmp_path, files=1)


def test_a_run_in_mid_drive_cannot_be_kept(tmp_path: Path) -> None:
    session = sitting(tmp_path)
    drive(session, ticks=2)
    with pytest.raises(ValueError, match="not ended"):
        session.keep()


def test_a_full_disk_at_keep_loses_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    session = sitting(tmp_path)
    drive(session)

    def full(path: Path, data: bytes) -> None:
        raise RecordError(f"{path} cannot be written: No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr("sonata2d.collect.collection.write_atomically", full)
        with pytest.raises(RecordError, match="No space left"):
            session.keep()
    assert session.state == "ended"
    assert session.keep().exists()
    assert_sound(tmp_path, files=1)


def test_a_journal_that_cannot_be_written_is_told_and_does_not_stop_the_run(tmp_path: Path) -> None:
    session = sitting(tmp_path)
    drive(session, ticks=2)
    os.close(session._journal._file.fileno())  # type: ignore[union-attr]
    drive(session)
    assert session.trouble is not None
    assert session.state == "ended"
    assert session.keep().exists()


@pytest.mark.parametrize("name", ["../../etc", "zoë: 🤖/lab", "x" * 300, "CON", " padded ", "名前", "a\\b|c?", "..."])
def test_odd_names_stay_in_the_folder_and_in_the_file(tmp_path: Path, name: str) -> None:
    session = sitting(tmp_path / "runs", name)
    drive(session)
    path = session.keep()
    session.close()
    assert path.parent == tmp_path / "runs"
    assert {entry.name for entry in tmp_path.iterdir()} == {"runs"}
    assert read_episode(path).contributor == name.strip()
    assert len(path.name.encode()) < 200
    assert_sound(tmp_path / "runs", files=1)
    again = sitting(tmp_path / "runs", name)
    assert (again.kept, again.scene.episode) == (1, 1)


@pytest.mark.parametrize("name", ["", "   ", "x" * 2000, "tab\there", "nul\0", "\ud800"])
def test_names_that_no_file_can_hold_are_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(ConfigError, match="contributor"):
        sitting(tmp_path, name)


def test_two_runs_of_one_second_have_two_names(tmp_path: Path) -> None:
    session = sitting(tmp_path, now=lambda: datetime(2026, 1, 2, 3, 4, 5, tzinfo=UTC))
    for _ in range(2):
        drive(session, ticks=3)
        session.redo()
    drive(session, ticks=3)
    session.stop()
    assert session.keep().name == "zoe__20260102T030405Z__000000-3.json"
    assert len(list((tmp_path / "discarded").iterdir())) == 2
    assert_sound(tmp_path, files=1)


def test_other_people_s_folders_are_left_alone(tmp_path: Path) -> None:
    (tmp_path / "notes.json").write_text("{}")
    with pytest.raises(RecordError, match="choose another folder"):
        sitting(tmp_path)
    from sonata2d.datasets.generate import generate_dataset

    generate_dataset(tmp_path / "made", ScenarioConfig(**SCENE), "straight-to-goal", episodes=1)
    with pytest.raises(RecordError, match="generated data set"):
        sitting(tmp_path / "made")


def test_other_settings_apply_from_the_next_scene_on(tmp_path: Path) -> None:
    session = sitting(tmp_path)
    session.next(session.config.changed(humans=[7, 7]))
    assert len(session.scene.humans) == 7
    drive(session)
    session.keep()
    assert len(session.scene.humans) == 7
    with pytest.raises(ConfigError, match="humans"):
        session.config.changed(humans=[7, 2])
    assert_sound(tmp_path, files=1)


def test_a_file_added_or_taken_away_by_hand_is_seen(tmp_path: Path) -> None:
    session = sitting(tmp_path)
    drive(session)
    path = session.keep()
    session.close()
    path.unlink()
    again = sitting(tmp_path)
    assert again.kept == 0
    assert read_manifest(tmp_path)["files"] == []


def test_devices_read_otherwise_apply_before_the_run_begins(tmp_path: Path) -> None:
    session = sitting(tmp_path)
    session.read_by({"pad": Hand({"left_y": ("ahead", 1.0)})})
    drive(session, ticks=3)
    assert read_command(session)[0] < 0.0
    session.read_by(HANDS)
    session.tick()
    assert read_command(session)[0] < 0.0, "not in mid-run: the file says how devices are read"


def read_command(session: Session) -> tuple[float, float, float]:
    command = session._run.past[-1].command
    return command.vx, command.vy, command.omega
