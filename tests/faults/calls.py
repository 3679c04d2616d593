"""Each call of a function that writes files fails in turn, and the power is cut at each: nothing is lost or half done.

After SQLite's tests of I/O errors: the number of calls is counted first; then, for every k, the k-th call fails in a
run of its own. A function may raise an error of the library, or succeed with all of its result. Repeating it then gives
the files of an undisturbed run.
"""

from __future__ import annotations

import os
import pickle
import re
import shutil
import tempfile
import traceback
import warnings
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any

import sonata2d as s2
from sonata2d.agents.controllers.teleoperation import DeviceMapping
from sonata2d.collect.json_lines import append_line
from sonata2d.collect.session import Session
from sonata2d.core.devices import DeviceEvent
from sonata2d.datasets import merge_datasets, mirror_dataset, split_dataset, verify, write_card
from sonata2d.errors import ConfigError, RecordError, Sonata2dError
from sonata2d.formats import export_to
from sonata2d.study.folder import StudyFolder
from sonata2d.study.load import load_study
from sonata2d.study.participant import Participant
from sonata2d.study.removal import remove_participant

from ..study.conftest import NOW, ROOM, STUDY, take_part
from .commands import contents
from .disk import Disk, PowerCut
from .table import Row

_SCENARIO = s2.load_scenario("lively").changed(rules={"time_limit": 1.0, "ends_on": ["time"]})
_DRIVEN = s2.load_scenario("empty").changed(rules={"time_limit": 0.5, "ends_on": ["time"]})


@dataclass(frozen=True)
class Trial:
    """A function that writes files.

    Attributes:
        name: for the table.
        act: what is disturbed; its argument is a folder with the data sets `a` and `b`, in which it writes.
        again: what the user does after a fault, so that all is as after an undisturbed run; by default the same.
        judge: what the user relies on after a fault, and before `again`; returns what is wrong, or nothing.
        result: what must be as after an undisturbed run; by default the hashes of all files that count.
        warns: whether the function may succeed with a warning, and leave files to `again` that describe its result.
    """

    name: str
    act: Callable[[Path], object]
    again: Callable[[Path], object] | None = None
    judge: Callable[[Path], str] = lambda folder: ""
    result: Callable[[Path], object] | None = None
    warns: bool = False


def _generate(folder: Path, **options: Any) -> None:
    resume = (folder / "out" / "manifest.json").exists()
    s2.generate_dataset(folder / "out", _SCENARIO, "straight-to-goal", episodes=3, seed=4, resume=resume, **options)


def _session(folder: Path) -> Session:
    mappings = {"pad": DeviceMapping({"left_y": ("ahead", -1.0)})}
    return Session(folder / "out", "zoe", _DRIVEN, mappings=mappings, now=lambda: datetime(2026, 1, 2, tzinfo=UTC))


def _drive(session: Session) -> Session:
    session.tick((DeviceEvent("pad0", "left_y", -0.8),))
    while session.state != "ended":
        session.tick()
    return session


def _driven(folder: Path) -> Session:
    """A session whose run has ended; a file that is not on the disk under test says so."""
    session = _drive(_session(folder))
    (folder.parent / "driven").touch()
    return session


def _repeated(function: Callable[[], object]) -> None:
    """Call a function, and once more if it fails."""
    try:
        function()
    except RecordError:
        function()


def _keep(folder: Path) -> None:
    session = _driven(folder)
    session.keep()
    session.close()


def _keep_recovered(folder: Path) -> None:
    """Keep the run that the journal holds, unless it was kept; a run that was driven to its end is never lost."""
    session = _session(folder)
    is_there = session.kept == 1 or session.state == "ended"
    assert is_there or not (folder.parent / "driven").exists(), "the run is lost"
    if session.kept == 0:
        (session if is_there else _drive(session)).keep()
    session.close()


def _keep_again(folder: Path) -> None:
    session = _driven(folder)
    _repeated(session.keep)
    session.close()


def _append_again(folder: Path) -> None:
    _repeated(lambda: append_line(folder / "lines" / "a.jsonl", {"version": 1}))
    (folder.parent / "added").touch()


def _lines(folder: Path) -> object:
    path = folder / "lines" / "a.jsonl"
    return path.read_text().splitlines() if path.exists() else []


def _append_missing(folder: Path) -> None:
    if not _lines(folder):
        append_line(folder / "lines" / "a.jsonl", {"version": 1})


def _lost_line(folder: Path) -> str:
    is_lost = (folder.parent / "added").exists() and not _lines(folder)
    return "the line is lost" if is_lost else ""


def _undo(folder: Path) -> None:
    session = _driven(folder)
    session.keep()
    session.undo()
    session.close()


def _kept_runs(folder: Path) -> object:
    return len(list((folder / "out").glob("zoe__*.json")))


def _remove(folder: Path) -> None:
    remove_participant(folder / "study", "p1")


def _remove_again(folder: Path) -> None:
    """Remove a participant, unless that is done."""
    with suppress(ConfigError):
        _remove(folder)


def _harmed(folder: Path) -> str:
    """What is wrong with the study of the other participant, whose data are as before."""
    problems = verify(folder / "study")
    kept = [path for path in (folder / "study").rglob("p2*") if path.suffix != ".lock"]
    missing = 6 - len(kept)  # practice, two runs, answers, personal answers, ratings
    expected = ("files", "complete", "counts")
    found = [str(problem) for problem in problems if not problem.is_warning and problem.place not in expected]
    return "; ".join([*found, *([f"{missing} files of p2 are missing"] if missing else [])])


def _export(folder: Path, name: str) -> None:
    if refused := export_to(folder / "a", name, folder / "out").refused:
        raise RecordError(str(refused[0]))  # as the command says it


def _damage(folder: Path) -> str:
    """The problems that `check` finds in a data set that lists files."""
    out = folder / "out"
    problems = verify(out) if (out / "manifest.json").exists() else []
    # of a run that is not finished, of files that are not listed yet, and of a card that is newer than the manifest
    expected = ("complete", "files", "counts")
    return "; ".join(str(problem) for problem in problems if not problem.is_warning and problem.place not in expected)


TRIALS = (
    Trial("generate", _generate, judge=_damage),
    Trial("generate in shards", lambda folder: _generate(folder, shard_size=2), judge=_damage),
    Trial("keep", _keep, _keep_recovered, judge=_damage, warns=True),
    Trial("keep, repeated", _keep_again, _keep_recovered, judge=_damage, result=_kept_runs, warns=True),
    Trial("undo", _undo, _keep_recovered, judge=_damage, result=_kept_runs, warns=True),
    Trial("line, repeated", _append_again, _append_missing, judge=_lost_line, result=_lines, warns=True),
    Trial("remove", _remove, _remove_again, judge=_harmed),
    Trial("merge", lambda folder: merge_datasets([folder / "a", folder / "b"], folder / "out"), judge=_damage),
    Trial("mirror", lambda folder: mirror_dataset(folder / "a", folder / "out"), judge=_damage),
    Trial("split", lambda folder: split_dataset(folder / "a", {"train": 1, "test": 1})),
    Trial("card", lambda folder: write_card(folder / "a")),
    Trial("export csv", lambda folder: _export(folder, "csv")),
    Trial("export npz", lambda folder: _export(folder, "npz")),
)


def create_sets(folder: Path) -> Path:
    """Create the data sets `a` and `b`, and `study` with two participants, and return their folder."""
    for name, seed in (("a", 1), ("b", 2)):
        s2.generate_dataset(folder / name, _SCENARIO, "straight-to-goal", episodes=2, seed=seed)
    (folder / "room.yaml").write_text(ROOM)
    path = folder / "study.yaml"
    path.write_text(STUDY.replace("folder: recorded, count: 3", "folder: a, count: 2"))
    for id in ("p1", "p2"):
        participant = Participant(StudyFolder(folder / "study", load_study(path)), id, now=lambda: NOW)
        take_part(participant)
        participant.close()
    return folder


def trials(
    sets: Path,
    functions: Iterable[Trial] = TRIALS,
    chosen: Callable[[int], list[int]] = lambda count: list(range(1, count + 1)),
) -> Iterator[Row]:
    """Disturb functions.

    Args:
        sets: folder of `create_sets`.
        functions: the functions.
        chosen: the numbers of the calls that are disturbed, given the number of calls.
    """
    for trial in functions:
        with _copy(sets) as folder:
            calls, error = _in_process(partial(_act, trial, folder))
            if trial.again and not error:
                _, error = _in_process(partial(trial.again, folder))
            assert not error, f"{trial.name}, undisturbed: {error}"
            expected = _result(trial, folder)
        rows = {kind: Row(kind, trial.name) for kind in ("call fails", "power cut", "power cut, names kept")}
        for number in chosen(len(calls)):
            for kind, row in rows.items():
                with _copy(sets) as folder:
                    is_complete = number == len(calls)
                    outcome, fault = _disturbed(trial, folder, number, kind, expected, is_complete=is_complete)
                row.add(outcome, fault and f"call {number}, {calls[number - 1]}: {fault}")
        yield from rows.values()


def _disturbed(
    trial: Trial, folder: Path, number: int, kind: str, expected: object, *, is_complete: bool
) -> tuple[str, str]:
    """The outcome of a run, and what is wrong with it; `is_complete`: the function has ended before the fault."""
    is_cut = kind != "call fails"
    _, error = _in_process(partial(_act, trial, folder, number, is_cut=is_cut, keeps_names=kind.endswith("kept")))
    if error.startswith("Traceback"):
        return "", error[-400:]
    outcome = error.partition(":")[0] or ("cut" if is_cut else "ended")
    if outcome == "ended" and not trial.warns and (found := _result(trial, folder)) != expected:
        return "", f"it succeeded with another result: {_difference(found, expected)}"
    if is_complete and not trial.warns and (found := _result(trial, folder)) != expected:
        return "", f"the power cut after its end undid it: {_difference(found, expected)}"
    found, error = _in_process(partial(trial.judge, folder))
    if error or found:
        return "", f"afterwards {error or found}"
    if trial.again or (outcome != "ended" and _result(trial, folder) != expected):  # else all was done before the fault
        _, error = _in_process(partial(trial.again or trial.act, folder))
    if error:
        return "", f"repeated: {error[-400:]}"
    found = _result(trial, folder)
    return outcome, "" if found == expected else f"repeated, {_difference(found, expected)}"


def _act(trial: Trial, folder: Path, number: int = 0, *, is_cut: bool = False, keeps_names: bool = False) -> list[str]:
    with Disk(folder, number, is_cut) as disk:
        try:
            trial.act(folder)
            with suppress(OSError):
                (folder / "after").mkdir()  # a call after the last one, at which the power is cut, too
        except PowerCut:
            pass
        except BaseException:
            if not disk.is_off:
                raise
    if disk.is_off:
        disk.lose(keeps_names=keeps_names)
    return disk.calls


def _in_process(function: Callable[[], Any]) -> tuple[Any, str]:
    """The result of a function in a process of its own, whose end releases locks, and the text of its error.

    An error of the library is one line; any other one a traceback.
    """
    reading, writing = os.pipe()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # other threads of this process do not matter to the child
        child = os.fork()
    if child == 0:
        try:
            answer: tuple[Any, str] = function(), ""
        except Sonata2dError as error:
            answer = None, f"{type(error).__name__}: {error}"
        except BaseException:
            answer = None, traceback.format_exc()
        with open(writing, "wb") as pipe:
            pickle.dump(answer, pipe)
        os._exit(0)
    os.close(writing)
    with open(reading, "rb") as pipe:
        data = pipe.read()
    os.waitpid(child, 0)
    result: tuple[Any, str] = pickle.loads(data) if data else (None, "Traceback: the process died")
    return result


@contextmanager
def _copy(sets: Path) -> Iterator[Path]:
    """A folder with the data sets."""
    with tempfile.TemporaryDirectory(prefix="faults-") as folder:
        yield Path(shutil.copytree(sets, Path(folder, "work")))


def _result(trial: Trial, folder: Path) -> Any:
    """The files to compare with those of an undisturbed run, without run log, locks, temporary files, secret links."""
    if trial.result is not None:
        return trial.result(folder)
    found = contents(folder).items()
    return {name: value for name, value in found if not re.search(r"(^|/)\.|\.lock$|/links\.json$", name)}


def _difference(found: Any, expected: Any) -> str:
    if not isinstance(found, dict):
        return f"{found} instead of {expected}"
    missing, surplus = sorted(expected.keys() - found.keys()), sorted(found.keys() - expected.keys())
    changed = sorted(name for name in found.keys() & expected.keys() if found[name] != expected[name])
    return f"missing {missing}, surplus {surplus}, changed {changed}"
