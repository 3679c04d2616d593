"""The simulator in a page, run by this Python: what it needs, what it answers, and that it agrees with the server."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import zipfile
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import sonata2d as s2
from sonata2d.datasets import verify
from sonata2d.study.folder import StudyFolder
from sonata2d.study.load import load_study
from sonata2d.study.participant import Participant
from sonata2d.web.in_page import PageSimulator
from sonata2d.web.page_folder import own_archive
from sonata2d.web.participant_session import ParticipantSession

from .conftest import answered

# What Pyodide loads for the page, see `page_folder`: packages, and modules of the interpreter's site-packages.
_PACKAGES = (
    "numpy", "numpy.libs", "pymunk", "cffi", "pycparser", "orjson", "yaml", "pydantic", "pydantic_core",
    "annotated_types", "typing_inspection", "lazy_loader", "cloudpickle",
)  # fmt: skip
_PROGRAM = """
import sys
from pathlib import Path
from sonata2d.web.in_page import PageSimulator
simulator = PageSimulator(Path(sys.argv[1]))
for line in sys.stdin:
    print(simulator.answer(line), flush=True)
"""


def ask(simulator: PageSimulator, **message: Any) -> Any:
    return json.loads(simulator.answer(json.dumps(message)))


def opened(simulator: PageSimulator, **changed: Any) -> Any:
    message = {"scenario": "lively", "changes": {}, "seed": 3, "controller": "teleoperation", "code": None} | changed
    return ask(simulator, type="open", **message)


def lines_without_versions(text: str) -> list[str]:
    return [line for line in text.splitlines() if not line.startswith('"software"')]


def test_it_needs_nothing_but_its_parts(tmp_path: Path) -> None:
    with zipfile.ZipFile(BytesIO(own_archive())) as archive:
        archive.extractall(tmp_path / "parts")
    site = Path(np.__file__).parents[1]
    for path in (*map(site.joinpath, _PACKAGES), *site.glob("_cffi_backend*"), site / "typing_extensions.py"):
        if path.exists():
            (tmp_path / "parts" / path.name).symlink_to(path)
    messages = [
        {"type": "open", "scenario": "entering-room", "changes": {}, "seed": 1, "controller": "teleoperation"},
        {"type": "open", "scenario": "lively", "changes": {"wandering": 2}, "seed": 3, "controller": "social-planner"},
        *({"type": "tick", "run": 3, "number": number, "events": []} for number in range(20)),
        {"type": "stop", "run": 3},
        {"type": "file"},
    ]
    done = subprocess.run(
        [sys.executable, "-S", "-c", _PROGRAM, str(tmp_path)],  # -S: without other packages
        input="".join(json.dumps(message) + "\n" for message in messages),
        capture_output=True,
        text=True,
        env=os.environ | {"PYTHONPATH": str(tmp_path / "parts")},
        cwd=tmp_path,
        timeout=300,
        check=True,
    )
    answers = [json.loads(line) for line in done.stdout.splitlines()]
    assert [answer["type"] for answer in answers] == ["view", "view", *["tick"] * 20, "view", "file"]
    assert "<text" in _room(answers[0])  # names of rooms, without the fonts of pygame

    here = PageSimulator(tmp_path)  # compiled, with pygame
    opened(here, changes={"wandering": 2}, controller="social-planner")
    for number, answer in enumerate(answers[2:22]):
        ours = ask(here, type="tick", run=2, number=number, events=[])
        assert ours["state"] == answer["state"]
    ask(here, type="stop", run=2)
    ours = ask(here, type="file")
    assert ours["name"] == answers[-1]["name"]
    assert lines_without_versions(ours["text"]) == lines_without_versions(answers[-1]["text"])


def _room(view: Any) -> str:
    import base64

    return base64.b64decode(view["drive"]["scene"]["room"].partition(",")[2]).decode()


def test_a_file_of_the_page_replays(tmp_path: Path) -> None:
    simulator = PageSimulator(tmp_path)
    run = opened(simulator)["drive"]["run"]
    for number in range(15):
        events = [{"device": "keyboard", "control": "up", "value": 1.0}] if number == 0 else []
        ask(simulator, type="tick", run=run, number=number, events=events)
    view = ask(simulator, type="pause", run=run)["drive"]
    assert view["status"] == "paused"
    assert view["state"]["robot"][3] > 0
    ask(simulator, type="tick", run=run, number=15, events=[])
    ask(simulator, type="stop", run=run)
    answer = ask(simulator, type="file")
    path = tmp_path / answer["name"]
    path.write_text(answer["text"])
    record = s2.read_episode(path)
    assert record.outcome.status == "stopped"
    frames = list(record.frames())
    assert len(frames) == 16
    events = [event for frame in frames for event in frame.snapshot.events]
    assert [(event.control, event.value) for event in events] == [("up", 1.0), ("up", 0.0)]  # the pause released it
    assert verify(path, replay=True, rerun=True) == []


@pytest.mark.parametrize(
    ("code", "line", "words"),
    [
        ("def f(:\n", 1, "invalid syntax"),
        ("class X:\n    pass\n", None, "not a Controller class"),
        ("import nothing_of_this_name\n", 1, "nothing_of_this_name"),
    ],
)
def test_code_that_cannot_be_used_is_explained(tmp_path: Path, code: str, line: int | None, words: str) -> None:
    simulator = PageSimulator(tmp_path)
    before = opened(simulator)["drive"]["run"]
    answer = opened(simulator, controller="own", code=code)
    assert answer["type"] == "error"
    assert answer["line"] == line
    assert words in answer["text"]
    assert ask(simulator, type="tick", run=before, number=0, events=[])["ticks"] == 1  # the run before goes on


def test_an_error_while_driving_names_the_line_and_ends_the_run(tmp_path: Path) -> None:
    simulator = PageSimulator(tmp_path)
    code = "import sonata2d as s2\n\nclass A(s2.Controller):\n    def act(self, snapshot):\n        return 1 / 0\n"
    run = opened(simulator, controller="own", code=code)["drive"]["run"]
    answer = ask(simulator, type="tick", run=run, number=0, events=[])
    assert answer["type"] == "error"
    assert answer["line"] == 5
    assert "division by zero" in answer["text"]
    corrected = opened(simulator, controller="own", code=code.replace("1 / 0", "s2.Twist(0.3, 0, 0)"))["drive"]
    answer = ask(simulator, type="tick", run=corrected["run"], number=0, events=[])
    assert answer["state"]["robot"][3] > 0


def test_a_setting_that_is_refused_is_named(tmp_path: Path) -> None:
    answer = opened(PageSimulator(tmp_path), changes={"wandering": -3})
    assert answer["type"] == "error"
    assert "wandering" in answer["text"]


# -- in a study

STUDY = "title: T\npractice: {scenario: lively, runs: 1}\nruns: [{scenario: lively, runs: 2}]\nseed: 5\nredo: true\n"


class Both:
    """A session of a study, and the simulator of its page, which gets the same messages."""

    def __init__(self, folder: Path) -> None:
        (folder / "study.yaml").write_text(STUDY)
        self.study = StudyFolder(folder / "out", load_study(folder / "study.yaml"))
        self.study.add("p1")
        self.simulator, self.compared = PageSimulator(folder), 0
        self.is_paused = False
        self.connect()

    def connect(self) -> Any:
        self.session = ParticipantSession(
            Participant(self.study, "p1"),
            is_paused=lambda: self.is_paused,
            predicts=True,
            clock=lambda: 0.0,
            sleep=_no_sleep,
        )
        return self.send(type="hello", protocol=2)

    def send(self, **message: Any) -> Any:
        answer = answered(self.session, message)
        if answer["type"] == "view" and "drive" in answer:
            self.drive = answer["drive"]
            ask(self.simulator, type="follow", **self.drive["follow"])
        return answer

    def tick(self, *events: tuple[str, float]) -> Any:
        number = self.drive["ticks"]
        sent = [{"device": "keyboard", "control": control, "value": value} for control, value in events]
        own = ask(self.simulator, type="tick", run=self.drive["run"], number=number, events=sent)
        answer = self.send(
            type="tick", run=self.drive["run"], number=number, events=sent, round_trip=0.2, predicted=True
        )
        assert own["state"] == json.loads(json.dumps(answer["state"]))
        assert own["ticks"] == answer["ticks"]
        self.drive["ticks"], self.compared = answer["ticks"], self.compared + 1
        return answer


async def _no_sleep(seconds: float) -> None: ...


def test_the_page_sees_what_the_server_simulates(tmp_path: Path) -> None:
    both = Both(tmp_path)
    step = both.send(type="hello", protocol=2)["step"]
    if step["kind"] == "page":
        both.send(type="read", step=step["id"])
    for _ in range(8):
        both.tick(("up", 1.0), ("left", 1.0))
    both.send(type="pause", run=both.drive["run"])  # releases the keys
    for _ in range(9):
        answer = both.tick()
    assert answer["state"]["robot"][5] == 0.0
    both.send(type="hello", protocol=2)  # a new page, which gets the past ticks
    both.simulator = PageSimulator(tmp_path)
    both.send(type="hello", protocol=2)
    both.tick(("up", 1.0))
    both.session.participant.close()  # the server starts again
    both.connect()
    both.tick(("right", 1.0))
    both.is_paused = True  # by the researcher: the page has simulated a tick that the server refuses
    number = both.drive["ticks"]
    own = ask(both.simulator, type="tick", run=both.drive["run"], number=number, events=[])
    assert own["ticks"] == number + 1
    refused = both.send(type="tick", run=both.drive["run"], number=number)
    assert (refused["ticks"], refused["isStudyPaused"]) == (number, True)
    both.is_paused = False
    both.send(type="pause", run=both.drive["run"])  # the page asks whether it goes on
    both.tick(("up", 1.0))
    both.send(type="stop", run=both.drive["run"])
    both.send(type="redo", run=both.drive["run"])
    both.tick(("down", 1.0))
    both.send(type="stop", run=both.drive["run"])
    both.send(type="finish_practice", run=both.drive["run"])
    for _ in range(5):
        both.tick(("up", 1.0))
    both.send(type="stop", run=both.drive["run"])
    both.send(type="keep", run=both.drive["run"])
    assert both.compared > 15
    (path,) = both.study.out.glob("p1__*.json")
    record = s2.read_episode(path)
    assert record.predicted.all()
    both.session.participant.close()


def test_a_page_of_a_server_without_the_simulator_gets_no_run_to_follow(tmp_path: Path) -> None:
    both = Both(tmp_path)
    both.session.participant.close()
    session = ParticipantSession(Participant(both.study, "p1"), clock=lambda: 0.0, sleep=_no_sleep)
    view = answered(session, {"type": "hello", "protocol": 2})
    assert "follow" not in view.get("drive", {})
    session.participant.close()
