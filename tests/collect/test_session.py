"""A collection session loses nothing that was driven, and kept runs can be verified."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import textwrap
import threading
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest

from sonata2d.agents.controllers.teleoperation import DeviceMapping
from sonata2d.collect import collection
from sonata2d.collect.journal import Journal
from sonata2d.collect.session import Session
from sonata2d.core.compiled.kernel import IS_COMPILED
from sonata2d.core.devices import DeviceEvent
from sonata2d.datasets import verify
from sonata2d.datasets.manifest import read_manifest
from sonata2d.errors import ConfigError, RecordError, SceneError
from sonata2d.record.reader import read_episode
from sonata2d.scenegen.scenario.config import ScenarioConfig

MAPPINGS = {"pad": DeviceMapping({"left_y": ("ahead", -1.0), "right_x": ("turn", -1.0)})}
SCENE: dict[str, Any] = {
    "room": {"kinds": "square", "side": 8},
    "humans": [2, 3],
    "relations": 0,
    "tables": 0,
    "plants": 1,
    "rules": {"time_limit": 3.0},
}


def open_session(
    folder: Path,
    contributor: str = "zoe",
    label: dict[str, Any] | None = None,
    config: ScenarioConfig | None = None,
    **options: Any,
) -> Session:
    config = config or ScenarioConfig(**SCENE, **({"label": label} if label else {}))
    session = Session(folder, contributor, config, mappings=MAPPINGS, **options)
    SESSIONS.append(session)
    return session


SESSIONS: list[Session] = []


@pytest.fixture(autouse=True)
def _close_sessions() -> Iterator[None]:
    """Close what a test leaves open."""
    yield
    for session in SESSIONS:
        session._journal.shut()
        abandon(session)
    SESSIONS.clear()


def drive(session: Session, ticks: int = 1000) -> None:
    """Deflect the stick and hold it for a number of ticks, or to the end of the run."""
    session.tick((DeviceEvent("pad0", "left_y", -0.8), DeviceEvent("pad0", "right_x", 0.1)))
    for _ in range(ticks - 1):
        if session.state == "ended":
            break
        session.tick()


def abandon(session: Session) -> None:
    """Release the lock without closing anything, as when the program is killed."""
    session._collection._lock.release()


def assert_valid(folder: Path, files: int) -> None:
    assert verify(folder, replay=True, rerun=True) == []
    assert len([path for path in folder.glob("*.json") if "__" in path.name]) == files


def test_kept_runs_pass_check_replay_and_rerun(tmp_path: Path) -> None:
    session = open_session(tmp_path)
    drive(session)
    first = session.keep()
    drive(session, ticks=10)
    session.stop()
    second = session.keep()
    session.close()
    assert_valid(tmp_path, files=2)
    assert [read_episode(path).outcome.status for path in (first, second)] == ["timeout", "stopped"]
    assert [read_episode(path).episode for path in (first, second)] == [0, 1]
    assert read_episode(first).contributor == "zoe"
    manifest = read_manifest(tmp_path)
    assert manifest["counts"]["contributor"] == {"zoe": 2}
    assert [file["name"] for file in manifest["files"]] == sorted([first.name, second.name])


def test_the_world_waits_for_the_first_tick(tmp_path: Path) -> None:
    session = open_session(tmp_path)
    assert (session.state, session.ticks, session.after.tick) == ("waiting", 0, 0)
    assert session.before is session.after
    drive(session, ticks=1)
    assert (session.state, session.ticks, session.after.tick) == ("driving", 1, 1)


def test_before_and_after_are_the_last_two_snapshots(tmp_path: Path) -> None:
    session = open_session(tmp_path)
    drive(session, ticks=5)
    assert (session.before.tick, session.after.tick) == (4, 5)
    session.pause()
    assert (session.state, session.before.tick, session.after.tick) == ("paused", 5, 5)


def test_redo_repeats_the_scene_and_discarded_runs_are_stored_apart(tmp_path: Path) -> None:
    session = open_session(tmp_path)
    scene = session.scene
    drive(session, ticks=5)
    first = session.redo()
    assert first is not None
    assert first.parent == tmp_path / "discarded"
    assert session.scene == scene
    assert (session.state, session.ticks) == ("waiting", 0)
    drive(session)
    assert session.next(reason="discarded") is not None
    assert session.scene != scene
    assert session.kept == 0
    session.close()
    assert verify(tmp_path / "discarded", replay=True, rerun=True) == []
    reasons = [json.loads(line).get("reason") for line in (tmp_path / "run.jsonl").read_text().splitlines()]
    assert {"driven again", "discarded"} <= set(reasons)


def test_a_scene_without_ticks_leaves_no_file(tmp_path: Path) -> None:
    session = open_session(tmp_path)
    assert session.next() is None
    assert session.redo() is None
    session.close()
    assert not (tmp_path / "discarded").exists()
    assert [path.name for path in (tmp_path / "journal").glob("*.jsonl*")] == []


def test_undo_makes_the_last_kept_run_present_again(tmp_path: Path) -> None:
    session = open_session(tmp_path)
    drive(session)
    path = session.keep()
    scene = session.scene
    discarded = session.undo()
    assert not path.exists()
    assert discarded.exists()
    assert session.kept == 0
    assert read_manifest(tmp_path)["files"] == []
    assert (session.state, session.scene.episode) == ("ended", 0)
    again = session.keep()
    assert session.scene == scene
    assert [frame.snapshot.robot for frame in read_episode(again).frames()] == [
        frame.snapshot.robot for frame in read_episode(discarded).frames()
    ]
    session.close()
    assert_valid(tmp_path, files=1)


def test_undo_restores_the_label_and_survives_a_crash(tmp_path: Path) -> None:
    session = open_session(tmp_path, label={"kind": "slider"})
    with pytest.raises(ValueError, match="nothing was kept"):
        session.undo()
    drive(session)
    session.keep(0.25)
    drive(session, ticks=2)
    with pytest.raises(ValueError, match="another run has begun"):
        session.undo()
    session.redo()
    session.undo()
    assert session.undone_label == 0.25
    abandon(session)
    again = open_session(tmp_path, label={"kind": "slider"})
    assert again.state == "ended"
    assert read_episode(again.keep(0.75)).label == 0.75
    assert_valid(tmp_path, files=1)


def test_a_crash_after_writing_a_run_does_not_duplicate_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for method in ("keep", "redo"):
        session = open_session(tmp_path / method)
        drive(session)
        with monkeypatch.context() as patch:
            patch.setattr(session, "_put_away", _crash)
            with pytest.raises(KeyboardInterrupt):
                getattr(session, method)()
        abandon(session)
        again = open_session(tmp_path / method)
        assert (again.state, again.ticks, again.recovered) == ("waiting", 0, None)
        assert again.kept == (method == "keep")


def _crash(*_: object, **__: object) -> None:
    raise KeyboardInterrupt


def test_a_stopped_run_is_still_ended_after_a_crash(tmp_path: Path) -> None:
    session = open_session(tmp_path)
    drive(session, ticks=4)
    session.stop()
    abandon(session)
    again = open_session(tmp_path)
    assert (again.state, again.outcome) == (session.state, session.outcome)
    again.keep()
    assert_valid(tmp_path, files=1)


@pytest.mark.parametrize("names", [("zoe lab", "zoe_lab"), ("!!!", "???"), ("🦊", "🐻"), ("Zoe", "zoe")])
def test_contributors_with_similar_names_have_separate_runs(tmp_path: Path, names: tuple[str, str]) -> None:
    drive(one := open_session(tmp_path, names[0]), ticks=5)
    other = open_session(tmp_path, names[1])
    assert (other.ticks, other.recovered) == (0, None)
    abandon(one)
    assert open_session(tmp_path, names[0]).ticks == 5


def test_two_contributors_at_once_leave_a_valid_manifest(tmp_path: Path) -> None:
    ann, bob = open_session(tmp_path, "ann"), open_session(tmp_path, "bob")
    for session in (ann, bob):
        drive(session)
        session.keep()
    ann.undo()
    drive(bob)
    bob.keep()
    assert_valid(tmp_path, files=2)


def test_a_run_that_is_kept_while_another_program_lists_the_folder_is_listed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    one, two = (open_session(tmp_path / "out", name) for name in ("p1", "p2"))
    for session in (one, two):
        drive(session, 5)
        session.stop()
    original, other = collection._read_rows, threading.Thread(target=two.keep)

    def read_rows(folder: Path, known: dict[str, Any]) -> dict[str, dict[str, Any]]:
        rows = original(folder, known)
        if not other.ident:
            other.start()
            other.join(0.5)  # it may finish now, or wait for its turn
        return rows

    monkeypatch.setattr(collection, "_read_rows", read_rows)
    one.keep()
    other.join()
    assert_valid(tmp_path / "out", files=2)


def test_a_temporarily_full_disk_leaves_no_gap_in_the_journal(tmp_path: Path) -> None:
    session = open_session(tmp_path)
    drive(session, ticks=3)
    file, session._journal._file = session._journal._file, FullFile()  # type: ignore[assignment]
    drive(session, ticks=3)
    assert session.journal_error is not None
    session._journal._file = file
    drive(session, ticks=2)
    assert session.journal_error is None
    abandon(session)
    assert open_session(tmp_path).ticks == 8


class FullFile:
    """Writes half of the data, like a full disk."""

    def seek(self, place: int) -> None: ...
    def truncate(self, size: int) -> None: ...
    def fileno(self) -> int:
        raise OSError(28, "No space left on device")

    def write(self, data: bytes) -> int:
        return len(data) // 2


@pytest.mark.parametrize("damage", ["settings", "physics", "lines", "head"])
def test_an_unusable_journal_is_renamed(tmp_path: Path, damage: str) -> None:
    session = open_session(tmp_path)
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
        again = open_session(tmp_path)
        assert (again.state, again.ticks) == ("waiting", 0)
        abandon(again)
    assert len(list((tmp_path / "journal").glob("*.aside"))) == 1


def test_a_session_can_be_opened_after_a_failed_attempt(tmp_path: Path) -> None:
    packed = ScenarioConfig(room={"kinds": "square", "side": 3}, humans=40, max_layouts=1, max_attempts=2)
    with pytest.raises(SceneError):
        Session(tmp_path, "zoe", packed)
    assert open_session(tmp_path).state == "waiting"


def test_a_scene_error_after_keep_does_not_duplicate_the_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    session = open_session(tmp_path)
    scene = session.scene
    drive(session)

    def fail(*_: object) -> None:
        raise SceneError("no free spot for table 3")

    monkeypatch.setattr("sonata2d.collect.session.generate", fail)
    session.keep()
    assert (session.state, session.scene, session.kept) == ("waiting", scene, 1)
    assert "no free spot" in session.notice


def test_scenes_are_counted_separately_for_each_seed(tmp_path: Path) -> None:
    session = open_session(tmp_path)
    drive(session)
    session.keep()
    drive(session)
    session.next()
    session.close()
    other = open_session(tmp_path, seed=5)
    assert other.scene.episode == 0
    other.close()
    assert open_session(tmp_path).scene.episode == 2


def test_counts_are_read_from_the_files(tmp_path: Path) -> None:
    session = open_session(tmp_path)
    drive(session)
    session.keep()
    drive(session)
    session.next(reason="discarded")
    session.close()
    again = open_session(tmp_path)
    assert (again.kept, again.scene.episode) == (1, 2)
    again.close()
    other = open_session(tmp_path, "bo")
    assert (other.kept, other.scene.episode) == (0, 0)
    other.close()


def test_a_killed_run_continues_to_the_bit(tmp_path: Path) -> None:
    whole = open_session(tmp_path / "whole")
    drive(whole)
    expected = [frame.snapshot.robot.position for frame in read_episode(whole.keep()).frames()]
    session = open_session(tmp_path / "cut")
    drive(session, ticks=12)
    abandon(session)
    again = open_session(tmp_path / "cut")
    assert again.recovered == pytest.approx(1.2)
    assert (again.state, again.ticks) == ("paused", 12)
    drive(again)
    record = read_episode(again.keep())
    again.close()
    assert [frame.snapshot.robot.position for frame in record.frames()][:13] == expected[:13]
    assert len(record) == len(expected)
    assert_valid(tmp_path / "cut", files=1)


def test_all_controls_are_released_when_a_killed_run_continues(tmp_path: Path) -> None:
    session = open_session(tmp_path)
    drive(session, ticks=8)
    abandon(session)
    again = open_session(tmp_path)
    again.tick()
    again.stop()
    record = read_episode(again.keep())
    assert {(e.control, e.value) for e in record.snapshot(8).events} == {("left_y", 0.0), ("right_x", 0.0)}
    assert record.command[8].tolist() == [0.0, 0.0, 0.0]
    assert_valid(tmp_path, files=1)


def test_an_incomplete_journal_line_loses_one_tick_only(tmp_path: Path) -> None:
    session = open_session(tmp_path)
    drive(session, ticks=8)
    abandon(session)
    journal = tmp_path / "journal" / "zoe.jsonl"
    journal.write_bytes(journal.read_bytes()[:-10])
    again = open_session(tmp_path)
    assert again.ticks == 7
    drive(again, ticks=3)
    abandon(again)
    assert open_session(tmp_path).ticks == 10


def test_sigkill_loses_no_tick(tmp_path: Path) -> None:
    code = f"""
        import sys
        from pathlib import Path
        from tests.collect.test_session import drive, open_session
        session = open_session(Path({str(tmp_path)!r}))
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
            open_session(tmp_path)
        os.kill(program.pid, getattr(signal, "SIGKILL", signal.SIGTERM))
    again = open_session(tmp_path)
    assert again.ticks == 15
    again.stop()
    again.keep()
    assert_valid(tmp_path, files=1)


def test_labels_per_frame_are_device_events_and_replay(tmp_path: Path) -> None:
    label = {"kind": "classes", "classes": ["rude", "fine", "kind"], "when": "frame", "name": "manners"}
    session = open_session(tmp_path, label=label)
    drive(session, ticks=3)
    session.tick((DeviceEvent("label", "value", 1.0),))
    assert session.label == 3
    session.tick()
    abandon(session)
    again = open_session(tmp_path, label=label)
    assert again.label == 3
    again.tick()
    again.stop()
    record = read_episode(again.keep())
    assert [frame.label for frame in record.frames()] == [{"manners": None}] * 3 + [{"manners": 3}] * 3
    assert record.controller_info.labels == {"manners": "1: rude, 2: fine, 3: kind"}
    assert_valid(tmp_path, files=1)


def test_a_label_of_the_run_is_validated_and_stored(tmp_path: Path) -> None:
    session = open_session(tmp_path, label={"kind": "slider", "question": "How comfortable?"})
    drive(session)
    with pytest.raises(ValueError, match="is not a valid label"):
        session.keep()
    with pytest.raises(ValueError, match=r"1\.5 is not a valid label"):
        session.keep(1.5)
    record = read_episode(session.keep(0.65432))
    assert record.label == 0.6543
    assert record.label_spec.question == "How comfortable?"
    assert_valid(tmp_path, files=1)


def test_a_run_that_has_not_ended_cannot_be_kept(tmp_path: Path) -> None:
    session = open_session(tmp_path)
    drive(session, ticks=2)
    with pytest.raises(ValueError, match="not ended"):
        session.keep()


def test_a_full_disk_at_keep_loses_no_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    session = open_session(tmp_path)
    drive(session)

    def full(path: Path, document: Any) -> None:
        raise RecordError(f"{path} cannot be written: No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr("sonata2d.collect.collection.write_document", full)
        with pytest.raises(RecordError, match="No space left"):
            session.keep()
    assert session.state == "ended"
    assert session.keep().exists()
    assert_valid(tmp_path, files=1)


def test_a_journal_error_is_reported_and_does_not_stop_the_run(tmp_path: Path) -> None:
    session = open_session(tmp_path)
    drive(session, ticks=2)
    os.close(session._journal._file.fileno())  # type: ignore[union-attr]
    drive(session)
    assert session.journal_error is not None
    assert session.state == "ended"
    assert session.keep().exists()


@pytest.mark.parametrize("name", ["../../etc", "zoë: 🤖/lab", "x" * 300, "CON", " padded ", "名前", "a\\b|c?", "..."])
def test_unusual_names_are_stored_within_the_folder(tmp_path: Path, name: str) -> None:
    session = open_session(tmp_path / "runs", name)
    drive(session)
    path = session.keep()
    session.close()
    assert path.parent == tmp_path / "runs"
    assert {entry.name for entry in tmp_path.iterdir()} == {"runs"}
    assert read_episode(path).contributor == name.strip()
    assert len(path.name.encode()) < 200
    assert_valid(tmp_path / "runs", files=1)
    again = open_session(tmp_path / "runs", name)
    assert (again.kept, again.scene.episode) == (1, 1)


@pytest.mark.parametrize("name", ["", "   ", "x" * 2000, "tab\there", "nul\0", "\ud800"])
def test_unusable_names_are_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(ConfigError, match="contributor"):
        open_session(tmp_path, name)


def test_runs_of_the_same_second_have_different_names(tmp_path: Path) -> None:
    session = open_session(tmp_path, now=lambda: datetime(2026, 1, 2, 3, 4, 5, tzinfo=UTC))
    for _ in range(2):
        drive(session, ticks=3)
        session.redo()
    drive(session, ticks=3)
    session.stop()
    assert session.keep().name == "zoe__20260102T030405Z__000000-3.json"
    assert len(list((tmp_path / "discarded").iterdir())) == 2
    assert_valid(tmp_path, files=1)


def test_folders_with_other_content_are_refused(tmp_path: Path) -> None:
    (tmp_path / "notes.json").write_text("{}")
    with pytest.raises(RecordError, match="choose another folder"):
        open_session(tmp_path)
    from sonata2d.datasets import generate_dataset

    generate_dataset(tmp_path / "made", ScenarioConfig(**SCENE), "straight-to-goal", episodes=1)
    with pytest.raises(RecordError, match="generated data set"):
        open_session(tmp_path / "made")


def test_new_settings_apply_from_the_next_scene_on(tmp_path: Path) -> None:
    session = open_session(tmp_path)
    session.next(session.config.changed(humans=[7, 7]))
    assert len(session.scene.humans) == 7
    drive(session)
    session.keep()
    assert len(session.scene.humans) == 7
    with pytest.raises(ConfigError, match="humans"):
        session.config.changed(humans=[7, 2])
    assert_valid(tmp_path, files=1)


def test_a_file_removed_by_hand_is_noticed(tmp_path: Path) -> None:
    session = open_session(tmp_path)
    drive(session)
    path = session.keep()
    session.close()
    path.unlink()
    again = open_session(tmp_path)
    assert again.kept == 0
    assert read_manifest(tmp_path)["files"] == []


def test_new_mappings_apply_before_the_run_begins(tmp_path: Path) -> None:
    session = open_session(tmp_path)
    session.set_mappings({"pad": DeviceMapping({"left_y": ("ahead", 1.0)})})
    drive(session, ticks=3)
    assert last_speed(session) < 0.0
    session.set_mappings(MAPPINGS)
    session.tick()
    assert last_speed(session) < 0.0, "the mappings stay during a run, because its file records them"


def last_speed(session: Session) -> float:
    """Forward speed of the last command, m/s."""
    return session._episode.past[-1].command.vx


@pytest.mark.skipif(not IS_COMPILED, reason="kernels are interpreted")
def test_nothing_is_compiled_or_loaded_while_a_person_drives(tmp_path: Path) -> None:
    program = f"""
        import gc
        from pathlib import Path

        from numba.core.registry import CPUDispatcher

        from sonata2d.collect.session import Session, warm_up
        from sonata2d.core.devices import DeviceEvent
        from sonata2d.scenegen.generator import generate
        from sonata2d.scenegen.scenario.load import load_scenario

        def ready():
            return sum(len(one.overloads) for one in gc.get_objects() if isinstance(one, CPUDispatcher))

        for scenario in ("lively", "crowded-hall"):
            config = load_scenario(scenario)
            warm_up(generate(config, 0))
            before = ready()
            session = Session(Path({str(tmp_path)!r}) / scenario, "zoe", config)
            session.tick((DeviceEvent("keyboard", "w", 1.0),))
            for _ in range(100):
                session.tick()
            session.stop()
            session.keep()
            print(before > 0, ready() - before)
    """
    done = subprocess.run([sys.executable, "-c", textwrap.dedent(program)], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["True", "0"] * 2


@pytest.mark.parametrize("is_moved", [False, True])
def test_a_crash_while_a_run_is_taken_back_loses_and_doubles_nothing(
    is_moved: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    session = open_session(tmp_path)
    drive(session)
    path = session.keep()
    move = collection.Collection.undo

    def crash(self: collection.Collection) -> Path:
        if is_moved:
            move(self)
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(collection.Collection, "undo", crash)
        with pytest.raises(KeyboardInterrupt):
            session.undo()
    abandon(session)
    again = open_session(tmp_path)
    assert (again.state, again.kept, path.exists()) == (("ended", 0, False) if is_moved else ("waiting", 1, True))
    if is_moved:
        again.keep()
    again.close()
    assert_valid(tmp_path, files=1)


def test_a_run_that_cannot_be_taken_back_stays_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    session = open_session(tmp_path)
    drive(session)
    path = session.keep()
    scene = session.scene

    def fail(*_: object) -> None:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr("sonata2d.collect.collection.os.replace", fail)
        with pytest.raises(RecordError, match="cannot be moved"):
            session.undo()
    assert (session.state, session.scene, session.kept, path.exists()) == ("waiting", scene, 1, True)
    session.undo()
    assert session.state == "ended"
    session.close()


def test_a_run_that_another_driver_takes_back_meanwhile_is_left_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    other = open_session(tmp_path, "ada")
    drive(other)
    path = other.keep()
    session = open_session(tmp_path)
    drive(session)
    stat = Path.stat

    def vanish(self: Path, **options: Any) -> os.stat_result:
        if self == path and os.path.lexists(path):
            os.rename(path, tmp_path / "taken-back")
        return stat(self, **options)

    with monkeypatch.context() as patch:
        patch.setattr(Path, "stat", vanish)
        kept = session.keep()
    assert [file["name"] for file in read_manifest(tmp_path)["files"]] == [kept.name]


def test_a_run_is_not_taken_back_without_a_journal(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    session = open_session(tmp_path)
    drive(session)
    path = session.keep()

    def fail(self: Journal) -> None:
        self.failure = "the journal cannot be written: No space left on device"

    with monkeypatch.context() as patch:
        patch.setattr(Journal, "sync", fail)
        with pytest.raises(RecordError, match="cannot be taken back: the journal cannot be written"):
            session.undo()
    assert (session.state, session.kept, path.exists()) == ("waiting", 1, True)


def test_a_run_is_taken_back_although_the_manifest_cannot_be_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    session = open_session(tmp_path)
    drive(session)
    path = session.keep()

    def fail(*_: object) -> None:
        raise RecordError("manifest.json cannot be written")

    with monkeypatch.context() as patch:
        patch.setattr(collection.Collection, "_write_manifest", fail)
        assert session.undo().exists()
    assert (session.state, session.kept, path.exists(), dict(session.kept_runs)) == ("ended", 0, False, {})
    again = session.keep()
    assert [file["name"] for file in read_manifest(tmp_path)["files"]] == [again.name]


ROBOTS: dict[str, Any] = {
    **SCENE,
    "robots": [{"count": 2, "controller": "social-planner"}],
    "rules": {"time_limit": 8.0},
}


def test_runs_among_other_robots_continue_to_the_bit_and_are_verified(tmp_path: Path) -> None:
    config = ScenarioConfig(**ROBOTS)

    def robots_of(path: Path) -> list[Any]:
        return [frame["robots"] for frame in read_episode(path).document["frames"]]

    whole = open_session(tmp_path / "whole", config=config)
    drive(whole)
    expected = robots_of(whole.keep())
    assert whole.undo()  # its recorded run is present again
    assert robots_of(whole.keep()) == expected
    session = open_session(tmp_path / "cut", config=config)
    drive(session, ticks=12)
    abandon(session)
    again = open_session(tmp_path / "cut", config=config)
    for _ in range(4):  # the driver does not move until the last tick that is compared
        again.tick()
    again.stop()
    assert robots_of(again.keep())[:14] == expected[:14]
    for folder in ("whole", "cut"):
        assert_valid(tmp_path / folder, files=1)


def test_a_driver_who_has_arrived_gives_labels_and_ends_the_run(tmp_path: Path) -> None:
    scene = SCENE | {
        "humans": 0,
        "plants": 0,
        "rules": {"time_limit": 20.0},
        "label": {"kind": "slider", "when": "frame"},
    }
    scene |= {"robot": {"pose": [-1, -3, 0]}, "goal": {"position": [0, -3], "distance": 0.1}}
    scene["robots"] = [{"pose": [-3, 3, 0], "limits": {"ahead": 0.1}, "goal": {"position": [3, 3]}}]
    session = open_session(tmp_path, config=ScenarioConfig(**scene))
    session.tick((DeviceEvent("pad0", "left_y", -1.0),))
    while not session.has_arrived:
        session.tick()
    arrived = session.ticks
    session.tick((DeviceEvent("label", "value", 0.7),))
    for _ in range(5):
        session.tick()
    assert session.state == "driving"
    session.stop()
    assert session.outcome is not None
    assert session.outcome.status == "stopped"
    record = read_episode(session.keep())
    assert [frame["command"] for frame in record.document["frames"][arrived + 1 :]] == [[0.0, 0.0, 0.0]] * 5
    assert record.labels[-1] == {"label": 0.7}
    assert_valid(tmp_path, files=1)


def test_a_run_of_several_robots_that_crashed_before_its_last_tick_ends(tmp_path: Path) -> None:
    scene = {**SCENE, "humans": 0, "robots": 2, "rules": {"time_limit": 1.0}}
    session = open_session(tmp_path, config=ScenarioConfig(**scene))
    drive(session, ticks=10)
    assert session.state == "driving"
    abandon(session)
    again = open_session(tmp_path, config=ScenarioConfig(**scene))
    assert (again.state, again.outcome and again.outcome.status) == ("ended", "timeout")
